//! Surfaces probed in the scanners' evidence: is something there, or is it seen through?

use super::evidence::Scanned;
use super::surfaces::{Surface, Surfaces};
use super::{ChangeConfig, Stretch};
use crate::geometry::Point;

/// What a probe across a surface meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Met {
    /// Something occupied, or a wall of the map.
    Hit,
    /// Free cells all the way.
    Through,
    /// Neither: nobody has looked, or not often enough.
    Nothing,
}

/// What probes of one object's surface met, metres of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct OfOwner {
    /// All surface.
    pub(super) length: f64,
    /// Probes that met something or saw through.
    pub(super) probed: f64,
    /// Those that saw through.
    pub(super) through: f64,
}

impl OfOwner {
    /// Whether the whole object is gone.
    pub(super) fn is_missing(&self, config: &ChangeConfig) -> bool {
        self.through >= config.length_min
            && self.through > config.missing_share * self.probed
            && self.probed >= config.probed_share * self.length
    }
}

/// All probes of all surfaces.
#[derive(Debug)]
pub(super) struct Probed {
    met: Vec<Met>,
    /// Of each surface, where its probes begin.
    starts: Vec<usize>,
    owners: Vec<OfOwner>,
}

/// How many probes a surface has.
pub(super) fn count(surface: &Surface, step: f64) -> usize {
    (surface.length / step).round().max(1.0) as usize
}

/// Where probe `index` of a surface is, metres along it.
fn place(surface: &Surface, index: usize, count: usize) -> f64 {
    surface.length * (index as f64 + 0.5) / count as f64
}

/// What a probe meets across the surface at `p`, up to `reach` before and behind it.
pub(super) fn probe(
    scanned: &mut Scanned<'_>,
    p: &Point,
    outward: &Point,
    reach: f64,
    config: &ChangeConfig,
) -> Met {
    let steps = (2.0 * reach / (0.5 * config.resolution)).ceil() as i32;
    let mut met = Met::Through;
    for step in 0..=steps {
        let out = reach * (1.0 - 2.0 * f64::from(step) / f64::from(steps));
        let evidence = scanned.at(&(p + outward * out));
        if evidence.0 > 0 {
            return Met::Hit;
        }
        if evidence > config.free_max {
            met = Met::Nothing;
        }
    }
    met
}

impl Probed {
    /// Probes all surfaces; where walls of the map hold one (`held`, a list for each surface), it is hit.
    pub(super) fn of(
        surfaces: &Surfaces,
        held: &[Vec<bool>],
        scanned: &mut Scanned<'_>,
        config: &ChangeConfig,
    ) -> Self {
        let mut met = Vec::new();
        let mut starts = vec![0];
        let mut owners = vec![OfOwner::default(); surfaces.owners.len()];
        for (surface, held) in surfaces.all.iter().zip(held) {
            let reach = config.reach(surfaces.owners[surface.owner].tolerance);
            let count = held.len();
            let each = surface.length / count as f64;
            let of_owner = &mut owners[surface.owner];
            of_owner.length += surface.length;
            for (index, is_held) in held.iter().enumerate() {
                let p = surface.at(place(surface, index, count));
                let said = if *is_held {
                    Met::Hit
                } else {
                    probe(scanned, &p, &surface.outward(), reach, config)
                };
                of_owner.probed += if said == Met::Nothing { 0.0 } else { each };
                of_owner.through += if said == Met::Through { each } else { 0.0 };
                met.push(said);
            }
            starts.push(met.len());
        }
        Self { met, starts, owners }
    }

    pub(super) fn of_owner(&self, owner: usize) -> OfOwner {
        self.owners[owner]
    }

    fn of_surface(&self, surface: usize) -> &[Met] {
        &self.met[self.starts[surface]..self.starts[surface + 1]]
    }

    /// The stretches of an object that are seen through, and long enough to be told of; of two faces of a wall that
    /// are seen through in the same place, one.
    pub(super) fn stretches(
        &self,
        surfaces: &Surfaces,
        owner: usize,
        config: &ChangeConfig,
    ) -> Vec<Stretch> {
        // Jambs shadow the first cells beside them: what is told is a little more than what is seen through.
        let min = config.length_min.max(2.0 * config.slack);
        let mut told: Vec<Stretch> = Vec::new();
        for (index, surface) in surfaces.of_owner(owner) {
            let met = self.of_surface(index);
            let each = surface.length / met.len() as f64;
            for [from, to] in runs(met) {
                let [from, to] = [from, to].map(|end| end as f64 * each);
                if to - from < min {
                    continue;
                }
                let middle = surface.at(0.5 * (from + to));
                let is_told = told.iter().any(|stretch| {
                    let along = stretch.to - stretch.from;
                    let share = (middle - stretch.from).dot(&along) / along.norm_squared();
                    let off = (stretch.from + along * share - middle).norm();
                    (0.0..=1.0).contains(&share) && off <= stretch.depth + config.slack
                });
                if !is_told {
                    let depth = depth(surfaces, owner, surface, &middle);
                    told.push(Stretch { from: surface.at(from), to: surface.at(to), depth });
                }
            }
        }
        told
    }
}

/// Where probes one after the other saw through, a single one between them that met nothing forgiven.
fn runs(met: &[Met]) -> Vec<[usize; 2]> {
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for (index, _) in met.iter().enumerate().filter(|(_, met)| **met == Met::Through) {
        match runs.last_mut() {
            Some(run) if run[1] == index => run[1] = index + 1,
            Some(run) if run[1] + 1 == index && met[index - 1] == Met::Nothing => {
                run[1] = index + 1;
            }
            _ => runs.push([index, index + 1]),
        }
    }
    runs
}

/// Distance from a place of a surface to the object's face behind it, metres; 0 for a sheet.
fn depth(surfaces: &Surfaces, owner: usize, surface: &Surface, p: &Point) -> f64 {
    if surface.both {
        return 0.0;
    }
    let behind = surfaces.of_owner(owner).filter_map(|(_, other)| {
        let is_back = other.outward().dot(&surface.outward()) < -0.9;
        let [along, _] = other.coordinates(p);
        let depth = -surface.coordinates(&other.nearest(p))[1];
        (is_back && (0.0..=other.length).contains(&along) && depth > 0.0).then_some(depth)
    });
    behind.reduce(f64::min).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_forgives_one_probe_that_met_nothing_but_none_that_was_hit() {
        use Met::{Hit, Nothing, Through};
        let met = [Through, Nothing, Through, Through, Hit, Through, Nothing, Nothing, Through];
        assert_eq!(runs(&met), [[0, 4], [5, 6], [8, 9]]);
    }
}
