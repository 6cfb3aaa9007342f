//! Places on small made-up levels: found, told apart, and not invented.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_map::geometry::{Level, Point, Pose, Robot, difference};
use mapfold_map::level::LevelMap;
use mapfold_map::places::{
    Beam, LikelihoodField, PlacesConfig, View, place_near, pose_at, search, search_near,
};
use mapfold_map::raster::{Cell, TILE_CELLS, Tile, TileIndex};

const RESOLUTION: f64 = 0.05;

/// Rectangles that are free inside, `[left, bottom, right, top]`, with walls where no other one goes on.
type Floor = Vec<[f64; 4]>;

fn is_free(floor: &Floor, p: &Point) -> bool {
    floor.iter().any(|[left, bottom, right, top]| {
        (*left..*right).contains(&p.x) && (*bottom..*top).contains(&p.y)
    })
}

/// An L with a niche, unlike itself when turned.
fn angled(x: f64) -> Floor {
    vec![[x, 0.0, x + 7.0, 3.0], [x, 0.0, x + 2.5, 6.0], [x + 4.0, 3.0, x + 5.0, 3.6]]
}

/// The field of what a robot would have drawn of the floors that are on its map.
fn field(floor: &Floor) -> LikelihoodField {
    let mut tiles: BTreeMap<TileIndex, Box<[i32; TILE_CELLS]>> = BTreeMap::new();
    let around = |v: f64, by: i32| (v / RESOLUTION).round() as i32 + by;
    for [left, bottom, right, top] in floor {
        for column in around(*left, -2)..around(*right, 2) {
            for row in around(*bottom, -2)..around(*top, 2) {
                let cell = Cell { column, row };
                let centre = cell.centre(RESOLUTION);
                let near = [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)]
                    .map(|(x, y)| is_free(floor, &(centre + Point::new(x, y) * RESOLUTION)));
                let value = match (is_free(floor, &centre), near.contains(&true)) {
                    (true, _) => -300,
                    (false, true) => 300,
                    (false, false) => continue,
                };
                let (tile, offset) = cell.tile();
                tiles.entry(tile).or_insert_with(|| Box::new([0; TILE_CELLS]))[offset] = value;
            }
        }
    }
    let walls = floor.iter().flat_map(sides);
    let tiles = tiles.into_iter().map(|(index, cells)| (index, Tile::new(cells)));
    LikelihoodField::new(tiles, walls, RESOLUTION, &PlacesConfig::STANDARD)
}

/// The sides of a rectangle, each with its inside on the left.
fn sides([left, bottom, right, top]: &[f64; 4]) -> impl Iterator<Item = (Point, Point)> + use<> {
    let corners = [(*left, *bottom), (*right, *bottom), (*right, *top), (*left, *top)];
    let corners = corners.map(|(x, y)| Point::new(x, y));
    (0..4).map(move |i| (corners[i], corners[(i + 1) % 4]))
}

/// A map that nobody has driven on, with the prior of a plan: rooms -0.5 nat, all else within 2 m of one solid.
fn planned(floor: &Floor) -> LevelMap {
    let mut tiles: BTreeMap<TileIndex, Box<[i32; TILE_CELLS]>> = BTreeMap::new();
    let cells = |v: f64| (v / RESOLUTION).round() as i32;
    for [left, bottom, right, top] in floor {
        for column in cells(*left - 2.0)..cells(*right + 2.0) {
            for row in cells(*bottom - 2.0)..cells(*top + 2.0) {
                let cell = Cell { column, row };
                let (tile, offset) = cell.tile();
                let value = if is_free(floor, &cell.centre(RESOLUTION)) { -50 } else { 200 };
                tiles.entry(tile).or_insert_with(|| Box::new([0; TILE_CELLS]))[offset] = value;
            }
        }
    }
    let tile = |(index, cells)| (index, Arc::new(Tile::new(cells)));
    LevelMap { prior: tiles.into_iter().map(tile).collect(), ..LevelMap::default() }
}

