//! From the map to the wire and back: bit for bit.

#![expect(clippy::needless_pass_by_value, reason = "map_err passes by value")]

use std::sync::Arc;

use mapfold_map::geometry::{
    Covariance, Interval, Line, Point, Pose, UncertainLine, UncertainPose, convex_hull,
};
use mapfold_map::level::{Contribution, ContributionId, FeatureId, Patch, Provenance, RobotName};
use mapfold_map::raster::{
    EvidencePatch, LogOdds, SensorClass, TILE_CELLS, Tile, TileIndex, TileKey, TilePatch,
};
use mapfold_map::vector::{
    Chain, ChainId, ChainKind, Cluster, EndKind, Facing, ObservedCluster, ObservedEnd,
    ObservedSegment, Segment, SolidInterval, Vertex,
};
use mapfold_schema::border::{
    DEFAULT_LIMITS, Target, Violation, chain_id, check_contribution, feature_id, map_chain,
    map_cluster, map_patch, map_segment, map_tile, parse_chain_id, parse_feature_id, wire_chain,
    wire_cluster, wire_contribution, wire_patch, wire_segment, wire_tile,
};
use mapfold_schema::codec::{self, CBOR, JSON};
use mapfold_schema::digest::content_digest;
use mapfold_schema::instant::{parse_rfc3339, to_rfc3339};
use mapfold_schema::v1;
use proptest::collection::{btree_map, btree_set, vec};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use uuid::Uuid;

/// 0000-01-01T00:00:00Z and the last microsecond of 9999.
const INSTANTS_US: std::ops::RangeInclusive<i64> =
    -62_167_219_200_000_000..=253_402_300_799_999_999;

fn target() -> Target {
    Target { frame: Uuid::from_u128(7), resolution_m: 0.05, limits: DEFAULT_LIMITS }
}

fn angle() -> impl Strategy<Value = f64> {
    prop_oneof![
        9 => -std::f64::consts::PI.next_down()..=std::f64::consts::PI,
        1 => prop::sample::select(vec![0.0, 1e-300, -1e-300, std::f64::consts::PI, -1e-17]),
    ]
}

/// A covariance with standard deviations around `sds`: L L^T with every direction above a
/// quarter of them.
fn covariance<const N: usize>(sds: [f64; N]) -> impl Strategy<Value = Covariance<N>> {
    vec(-1.0..1.0_f64, N * N).prop_filter_map("not a covariance", move |factor| {
        let entry = |i: usize, j: usize| -> f64 {
            let product: f64 = (0..N).map(|k| factor[N * i + k] * factor[N * j + k]).sum();
            let regular = if i == j { product + 0.1 } else { product };
            regular * (sds[i] * sds[j])
        };
        let mut rows = [[0.0; N]; N];
        for (i, row) in rows.iter_mut().enumerate() {
            for (j, slot) in row.iter_mut().enumerate() {
                *slot = entry(i, j);
            }
        }
        Covariance::from_rows(rows).ok()
    })
}

fn end_kind() -> impl Strategy<Value = EndKind> + Clone {
    prop::sample::select(vec![EndKind::Corner, EndKind::Jump, EndKind::Occluded])
}

fn facing() -> impl Strategy<Value = Facing> {
    prop::sample::select(vec![Facing::Origin, Facing::Away])
}

fn class() -> impl Strategy<Value = SensorClass> {
    prop::sample::select(SensorClass::ALL.to_vec())
}

fn robots() -> impl Strategy<Value = Vec<RobotName>> {
    vec("[a-z]([a-z0-9-]{0,10}[a-z0-9])?", 1..4)
        .prop_map(|names| names.iter().map(|n| RobotName::from(n.as_str())).collect())
}

fn feature() -> impl Strategy<Value = FeatureId> {
    (any::<[u8; 16]>(), any::<u16>())
        .prop_map(|(id, index)| FeatureId { contribution: ContributionId(id), index })
}

fn solids() -> impl Strategy<Value = Vec<SolidInterval>> {
    let piece = (0..5_000_i64, 1..100_000_i64, [end_kind(), end_kind()], any::<i32>());
    (-1_000_000_000..1_000_000_000_i64, vec(piece, 1..5)).prop_map(|(start, pieces)| {
        let mut free_from = start;
        let mut solids = Vec::new();
        for (gap, length, ends, existence) in pieces {
            let from = free_from + gap;
            free_from = from + length;
            let (span, existence) = (Interval { from, to: free_from }, LogOdds(existence));
            solids.push(SolidInterval { span, ends, existence });
        }
        solids
    })
}

