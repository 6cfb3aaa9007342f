//! What gets through the border and what does not.

use mapfold_schema::border::{
    DEFAULT_LIMITS, Target, VIOLATIONS_MAX, Violation, check_contribution,
};
use mapfold_schema::codec::{self, DecodeError};
use mapfold_schema::malformed::{catalogue, valid};
use mapfold_schema::v1;
use uuid::Uuid;

const ID: Uuid = Uuid::from_u128(0x0192_7d3b_5a00_7abc_8def_0123_4567_89ab);

fn target() -> Target {
    Target { frame: Uuid::from_u128(7), resolution_m: 0.05, limits: DEFAULT_LIMITS }
}

fn example() -> v1::Contribution {
    valid(ID, "r1", &target())
}

/// What the way in says to a body: shape first, then content.
fn refusals(media_type: &str, body: &[u8]) -> Vec<Violation> {
    match codec::decode::<v1::Contribution>(media_type, body) {
        Ok(contribution) => check_contribution(&contribution, &target()).err().unwrap_or_default(),
        Err(DecodeError::Shape(violation)) => vec![violation],
        Err(other) => panic!("every body of the catalogue is well-formed: {other}"),
    }
}

#[test]
fn the_example_is_valid() {
    assert!(check_contribution(&example(), &target()).is_ok());
}

#[test]
fn every_malformed_contribution_is_refused_by_its_code_and_place_and_nothing_else() {
    let catalogue = catalogue(ID, "r1", &target());
    assert!(catalogue.len() >= 100);
    for malformed in &catalogue {
        let body = serde_json::to_vec(&malformed.body).unwrap();
        let said: Vec<(String, String)> =
            refusals(codec::JSON, &body).into_iter().map(|v| (v.code, v.pointer)).collect();
        let expected = (malformed.code.to_owned(), malformed.pointer.to_owned());
        assert_eq!(said, [expected], "{}", malformed.name);
    }
}

#[test]
fn names_in_the_catalogue_are_unique() {
    let mut names: Vec<&str> = catalogue(ID, "r1", &target()).iter().map(|m| m.name).collect();
    let all = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), all);
}

#[test]
fn a_refusal_explains_itself_in_few_words() {
    for malformed in catalogue(ID, "r1", &target()) {
        for violation in refusals(codec::JSON, &serde_json::to_vec(&malformed.body).unwrap()) {
            assert!((15..=512).contains(&violation.detail.len()), "{violation:?}");
        }
    }
}

#[test]
fn of_very_many_faults_the_first_are_reported() {
    let mut contribution = example();
    contribution.segments = vec![contribution.segments[0].clone(); 1000];
    for segment in &mut contribution.segments {
        segment.points = 0;
    }
    let found = check_contribution(&contribution, &target()).unwrap_err();
    assert_eq!(found.len(), VIOLATIONS_MAX);
    assert_eq!(found[31].pointer, "/segments/31/points");
}

#[test]
fn what_json_cannot_say_is_refused_in_cbor() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut contribution = example();
        contribution.pose.covariance[2][1] = value;
        contribution.segments[0].ends[1].sd_m = value;
        contribution.clusters[0].hull_m[2][0] = value;
        let body = codec::to_cbor(&contribution).unwrap();
        let said: Vec<(String, String)> =
            refusals(codec::CBOR, &body).into_iter().map(|v| (v.code, v.pointer)).collect();
        let at = |pointer: &str| ("not_finite".to_owned(), pointer.to_owned());
        assert_eq!(
            said,
            [
                at("/pose/covariance/2/1"),
                at("/segments/0/ends/1/sd_m"),
                at("/clusters/0/hull_m/2/0")
            ]
        );
    }
}

#[test]
fn shape_is_refused_by_place_in_cbor_too() {
    // Members in alphabetical order and UUIDs as text, as a CBOR library of another language
    // would write them from JSON.
    let body = serde_json::to_value(example()).unwrap();
    let refused = refusals(codec::CBOR, &codec::to_cbor(&body).unwrap());
    assert_eq!(refused[0].code, "unexpected_shape");
    assert_eq!(refused[0].pointer, "/frame", "a UUID is a byte string in CBOR");

    let contribution = example();
    let mut bytes = codec::to_cbor(&contribution).unwrap();
    let at = bytes.windows(8).position(|w| w == b"\x66points\x18").unwrap();
    bytes[at + 7] = 0x38; // the same number, negative
    let refused = refusals(codec::CBOR, &bytes);
    assert_eq!(
        (&*refused[0].code, &*refused[0].pointer),
        ("unexpected_shape", "/segments/0/points")
    );
}