/// What a robot sees all around, by stepping along its beams.
fn view(floor: &Floor, level_from_robot: &Pose<Level, Robot>) -> View {
    let mut view = View::default();
    let robot_from_level = level_from_robot.inverse();
    for degrees in 0..360 {
        let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
        let steps = (1..3000).map(|i| f64::from(i) * 0.01);
        let mut ends = steps.map(|t| Point::new(cos * t, sin * t));
        let to = ends.find(|p| !is_free(floor, &level_from_robot.act(p))).unwrap();
        view.add(Beam { from: Point::zeros(), to, normal: None }, &PlacesConfig::STANDARD);
    }
    let sides =
        [(0.0, 0.0, 1.0, 0.0), (0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 1.0, 1.0), (1.0, 1.0, 0.0, 1.0)];
    // Directions of all sides, with free space on the left: what perception would tell of them.
    view.walls = sides
        .map(|(ax, ay, bx, by)| {
            let act = |x: f64, y: f64| robot_from_level.act(&Point::new(2.0 * x, 2.0 * y));
            (act(ax, ay), act(bx, by))
        })
        .to_vec();
    view
}

fn is_at(found: &Pose<Level, Robot>, truth: &Pose<Level, Robot>) -> bool {
    (found.position() - truth.position()).norm() < 0.06
        && difference(found.heading(), truth.heading()).abs() < 0.02
}

#[test]
fn a_room_unlike_any_other_is_found_from_anywhere_in_it() {
    let floor = angled(3.0);
    let field = field(&floor);
    for (x, y, heading) in [(4.0, 1.0, 0.3), (4.2, 5.1, -2.0), (9.0, 2.2, 3.1), (7.4, 0.6, 1.6)] {
        let truth = Pose::new(x, y, heading);
        let found = search(&field, &view(&floor, &truth), &[]);
        let best = found.places.first().unwrap();
        assert!(is_at(&best.level_from_robot.pose, &truth), "{truth:?}: {best:?}");
        assert_eq!(found.places.len(), 1, "{truth:?}");
        assert!(found.rest < best.fit - 6.9, "{truth:?}: {found:?}");
        assert!(best.hits > 0.95 && best.throughs < 0.05, "{best:?}");
    }
}

#[test]
fn walls_that_no_map_has_hide_no_place() {
    // Boards lean about the room: of the walls in sight none has a direction of the map's.
    let floor = angled(3.0);
    let field = field(&floor);
    for turned in [0.3, 0.7, -0.4] {
        let truth = Pose::new(4.2, 5.1, -2.0);
        let mut view = view(&floor, &truth);
        let boards = Pose::<Robot, Robot>::new(0.0, 0.0, turned);
        view.walls.truncate(1);
        view.walls.iter_mut().for_each(|(a, b)| (*a, *b) = (boards.act(a), boards.act(b)));
        let found = search(&field, &view, &[]);
        let best = found.places.first().unwrap();
        assert!(is_at(&best.level_from_robot.pose, &truth), "{turned}: {best:?}");
    }
}

#[test]
fn a_hall_whose_walls_are_all_far_away_is_a_place_too() {
    // Niches as wide as a robot tell its ends apart; all walls are farther off than what large blocks are bounded with.
    let floor = vec![[0.0, 0.0, 44.0, 27.0], [3.0, 27.0, 9.0, 29.0], [44.0, 4.0, 46.5, 7.0]];
    let field = field(&floor);
    for truth in [Pose::new(20.0, 13.5, 0.4), Pose::new(26.0, 12.5, -2.6)] {
        let view = view(&floor, &truth);
        assert!(view.beams.iter().all(|b| b.to.norm() > PlacesConfig::STANDARD.search_range));
        let found = search(&field, &view, &[]);
        let best = found.places.first().unwrap();
        assert!(is_at(&best.level_from_robot.pose, &truth), "{truth:?}: {best:?}");
        assert!(found.rest < best.fit - 6.9 && found.places.len() == 1, "{truth:?}: {found:?}");
    }
}