fn segment() -> impl Strategy<Value = Segment> {
    (
        (0.0..1e5_f64, angle(), covariance([0.02, 0.01]), covariance([30.0, 0.3])),
        (facing(), solids(), any::<u32>(), robots(), INSTANTS_US, INSTANTS_US),
    )
        .prop_map(|((rho, alpha, independent, dependent), rest)| {
            let (facing, solid, looks, robots, first_seen_us, last_seen_us) = rest;
            let line = Line::normal_form(rho, alpha).0;
            Segment {
                line,
                independent,
                dependent,
                facing,
                solid,
                looks,
                robots,
                first_seen_us,
                last_seen_us,
            }
        })
}

fn point(reach: f64) -> impl Strategy<Value = Point> {
    (-reach..reach, -reach..reach).prop_map(|(x, y)| Point::new(x, y))
}

fn cluster() -> impl Strategy<Value = Cluster> {
    (
        (vec(point(1e4), 1..9), point(1e4), covariance([0.1, 0.1])),
        (any::<u64>(), any::<u32>(), robots(), INSTANTS_US, INSTANTS_US),
    )
        .prop_map(|((hull, centroid, covariance), rest)| {
            let (points, looks, robots, first_seen_us, last_seen_us) = rest;
            Cluster {
                hull,
                centroid,
                covariance,
                points,
                looks,
                robots,
                first_seen_us,
                last_seen_us,
            }
        })
}

fn chain_key() -> impl Strategy<Value = ChainId> {
    (feature(), any::<i16>()).prop_map(|(segment, piece)| ChainId { segment, piece })
}

fn chain() -> impl Strategy<Value = Chain> {
    let vertex =
        (point(1e4), covariance([0.1, 0.1])).prop_map(|(at, covariance)| Vertex { at, covariance });
    (
        (0..3_usize, vec((vertex, feature()), 3..9)),
        (any::<u32>(), robots(), INSTANTS_US, INSTANTS_US),
    )
        .prop_map(|((kind, corners), rest)| {
            let (looks, robots, first_seen_us, last_seen_us) = rest;
            let kind = [ChainKind::Polyline, ChainKind::Obstacle, ChainKind::Room][kind];
            let (vertices, mut segments): (Vec<_>, Vec<_>) = corners.into_iter().unzip();
            if !kind.is_closed() {
                segments.pop();
            }
            Chain { kind, vertices, segments, looks, robots, first_seen_us, last_seen_us }
        })
}

/// Cells in runs, as evidence is.
fn cells<T: Copy + Default + std::fmt::Debug + 'static>(
    value: impl Strategy<Value = T>,
) -> impl Strategy<Value = Box<[T; TILE_CELLS]>> {
    vec((0..TILE_CELLS, 1..200_usize, value), 1..20).prop_map(|runs| {
        let mut cells = Box::new([T::default(); TILE_CELLS]);
        for (start, length, value) in runs {
            cells[start..(start + length).min(TILE_CELLS)].fill(value);
        }
        cells
    })
}

fn key() -> impl Strategy<Value = TileKey> {
    const MAX: i32 = i32::MAX / 64 - 1;
    (class(), -MAX..=MAX, -MAX..=MAX)
        .prop_map(|(class, x, y)| TileKey { class, tile: TileIndex { x, y } })
}

fn patch() -> impl Strategy<Value = Patch> {
    let tile = || cells(any::<i32>()).prop_map(|cells| Arc::new(Tile::new(cells)));
    (
        btree_map(feature(), segment().prop_map(Arc::new), 0..3),
        btree_map(feature(), cluster().prop_map(Arc::new), 0..3),
        btree_map(chain_key(), chain().prop_map(Arc::new), 0..3),
        btree_map(key(), tile(), 0..3),
        (btree_map(key().prop_map(|key| key.tile), tile(), 0..3), vec(key(), 0..3)),
        (vec(feature(), 0..3), vec(feature(), 0..3), vec(chain_key(), 0..3), vec(key(), 0..3)),
    )
        .prop_map(|(segments, clusters, chains, tiles, (prior, gone), removed)| {
            let (removed_segments, removed_clusters, removed_chains, removed_tiles) = removed;
            let removed_prior = gone.into_iter().map(|key| key.tile).collect();
            Patch {
                segments,
                clusters,
                chains,
                tiles,
                prior,
                removed_segments,
                removed_clusters,
                removed_chains,
                removed_tiles,
                removed_prior,
            }
        })
}