#[test]
fn bodies_that_are_not_well_formed_are_told_from_wrong_shapes() {
    let json = |text: &str| codec::from_json::<v1::Contribution>(text.as_bytes());
    for text in ["", "{", "{]", "nul", "{} {}", "\u{feff}{}", "{\"x\": NaN}"] {
        assert!(matches!(json(text), Err(DecodeError::Json(_))), "{text}");
    }
    let huge = r#"{"pose": {"x_m": 1e400}}"#;
    assert!(matches!(json(huge), Err(DecodeError::Shape(v)) if v.pointer == "/pose/x_m"));
    let twice = r#"{"robot": "a", "robot": "b"}"#;
    assert!(matches!(json(twice), Err(DecodeError::Shape(v)) if v.detail.contains("duplicate")));

    let cbor = |bytes: &[u8]| codec::from_cbor::<v1::Contribution>(bytes);
    for bytes in [&b""[..], b"\xa1", b"\xa1\x61", b"\xbf", b"\x1b\x00", b"\xa0\xa0"] {
        assert!(matches!(cbor(bytes), Err(DecodeError::Cbor(_))), "{bytes:x?}");
    }
    assert!(matches!(cbor(b"\x01"), Err(DecodeError::Shape(v)) if v.pointer.is_empty()));
    let mut trailing = codec::to_cbor(&example()).unwrap();
    trailing.push(0);
    assert!(matches!(cbor(&trailing), Err(DecodeError::Cbor(_))));
}