#[test]
fn a_wall_that_turns_another_side_is_another_wall() {
    // Its right wall, seen from inside; the same from outside, where nobody has been; and as if it stood across.
    let field = field(&vec![[0.0, 0.0, 6.0, 4.0]]);
    let fit = |x: f64, to: f64, normal: Point| {
        let hit = |i| Beam {
            from: Point::zeros(),
            to: Point::new(to, f64::from(i) * 0.02 - 0.4),
            normal: Some(normal),
        };
        let beams = (0..40).map(hit).collect();
        let place = place_near(&field, &View { beams, walls: Vec::new() }, &Pose::new(x, 2.0, 0.0));
        assert!(place.hits > 0.99 && place.throughs < 0.01, "{place:?}");
        place.fit
    };
    let (along, across) = (Point::new(1.0, 0.0), Point::new(0.0, 1.0));
    let [inside, outside] = [fit(4.0, 2.03, along), fit(8.0, -1.97, along)];
    let config = PlacesConfig::STANDARD;
    let cost = |a: f64, b: f64| (a - b) / (40.0 * config.temper);
    assert!((cost(inside, outside) - config.behind_cost).abs() < 0.05, "{inside} {outside}");
    assert!((fit(4.0, 2.03, -along) - inside).abs() < 1e-9, "a normal has no sign of its own");
    let stands_across = fit(4.0, 2.03, across);
    assert!((cost(inside, stands_across) - config.across_cost).abs() < 0.05, "{stands_across}");
}

#[test]
fn what_is_seen_through_a_wall_costs_also_where_nothing_is_known_behind_it() {
    let room = vec![[0.0, 0.0, 6.0, 4.0]];
    let field = field(&room);
    let at = Pose::new(3.0, 2.0, 0.0);
    let place = |x: f64, y: f64| {
        let to = Point::new(x, y);
        let beams = vec![Beam { from: Point::zeros(), to, normal: None }; 40];
        place_near(&field, &View { beams, walls: Vec::new() }, &at)
    };
    let fit = |x: f64, y: f64| place(x, y).fit;
    let throughs = |x: f64, y: f64| place(x, y).throughs;
    assert!(throughs(0.0, 2.0) < 0.01, "ends on it");
    assert!(throughs(0.0, 2.3) < 0.01, "ranges err, and walls are thick");
    assert!(throughs(0.0, 4.0) > 0.99, "ends far behind it");
    // Behind a wall nobody has ever seen anything from here: that weighs more than to end where nobody has been.
    let config = PlacesConfig::STANDARD;
    let costs = config.unknown_cost + config.through_unknown_cost;
    let expected = 40.0 * config.temper * (config.elsewhere - costs);
    assert!((fit(0.0, 4.0) - expected).abs() < 1.0, "{} {expected}", fit(0.0, 4.0));
}

#[test]
fn a_plan_alone_tells_a_robot_its_place() {
    let floor = angled(3.0);
    let walls = floor.iter().flat_map(sides);
    let config = PlacesConfig::STANDARD;
    let field = LikelihoodField::of_map_and_walls(&planned(&floor), walls, RESOLUTION, &config);
    for (x, y, heading) in [(4.0, 1.0, 0.3), (4.2, 5.1, -2.0), (9.0, 2.2, 3.1), (7.4, 0.6, 1.6)] {
        let truth = Pose::new(x, y, heading);
        // A cupboard that is in no plan takes up a sixth of what is seen.
        let mut view = view(&floor, &truth);
        let hidden = view.beams.len() / 6;
        view.beams[..hidden].iter_mut().for_each(|beam| beam.to *= 0.6);
        let found = search(&field, &view, &[]);
        let best = found.places.first().unwrap();
        assert!(is_at(&best.level_from_robot.pose, &truth), "{truth:?}: {best:?}");
        assert!(found.rest < best.fit - 6.9, "{truth:?}: {found:?}");
        assert!(found.places.len() == 1 && best.hits > 0.75, "{found:?}");
    }
    // Nobody has been there: that is presumed to be free, not found to be.
    assert!(!field.is_free(&Point::new(4.0, 1.0)));
    // What would end deep inside of something solid fits no wall.
    let at = Pose::new(4.0, 1.0, 0.0);
    let hits = |y: f64| {
        let to = Point::new(0.0, y - at.y);
        let beams = vec![Beam { from: Point::zeros(), to, normal: None }; 40];
        place_near(&field, &View { beams, walls: Vec::new() }, &at).hits
    };
    assert!(hits(-0.05) > 0.9);
    assert!(hits(-1.2) < 0.1);
}

