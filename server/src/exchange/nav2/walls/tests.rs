//! Maps drawn for the purpose: straight walls, slanted ones, thick things, and noise.

use std::f64::consts::PI;

use mapfold_map::gdb::{Outline, Structure};
use mapfold_schema::border::gdb::object_id;

use super::*;

/// A map of 0.05 m cells, occupied where `is_wall` says so of their middles, in cells.
fn package(columns: u32, rows: u32, yaw: f64, is_wall: impl Fn(f64, f64) -> bool) -> Package {
    let mut image = format!("P5\n{columns} {rows}\n255\n").into_bytes();
    for row in (0..rows).rev() {
        let middle = |column| (f64::from(column) + 0.5, f64::from(row) + 0.5);
        let grey = |(x, y)| if is_wall(x, y) { 0 } else { 254 };
        image.extend((0..columns).map(|column| grey(middle(column))));
    }
    let description = format!(
        "image: map.pgm\nresolution: 0.05\norigin: [-1.0, 2.0, {yaw}]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    );
    Package { description: description.into_bytes(), image }
}

fn drawn(package: &Package) -> (Incoming, Explained) {
    package.walls(Uuid::from_u128(3), &BTreeMap::new()).unwrap()
}

fn solid_area(incoming: &Incoming) -> f64 {
    let objects = incoming.objects.iter();
    let objects = objects.map(|(id, o)| (object_id(*id), map_object(o).unwrap())).collect();
    let plan = Structure::of(&Model { objects, ..Model::default() }).plan(1.0);
    -plan.outlines().iter().map(Outline::area).sum::<f64>()
}

#[test]
fn a_room_becomes_its_walls_where_they_stand() {
    // Walls of four cells about a room, one with a door, and a pillar of 20 by 20 cells.
    let is_wall = |x: f64, y: f64| {
        let outer = (10.0..110.0).contains(&x) && (10.0..90.0).contains(&y);
        let inner = (14.0..106.0).contains(&x) && (14.0..86.0).contains(&y);
        let door = (40.0..58.0).contains(&x) && y < 20.0;
        let pillar = (60.0..80.0).contains(&x) && (40.0..60.0).contains(&y);
        (outer && !inner && !door) || pillar
    };
    let (incoming, explained) = drawn(&package(120, 100, 0.0, is_wall));
    assert_eq!(
        (explained.straight, explained.thick, explained.invented),
        (5, 1, 0),
        "{explained:?}"
    );
    assert_eq!(explained.explained, explained.occupied);
    let bounds = incoming.report.bounds.unwrap();
    let found = [bounds.min_x_m, bounds.max_x_m, bounds.min_y_m, bounds.max_y_m];
    // From cells 10 to 110 and 10 to 90, about an origin of -1 and 2 m.
    assert!(
        found.iter().zip([-0.5, 4.5, 2.5, 6.5]).all(|(a, b)| (a - b).abs() < 0.01),
        "{found:?}"
    );
    let wanted = explained.occupied as f64 * 0.05 * 0.05;
    let area = solid_area(&incoming);
    assert!((area - wanted).abs() < 0.03 * wanted, "{area} {wanted}");
}

#[test]
fn a_slanted_wall_is_one_wall_and_finer_than_its_cells() {
    let (angle, half) = (0.3_f64, 2.0);
    let is_wall = |x: f64, y: f64| {
        let (x, y) = (x - 50.0, y - 40.0);
        let (along, off) = (x * angle.cos() + y * angle.sin(), y * angle.cos() - x * angle.sin());
        along.abs() <= 35.0 && off.abs() <= half
    };
    let (incoming, explained) = drawn(&package(100, 80, 0.5, is_wall));
    assert_eq!(explained.invented, 0);
    assert!(explained.explained as f64 >= 0.99 * explained.occupied as f64, "{explained:?}");
    let turns: Vec<(f64, f64)> = incoming
        .objects
        .values()
        .filter_map(|object| {
            let [w, _, _, z] = object.placement?.rotation?;
            let GdbSolid::Box(solid) = object.solids.as_ref()?.first()? else { return None };
            Some((2.0 * z.atan2(w), solid.to_m[1] - solid.from_m[1]))
        })
        .collect();
    // In the level the map itself is turned by 0.5.
    let (turn, thickness) = turns[0];
    let off = (turn - angle - 0.5).rem_euclid(PI);
    assert!(off.min(PI - off) < 0.02, "{turns:?}");
    // Each border to a quarter of a cell.
    assert!((thickness - 0.2).abs() < 0.025, "{turns:?}");
    assert_eq!(explained.straight, 1, "{turns:?}");
}

#[test]
fn specks_are_left_out_and_crooked_things_come_whole() {
    let is_wall = |x: f64, y: f64| {
        let speck = (x as i64 % 10 == 0 && y as i64 % 10 == 0) && x < 50.0;
        let (x, y) = (x - 80.0, y - 50.0);
        let crooked = x.hypot(y) < 15.0 && x.hypot(y) > 4.0;
        speck || crooked
    };
    let (incoming, explained) = drawn(&package(120, 100, 0.0, is_wall));
    assert_eq!(incoming.report.left_out[0].count, 50);
    let area = solid_area(&incoming);
    let wanted = (explained.occupied - 50) as f64 * 0.05 * 0.05;
    assert!((area - wanted).abs() < 0.06 * wanted, "{area} {wanted} {explained:?}");
    assert_eq!(explained.explained, explained.occupied - 50);
}

#[test]
fn what_is_no_map_is_refused() {
    let mut broken = package(10, 10, 0.0, |_, _| true);
    broken.image.truncate(20);
    let fault = broken.walls(Uuid::nil(), &BTreeMap::new()).unwrap_err();
    assert_eq!(fault.place, "the map");
    let empty = package(10, 10, 0.0, |_, _| false);
    assert_eq!(drawn(&empty).0.objects.len(), 0);
    let noise = |x: f64, y: f64| ((x as i64 * 7919) ^ (y as i64 * 104_729)) % 3 != 0;
    let (incoming, explained) = drawn(&package(200, 200, 0.0, noise));
    assert!(explained.explained * 10 >= explained.occupied * 9, "{explained:?}");
    assert!(!incoming.objects.is_empty());
}
