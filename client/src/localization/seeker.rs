//! Finds where a robot is that knows nothing but its level, over as many looks as that takes.
//!
//! Every look names all places that it fits nearly as well as the best, and bounds how well any other place
//! fits (`mapfold_map::places`). The places are carried on by the wheels; what one look leaves open, the
//! next ones tell. Of a place that an earlier look did not name no more is assumed than that look's bound. So
//! the weights of all places are known or bounded at any time, and one of them is believed only when it
//! is likelier than all others together, named or not, by the odds asked for, and likelier than that the
//! robot is nowhere on its map.

use mapfold_map::geometry::{Covariance, Level, Pose, Robot, UncertainPose, difference};
use mapfold_map::places::{Found, LikelihoodField, Place, PlacesConfig, View, place_near, search};

use crate::odometry::OdometryNoise;

/// When a robot that seeks looks again, and what it believes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeekerConfig {
    /// How the wheels err.
    pub odometry: OdometryNoise,
    /// A look after less way than this tells nothing new, metres.
    pub way_min: f64,
    /// Or after less turning than this, radians.
    pub turn_min: f64,
    /// From this way on a look counts in full: nearer ones see the same things, err with them, and count by
    /// the way, metres.
    pub way_full: f64,
    /// The same of turning, radians.
    pub turn_full: f64,
    /// How much likelier a place must be than that the robot is nowhere on the map, as a logarithm.
    pub weight_min: f64,
    /// How far it must be ahead of all others in the looks that tell it apart, nat: maps are not whole.
    pub lead_min: f64,
    /// A look that adds less to its lead does not tell it apart, nat: cells, and what a map has wrong, make that much of
    /// two places that are the same, look after look.
    pub apart_min: f64,
    /// Least share of the beams of the last look that end on what is known to be occupied.
    pub hits_min: f64,
}

impl SeekerConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        odometry: OdometryNoise::STANDARD,
        way_min: 0.4,
        turn_min: 0.35,
        way_full: 1.5,
        turn_full: 1.0,
        weight_min: 3.0,
        lead_min: 6.0,
        apart_min: 2.0,
        hits_min: 0.55,
    };
}

/// A pose that may be the robot's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// The pose.
    pub level_from_robot: UncertainPose<Level, Robot>,
    /// Logarithm of how much likelier it is than that the robot is nowhere on the map.
    pub weight: f64,
    /// How far it has been ahead, look by look, of all others together with what one must fit by chance. What is
    /// not on the map may resemble the view as much as the next best place on it does: that one is another in
    /// every look, so that looks rule it out one by one, but not what is not on the map.
    pub lead: f64,
    /// Share of the beams of the last look that end on what is known to be occupied.
    pub hits: f64,
}

/// Where a robot is, as far as can be told.
#[derive(Debug, Clone, PartialEq)]
pub enum Fix {
    /// There: all other places together are less likely by the odds asked for.
    Unique(Candidate),
    /// One of these, likeliest first, or one that is not named.
    Ambiguous(Vec<Candidate>),
    /// Nothing on the map fits well enough.
    NoMatch,
}

/// Seeks one robot.
#[derive(Debug, Clone)]
pub struct Seeker {
    config: SeekerConfig,
    places: PlacesConfig,
    /// Places with their weights, in the order in which they were found.
    candidates: Vec<Candidate>,
    /// What the weight of no other place exceeds; `None` before the first look.
    rest: Option<f64>,
    /// What the wheels have counted since the last look: metres, radians.
    since: (f64, f64),
}

impl Seeker {
    /// Before the first look.
    pub fn new(config: SeekerConfig, places: PlacesConfig) -> Self {
        Self { config, places, candidates: Vec::new(), rest: None, since: (0.0, 0.0) }
    }

    /// The wheels have counted a step: the robot's pose now in its own frame before.
    pub fn moved(&mut self, step: &Pose<Robot, Robot>) {
        self.since.0 += step.position().norm();
        self.since.1 += step.heading().abs();
        let step = self.config.odometry.of_step(step);
        for candidate in &mut self.candidates {
            candidate.level_from_robot = candidate.level_from_robot.compose(&step);
        }
    }

    /// Whether a look from here would tell anything new.
    pub fn is_due(&self) -> bool {
        let (way, turn) = self.since;
        self.rest.is_none() || way >= self.config.way_min || turn >= self.config.turn_min
    }

    /// The robot has looked: where it may be now. `proposals` are poses that something else thinks of, matched
    /// landmarks for instance.
    pub fn seen(
        &mut self,
        field: &LikelihoodField,
        view: &View,
        proposals: &[Pose<Level, Robot>],
    ) -> Fix {
        let (way, turn) = std::mem::take(&mut self.since);
        let known = self.candidates.iter().map(|c| c.level_from_robot.pose);
        let proposals: Vec<_> = known.chain(proposals.iter().copied()).collect();
        let found = search(field, view, &proposals);
        let prior = -field.ln_places();
        if let Some(rest) = self.rest {
            let news = (way / self.config.way_full).max(turn / self.config.turn_full).min(1.0);
            self.weigh(field, view, &found, rest, news);
            self.rest = Some(rest + news * found.rest);
        } else {
            let new = |place: &Place| Candidate {
                level_from_robot: place.level_from_robot,
                weight: place.fit + prior,
                lead: self.lead(place, &found),
                hits: place.hits,
            };
            self.candidates = found.places.iter().map(new).collect();
            self.rest = Some(found.rest + prior);
        }
        self.drop_hopeless();
        self.fix()
    }