#[test]
fn of_two_equal_rooms_both_are_told_and_proposals_change_nothing() {
    let floor = [angled(0.0), angled(20.0)].concat();
    let field = field(&floor);
    let truth = Pose::new(1.2, 4.0, 0.7);
    let twin = Pose::new(21.2, 4.0, 0.7);
    let view = view(&floor, &truth);
    let found = search(&field, &view, &[]);
    for pose in [truth, twin] {
        assert!(found.places.iter().any(|p| is_at(&p.level_from_robot.pose, &pose)), "{found:?}");
    }
    assert!((found.places[0].fit - found.places[1].fit).abs() < 1.0, "{found:?}");
    let wrong = Pose::new(3.0, 1.0, 2.0);
    let helped = search(&field, &view, &[twin, wrong]);
    assert_eq!(helped.places.len(), found.places.len());
}

#[test]
fn a_place_is_as_certain_as_what_is_seen_from_it() {
    let floor = angled(0.0);
    let room = field(&floor);
    let truth = Pose::new(1.2, 4.0, 0.7);
    let seen = view(&floor, &truth);
    let at = pose_at(&room, &seen, &place_near(&room, &seen, &truth));
    assert!((at.pose.position() - truth.position()).norm() < 0.03, "{at:?}");
    assert!(difference(at.pose.heading(), truth.heading()).abs() < 0.01, "{at:?}");
    assert!((0..2).all(|i| at.covariance.sd(i) < 0.05) && at.covariance.sd(2) < 0.03, "{at:?}");
    // In the middle of a corridor whose ends are out of sight, along it anything is as likely.
    let corridor = vec![[0.0, 0.0, 24.0, 2.0]];
    let long = field(&corridor);
    let truth = Pose::new(12.0, 1.0, 0.0);
    let mut seen = view(&corridor, &truth);
    seen.beams.retain(|beam| beam.to.norm() < 8.0);
    let at = pose_at(&long, &seen, &place_near(&long, &seen, &truth));
    assert!(at.covariance.sd(0) > 0.12 && at.covariance.sd(1) < 0.03, "{at:?}");
}

#[test]
fn around_a_known_pose_only_what_is_near_is_told() {
    let floor = [angled(0.0), angled(20.0)].concat();
    let field = field(&floor);
    let truth = Pose::new(1.2, 4.0, 0.7);
    let view = view(&floor, &truth);
    // Wheels have slipped; the twin room is out of reach.
    for (x, y, turn) in [(0.0, 0.0, 0.0), (0.35, -0.3, 0.2), (-0.3, 0.35, -0.23)] {
        let around = Pose::new(truth.x + x, truth.y + y, truth.heading() + turn);
        let found = search_near(&field, &view, &around, (0.4, 0.25));
        let [place] = found.places.as_slice() else { panic!("{found:?}") };
        assert!(is_at(&place.level_from_robot.pose, &truth), "{place:?}");
        assert!(found.rest < place.fit - 6.9 && place.gain() > 0.3, "{found:?}");
    }
    // The robot is elsewhere: nothing near fits.
    let away = Pose::new(5.5, 1.5, 0.7);
    let found = search_near(&field, &view, &away, (0.4, 0.25));
    assert!(found.places.is_empty(), "{found:?}");
    // Off the map there is nothing, and no harm.
    let nowhere = search_near(&field, &view, &Pose::new(-900.0, 1e6, 0.0), (0.4, 0.25));
    assert!(nowhere.places.is_empty(), "{nowhere:?}");
}

#[test]
fn a_place_that_is_not_on_the_map_fits_nowhere() {
    let field = field(&angled(0.0));
    // A round hall that no corner of an L resembles.
    let hall: Floor = (0..60)
        .map(|i| {
            let x = -4.0 + 8.0 * (f64::from(i) + 0.5) / 60.0;
            let y = (16.0 - x * x).sqrt();
            [x - 0.08, -y, x + 0.08, y]
        })
        .collect();
    let found = search(&field, &view(&hall, &Pose::new(0.5, 0.4, 0.2)), &[]);
    assert!(found.places.is_empty(), "{found:?}");
}

#[test]
fn nothing_seen_and_nothing_known_are_no_place() {
    let field = field(&angled(0.0));
    assert!(search(&field, &View::default(), &[]).places.is_empty());
    let nothing = LikelihoodField::new([], [], RESOLUTION, &PlacesConfig::STANDARD);
    let view = view(&angled(0.0), &Pose::new(1.0, 1.0, 0.0));
    assert!(search(&nothing, &view, &[]).places.is_empty());
}
