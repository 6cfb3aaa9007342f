//! What people set up: sites, levels, robots, tokens.

use mapfold_schema::v1;
use mapfold_server::store::StoreError;
use mapfold_server::store::tokens::TokenRow;

use crate::engines::Database;
use crate::synthetic::{FRAME, LEVEL, SITE, START_US, furnish, new_level, new_robot};

on_each_engine!(
    a_site_is_made_once_and_lists_its_levels,
    a_level_needs_its_site_and_is_made_once,
    a_robot_is_enrolled_once_and_changed_in_parts,
    a_token_is_found_listed_and_revoked_once,
    migrations_run_again_without_effect,
);

fn taken(outcome: &StoreError, kind: &str, name: &str) -> bool {
    matches!(outcome, StoreError::AlreadyExists { kind: k, name: n } if *k == kind && n == name)
}

fn missing(outcome: &StoreError, kind: &str, name: &str) -> bool {
    matches!(outcome, StoreError::Missing { kind: k, name: n } if *k == kind && n == name)
}

async fn a_site_is_made_once_and_lists_its_levels(database: Database) {
    let store = database.store().await;
    assert_eq!(store.sites().await.unwrap(), []);
    assert_eq!(store.site("b").await.unwrap(), None);
    let made = store.create_site("b", "Bee", START_US).await.unwrap();
    assert_eq!(
        made,
        v1::SiteDescription { site: "b".into(), name: "Bee".into(), levels: Vec::new() }
    );
    let again = store.create_site("b", "Other", START_US).await.unwrap_err();
    assert!(taken(&again, "site", "b"), "{again}");
    // Text is sorted by bytes on every engine: 1 before -, whatever a locale thinks.
    store.create_site("a-2", "A two", START_US).await.unwrap();
    store.create_site("a1", "A one", START_US).await.unwrap();
    for level in ["z", "a"] {
        store.create_level("b", &new_level(level)).await.unwrap();
    }
    let sites = store.sites().await.unwrap();
    let names: Vec<&str> = sites.iter().map(|s| s.site.as_str()).collect();
    assert_eq!(names, ["a-2", "a1", "b"]);
    assert_eq!(sites[2].levels, ["a", "z"]);
    assert_eq!(store.site("b").await.unwrap().as_ref(), Some(&sites[2]));
}

async fn a_level_needs_its_site_and_is_made_once(database: Database) {
    let store = database.store().await;
    let early = store.create_level(SITE, &new_level(LEVEL)).await.unwrap_err();
    assert!(missing(&early, "site", SITE), "{early}");
    store.create_site(SITE, "Plant", START_US).await.unwrap();
    let made = store.create_level(SITE, &new_level(LEVEL)).await.unwrap();
    assert_eq!((made.frame, made.revision, made.folded_revision), (FRAME, 0, 0));
    assert_eq!(store.level(SITE, LEVEL).await.unwrap().as_ref(), Some(&made));
    assert_eq!(store.levels(SITE).await.unwrap(), [made]);
    assert_eq!(store.level(SITE, "attic").await.unwrap(), None);
    assert_eq!(store.levels("elsewhere").await.unwrap(), []);
    assert_eq!(store.revisions(SITE, "attic").await.unwrap(), None);
    let again = store.create_level(SITE, &new_level(LEVEL)).await.unwrap_err();
    assert!(taken(&again, "level", LEVEL), "{again}");
}

