//! One thing is one landmark, from however many sides robots saw it.

use mapfold_map::landmarks::LandmarkKind;
use mapfold_tests::Error;
use mapfold_tests::taught::teach;

#[test]
fn robots_teach_each_end_corner_and_doorway_of_thin_walls_once() -> Result<(), Error> {
    for (seed, thickness_m) in [(1, 0.10), (2, 0.12), (3, 0.16)] {
        let taught = teach(seed, thickness_m)?;
        let mut learned = taught.learned.iter().collect::<Vec<_>>();
        for planned in &taught.planned {
            let (meant, extent) = (planned.landmark, planned.extent);
            let is_it = |l: &&&mapfold_map::landmarks::LearnedLandmark| {
                l.landmark.kind == meant.kind
                    && (l.landmark.at - meant.at).norm() <= 0.08
                    && meant.kind.turn(l.landmark.direction, meant.direction).abs() <= 0.05
            };
            let found: Vec<_> = learned.iter().filter(is_it).copied().collect();
            assert_eq!(found.len(), 1, "{thickness_m}: {planned:#?} in {learned:#?}");
            // A scanner sees an end to some centimetres, between two beams.
            let wide = match meant.kind {
                LandmarkKind::Doorway => 0.12,
                LandmarkKind::WallEnd => 0.04,
                _ => f64::INFINITY,
            };
            let told = found[0];
            assert!((told.extent - extent).abs() <= wide, "{told:?} beside {planned:?}");
            learned.retain(|l| l.id != found[0].id);
        }
        assert!(learned.is_empty(), "{thickness_m}: not there: {learned:#?}");
        let kinds = LandmarkKind::ALL
            .map(|kind| taught.planned.iter().filter(|l| l.landmark.kind == kind).count());
        assert_eq!(kinds, [0, 6, 1, 1]);
    }
    Ok(())
}
