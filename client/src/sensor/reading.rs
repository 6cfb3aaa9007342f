//! Readings: scans of beams, and the echoes of a ring of sonars.

use std::f64::consts::TAU;

use mapfold_map::geometry::{Point, Pose, Robot, Sensor, unit_normal};

/// Where the beams of a scan point, in the sensor frame, counter-clockwise from `first_bearing`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanGeometry {
    /// Bearing of beam 0, radians.
    pub first_bearing: f64,
    /// Angle from one beam to the next, radians, positive.
    pub increment: f64,
}

impl ScanGeometry {
    /// Bearing of a beam, radians, not wrapped.
    pub fn bearing(&self, beam: usize) -> f64 {
        self.first_bearing + self.increment * beam as f64
    }

    /// Whether `count` beams go all the way round, so that the last is the first one's neighbour: one step
    /// from it, none if drivers repeat the first beam at the end, or two if they leave the last out.
    pub fn is_full_circle(&self, count: usize) -> bool {
        let steps_left = TAU / self.increment - count as f64 + 1.0;
        count > 2 && steps_left > -0.5 && steps_left < 2.5
    }
}

/// One sweep of a scanner.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Where the beams point.
    pub geometry: ScanGeometry,
    /// One range a beam, metres, as the sensor gave it: 0, not finite, or at or beyond `range_max`
    /// where there was no return.
    pub ranges: Vec<f64>,
    /// Ranges from here on mean "no return", metres.
    pub range_max: f64,
    /// Where the scanner sits.
    pub robot_from_sensor: Pose<Robot, Sensor>,
    /// Of how many readings each range is the mean; empty if each is one reading.
    pub repeats: Vec<u16>,
}

impl Scan {
    /// Whether a range means that something was hit, as far as the scan tells.
    pub fn is_return(&self, range: f64) -> bool {
        range.is_finite() && range > 0.0 && range < self.range_max
    }

    /// The share of a single reading's variance that the range of a beam has. The mean of what is
    /// left after some were thrown out has up to 15 % more than that of as many unsorted ones.
    pub fn variance_share(&self, beam: usize) -> f64 {
        const SORTED_OUT: f64 = 1.15;
        self.repeats
            .get(beam)
            .map_or(1.0, |count| (SORTED_OUT / f64::from((*count).max(1))).min(1.0))
    }

    /// The unit vector along a beam, in the sensor frame.
    pub fn direction(&self, beam: usize) -> Point {
        unit_normal(self.geometry.bearing(beam))
    }

    /// Whether the scan closes on itself.
    pub fn is_full_circle(&self) -> bool {
        self.geometry.is_full_circle(self.ranges.len())
    }
}

/// What one sonar of a ring heard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sonar {
    /// Where the transducer sits; it listens along its own x.
    pub robot_from_sensor: Pose<Robot, Sensor>,
    /// Distance of the first echo, metres; `None` without echo.
    pub range: Option<f64>,
    /// Whether it heard the same in the rounds of a stop, if there were several; else the range is
    /// that of the nearest echo.
    pub is_steady: bool,
}

/// What all sonars of a robot heard at about the same time.
#[derive(Debug, Clone, PartialEq)]
pub struct Ring {
    /// Full width of each cone, radians.
    pub cone: f64,
    /// The sonars in their order round the robot: neighbours here are neighbours there.
    pub sonars: Vec<Sonar>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_closes_when_one_more_beam_would_repeat_the_first() {
        let one_degree = ScanGeometry { first_bearing: 0.0, increment: 1f64.to_radians() };
        assert!(one_degree.is_full_circle(360));
        assert!(!one_degree.is_full_circle(181));
        assert!(one_degree.is_full_circle(359));
        assert!(one_degree.is_full_circle(361));
        assert!(!one_degree.is_full_circle(358));
        assert!(!one_degree.is_full_circle(362));
    }
}
