//! Imported maps: a prior that no fold reads, the same on every replica and after every restart.

use std::collections::BTreeMap;

use mapfold_map::level::LevelMap;
use mapfold_map::raster::{TILE_CELLS, Tile, TileIndex};
use mapfold_schema::v1;
use mapfold_server::level::{LevelHandle, LevelOptions, Snapshot};
use mapfold_server::maintenance::verify;
use mapfold_server::store::imports::NewImport;
use uuid::Uuid;

use crate::engines::{Database, killed_after};
use crate::levels_in_memory::{Mirror, open, reached, still, submit_all};
use crate::reverts::{act, of_robot};
use crate::synthetic::{LEVEL, SITE, START_US, folded, furnish, looks};

on_each_engine!(
    imports_leave_the_fold_alone_and_every_replica_has_the_same_prior,
    a_killed_level_comes_back_with_its_prior,
    the_same_import_is_one_and_a_removal_needs_one,
);

const FIRST: [(i32, i32, i32); 2] = [(0, 0, 200), (1, 0, -25)];
const SECOND: [(i32, i32, i32); 2] = [(1, 0, 100), (-5, 7, 400)];

fn report() -> v1::ImportReport {
    v1::ImportReport {
        image: "map.pgm".into(),
        columns: 64,
        rows: 64,
        resolution_m: 0.05,
        origin_m: [0.0, -0.1],
        yaw_rad: 0.0,
        mode: "trinary".into(),
        occupied_thresh: Some(0.65),
        free_thresh: Some(0.196),
        negate: Some(false),
        trust: 0.5,
        occupied: 1,
        free: 2,
        unknown: 3,
        tiles: 2,
        bounds: None,
        warnings: vec!["doubtful".into()],
    }
}

/// An import of tiles that hold one value each.
fn import(number: u128, tiles: &[(i32, i32, i32)]) -> NewImport {
    let column = |value| NewImport::column(&Tile::new(Box::new([value; TILE_CELLS]))).unwrap();
    NewImport {
        id: Uuid::from_u128(number),
        digest: format!("{number:064x}"),
        author: "operator".into(),
        at_us: START_US,
        report: Some(report()),
        tiles: tiles.iter().map(|(x, y, v)| (TileIndex { x: *x, y: *y }, column(*v))).collect(),
    }
}

fn removal(number: u128) -> NewImport {
    NewImport { digest: String::new(), report: None, tiles: Vec::new(), ..import(number, &[]) }
}

/// The value of each tile of the prior.
fn prior(snapshot: &Snapshot) -> BTreeMap<(i32, i32), i32> {
    let all = [i32::MIN, i32::MAX].map(|end| TileIndex { x: end, y: end });
    snapshot.prior_between(all[0], all[1]).map(|(at, t)| ((at.x, at.y), t.cells()[7])).collect()
}

fn of(tiles: &[(i32, i32, i32)]) -> BTreeMap<(i32, i32), i32> {
    tiles.iter().map(|(x, y, value)| ((*x, *y), *value)).collect()
}

/// 20 looks, an import, 20 looks, a revert, another import: revision 43.
async fn story(level: &LevelHandle) -> i64 {
    let all = looks(91, 40);
    submit_all(level, &all[..20]).await;
    assert_eq!(level.import(&import(1, &FIRST)).await.unwrap().unwrap().revision, 21);
    submit_all(level, &all[20..]).await;
    let targets = of_robot("bert");
    level.revert(&act(1, &targets), &targets).await.unwrap();
    level.import(&import(2, &SECOND)).await.unwrap().unwrap().revision
}

/// What robots saw of it.
fn seen(snapshot: &Snapshot) -> LevelMap {
    LevelMap { prior: BTreeMap::new(), ..LevelMap::clone(&snapshot.map()) }
}

fn kept() -> Vec<v1::Contribution> {
    looks(91, 40).into_iter().filter(|look| look.robot != "bert").collect()
}