#[test]
fn errors_do_not_repeat_megabytes() {
    let word = "x".repeat(1_000_000);
    let text = format!(r#"{{"{word}": 1}}"#);
    let Err(DecodeError::Shape(violation)) = codec::from_json::<v1::Contribution>(text.as_bytes())
    else {
        panic!("an unknown member is refused");
    };
    assert!(violation.pointer.len() <= 512 && violation.detail.len() <= 512);
}

#[test]
fn uploads_are_one_or_many() {
    let one = example();
    for media_type in ["application/json", "Application/CBOR; v=1"] {
        let body = codec::encode(media_type, &one).unwrap();
        assert_eq!(codec::decode_uploads(media_type, &body), Ok((vec![one.clone()], false)));
        let body = codec::encode(media_type, &vec![one.clone(), one.clone()]).unwrap();
        assert_eq!(
            codec::decode_uploads(media_type, &body),
            Ok((vec![one.clone(), one.clone()], true))
        );
        let body = codec::encode(media_type, &Vec::<v1::Contribution>::new()).unwrap();
        assert_eq!(codec::decode_uploads(media_type, &body), Ok((vec![], true)));
    }
    let body = [b" \r\n\t".as_slice(), &codec::to_json(&[&one]).unwrap()].concat();
    assert!(codec::decode_uploads(codec::JSON, &body).unwrap().1);
    assert!(matches!(
        codec::decode_uploads("text/plain", b"{}"),
        Err(DecodeError::MediaType(t)) if t == "text/plain"
    ));
}

#[test]
fn a_fault_in_a_batch_is_found_at_its_place() {
    let mut body = serde_json::json!([example(), example()]);
    body[1]["pose"]["x_m"] = serde_json::json!("here");
    let refused = codec::decode_uploads(codec::JSON, &serde_json::to_vec(&body).unwrap());
    assert!(matches!(refused, Err(DecodeError::Shape(v)) if v.pointer == "/1/pose/x_m"));
}

#[test]
fn a_batch_can_be_taken_apart_so_that_one_fault_spoils_one_element() {
    let body = serde_json::json!([example(), {"nonsense": [1, [2]]}, example()]);
    let json = serde_json::to_vec(&body).unwrap();
    let item = codec::to_cbor(&example()).unwrap();
    let known_length = [&[0x82], item.as_slice(), &[0x19, 1, 0]].concat();
    let unknown_length = [&[0x9f], item.as_slice(), &[0x80, 0xff]].concat();

    let split = codec::split_array(codec::JSON, &json, 64).unwrap();
    assert_eq!(split.len(), 3);
    assert_eq!(codec::from_json::<v1::Contribution>(split[2]), Ok(example()));
    assert_eq!(split[1], br#"{"nonsense":[1,[2]]}"#);
    for body in [&known_length, &unknown_length] {
        let split = codec::split_array(codec::CBOR, body, 64).unwrap();
        assert_eq!(split.len(), 2);
        assert_eq!(codec::from_cbor::<v1::Contribution>(split[0]), Ok(example()));
    }
    assert_eq!(codec::split_array(codec::JSON, b"[1,2,3,4,5]", 2).unwrap(), [b"1", b"2", b"3"]);
    assert_eq!(codec::split_array(codec::CBOR, &[0x84, 1, 2, 3, 4], 2).unwrap().len(), 3);
    for bad in [b"{}".as_slice(), b"[1,", b"[1] 2", b"7"] {
        assert!(matches!(codec::split_array(codec::JSON, bad, 2), Err(DecodeError::Json(_))));
    }
    for bad in [[0x82, 1].as_slice(), &[0x9f, 1], &[0xa0], &[], &[0x81, 1, 1], &[0x9f, 0xff, 1]] {
        assert!(matches!(codec::split_array(codec::CBOR, bad, 2), Err(DecodeError::Cbor(_))));
    }
}

#[test]
fn certainty_below_the_floor_buys_nothing() {
    let claim = |factor: f64| {
        let mut contribution = example();
        let scale = |entry: f64| entry * factor;
        let pose = &mut contribution.pose.covariance;
        *pose = pose.map(|row| row.map(scale));
        let line = &mut contribution.segments[0].covariance;
        *line = line.map(|row| row.map(scale));
        let centroid = &mut contribution.clusters[0].covariance;
        *centroid = centroid.map(|row| row.map(scale));
        contribution.segments[0].ends[0].sd_m *= factor;
        contribution.segments[0].ends[1].sd_m *= factor;
        check_contribution(&contribution, &target()).unwrap()
    };
    let floored = claim(0.0);
    let pose = floored.level_from_robot.covariance;
    assert!((pose.sd(0) - 0.005).abs() < 1e-12 && (pose.sd(1) - 0.005).abs() < 1e-12);
    assert!((pose.sd(2) - 0.05_f64.to_radians()).abs() < 1e-12);
    let line = floored.segments[0].line.covariance;
    assert!((line.sd(0) - 0.001).abs() < 1e-12);
    assert!((line.sd(1) - 0.02_f64.to_radians()).abs() < 1e-12);
    for factor in [1e-300, 1e-30, 1e-6] {
        assert_eq!(claim(factor), floored);
    }
    assert_ne!(claim(1.0), floored);
}

#[test]
fn a_direction_that_is_too_certain_is_floored_and_the_others_stay() {
    let mut contribution = example();
    // Standard deviations of 1 m, but the sum of x and y known to be without error.
    contribution.pose.covariance = [[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let checked = check_contribution(&contribution, &target()).unwrap();
    let c = *checked.level_from_robot.covariance.matrix();
    let along_sum = 0.5 * (c[(0, 0)] + c[(1, 1)]) + c[(0, 1)];
    let along_difference = 0.5 * (c[(0, 0)] + c[(1, 1)]) - c[(0, 1)];
    assert!((along_sum - 0.005_f64.powi(2)).abs() < 1e-10);
    assert!((along_difference - 2.0).abs() < 1e-9);
    assert!((c[(2, 2)] - 1.0).abs() < 1e-12);
}

#[test]
fn what_is_only_unusual_is_normalised() {
    let mut contribution = example();
    contribution.pose.x_m = -0.0;
    contribution.pose.y_m = 5e-324;
    contribution.pose.heading_rad = 6.0;
    contribution.segments[0].alpha_rad = -6.0;
    contribution.pose.covariance[2][0] = -1e-310;
    let checked = check_contribution(&contribution, &target()).unwrap();
    let pose = checked.level_from_robot.pose;
    assert_eq!((pose.x.to_bits(), pose.y.to_bits()), (0, 0));
    assert!((pose.heading() - (6.0 - std::f64::consts::TAU)).abs() < 1e-15);
    let alpha = checked.segments[0].line.line.alpha();
    assert!((alpha - (std::f64::consts::TAU - 6.0)).abs() < 1e-15);
    assert_eq!(checked.level_from_robot.covariance.rows()[2][0].to_bits(), 0);
}

#[test]
fn a_contribution_of_only_a_pose_is_valid() {
    let mut contribution = example();
    contribution.segments.clear();
    contribution.clusters.clear();
    contribution.evidence.clear();
    let checked = check_contribution(&contribution, &target()).unwrap();
    assert!(checked.segments.is_empty() && checked.evidence.is_empty());
}

#[test]
fn a_tile_lies_within_the_level_with_its_far_edge_too() {
    let accepted = |x: i32, coordinate_max_m: f64| {
        let mut target = target();
        target.limits.coordinate_max_m = coordinate_max_m;
        let mut contribution = example();
        contribution.evidence[0].tiles.truncate(1);
        contribution.evidence[0].tiles[0].x = x;
        check_contribution(&contribution, &target).is_ok()
    };
    // A tile is 64 cells of 0.05 m, so ten of them reach to 32 m.
    assert!(accepted(9, 32.0) && accepted(-10, 32.0));
    assert!(!accepted(10, 32.0) && !accepted(-11, 32.0));
    // Whatever a site allows, the numbers of cells must fit.
    assert!(accepted(1 << 24, 1e12));
    assert!(!accepted(i32::MAX, 1e12) && !accepted(i32::MIN, 1e12));
}
