//! Every kind of finding, found where it is, and nowhere else.

use mapfold_map::gdb::{
    Face, Finding, FindingKind as K, Kind, Model, Object, Outline, Placement, Plan, PlanPoint,
    Point3, Polygon, Polyhedron, Prototype, Severity, Shape, Solid, Structure, findings,
};

use super::world::{block, cube, doorway, id, model, wall};

fn of(objects: impl IntoIterator<Item = Object>) -> Vec<Finding> {
    findings(&model(objects))
}

fn polyhedron(polyhedron: Polyhedron) -> Object {
    Object::of(Kind::Machine, vec![Solid::Polyhedron(polyhedron)])
}

fn unit() -> Polyhedron {
    cube([0.0; 3], [1.0; 3])
}

/// The only finding of a polyhedron: its kind and its face.
fn only(changed: Polyhedron) -> (K, Option<usize>) {
    let findings = of([polyhedron(changed)]);
    let [finding] = findings.as_slice() else { panic!("{findings:?}") };
    assert_eq!(finding.place.object, Some(id(0)));
    assert_eq!(finding.place.solid, Some(0));
    (finding.kind.clone(), finding.place.face)
}

#[test]
fn a_sound_cube_has_no_faults() {
    assert_eq!(of([polyhedron(unit())]), []);
}

#[test]
fn a_missing_face_is_an_open_shell_and_only_a_warning() {
    let mut open = unit();
    open.faces.pop();
    let (kind, _) = only(open);
    assert_eq!(kind, K::OpenShell { edges: 4 });
    assert_eq!(kind.severity(), Severity::Warning);
}

#[test]
fn a_flipped_face_is_named() {
    for face in 0..6 {
        let mut flipped = unit();
        flipped.faces[face].outer.reverse();
        assert_eq!(only(flipped), (K::FlippedFace, Some(face)));
    }
}

#[test]
fn all_faces_flipped_are_a_solid_inside_out() {
    let mut flipped = unit();
    flipped.faces.iter_mut().for_each(|face| face.outer.reverse());
    assert_eq!(only(flipped).0, K::InsideOut);
}

#[test]
fn a_vertex_off_its_plane_is_named() {
    let mut bent = unit();
    bent.vertices[7] += Point3::new(0.0, 0.0, 0.01);
    // The top and no other: the sides that share the vertex stay in their planes.
    let findings = of([polyhedron(bent)]);
    let [finding] = findings.as_slice() else { panic!("{findings:?}") };
    assert_eq!(finding.place.face, Some(1));
    assert!(matches!(finding.kind, K::NotPlane { off } if off > 0.002 && off < 0.0101));
}

#[test]
fn faces_that_are_no_polygons_are_named() {
    let with = |outer: Vec<u32>| {
        let mut changed = unit();
        changed.faces[1] = Face::simple(outer);
        only(changed)
    };
    assert_eq!(with(vec![4, 5]), (K::TooFewVertices, Some(1)));
    assert_eq!(with(vec![4, 5, 5, 7, 6]), (K::RepeatedVertex, Some(1)));
    assert_eq!(with(vec![4, 7, 5, 6]), (K::NoArea, Some(1)), "a bow tie of equal halves");
    assert_eq!(with(vec![4, 5, 99, 6]), (K::UnknownVertex, Some(1)));
    assert_eq!(with(vec![]), (K::TooFewVertices, Some(1)));
}

fn prism(outer: &[[f64; 2]], holes: &[&[[f64; 2]]]) -> Vec<K> {
    let points = |ring: &[[f64; 2]]| ring.iter().map(|p| (*p).into()).collect();
    let base =
        Polygon { outer: points(outer), holes: holes.iter().map(|hole| points(hole)).collect() };
    let solid = Solid::Prism { base, lower: 0.0, upper: 1.0 };
    of([Object::of(Kind::Machine, vec![solid])]).into_iter().map(|finding| finding.kind).collect()
}

