//! Sensors of a robot on their way in.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt;

use super::violations::{Place, Violation, Violations};
use crate::v1::{RangeCorrection, SensorMount, SensorProfile};

/// Sensors of one robot.
const SENSORS_MAX: usize = 32;
/// Transducers of one ring.
const TRANSDUCERS_MAX: usize = 256;
/// Longest name of a model, bytes.
const MODEL_LENGTH_MAX: usize = 128;
/// Ranges of a sensor and their deviations.
const RANGE_MAX_M: f64 = 10_000.0;
/// A sensor sits within this of its robot's centre.
const MOUNT_MAX_M: f64 = 100.0;
/// Distances of a correction table: every 10 cm up to 50 m.
const DISTANCES_MAX: usize = 512;
/// Incidences of a correction table.
const INCIDENCES_MAX: usize = 64;
/// A sensor that is off by more than this needs repair, no table.
const BIAS_MAX_M: f64 = 10.0;

/// What is wrong with the member `sensors` of a body; nothing if it is fine.
pub fn check_sensors(sensors: &[SensorProfile]) -> Vec<Violation> {
    let mut wrong = Violations::default();
    let root = Place::Root;
    let place = root.field("sensors");
    if sensors.len() > SENSORS_MAX {
        wrong.add(&place, "too_many", format_args!("a robot has at most {SENSORS_MAX} sensors"));
    }
    for (index, sensor) in sensors.iter().take(SENSORS_MAX).enumerate() {
        check_sensor(sensor, &place.index(index), &mut wrong);
    }
    wrong.all()
}

/// What is wrong with a correction table; pointers begin at the table itself.
pub fn check_correction(correction: &RangeCorrection) -> Vec<Violation> {
    let mut wrong = Violations::default();
    check_table(correction, &Place::Root, &mut wrong);
    wrong.all()
}

fn check_sensor(sensor: &SensorProfile, place: &Place<'_>, wrong: &mut Violations) {
    let length = |value: f64| value > 0.0 && value <= RANGE_MAX_M;
    let not_negative = |value: f64| (0.0..=RANGE_MAX_M).contains(&value);
    let lengths = format!("a length of more than 0 and at most {RANGE_MAX_M} m");
    let optional = |value: Option<f64>| value.is_none_or(not_negative);
    let figure = format!("not negative and at most {RANGE_MAX_M}");
    expect(length(sensor.range_max_m), &place.field("range_max_m"), &lengths, wrong);
    let nearer = sensor.range_min_m.is_none_or(|min| (0.0..sensor.range_max_m).contains(&min));
    expect(nearer, &place.field("range_min_m"), "not negative and less than range_max_m", wrong);
    expect(length(sensor.range_sd_m), &place.field("range_sd_m"), &lengths, wrong);
    expect(optional(sensor.range_sd_per_m), &place.field("range_sd_per_m"), &figure, wrong);
    expect(optional(sensor.systematic_sd_m), &place.field("systematic_sd_m"), &figure, wrong);
    let beam = sensor.beam_rad > 0.0 && sensor.beam_rad <= TAU;
    let angle = "an angle of more than 0 and at most 2 pi";
    expect(beam, &place.field("beam_rad"), angle, wrong);
    if sensor.model.len() > MODEL_LENGTH_MAX || sensor.model.chars().any(char::is_control) {
        let detail = format_args!("at most {MODEL_LENGTH_MAX} bytes without control characters");
        wrong.add(&place.field("model"), "bad_name", detail);
    }
    if let Some(mount) = &sensor.mount {
        check_mount(mount, &place.field("mount"), wrong);
    }
    let ring = place.field("transducers");
    if sensor.transducers.len() > TRANSDUCERS_MAX {
        let detail = format_args!("a ring has at most {TRANSDUCERS_MAX} transducers");
        wrong.add(&ring, "too_many", detail);
    }
    for (index, mount) in sensor.transducers.iter().take(TRANSDUCERS_MAX).enumerate() {
        check_mount(mount, &ring.index(index), wrong);
    }
    if let Some(correction) = &sensor.correction {
        check_table(correction, &place.field("correction"), wrong);
    }
}

fn check_mount(mount: &SensorMount, place: &Place<'_>, wrong: &mut Violations) {
    for (name, value) in [("x_m", mount.x_m), ("y_m", mount.y_m)] {
        let detail = format_args!("a sensor sits within {MOUNT_MAX_M} m of its robot's centre");
        expect(value.abs() <= MOUNT_MAX_M, &place.field(name), detail, wrong);
    }
    let turn = mount.heading_rad.abs() <= TAU;
    expect(turn, &place.field("heading_rad"), "an angle of at most 2 pi either way", wrong);
}

fn check_table(table: &RangeCorrection, place: &Place<'_>, wrong: &mut Violations) {
    let distances = place.field("distances_m");
    let incidences = place.field("incidences_rad");
    let (columns, rows) = (table.distances_m.len(), table.incidences_rad.len());
    if !(2..=DISTANCES_MAX).contains(&columns) {
        let detail = format_args!("a table has 2 to {DISTANCES_MAX} distances, not {columns}");
        return wrong.add(&distances, "bad_shape", detail);
    }
    if !(1..=INCIDENCES_MAX).contains(&rows) {
        let detail = format_args!("a table has 1 to {INCIDENCES_MAX} incidences, not {rows}");
        return wrong.add(&incidences, "bad_shape", detail);
    }
    ascending(&table.distances_m, RANGE_MAX_M, &distances, wrong);
    // Short of a right angle: there a beam meets nothing.
    ascending(&table.incidences_rad, FRAC_PI_2 - 1e-3, &incidences, wrong);
    let last = table.incidences_rad[rows - 1];
    let limit = table.incidence_max_rad;
    let detail =
        format_args!("{limit} must not be negative and at most the last incidence, {last}");
    expect((0.0..=last).contains(&limit), &place.field("incidence_max_rad"), detail, wrong);
    let bias = |value: f64| value.abs() <= BIAS_MAX_M;
    matrix(&table.bias_m, (rows, columns), bias, &place.field("bias_m"), wrong);
    let sd = |value: f64| value > 0.0 && value <= BIAS_MAX_M;
    matrix(&table.sd_m, (rows, columns), sd, &place.field("sd_m"), wrong);
}

