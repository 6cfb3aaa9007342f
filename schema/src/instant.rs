//! Instants on the wire: RFC 3339 text; inside, microseconds since 1970. Knows no clock.

use time::format_description::well_known::Rfc3339;
use time::{Date, Month, OffsetDateTime, PrimitiveDateTime, Time};

/// `us` microseconds since 1970 as RFC 3339 in UTC, always 27 characters:
/// `2026-11-22T04:00:00.123456Z`. What lies outside the years 0 to 9999 becomes their first or
/// last instant, because RFC 3339 cannot say it.
pub fn to_rfc3339(us: i64) -> String {
    let t = OffsetDateTime::from_unix_timestamp_nanos(i128::from(us) * 1000)
        .ok()
        .filter(|t| (0..=9999).contains(&t.year()))
        .unwrap_or_else(|| if us < 0 { first() } else { last() });
    format!(
        "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:06}Z",
        t.year(),
        u8::from(t.month()),
        t.day(),
        t.hour(),
        t.minute(),
        t.second(),
        t.microsecond()
    )
}

/// Microseconds since 1970 of an RFC 3339 text with any offset, rounded down; `None` if it is none.
pub fn parse_rfc3339(text: &str) -> Option<i64> {
    let t = OffsetDateTime::parse(text, &Rfc3339).ok()?;
    i64::try_from(t.unix_timestamp_nanos().div_euclid(1000)).ok()
}

fn first() -> OffsetDateTime {
    Date::from_calendar_date(0, Month::January, 1)
        .map_or(OffsetDateTime::UNIX_EPOCH, |d| d.midnight().assume_utc())
}

fn last() -> OffsetDateTime {
    match (
        Date::from_calendar_date(9999, Month::December, 31),
        Time::from_hms_micro(23, 59, 59, 999_999),
    ) {
        (Ok(date), Ok(time)) => PrimitiveDateTime::new(date, time).assume_utc(),
        _ => OffsetDateTime::UNIX_EPOCH,
    }
}
