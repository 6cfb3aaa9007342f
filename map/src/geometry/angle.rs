//! Angles in radians, kept in (-pi, pi].

use std::f64::consts::{PI, TAU};

/// The same angle in (-pi, pi].
///
/// A finite input gives a finite output; the input -pi gives +pi. An angle that is in the interval
/// already comes back bit for bit, so that wrapping what travels changes nothing.
pub fn wrap(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let turned = angle.rem_euclid(TAU);
    // rem_euclid may round up to TAU itself for tiny negative input; both branches stay in range.
    if turned > PI { turned - TAU } else { turned }
}

/// The turn that leads from `b` to `a`, in (-pi, pi].
pub fn difference(a: f64, b: f64) -> f64 {
    wrap(a - b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrap_keeps_plus_pi_and_turns_minus_pi_into_it() {
        assert!((wrap(PI) - PI).abs() < 1e-15);
        assert!((wrap(-PI) - PI).abs() < 1e-15);
        assert!((wrap(3.0 * PI) - PI).abs() < 1e-12);
        assert!(wrap(TAU).abs() < 1e-15);
        assert!(wrap(-1e-20).abs() < 1e-15);
    }
}
