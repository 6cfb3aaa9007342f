//! Drawings: a model out and in again, a flat drawing as people draw them, and whatever must be refused.

use std::collections::BTreeMap;

use mapfold_map::gdb::{Severity, Structure, findings};
use mapfold_schema::v1::ObjectKind;
use proptest::prelude::*;

use super::super::incoming::{FileFault, Incoming};
use super::super::sample::{FRAME, Sample, model_of, plans, words};
use super::*;

fn import(drawing: &str, options: &Options) -> Result<Incoming, FileFault> {
    read(drawing.as_bytes(), FRAME, &BTreeMap::new(), options)
}

fn written(sample: &Sample) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(sample.outgoing(), &mut bytes).unwrap();
    bytes
}

#[test]
fn a_model_comes_back_as_what_it_was_and_every_plan_of_it_to_the_bit() {
    let sample = Sample::new();
    let bytes = written(&sample);
    assert_eq!(bytes, written(&sample));
    assert!(bytes.is_ascii());
    let incoming = read(&bytes, FRAME, &BTreeMap::new(), &Options::default()).unwrap();
    assert_eq!((&incoming.report.left_out[..], &incoming.report.warnings[..]), (&[][..], &[][..]));
    assert_eq!(words(&incoming.objects), words(&sample.objects));
    let names: Vec<&String> = incoming.prototypes.keys().collect();
    assert_eq!(names, ["TABLE 1.6 'm'", "table 1.6 \"m\""]);
    assert_eq!(plans(&model_of(&incoming)), plans(&sample.model));
    // Where there are these prototypes already, none comes in.
    let mut library = sample.library.clone();
    library.extend(incoming.prototypes);
    let again = read(&bytes, FRAME, &library, &Options::default()).unwrap();
    assert!(again.prototypes.is_empty());
    assert_eq!(again.objects, incoming.objects);
}

/// Groups of a drawing out of a shorter way to write them.
fn groups(text: &str) -> String {
    let pairs = text.split_whitespace().collect::<Vec<_>>();
    pairs.join("\n") + "\n"
}

fn line(layer: &str, [a, b, c, d]: [f64; 4]) -> String {
    format!("0 LINE 8 {layer} 10 {a} 20 {b} 11 {c} 21 {d} ")
}

fn drawing(units: &str, blocks: &str, entities: &str) -> String {
    groups(&format!(
        "0 SECTION 2 HEADER 9 $INSUNITS 70 {units} 0 ENDSEC 0 SECTION 2 BLOCKS {blocks} 0 ENDSEC \
         0 SECTION 2 ENTITIES {entities} 0 ENDSEC 0 EOF"
    ))
}

/// A room of 4 by 3 m in millimetres: walls of 200 mm, a door of 900 mm with its swing, a column, a desk turned over and
/// stretched, and things of no interest.
fn room() -> String {
    let blocks = "0 BLOCK 2 xref$0$DESK 10 0 20 0 30 0 \
        0 LINE 8 0 10 0 20 0 11 1600 21 0 0 LINE 8 0 10 0 20 800 11 1600 21 800 \
        0 ARC 8 A-CASE 10 1600 20 400 40 400 50 270 51 90 0 ENDBLK";
    let mut walls = String::new();
    for ends in [
        [0.0, 0.0, 4400.0, 0.0],
        [4400.0, 0.0, 4400.0, 3400.0],
        [4400.0, 3400.0, 0.0, 3400.0],
        [0.0, 3400.0, 0.0, 0.0],
        [200.0, 200.0, 1000.0, 200.0],
        [1900.0, 200.0, 4200.0, 200.0],
        [4200.0, 200.0, 4200.0, 3200.0],
        [4200.0, 3200.0, 200.0, 3200.0],
        [200.0, 3200.0, 200.0, 200.0],
    ] {
        walls.push_str(&line("plan$0$A-WALL", ends));
    }
    // The outer face is open at the door, too, and there are jambs.
    let walls = walls.replacen("10 0 20 0 11 4400 21 0", "10 0 20 0 11 1000 21 0", 1)
        + &line("A-WALL", [1900.0, 0.0, 4400.0, 0.0])
        + &line("A-WALL", [1000.0, 0.0, 1000.0, 200.0])
        + &line("A-WALL", [1900.0, 200.0, 1900.0, 0.0]);
    let others = "0 ARC 8 A-DOOR 10 1000 20 200 40 900 50 0 51 90 \
        0 CIRCLE 8 S-COLS 10 3000 20 2000 40 150 \
        0 INSERT 8 A-FURN 2 xref$0$DESK 10 -1500 20 2300 41 0.5 210 0 220 0 230 -1 \
        0 INSERT 8 A-FURN 2 xref$0$DESK 10 2500 20 1000 50 90 \
        0 TEXT 8 A-WALL 10 0 20 0 1 wall 0 LINE 8 S-FOOTER 10 0 20 0 11 4400 21 0 \
        0 LWPOLYLINE 8 A-FURN 90 2 70 0 10 0 20 0 10 1 20 1";
    drawing("4", blocks, &(walls + others))
}

