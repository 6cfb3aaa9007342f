//! Looks of a robot that has found its place itself wait until it has driven on without being lost.
//!
//! A tracker that is wrong, or whose robot has been carried away, notices within some metres. What was seen on
//! those metres has a wrong pose; sent at once, it would be in everybody's map.

use std::collections::VecDeque;

use super::Look;

/// Way without being lost after which a look's pose is believed, metres: within that a kidnapped robot notices
/// (`mapfold-evaluate localization`).
const BELIEVED_AFTER_M: f64 = 3.0;

/// Looks that wait.
#[derive(Debug, Default)]
pub struct Probation {
    waiting: VecDeque<Look>,
}

impl Probation {
    /// Takes a look; those that are believed now, in their order. Looks whose poses the robot did not find itself are
    /// believed at once.
    pub fn pass(&mut self, look: Look) -> Vec<Look> {
        let Some(basis) = &look.basis else { return vec![look] };
        let way = basis.way;
        self.waiting.push_back(look);
        let is_believed = |look: &Look| {
            look.basis.as_ref().is_none_or(|basis| basis.way + BELIEVED_AFTER_M <= way)
        };
        let count = self.waiting.iter().take_while(|look| is_believed(look)).count();
        self.waiting.drain(..count).collect()
    }

    /// The robot is lost, or has found another place: what waits is not to be believed, and gone. How many looks it was.
    pub fn fail(&mut self) -> u64 {
        self.waiting.drain(..).count() as u64
    }

    /// The robot stops and is not lost: what waits is believed.
    pub fn finish(&mut self) -> Vec<Look> {
        self.waiting.drain(..).collect()
    }

    /// How often the robot had found its place when the looks that wait were made.
    pub fn finds(&self) -> Option<u32> {
        self.waiting.front()?.basis.as_ref().map(|basis| basis.finds)
    }
}
