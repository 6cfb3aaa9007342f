//! The lines of a drawing in pairs: a code that tells what the value after it is. Nothing is copied but text that is not
//! UTF-8.

use std::borrow::Cow;

use super::super::incoming::FileFault;

/// What binary drawings begin with.
const BINARY: &[u8] = b"AutoCAD Binary DXF";
/// Largest number that a drawing may hold: far beyond any building, in any unit.
const NUMBER_MAX: f64 = 1e12;

/// A code and its value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Group<'a> {
    /// The line of the value, from 1.
    pub(super) line: usize,
    pub(super) code: i32,
    pub(super) value: &'a str,
}

impl Group<'_> {
    pub(super) fn number(&self) -> Result<f64, FileFault> {
        let number = self.value.parse::<f64>().ok().filter(|number| number.abs() <= NUMBER_MAX);
        number.ok_or_else(|| self.fault(format!("{:?} is no number here", short(self.value))))
    }

    pub(super) fn integer(&self) -> Result<i64, FileFault> {
        let number = self.value.parse::<i64>().ok();
        number.ok_or_else(|| self.fault(format!("{:?} is no whole number", short(self.value))))
    }

    pub(super) fn fault(&self, fault: impl Into<String>) -> FileFault {
        fault_at(self.line, fault)
    }
}

pub(super) fn fault_at(line: usize, fault: impl Into<String>) -> FileFault {
    FileFault::at(format!("line {line}"), fault)
}

/// The beginning of a text, for messages.
pub(super) fn short(text: &str) -> String {
    text.chars().take(40).collect()
}

/// The text of a drawing: UTF-8, or else Latin-1, of which every byte is a letter.
pub(super) fn text(bytes: &[u8]) -> Result<Cow<'_, str>, FileFault> {
    if bytes.starts_with(BINARY) {
        return Err(fault_at(1, "this is a binary drawing: save it as ASCII DXF"));
    }
    Ok(match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|byte| char::from(*byte)).collect()),
    })
}

/// Reads group by group, and can look at the next one.
pub(super) struct Groups<'a> {
    lines: std::str::Lines<'a>,
    line: usize,
    next: Option<Group<'a>>,
}

impl<'a> Groups<'a> {
    pub(super) fn of(text: &'a str) -> Self {
        Self { lines: text.trim_start_matches('\u{feff}').lines(), line: 0, next: None }
    }

    /// The line that was read last.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// The next group; `None` at the end of the file. Comments are passed over.
    pub(super) fn read(&mut self) -> Result<Option<Group<'a>>, FileFault> {
        if let Some(next) = self.next.take() {
            return Ok(Some(next));
        }
        loop {
            let Some(code) = self.lines.next() else { return Ok(None) };
            self.line += 1;
            let Some(value) = self.lines.next() else {
                // An empty line at the end is none.
                let is_blank = code.trim().is_empty();
                let fault = "the drawing breaks off after a code";
                return if is_blank { Ok(None) } else { Err(fault_at(self.line, fault)) };
            };
            self.line += 1;
            let code = code.trim();
            let number = code.parse::<i32>().ok().filter(|code| (-5..=1071).contains(code));
            let number = number.ok_or_else(|| {
                let words =
                    format!("{:?} is no code of a group: is this an ASCII DXF?", short(code));
                fault_at(self.line - 1, words)
            })?;
            if number != 999 {
                let value = if number == 1000 { value } else { value.trim() };
                return Ok(Some(Group { line: self.line, code: number, value }));
            }
        }
    }

    /// Puts a group back.
    pub(super) fn put_back(&mut self, group: Group<'a>) {
        self.next = Some(group);
    }
}
