//! Plans and landmark tables on their way back in: what robots make of what the server tells.

use mapfold_map::gdb::{Free, ObjectId, Owner, PlanPoint, Surface};
use mapfold_map::geometry::Point;
use mapfold_map::landmarks::Landmark;

use super::super::number::{covariance, finite};
use super::super::violations::{Place, Violation, Violations};
use crate::v1;

/// The surfaces of a plan.
///
/// # Errors
/// What is wrong with it, place by place.
pub fn map_surfaces(plan: &v1::GdbPlan) -> Result<Vec<Surface>, Vec<Violation>> {
    let mut wrong = Violations::default();
    let root = Place::Root;
    let at = root.field("objects");
    let owners: Vec<Owner> = plan
        .objects
        .iter()
        .enumerate()
        .filter_map(|(number, object)| owner(object, &at.index(number), &mut wrong))
        .collect();
    let mut surfaces = Vec::new();
    let paths = [(&plan.outlines, "outlines", true), (&plan.sheets, "sheets", false)];
    for (paths, name, is_closed) in paths {
        let at = root.field(name);
        for (number, path) in paths.iter().enumerate() {
            let of_path = Path { corners: path, is_closed, owners: &owners };
            of_path.read(&at.index(number), &mut surfaces, &mut wrong);
        }
    }
    wrong.none_or(Some(surfaces))
}

fn owner(object: &v1::PlanObject, at: &Place<'_>, wrong: &mut Violations) -> Option<Owner> {
    let tolerance = finite(object.tolerance_m, &at.field("tolerance_m"), wrong)?;
    let trust = finite(object.trust, &at.field("trust"), wrong)?;
    if tolerance < 0.0 {
        wrong.add(&at.field("tolerance_m"), "out_of_range", "a deviation is not negative");
    }
    Some(Owner {
        id: ObjectId(object.id.into_bytes()),
        kind: object.kind.into(),
        tolerance: tolerance.max(0.0),
        trust: trust.clamp(0.0, 1.0),
    })
}

/// An outline or a sheet.
struct Path<'a> {
    corners: &'a [v1::PlanCorner],
    is_closed: bool,
    owners: &'a [Owner],
}

impl Path<'_> {
    fn read(&self, at: &Place<'_>, surfaces: &mut Vec<Surface>, wrong: &mut Violations) {
        let mut corners = Vec::with_capacity(self.corners.len());
        for (number, corner) in self.corners.iter().enumerate() {
            let at = at.index(number);
            let place = Point::from(corner.at_m);
            match (PlanPoint::nearest(&place), self.owners.get(corner.object as usize)) {
                (Some(point), Some(owner)) => corners.push((point, *owner)),
                (None, _) => wrong.add(
                    &at.field("at_m"),
                    "out_of_range",
                    "this must be a place within 10 km of the level's origin",
                ),
                (_, None) => {
                    wrong.add(&at.field("object"), "unknown_object", "there is no such object");
                }
            }
        }
        let free = if self.is_closed { Free::Left } else { Free::Both };
        let back = corners.first().copied().filter(|_| self.is_closed);
        let ends = corners.iter().skip(1).copied().chain(back);
        surfaces.extend(
            corners
                .iter()
                .zip(ends)
                .filter(|(a, b)| a.0 != b.0)
                .map(|((from, owner), (to, _))| Surface { from: *from, to, free, owner: *owner }),
        );
    }
}

/// A landmark of a table.
///
/// # Errors
/// What is wrong with it.
pub fn map_landmark(landmark: &v1::Landmark) -> Result<Landmark, Vec<Violation>> {
    let mut wrong = Violations::default();
    let root = Place::Root;
    let at = root.field("at_m");
    let place = {
        let [x, y] = [0, 1].map(|i| finite(landmark.at_m[i], &at.index(i), &mut wrong));
        x.zip(y).map(|(x, y)| Point::new(x, y))
    };
    let direction = finite(landmark.heading_rad, &root.field("heading_rad"), &mut wrong);
    let [[xx, xy, _], [yx, yy, _], [.., turn]] = landmark.covariance;
    let at = root.field("covariance");
    let of_place = covariance(&[[xx, xy], [yx, yy]], &at, &mut wrong);
    let turn = finite(turn, &at.index(2).index(2), &mut wrong);
    let read = place.zip(direction).zip(of_place.zip(turn));
    wrong.none_or(read.map(|((at, direction), (covariance, turn))| Landmark {
        kind: landmark.kind.into(),
        at,
        direction,
        covariance,
        direction_sd: turn.max(0.0).sqrt(),
    }))
}