#[test]
fn a_flat_drawing_becomes_a_room_with_a_door_a_column_and_desks() {
    let incoming = import(&room(), &Options::default()).unwrap();
    let report = &incoming.report;
    let count = |kind| report.kinds.iter().find(|k| k.kind == kind).map_or(0, |k| k.count);
    let kinds = [ObjectKind::Wall, ObjectKind::Doorway, ObjectKind::Furniture];
    // Five stretches of wall, the one over the door, and the column.
    assert_eq!(kinds.map(count), [7, 1, 2], "{report:?}");
    assert_eq!(report.instances, 2);
    assert_eq!(report.prototypes, ["DESK", "DESK 0.5000 by 1.0000 by 1.0000 mirrored"]);
    let left: Vec<&str> = report.left_out.iter().map(|left| left.what.as_str()).collect();
    let lines = [
        "LINE on layer \"S-FOOTER\"",
        "TEXT on layer \"A-WALL\"",
        "open lines of furniture pieces",
    ];
    assert_eq!(left, lines);
    let bounds = report.bounds.unwrap();
    assert!((bounds.max_x_m - 4.4).abs() < 1e-6 && bounds.min_x_m.abs() < 1e-6, "{bounds:?}");

    let model = model_of(&incoming);
    let errors = findings(&model).into_iter().filter(|f| f.kind.severity() == Severity::Error);
    assert_eq!(errors.count(), 0);
    let plan = Structure::of(&model).plan(0.3);
    assert_eq!(plan.openings().len(), 1, "{:?}", plan.openings());
    assert!((plan.openings()[0].width() - 0.9).abs() < 1e-5);
    // One outline around the building and through the door about the room, and three things in it.
    assert_eq!(plan.outlines().len(), 4);
    let areas: f64 = plan.outlines().iter().map(mapfold_map::gdb::Outline::area).sum();
    let walls = 4.4 * 3.4 - 4.0 * 3.0 - 0.9 * 0.2;
    let desk = 1.6 * 0.8 + 0.4 * 0.4 * std::f64::consts::PI / 2.0;
    let things = desk * 1.5 + 0.15 * 0.15 * std::f64::consts::PI;
    assert!((areas + walls + things).abs() < 0.02, "{areas} {walls} {things}");

    // The request says more of the layers, and of the unit.
    let options = Options::new(Some("S-FOOTER=wall,A-FURN=skip"), Some(0.0254), Some(3.0)).unwrap();
    let other = import(&room(), &options).unwrap();
    assert!((other.report.scale_m - 0.0254).abs() < 1e-12);
    assert!(other.report.instances == 0, "{:?}", other.report);
    assert!(other.report.bounds.unwrap().max_x_m > 100.0);
    assert!(Options::new(Some("A=tree"), None, None).is_err());
    assert!(Options::new(None, Some(f64::NAN), None).is_err());
}

#[test]
fn blocks_that_walls_are_drawn_in_are_laid_out_where_they_stand() {
    let blocks = "0 BLOCK 2 FLOOR 10 0 20 0 0 LINE 8 A-WALL 10 0 20 0 11 5 21 0 \
        0 LINE 8 A-WALL 10 0 20 0.2 11 5 21 0.2 0 ENDBLK \
        0 BLOCK 2 OUTER 10 1 20 0 0 INSERT 8 0 2 FLOOR 10 1 20 0 70 2 71 3 44 10 45 -4 0 ENDBLK";
    let incoming =
        import(&drawing("6", blocks, "0 INSERT 8 0 2 OUTER 10 0 20 0 50 90"), &Options::default());
    let incoming = incoming.unwrap();
    assert_eq!(incoming.objects.len(), 6);
    let bounds = incoming.report.bounds.unwrap();
    let found = [bounds.min_x_m, bounds.max_x_m, bounds.min_y_m, bounds.max_y_m];
    let wanted = [-0.2, 8.0, 0.0, 15.0];
    assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
}

