//! YAML as a tree of scalars, lists and mappings, each with its place. Bounded in depth and size, and without references,
//! so that nothing can swell.

use std::borrow::Cow;

use saphyr_parser::{Event, Marker, Parser, ScalarStyle, Span};

use super::BuildingError;

/// Lists and mappings within each other.
const DEPTH_MAX: usize = 16;
/// Scalars, lists and mappings in all.
const NODES_MAX: usize = 1_000_000;

/// A node and its place.
#[derive(Debug, Clone)]
pub(super) struct Node<'a> {
    pub(super) value: Value<'a>,
    at: Marker,
}

/// What a node is.
#[derive(Debug, Clone)]
pub(super) enum Value<'a> {
    /// A word; `true` if it stands there without quotes.
    Scalar(Cow<'a, str>, bool),
    List(Vec<Node<'a>>),
    Map(Vec<(Cow<'a, str>, Node<'a>)>),
}

fn fault_at(at: Marker, fault: impl Into<String>) -> BuildingError {
    BuildingError::At { line: at.line(), column: at.col() + 1, fault: fault.into() }
}

/// The tree of the document.
pub(super) fn read(text: &str) -> Result<Node<'_>, BuildingError> {
    let mut reading = Reading { events: Parser::new_from_str(text), nodes: 0 };
    loop {
        match reading.next()? {
            (Event::StreamStart | Event::DocumentStart(_), _) => {}
            (event, at) => return reading.node(event, at, 0),
        }
    }
}

struct Reading<'a> {
    events: Parser<'a, saphyr_parser::StrInput<'a>>,
    nodes: usize,
}

impl<'a> Reading<'a> {
    fn next(&mut self) -> Result<(Event<'a>, Marker), BuildingError> {
        match self.events.next() {
            Some(Ok((event, Span { start, .. }))) => Ok((event, start)),
            Some(Err(error)) => Err(fault_at(*error.marker(), error.info())),
            None => Err(fault_at(Marker::new(0, 1, 0), "the building is empty")),
        }
    }

    fn node(
        &mut self,
        event: Event<'a>,
        at: Marker,
        depth: usize,
    ) -> Result<Node<'a>, BuildingError> {
        self.nodes += 1;
        if self.nodes > NODES_MAX {
            return Err(fault_at(at, format!("more than {NODES_MAX} values are not taken")));
        }
        if depth > DEPTH_MAX {
            return Err(fault_at(
                at,
                format!("more than {DEPTH_MAX} levels of lists are not taken"),
            ));
        }
        let value = match event {
            Event::Scalar(text, style, ..) => Value::Scalar(text, style == ScalarStyle::Plain),
            Event::SequenceStart(..) => {
                let mut items = Vec::new();
                loop {
                    match self.next()? {
                        (Event::SequenceEnd, _) => break Value::List(items),
                        (event, at) => items.push(self.node(event, at, depth + 1)?),
                    }
                }
            }
            Event::MappingStart(..) => {
                let mut entries = Vec::new();
                loop {
                    let key = match self.next()? {
                        (Event::MappingEnd, _) => break Value::Map(entries),
                        (Event::Scalar(text, ..), _) => text,
                        (_, at) => return Err(fault_at(at, "a key is a word")),
                    };
                    let (event, at) = self.next()?;
                    entries.push((key, self.node(event, at, depth + 1)?));
                }
            }
            Event::Alias(_) => {
                let fault = "references (`*name`) are not read: write the value out";
                return Err(fault_at(at, fault));
            }
            _ => return Err(fault_at(at, "there is nothing here: a building is a mapping")),
        };
        Ok(Node { value, at })
    }
}

impl<'a> Node<'a> {
    pub(super) fn fault(&self, fault: impl Into<String>) -> BuildingError {
        fault_at(self.at, fault)
    }

    /// The value of a key of a mapping; `None` if it is not there, or nothing is.
    pub(super) fn get(&self, key: &str) -> Option<&Node<'a>> {
        let Value::Map(entries) = &self.value else { return None };
        let found = entries.iter().find(|(name, _)| name == key).map(|(_, node)| node);
        found.filter(|node| !node.is_nothing())
    }

    fn is_nothing(&self) -> bool {
        matches!(&self.value, Value::Scalar(word, true) if matches!(word.as_ref(), "" | "~" | "null"))
    }

    pub(super) fn entries(&self, what: &str) -> Result<&[(Cow<'a, str>, Node<'a>)], BuildingError> {
        match &self.value {
            Value::Map(entries) => Ok(entries),
            _ => Err(self.fault(format!("{what} is a mapping of keys to values"))),
        }
    }

    pub(super) fn items(&self, what: &str) -> Result<&[Node<'a>], BuildingError> {
        match &self.value {
            Value::List(items) => Ok(items),
            _ => Err(self.fault(format!("{what} is a list"))),
        }
    }

    pub(super) fn word(&self, what: &str) -> Result<&str, BuildingError> {
        match &self.value {
            Value::Scalar(word, _) => Ok(word),
            _ => Err(self.fault(format!("{what} is a word"))),
        }
    }

    pub(super) fn number(&self, what: &str) -> Result<f64, BuildingError> {
        let word = self.word(what)?;
        let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| self.fault(format!("{what} is a number, not {word:?}")))
    }

    /// A whole number that counts one of `count` things from 0.
    pub(super) fn index(&self, what: &str, count: usize) -> Result<usize, BuildingError> {
        let word = self.word(what)?;
        let index = word.parse::<usize>().ok().filter(|index| *index < count);
        index.ok_or_else(|| {
            self.fault(format!("{what} is the number of one of {count} vertices, not {word:?}"))
        })
    }
}
