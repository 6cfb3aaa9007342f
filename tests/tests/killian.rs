//! The Killian log (MIT, 3873 scans) as three robots through HTTP, into SQLite and into PostgreSQL:
//! the same revisions, identical exports, and a map that agrees with the readings.

use std::path::Path;

use mapfold_tests::Error;
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::{fleet, trial};

#[tokio::test]
async fn the_whole_log_gives_one_map_on_both_engines() -> Result<(), Error> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz"))?;
    assert_eq!(log.scans.len(), 3873);
    let robots = fleet::cut(&log, folder.path())?;

    let sqlite = trial::play(Database::Sqlite, &robots, Some(&log), folder.path()).await?;
    let postgres = Database::new_postgres().await?;
    let postgres = trial::play(postgres, &robots, Some(&log), folder.path()).await?;

    for outcome in [&sqlite, &postgres] {
        println!("{}", outcome.sentence(log.scans.len()));
        assert_eq!(outcome.revision, 3873, "{}", outcome.engine);
        let coverage = outcome.coverage.expect("a log of lasers");
        assert!(coverage.returns > 500_000, "{coverage:?}");
        assert!(trial::is_within_bounds(&coverage), "{}", outcome.sentence(log.scans.len()));
    }
    assert_eq!(sqlite.differences(&postgres), Vec::<&str>::new());
    Ok(())
}
