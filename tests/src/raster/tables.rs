//! The tables of `mapfold-evaluate raster`, and what is not as it must be.

use std::path::Path;

use mapfold_client::evidence::SonarEvidenceConfig;

use super::fleet::{Layers, Override};
use super::recorded::{Rounds, emulated, log};
use super::{Scores, scanner, sonar};
use crate::{Error, report};

const SCORES: [&str; 4] = ["log score, bits/cell", "Brier", "AUC", "occupied F1"];
/// Rooms of each table.
const SEEDS: u64 = 20;
/// Offices of the fleet.
const OFFICES: u64 = 5;

/// Rewrites the tables `sonar`, `rules`, `scanner-grid`, `layers` and `recorded` of the report and draws the
/// corridor; answers what is not as it must be.
///
/// # Errors
/// A page, a log or a picture that cannot be read or written.
pub fn raster(page: &Path, picture: &Path) -> Result<Vec<String>, Error> {
    let mut faults = Vec::new();
    let write = |name: &str, first: &[&str], rows: &[Vec<String>]| {
        report::say(&report::table(&[first, &SCORES].concat(), rows));
        report::rewrite(page, name, &report::table(&[first, &SCORES].concat(), rows))
    };
    let (rows, wrong) = sonar_rows(SEEDS);
    write("sonar-grid", &["model"], &rows)?;
    faults.extend(wrong);
    let (rows, wrong) = rule_rows(SEEDS);
    write("rules", &["rule", "scene made for it", "applied", "readings are judged"], &rows)?;
    faults.extend(wrong);
    let (rows, wrong) = scanner_rows(SEEDS);
    write("scanner-grid", &["model"], &rows)?;
    faults.extend(wrong);
    let (rows, wrong) = layer_rows(OFFICES);
    write("layers", &["sonar drives", "what is read"], &rows)?;
    faults.extend(wrong);
    let rounds = Rounds::read(&log("corridor-ring8.log.gz"))?;
    let (mut rows, verdicts) = rounds.rows();
    report::say(&verdicts);
    rows.extend(emulated(&log("killian.log.gz"), 2600..2800)?);
    write("recorded", &["log", "model"], &rows)?;
    std::fs::write(picture, rounds.picture()).map_err(|e| Error::file(picture, e))?;
    Ok(faults)
}

fn row(first: &[&str], scores: &Scores) -> Vec<String> {
    first.iter().map(|word| (*word).to_owned()).chain(scores.cells()).collect()
}

/// Smooth rooms: base rate, plain cone, ours.
pub fn sonar_rows(seeds: u64) -> (Vec<Vec<String>>, Vec<String>) {
    let (rooms, _) = &sonar::scenes()[0];
    let all = sonar::beside(rooms, seeds);
    let names = ["base rate", "plain cone", "Mapfold"];
    let rows = names.into_iter().zip(&all).map(|(name, scores)| row(&[name], scores)).collect();
    let [base, plain, ours] = all;
    let mut faults = Vec::new();
    if ours.log_bits > 0.25 || ours.log_bits > 0.75 * plain.log_bits.min(base.log_bits) {
        faults.push(format!("sonar in smooth rooms: {:.3} bits a cell", ours.log_bits));
    }
    if ours.auc < 0.955 || ours.f1 < 0.82 {
        faults.push(format!("sonar in smooth rooms: AUC {:.3}, F1 {:.3}", ours.auc, ours.f1));
    }
    (rows, faults)
}

/// Every rule in its scene: with it, and without.
pub fn rule_rows(seeds: u64) -> (Vec<Vec<String>>, Vec<String>) {
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    for (scene, rule) in sonar::scenes() {
        let Some(rule) = rule else { continue };
        let ([with, without], applied) = sonar::ablated(&scene, rule, seeds);
        let applied = applied.to_string();
        let is_off = SonarEvidenceConfig::STANDARD.off.contains(&Some(rule));
        let name = if is_off { format!("{} (off)", rule.name()) } else { rule.name().to_owned() };
        rows.push(row(&[&name, scene.name, &applied, "with it"], &with));
        rows.push(row(&["", "", "", "without"], &without));
        let better = with.log_bits < without.log_bits || with.f1 > without.f1 + 0.02;
        if !better && !is_off {
            faults.push(format!("the rule {:?} earns nothing in its scene", rule.name()));
        }
    }
    (rows, faults)
}

/// A scanner in rooms: base rate, ray by ray, ours.
pub fn scanner_rows(seeds: u64) -> (Vec<Vec<String>>, Vec<String>) {
    let all: Vec<[Scores; 3]> = (0..seeds).map(scanner::scores).collect();
    let mean = |of: usize| Scores::mean(&all.iter().map(|scores| scores[of]).collect::<Vec<_>>());
    let [base, rays, ours] = [0, 1, 2].map(mean);
    let names = ["base rate", "ray by ray", "Mapfold"];
    let scores = [base, rays, ours];
    let rows = names.into_iter().zip(&scores).map(|(name, scores)| row(&[name], scores)).collect();
    let mut faults = Vec::new();
    if ours.log_bits > 0.25 * base.log_bits || ours.f1 < 0.97 {
        let (bits, f1) = (ours.log_bits, ours.f1);
        faults.push(format!("a scanner in rooms: {bits:.3} bits a cell, F1 {f1:.3}"));
    }
    (rows, faults)
}

/// A fleet in offices: each layer, and ways to read both.
pub fn layer_rows(seeds: u64) -> (Vec<Vec<String>>, Vec<String>) {
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    for (name, everywhere) in [("its own parts", false), ("everywhere", true)] {
        let all: Vec<Layers> = (0..seeds).map(|seed| Layers::of_seed(seed, everywhere)).collect();
        let mean =
            |of: &dyn Fn(&Layers) -> Scores| Scores::mean(&all.iter().map(of).collect::<Vec<_>>());
        let fused = |over, weight| mean(&|l| l.truth.scores(&l.fused(over, weight)));
        let alone = [mean(&|l| l.truth.scores(&l.scanner)), mean(&|l| l.truth.scores(&l.sonar))];
        let sum = fused(Override::Never, 1.0);
        let together = mean(&|l| l.truth.scores(&l.together()));
        for (what, scores) in [
            ("base rate", mean(&|l| l.truth.base_scores())),
            ("scanner alone", alone[0]),
            ("sonar alone", alone[1]),
            ("sum of both", sum),
            ("sonar by 0.3 after 3 looks of the scanner", fused(Override::Looks(3), 0.3)),
            ("sonar by 0.5 where the scanner looked", fused(Override::Looks(0), 0.5)),
            ("Mapfold: sonar by 0.3 where the scanner looked", together),
            ("sonar by 0.3 from 1.2 nat of the scanner", fused(Override::Evidence(1.2), 0.3)),
            ("no sonar from 1.2 nat of the scanner", fused(Override::Evidence(1.2), 0.0)),
        ] {
            rows.push(row(&[name, what], &scores));
        }
        if alone.iter().any(|layer| layer.log_bits <= together.log_bits) {
            faults.push(format!("sonar drives {name}: both are no better than a layer alone"));
        }
        if sum.log_bits < together.log_bits {
            faults.push(format!("sonar drives {name}: the plain sum tells more"));
        }
    }
    (rows, faults)
}
