//! Buildings drawn for the purpose: two rooms with a door between, aligned levels, and whatever must be refused.

use mapfold_map::gdb::{Model, Severity, Structure, findings};
use mapfold_map::landmarks::LandmarkKind;
use mapfold_schema::border::gdb::{map_object, object_id};
use mapfold_schema::v1::{DoorKind, ObjectKind};

use super::*;

/// Two rooms of 4 by 3 m side by side, at 100 pixels a metre, y down; a door of 1 m in the wall between.
const ROOMS: &str = "
name: rooms
levels:
  L1:
    elevation: 0
    vertices:
      - [100, 100, 0, '']
      - [500, 100, 0, '']
      - [900, 100, 0, '']
      - [900, 400, 0, '']
      - [500, 400, 0, '']
      - [100, 400, 0, '']
      - [500, 200, 0, '']
      - [500, 300, 0, '']
    walls:
      - [0, 1, {alpha: [3, 1], texture_height: [3, 2.7]}]
      - [1, 2, {}]
      - [2, 3]
      - [3, 4]
      - [4, 5]
      - [5, 0]
      - [1, 6]
      - [7, 4]
    doors:
      - [6, 7, {name: [1, middle], type: [1, hinged], motion_degrees: [3, -90]}]
    measurements:
      - [0, 1, {distance: [3, 4.0]}]
    floors:
      - {parameters: {}, vertices: [0, 2, 3, 5]}
    models:
      - {model_name: Shelf, name: s1, x: 300, y: 200, yaw: 1.5, z: 0}
      - {model_name: Chair, name: c1, x: 300, y: 200, yaw: 0, z: 0}
lifts: {}
";

const FRAME: Uuid = Uuid::from_u128(5);

fn import(yaml: &str, level: Option<&str>) -> Result<Imported, BuildingError> {
    Document::read(yaml.as_bytes())?.import(level, FRAME, &BTreeSet::from(["Shelf"]))
}

fn model(imported: &Imported) -> Model {
    let objects = imported.objects.iter().filter(|(_, object)| object.prototype.is_none());
    let objects = objects.map(|(id, object)| (object_id(*id), map_object(object).unwrap()));
    Model { objects: objects.collect(), ..Model::default() }
}

