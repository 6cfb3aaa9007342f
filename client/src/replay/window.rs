//! Which part of a log to play.

use std::str::FromStr;

use crate::log::Log;

/// A place to cut a log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cut {
    /// So many seconds after the log's first reading, by the log's clock.
    Seconds(f64),
    /// So large a share of the log's readings, 0 to 1: also for logs whose clock means nothing.
    Share(f64),
}

/// A cut that is none.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is no place in a log: give seconds from its start (90.5), or a share of it (33%)")]
pub struct CutError(String);

impl FromStr for Cut {
    type Err = CutError;

    fn from_str(text: &str) -> Result<Self, CutError> {
        let number = |digits: &str| {
            digits
                .trim()
                .parse::<f64>()
                .ok()
                .filter(|n| n.is_finite() && *n >= 0.0)
                .ok_or_else(|| CutError(text.to_owned()))
        };
        match text.strip_suffix('%') {
            Some(percent) => number(percent).and_then(|p| {
                if p <= 100.0 { Ok(Self::Share(p / 100.0)) } else { Err(CutError(text.to_owned())) }
            }),
            None => number(text).map(Self::Seconds),
        }
    }
}

/// From one cut up to, but without, another: windows that share a cut share no reading.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Window {
    /// The log's beginning if absent.
    pub from: Option<Cut>,
    /// The log's end if absent.
    pub to: Option<Cut>,
}

impl Window {
    /// The numbers of the readings in the window.
    pub fn select(&self, log: &Log) -> Vec<u32> {
        let (start, count) = (log.start_s(), log.readings.len() as f64);
        log.readings
            .iter()
            .filter(|reading| {
                let before = |cut: Cut| match cut {
                    Cut::Seconds(s) => reading.time_s - start < s,
                    Cut::Share(share) => f64::from(reading.index) < share * count,
                };
                !self.from.is_some_and(before) && self.to.is_none_or(before)
            })
            .map(|reading| reading.index)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::carmen::read_from;
    use std::io::Cursor;

    fn log() -> Log {
        let lines: Vec<String> =
            (0..10).map(|i| format!("FLASER 1 2.0 0 0 0 0 0 0 {} h 0\n", 100 + 10 * i)).collect();
        read_from(Cursor::new(lines.concat().into_bytes())).unwrap()
    }

    fn select(from: Option<&str>, to: Option<&str>) -> Vec<u32> {
        let cut = |text: Option<&str>| text.map(|t| t.parse().unwrap());
        Window { from: cut(from), to: cut(to) }.select(&log())
    }

    #[test]
    fn seconds_count_from_the_logs_start() {
        assert_eq!(select(None, None).len(), 10);
        assert_eq!(select(Some("20"), Some("50")), [2, 3, 4]);
        assert_eq!(select(Some("91"), None), Vec::<u32>::new());
    }

    #[test]
    fn windows_that_share_a_cut_share_no_reading_and_lose_none() {
        for cut in ["0%", "33%", "33.3333%", "66.6%", "100%", "0", "45", "50"] {
            let (mut left, right) = (select(None, Some(cut)), select(Some(cut), None));
            left.extend(right);
            assert_eq!(left, (0..10).collect::<Vec<_>>(), "{cut}");
        }
        assert_eq!(select(Some("33%"), Some("66%")), [4, 5, 6]);
    }

    #[test]
    fn what_is_no_cut_is_refused() {
        for text in ["", "x", "-1", "nan", "inf", "101%", "%", "1e999"] {
            assert!(text.parse::<Cut>().is_err(), "{text}");
        }
    }
}