/// Edges without end cost no time without end, whether they meet each other or not.
#[test]
fn tangles_and_combs_are_named_without_looking_at_all_of_them() {
    let tangle: Vec<[f64; 2]> =
        (0..60_000).map(|k| [f64::from(k % 7), f64::from(k % 11)]).collect();
    assert_eq!(prism(&tangle, &[]), [K::MeetsItself]);
    // Slanting teeth, each beside thousands of others.
    let tooth =
        |k: u32| [f64::from(k / 2) * 0.001 + f64::from(k % 2) * 40.0, f64::from(k % 2) * 40.0];
    let up = (0..30_000).map(|k| [tooth(k)[0] + f64::from(k % 2) * 2e-4, tooth(k)[1]]);
    let comb: Vec<[f64; 2]> = up.chain([[60.0, -1.0], [-1.0, -1.0]]).collect();
    assert_eq!(prism(&comb, &[]), [K::TooIntricate]);
}

#[test]
fn polygons_that_meet_themselves_and_holes_outside_are_named() {
    let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
    assert_eq!(prism(&square, &[]), []);
    assert_eq!(prism(&square, &[&[[1.0, 1.0], [2.0, 1.0], [1.0, 2.0]]]), []);
    assert_eq!(prism(&[[0.0, 0.0], [4.0, 3.0], [4.0, 0.0], [0.0, 4.0]], &[]), [K::MeetsItself]);
    // A spike that folds back on itself.
    assert_eq!(
        prism(&[[0.0, 0.0], [4.0, 0.0], [6.0, 0.0], [4.0, 0.0], [4.0, 4.0]], &[]),
        [K::MeetsItself]
    );
    assert_eq!(prism(&square, &[&[[3.0, 1.0], [5.0, 1.0], [3.0, 2.0]]]), [K::MeetsItself]);
    assert_eq!(prism(&square, &[&[[5.0, 1.0], [6.0, 1.0], [5.0, 2.0]]]), [K::HoleOutside]);
    assert_eq!(prism(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], &[]), [K::NoArea]);
    assert_eq!(prism(&[[0.0, 0.0], [1.0, f64::NAN], [2.0, 2.0]], &[]), [K::OutOfReach]);
}

#[test]
fn an_unknown_prototype_is_named_and_a_faulty_one_only_once() {
    let instance = |name: &str| Object {
        shape: Shape::Instance(name.into()),
        ..Object::of(Kind::Furniture, vec![])
    };
    let mut model: Model = model([instance("table"), instance("table"), instance("chair")]);
    model.prototypes.insert(
        "table".into(),
        Prototype { solids: vec![Solid::cuboid([0.0; 3], [1.0, 1.0, -1.0])] },
    );
    let findings = findings(&model);
    let [first, second] = findings.as_slice() else { panic!("{findings:?}") };
    assert_eq!(
        (&first.kind, first.place.prototype.as_deref(), first.place.object),
        (&K::NoExtent, Some("table"), None)
    );
    assert_eq!(
        (&second.kind, second.place.object),
        (&K::UnknownPrototype("chair".into()), Some(id(2)))
    );
    assert!(second.kind.to_string().contains("\"chair\""));
}

#[test]
fn figures_out_of_their_range_are_named() {
    let kinds = |object: Object| of([object]).into_iter().map(|f| f.kind).collect::<Vec<_>>();
    let sound = || wall([0.0, 0.0], [1.0, 0.1]);
    assert_eq!(kinds(Object { tolerance: -0.1, ..sound() }), [K::BadTolerance]);
    assert_eq!(kinds(Object { trust: 1.5, ..sound() }), [K::BadTrust]);
    assert_eq!(kinds(Object { trust: f64::NAN, ..sound() }), [K::BadTrust]);
    assert_eq!(kinds(Object::of(Kind::Wall, vec![])), [K::NoSolids]);
    let placed =
        |x: f64| Object { placement: Placement::upright(Point3::new(x, 0.0, 0.0), 0.0), ..sound() };
    assert_eq!(kinds(placed(f64::INFINITY)), [K::BadPlacement]);
    assert_eq!(kinds(placed(2e4)), [K::OutOfReach]);
}