#[test]
fn walls_close_at_corners_and_a_door_opens_the_wall_that_it_stands_in() {
    let imported = import(ROOMS, None).unwrap();
    let report = &imported.report;
    assert_eq!((report.walls, report.doorways, report.floors, report.instances), (9, 1, 1, 1));
    assert!((report.scale_m - 0.01).abs() < 1e-12);
    assert_eq!(report.warnings.len(), 1, "{:?}", report.warnings);
    assert!(report.warnings[0].contains("Chair"));
    let model = model(&imported);
    let faults: Vec<_> =
        findings(&model).into_iter().filter(|f| f.kind.severity() == Severity::Error).collect();
    assert_eq!(faults, []);
    let structure = Structure::of(&model);
    let plan = structure.plan(0.3);
    // Outside, and one room of two parts that the door joins.
    assert_eq!((plan.outlines().len(), plan.openings().len()), (2, 1));
    let opening = &plan.openings()[0];
    assert!((opening.width() - 1.0).abs() < 1e-5, "{opening:?}");
    let mut areas: Vec<f64> = plan.outlines().iter().map(mapfold_map::gdb::Outline::area).collect();
    areas.sort_by(f64::total_cmp);
    assert!((areas[0] + 8.1 * 3.1).abs() < 1e-3, "{areas:?}");
    assert!((areas[1] - (2.0 * 3.9 * 2.9 + 0.1 * 0.9 + 0.1 * 0.1)).abs() < 2e-2, "{areas:?}");
    // Above the door the wall goes on: two rooms.
    assert_eq!(structure.plan(2.3).outlines().len(), 3);
    assert_eq!(structure.plan(2.6).outlines().len(), 1, "one wall is higher than the others");
    let config = mapfold_map::gdb::LandmarkConfig::STANDARD;
    let landmarks = mapfold_map::gdb::landmarks(&plan, &config);
    let count = |kind| landmarks.iter().filter(|landmark| landmark.id.kind == kind).count();
    assert_eq!(count(LandmarkKind::Doorway), 1);
    assert_eq!(count(LandmarkKind::ConcaveCorner), 8);
    assert_eq!(count(LandmarkKind::ConvexCorner), 4);
    let door = imported.objects.values().find(|o| o.kind == ObjectKind::Doorway).unwrap();
    let leaves = door.door.unwrap();
    assert_eq!((door.name.as_str(), leaves.kind), ("middle", DoorKind::Hinged));
    assert!((leaves.opens_rad.unwrap() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    // y points up: what is further down in the image is further down here.
    let bounds = report.bounds.unwrap();
    assert!((bounds.max_y_m + 0.95).abs() < 0.01 && (bounds.min_y_m + 4.05).abs() < 0.01);
}

#[test]
fn the_same_file_gives_the_same_objects_and_another_level_gives_others() {
    let (a, b) = (import(ROOMS, None).unwrap(), import(ROOMS, Some("L1")).unwrap());
    assert_eq!(a, b);
    let document = Document::read(ROOMS.as_bytes()).unwrap();
    let elsewhere = document.import(None, Uuid::from_u128(6), &BTreeSet::new()).unwrap();
    assert!(elsewhere.objects.keys().all(|id| !a.objects.contains_key(id)));
}

/// A second level, drawn at half the scale, turned by a right angle and shifted, with the fiducials of the first.
#[test]
fn a_level_is_aligned_to_the_reference_by_fiducials_and_needs_no_measurement() {
    let body = ROOMS.split_once("levels:").unwrap().1.split_once("lifts:").unwrap().0;
    let fiducials =
        "    fiducials:\n      - [100, 100, a]\n      - [900, 100, b]\n      - [100, 400, c]\n";
    // (x, y) -> (y/2 + 7, -x/2 + 900): in the upright frame a turn by a right angle.
    let moved = |x: f64, y: f64| format!("[{}, {}", y / 2.0 + 7.0, -x / 2.0 + 900.0);
    let mut second = body.replace("  L1:", "  L2:");
    for (x, y) in [
        (100, 100),
        (500, 100),
        (900, 100),
        (900, 400),
        (500, 400),
        (100, 400),
        (500, 200),
        (500, 300),
    ] {
        let there = moved(f64::from(x), f64::from(y));
        second = second.replace(&format!("- [{x}, {y},"), &format!("- {there},"));
    }
    let second = second.replace("x: 300, y: 200", "x: 107, y: 750");
    let (before, rest) = second.split_once("    measurements:").unwrap();
    let second = before.to_owned() + "    floors:" + rest.split_once("    floors:").unwrap().1;
    let aligned = [(100.0, 100.0, "a"), (900.0, 100.0, "b"), (100.0, 400.0, "c")]
        .map(|(x, y, name)| format!("      - {}, {name}]\n", moved(x, y)));
    let second = format!("{second}    fiducials:\n{}", aligned.concat());
    let yaml = format!("name: two\nlevels:{body}{fiducials}{}", second.trim_start_matches('\n'));
    let first = import(&yaml, Some("L1")).unwrap();
    let second = import(&yaml, Some("L2")).unwrap();
    assert!((second.report.scale_m - 0.02).abs() < 1e-12);
    let (a, b) = (first.report.bounds.unwrap(), second.report.bounds.unwrap());
    for (a, b) in [
        (a.min_x_m, b.min_x_m),
        (a.max_x_m, b.max_x_m),
        (a.min_y_m, b.min_y_m),
        (a.max_y_m, b.max_y_m),
    ] {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    let area = |imported: &Imported| -> f64 {
        let plan = Structure::of(&model(imported)).plan(0.3);
        plan.outlines().iter().map(mapfold_map::gdb::Outline::area).sum()
    };
    assert!((area(&first) - area(&second)).abs() < 1e-4);
    let asked = import(&yaml, None).unwrap_err();
    assert!(
        matches!(&asked, BuildingError::NoSuchLevel { known, .. } if known == "\"L1\", \"L2\"")
    );
}

#[test]
fn what_cannot_be_taken_is_refused_with_its_place() {
    for (from, to, line, words) in [
        ("- [0, 1, {alpha", "- [0, 8, {alpha", 16, "one of 8 vertices"),
        ("- [0, 1, {alpha", "- [0, -1, {alpha", 16, "one of 8 vertices"),
        ("- [0, 1, {alpha", "- [0]\n      - [0, 1, {alpha", 16, "an edge is"),
        ("[100, 100, 0, '']", "[.nan, 100, 0, '']", 7, "x is a number"),
        ("[100, 100, 0, '']", "[1e999, 100, 0, '']", 7, "x is a number"),
        ("[100, 100, 0, '']", "&a [100, 100, 0, '']\n      - *a", 8, "references"),
        ("texture_height: [3, 2.7]", "texture_height: [3, -2]", 16, "height"),
        ("distance: [3, 4.0]", "distance: [3, 0]", 27, "more than 0 m"),
        ("distance: [3, 4.0]", "length: [3, 4.0]", 27, "`distance`"),
        ("    vertices:\n", "    vertices: 7\n    other:\n", 6, "`vertices` is a list"),
        ("levels:", "floors:", 2, "`levels`"),
    ] {
        let yaml = ROOMS.replacen(from, to, 1);
        assert_ne!(yaml, ROOMS, "{from}");
        match import(&yaml, None).unwrap_err() {
            BuildingError::At { line: at, fault, .. } => {
                assert!(fault.contains(words), "{fault}");
                assert_eq!(at, line, "{fault}");
            }
            other => panic!("{other:?}"),
        }
    }
    let unmeasured = ROOMS.replace("- [0, 1, {distance: [3, 4.0]}]", "");
    assert!(matches!(import(&unmeasured, None), Err(BuildingError::NoScale { .. })));
    let earth = format!("coordinate_system: wgs84{ROOMS}");
    assert!(matches!(import(&earth, None), Err(BuildingError::OnEarth(_))));
    let metres = format!("coordinate_system: cartesian_meters{ROOMS}");
    assert!(import(&metres, None).unwrap().report.bounds.unwrap().min_y_m > 99.0);
    let deep = "[".repeat(10_000);
    assert!(matches!(Document::read(deep.as_bytes()), Err(BuildingError::At { .. })));
    let long = vec![b' '; BUILDING_BYTES_MAX + 1];
    assert!(matches!(Document::read(&long), Err(BuildingError::TooLong { .. })));
    assert!(matches!(Document::read(b"\xff"), Err(BuildingError::At { line: 1, column: 1, .. })));
    assert!(Document::read(b"").is_err());
}
