//! From greys to occupancy, by the rules of `map_server`.

use super::Mode;
use super::description::Description;
use super::image::Image;
use super::refusal::Warning;

/// The occupancy of a cell of which nothing is known.
pub const UNKNOWN: i8 = -1;
const OCCUPIED: i8 = 100;
const FREE: i8 = 0;
/// The grey that savers write for unknown.
const UNKNOWN_GREY: u8 = 205;
/// Unknown cells that turn free are worth a warning from this share of the image on (1 in ...).
const PLATEAU_SHARE: u64 = 100;

/// Occupancy in per cent, or [`UNKNOWN`], the lowest row first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cells {
    /// Cells across.
    pub columns: u32,
    /// Cells up.
    pub rows: u32,
    /// Row by row from below.
    pub values: Vec<i8>,
}

/// Cells, and what is doubtful about them.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The cells.
    pub cells: Cells,
    /// What is doubtful.
    pub warnings: Vec<Warning>,
}

/// Reads greys as `map_server` does.
///
/// With `p` the darkness of a pixel, from 0 to 1 (its brightness, if `negate`): in modes trinary and
/// scale, `p >= occupied_thresh` is occupied and `p <= free_thresh` free; what lies between is
/// unknown, or with scale spread from 0 to 100; what is not wholly opaque is unknown. In mode raw
/// the grey is the occupancy, and nothing is known where it is beyond 100.
pub fn load(description: &Description, image: &Image) -> Loaded {
    let occupancy: Vec<i8> = (0..=u8::MAX).map(|grey| occupancy_of(grey, description)).collect();
    let see_through = image.opaque.as_ref().filter(|_| description.mode != Mode::Raw);
    let columns = image.columns as usize;
    let mut values = Vec::with_capacity(image.grey.len());
    let mut plateau = 0;
    for row in (0..image.rows as usize).rev() {
        for index in row * columns..(row + 1) * columns {
            let grey = image.grey[index];
            let known = see_through.is_none_or(|opaque| opaque[index]);
            plateau += u64::from(known && grey == UNKNOWN_GREY);
            values.push(if known { occupancy[usize::from(grey)] } else { UNKNOWN });
        }
    }
    let mut warnings = Vec::new();
    let reads_free = description.mode != Mode::Raw && occupancy[usize::from(UNKNOWN_GREY)] == FREE;
    if reads_free && plateau > 0 && plateau * PLATEAU_SHARE >= values.len() as u64 {
        let free_thresh = description.free_thresh;
        warnings.push(Warning::UnknownReadsFree { cells: plateau, free_thresh });
    }
    if values.iter().all(|value| *value == UNKNOWN) {
        warnings.push(Warning::NothingKnown);
    } else if values.iter().all(|value| *value <= 50) {
        warnings.push(Warning::NothingOccupied);
    }
    Loaded { cells: Cells { columns: image.columns, rows: image.rows, values }, warnings }
}

