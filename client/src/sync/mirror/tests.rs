//! Mirrors against a level that goes on, goes back, and is made anew.

use std::fs;
use std::sync::Arc;

use mapfold_map::raster::{TILE_CELLS, Tile, TileIndex};
use proptest::prelude::*;
use rand::SeedableRng;
use rand::rngs::StdRng;
use tempfile::TempDir;

use super::*;
use crate::sync::ApiOptions;
use crate::sync::tests::stub::Stub;
use crate::sync::tests::{FRAME, api, contributions, level};

const CONFIG: MirrorConfig = MirrorConfig {
    page_limit: 3,
    backoff: BackoffConfig {
        base: Duration::from_millis(2),
        cap: Duration::from_millis(10),
        server_cap: Duration::from_secs(1),
    },
    save_interval: Duration::ZERO,
};

fn open(folder: &TempDir) -> Mirror {
    Mirror::open(folder.path(), &level(), CONFIG).unwrap()
}

fn api_of(stub: &Stub) -> Api {
    api(&stub.url(), ApiOptions::STANDARD)
}

fn with_contributions(range: std::ops::Range<u64>) -> Stub {
    let stub = Stub::start();
    stub.ledger().take(&contributions(range));
    stub
}

/// As the server would export it.
fn geojson(map: &LevelMap) -> Vec<u8> {
    let mut bytes = Vec::new();
    geojson::write_map(map, &mut bytes).unwrap();
    bytes
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_lead_to_the_same_map_as_one_fetch_of_all() {
    let stub = with_contributions(0..40);
    let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut mirror = open(&folder);
    assert_eq!((mirror.revision(), mirror.frame()), (0, None));
    let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!((refreshed.from_revision, refreshed.to_revision), (0, 40));
    assert!(refreshed.changes > 0 && refreshed.resync.is_none());
    assert!(stub.ledger().pages > 5, "{} pages", stub.ledger().pages);
    assert_eq!(mirror.map(), stub.ledger().map());
    assert!(!mirror.map().segments.is_empty() && !mirror.map().tiles.is_empty());
    assert_eq!((mirror.frame(), mirror.resolution_m()), (Some(FRAME), Some(0.05)));

    let whole = MirrorConfig { page_limit: 20_000, ..CONFIG };
    let mut at_once = Mirror::open(other.path(), &level(), whole).unwrap();
    let before = stub.ledger().pages;
    at_once.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(stub.ledger().pages, before + 1);
    assert_eq!(at_once.map(), mirror.map());

    let nothing = mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!((nothing.from_revision, nothing.to_revision, nothing.changes), (40, 40, 0));
}

#[tokio::test(flavor = "multi_thread")]
async fn it_goes_on_from_the_disk_and_only_asks_for_what_is_new() {
    let stub = with_contributions(0..10);
    let folder = tempfile::tempdir().unwrap();
    open(&folder).refresh(&api_of(&stub)).await.unwrap();
    stub.ledger().take(&contributions(10..12));
    let mut mirror = open(&folder);
    assert_eq!((mirror.revision(), mirror.frame()), (10, Some(FRAME)));
    let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!((refreshed.from_revision, refreshed.to_revision), (10, 12));
    assert_eq!(mirror.map(), stub.ledger().map());
    drop(mirror);
    assert_eq!(open(&folder).map(), stub.ledger().map());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_was_set_back_is_noticed_and_followed() {
    let stub = with_contributions(0..20);
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    mirror.refresh(&api_of(&stub)).await.unwrap();
    stub.ledger().set_back(12);
    let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(refreshed.resync, Some(ResyncReason::ServerWentBack));
    assert_eq!((refreshed.from_revision, refreshed.to_revision), (20, 12));
    assert_eq!(mirror.map(), stub.ledger().map());
    drop(mirror);
    let mut mirror = open(&folder);
    assert_eq!(mirror.revision(), 12, "and on disk");
    assert_eq!(mirror.refresh(&api_of(&stub)).await.unwrap().resync, None);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_was_set_back_and_went_another_way_is_noticed_by_its_counts() {
    let stub = with_contributions(0..20);
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    mirror.refresh(&api_of(&stub)).await.unwrap();
    stub.ledger().set_back(12);
    // Other walls than before, and more revisions than the mirror knows.
    stub.ledger().take(&contributions(100..110));
    let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(refreshed.resync, Some(ResyncReason::Diverged));
    assert_eq!(mirror.revision(), 22);
    assert_eq!(mirror.map(), stub.ledger().map());
    assert_eq!(mirror.refresh(&api_of(&stub)).await.unwrap().resync, None);
}

#[tokio::test(flavor = "multi_thread")]
async fn counts_that_never_fit_are_believed_once() {
    let stub = with_contributions(0..3);
    stub.ledger().counts = Some(v1::Counts { segments: 99, ..v1::Counts::default() });
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(refreshed.resync, Some(ResyncReason::Diverged));
    stub.ledger().take(&contributions(3..5));
    let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!((refreshed.resync, refreshed.to_revision), (None, 5));
    assert_eq!(mirror.map(), stub.ledger().map());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_level_that_was_made_anew_is_noticed_by_its_frame() {
    let stub = with_contributions(0..5);
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    mirror.refresh(&api_of(&stub)).await.unwrap();
    let frame = Uuid::from_bytes([3; 16]);
    stub.ledger().make_anew(frame);
    let anew: Vec<v1::Contribution> =
        contributions(50..58).into_iter().map(|c| v1::Contribution { frame, ..c }).collect();
    stub.ledger().take(&anew);
    let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(refreshed.resync, Some(ResyncReason::OtherFrame));
    assert_eq!((mirror.frame(), mirror.revision()), (Some(frame), 8));
    assert_eq!(mirror.map(), stub.ledger().map());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_resync_that_breaks_off_keeps_the_old_map_and_is_done_the_next_time() {
    let mut stub = with_contributions(0..10);
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    mirror.refresh(&api_of(&stub)).await.unwrap();
    let old = mirror.map().clone();
    mirror.resync = Some(ResyncReason::DamagedFile);
    stub.kill();
    let error = mirror.refresh(&api_of(&stub)).await.unwrap_err();
    assert!(error.is_retryable(), "{error}");
    assert_eq!((mirror.map(), mirror.revision()), (&old, 10));
    stub.restart();
    let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(refreshed.resync, Some(ResyncReason::DamagedFile));
    assert_eq!(mirror.map(), &old);
}

#[tokio::test(flavor = "multi_thread")]
async fn it_follows_through_an_outage_and_stops_when_told() {
    let mut stub = with_contributions(0..3);
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    let api = api_of(&stub);
    let (stop, stopped) = watch::channel(false);
    let (told, mut hear) = watch::channel((0, 0_usize));
    let follow = tokio::spawn(async move {
        let tell = |mirror: &Mirror, outcome: Result<Refreshed, &MirrorError>| {
            told.send_modify(|(revision, failures)| {
                *revision = mirror.revision();
                *failures += usize::from(outcome.is_err());
            });
        };
        let mut rng = StdRng::seed_from_u64(1);
        mirror.follow(&api, Duration::from_millis(5), stopped, &mut rng, tell).await.unwrap();
        mirror
    });
    hear.wait_for(|(revision, _)| *revision == 3).await.unwrap();
    stub.kill();
    hear.wait_for(|(_, failures)| *failures >= 3).await.unwrap();
    stub.ledger().take(&contributions(3..9));
    stub.restart();
    hear.wait_for(|(revision, _)| *revision == 9).await.unwrap();
    stop.send_replace(true);
    let mirror = follow.await.unwrap();
    assert_eq!(mirror.map(), stub.ledger().map());
    drop(mirror);
    assert_eq!(open(&folder).revision(), 9);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_does_not_go_away_ends_the_following() {
    let stub = with_contributions(0..1);
    "another".clone_into(&mut stub.ledger().token);
    let folder = tempfile::tempdir().unwrap();
    let (_stop, stopped) = watch::channel(false);
    let mut rng = StdRng::seed_from_u64(1);
    let mut mirror = open(&folder);
    let api = api_of(&stub);
    let ended = mirror.follow(&api, Duration::from_secs(9), stopped, &mut rng, |_, _| ()).await;
    let error = ended.unwrap_err();
    assert!(matches!(&error, MirrorError::Api(e) if e.is_refusal("invalid_token")), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_folder_belongs_to_one_mirror_of_one_level() {
    let stub = with_contributions(0..1);
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    mirror.refresh(&api_of(&stub)).await.unwrap();
    let second = Mirror::open(folder.path(), &level(), CONFIG);
    assert!(matches!(second, Err(MirrorError::InUse { .. })));
    drop(mirror);
    let upstairs = LevelAddress { level: "first".to_owned(), ..level() };
    let error = Mirror::open(folder.path(), &upstairs, CONFIG).unwrap_err();
    assert!(error.to_string().ends_with("this is the mirror of plant/ground, not of plant/first"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_file_is_set_aside_and_everything_read_anew() {
    let stub = with_contributions(0..6);
    let folder = tempfile::tempdir().unwrap();
    open(&folder).refresh(&api_of(&stub)).await.unwrap();
    let path = folder.path().join("level.mirror");
    let whole = fs::read(&path).unwrap();
    let places = (0..whole.len()).step_by(13);
    for (n, place) in places.enumerate() {
        let mut bytes = whole.clone();
        if n % 2 == 0 {
            bytes[place] ^= 0x10;
        } else {
            bytes.truncate(place);
        }
        fs::write(&path, &bytes).unwrap();
        let mut mirror = open(&folder);
        assert_eq!((mirror.revision(), mirror.frame()), (0, None), "{place}");
        assert_eq!(fs::read(folder.path().join("level.mirror.damaged")).unwrap(), bytes);
        if n % 10 == 0 {
            let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
            assert_eq!(refreshed.resync, Some(ResyncReason::DamagedFile));
            assert_eq!(mirror.map(), stub.ledger().map());
            assert_eq!(fs::read(&path).unwrap(), whole, "the same map is the same file");
        }
    }
}

#[test]
fn the_prior_is_on_disk_with_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let mut known = KnownMap { revision: 7, map: LevelMap::default() };
    let mut cells = Box::new([0; TILE_CELLS]);
    cells[70] = 200;
    cells[71..90].fill(-25);
    known.map.prior.insert(TileIndex { x: -3, y: 8 }, Arc::new(Tile::new(cells)));
    let ground = Ground { frame: FRAME, resolution_m: 0.05 };
    let landmarks = Arc::default();
    let saved = Saved { level: level(), ground, known: known.clone(), landmarks };
    file::write(folder.path(), &saved).unwrap();
    let mirror = open(&folder);
    assert_eq!((mirror.map(), mirror.revision()), (&known.map, 7));
}

/// A corner at (x, 2) m.
fn corner(x: f64) -> v1::Landmark {
    v1::Landmark {
        id: format!("convex:{x}"),
        kind: v1::LandmarkKind::ConvexCorner,
        source: v1::LandmarkSource::Gdb,
        at_m: [x, 2.0],
        heading_rad: 0.7,
        covariance: [[4e-4, 1e-4, 0.0], [1e-4, 9e-4, 0.0], [0.0, 0.0, 1e-4]],
        extent: 4.7,
        objects: Vec::new(),
        support: None,
    }
}

/// A square of `side` metres.
fn square_plan(side: f64) -> v1::GdbPlan {
    let corners = [[0.0, 0.0], [0.0, side], [side, side], [side, 0.0]];
    v1::GdbPlan {
        height_m: 0.3,
        draft: 1,
        library: 0,
        objects: vec![v1::PlanObject {
            id: uuid::Uuid::from_u128(5),
            kind: v1::ObjectKind::Machine,
            tolerance_m: 0.03,
            trust: 0.5,
        }],
        outlines: vec![corners.map(|at_m| v1::PlanCorner { at_m, object: 0 }).to_vec()],
        sheets: Vec::new(),
        openings: Vec::new(),
    }
}

fn places(mirror: &Mirror) -> Vec<f64> {
    let mut places: Vec<f64> = mirror.landmarks().map(|landmark| landmark.at.x).collect();
    places.sort_by(f64::total_cmp);
    places
}

#[tokio::test(flavor = "multi_thread")]
async fn landmarks_and_model_come_with_the_map_and_are_asked_for_only_when_they_may_have_changed() {
    let stub = with_contributions(0..3);
    stub.ledger().landmarks = vec![(2, corner(1.0)), (3, corner(2.0))];
    stub.ledger().plan = Some((2, square_plan(4.0)));
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(places(&mirror), [1.0, 2.0]);
    assert_eq!(mirror.surfaces().len(), 4);
    drop(mirror);
    // They are on disk.
    let mut mirror = open(&folder);
    assert_eq!((places(&mirror), mirror.surfaces().len()), (vec![1.0, 2.0], 4));
    // The next ones: one more, one less, the model as it was.
    stub.ledger().take(&contributions(3..5));
    stub.ledger().landmarks.push((5, corner(7.0)));
    stub.ledger().gone.push((4, "convex:1".to_owned()));
    mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!((places(&mirror), stub.ledger().plans), (vec![2.0, 7.0], 1));
    // Nothing new: no question, or this refusal would be told.
    stub.ledger().refuses_landmarks.push_back((503, "closing"));
    mirror.refresh(&api_of(&stub)).await.unwrap();
    stub.ledger().refuses_landmarks.clear();
    // Another publication; what changed since is no longer known.
    stub.ledger().take(&contributions(5..6));
    stub.ledger().plan = Some((6, square_plan(9.0)));
    stub.ledger().refuses_landmarks.push_back((410, "cursor_expired"));
    mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(stub.ledger().plans, 2);
    assert!((mirror.surfaces()[0].to.metres().y - 9.0).abs() < 1e-9);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_that_cannot_be_cut_leaves_the_map_and_landmarks_that_cannot_be_are_refused() {
    let stub = with_contributions(0..3);
    stub.ledger().landmarks = vec![(2, corner(1.0))];
    stub.ledger().refuses_landmarks.push_back((409, "plan_too_crowded"));
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(mirror.map(), stub.ledger().map());
    assert!(mirror.landmarks().next().is_none());
    stub.ledger().take(&contributions(3..4));
    let mut bad = corner(4.0);
    bad.covariance[0][0] = -1.0;
    stub.ledger().landmarks.push((4, bad));
    let error = mirror.refresh(&api_of(&stub)).await.unwrap_err();
    assert!(
        error.to_string().starts_with("the landmarks of revision 4 cannot be taken"),
        "{error}"
    );
    stub.ledger().landmarks.pop();
    mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!(places(&mirror), [1.0], "asked for from the beginning");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_level_that_was_made_anew_takes_its_landmarks_with_it() {
    let stub = with_contributions(0..5);
    stub.ledger().landmarks = vec![(2, corner(1.0))];
    stub.ledger().plan = Some((2, square_plan(4.0)));
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    mirror.refresh(&api_of(&stub)).await.unwrap();
    stub.ledger().make_anew(Uuid::from_bytes([3; 16]));
    stub.ledger().landmarks.clear();
    stub.ledger().plan = None;
    mirror.refresh(&api_of(&stub)).await.unwrap();
    assert_eq!((places(&mirror).len(), mirror.surfaces().len()), (0, 0));
}

/// A file of format `version`, whose map nobody can read any more.
fn file_of(version: u32) -> Vec<u8> {
    #[derive(serde::Serialize)]
    struct Old {
        site: String,
        level: String,
        frame: uuid::Uuid,
        resolution_m: f64,
        map: &'static str,
    }
    let LevelAddress { site, level } = level();
    let old = Old { site, level, frame: FRAME, resolution_m: 0.05, map: "as it was" };
    let cbor = mapfold_schema::codec::to_cbor(&old).unwrap();
    let payload = zstd::bulk::compress(&cbor, 3).unwrap();
    let mut bytes = b"MFMIRROR".to_vec();
    bytes.extend(version.to_le_bytes());
    bytes.extend(<sha2::Sha256 as sha2::Digest>::digest(&payload));
    bytes.extend(payload);
    bytes
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_of_an_older_version_is_fetched_anew_without_a_word() {
    let stub = with_contributions(0..9);
    let folder = tempfile::tempdir().unwrap();
    open(&folder).refresh(&api_of(&stub)).await.unwrap();
    let path = folder.path().join("level.mirror");
    for version in [1, 2, 3] {
        fs::write(&path, file_of(version)).unwrap();
        let mut mirror = open(&folder);
        assert_eq!((mirror.revision(), mirror.frame()), (0, Some(FRAME)));
        let refreshed = mirror.refresh(&api_of(&stub)).await.unwrap();
        assert_eq!((refreshed.to_revision, refreshed.resync), (9, None));
        assert_eq!(mirror.map(), stub.ledger().map());
    }
    for version in [0, 4, 5] {
        fs::write(&path, file_of(version)).unwrap();
        assert_eq!(open(&folder).resync, Some(ResyncReason::DamagedFile), "version {version}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn its_geojson_has_a_line_for_each_solid_part_and_is_the_same_for_the_same_map() {
    let stub = with_contributions(0..12);
    let folder = tempfile::tempdir().unwrap();
    let mut mirror = open(&folder);
    mirror.refresh(&api_of(&stub)).await.unwrap();
    let mut bytes = Vec::new();
    mirror.write_geojson(&mut bytes).unwrap();
    assert_eq!(bytes, geojson(stub.ledger().map()));
    let json: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    assert_eq!(json["type"], "FeatureCollection");
    assert_eq!(json["coordinate_frame"]["unit"], "m");
    let features = json["features"].as_array().unwrap();
    let solids: usize = mirror.map().segments.values().map(|s| s.solid.len()).sum();
    assert_eq!(features.len(), solids + mirror.map().clusters.len() + mirror.map().chains.len());
    assert!(solids > 0);
    for feature in features {
        let properties = &feature["properties"];
        assert_eq!(properties["kind"], "segment");
        assert_eq!(feature["geometry"]["type"], "LineString");
        assert!(feature["id"].as_str().unwrap().starts_with(properties["id"].as_str().unwrap()));
        for name in ["quality", "rho_m", "alpha_rad", "covariance", "robots"] {
            assert!(!properties[name].is_null(), "{name}");
        }
        // Both ends lie on the line that the properties name.
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let (rho, alpha) = (number(&properties["rho_m"]), number(&properties["alpha_rad"]));
        for end in feature["geometry"]["coordinates"].as_array().unwrap() {
            let across = number(&end[0]) * alpha.cos() + number(&end[1]) * alpha.sin();
            assert!((across - rho).abs() < 1e-9);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    #[test]
    fn whatever_the_pages_and_whenever_it_looks_the_mirror_is_the_map(
        steps in prop::collection::vec((0..8_u64, any::<bool>()), 1..8),
        page_limit in 1..12_u32,
    ) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let stub = Stub::start();
        let folder = tempfile::tempdir().unwrap();
        let config = MirrorConfig { page_limit, ..CONFIG };
        let mut mirror = Mirror::open(folder.path(), &level(), config).unwrap();
        let mut taken = 0;
        for (more, restarts) in steps {
            stub.ledger().take(&contributions(taken..taken + more));
            taken += more;
            if restarts {
                drop(mirror);
                mirror = Mirror::open(folder.path(), &level(), config).unwrap();
            }
            runtime.block_on(mirror.refresh(&api_of(&stub))).unwrap();
            prop_assert_eq!(mirror.revision(), taken as i64);
            let ledger = stub.ledger();
            prop_assert_eq!(mirror.map(), ledger.map());
        }
    }
}