async fn imports_leave_the_fold_alone_and_every_replica_has_the_same_prior(database: Database) {
    let stores = [database.store().await, database.store().await];
    furnish(&stores[0]).await;
    let (levels, level) = open(&stores[0], still()).await;
    let (_others, other) = open(&stores[1], still()).await;
    let mut events = level.events();
    let end = story(&level).await;
    let here = reached(&level, end).await;
    assert_eq!(end, 43);
    assert_eq!(&seen(&here), folded(&kept()).map());
    assert_eq!(prior(&here), of(&SECOND));
    let there = reached(&other, end).await;
    assert_eq!(prior(&there), of(&SECOND));
    for since in 0..=end {
        let changes = |snapshot: &Snapshot| snapshot.raster_since(since, None).unwrap();
        assert_eq!(changes(&here), changes(&there), "since {since}");
    }
    // A mirror has it too, in whatever pages.
    for limit in [1, 3, 1000] {
        let mut mirror = Mirror::default();
        mirror.follow(&there, limit);
        assert_eq!(&mirror.map, &*here.map());
    }
    let place = |x, y| v1::TilePlace { x, y };
    let since = here.raster_since(21, None).unwrap();
    assert_eq!(since.prior, [place(-5, 7), place(1, 0)]);
    assert_eq!(since.removed_prior, [place(0, 0)]);
    let mut told = Vec::new();
    while let Ok(event) = events.try_recv() {
        told.extend((event.acts == 1 && event.tiles > 0).then_some((event.revision, event.tiles)));
    }
    assert!(told.contains(&(21, 2)) && told.contains(&(43, 3)), "{told:?}");

    level.import(&removal(3)).await.unwrap().unwrap();
    let bare = reached(&other, 44).await;
    assert_eq!(prior(&bare), BTreeMap::new());
    let mut mirror = Mirror::default();
    mirror.follow(&here, 7);
    assert_eq!(mirror.map.prior.len(), 2);
    mirror.follow(&bare, 7);
    assert_eq!(&mirror.map, folded(&kept()).map());
    drop((level, here));
    levels.shutdown().await;
    let report = verify(&stores[0], SITE, LEVEL).await.unwrap().unwrap();
    assert_eq!((report.faults, report.imports, report.acts), (vec![], 3, 1));
}

async fn a_killed_level_comes_back_with_its_prior(database: Database) {
    for write_behind_revisions in [1, i64::MAX] {
        let dying = database.clone();
        let first = write_behind_revisions == 1;
        let end = killed_after(move || async move {
            let store = dying.store().await;
            if first {
                furnish(&store).await;
            }
            let (_levels, level) =
                open(&store, LevelOptions { write_behind_revisions, ..still() }).await;
            let end = if first { story(&level).await } else { level.snapshot().revision() };
            reached(&level, end).await;
            end
        })
        .await;
        let store = database.store().await;
        let (levels, level) = open(&store, still()).await;
        let snapshot = reached(&level, end).await;
        assert_eq!(prior(&snapshot), of(&SECOND));
        assert_eq!(&seen(&snapshot), folded(&kept()).map());
        // A reader of any revision since the first import learns what is gone.
        for since in 21..end {
            let changes = snapshot.raster_since(since, None).unwrap();
            assert_eq!((changes.prior.len(), changes.removed_prior.len()), (2, 1), "{since}");
        }
        drop((level, snapshot));
        levels.shutdown().await;
    }
    // Now all of it is in rows, and a spoilt tile is found.
    let store = database.store().await;
    assert_eq!(verify(&store, SITE, LEVEL).await.unwrap().unwrap().faults, Vec::<String>::new());
    database.meddle("delete from imports where revision = 21").await;
    let faults = verify(&store, SITE, LEVEL).await.unwrap().unwrap().faults;
    assert!(faults.iter().any(|fault| fault.contains("no revision 21")), "{faults:?}");
}

async fn the_same_import_is_one_and_a_removal_needs_one(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    assert_eq!(store.import(SITE, LEVEL, &removal(9)).await.unwrap(), None);
    let first = store.import(SITE, LEVEL, &import(1, &FIRST)).await.unwrap().unwrap();
    assert_eq!((first.revision, first.report.clone()), (1, Some(report())));
    let again = NewImport { id: Uuid::from_u128(5), ..import(1, &FIRST) };
    assert_eq!(store.import(SITE, LEVEL, &again).await.unwrap(), Some(first.clone()));
    let removed = store.import(SITE, LEVEL, &removal(9)).await.unwrap().unwrap();
    assert_eq!((removed.revision, removed.report), (2, None));
    assert_eq!(store.import(SITE, LEVEL, &removal(10)).await.unwrap(), None);
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 2);
    let back = store.import(SITE, LEVEL, &again).await.unwrap().unwrap();
    assert_eq!(back.revision, 3);
    let page = store.import_page(SITE, LEVEL, None, 10).await.unwrap();
    assert_eq!(page.imports.iter().map(|i| i.revision).collect::<Vec<_>>(), [3, 2, 1]);
    let nowhere = store.import(SITE, "attic", &import(1, &FIRST)).await;
    assert!(nowhere.is_err());
}
