//! The colours as people see them who lack one kind of cone: simulated after Machado, Oliveira and
//! Fernandes 2009 (severity 1, linear RGB), compared in CIE 1976 L*a*b*, white D65.

use super::*;

/// How each kind of eye mixes linear red, green and blue.
const VISIONS: [(&str, [[f64; 3]; 3]); 4] = [
    ("normal", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    (
        "protanopia",
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
    ),
    (
        "deuteranopia",
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ),
    (
        "tritanopia",
        [
            [1.255_528, -0.076_749, -0.178_779],
            [-0.078_411, 0.930_809, 0.147_602],
            [0.004_733, 0.691_367, 0.303_900],
        ],
    ),
];

/// Least difference (CIE 1976) between obstacles of two kinds; 2.3 is just noticeable.
const DIFFERENCE_MIN: f64 = 20.0;
/// Least fall of lightness (0 to 100) from a step to the next.
const FALL_MIN: f64 = 1.5;
/// Least contrast of the surest obstacle against the surest free space (WCAG 2.1, 1.4.11).
const CONTRAST_MIN: f64 = 3.0;

/// Linear red, green and blue as an eye mixes them.
fn seen(colour: [u8; 3], vision: &[[f64; 3]; 3]) -> [f64; 3] {
    let linear = colour.map(|part| {
        let part = f64::from(part) / 255.0;
        if part <= 0.040_45 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
    });
    vision.map(|row| {
        row.iter().zip(linear).map(|(weight, part)| weight * part).sum::<f64>().clamp(0.0, 1.0)
    })
}

fn luminance([red, green, blue]: [f64; 3]) -> f64 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

fn lab(rgb: [f64; 3]) -> [f64; 3] {
    let [red, green, blue] = rgb;
    let root = |t: f64| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
    let x = root((0.4124 * red + 0.3576 * green + 0.1805 * blue) / 0.950_47);
    let y = root(luminance(rgb));
    let z = root((0.0193 * red + 0.1192 * green + 0.9505 * blue) / 1.088_83);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The colours of each ramp, from free to occupied.
fn ramps() -> Vec<Vec<[u8; 3]>> {
    let palette = palette();
    let (colours, _) = palette[3..].as_chunks::<3>();
    colours.chunks_exact(usize::from(STEPS)).map(<[_]>::to_vec).collect()
}

#[test]
fn every_ramp_grows_darker_in_any_colour_vision_and_obstacles_stand_out() {
    let ramps = ramps();
    assert_eq!(ramps.len(), 3);
    for (name, vision) in &VISIONS {
        for (number, ramp) in ramps.iter().enumerate() {
            let light: Vec<f64> = ramp.iter().map(|c| lab(seen(*c, vision))[0]).collect();
            for (step, pair) in light.windows(2).enumerate() {
                assert!(
                    pair[0] - pair[1] > FALL_MIN,
                    "ramp {number}, step {step}, {name}: {pair:?}"
                );
            }
            let y = |colour: [u8; 3]| luminance(seen(colour, vision)) + 0.05;
            let contrast = y(ramp[0]) / y(ramp[usize::from(STEPS) - 1]);
            assert!(contrast > CONTRAST_MIN, "ramp {number}, {name}: {contrast}");
        }
    }
}

#[test]
fn obstacles_of_different_kinds_are_told_apart_in_any_colour_vision() {
    let ramps = ramps();
    for (name, vision) in &VISIONS {
        for step in usize::from(OCCUPIED_FROM)..usize::from(STEPS) {
            let labs: Vec<[f64; 3]> = ramps.iter().map(|r| lab(seen(r[step], vision))).collect();
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                let difference =
                    labs[a].iter().zip(labs[b]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                let told = format!("ramps {a} and {b}, step {step}, {name}: {difference}");
                assert!(difference > DIFFERENCE_MIN, "{told}");
            }
            // Darkest what scanners saw, lightest what no robot saw.
            assert!(labs[0][0] < labs[1][0] && labs[1][0] < labs[2][0], "step {step}, {name}");
        }
    }
}
