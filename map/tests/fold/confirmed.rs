//! What confirmed walls explain of the grid, where several layers are read together.

use mapfold_map::geometry::Point;
use mapfold_map::level::{Contribution, Level};
use mapfold_map::raster::{
    Cell, Layered, LogOdds, Said, SensorClass, Tile, TileIndex, TileKey, together,
};
use mapfold_map::vector::{ConfirmedConfig, confirmed};

use crate::walls::{EXACT, area, folded, look};

/// What the cell at `p` reads as, with and without what walls say.
fn read(level: &Level, p: Point) -> [Option<LogOdds>; 2] {
    let (tile, offset) = Cell::holding(&p, 0.05).tile();
    let walls = walls(level, tile);
    let layer = |class| level.map().tiles.get(&TileKey { class, tile }).map(AsRef::as_ref);
    let layers = Layered {
        prior: None,
        scanner: layer(SensorClass::Scanner),
        sonar: layer(SensorClass::Sonar),
        walls: Some(&walls),
    };
    let said = layers.said(offset..offset + 1).next().unwrap();
    [together(said), together(Said { walls: LogOdds(0), ..said })]
}

fn walls(level: &Level, at: TileIndex) -> Tile {
    let mut tile = Tile::default();
    for segment in level.map().segments.values() {
        let mut said = confirmed(segment, 0.05, &ConfirmedConfig::STANDARD);
        if let Some(patch) = said.remove(&at) {
            tile.add(&patch);
        }
    }
    tile
}

/// Scanner looks at a wall along y = 3.02, from x = 1 to 5, that hit it but from 2 to 3, where they pass it
/// aslant; and the three sonars that it mirrors, which take it for free space.
fn scene() -> Vec<Contribution> {
    let wall = (Point::new(1.0, 3.02), Point::new(5.0, 3.02));
    let mut looks: Vec<_> = (0..4).map(|i| look(i, &[wall], Point::new(3.0, 1.0), EXACT)).collect();
    for (i, xs, value) in [(10, [1.0, 2.0], 300), (11, [2.0, 3.0], -30), (12, [3.0, 5.0], 300)] {
        looks.push(area(i, xs, [3.0, 3.04], value, SensorClass::Scanner));
    }
    looks.extend((20..60).map(|i| area(i, [0.5, 5.5], [2.0, 3.6], -40, SensorClass::Sonar)));
    looks
}

fn along(from: f64, to: f64) -> impl Iterator<Item = Point> {
    let cells = ((to - from) / 0.05).round() as u32;
    (0..cells).map(move |i| Point::new(from + 0.05 * (f64::from(i) + 0.5), 3.02))
}

#[test]
fn sonars_that_a_wall_mirrors_and_beams_that_pass_it_aslant_leave_no_hole_in_it() {
    let level = folded(&scene());
    for p in along(1.1, 4.9) {
        let [with, without] = read(&level, p);
        assert!(with.unwrap().probability() > 0.65, "{with:?} at {p}");
        assert!(without.unwrap().0 < 0, "evidence alone has lost it: {without:?} at {p}");
    }
    let [beside, _] = read(&level, Point::new(3.0, 2.9));
    assert!(beside.unwrap().0 < 0, "no thicker than a cell");
    let [beyond, _] = read(&level, Point::new(5.3, 3.02));
    assert!(beyond.unwrap().0 < 0, "and no longer than it was seen");
}

#[test]
fn two_looks_confirm_nothing_and_what_scanners_look_through_is_free_again() {
    let scene = scene();
    let mut level = folded(&scene);
    level.unfold(&scene[..2]);
    assert!(along(1.1, 4.9).all(|p| read(&level, p)[0].unwrap().0 < 0), "two looks");
    level.fold(&scene[..2]);

    let door: Vec<_> =
        (100..110).map(|i| area(i, [3.5, 4.4], [2.5, 3.6], -100, SensorClass::Scanner)).collect();
    level.fold(&door);
    for p in along(3.6, 4.3) {
        let [with, without] = read(&level, p);
        assert!(with.unwrap().0 < 0 && with == without, "{with:?} at {p}");
    }
    for p in along(1.1, 3.3).chain(along(4.6, 4.9)) {
        assert!(read(&level, p)[0].unwrap().0 >= 200, "the rest stands, also at {p}");
    }
    level.unfold(&door);
    assert!(along(1.1, 4.9).all(|p| read(&level, p)[0].unwrap().0 >= 200), "shut again");
}
