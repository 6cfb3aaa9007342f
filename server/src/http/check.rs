//! What people set up or ask for, checked before it is stored: slugs, names, figures, spans.

use mapfold_schema::border::{Violation, check_sensors, parse_feature_id};
use mapfold_schema::instant::parse_rfc3339;
use mapfold_schema::slug::{SLUG_LENGTH_MAX, is_slug};
use mapfold_schema::v1::{
    FixKind, NewLevel, NewModelChangeAnswer, NewRevert, NewRobot, NewSite, RobotFix, RobotUpdate,
    Scope, SensorProfile,
};

use super::problem::ApiError;
use crate::store::acts::{Span, Targets};

/// Longest name for people, bytes.
const NAME_LENGTH_MAX: usize = 128;
/// Longest reason, bytes.
const REASON_LENGTH_MAX: usize = 500;
/// Contributions that a revert may name one by one.
const NAMED_MAX: usize = 1000;
/// Edge of a cell: from half a centimetre to a metre.
const RESOLUTION_M: std::ops::RangeInclusive<f64> = 0.005..=1.0;
/// Height of a floor over some datum.
const ELEVATION_MAX_M: f64 = 10_000.0;
/// Height of something on a floor.
const UPPER_MAX_M: f64 = 100.0;
/// Length of a slice of evidence, seconds: ten minutes, shorter than which few looks come together, to
/// thirty days.
const SLICE_S: std::ops::RangeInclusive<u32> = 600..=2_592_000;
/// Places that a robot may think of at once.
const FIX_PLACES_MAX: usize = 16;
/// Segments, and landmarks, that one of its looks is matched with.
const FIX_MATCHED_MAX: usize = 1024;
/// No figure of a place is larger: metres, radians, and their squares.
const FIX_FIGURE_MAX: f64 = 1e6;
/// What a robot's token may allow: never what operators do.
const ROBOT_SCOPES: [Scope; 2] = [Scope::MapRead, Scope::MapContribute];

#[derive(Default)]
struct Findings(Vec<Violation>);

impl Findings {
    fn expect(&mut self, fine: bool, pointer: &str, code: &str, detail: impl Into<String>) {
        if !fine {
            let (pointer, code) = (pointer.to_owned(), code.to_owned());
            self.0.push(Violation { pointer, code, detail: detail.into() });
        }
    }

    fn slug(&mut self, text: &str, pointer: &str) {
        let detail = format!(
            "a slug is 1 to {SLUG_LENGTH_MAX} lower-case letters, digits and inner hyphens"
        );
        self.expect(is_slug(text), pointer, "not_a_slug", detail);
    }

    fn name(&mut self, name: Option<&str>) {
        let fits = |name: &str| {
            !name.trim().is_empty()
                && name.len() <= NAME_LENGTH_MAX
                && !name.chars().any(char::is_control)
        };
        let detail = format!("a name is 1 to {NAME_LENGTH_MAX} bytes without control characters");
        self.expect(name.is_none_or(fits), "/name", "bad_name", detail);
    }

    fn sensors(&mut self, sensors: &[SensorProfile]) {
        self.0.extend(check_sensors(sensors));
    }

    /// What a robot knows of its place.
    fn fix(&mut self, fix: &RobotFix) {
        self.slug(&fix.level, "/fix/level");
        self.instant(Some(&fix.observed_at), "/fix/observed_at");
        let most = match fix.kind {
            FixKind::Unique | FixKind::Tracked => 1..=1,
            FixKind::Ambiguous => 0..=FIX_PLACES_MAX,
            FixKind::NoMatch => 0..=0,
        };
        let detail =
            format!("one if unique or tracked, none if no match, else up to {FIX_PLACES_MAX}");
        self.expect(most.contains(&fix.places.len()), "/fix/places", "bad_count", detail);
        let number = |number: &f64| number.is_finite() && number.abs() <= FIX_FIGURE_MAX;
        let fine = fix.places.iter().all(|place| {
            let figures = [place.x_m, place.y_m, place.heading_rad];
            figures.iter().chain(place.covariance.iter().flatten()).all(number)
                && (0..3).all(|i| place.covariance[i][i] >= 0.0)
        });
        self.expect(fine, "/fix/places", "out_of_range", "poses in metres and radians");
        let fine = fix.landmarks_m.len() <= FIX_MATCHED_MAX
            && fix.landmarks_m.iter().flatten().all(number);
        self.expect(fine, "/fix/landmarks_m", "out_of_range", "at most 1024 places in metres");
        let fine = fix.segments.len() <= FIX_MATCHED_MAX
            && fix.segments.iter().all(|id| parse_feature_id(id).is_some());
        self.expect(fine, "/fix/segments", "bad_id", "at most 1024 ids of segments");
    }

