//! The GDB in the log: edits by several people, publications that never change, and every replica with the same.

use std::collections::{BTreeMap, BTreeSet};

use mapfold_schema::{codec, v1};
use mapfold_server::level::LevelHandle;
use mapfold_server::level::gdb::{library, read_model};
use mapfold_server::maintenance::verify;
use mapfold_server::store::Store;
use mapfold_server::store::gdb::{Expected, GdbChange, GdbOutcome, GdbVersion, NewGdbEntry, Stale};
use mapfold_server::store::library::LibraryOutcome;
use uuid::Uuid;

use crate::engines::{Database, killed_after};
use crate::levels_in_memory::{open, reached, still, submit_all};
use crate::synthetic::{LEVEL, SITE, START_US, folded, furnish, looks};

on_each_engine!(
    edits_leave_the_fold_alone_and_every_replica_reads_the_same_model,
    a_stale_edit_is_refused_with_what_changed_and_what_is_so_already_is_none,
    what_is_published_stays_while_drafts_and_libraries_move_on,
    a_killed_level_comes_back_and_spoilt_objects_are_found,
);

fn new(number: u128, author: &str, expected: Expected) -> NewGdbEntry {
    NewGdbEntry {
        id: Uuid::from_u128(number),
        author: author.to_owned(),
        at_us: START_US,
        comment: format!("entry {number}"),
        expected,
    }
}

fn wall(length: f64) -> Vec<u8> {
    let object = v1::GdbObject {
        name: String::new(),
        kind: v1::ObjectKind::Wall,
        solids: Some(vec![v1::GdbSolid::Box(v1::GdbBox {
            from_m: [0.0, 0.0, 0.0],
            to_m: [length, 0.2, 2.5],
        })]),
        prototype: None,
        placement: None,
        tolerance_m: None,
        trust: None,
        door: None,
    };
    codec::to_cbor(&object).unwrap()
}

fn id(number: u128) -> Uuid {
    Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0000 + number)
}

fn put(objects: &[(u128, f64)]) -> GdbChange {
    let put = objects.iter().map(|(number, length)| (id(*number), wall(*length))).collect();
    GdbChange::Edit { put, removed: BTreeSet::new() }
}

fn removal(objects: &[u128]) -> GdbChange {
    GdbChange::Edit {
        put: BTreeMap::new(),
        removed: objects.iter().map(|number| id(*number)).collect(),
    }
}

fn at(draft: i64, library: i64) -> GdbVersion {
    GdbVersion { draft, library }
}

fn done(outcome: GdbOutcome) -> v1::GdbEntry {
    match outcome {
        GdbOutcome::Done(entry) => entry,
        other => panic!("{other:?}"),
    }
}

async fn edit(store: &Store, number: u128, change: &GdbChange) -> v1::GdbEntry {
    let entry = new(number, "anna", Expected::Any);
    done(store.edit_gdb(SITE, LEVEL, &entry, change, 1000).await.unwrap())
}

/// The lengths of the walls of a draft.
async fn lengths(store: &Store, version: GdbVersion) -> BTreeMap<u128, f64> {
    let model = read_model(store, SITE, LEVEL, version).await.unwrap();
    let length = |object: &v1::GdbObject| match object.solids.as_deref() {
        Some([v1::GdbSolid::Box(solid)]) => solid.to_m[0],
        other => panic!("{other:?}"),
    };
    model.objects().iter().map(|(i, o)| (i.as_u128() & 0xffff, length(o))).collect()
}

/// 10 looks, an edit, 10 looks, an edit, a publication: revision 23.
async fn story(level: &LevelHandle) -> i64 {
    let all = looks(17, 20);
    submit_all(level, &all[..10]).await;
    let change = put(&[(1, 1.0), (2, 2.0)]);
    let first = level.edit_gdb(&new(1, "anna", Expected::Any), &change).await.unwrap();
    assert_eq!(done(first).revision, 11);
    submit_all(level, &all[10..]).await;
    let second = new(2, "bert", Expected::OneOf(vec![at(11, 0)]));
    done(level.edit_gdb(&second, &removal(&[1])).await.unwrap());
    done(level.publish_gdb(&new(3, "bert", Expected::Any)).await.unwrap()).revision
}

