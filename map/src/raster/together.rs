//! The layers of a place, read together.
//!
//! Each layer is summed and kept by itself; only who reads several at once weighs them against each
//! other. Sonar counts in full where no scanner has looked, and for little where one has: its cone
//! is decimetres wide and mirrored by smooth walls, so that many of its looks would wash a wall away
//! that one scanner saw (`docs/decisions/0019`). And where a confirmed wall is, a cell is no freer than
//! the wall says (`docs/decisions/0022`).

use std::ops::Range;

use super::{LogOdds, TILE_CELLS, Tile};

/// What the layers say of one cell, each as it reads; 0 where one says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Said {
    /// What was known before any robot came.
    pub prior: LogOdds,
    /// What scanners saw.
    pub scanner: LogOdds,
    /// What sonars saw.
    pub sonar: LogOdds,
    /// What confirmed walls say, not less than 0.
    pub walls: LogOdds,
}

/// What counts of sonar evidence in a cell of which scanners say anything: 3 tenths.
const SONAR_BESIDE_SCANNER: [i64; 2] = [3, 10];

/// What the layers come to in one cell: their sum, sonar weighed, but where there is a wall not less
/// than it says; `None` where none says anything. What is beyond the bounds of `i32` is at them.
pub fn together(said: Said) -> Option<LogOdds> {
    let Said { prior, scanner, sonar, walls } = said;
    let [prior, scanner, sonar, walls] = [prior, scanner, sonar, walls].map(|said| said.0);
    if [prior, scanner, sonar, walls] == [0; 4] {
        return None;
    }
    let sonar = if scanner == 0 { i64::from(sonar) } else { weighed(sonar) };
    let sum = i64::from(prior) + i64::from(scanner) + sonar;
    let sum = if walls == 0 { sum } else { sum.max(i64::from(walls)) };
    Some(LogOdds(sum.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32))
}

/// To the nearest step, halves away from none: equal evidence for and against stays equal.
fn weighed(sonar: i32) -> i64 {
    let [share, whole] = SONAR_BESIDE_SCANNER;
    let parts = i64::from(sonar) * share;
    (parts + parts.signum() * whole / 2) / whole
}

/// The tiles of one place; `None` where a layer is not asked for or holds nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Layered<'a> {
    /// What was known before any robot came.
    pub prior: Option<&'a Tile>,
    /// What scanners saw.
    pub scanner: Option<&'a Tile>,
    /// What sonars saw.
    pub sonar: Option<&'a Tile>,
    /// What confirmed walls say.
    pub walls: Option<&'a Tile>,
}

/// The cells of a layer that says nothing.
static NOTHING: [i32; TILE_CELLS] = [0; TILE_CELLS];

impl<'a> Layered<'a> {
    /// Whether no layer holds anything there.
    pub fn is_empty(&self) -> bool {
        self.prior.or(self.scanner).or(self.sonar).or(self.walls).is_none()
    }