fn observed_segment() -> impl Strategy<Value = ObservedSegment> {
    let end = (end_kind(), 0.001..1.0_f64).prop_map(|(kind, sd)| ObservedEnd { kind, sd });
    (
        (0.0..50.0_f64, angle(), covariance([0.02, 0.01])),
        (-50.0..50.0_f64, 0.02..80.0_f64, facing(), [end.clone(), end], 1..u32::MAX),
        btree_set(-60_000..60_000_i64, 0..5),
    )
        .prop_map(|((rho, alpha, covariance), (from, length, facing, ends, points), marks)| {
            let line = UncertainLine { line: Line::normal_form(rho, alpha).0, covariance };
            let marks: Vec<i64> = marks.into_iter().collect();
            let seen_through =
                marks.chunks_exact(2).map(|m| Interval { from: m[0], to: m[1] }).collect();
            ObservedSegment { line, from, to: from + length, facing, ends, points, seen_through }
        })
}

fn observed_cluster() -> impl Strategy<Value = ObservedCluster> {
    (vec(point(5.0), 1..12), covariance([0.1, 0.1])).prop_map(|(points, covariance)| {
        let centroid = points.iter().sum::<Point>() / points.len() as f64;
        let points_count = points.len() as u32;
        ObservedCluster { hull: convex_hull(&points), centroid, covariance, points: points_count }
    })
}

fn evidence(class: SensorClass) -> impl Strategy<Value = EvidencePatch> {
    let value = prop_oneof![-400..0_i16, 1..=400_i16];
    let index = (-30_000..30_000, -30_000..30_000).prop_map(|(x, y)| TileIndex { x, y });
    let tile = cells(value).prop_map(|cells| TilePatch::from_cells(&cells));
    btree_map(index, tile, 0..4).prop_map(move |tiles| EvidencePatch { class, tiles })
}

fn contribution() -> impl Strategy<Value = Contribution> {
    let provenance =
        prop::sample::select(vec![Provenance::Datum, Provenance::SharedMap, Provenance::Odometry]);
    let evidence = (evidence(SensorClass::Sonar), evidence(SensorClass::Scanner));
    (
        (any::<u128>(), robots(), 0..7_258_118_400_000_000_i64),
        (-9e4..9e4_f64, -9e4..9e4_f64, angle(), covariance([0.3, 0.3, 0.1]), provenance),
        vec(observed_segment(), 0..4),
        vec(observed_cluster(), 0..4),
        evidence,
    )
        .prop_map(|((id, robots, observed_at_us), pose, segments, clusters, evidence)| {
            let (x, y, heading, covariance, provenance) = pose;
            let id = uuid::Builder::from_u128(id).with_version(uuid::Version::SortRand);
            let id = id.with_variant(uuid::Variant::RFC4122).into_uuid();
            Contribution {
                id: ContributionId(id.into_bytes()),
                robot: Arc::clone(&robots[0]),
                observed_at_us,
                level_from_robot: UncertainPose { pose: Pose::new(x, y, heading), covariance },
                provenance,
                segments,
                clusters,
                evidence: vec![evidence.0, evidence.1],
            }
        })
}

/// What comes out when `value` travels in both formats: the same twice, bit for bit.
fn travelled<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(value: &T) -> T {
    let [json, cbor] = [JSON, CBOR].map(|media_type| {
        let bytes = codec::encode(media_type, value);
        bytes.map(|bytes| codec::decode::<T>(media_type, &bytes))
    });
    let (Ok(Ok(json)), Ok(Ok(cbor))) = (json, cbor) else { panic!("{value:?} does not travel") };
    assert_eq!(codec::to_cbor(&json), codec::to_cbor(&cbor));
    assert_eq!(&cbor, value);
    cbor
}