#[test]
fn hostile_drawings_are_refused_with_the_line() {
    let nested = |depth: usize| {
        let block = |k: usize| {
            format!("0 BLOCK 2 B{k} 10 0 20 0 0 INSERT 8 A-WALL 2 B{} 10 0 20 0 0 ENDBLK ", k + 1)
        };
        let last =
            format!("0 BLOCK 2 B{depth} 10 0 20 0 0 LINE 8 A-WALL 10 0 20 0 11 1 21 1 0 ENDBLK ");
        (0..depth).map(block).collect::<String>() + &last
    };
    let doubled = |k: usize| {
        let copies = "10 0 20 0 70 9 71 9 44 1 45 1";
        format!("0 BLOCK 2 B{k} 10 0 20 0 0 INSERT 8 A-WALL 2 B{} {copies} 0 ENDBLK ", k + 1)
    };
    let doubling = (0..15).map(doubled).collect::<String>()
        + "0 BLOCK 2 B15 10 0 20 0 0 LINE 8 A-WALL 10 0 20 0 11 1 21 1 0 ENDBLK ";
    let insert = "0 INSERT 8 A-WALL 2 B0 10 0 20 0";
    let cyclic = "0 BLOCK 2 B0 10 0 20 0 0 INSERT 8 A-FURN 2 B1 10 0 20 0 0 ENDBLK \
        0 BLOCK 2 B1 10 0 20 0 0 INSERT 8 A-FURN 2 B0 10 0 20 0 0 ENDBLK";
    let with = |entities: &str| drawing("6", "", entities);
    for (text, words) in [
        (String::new(), "line 0: the drawing breaks off"),
        ("AutoCAD Binary DXF\r\n\u{1a}\0".to_owned(), "binary"),
        ("hello\nworld\n".to_owned(), "line 1: \"hello\" is no code"),
        ("0\n".to_owned(), "line 1: the drawing breaks off after a code"),
        (groups("0 SECTION 2 ENTITIES 0 TEXT 8 A-WALL"), "breaks off"),
        (groups("0 SECTION 2 ENTITIES 0 EOF"), "ENDSEC is missing"),
        (groups("0 SECTION 2 BLOCKS 0 BLOCK 2 A 0 ENDSEC 0 EOF"), "ENDBLK is missing"),
        (with("0 LINE 8 A-WALL 10 nan 20 0 11 1 21 1"), "line 26: \"nan\" is no number"),
        (with("0 LINE 8 A-WALL 10 1e999 20 0 11 1 21 1"), "\"1e999\" is no number"),
        (with("0 LINE 8 A-WALL 10 0 20 0"), "line 22: this LINE has no end"),
        (with("0 CIRCLE 8 S-COLS 10 0 20 0 40 -1"), "a radius is more than 0"),
        (with("0 LWPOLYLINE 8 A-WALL 20 1"), "a y without an x"),
        (with("0 POLYLINE 8 A-WALL 70 1 0 LINE 8 A-WALL"), "SEQEND"),
        (with("0 INSERT 8 A-WALL 2 NONE 10 0 20 0"), "line 22: there is no block \"NONE\""),
        (with("0 LINE 8 A-WALL 10 0 20 0 11 1 21 1 210 0 220 0 230 0"), "the normal"),
        (with("0 LINE 8 A-WALL 10 2e5 20 0 11 3e5 21 0"), "100000 m is the most"),
        (with("0 INSERT 8 A-WALL 2 B 10 0 20 0 70 99999999999"), "no number of copies"),
        (drawing("6", &nested(20), insert), "more than 16 deep"),
        (drawing("6", &doubling, insert), "points"),
        (drawing("6", cyclic, "0 INSERT 8 A-FURN 2 B0 10 0 20 0"), "more than 16 deep"),
        (drawing("6", cyclic, "0 INSERT 8 A-WALL 2 B0 10 0 20 0"), "more than 16 deep"),
        (drawing("0", "", ""), "does not tell its unit"),
    ] {
        let fault = import(&text, &Options::default()).unwrap_err().to_string();
        assert!(fault.contains(words), "{words}: {fault}");
        assert!(fault.starts_with("line "), "{fault}");
    }
    // A million copies of a block that is not taken cost no more than counting them.
    let many = drawing("6", &nested(0), "0 INSERT 8 X 2 B0 10 0 20 0 70 1000 71 1000");
    assert!(import(&many, &Options::default()).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// Whatever is changed in a drawing, it is read or refused with a place.
    #[test]
    fn changed_drawings_are_read_or_refused(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4_u8), 1..6),
        is_ours: bool,
    ) {
        let mut bytes = if is_ours { written(&Sample::new()) } else { room().into_bytes() };
        for (at, byte, what) in edits {
            if bytes.is_empty() {
                break;
            }
            let at = at.index(bytes.len());
            match what {
                0 => bytes[at] = byte,
                1 => bytes.truncate(at),
                2 => { bytes.remove(at); }
                _ => bytes.insert(at, byte % 10 + b'0'),
            }
        }
        match read(&bytes, FRAME, &BTreeMap::new(), &Options::default()) {
            Ok(incoming) => { let _ = plans(&model_of(&incoming)); }
            Err(fault) => prop_assert!(!fault.place.is_empty() && !fault.fault.is_empty()),
        }
    }
}