fn ascending(values: &[f64], max: f64, place: &Place<'_>, wrong: &mut Violations) {
    let mut before = None;
    for (index, &value) in values.iter().enumerate() {
        let place = place.index(index);
        if !(0.0..=max).contains(&value) {
            let detail = format_args!("{value} must lie between 0 and {max}");
            return wrong.add(&place, "out_of_range", detail);
        }
        if before.is_some_and(|before| value <= before) {
            let detail = format_args!("{value} must be more than the number before it");
            return wrong.add(&place, "not_ascending", detail);
        }
        before = Some(value);
    }
}

fn matrix(
    values: &[Vec<f64>],
    (rows, columns): (usize, usize),
    fine: impl Fn(f64) -> bool,
    place: &Place<'_>,
    wrong: &mut Violations,
) {
    if values.len() != rows {
        let detail =
            format_args!("one row for each of the {rows} incidences, not {}", values.len());
        return wrong.add(place, "bad_shape", detail);
    }
    for (index, row) in values.iter().enumerate() {
        let place = place.index(index);
        if row.len() != columns {
            let detail =
                format_args!("one number for each of the {columns} distances, not {}", row.len());
            wrong.add(&place, "bad_shape", detail);
        } else if let Some(column) = row.iter().position(|value| !fine(*value)) {
            let detail = format_args!(
                "{} is no such length: a bias is at most {BIAS_MAX_M} m either way, a deviation \
                 more than 0 and at most {BIAS_MAX_M} m",
                row[column]
            );
            wrong.add(&place.index(column), "out_of_range", detail);
        }
    }
}

fn expect(fine: bool, place: &Place<'_>, detail: impl fmt::Display, wrong: &mut Violations) {
    if !fine {
        wrong.add(place, "out_of_range", detail);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::SensorKind;

    fn table() -> RangeCorrection {
        RangeCorrection {
            distances_m: vec![0.5, 1.0, 2.0],
            incidences_rad: vec![0.0, 1.0],
            bias_m: vec![vec![0.0, 0.01, -0.02]; 2],
            sd_m: vec![vec![0.01; 3]; 2],
            incidence_max_rad: 1.0,
        }
    }

    fn pointers(violations: &[Violation]) -> Vec<&str> {
        violations.iter().map(|v| v.pointer.as_str()).collect()
    }

    #[test]
    fn a_whole_profile_passes() {
        let sensor = SensorProfile {
            range_min_m: Some(0.3),
            range_sd_per_m: Some(0.004),
            systematic_sd_m: Some(0.01),
            mount: Some(SensorMount { x_m: 0.1, y_m: 0.0, heading_rad: 0.0 }),
            correction: Some(table()),
            ..SensorProfile::new(SensorKind::Scanner, 4.0, 0.01, 0.01)
        };
        assert_eq!(check_sensors(&[sensor]), []);
    }

    #[test]
    fn every_fault_of_a_table_is_found_at_its_place() {
        type Fault = (fn(&mut RangeCorrection), &'static str);
        let faults: [Fault; 9] = [
            (|t| t.distances_m.truncate(1), "/distances_m"),
            (|t| t.distances_m[2] = 1.0, "/distances_m/2"),
            (|t| t.distances_m[0] = f64::NAN, "/distances_m/0"),
            (|t| t.incidences_rad.clear(), "/incidences_rad"),
            (|t| t.incidences_rad[1] = 1.6, "/incidences_rad/1"),
            (|t| t.incidence_max_rad = 1.1, "/incidence_max_rad"),
            (|t| t.bias_m[1].truncate(2), "/bias_m/1"),
            (|t| t.sd_m[1][2] = 0.0, "/sd_m/1/2"),
            (|t| t.sd_m.truncate(1), "/sd_m"),
        ];
        assert_eq!(check_correction(&table()), []);
        for (spoil, pointer) in faults {
            let mut table = table();
            spoil(&mut table);
            assert_eq!(pointers(&check_correction(&table)), [pointer]);
        }
    }

    #[test]
    fn bad_figures_are_named_with_the_sensor_they_belong_to() {
        let good = SensorProfile::new(SensorKind::Scanner, 4.0, 0.01, 0.01);
        let far = SensorMount { x_m: 1e3, y_m: 0.0, heading_rad: f64::NAN };
        let bad = SensorProfile {
            range_min_m: Some(5.0),
            systematic_sd_m: Some(-1.0),
            transducers: vec![far],
            model: "\u{1b}".to_owned(),
            ..good.clone()
        };
        assert_eq!(
            pointers(&check_sensors(&[good.clone(), bad])),
            [
                "/sensors/1/range_min_m",
                "/sensors/1/systematic_sd_m",
                "/sensors/1/model",
                "/sensors/1/transducers/0/x_m",
                "/sensors/1/transducers/0/heading_rad",
            ]
        );
        assert_eq!(pointers(&check_sensors(&vec![good; 40])), ["/sensors"]);
    }
}