proptest! {
    #[test]
    fn a_feature_id_survives(id in feature()) {
        prop_assert_eq!(parse_feature_id(&feature_id(&id)), Some(id));
    }

    #[test]
    fn a_segment_survives(id in feature(), segment in segment()) {
        let wire = wire_segment(&id, &segment);
        let (id_back, back) = map_segment(&travelled(&wire)).map_err(fail)?;
        prop_assert_eq!(&(id_back, &back), &(id, &segment));
        prop_assert_eq!(codec::to_cbor(&wire_segment(&id_back, &back)), codec::to_cbor(&wire));
    }

    #[test]
    fn a_chain_survives(id in chain_key(), chain in chain()) {
        let wire = wire_chain(&id, &chain);
        let (id_back, back) = map_chain(&travelled(&wire)).map_err(fail)?;
        prop_assert_eq!(&(id_back, &back), &(id, &chain));
        prop_assert_eq!(codec::to_cbor(&wire_chain(&id_back, &back)), codec::to_cbor(&wire));
        prop_assert_eq!(parse_chain_id(&chain_id(&id)), Some(id));
    }

    #[test]
    fn a_cluster_survives(id in feature(), cluster in cluster()) {
        let wire = wire_cluster(&id, &cluster);
        let (id_back, back) = map_cluster(&travelled(&wire)).map_err(fail)?;
        prop_assert_eq!(&(id_back, &back), &(id, &cluster));
        prop_assert_eq!(codec::to_cbor(&wire_cluster(&id_back, &back)), codec::to_cbor(&wire));
    }

    #[test]
    fn a_tile_survives(key in key(), cells in cells(any::<i32>())) {
        let tile = Tile::new(cells);
        let back = map_tile(&travelled(&wire_tile(&key, &tile))).map_err(fail)?;
        prop_assert_eq!(back, (key, tile));
    }

    #[test]
    fn a_patch_survives(patch in patch(), since in 0..9_i64, more in any::<bool>()) {
        let wire: v1::Patch = travelled(&wire_patch(&patch, since, since + 1, more));
        prop_assert_eq!((wire.since, wire.revision, wire.more), (since, since + 1, more));
        prop_assert_eq!(map_patch(&wire).map_err(fail_all)?, patch);
    }

    #[test]
    fn a_contribution_survives(contribution in contribution(), emulated in any::<bool>()) {
        let wire = travelled(&wire_contribution(&contribution, target().frame, emulated, None));
        prop_assert_eq!(wire.emulated, emulated);
        let back = check_contribution(&wire, &target()).map_err(fail_all)?;
        prop_assert_eq!(&back, &contribution);
        let again = wire_contribution(&back, target().frame, emulated, None);
        prop_assert_eq!(content_digest(&again), content_digest(&wire));
    }

    #[test]
    fn an_instant_survives_at_one_width(us in INSTANTS_US) {
        let text = to_rfc3339(us);
        prop_assert_eq!(text.len(), 27);
        prop_assert_eq!(parse_rfc3339(&text), Some(us));
    }

    #[test]
    fn any_instant_has_a_text_and_later_ones_sort_later(a in any::<i64>(), b in any::<i64>()) {
        let (a, b) = (a.min(b), a.max(b));
        prop_assert!(to_rfc3339(a) <= to_rfc3339(b));
        prop_assert_eq!(to_rfc3339(a).len(), 27);
    }

    #[test]
    fn a_millimetre_survives_as_metres(mm in -1_000_000_000_000..1_000_000_000_000_i64) {
        let there = Interval { from: mm, to: mm + 1 };
        prop_assert_eq!(Interval::from_metres(there.from_m(), there.to_m()), there);
        let text = there.from_m().to_string();
        let decimals = text.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        prop_assert!(decimals <= 3, "{}", text);
    }
}

fn fail(violation: Violation) -> TestCaseError {
    TestCaseError::fail(format!("{violation:?}"))
}

fn fail_all(violations: Vec<Violation>) -> TestCaseError {
    TestCaseError::fail(format!("{violations:?}"))
}

