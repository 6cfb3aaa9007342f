//! The raster prior against sampling of what it says.

use std::collections::BTreeMap;

use mapfold_map::gdb::{
    Kind, Model, Object, Placement, Point3, Prior, PriorConfig, PriorError, Structure, prior,
};
use mapfold_map::raster::Cell;
use proptest::prelude::*;

use super::world::{block, doorway, model, wall};

fn cells(prior: &Prior) -> BTreeMap<Cell, i16> {
    let mut cells = BTreeMap::new();
    for (tile, patch) in prior {
        for run in patch.runs() {
            cells.extend(run.range().map(|offset| (tile.cell(offset), run.value)));
        }
    }
    cells
}

fn of(model: &Model) -> BTreeMap<Cell, i16> {
    cells(&prior(&Structure::of(model).plan(0.5), &PriorConfig::standard(0.05)).unwrap())
}

fn at(cells: &BTreeMap<Cell, i16>, column: i32, row: i32) -> i16 {
    cells.get(&Cell { column, row }).copied().unwrap_or(0)
}

/// A room of 4 m x 3 m in walls of 0.3 m, trusted by a half, and a machine of 1 m x 1 m that is trusted wholly.
fn room() -> Model {
    let machine = Object { trust: 1.0, ..block(Kind::Machine, [1.0, 1.0], [2.0, 2.0], [0.0, 1.0]) };
    model([
        wall([-0.3, -0.3], [4.3, 0.0]),
        wall([-0.3, 3.0], [4.3, 3.3]),
        wall([-0.3, -0.3], [0.0, 3.3]),
        wall([4.0, -0.3], [4.3, 3.3]),
        doorway([2.5, -0.4], [3.5, 0.1]),
        machine,
    ])
}

#[test]
fn surfaces_insides_rooms_and_the_outside_have_their_values() {
    let cells = of(&room());
    // Across the west wall in row 30: outside, surface, four cells inside, surface, room.
    let row: Vec<i16> = (-8..=1).map(|column| at(&cells, column, 30)).collect();
    assert_eq!(row, [0, 0, 200, 200, 200, 200, 200, 200, -50, -50]);
    // The machine: its surface at full trust, its inside at what is never looked at.
    let row: Vec<i16> = (18..=42).map(|column| at(&cells, column, 30)).collect();
    let mut want = vec![-50, -50, 400];
    want.extend([200; 18]);
    want.extend([400, -50, -50, -50]);
    assert_eq!(row, want);
    // Through the doorway: what is between the jambs is free, what is before it is outside.
    assert_eq!(
        (-8..=1).map(|row| at(&cells, 60, row)).collect::<Vec<_>>(),
        [0, 0, -50, -50, -50, -50, -50, -50, -50, -50]
    );
}

#[test]
fn what_nobody_trusts_says_nothing() {
    let mut model = room();
    model.objects.values_mut().for_each(|object| object.trust = 0.0);
    assert!(of(&model).values().all(|value| *value == -50));
}

#[test]
fn a_plan_of_half_the_country_is_refused() {
    let plan = Structure::of(&model([wall([-9000.0, -9000.0], [9000.0, 9000.0])])).plan(0.5);
    let config = PriorConfig::standard(0.05);
    assert!(matches!(
        prior(&plan, &config),
        Err(PriorError::TooLarge { cells_max: 100_000_000, .. })
    ));
    for resolution in [0.0, -1.0, f64::NAN, 1e-9, f64::INFINITY] {
        let config = PriorConfig { resolution, ..config };
        assert!(
            matches!(prior(&plan, &config), Err(PriorError::BadResolution { .. })),
            "{resolution}"
        );
    }
}

proptest! {
    /// Wherever a sample is solid, its cell is occupied; wherever a cell is wholly inside or free, all samples in it are.
    #[test]
    fn no_cell_that_meets_something_solid_is_free(
        bodies in prop::collection::vec((-3.0..3.0_f64, -3.0..3.0_f64, 0.0..6.0_f64, 0.1..2.0_f64, 0.1..2.0_f64), 1..5),
        samples in prop::collection::vec((-5.0..5.0_f64, -5.0..5.0_f64), 300),
    ) {
        let body = |(x, y, yaw, length, width): &(f64, f64, f64, f64, f64)| Object {
            placement: Placement::upright(Point3::new(*x, *y, 0.0), *yaw),
            trust: 1.0,
            ..block(Kind::Other, [0.0, 0.0], [*length, *width], [0.0, 1.0])
        };
        let cells = of(&model(bodies.iter().map(body)));
        for (x, y) in samples {
            let margin = bodies
                .iter()
                .map(|(at_x, at_y, yaw, length, width)| {
                    let (s, c) = yaw.sin_cos();
                    let (dx, dy) = (x - at_x, y - at_y);
                    let (u, v) = (c * dx + s * dy, c * dy - s * dx);
                    u.min(length - u).min(v).min(width - v)
                })
                .fold(f64::NEG_INFINITY, f64::max);
            let cell = Cell::holding(&mapfold_map::geometry::Point::new(x, y), 0.05);
            let value = cells.get(&cell).copied().unwrap_or(0);
            if margin > 1e-5 {
                prop_assert!(value > 0, "solid at {} {}, {}", x, y, value);
            }
            if margin < -1e-5 {
                prop_assert!(value != 200, "not inside at {} {}", x, y);
            }
            // A cell's diagonal away from anything: no surface.
            if margin < -0.0708 {
                prop_assert!(value <= 0, "free at {} {}, {}", x, y, value);
            }
        }
    }
}
