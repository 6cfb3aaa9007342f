//! The plain cone, as it stands in textbooks: free inside, occupied all along the arc, nothing else. What
//! every refinement has to beat.

use mapfold_client::sensor::Ring;

use super::Grid;
use crate::plane::Point;

const FREE_NAT: f64 = -0.4;
const OCCUPIED_NAT: f64 = 0.9;

/// Enters a ring's readings from a place; silent sonars free their cone to `range_max_m`.
pub(super) fn enter(grid: &mut Grid, ring: &Ring, (at, heading): (Point, f64), range_max_m: f64) {
    let half = 0.5 * ring.cone;
    for sonar in &ring.sonars {
        let (range, is_echo) = sonar.range.map_or((range_max_m, false), |range| (range, true));
        let sd = 0.03 + 0.01 * range;
        let axis = heading + sonar.robot_from_sensor.heading();
        for index in 0..grid.nats.len() {
            let p = grid.centre(index);
            let (d, angle) = (at.distance(p), (p.y - at.y).atan2(p.x - at.x) - axis);
            let off = angle.sin().atan2(angle.cos()).abs();
            if off >= half {
                continue;
            }
            let across = (-0.5 * (off / (0.5 * half)).powi(2)).exp();
            if d < range - 2.0 * sd {
                grid.nats[index] += FREE_NAT * across * (1.0 - d / range_max_m).clamp(0.1, 1.0);
            } else if is_echo && (d - range).abs() < 2.0 * sd {
                grid.nats[index] +=
                    OCCUPIED_NAT * across * (-0.5 * ((d - range) / sd).powi(2)).exp();
            }
        }
    }
}