    /// An instant, if there is one and it is one.
    fn instant(&mut self, text: Option<&str>, pointer: &str) -> Option<i64> {
        let instant = text.and_then(parse_rfc3339);
        let detail = "an instant as in 2026-11-22T04:00:00.123456Z";
        self.expect(text.is_none() || instant.is_some(), pointer, "bad_instant", detail);
        instant
    }

    fn done(self) -> Result<(), ApiError> {
        if self.0.is_empty() { Ok(()) } else { Err(ApiError::Invalid(self.0)) }
    }
}

/// What an entry of the log is for.
pub(super) fn comment(comment: &str) -> Result<(), ApiError> {
    if comment.len() <= REASON_LENGTH_MAX && !comment.chars().any(char::is_control) {
        return Ok(());
    }
    let words = "`comment` is at most 500 bytes without control characters.";
    Err(ApiError::Query(words.to_owned()))
}

/// A site to be made.
pub(super) fn new_site(new: &NewSite) -> Result<(), ApiError> {
    let mut findings = Findings::default();
    findings.slug(&new.site, "/site");
    findings.name(new.name.as_deref());
    findings.done()
}

/// A level to be made.
pub(super) fn new_level(new: &NewLevel) -> Result<(), ApiError> {
    let mut findings = Findings::default();
    findings.slug(&new.level, "/level");
    findings.name(new.name.as_deref());
    let (low, high) = (RESOLUTION_M.start(), RESOLUTION_M.end());
    let fine = new.resolution_m.is_none_or(|r| RESOLUTION_M.contains(&r));
    let detail = format!("the edge of a cell is {low} to {high} m");
    findings.expect(fine, "/resolution_m", "out_of_range", detail);
    let fine = new.elevation_m.is_none_or(|e| e.abs() <= ELEVATION_MAX_M);
    let detail = format!("a floor lies at most {ELEVATION_MAX_M} m above or below");
    findings.expect(fine, "/elevation_m", "out_of_range", detail);
    let (low, high) = (SLICE_S.start(), SLICE_S.end());
    let fine = new.evidence_slice_s.is_none_or(|s| SLICE_S.contains(&s));
    let detail = format!("evidence is summed up for stretches of {low} to {high} seconds");
    findings.expect(fine, "/evidence_slice_s", "out_of_range", detail);
    findings.done()
}

/// What is to become of a change against the GDB.
pub(super) fn change_answer(new: &NewModelChangeAnswer) -> Result<(), ApiError> {
    comment(&new.comment)?;
    let mut findings = Findings::default();
    findings.name(new.name.as_deref());
    let fine = new.upper_m.is_none_or(|upper| upper > 0.0 && upper <= UPPER_MAX_M);
    let detail = format!("a height of more than 0 and at most {UPPER_MAX_M} m");
    findings.expect(fine, "/upper_m", "out_of_range", detail);
    findings.done()
}

/// A robot to be enrolled.
pub(super) fn new_robot(new: &NewRobot) -> Result<(), ApiError> {
    let mut findings = Findings::default();
    findings.slug(&new.robot, "/robot");
    findings.name(new.name.as_deref());
    findings.sensors(&new.sensors);
    findings.done()
}