#[test]
fn instants_are_read_with_any_offset_and_rounded_down() {
    assert_eq!(to_rfc3339(0), "1970-01-01T00:00:00.000000Z");
    assert_eq!(to_rfc3339(-1), "1969-12-31T23:59:59.999999Z");
    assert_eq!(to_rfc3339(1_795_320_000_123_456), "2026-11-22T04:00:00.123456Z");
    assert_eq!(to_rfc3339(i64::MAX), "9999-12-31T23:59:59.999999Z");
    assert_eq!(to_rfc3339(i64::MIN), "0000-01-01T00:00:00.000000Z");
    assert_eq!(parse_rfc3339("1970-01-01T01:00:00.0000019+01:00"), Some(1));
    assert_eq!(parse_rfc3339("1969-12-31T23:59:59.9999999Z"), Some(-1));
    for text in ["", "now", "1970-01-01", "1970-01-01T00:00:00", "1970-13-01T00:00:00Z"] {
        assert_eq!(parse_rfc3339(text), None, "{text}");
    }
}

#[test]
fn only_what_we_write_is_a_feature_id() {
    let uuid = "01927d3b-5a00-7abc-8def-0123456789ab";
    assert!(parse_feature_id(&format!("{uuid}-65535")).is_some());
    for text in ["", "-", "7", uuid, "-7", "--7", &format!("{uuid}-"), &format!("{uuid}-65536")] {
        assert_eq!(parse_feature_id(text), None, "{text}");
    }
    for index in ["007", "+7", " 7", "7 ", "-7", "1e3"] {
        assert_eq!(parse_feature_id(&format!("{uuid}-{index}")), None, "{index}");
    }
    let upper = format!("{}-7", uuid.to_uppercase());
    assert_eq!(parse_feature_id(&upper), None);
}

#[test]
fn the_digest_is_that_of_the_bytes_and_does_not_depend_on_the_format() {
    let contribution = mapfold_schema::malformed::valid(Uuid::from_u128(0), "r1", &target());
    let digest = content_digest(&contribution);
    assert_eq!(content_digest(&travelled(&contribution)), digest);
    let other = v1::Contribution { emulated: true, ..contribution };
    assert_ne!(content_digest(&other), digest);
    assert!(
        digest.is_ok_and(|d| d.len() == 64 && d.bytes().all(|b| b"0123456789abcdef".contains(&b)))
    );
}

/// Code and pointer of what a change to a segment is refused with.
type Refusal = (&'static str, &'static str, fn(&mut v1::Segment));

#[test]
fn a_mirror_refuses_what_it_could_not_keep_exactly() {
    let id = FeatureId { contribution: ContributionId([7; 16]), index: 1 };
    let segment = Segment {
        line: Line::normal_form(3.0, 0.5).0,
        independent: Covariance::from_variances([1e-4, 1e-4]),
        dependent: Covariance::from_variances([1e-3, 1e-5]),
        facing: Facing::Away,
        solid: vec![SolidInterval {
            span: Interval { from: -5, to: 7 },
            ends: [EndKind::Jump, EndKind::Corner],
            existence: LogOdds(578),
        }],
        looks: 2,
        robots: vec!["r1".into()],
        first_seen_us: 0,
        last_seen_us: 1,
    };
    let refused = |change: fn(&mut v1::Segment)| {
        let mut wire = wire_segment(&id, &segment);
        change(&mut wire);
        map_segment(&wire).map_err(|v| (v.code, v.pointer)).err()
    };
    assert_eq!(refused(|_| ()), None);
    let cases: [Refusal; 12] = [
        ("negative", "/rho_m", |s| s.rho_m = -3.0),
        ("not_finite", "/rho_m", |s| s.rho_m = f64::NAN),
        ("not_wrapped", "/alpha_rad", |s| s.alpha_rad = 3.5),
        ("covariance_not_sum", "/covariance", |s| s.covariance[0][0] *= 1.001),
        ("not_symmetric", "/covariance_dependent/1/0", |s| s.covariance_dependent[0][1] = 1e-5),
        ("not_millimetres", "/solid/0/to_m", |s| s.solid[0].to_m = 0.0071),
        ("out_of_order", "/solid/0", |s| s.solid[0].to_m = -0.005),
        ("out_of_range", "/solid/0/from_m", |s| s.solid[0].from_m = -1e300),
        ("not_hundredths", "/solid/0/existence_nat", |s| s.solid[0].existence_nat = 2.891),
        ("bad_feature_id", "/id", |s| s.id.clear()),
        ("bad_slug", "/robots/0", |s| s.robots[0].clear()),
        ("bad_instant", "/last_seen", |s| s.last_seen.clear()),
    ];
    for (code, pointer, change) in cases {
        assert_eq!(refused(change), Some((code.to_owned(), pointer.to_owned())));
    }
}

