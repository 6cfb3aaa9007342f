//! What vast models cost: cutting a plan, finding what is wrong with a model, its landmarks, its raster, and holding a map
//! against it.

use std::path::Path;

use mapfold_map::changes::{ChangeConfig, changes};
use mapfold_map::gdb::{
    Kind, LandmarkConfig, Model, Object, ObjectId, Plan, PriorConfig, Solid, Structure, findings,
    landmarks, prior,
};
use mapfold_map::level::LevelMap;
use tokio::time::Instant;

use crate::statistics::quantile;
use crate::{Error, report};

/// Rooms along one side of a floor: 1 250, 5 000 and 20 000 walls.
const SIDES: [u32; 3] = [25, 50, 100];
/// Every measurement is taken so often, and its median told.
const TIMES: usize = 5;
/// The height of a sensor, metres.
const HEIGHT_M: f64 = 0.3;
/// The cost of a wall on the largest floor, beside that on the smallest.
const GROWTH_MAX: f64 = 2.0;

/// A floor of `side` x `side` rooms of 4 m: two walls of 10 cm for each, with a doorway in one.
fn floor(side: u32) -> Model {
    let mut model = Model::default();
    let mut put = |kind: Kind, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], upper: f64| {
        let mut id = [0; 16];
        id[8..].copy_from_slice(&(model.objects.len() as u64).to_be_bytes());
        let solid = Solid::cuboid([x0, y0, 0.0], [x1, y1, upper]);
        model.objects.insert(ObjectId(id), Object::of(kind, vec![solid]));
    };
    for (x, y) in (0..side).flat_map(|x| (0..side).map(move |y| (x, y))) {
        let (x, y) = (f64::from(x) * 4.0, f64::from(y) * 4.0);
        put(Kind::Wall, [x, y], [x + 4.1, y + 0.1], 3.0);
        put(Kind::Wall, [x, y], [x + 0.1, y + 4.1], 3.0);
        put(Kind::Doorway, [x - 0.1, y + 1.5], [x + 0.2, y + 2.5], 2.1);
    }
    model
}

/// Median milliseconds of some work.
fn took<T>(work: impl Fn() -> T) -> (T, f64) {
    let mut times = Vec::new();
    loop {
        let begin = Instant::now();
        let done = work();
        times.push(begin.elapsed().as_secs_f64() * 1e3);
        if times.len() == TIMES {
            return (done, quantile(&times, 0.5));
        }
    }
}

/// Measures, and rewrites the table `plans` of a page.
///
/// # Errors
/// The page cannot be read or written.
pub fn table(page: &Path) -> Result<Vec<String>, Error> {
    let (mut rows, mut faults): (Vec<Vec<String>>, Vec<String>) = (Vec::new(), Vec::new());
    let mut smallest: Option<[f64; 5]> = None;
    for side in SIDES {
        let model = floor(side);
        let walls = f64::from(2 * side * side);
        let (plan, plan_ms): (Plan, f64) = took(|| Structure::of(&model).plan(HEIGHT_M));
        let (_, findings_ms) = took(|| findings(&model).len());
        let (found, landmarks_ms) = took(|| landmarks(&plan, &LandmarkConfig::STANDARD).len());
        let (_, prior_ms) = took(|| prior(&plan, &PriorConfig::standard(0.05)).map(|p| p.len()));
        let map = LevelMap::default();
        let (_, changes_ms) =
            took(|| changes(&plan, &map, &ChangeConfig::standard(0.05)).map(|c| c.len()));
        let all = [plan_ms, findings_ms, landmarks_ms, prior_ms, changes_ms];
        let each = all.map(|ms| ms / walls);
        let first = *smallest.get_or_insert(each);
        let growth = each.iter().zip(&first).map(|(now, first)| now / first).fold(0.0, f64::max);
        if growth > GROWTH_MAX {
            faults.push(format!("{walls} walls cost {growth:.2} times as much each as few do"));
        }
        let mut row = vec![walls.to_string(), found.to_string()];
        row.extend(all.iter().map(|ms| format!("{ms:.1}")));
        row.push(format!("{growth:.2}"));
        report::say(&row.join(" | "));
        rows.push(row);
    }
    let header = [
        "walls",
        "landmarks",
        "plan ms",
        "findings ms",
        "landmarks ms",
        "raster ms",
        "changes ms",
        "growth",
    ];
    report::rewrite(page, "plans", &report::table(&header, &rows))?;
    Ok(faults)
}