async fn edits_leave_the_fold_alone_and_every_replica_reads_the_same_model(database: Database) {
    let stores = [database.store().await, database.store().await];
    furnish(&stores[0]).await;
    let (levels, level) = open(&stores[0], still()).await;
    let (_others, other) = open(&stores[1], still()).await;
    let mut events = level.events();
    let end = story(&level).await;
    assert_eq!(end, 23);
    let (here, there) = (reached(&level, end).await, reached(&other, end).await);
    assert_eq!(&*here.map(), folded(&looks(17, 20)).map());
    assert_eq!(there.map(), here.map());
    let state = level.gdb_state().await.unwrap();
    assert_eq!(state, other.gdb_state().await.unwrap());
    assert_eq!((state.draft, state.objects), (at(22, 0), 1));
    assert_eq!(state.published.map(|p| (p.revision, p.version)), Some((23, at(22, 0))));
    for level in [&level, &other] {
        let model = level.gdb_model(state.draft).await.unwrap();
        assert_eq!(model.objects().keys().copied().collect::<Vec<_>>(), [id(2)]);
        let outlines = model.plan(0.3, |plan| plan.outlines().len()).unwrap();
        assert_eq!((outlines, model.landmarks(0.3).unwrap().len()), (1, 2));
    }
    // Any draft can be read as it was.
    assert_eq!(lengths(&stores[1], at(11, 0)).await, [(1, 1.0), (2, 2.0)].into());
    assert_eq!(lengths(&stores[1], at(0, 0)).await, BTreeMap::new());
    let page = stores[1].gdb_page(SITE, LEVEL, None, 2).await.unwrap();
    let line = |e: &v1::GdbEntry| (e.revision, e.kind, e.author.clone(), e.put, e.removed);
    let lines: Vec<_> = page.entries.iter().map(line).collect();
    let (edited, published) = (v1::GdbEntryKind::Edit, v1::GdbEntryKind::Publication);
    assert_eq!(lines, [(23, published, "bert".into(), 0, 0), (22, edited, "bert".into(), 0, 1)]);
    assert_eq!(page.next.as_deref(), Some("22"));
    let mut acts = 0;
    while let Ok(event) = events.try_recv() {
        acts += event.acts;
    }
    assert_eq!(acts, 3);
    drop((level, here));
    levels.shutdown().await;
    let report = verify(&stores[0], SITE, LEVEL).await.unwrap().unwrap();
    assert_eq!((report.faults, report.gdb_entries), (vec![], 3));
}

async fn a_stale_edit_is_refused_with_what_changed_and_what_is_so_already_is_none(
    database: Database,
) {
    let store = database.store().await;
    furnish(&store).await;
    let first = edit(&store, 1, &put(&[(1, 1.0), (2, 2.0), (3, 3.0)])).await;
    assert_eq!((first.revision, first.put, first.removed), (1, 3, 0));
    edit(&store, 2, &put(&[(2, 2.5)])).await;
    edit(&store, 3, &removal(&[3])).await;

    let seen = Expected::OneOf(vec![at(1, 0)]);
    let late = new(4, "bert", seen.clone());
    let outcome = store.edit_gdb(SITE, LEVEL, &late, &put(&[(2, 9.0)]), 1000).await.unwrap();
    let GdbOutcome::Stale(Stale { seen: then, now, entries, changes }) = outcome else {
        panic!("{outcome:?}")
    };
    assert_eq!((then, now), (at(1, 0), at(3, 0)));
    assert_eq!(entries.iter().map(|e| e.revision).collect::<Vec<_>>(), [3, 2]);
    let told: Vec<_> =
        changes.iter().map(|c| (c.object, c.revision, c.is_removed, &*c.author)).collect();
    assert_eq!(told, [(id(3), 3, true, "anna"), (id(2), 2, false, "anna")]);
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 3, "nothing is lost");

    // An edit that is so already, as after a lost answer, is none; whatever it was made on.
    let again = new(5, "anna", seen.clone());
    for change in [put(&[(2, 2.5)]), removal(&[3]), removal(&[77])] {
        let outcome = store.edit_gdb(SITE, LEVEL, &again, &change, 1000).await.unwrap();
        assert!(matches!(outcome, GdbOutcome::Same(state) if state.draft == at(3, 0)));
    }
    let whole = |objects: &[(u128, f64)]| match put(objects) {
        GdbChange::Edit { put, .. } => GdbChange::Replace(put),
        GdbChange::Replace(_) => unreachable!(),
    };
    let same = whole(&[(1, 1.0), (2, 2.5)]);
    let outcome = store.edit_gdb(SITE, LEVEL, &again, &same, 1000).await.unwrap();
    assert!(matches!(outcome, GdbOutcome::Same(_)));
    let replaced = edit(&store, 6, &whole(&[(2, 2.5), (3, 3.5), (4, 4.0)])).await;
    assert_eq!((replaced.revision, replaced.put, replaced.removed), (4, 2, 1));
    assert_eq!(lengths(&store, at(4, 0)).await, [(2, 2.5), (3, 3.5), (4, 4.0)].into());

    let (entry, change) = (new(7, "anna", Expected::Any), put(&[(5, 1.0)]));
    let many = store.edit_gdb(SITE, LEVEL, &entry, &change, 3).await.unwrap();
    assert!(matches!(many, GdbOutcome::TooMany { objects: 4 }));
    assert!(store.edit_gdb(SITE, "attic", &late, &same, 3).await.is_err());
}