/// A change to a robot.
pub(super) fn robot_update(update: &RobotUpdate) -> Result<(), ApiError> {
    let mut findings = Findings::default();
    findings.name(update.name.as_deref());
    findings.sensors(update.sensors.as_deref().unwrap_or_default());
    for (pointer, figure) in
        [("/revision", update.revision), ("/queue_length", update.queue_length)]
    {
        let fine = figure.is_none_or(|f| f >= 0);
        findings.expect(fine, pointer, "out_of_range", "a whole number, 0 or more");
    }
    if let Some(fix) = &update.fix {
        findings.fix(fix);
    }
    findings.done()
}

/// A revert to be taken, or to be tried out; which contributions it means.
pub(super) fn new_revert(new: &NewRevert, is_preview: bool) -> Result<Targets, ApiError> {
    let NewRevert { id: _, contributions, robot, from, to, reason } = new;
    let mut findings = Findings::default();
    let fine = (is_preview || !reason.trim().is_empty())
        && reason.len() <= REASON_LENGTH_MAX
        && !reason.chars().any(char::is_control);
    let detail = format!("say why, in 1 to {REASON_LENGTH_MAX} bytes without control characters");
    findings.expect(fine, "/reason", "bad_reason", detail);
    let targets = match (contributions, robot) {
        (Some(ids), None) => {
            findings.expect(!ids.is_empty(), "/contributions", "empty", "name one at least");
            for (bound, pointer) in [(from, "/from"), (to, "/to")] {
                let detail = "a span is of a robot: leave it out, or name a robot instead";
                findings.expect(bound.is_none(), pointer, "span_without_robot", detail);
            }
            if ids.len() > NAMED_MAX {
                return Err(ApiError::TooManyItems { limit: NAMED_MAX });
            }
            Some(Targets::Contributions(ids.clone()))
        }
        (None, Some(robot)) => {
            findings.slug(robot, "/robot");
            let from_us = findings.instant(from.as_deref(), "/from");
            let to_us = findings.instant(to.as_deref(), "/to");
            let fine = from_us.zip(to_us).is_none_or(|(from, to)| from < to);
            findings.expect(fine, "/to", "empty_span", "the span must end after it begins");
            Some(Targets::Span(Span { robot: robot.clone(), from_us, to_us }))
        }
        _ => {
            let detail = "name either `contributions` or a `robot`";
            findings.expect(false, "", "what_to_revert", detail);
            None
        }
    };
    findings.done()?;
    // Without findings there are targets.
    targets.ok_or_else(|| ApiError::Internal("a revert of nothing".to_owned()))
}

/// The scopes of a robot's token; reading and contributing if none are named.
pub(super) fn robot_scopes(scopes: Option<Vec<Scope>>) -> Result<Vec<Scope>, ApiError> {
    let scopes = scopes.unwrap_or_else(|| ROBOT_SCOPES.to_vec());
    let mut findings = Findings::default();
    let fine = !scopes.is_empty() && scopes.iter().all(|scope| ROBOT_SCOPES.contains(scope));
    let detail = "a robot's token allows map:read, map:contribute or both";
    findings.expect(fine, "/scopes", "scope_not_for_robots", detail);
    findings.done().map(|()| scopes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pointers(result: Result<(), ApiError>) -> Vec<String> {
        match result {
            Err(ApiError::Invalid(errors)) => errors.into_iter().map(|e| e.pointer).collect(),
            _ => Vec::new(),
        }
    }

    #[test]
    fn every_bad_field_is_named() {
        let level = NewLevel {
            level: "Ground Floor".to_owned(),
            name: Some("\u{1b}[2J".to_owned()),
            resolution_m: Some(f64::NAN),
            elevation_m: Some(1e9),
            evidence_slice_s: Some(0),
        };
        let expected = ["/level", "/name", "/resolution_m", "/elevation_m", "/evidence_slice_s"];
        assert_eq!(pointers(new_level(&level)), expected);
        assert!(robot_scopes(Some(vec![Scope::MapRead, Scope::Admin])).is_err());
        assert!(robot_scopes(Some(Vec::new())).is_err());
        assert_eq!(robot_scopes(None).ok(), Some(ROBOT_SCOPES.to_vec()));
        let update = RobotUpdate { queue_length: Some(-1), ..RobotUpdate::default() };
        assert_eq!(pointers(robot_update(&update)), ["/queue_length"]);
    }
}
