//! A YAML document that is one flat mapping of keys to scalars and lists of scalars, with the place
//! of each: all that a map's description may be. No aliases, so nothing can swell.

use std::borrow::Cow;

use saphyr_parser::{Event, Marker, Parser, ScalarStyle, Span};

use super::refusal::ImportError;

/// Most numbers of a list, far beyond the three that `origin` has.
const ITEMS_MAX: usize = 64;

/// A scalar and where it stands.
#[derive(Debug, Clone)]
pub(super) struct Text<'a> {
    pub(super) word: Cow<'a, str>,
    /// Without quotes: may be a number or a truth value.
    pub(super) plain: bool,
    at: Marker,
}

/// What a key stands for.
#[derive(Debug, Clone)]
pub(super) enum Value<'a> {
    Scalar(Text<'a>),
    List { items: Vec<Text<'a>>, at: Marker },
}

/// A key and its value.
#[derive(Debug, Clone)]
pub(super) struct Entry<'a> {
    pub(super) key: Text<'a>,
    pub(super) value: Value<'a>,
}

pub(super) fn fault_at(at: Marker, fault: impl Into<String>) -> ImportError {
    ImportError::Yaml { line: at.line(), column: at.col() + 1, fault: fault.into() }
}

impl Text<'_> {
    pub(super) fn fault(&self, fault: impl Into<String>) -> ImportError {
        fault_at(self.at, fault)
    }
}

impl Value<'_> {
    pub(super) fn fault(&self, fault: impl Into<String>) -> ImportError {
        match self {
            Self::Scalar(text) => text.fault(fault),
            Self::List { at, .. } => fault_at(*at, fault),
        }
    }
}

/// The entries of the document, in its order.
pub(super) fn read(yaml: &str) -> Result<Vec<Entry<'_>>, ImportError> {
    let mut reading = Reading { events: Parser::new_from_str(yaml) };
    let mut entries: Vec<Entry<'_>> = Vec::new();
    let (mut event, mut at) = reading.next()?;
    while matches!(event, Event::StreamStart | Event::DocumentStart(_)) {
        (event, at) = reading.next()?;
    }
    if !matches!(event, Event::MappingStart(..)) {
        return Err(fault_at(at, "a description is lines of `key: value`"));
    }
    loop {
        let key = match reading.next()? {
            (Event::MappingEnd, _) => break,
            (Event::Scalar(text, style, ..), at) => Text::new(text, style, at),
            (_, at) => return Err(fault_at(at, "a key is a word")),
        };
        if entries.iter().any(|entry| entry.key.word == key.word) {
            return Err(key.fault(format!("`{}` stands there twice: remove one", key.word)));
        }
        let value = reading.value()?;
        entries.push(Entry { key, value });
    }
    loop {
        match reading.next()? {
            (Event::StreamEnd, _) => return Ok(entries),
            (Event::DocumentEnd, _) => {}
            (_, at) => return Err(fault_at(at, "only one document is read: remove what follows")),
        }
    }
}

impl<'a> Text<'a> {
    fn new(text: Cow<'a, str>, style: ScalarStyle, at: Marker) -> Self {
        Self { word: text, plain: style == ScalarStyle::Plain, at }
    }
}

struct Reading<'a> {
    events: Parser<'a, saphyr_parser::StrInput<'a>>,
}

impl<'a> Reading<'a> {
    fn next(&mut self) -> Result<(Event<'a>, Marker), ImportError> {
        match self.events.next() {
            Some(Ok((event, Span { start, .. }))) => Ok((event, start)),
            Some(Err(error)) => Err(fault_at(*error.marker(), error.info())),
            None => Err(fault_at(Marker::new(0, 1, 0), "the description is empty")),
        }
    }

    fn value(&mut self) -> Result<Value<'a>, ImportError> {
        match self.next()? {
            (Event::Scalar(text, style, ..), at) => Ok(Value::Scalar(Text::new(text, style, at))),
            (Event::SequenceStart(..), at) => {
                let mut items = Vec::new();
                loop {
                    match self.next()? {
                        (Event::SequenceEnd, _) => return Ok(Value::List { items, at }),
                        (Event::Scalar(..), at) if items.len() == ITEMS_MAX => {
                            return Err(fault_at(at, format!("a list of more than {ITEMS_MAX}")));
                        }
                        (Event::Scalar(text, style, ..), at) => {
                            items.push(Text::new(text, style, at));
                        }
                        (_, at) => return Err(fault_at(at, "a list holds numbers only")),
                    }
                }
            }
            (Event::Alias(_), at) => {
                Err(fault_at(at, "references (`*name`) are not read: write the value out"))
            }
            (_, at) => Err(fault_at(at, "a value is a word, a number or a list of numbers")),
        }
    }
}