async fn what_is_published_stays_while_drafts_and_libraries_move_on(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let shelf = |width: f64| {
        let prototype = v1::GdbPrototype {
            kind: None,
            solids: vec![v1::GdbSolid::Box(v1::GdbBox {
                from_m: [0.0; 3],
                to_m: [width, 0.4, 2.0],
            })],
        };
        BTreeMap::from([("shelf".to_owned(), codec::to_cbor(&prototype).unwrap())])
    };
    let entry = |number| new(number, "anna", Expected::Any);
    let made = store.put_library(SITE, &entry(1), Some(&[0]), &shelf(1.0)).await.unwrap();
    assert_eq!(made, LibraryOutcome::Is(1));
    let object = v1::GdbObject {
        name: "a shelf".to_owned(),
        kind: v1::ObjectKind::Furniture,
        solids: None,
        prototype: Some("shelf".to_owned()),
        placement: None,
        tolerance_m: None,
        trust: None,
        door: None,
    };
    let change = BTreeMap::from([(id(1), codec::to_cbor(&object).unwrap())]);
    edit(&store, 2, &GdbChange::Edit { put: change, removed: BTreeSet::new() }).await;
    let publish = async |number, expected| {
        store.publish_gdb(SITE, LEVEL, &new(number, "anna", expected)).await.unwrap()
    };
    let published = done(publish(3, Expected::OneOf(vec![at(1, 1)])).await);
    assert_eq!((published.draft, published.library), (1, 1));
    assert!(matches!(publish(4, Expected::Any).await, GdbOutcome::Same(_)));

    let stale = store.put_library(SITE, &entry(5), Some(&[0]), &shelf(3.0)).await.unwrap();
    assert_eq!(stale, LibraryOutcome::Stale { now: 1 });
    let moved = store.put_library(SITE, &entry(5), Some(&[1]), &shelf(3.0)).await.unwrap();
    assert_eq!(moved, LibraryOutcome::Is(2));
    let again = store.put_library(SITE, &entry(5), Some(&[1]), &shelf(3.0)).await.unwrap();
    assert_eq!(again, LibraryOutcome::Is(2), "what is so already is no change");
    let state = store.gdb_state(SITE, LEVEL).await.unwrap();
    assert_eq!(state.draft, at(1, 2));
    let width = async |version| {
        let model = read_model(&store, SITE, LEVEL, version).await.unwrap();
        let xs = |plan: &mapfold_map::gdb::Plan| {
            plan.edges().map(|e| e.to.metres().x).fold(0.0, f64::max)
        };
        model.plan(0.3, xs).unwrap()
    };
    assert_eq!((width(at(1, 1)).await, width(state.draft).await), (1.0, 3.0));
    // Who saw the old library may not publish the new one unseen.
    assert!(matches!(publish(6, Expected::OneOf(vec![at(1, 1)])).await, GdbOutcome::Stale(_)));
    let published = done(publish(7, Expected::OneOf(vec![state.draft])).await);
    assert_eq!((published.revision, published.library), (3, 2));
    let before = store.gdb_publication(SITE, LEVEL, 2).await.unwrap().unwrap();
    assert_eq!((before.revision, before.version), (2, at(1, 1)));
    store.put_library(SITE, &entry(8), None, &BTreeMap::new()).await.unwrap();
    assert_eq!(library(&store, SITE, i64::MAX).await.unwrap(), (3, BTreeMap::new()));
    assert_eq!(library(&store, SITE, 2).await.unwrap().1.len(), 1);
    assert!(store.put_library("nowhere", &entry(9), None, &shelf(1.0)).await.is_err());
}

async fn a_killed_level_comes_back_and_spoilt_objects_are_found(database: Database) {
    let dying = database.clone();
    let end = killed_after(move || async move {
        let store = dying.store().await;
        furnish(&store).await;
        let options = mapfold_server::level::LevelOptions { write_behind_revisions: 1, ..still() };
        let (_levels, level) = open(&store, options).await;
        let end = story(&level).await;
        reached(&level, end).await;
        end
    })
    .await;
    let store = database.store().await;
    let (levels, level) = open(&store, still()).await;
    let snapshot = reached(&level, end).await;
    assert_eq!(&*snapshot.map(), folded(&looks(17, 20)).map());
    assert_eq!(level.gdb_state().await.unwrap().draft, at(22, 0));
    drop((level, snapshot));
    levels.shutdown().await;
    assert_eq!(verify(&store, SITE, LEVEL).await.unwrap().unwrap().faults, Vec::<String>::new());
    let spoilt = "update gdb_objects set content = (select content from gdb_objects \
        where content is null limit 1) where revision = 11";
    assert_eq!(database.meddle(spoilt).await, 2);
    let faults = verify(&store, SITE, LEVEL).await.unwrap().unwrap().faults;
    assert!(faults.iter().any(|fault| fault.contains("put 2 objects")), "{faults:?}");
    let gone = "delete from gdb_entries where revision = 22";
    database.meddle(gone).await;
    let faults = verify(&store, SITE, LEVEL).await.unwrap().unwrap().faults;
    assert!(faults.iter().any(|fault| fault.contains("no revision 22")), "{faults:?}");
}