#[test]
fn things_that_take_up_the_same_space_are_named_and_those_that_touch_are_not() {
    let machine = |x: f64, z: f64| block(Kind::Machine, [x, 0.0], [x + 1.0, 1.0], [z, z + 1.0]);
    assert_eq!(of([machine(0.0, 0.0), machine(1.0, 0.0)]), []);
    assert_eq!(of([machine(0.0, 0.0), machine(0.5, 1.0)]), [], "one upon the other");
    let findings = of([machine(0.0, 0.0), machine(0.9, 0.5)]);
    let [Finding { kind: K::Overlap { other, area }, place }] = findings.as_slice() else {
        panic!("{findings:?}")
    };
    assert_eq!((place.object, *other), (Some(id(0)), id(1)));
    assert!((area - 0.1).abs() < 1e-9);
    let at = place.at.unwrap();
    assert!((0.5..1.0).contains(&at.z) && (0.9..=1.0).contains(&at.x));
    // Walls overlap where they meet.
    assert_eq!(of([wall([0.0, 0.0], [5.0, 0.2]), wall([0.0, 0.0], [0.2, 5.0])]), []);
    assert_eq!(of([wall([0.0, 0.0], [5.0, 0.2]), machine(1.0, 0.0)]).len(), 1);
}

#[test]
fn a_doorway_wants_a_wall_and_wants_to_go_through_it() {
    let kinds = |doorway: Object| {
        let findings = of([wall([0.0, 0.0], [6.0, 0.4]), doorway]);
        findings.into_iter().map(|f| (f.place.object.unwrap(), f.kind)).collect::<Vec<_>>()
    };
    assert_eq!(kinds(doorway([1.0, -0.1], [2.0, 0.5])), []);
    assert_eq!(kinds(doorway([1.0, 1.0], [2.0, 1.5])), [(id(1), K::DoorwayOutsideWall)]);
    assert_eq!(
        kinds(doorway([1.0, 0.4], [2.0, 0.9])),
        [(id(1), K::DoorwayOutsideWall)],
        "it only touches"
    );
    assert_eq!(kinds(doorway([1.0, -0.1], [2.0, 0.2])), [(id(1), K::DoorwayNotThrough)]);
}

/// Leaves of sliding doors, say: they open nothing, so they keep nobody from publishing.
#[test]
fn a_doorway_in_no_wall_is_told_and_changes_no_plan() {
    let wall = || wall([0.0, 0.0], [6.0, 0.4]);
    let leaf = || doorway([1.0, 1.0], [2.0, 1.025]);
    let findings = of([wall(), leaf()]);
    assert_eq!(findings.iter().map(|f| f.kind.severity()).collect::<Vec<_>>(), [Severity::Warning]);
    let [with, without] =
        [model([wall(), leaf()]), model([wall()])].map(|model| Structure::of(&model).plan(0.5));
    let corners = |plan: &Plan| -> Vec<PlanPoint> {
        plan.outlines().iter().flat_map(Outline::vertices).collect()
    };
    assert_eq!(corners(&with), corners(&without));
    assert_eq!((with.openings().len(), with.sheets().len()), (0, 0));
}

/// A draft shows what it has right.
#[test]
fn plans_leave_out_what_has_an_error_and_nothing_else() {
    let mut flipped = unit();
    flipped.faces[2].outer.reverse();
    let objects = [polyhedron(flipped), wall([5.0, 0.0], [6.0, 1.0])];
    let plan = Structure::of(&model(objects)).plan(0.5);
    assert_eq!(plan.outlines().len(), 1);
    assert!(plan.edges().all(|edge| edge.owner.id == id(1)));
}

#[test]
fn every_sentence_says_what_to_do() {
    let all = [
        K::NoSolids,
        K::BadTolerance,
        K::BadTrust,
        K::BadPlacement,
        K::OutOfReach,
        K::NoExtent,
        K::TooFewVertices,
        K::UnknownVertex,
        K::RepeatedVertex,
        K::NoArea,
        K::MeetsItself,
        K::TooIntricate,
        K::HoleOutside,
        K::NotPlane { off: 0.002 },
        K::OpenShell { edges: 3 },
        K::FlippedFace,
        K::InsideOut,
        K::Overlap { other: id(1), area: 0.01 },
        K::DoorwayOutsideWall,
        K::DoorwayNotThrough,
    ];
    let verbs = [
        "add", "delete", "must", "move", "draw", "give", "check", "pull", "close", "flip", "make",
        "place", "cut",
    ];
    for kind in all {
        let sentence = kind.to_string();
        assert!(verbs.iter().any(|verb| sentence.contains(verb)), "{sentence}");
    }
    assert!(K::NotPlane { off: 0.002 }.to_string().contains("2.0 mm"));
}