async fn a_robot_is_enrolled_once_and_changed_in_parts(database: Database) {
    let store = database.store().await;
    let early = store.create_robot(SITE, &new_robot("anna"), START_US).await.unwrap_err();
    assert!(missing(&early, "site", SITE), "{early}");
    furnish(&store).await;
    let again = store.create_robot(SITE, &new_robot("anna"), START_US).await.unwrap_err();
    assert!(taken(&again, "robot", "anna"), "{again}");

    let anna = store.robot(SITE, "anna").await.unwrap().unwrap();
    assert_eq!(anna.name, "anna");
    assert_eq!(anna.sensors, new_robot("anna").sensors);
    assert_eq!(anna.competence, [v1::SensorKind::Scanner]);
    assert_eq!(anna.state, v1::RobotState::Active);
    assert_eq!((anna.last_pose.clone(), anna.contributions), (None, 0));
    let robots = store.robots(SITE).await.unwrap();
    assert_eq!(robots.len(), 3);
    assert_eq!(robots[0], anna);
    assert_eq!(store.robot(SITE, "zoe").await.unwrap(), None);

    let mut both = anna.sensors.clone();
    both.push(v1::SensorProfile { kind: v1::SensorKind::Sonar, ..both[0].clone() });
    let update = v1::RobotUpdate {
        sensors: Some(both.clone()),
        state: Some(v1::RobotState::Held),
        ..v1::RobotUpdate::default()
    };
    let held = store.update_robot(SITE, "anna", &update).await.unwrap().unwrap();
    assert_eq!(held.state, v1::RobotState::Held);
    assert_eq!(held.competence, [v1::SensorKind::Scanner, v1::SensorKind::Sonar]);
    assert_eq!((held.name.as_str(), held.revision), ("anna", None));
    let update = v1::RobotUpdate {
        name: Some("Anna K.".into()),
        revision: Some(17),
        queue_length: Some(3),
        ..v1::RobotUpdate::default()
    };
    let named = store.update_robot(SITE, "anna", &update).await.unwrap().unwrap();
    assert_eq!((named.revision, named.queue_length), (Some(17), Some(3)));
    assert_eq!((named.name.as_str(), &named.sensors), ("Anna K.", &both));
    assert_eq!(named.state, v1::RobotState::Held);
    assert_eq!(store.robot(SITE, "anna").await.unwrap(), Some(named));
    assert_eq!(store.update_robot(SITE, "zoe", &update).await.unwrap(), None);
}

async fn a_token_is_found_listed_and_revoked_once(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let admin = TokenRow {
        id: "adm".into(),
        secret_sha256: [7; 32],
        site: None,
        robot: None,
        scopes: vec![v1::Scope::Admin],
        created_at_us: START_US + 1,
        expires_at_us: None,
        revoked_at_us: None,
    };
    let robot = TokenRow {
        id: "zzz".into(),
        secret_sha256: [0xff; 32],
        site: Some(SITE.into()),
        robot: Some("anna".into()),
        scopes: vec![v1::Scope::MapRead, v1::Scope::MapContribute],
        created_at_us: START_US,
        expires_at_us: Some(START_US + 5),
        revoked_at_us: None,
    };
    store.create_token(&admin).await.unwrap();
    store.create_token(&robot).await.unwrap();
    let again = store.create_token(&admin).await.unwrap_err();
    assert!(taken(&again, "token", "adm"), "{again}");
    let nobody = TokenRow { id: "n".into(), robot: Some("zoe".into()), ..robot.clone() };
    let nobody = store.create_token(&nobody).await.unwrap_err();
    assert!(missing(&nobody, "robot", "zoe"), "{nobody}");
    let nowhere =
        TokenRow { id: "n".into(), site: Some("mars".into()), robot: None, ..robot.clone() };
    let nowhere = store.create_token(&nowhere).await.unwrap_err();
    assert!(missing(&nowhere, "site", "mars"), "{nowhere}");

    assert_eq!(store.token_by_id("adm").await.unwrap(), Some(admin.clone()));
    assert_eq!(store.token_by_id("n").await.unwrap(), None);
    assert_eq!(store.tokens().await.unwrap(), [robot.clone(), admin.clone()]);
    assert!(store.revoke_token("zzz", 9).await.unwrap());
    assert!(!store.revoke_token("zzz", 10).await.unwrap());
    assert!(!store.revoke_token("n", 10).await.unwrap());
    let revoked = store.token_by_id("zzz").await.unwrap();
    assert_eq!(revoked, Some(TokenRow { revoked_at_us: Some(9), ..robot }));
}

async fn migrations_run_again_without_effect(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    store.migrate().await.unwrap();
    store.ping().await.unwrap();
    store.close().await;
    assert!(store.ping().await.is_err());
    assert_eq!(database.store().await.sites().await.unwrap().len(), 1);
}