    /// What the layers say of some cells, given by their offsets.
    pub fn said(&self, cells: Range<usize>) -> impl Iterator<Item = Said> + use<'a> {
        let of = |tile: Option<&'a Tile>| &tile.map_or(&NOTHING, Tile::cells)[cells.clone()];
        let robots = of(self.scanner).iter().zip(of(self.sonar));
        let others = of(self.prior).iter().zip(of(self.walls));
        robots.zip(others).map(|((scanner, sonar), (prior, walls))| Said {
            prior: LogOdds(*prior),
            scanner: LogOdds(*scanner),
            sonar: LogOdds(*sonar),
            walls: LogOdds(*walls),
        })
    }

    /// What the layers come to, cell by cell, 0 where none says anything; `None` without a tile.
    pub fn together(&self) -> Option<Tile> {
        if self.is_empty() {
            return None;
        }
        let mut read = Box::new(NOTHING);
        for (cell, said) in read.iter_mut().zip(self.said(0..TILE_CELLS)) {
            *cell = together(said).unwrap_or_default().0;
        }
        Some(Tile::new(read))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn said(prior: i32, scanner: i32, sonar: i32) -> Said {
        let walls = LogOdds(0);
        Said { prior: LogOdds(prior), scanner: LogOdds(scanner), sonar: LogOdds(sonar), walls }
    }

    fn read(prior: i32, scanner: i32, sonar: i32) -> i32 {
        together(said(prior, scanner, sonar)).unwrap_or_default().0
    }

    /// Such as cells come to, and what no cell comes to.
    fn any_value() -> impl Strategy<Value = i32> {
        prop_oneof![4 => -600..600_i32, 1 => Just(0), 1 => any::<i32>()]
    }

    #[test]
    fn sonar_counts_three_tenths_where_a_scanner_speaks() {
        for (layers, expected) in [
            ((0, 0, -400), -400),
            ((0, 85, -400), 85 - 120),
            ((0, -40, 400), -40 + 120),
            ((200, 0, -400), -200),
            ((200, 1, -5), 201 - 2),
            ((0, 1, 1), 1),
            ((0, i32::MAX, i32::MAX), i32::MAX),
            ((i32::MIN, i32::MIN, i32::MIN), i32::MIN),
        ] {
            let (prior, scanner, sonar) = layers;
            assert_eq!(read(prior, scanner, sonar), expected, "{layers:?}");
        }
        assert_eq!(together(said(0, 0, 0)), None);
        assert_eq!(together(said(-7, 7, 0)), Some(LogOdds(0)), "doubt is not ignorance");
    }

    proptest! {
        #[test]
        fn more_evidence_never_reads_as_less(
            prior in any_value(),
            scanner in any_value(),
            sonar in any_value(),
            more in 0..1000_i32,
        ) {
            let before = read(prior, scanner, sonar);
            prop_assert!(read(prior.saturating_add(more), scanner, sonar) >= before);
            prop_assert!(read(prior, scanner, sonar.saturating_add(more)) >= before);
            // A scanner that begins to speak takes sonar its weight: from there on it holds.
            let later = scanner.saturating_add(more);
            if scanner != 0 && later != 0 {
                prop_assert!(read(prior, later, sonar) >= before);
            }
        }

        #[test]
        fn without_a_scanner_or_without_sonar_it_is_the_plain_sum(
            prior in any_value(),
            one in any_value(),
        ) {
            let sum = prior.saturating_add(one);
            prop_assert_eq!(read(prior, 0, one), sum);
            prop_assert_eq!(read(prior, one, 0), sum);
        }

        #[test]
        fn where_a_wall_is_nothing_reads_freer_than_it_and_surer_cells_stay(
            prior in any_value(),
            scanner in any_value(),
            sonar in any_value(),
            walls in 1..600_i32,
        ) {
            let evidence = said(prior, scanner, sonar);
            let without = together(evidence).unwrap_or_default().0;
            let with = together(Said { walls: LogOdds(walls), ..evidence }).unwrap_or_default().0;
            prop_assert_eq!(with, without.max(walls));
        }

        #[test]
        fn it_is_the_same_for_and_against(
            prior in -600..600_i32,
            scanner in -600..600_i32,
            sonar in -600..600_i32,
        ) {
            prop_assert_eq!(read(-prior, -scanner, -sonar), -read(prior, scanner, sonar));
        }

        #[test]
        fn tiles_read_cell_by_cell(
            cells in prop::collection::vec((0..TILE_CELLS, any_value(), any_value(), any_value()), 0..50),
        ) {
            let mut layers = [(); 3].map(|()| Box::new(NOTHING));
            for (at, prior, scanner, sonar) in cells {
                layers[0][at] = prior;
                layers[1][at] = scanner;
                layers[2][at] = sonar;
            }
            let [prior, scanner, sonar] = layers.map(Tile::new);
            let robots = Layered { scanner: Some(&scanner), sonar: Some(&sonar), ..Layered::default() };
            let all = Layered { prior: Some(&prior), ..robots };
            let tile = all.together().unwrap_or_default();
            for at in 0..TILE_CELLS {
                let cell = [&prior, &scanner, &sonar].map(|tile| tile.cells()[at]);
                prop_assert_eq!(tile.cells()[at], read(cell[0], cell[1], cell[2]));
            }
            prop_assert_eq!(Layered { sonar: Some(&sonar), ..Layered::default() }.together(), Some(sonar));
            prop_assert_eq!(Layered::default().together(), None);
        }
    }
}