/// The same for a chain.
type ChainRefusal = (&'static str, &'static str, fn(&mut v1::Chain));

#[test]
fn a_mirror_refuses_chains_that_do_not_hang_together() {
    let segment = FeatureId { contribution: ContributionId([7; 16]), index: 1 };
    let corner = |x: f64, y: f64| Vertex {
        at: Point::new(x, y),
        covariance: Covariance::from_variances([1e-4, 1e-4]),
    };
    let chain = Chain {
        kind: ChainKind::Room,
        vertices: vec![corner(0.0, 0.0), corner(2.0, 0.0), corner(2.0, 1.0)],
        segments: vec![segment; 3],
        looks: 2,
        robots: vec!["r1".into()],
        first_seen_us: 0,
        last_seen_us: 1,
    };
    let refused = |change: fn(&mut v1::Chain)| {
        let mut wire = wire_chain(&ChainId { segment, piece: -1 }, &chain);
        change(&mut wire);
        map_chain(&wire).map_err(|v| (v.code, v.pointer)).err()
    };
    assert_eq!(refused(|_| ()), None);
    let cases: [ChainRefusal; 9] = [
        ("bad_chain_id", "/id", |c| c.id.push('x')),
        ("bad_chain_id", "/id", |c| c.id = c.segments[0].clone()),
        ("kind_mismatch", "/closed", |c| c.closed = false),
        ("too_few", "/vertices_m", |c| {
            c.vertices_m.pop();
            c.covariances.pop();
            c.segments.pop();
        }),
        ("not_finite", "/vertices_m/1/0", |c| c.vertices_m[1][0] = f64::NAN),
        ("wrong_count", "/covariances", |c| c.covariances.truncate(2)),
        ("not_positive_semidefinite", "/covariances/2", |c| c.covariances[2][0][0] = -1.0),
        ("wrong_count", "/segments", |c| c.segments.truncate(2)),
        ("bad_feature_id", "/segments/0", |c| c.segments[0].clear()),
    ];
    for (code, pointer, change) in cases {
        assert_eq!(refused(change), Some((code.to_owned(), pointer.to_owned())));
    }
}

#[test]
fn a_patch_names_the_places_of_its_faults() {
    let tile = |runs| v1::TileEvidence { sensor: v1::SensorClass::Sonar, x: 0, y: 0, runs };
    let patch = v1::Patch {
        since: 0,
        revision: 1,
        more: false,
        segments: vec![],
        clusters: vec![],
        chains: vec![],
        tiles: vec![
            tile(vec![0, 1, 5]),
            tile(vec![0, 1, 5]),
            tile(vec![0, 1]),
            tile(vec![0, i32::MAX, 5]),
            tile(vec![4, 1, 5, 4, 1, 5]),
            tile(vec![4, 1, 0]),
            v1::TileEvidence { x: i32::MIN, ..tile(vec![]) },
        ],
        prior: vec![v1::PriorTile { x: 0, y: 0, runs: vec![4095, 2, 5] }],
        removed: v1::Removed { segments: vec!["x".to_owned()], ..v1::Removed::default() },
    };
    let said: Vec<(String, String)> = map_patch(&patch)
        .err()
        .unwrap_or_default()
        .into_iter()
        .map(|v| (v.code, v.pointer))
        .collect();
    let expected = [
        ("duplicate", "/tiles/1"),
        ("not_triples", "/tiles/2/runs"),
        ("bad_run", "/tiles/3/runs/0"),
        ("bad_run", "/tiles/4/runs/3"),
        ("bad_run", "/tiles/5/runs/0"),
        ("out_of_range", "/tiles/6/x"),
        ("bad_run", "/prior/0/runs/0"),
        ("bad_feature_id", "/removed/segments/0"),
    ];
    assert_eq!(said, expected.map(|(code, pointer)| (code.to_owned(), pointer.to_owned())));
}
