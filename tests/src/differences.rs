//! What robots find against the model: floors from which things were removed, to which things were added, and on
//! which things were moved, and how soon and how truly the map tells.

mod floor;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mapfold_map::changes::{Change, ChangeConfig, ChangeId, What, changes};
use mapfold_map::gdb::{ObjectId, Structure};
use mapfold_map::level::{Level, LevelConfig};

use crate::plane::{Point, distance_to_hull};
use crate::simulation::Noise;
use crate::surveying::{Looker, RESOLUTION_M, START_S};
use crate::{Error, report};
use floor::{Fate, Floor};

/// The height that models are cut at, metres.
const HEIGHT_M: f64 = 0.3;
/// Beams that must meet an object, or pass where it should be, in a look at it.
const BEAMS_MIN: u32 = 5;
/// Floors, and looks at each.
const FLOORS: u64 = 50;
const LOOKS: u32 = 60;
/// Looks at an object by which it has to be told.
const TOLD_AFTER: u32 = 6;
/// Things are told where they are if no farther off, metres.
const NEAR_M: f64 = 0.3;

/// What became of one object that is not as the model says.
#[derive(Debug, Clone)]
struct Case {
    fate: Fate,
    /// Looks at it.
    looks: u32,
    /// Looks at it until something was said of it, and until that was right.
    noticed: Option<u32>,
    right: Option<u32>,
    /// Whether it was right after the last look.
    right_at_last: bool,
}

/// What was told on one floor.
#[derive(Debug, Default)]
struct Told {
    cases: Vec<Case>,
    unchanged: u32,
    /// Changes told that are none, each once.
    false_alarms: u32,
    /// Changes told after the last look, and those of them that are true.
    listed: u32,
    listed_true: u32,
    alarms: Vec<String>,
}

/// One robot after the other looks at a floor from anywhere.
fn watch(seed: u64) -> Result<Told, Error> {
    let mut noise = Noise::of_seed(seed);
    let floor = Floor::of_chance(&mut noise);
    let plan = Structure::of(&floor.model()).plan(HEIGHT_M);
    let world = floor.world();
    let config = ChangeConfig::standard(RESOLUTION_M);
    let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
    let mut robots = [Looker::new("ada", 7)?, Looker::new("bob", 8)?, Looker::new("eve", 9)?];
    let mut seen: BTreeMap<usize, u32> = BTreeMap::new();
    let mut told = Told { unchanged: floor.unchanged(), ..Told::default() };
    told.cases = floor.cases().map(|(_, fate)| Case::of(fate)).collect();
    let mut alarms: BTreeSet<String> = BTreeSet::new();
    for look in 0..LOOKS {
        let at = floor.stand(&mut noise);
        let heading = (noise.share() - 0.5) * std::f64::consts::TAU;
        let when = (look, START_S + 30.0 * f64::from(look));
        let robot = &mut robots[look as usize % 3];
        let Some(contribution) = robot.look(&world, (at, heading), when, &mut noise) else {
            continue;
        };
        level.fold(&[contribution]);
        for (case, (index, _)) in floor.cases().enumerate() {
            if floor.beams(index, &world, at, heading) >= BEAMS_MIN {
                *seen.entry(case).or_default() += 1;
            }
        }
        let found = changes(&plan, level.map(), &config).map_err(Error::Surface)?;
        let is_last = look + 1 == LOOKS;
        for (case, (index, fate)) in floor.cases().enumerate() {
            let about = |change: &&Change| floor.is_about(index, change);
            let noticed = found.values().any(|change| about(&change));
            let right = found.values().any(|change| floor.is_right(index, fate, change));
            let looks = seen.get(&case).copied().unwrap_or(0);
            let case = &mut told.cases[case];
            case.looks = looks;
            case.noticed = case.noticed.or(noticed.then_some(looks));
            case.right = case.right.or(right.then_some(looks));
            case.right_at_last = right;
        }
        for change in found.values() {
            let is_true = floor.cases().any(|(index, _)| floor.is_about(index, change));
            if !is_true {
                let name = format!("{:?}", change.id);
                if alarms.insert(name) {
                    told.alarms.push(format!("seed {seed}, look {look}: {change:?}"));
                }
            }
            told.listed += u32::from(is_last);
            told.listed_true += u32::from(is_last && is_true);
        }
    }
    told.false_alarms = alarms.len() as u32;
    Ok(told)
}

impl Case {
    fn of(fate: Fate) -> Self {
        Self { fate, looks: 0, noticed: None, right: None, right_at_last: false }
    }
}