fn occupancy_of(grey: u8, description: &Description) -> i8 {
    let Description { negate, occupied_thresh, free_thresh, mode, .. } = *description;
    if mode == Mode::Raw {
        return i8::try_from(grey).ok().filter(|value| *value <= OCCUPIED).unwrap_or(UNKNOWN);
    }
    let bright = f64::from(grey) / 255.0;
    let p = if negate { bright } else { 1.0 - bright };
    if p <= free_thresh {
        FREE
    } else if p >= occupied_thresh {
        OCCUPIED
    } else if mode == Mode::Scale {
        ((p - free_thresh) / (occupied_thresh - free_thresh) * 100.0).round() as i8
    } else {
        UNKNOWN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn description(
        mode: Mode,
        negate: bool,
        occupied_thresh: f64,
        free_thresh: f64,
    ) -> Description {
        Description {
            image: "map.png".into(),
            resolution_m: 0.05,
            origin: [0.0; 3],
            negate,
            occupied_thresh,
            free_thresh,
            mode,
        }
    }

    /// The rules of `map_server`, one line each: greys and what they are read as.
    #[test]
    fn greys_are_read_by_the_rules_of_map_server() {
        use Mode::{Raw, Scale, Trinary};
        const U: i8 = UNKNOWN;
        type Rule = (Mode, bool, f64, f64, &'static [(u8, i8)]);
        let table: &[Rule] = &[
            // What savers write comes back: 254 free, 0 occupied, 205 unknown.
            (Trinary, false, 0.65, 0.196, &[(0, 100), (254, 0), (255, 0), (205, U), (206, 0)]),
            // Both edges: 89/255 is a darkness of 0.65098, 90/255 of 0.64706.
            (Trinary, false, 0.65, 0.196, &[(89, 100), (90, U), (128, U), (204, U)]),
            // The trap: with the saver's own default for asking, unknown turns free.
            (Trinary, false, 0.65, 0.25, &[(205, 0), (192, 0), (191, U)]),
            // Negated: white is occupied.
            (
                Trinary,
                true,
                0.65,
                0.196,
                &[(255, 100), (166, 100), (165, U), (49, 0), (50, U), (0, 0)],
            ),
            // Thresholds are inclusive: 51/255 is 0.2 and 204/255 is 0.8.
            (Trinary, true, 0.8, 0.2, &[(51, 0), (52, U), (203, U), (204, 100)]),
            (Trinary, false, 1.0, 0.0, &[(0, 100), (1, U), (254, U), (255, 0)]),
            // Scale: between the thresholds the darkness is spread from 0 to 100.
            (
                Scale,
                false,
                0.65,
                0.196,
                &[(0, 100), (255, 0), (205, 0), (204, 1), (147, 50), (90, 99)],
            ),
            (
                Scale,
                false,
                1.0,
                0.0,
                &[(0, 100), (128, 50), (127, 50), (252, 1), (254, 0), (3, 99)],
            ),
            (Scale, true, 1.0, 0.0, &[(0, 0), (128, 50), (255, 100)]),
            // Raw: the grey itself; thresholds and negate say nothing.
            (
                Raw,
                false,
                0.65,
                0.196,
                &[(0, 0), (1, 1), (100, 100), (101, U), (128, U), (205, U), (255, U)],
            ),
            (Raw, true, 0.65, 0.196, &[(0, 0), (100, 100), (255, U)]),
        ];
        for (mode, negate, occupied, free, greys) in table {
            let description = description(*mode, *negate, *occupied, *free);
            for (grey, value) in *greys {
                assert_eq!(occupancy_of(*grey, &description), *value, "{description:?} {grey}");
            }
        }
    }

    #[test]
    fn what_is_not_wholly_opaque_is_unknown_but_in_raw_mode() {
        let image = Image {
            columns: 3,
            rows: 1,
            grey: vec![0, 0, 50],
            opaque: Some(vec![true, false, false]),
        };
        for (mode, values) in [
            (Mode::Trinary, [100, UNKNOWN, UNKNOWN]),
            (Mode::Scale, [100, UNKNOWN, UNKNOWN]),
            (Mode::Raw, [0, 0, 50]),
        ] {
            let loaded = load(&description(mode, false, 0.65, 0.196), &image);
            assert_eq!(loaded.cells.values, values, "{mode:?}");
        }
    }

    #[test]
    fn the_lowest_row_of_the_picture_comes_first() {
        let image = Image { columns: 2, rows: 2, grey: vec![0, 254, 205, 0], opaque: None };
        let loaded = load(&description(Mode::Trinary, false, 0.65, 0.196), &image);
        assert_eq!(loaded.cells.values, [UNKNOWN, 100, 100, 0]);
    }

    #[test]
    fn a_plateau_of_unknown_that_would_turn_free_is_warned_of_and_a_single_grey_is_not() {
        let warned = |free_thresh: f64, plateau: usize| {
            let mut grey = vec![205; plateau];
            grey.resize(1000, 0);
            let image = Image { columns: 100, rows: 10, grey, opaque: None };
            load(&description(Mode::Trinary, false, 0.65, free_thresh), &image).warnings
        };
        assert_eq!(
            warned(0.25, 400),
            [Warning::UnknownReadsFree { cells: 400, free_thresh: 0.25 }]
        );
        assert_eq!(warned(0.196, 400), []);
        assert_eq!(warned(0.25, 3), []);
    }

    #[test]
    fn a_map_of_nothing_is_warned_of() {
        let of = |grey: u8| {
            let image = Image { columns: 2, rows: 1, grey: vec![grey; 2], opaque: None };
            load(&description(Mode::Trinary, false, 0.65, 0.196), &image).warnings
        };
        assert_eq!(of(205), [Warning::NothingKnown]);
        assert_eq!(of(254), [Warning::NothingOccupied]);
        assert_eq!(of(0), []);
    }
}
