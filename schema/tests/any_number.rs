//! Whatever bits stand where a number is meant: nothing panics, and nothing that is not finite or
//! not in range gets through.

use mapfold_map::geometry::{Covariance, Point};
use mapfold_map::level::Contribution;
use mapfold_schema::border::{DEFAULT_LIMITS, Target, check_contribution};
use mapfold_schema::codec;
use mapfold_schema::malformed::valid;
use mapfold_schema::v1;
use proptest::prelude::*;
use uuid::Uuid;

const MAX_M: f64 = DEFAULT_LIMITS.coordinate_max_m;

fn target() -> Target {
    Target { frame: Uuid::from_u128(7), resolution_m: 0.05, limits: DEFAULT_LIMITS }
}

fn example() -> v1::Contribution {
    valid(Uuid::from_u128(0x0192_7d3b_5a00_7abc_8def_0123_4567_89ab), "r1", &target())
}

/// Every fractional number of a contribution.
fn fractions(c: &mut v1::Contribution) -> Vec<&mut f64> {
    let pose = &mut c.pose;
    let mut all = vec![&mut pose.x_m, &mut pose.y_m, &mut pose.heading_rad];
    all.extend(pose.covariance.as_flattened_mut());
    if let Some(basis) = &mut pose.basis {
        all.push(&mut basis.way_m);
        all.extend(basis.landmarks_m.as_flattened_mut());
    }
    for s in &mut c.segments {
        all.extend([&mut s.rho_m, &mut s.alpha_rad, &mut s.from_m, &mut s.to_m]);
        all.extend(s.covariance.as_flattened_mut());
        all.extend(s.ends.iter_mut().map(|end| &mut end.sd_m));
        all.extend(s.seen_through_m.as_flattened_mut());
    }
    for k in &mut c.clusters {
        all.extend(k.hull_m.as_flattened_mut());
        all.extend(&mut k.centroid_m);
        all.extend(k.covariance.as_flattened_mut());
    }
    all
}

/// Every signed whole number of a contribution.
fn integers(c: &mut v1::Contribution) -> Vec<&mut i32> {
    let tiles = c.evidence.iter_mut().flat_map(|patch| &mut patch.tiles);
    tiles.flat_map(|t| [&mut t.x, &mut t.y].into_iter().chain(&mut t.runs)).collect()
}

#[test]
fn every_fraction_of_the_wire_type_is_tried() {
    fn count(value: &serde_json::Value) -> usize {
        match value {
            serde_json::Value::Number(n) => usize::from(n.is_f64()),
            serde_json::Value::Array(all) => all.iter().map(count).sum(),
            serde_json::Value::Object(all) => all.values().map(count).sum(),
            _ => 0,
        }
    }
    let mut example = example();
    assert_eq!(count(&serde_json::json!(example)), fractions(&mut example).len());
}

/// Any bits at all, the numbers at which arithmetic breaks, and numbers that may pass.
fn any_fraction() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => any::<u64>().prop_map(f64::from_bits),
        2 => prop::sample::select(vec![
            f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN, f64::MIN_POSITIVE,
            5e-324, -5e-324, 1e-310, 0.0, -0.0, 1e300, -1e300, 1e154, 1e-154, f64::EPSILON,
            MAX_M, -MAX_M, MAX_M.next_up(), std::f64::consts::PI, -std::f64::consts::PI,
            std::f64::consts::TAU, 9_007_199_254_740_992.0,
        ]),
        2 => -10.0..10.0_f64,
        1 => (-1.0..1.0_f64).prop_map(|x| x * 1e-3),
    ]
}

fn assert_psd<const N: usize>(c: &Covariance<N>) {
    let rows = c.rows();
    assert!(rows.as_flattened().iter().all(|entry| entry.is_finite()));
    // The floor makes it positive definite, so it has a Cholesky factor.
    assert!(c.information().is_some(), "{rows:?}");
}

fn assert_point_in_level(c: &Contribution, p: &Point) {
    let p = c.level_from_robot.pose.act(p);
    assert!(p.x.abs() <= MAX_M && p.y.abs() <= MAX_M, "{p}");
}

