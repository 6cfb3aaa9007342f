//! Maps of different buildings: whatever is told of them is wrong.

use std::path::Path;

use mapfold_map::alignment::{AlignmentConfig, Chart, align};

use super::cuts::Recorded;
use super::{KEPT_ASIDE, away, chart};
use crate::{Error, logs, report};

/// Logs of raw odometry without any corrected pose, of one building: there is no truth to hold their halves against.
const WITHOUT_TRUTH: [&str; 3] = ["wean-1", "wean-2", "wean-3"];

/// The building of a log.
fn building(name: &str) -> &str {
    if name.starts_with("wean") { "wean" } else { name }
}

/// Rewrites the table `strangers` of a page: each log's whole map, in a frame of its own, against that of each log of
/// another building; and answers whether any was told.
pub(super) fn table(page: &Path, data: Option<&Path>) -> Result<Vec<String>, Error> {
    let config = AlignmentConfig::STANDARD;
    let mut all = logs::further(data);
    all.push(("killian".to_owned(), logs::killian()));
    all.extend(logs::named(data, &KEPT_ASIDE));
    all.extend(logs::named(data, &WITHOUT_TRUTH));
    let mut charts: Vec<(String, [Chart; 2])> = Vec::new();
    for (number, (name, path)) in all.into_iter().enumerate() {
        let recorded = Recorded::read(&path)?;
        let looks: Vec<usize> = (0..recorded.looks.len()).collect();
        let away = away(number as f64 + 0.5);
        let level = chart(&recorded.published_map(&looks));
        let own = chart(&recorded.map(&looks, |look| away.compose(&look.level_from_robot))?);
        charts.push((name, [level, own]));
    }
    let mut rows = Vec::new();
    let mut told_of_all = 0;
    for (name, [level, _]) in &charts {
        let (mut tried, mut told, mut agreed) = (0, 0, Vec::new());
        for (other, [_, own]) in &charts {
            if building(name) == building(other) {
                continue;
            }
            let alignment = align(level, own, &config);
            tried += 1;
            told += u32::from(alignment.aligned().is_some());
            agreed.extend(alignment.candidates.first().map(|best| best.agreed));
        }
        told_of_all += told;
        let most = agreed.into_iter().fold(0.0, f64::max);
        let row = vec![name.clone(), tried.to_string(), told.to_string(), format!("{most:.0}")];
        report::say(&row.join(" | "));
        rows.push(row);
    }
    let header = ["level", "robots from elsewhere", "told", "agreed m, most"];
    report::rewrite(page, "strangers", &report::table(&header, &rows))?;
    let fault = || format!("{told_of_all} maps of other buildings were aligned");
    Ok((told_of_all > 0).then(fault).into_iter().collect())
}
