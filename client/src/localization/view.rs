//! What a scan shows, as a search for its place takes it.

use mapfold_map::geometry::{Point, unit_normal};
use mapfold_map::places::{Beam, PlacesConfig, View};
use mapfold_map::vector::{Facing, ObservedSegment};

use crate::perception::{BeamState, BeamUse, Percept};

/// Shorter walls tell no direction, metres.
const WALL_MIN_M: f64 = 0.5;

/// The view of what perception made of a scan.
pub fn view(percept: &Percept<'_>, config: &PlacesConfig) -> View {
    let Percept { scan, states, features } = *percept;
    let mut view =
        View { walls: features.segments.iter().filter_map(wall).collect(), ..View::default() };
    let from = scan.robot_from_sensor.position();
    for (beam, (range, state)) in scan.ranges.iter().zip(states).enumerate() {
        if *state != BeamState::Hit {
            continue;
        }
        let to = scan.robot_from_sensor.act(&(scan.direction(beam) * *range));
        let normal = match features.beams.get(beam) {
            Some(BeamUse::Segment(number)) => features.segments.get(*number as usize),
            _ => None,
        };
        let normal = normal.map(|segment| unit_normal(segment.line.line.alpha()));
        view.add(Beam { from, to, normal }, config);
    }
    view
}

/// From end to end with free space on the left.
fn wall(segment: &ObservedSegment) -> Option<(Point, Point)> {
    let line = &segment.line.line;
    let (low, high) = (line.at(segment.from), line.at(segment.to));
    (segment.to - segment.from >= WALL_MIN_M).then_some(match segment.facing {
        Facing::Origin => (low, high),
        Facing::Away => (high, low),
    })
}