/// What the fold may rely on.
fn assert_sound(c: &Contribution) {
    let pi = std::f64::consts::PI;
    let pose = &c.level_from_robot.pose;
    assert!(pose.x.abs() <= MAX_M && pose.y.abs() <= MAX_M);
    assert!(pose.heading() > -pi && pose.heading() <= pi);
    assert_psd(&c.level_from_robot.covariance);
    for s in &c.segments {
        let line = &s.line.line;
        assert!((0.0..=MAX_M).contains(&line.rho()));
        assert!(line.alpha() > -pi && line.alpha() <= pi);
        assert_psd(&s.line.covariance);
        assert!((0.01..=1000.0).contains(&(s.to - s.from)) && s.points > 0);
        assert!(s.ends.iter().all(|end| (0.001..=100.0).contains(&end.sd)));
        assert_point_in_level(c, &line.at(s.from));
        assert_point_in_level(c, &line.at(s.to));
        assert!(s.seen_through.windows(2).all(|pair| pair[0].to <= pair[1].from));
        for through in &s.seen_through {
            assert!(through.from < through.to);
            assert_point_in_level(c, &line.at(through.from_m()));
            assert_point_in_level(c, &line.at(through.to_m()));
        }
    }
    for k in &c.clusters {
        assert!(!k.hull.is_empty() && k.points as usize >= k.hull.len());
        assert!(k.centroid.iter().all(|x| x.abs() <= MAX_M));
        assert_psd(&k.covariance);
        k.hull.iter().for_each(|p| assert_point_in_level(c, p));
    }
    for (index, patch) in c.evidence.iter().flat_map(|e| &e.tiles) {
        let edge = MAX_M / (64.0 * 0.05);
        assert!(f64::from(index.x).abs() <= edge && f64::from(index.y).abs() <= edge);
        assert!(!patch.runs().is_empty());
        for run in patch.runs() {
            assert!(run.range().end <= 4096 && !run.range().is_empty());
            assert!(run.value != 0 && i32::from(run.value).abs() <= DEFAULT_LIMITS.evidence_max);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn no_fraction_does_harm(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any_fraction()), 1..4)
    ) {
        let mut contribution = example();
        for (place, value) in changes {
            let mut all = fractions(&mut contribution);
            let place = place.index(all.len());
            *all[place] = value;
        }
        if let Ok(checked) = check_contribution(&contribution, &target()) {
            assert_sound(&checked);
        }
    }

    #[test]
    fn no_covariance_does_harm(entries in prop::array::uniform9(any_fraction())) {
        let mut contribution = example();
        contribution.pose.covariance =
            [0, 3, 6].map(|i| [entries[i], entries[i + 1], entries[i + 2]]);
        contribution.segments[0].covariance = [[entries[0], entries[1]], [entries[1], entries[2]]];
        if let Ok(checked) = check_contribution(&contribution, &target()) {
            assert_sound(&checked);
        }
    }

    #[test]
    fn no_nearly_singular_covariance_does_harm(
        exponents in prop::array::uniform3(-340.0..4.0_f64),
        correlations in prop::array::uniform3(prop_oneof![
            -1.0..=1.0_f64,
            prop::sample::select(vec![0.0, 1.0, -1.0, 1.0_f64.next_up(), 1.0 - 1e-12, 1.0 + 1e-9]),
        ]),
    ) {
        // Symmetric, of any scales, and positive semi-definite only up to rounding, or not at all.
        let sd = exponents.map(|e| 10.0_f64.powf(e / 2.0));
        let mut rows = [[0.0; 3]; 3];
        for (k, (i, j)) in [(0, 1), (0, 2), (1, 2)].into_iter().enumerate() {
            rows[i][j] = correlations[k] * sd[i] * sd[j];
            rows[j][i] = rows[i][j];
        }
        for i in 0..3 {
            rows[i][i] = sd[i] * sd[i];
        }
        let mut contribution = example();
        contribution.pose.covariance = rows;
        contribution.segments[0].covariance = [[rows[0][0], rows[0][1]], [rows[1][0], rows[1][1]]];
        contribution.clusters[0].covariance = [[rows[2][2], rows[1][2]], [rows[1][2], rows[1][1]]];
        if let Ok(checked) = check_contribution(&contribution, &target()) {
            assert_sound(&checked);
        }
    }

    #[test]
    fn no_integer_does_harm(
        changes in prop::collection::vec(
            (
                any::<prop::sample::Index>(),
                prop_oneof![any::<i32>(), -2..5000_i32, -32_000..33_000_i32],
            ),
            1..4,
        ),
        points in prop_oneof![Just(0), 1..10_u32, any::<u32>()],
    ) {
        let mut contribution = example();
        contribution.segments[0].points = points;
        contribution.clusters[0].points = points;
        for (place, value) in changes {
            let mut all = integers(&mut contribution);
            let place = place.index(all.len());
            *all[place] = value;
        }
        if let Ok(checked) = check_contribution(&contribution, &target()) {
            assert_sound(&checked);
        }
    }

    #[test]
    fn json_and_cbor_of_one_contribution_decode_to_the_same_bits(
        changes in prop::collection::vec(
            (any::<prop::sample::Index>(), any_fraction().prop_filter("JSON", |x| x.is_finite())),
            1..8,
        )
    ) {
        let mut contribution = example();
        for (place, value) in changes {
            let mut all = fractions(&mut contribution);
            let place = place.index(all.len());
            *all[place] = value;
        }
        let cbor = codec::to_cbor(&contribution)?;
        let from_cbor: v1::Contribution = codec::from_cbor(&cbor)?;
        let from_json: v1::Contribution = codec::from_json(&codec::to_json(&contribution)?)?;
        // The bytes tell 0 from -0, which == does not.
        prop_assert_eq!(&codec::to_cbor(&from_cbor)?, &cbor);
        prop_assert_eq!(&codec::to_cbor(&from_json)?, &cbor);
        prop_assert_eq!(from_cbor, from_json);
    }
}