    /// Adds what a further look says, which counts by `news`.
    fn weigh(&mut self, field: &LikelihoodField, view: &View, found: &Found, rest: f64, news: f64) {
        let mut carried: Vec<Candidate> = Vec::with_capacity(self.candidates.len());
        let mut taken = vec![false; found.places.len()];
        for old in &self.candidates {
            let pose = &old.level_from_robot.pose;
            let named =
                found.places.iter().position(|p| self.is_same(&p.level_from_robot.pose, pose));
            let place = match named {
                Some(at) => {
                    taken[at] = true;
                    found.places[at]
                }
                None => place_near(field, view, pose),
            };
            let now = Candidate {
                level_from_robot: place.level_from_robot,
                weight: old.weight + news * place.fit,
                lead: old.lead.max(0.0) + news * self.lead(&place, found),
                hits: place.hits,
            };
            // Two that have met are one.
            let met = carried
                .iter_mut()
                .find(|c| self.is_same(&c.level_from_robot.pose, &now.level_from_robot.pose));
            match met {
                Some(met) if met.weight < now.weight => *met = now,
                Some(_) => {}
                None => carried.push(now),
            }
        }
        // What earlier looks did not name weighed no more than what was left over.
        let unnamed = found.places.iter().zip(taken).filter(|(_, taken)| !taken);
        carried.extend(unnamed.map(|(place, _)| Candidate {
            level_from_robot: place.level_from_robot,
            weight: rest + news * place.fit,
            lead: news * self.lead(place, found),
            hits: place.hits,
        }));
        self.candidates = carried;
    }

    /// How far a place is ahead of all others in one look. Where many come near the best, the view is one that
    /// the building repeats, fits spread wide, and being ahead means the less.
    fn lead(&self, place: &Place, found: &Found) -> f64 {
        let others = found.places.iter().filter(|other| {
            !self.is_same(&other.level_from_robot.pose, &place.level_from_robot.pose)
        });
        let ahead = place.fit - others.map(|other| other.fit).fold(found.rest, f64::max);
        let lead = ahead / (1.0 + (found.places.len().max(1) as f64).ln());
        if lead.abs() < self.config.apart_min { 0.0 } else { lead }
    }

    fn is_same(&self, a: &Pose<Level, Robot>, b: &Pose<Level, Robot>) -> bool {
        let (apart, turned) = self.places.apart;
        (a.position() - b.position()).norm() < apart
            && difference(a.heading(), b.heading()).abs() < turned
    }

    /// Places that are too unlikely to matter join those that are not named.
    fn drop_hopeless(&mut self) {
        let best = self.candidates.iter().map(|c| c.weight).fold(f64::NEG_INFINITY, f64::max);
        let least = best - 2.0 * (self.places.odds + self.places.margin);
        let most_kept = 2 * self.places.places_max;
        self.candidates.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let keep = self.candidates.iter().take(most_kept).take_while(|c| c.weight >= least).count();
        if let (Some(dropped), Some(rest)) = (self.candidates.get(keep), &mut self.rest) {
            *rest = rest.max(dropped.weight);
        }
        self.candidates.truncate(keep);
    }

    fn fix(&self) -> Fix {
        let rest = self.rest.unwrap_or(0.0);
        let best = self.candidates.first();
        if best.map_or(rest, |best| best.weight.max(rest)) <= self.config.weight_min {
            return Fix::NoMatch;
        }
        let Some(best) = best else { return Fix::Ambiguous(Vec::new()) };
        let others = self.candidates[1..].iter().map(|c| c.weight).chain([rest]);
        let others: f64 = others.map(|weight| (weight - best.weight).exp()).sum();
        if best.weight > self.config.weight_min
            && -others.ln() > self.places.odds
            && best.lead > self.config.lead_min
            && best.hits >= self.config.hits_min
        {
            Fix::Unique(*best)
        } else {
            Fix::Ambiguous(self.candidates.clone())
        }
    }
}

/// Deviations of a place are not less than this once it is a fix, metres and radians: cells are as large.
pub(super) fn fix_of(place: &UncertainPose<Level, Robot>) -> UncertainPose<Level, Robot> {
    let least = Covariance::from_variances([4e-4, 4e-4, 2.5e-5]);
    UncertainPose { pose: place.pose, covariance: place.covariance + least }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_that_hardly_tells_two_places_apart_does_not_count() {
        let place = |x: f64, fit: f64| {
            let covariance = Covariance::from_variances([1e-4; 3]);
            let level_from_robot = UncertainPose { pose: Pose::new(x, 0.0, 0.0), covariance };
            Place { level_from_robot, fit, hits: 0.9, throughs: 0.0, beams: 80 }
        };
        let seeker = Seeker::new(SeekerConfig::STANDARD, PlacesConfig::STANDARD);
        let lead = |other: f64| {
            let places = vec![place(0.0, 30.0), place(20.0, other)];
            seeker.lead(&places[0], &Found { places: places.clone(), rest: 6.0, blocks: 1 })
        };
        // The same hall at both ends of a building, and what cells make of that.
        assert!(lead(28.0).abs() < 1e-12 && lead(31.5).abs() < 1e-12);
        assert!(lead(22.0) > 4.0 && lead(38.0) < -4.0);
    }
}
