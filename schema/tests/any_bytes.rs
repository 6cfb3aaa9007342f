//! Whatever bytes arrive: reading them answers, never panics, and never overflows the stack.

use mapfold_schema::border::{DEFAULT_LIMITS, Target, check_contribution, map_patch};
use mapfold_schema::codec::{self, CBOR, JSON};
use mapfold_schema::malformed::valid;
use mapfold_schema::v1;
use proptest::prelude::*;
use uuid::Uuid;

fn target() -> Target {
    Target { frame: Uuid::from_u128(7), resolution_m: 0.05, limits: DEFAULT_LIMITS }
}

/// Reads `bytes` as everything that arrives from outside, as far as it goes.
fn read_as_everything(bytes: &[u8]) {
    for media_type in [JSON, CBOR] {
        if let Ok((uploads, _)) = codec::decode_uploads(media_type, bytes) {
            for upload in &uploads {
                let _ = check_contribution(upload, &target());
            }
        }
        for element in codec::split_array(media_type, bytes, 3).unwrap_or_default() {
            let _ = codec::decode::<v1::Contribution>(media_type, element);
        }
        if let Ok(patch) = codec::decode::<v1::Patch>(media_type, bytes) {
            let _ = map_patch(&patch);
        }
        let _ = codec::decode::<v1::NewSite>(media_type, bytes);
        let _ = codec::decode::<v1::NewLevel>(media_type, bytes);
        let _ = codec::decode::<v1::NewRobot>(media_type, bytes);
        let _ = codec::decode::<v1::RobotUpdate>(media_type, bytes);
        let _ = codec::decode::<v1::NewToken>(media_type, bytes);
        let _ = codec::decode::<v1::ContributionPage>(media_type, bytes);
        let _ = codec::decode::<v1::LevelEvent>(media_type, bytes);
    }
}

fn example() -> v1::Contribution {
    valid(Uuid::from_u128(0x0192_7d3b_5a00_7abc_8def_0123_4567_89ab), "r1", &target())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn random_bytes_are_answered(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        read_as_everything(&bytes);
    }

    #[test]
    fn random_json_like_text_is_answered(text in r#"[\[\]{}",:0-9eE+.a-z\\ -]{0,200}"#) {
        read_as_everything(text.as_bytes());
    }

    #[test]
    fn damaged_uploads_are_answered(
        in_cbor in any::<bool>(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
        grafted in prop::option::of((any::<prop::sample::Index>(), any::<prop::sample::Index>())),
    ) {
        let media_type = if in_cbor { CBOR } else { JSON };
        let mut bytes = codec::encode(media_type, &vec![example(), example()])?;
        if let Some((from, to)) = grafted {
            let (from, to) = (from.index(bytes.len()), to.index(bytes.len()));
            let piece = bytes[from.min(to)..from.max(to)].to_vec();
            bytes.splice(to..to, piece);
        }
        for (place, byte) in damage {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        read_as_everything(&bytes);
    }
}

#[test]
fn deep_nesting_does_not_overflow_the_stack() {
    // Arrays, maps, tags, indefinite arrays and maps; then the same where an unknown or a known
    // member of an object is expected.
    let openings: [&[u8]; 8] =
        [b"[", b"{\"a\":", b"\x81", b"\xa1\x61a", b"\xc1", b"\x9f", b"\xbf\x61a", b"\xd9\xd9\xf7"];
    let before: [&[u8]; 6] = [
        b"",
        b"{\"x\":",
        b"{\"segments\":",
        b"{\"pose\":{\"covariance\":",
        b"\xa1\x61x",
        b"\xa1\x68segments",
    ];
    for opening in openings {
        for before in before {
            read_as_everything(&[before, &opening.repeat(200_000)].concat());
        }
    }
}

#[test]
fn lengths_that_lie_do_not_allocate() {
    // An array, a map, a text and a byte string of 2^63 and 2^32 members, with nothing in them.
    for major in [0x80, 0xa0, 0x60, 0x40_u8] {
        for length in [
            &[0x1b, 0x7f, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff][..],
            &[0x1a, 0xff, 0xff, 0xff, 0xff],
        ] {
            let item = [&[major | length[0]], &length[1..]].concat();
            read_as_everything(&item);
            read_as_everything(&[b"\xa1\x68segments", &*item].concat());
            read_as_everything(&[b"\xa1\x65tiles", &*item].concat());
            read_as_everything(&[b"\xa1\x65robot", &*item].concat());
        }
    }
}