impl Floor {
    /// Whether a change speaks of this object: by name, or by lying where it was or is.
    fn is_about(&self, index: usize, change: &Change) -> bool {
        let named = |id: ObjectId| id == floor::id(index);
        let object = &self.objects[index];
        let hull: Vec<Point> = change.hull.iter().map(|p| Point::new(p.x, p.y)).collect();
        let touches = |place: &floor::Box2| {
            let corners = place.corners();
            corners.iter().any(|p| distance_to_hull(&hull, *p) <= NEAR_M)
                || hull.iter().any(|p| distance_to_hull(&corners, *p) <= NEAR_M)
        };
        let is_there = || object.there.as_ref().is_some_and(touches);
        match change.id {
            ChangeId::Missing(id) | ChangeId::Opened(id) => named(id),
            // What was taken for another one that is gone is noticed, though not for what it is.
            ChangeId::Moved(id) => named(id) || is_there(),
            ChangeId::New(_) => is_there() || object.meant.as_ref().is_some_and(touches),
        }
    }

    /// Whether it says what has become of it: a motion to within 5 cm, a new thing where it is.
    fn is_right(&self, index: usize, fate: Fate, change: &Change) -> bool {
        let object = &self.objects[index];
        self.is_about(index, change)
            && match (&change.what, fate) {
                (What::Missing, Fate::Removed) | (What::New, Fate::Added) => true,
                (What::Moved { motion, .. }, Fate::Moved(_))
                    if change.id == ChangeId::Moved(floor::id(index)) =>
                {
                    let (Some(meant), Some(there)) = (&object.meant, &object.there) else {
                        return false;
                    };
                    let told = motion.act(&mapfold_map::geometry::Point::new(meant.x, meant.y));
                    Point::new(told.x, told.y).distance(Point::new(there.x, there.y)) <= 0.05
                }
                _ => false,
            }
    }
}

/// Watches many floors, and rewrites the table `differences` of a page.
///
/// # Errors
/// The page cannot be read or written.
pub fn table(page: &Path) -> Result<Vec<String>, Error> {
    let floors: Vec<Told> = (0..FLOORS).map(watch).collect::<Result<_, _>>()?;
    for alarm in floors.iter().flat_map(|floor| &floor.alarms) {
        report::say(alarm);
    }
    let mut faults = Vec::new();
    let mut rows = Vec::new();
    for fate in Fate::ALL {
        let cases: Vec<&Case> =
            floors.iter().flat_map(|f| &f.cases).filter(|case| case.fate == fate).collect();
        let seen: Vec<&&Case> = cases.iter().filter(|case| case.looks >= TOLD_AFTER).collect();
        let by_then = |looks: fn(&Case) -> Option<u32>| {
            let told = seen.iter().filter(|c| looks(c).is_some_and(|n| n <= TOLD_AFTER)).count();
            100.0 * told as f64 / seen.len().max(1) as f64
        };
        let at_last = seen.iter().filter(|case| case.right_at_last).count();
        let mut after: Vec<u32> = seen.iter().filter_map(|case| case.right).collect();
        after.sort_unstable();
        let noticed = by_then(|case| case.noticed);
        if fate.must_be_noticed() && noticed < 95.0 {
            faults.push(format!(
                "{}: only {noticed:.1} % told after {TOLD_AFTER} looks",
                fate.name()
            ));
        }
        rows.push(vec![
            fate.name(),
            seen.len().to_string(),
            format!("{noticed:.1} %"),
            format!("{:.1} %", by_then(|case| case.right)),
            format!("{:.1} %", 100.0 * at_last as f64 / seen.len().max(1) as f64),
            after.get(after.len() / 2).map_or("-".to_owned(), ToString::to_string),
        ]);
        report::say(&rows[rows.len() - 1].join(" | "));
    }
    let sum = |of: fn(&Told) -> u32| floors.iter().map(of).sum::<u32>();
    let (told, told_true) = (sum(|f| f.listed), sum(|f| f.listed_true));
    let alarms = f64::from(sum(|f| f.false_alarms));
    let rate = alarms * 100.0 * 100.0 / f64::from(sum(|f| f.unchanged)) / f64::from(LOOKS);
    if rate >= 0.1 {
        faults.push(format!("{rate:.3} false alarms per 100 unchanged objects per 100 looks"));
    }
    let said = format!(
        "{FLOORS} floors, {} unchanged objects, {LOOKS} looks at each floor: {alarms} false alarms, {rate:.3} per 100 unchanged \
         objects per 100 looks; of {told} changes told after the last look {:.1} % are true.",
        sum(|f| f.unchanged),
        100.0 * f64::from(told_true) / f64::from(told.max(1)),
    );
    report::say(&said);
    let header = [
        "what was done",
        "seen in 6 looks",
        "noticed by then",
        "right by then",
        "right at last",
        "looks, median",
    ];
    report::rewrite(page, "differences", &format!("{said}\n\n{}", report::table(&header, &rows)))?;
    Ok(faults)
}
