//! Zero-size markers that name the frame of a pose or a line.
//!
//! What they do not catch: two robots' `Odom` frames share one marker.

/// The fixed metric frame of one floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Level;

/// The frame in which a robot's wheels count, drifting against the level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Odom;

/// The robot: x ahead, y left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Robot;

/// One sensor on the robot: x along its own forward direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sensor;
