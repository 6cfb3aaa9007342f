//! The GDB on the wire: what goes out comes back as it was, other programs' drawings become solids, and what cannot be taken is
//! named by its place.

#![expect(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::collections::BTreeMap;

use mapfold_map::gdb::{LandmarkConfig, Model, Shape, Structure, Surface, findings, landmarks};
use mapfold_schema::border::gdb::{
    Library, check_edit, check_gdb, check_library, coord_ref_sys, map_landmark, map_object,
    map_prototype, map_surfaces, object_id, wire_feature, wire_finding, wire_gdb_landmark,
    wire_plan, wire_prototype,
};
use mapfold_schema::codec;
use mapfold_schema::v1::{
    CollectionWord, GdbCollection, GdbEdit, GdbFeature, GdbObject, GdbPrototype, Geometry,
    ObjectKind, PrototypeCollection,
};
use serde_json::{Value, json};
use uuid::Uuid;

const FRAME: Uuid = Uuid::from_u128(77);

fn feature(number: u128, properties: &Value) -> Value {
    json!({"type": "Feature", "id": Uuid::from_u128(number), "geometry": null, "properties": properties})
}

/// One of everything: a compound table that is turned, a wall with a doorway, a tilted box, a cylinder, an open shell, an instance.
fn everything() -> Value {
    let tetrahedron = json!([[[0, 2, 1]], [[0, 1, 3]], [[1, 2, 3]], [[0, 3, 2]]]);
    let corners = json!([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    json!({
        "type": "FeatureCollection",
        "features": [
            feature(1, &json!({"kind": "wall", "name": "north", "solids": [
                {"box": {"from_m": [0.0, 0.0, 0.0], "to_m": [5.0, 0.2, 2.5]}}]})),
            feature(2, &json!({"kind": "doorway", "door": {"type": "hinged", "opens_rad": 1.5},
                "solids": [{"box": {"from_m": [1.0, -0.05, 0.0], "to_m": [1.9, 0.25, 2.1]}}]})),
            feature(3, &json!({"kind": "furniture", "tolerance_m": 0.2, "trust": 0.3,
                "placement": {"position_m": [3.0, 2.0, 0.5], "rotation": [0.8, 0.0, 0.0, 0.6]},
                "solids": [
                    {"box": {"from_m": [-0.5, -0.3, 0.0], "to_m": [0.5, 0.3, 0.05]}},
                    {"prism": {"base_m": [[[0.0, 0.0], [0.3, 0.0], [0.3, 0.3], [0.0, 0.3]],
                        [[0.1, 0.1], [0.2, 0.1], [0.2, 0.2]]], "lower_m": -0.5, "upper_m": 0.0}}]})),
            feature(4, &json!({"kind": "machine",
                "placement": {"position_m": [0.1, 4.0, 1.0], "rotation": [0.8, 0.6, 0.0, 0.0]},
                "solids": [{"box": {"from_m": [0.0, 0.0, 0.0], "to_m": [1.0, 1.0, 1.0]}}]})),
            feature(5, &json!({"kind": "other", "solids": [{"cylinder": {"centre_m": [8.0, 8.0],
                "radius_m": 0.3, "lower_m": 0.0, "upper_m": 3.0}}]})),
            feature(6, &json!({"kind": "other", "solids": [
                {"polyhedron": {"vertices_m": corners, "faces": tetrahedron}},
                {"polyhedron": {"vertices_m": corners, "faces": [[[0, 1, 2]]]}}]})),
            feature(7, &json!({"kind": "furniture", "prototype": "shelf",
                "placement": {"position_m": [6.0, 4.0, 0.0]}})),
        ],
    })
}

fn shelves() -> (BTreeMap<String, GdbPrototype>, Library) {
    let collection: PrototypeCollection = serde_json::from_value(json!({
        "type": "FeatureCollection",
        "features": [{"type": "Feature", "id": "shelf", "geometry": null, "properties": {
            "kind": "furniture",
            "solids": [{"box": {"from_m": [0.0, 0.0, 0.0], "to_m": [2.0, 0.5, 1.8]}}]}}],
    }))
    .unwrap();
    let wire = check_library(&collection).unwrap();
    let mapped = wire.iter().map(|(name, p)| (name.as_str().into(), map_prototype(p).unwrap()));
    (wire.clone(), mapped.collect())
}

fn read(value: &Value) -> GdbCollection {
    let text = value.to_string();
    codec::from_json(text.as_bytes()).unwrap()
}

/// The collection as a server writes it.
fn written(objects: &BTreeMap<Uuid, GdbObject>, library: &Library) -> GdbCollection {
    let feature = |(id, object): (&Uuid, &GdbObject)| {
        wire_feature(*id, object, &map_object(object).unwrap(), library)
    };
    GdbCollection {
        kind: CollectionWord::FeatureCollection,
        conforms_to: Vec::new(),
        coord_ref_sys: Some(coord_ref_sys(FRAME)),
        revision: Some(3),
        library: Some(1),
        features: objects.iter().map(feature).collect(),
    }
}

#[test]
fn what_is_written_is_read_as_it_was_with_its_place_and_from_its_place() {
    let (_, library) = shelves();
    let objects = check_gdb(&read(&everything()), FRAME, &library).unwrap();
    let out = written(&objects, &library);
    let again: GdbCollection = codec::from_json(&codec::to_json(&out).unwrap()).unwrap();
    assert_eq!(again, out);
    assert_eq!(check_gdb(&again, FRAME, &library).unwrap(), objects);
    for object in objects.values() {
        let bytes = codec::to_cbor(object).unwrap();
        assert_eq!(&codec::from_cbor::<GdbObject>(&bytes).unwrap(), object);
    }
    // Another program knows nothing of our properties: `place` alone gives the same plan.
    let model = |objects: &BTreeMap<Uuid, GdbObject>| Model {
        prototypes: library.clone(),
        objects: objects.iter().map(|(id, o)| (object_id(*id), map_object(o).unwrap())).collect(),
    };
    let mut drawn = out.clone();
    for feature in &mut drawn.features {
        let properties = &mut feature.properties;
        (properties.solids, properties.prototype, properties.placement) = (None, None, None);
    }
    let drawn = check_gdb(&drawn, FRAME, &library).unwrap();
    assert_ne!(drawn, objects);
    let (as_given, as_drawn) = (Structure::of(&model(&objects)), Structure::of(&model(&drawn)));
    for height in [0.1, 0.3, 0.6, 1.2, 1.7] {
        let [a, b] = [&as_given, &as_drawn].map(|s| wire_plan(&s.plan(height), 3, 1));
        assert_eq!(a, b, "{height}");
        assert!(!a.outlines.is_empty());
    }
}

#[test]
fn a_plan_tells_whose_each_edge_is_and_where_doorways_open() {
    let (_, library) = shelves();
    let objects = check_gdb(&read(&everything()), FRAME, &library).unwrap();
    let mapped = objects.iter().map(|(id, o)| (object_id(*id), map_object(o).unwrap())).collect();
    let model = Model { prototypes: library, objects: mapped };
    let plan = wire_plan(&Structure::of(&model).plan(0.3), 3, 1);
    let [opening] = &plan.openings[..] else { panic!("{:?}", plan.openings) };
    assert_eq!((opening.doorway, opening.sides.len()), (Uuid::from_u128(2), 2));
    assert!((opening.width_m - 0.9).abs() < 1e-9);
    // The wall is two pieces, whose jambs are the doorway's.
    let of = |kind| plan.objects.iter().position(|o| o.kind == kind).unwrap() as u32;
    let (wall, doorway) = (of(ObjectKind::Wall), of(ObjectKind::Doorway));
    let pieces: Vec<_> =
        plan.outlines.iter().filter(|o| o.iter().any(|c| c.object == wall)).collect();
    assert_eq!(pieces.len(), 2);
    assert!(pieces.iter().all(|o| o.iter().filter(|c| c.object == doorway).count() == 1));
    let [sheet] = &plan.sheets[..] else { return assert_eq!(plan.sheets.len(), 0) };
    assert!(sheet.len() >= 2);
    // Findings travel with code and place.
    let told: Vec<_> = findings(&model).iter().map(wire_finding).collect();
    let open = told.iter().find(|finding| finding.code == "open_shell").unwrap();
    assert_eq!((open.object, open.solid), (Some(Uuid::from_u128(6)), Some(1)));
}

#[test]
fn robots_get_the_surfaces_and_landmarks_of_a_plan_as_they_are() {
    let (_, library) = shelves();
    let objects = check_gdb(&read(&everything()), FRAME, &library).unwrap();
    let mapped = objects.iter().map(|(id, o)| (object_id(*id), map_object(o).unwrap())).collect();
    let plan = Structure::of(&Model { prototypes: library, objects: mapped }).plan(0.3);
    let wire = wire_plan(&plan, 3, 1);
    let told = codec::from_cbor(&codec::to_cbor(&wire).unwrap()).unwrap();
    let surfaces: Vec<Surface> = plan.edges().map(Surface::from).collect();
    assert_eq!(map_surfaces(&told).unwrap(), surfaces);
    assert!(surfaces.len() > 20);
    let planned = landmarks(&plan, &LandmarkConfig::STANDARD);
    assert!(planned.len() > 10);
    for planned in planned {
        let read = map_landmark(&wire_gdb_landmark(&planned)).unwrap();
        let own = planned.landmark;
        assert_eq!((read.kind, read.at, read.direction), (own.kind, own.at, own.direction));
        assert_eq!(read.covariance, own.covariance);
        assert!((read.direction_sd - own.direction_sd).abs() < 1e-12);
    }

    // What cannot be is told with its place.
    let pointer = |plan: &_| map_surfaces(plan).unwrap_err()[0].pointer.clone();
    let mut wrong = wire.clone();
    wrong.outlines[1][2].object = 99;
    assert_eq!(pointer(&wrong), "/outlines/1/2/object");
    let mut wrong = wire.clone();
    wrong.outlines[0][1].at_m[1] = f64::NAN;
    assert_eq!(pointer(&wrong), "/outlines/0/1/at_m");
    let mut wrong = wire;
    wrong.objects[0].tolerance_m = -0.1;
    assert_eq!(pointer(&wrong), "/objects/0/tolerance_m");
}

#[test]
fn upright_solids_are_prisms_for_others_and_what_leans_is_faces() {
    let (wire, library) = shelves();
    let objects = check_gdb(&read(&everything()), FRAME, &library).unwrap();
    let out = written(&objects, &library);
    let place = |number: u128| {
        let of = |f: &&GdbFeature| f.id == Uuid::from_u128(number);
        out.features.iter().find(of).unwrap().place.clone().unwrap()
    };
    let Geometry::Prism { base, lower, upper } = place(7) else { panic!("{:?}", place(7)) };
    assert_eq!((lower, upper), (0.0, 1.8));
    let Geometry::Polygon { coordinates } = *base else { panic!("{base:?}") };
    assert_eq!(coordinates[0][..2], [vec![6.0, 4.0], vec![8.0, 4.0]]);
    assert_eq!(coordinates[0].first(), coordinates[0].last());
    assert!(
        matches!(place(3), Geometry::GeometryCollection { geometries } if geometries.len() == 2)
    );
    let Geometry::Polyhedron { coordinates } = place(4) else { panic!("{:?}", place(4)) };
    assert_eq!(coordinates[0].len(), 6);
    let Geometry::GeometryCollection { geometries } = place(6) else { panic!("{:?}", place(6)) };
    assert!(matches!(&geometries[0], Geometry::Polyhedron { .. }));
    assert!(matches!(&geometries[1], Geometry::MultiPolygon { .. }));
    let shelf = wire_prototype("shelf", &wire["shelf"], &library["shelf"]);
    assert!(matches!(shelf.place, Some(Geometry::Prism { .. })));
    let id = Uuid::from_u128(7);
    assert!(
        matches!(map_object(&objects[&id]).unwrap().shape, Shape::Instance(name) if &*name == "shelf")
    );
}

#[test]
fn every_fault_is_named_by_its_place() {
    let (_, library) = shelves();
    let solid = |solid: Value| json!({"kind": "wall", "solids": [solid]});
    let a_box = json!({"box": {"from_m": [0.0, 0.0, 0.0], "to_m": [1.0, 1.0, 1.0]}});
    let long = "x".repeat(129);
    for (properties, pointer, code) in [
        (json!({"kind": "wall"}), "", "no_shape"),
        (json!({"kind": "wall", "solids": [], "prototype": "shelf"}), "", "no_shape"),
        (json!({"kind": "wall", "solids": [a_box], "name": long}), "/name", "bad_name"),
        (json!({"kind": "wall", "solids": [a_box], "name": "a\u{7}"}), "/name", "bad_name"),
        (json!({"kind": "wall", "solids": [a_box], "trust": 1.5}), "/trust", "out_of_range"),
        (
            json!({"kind": "wall", "solids": [a_box], "tolerance_m": -1.0}),
            "/tolerance_m",
            "out_of_range",
        ),
        (
            json!({"kind": "wall", "solids": [a_box], "door": {"type": "open"}}),
            "/door",
            "no_doorway",
        ),
        (
            json!({"kind": "wall", "solids": [a_box], "placement": {"position_m": [0.0, 1e6, 0.0]}}),
            "/placement/position_m/1",
            "out_of_range",
        ),
        (
            json!({"kind": "wall", "solids": [a_box],
            "placement": {"position_m": [0.0, 0.0, 0.0], "rotation": [1.0, 1.0, 0.0, 0.0]}}),
            "/placement/rotation",
            "not_unit",
        ),
        (
            solid(json!({"box": {"from_m": [0.0, 2e5, 0.0], "to_m": [1.0, 1.0, 1.0]}})),
            "/solids/0/box/from_m/1",
            "out_of_range",
        ),
        (
            solid(json!({"prism": {"base_m": [], "lower_m": 0.0, "upper_m": 1.0}})),
            "/solids/0/prism/base_m",
            "no_ring",
        ),
        (
            solid(json!({"polyhedron": {"vertices_m": [], "faces": [[]]}})),
            "/solids/0/polyhedron/faces/0",
            "no_ring",
        ),
    ] {
        let collection =
            json!({"type": "FeatureCollection", "features": [feature(1, &properties)]});
        let wrong = check_gdb(&read(&collection), FRAME, &library).unwrap_err();
        let expected = format!("/features/0/properties{pointer}");
        assert_eq!((wrong[0].pointer.as_str(), wrong[0].code.as_str()), (&*expected, code));
    }
    // Shapes that do not fit are named by the reader.
    let text = json!({"type": "FeatureCollection", "features": [
        feature(1, &solid(json!({"box": {"from_m": [0.0, "a", 0.0], "to_m": [1.0, 1.0, 1.0]}})))]});
    let refused = codec::from_json::<GdbCollection>(text.to_string().as_bytes()).unwrap_err();
    assert!(
        refused.to_string().contains("/features/0/properties/solids/0/box/from_m/1"),
        "{refused}"
    );
}

#[test]
fn a_place_that_says_otherwise_and_another_frame_are_refused() {
    let (_, library) = shelves();
    let objects = check_gdb(&read(&everything()), FRAME, &library).unwrap();
    let mut moved = written(&objects, &library);
    let Some(Geometry::Prism { upper, .. }) = &mut moved.features[0].place else { panic!() };
    *upper += 0.5;
    let wrong = check_gdb(&moved, FRAME, &library).unwrap_err();
    assert_eq!(
        (wrong[0].pointer.as_str(), &*wrong[0].code),
        ("/features/0/place", "place_differs")
    );

    let elsewhere = written(&objects, &library);
    let wrong = check_gdb(&elsewhere, Uuid::from_u128(78), &library).unwrap_err();
    assert_eq!((wrong[0].pointer.as_str(), &*wrong[0].code), ("/coordRefSys", "frame_mismatch"));

    let id = Uuid::from_u128(1);
    let twice: GdbFeature = written(&objects, &library).features[0].clone();
    let edit = GdbEdit { put: vec![twice.clone(), twice], remove: vec![id, id] };
    let wrong = check_edit(&edit, &library).unwrap_err();
    let pointers: Vec<&str> = wrong.iter().map(|v| v.pointer.as_str()).collect();
    assert_eq!(pointers, ["/put/1/id", "/remove/0", "/remove/1"]);
}

#[test]
fn other_programs_drawings_are_taken_or_refused_where_they_are_wrong() {
    let library = Library::new();
    let drawn = |place: Value| {
        let mut feature = feature(1, &json!({"kind": "wall"}));
        feature["place"] = place;
        check_gdb(
            &read(&json!({"type": "FeatureCollection", "features": [feature]})),
            FRAME,
            &library,
        )
    };
    let ring = json!([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]);
    let base = json!({"type": "Polygon", "coordinates": [ring]});
    drawn(json!({"type": "Prism", "base": base, "lower": 0.0, "upper": 2.0})).unwrap();
    for (place, pointer, code) in [
        (json!({"type": "Polygon", "coordinates": [ring]}), "/coordinates/0/0", "bad_position"),
        (
            json!({"type": "Prism", "base": {"type": "Polygon", "coordinates": [[[0.0, 0.0], [1.0, 0.0]]]},
            "lower": 0.0, "upper": 1.0}),
            "/base/coordinates/0",
            "not_closed",
        ),
        (
            json!({"type": "Polyhedron", "coordinates": [[[[[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]]]]}),
            "/coordinates/0/0/0",
            "not_closed",
        ),
        (
            json!({"type": "GeometryCollection", "geometries": [
            {"type": "GeometryCollection", "geometries": []}]}),
            "/geometries/0",
            "unknown_geometry",
        ),
    ] {
        let wrong = drawn(place).unwrap_err();
        let expected = format!("/features/0/place{pointer}");
        assert_eq!((wrong[0].pointer.as_str(), wrong[0].code.as_str()), (&*expected, code));
    }
}
