//! The picture of a hallway: drawn from real scans, with everything on it, and the same every time.

use std::path::Path;

use mapfold_schema::v1::ChainKind;
use mapfold_tests::Error;
use mapfold_tests::figure::{HALLWAY, draw};

#[tokio::test]
async fn a_hallway_becomes_polylines_a_polygon_and_clusters_the_same_every_time()
-> Result<(), Error> {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz");
    let figure = draw(&log, &HALLWAY).await?;
    assert!(figure.stops >= 9, "{} scanning positions", figure.stops);
    let of = |kind| figure.map.chains.values().filter(|chain| chain.kind == kind).count();
    assert!(of(ChainKind::Polyline) >= 5, "{} polylines", of(ChainKind::Polyline));
    assert!(of(ChainKind::Obstacle) >= 1, "the pillar is a polygon");
    assert!(figure.map.clusters.len() >= 5, "{} clusters", figure.map.clusters.len());
    for chain in figure.map.chains.values() {
        for vertex in &chain.vertices_m {
            assert!(vertex.iter().all(|v| v.is_finite()));
        }
    }
    let again = draw(&log, &HALLWAY).await?;
    assert_eq!(figure.svg, again.svg);
    Ok(())
}
