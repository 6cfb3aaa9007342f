//! JSON for people, CBOR for robots, the same types behind both.
//!
//! In CBOR, UUIDs are byte strings of 16 and fractional numbers are floats of any width (never
//! integers); all else is as in JSON.

use serde::de::{DeserializeOwned, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserializer as _, Serialize};
use serde_json::value::RawValue;

use crate::border::Violation;
use crate::v1;

/// Media type of JSON.
pub const JSON: &str = "application/json";
/// Media type of CBOR.
pub const CBOR: &str = "application/cbor";

/// The byte that ends a CBOR array of unknown length.
const CBOR_BREAK: u8 = 0xff;

/// Longest piece of a body that an error repeats, bytes.
const ECHO_LENGTH_MAX: usize = 512;

/// A body that is not what it should be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// Neither JSON nor CBOR.
    #[error("the media type {0} is not known here: send {JSON} or {CBOR}")]
    MediaType(String),
    /// Not well-formed JSON.
    #[error("the body is not well-formed JSON: {0}")]
    Json(String),
    /// Not well-formed CBOR.
    #[error("the body is not well-formed CBOR: {0}")]
    Cbor(String),
    /// Well-formed, but not the expected shape there.
    #[error("the body does not have the expected shape at \"{}\": {}", .0.pointer, .0.detail)]
    Shape(Violation),
}

/// A value that cannot be written: a fault of ours, not of input.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("cannot encode: {0}")]
pub struct EncodeError(String);

/// One of the two formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Json,
    Cbor,
}

impl Format {
    /// The format of a media type with or without parameters, in any case.
    fn of(media_type: &str) -> Option<Self> {
        let essence = media_type.split(';').next().unwrap_or_default().trim();
        if essence.eq_ignore_ascii_case(JSON) {
            Some(Self::Json)
        } else if essence.eq_ignore_ascii_case(CBOR) {
            Some(Self::Cbor)
        } else {
            None
        }
    }
}

/// Writes `value` in the format of `media_type` ([`JSON`] or [`CBOR`]).
///
/// # Errors
/// Another media type; a type that the format cannot hold.
pub fn encode<T: Serialize>(media_type: &str, value: &T) -> Result<Vec<u8>, EncodeError> {
    match Format::of(media_type) {
        Some(Format::Json) => to_json(value),
        Some(Format::Cbor) => to_cbor(value),
        None => Err(EncodeError(format!("{media_type} is neither {JSON} nor {CBOR}"))),
    }
}

/// Reads a body of `media_type`, which may bear parameters.
///
/// # Errors
/// Another media type; what does not fit, with its place.
pub fn decode<T: DeserializeOwned>(media_type: &str, bytes: &[u8]) -> Result<T, DecodeError> {
    match Format::of(media_type) {
        Some(Format::Json) => from_json(bytes),
        Some(Format::Cbor) => from_cbor(bytes),
        None => Err(DecodeError::MediaType(media_type.to_owned())),
    }
}

/// Reads an upload: one contribution, or an array of them. The flag says whether it was an array,
/// because the answer is then an array too. How many there may be is not decided here.
///
/// # Errors
/// Another media type; what does not fit, with its place.
pub fn decode_uploads(
    media_type: &str,
    bytes: &[u8],
) -> Result<(Vec<v1::Contribution>, bool), DecodeError> {
    let format =
        Format::of(media_type).ok_or_else(|| DecodeError::MediaType(media_type.to_owned()))?;
    let is_array = match format {
        Format::Json => bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'['),
        // The upper three bits of a CBOR item's first byte are its major type; 4 is an array.
        Format::Cbor => bytes.first().is_some_and(|b| b >> 5 == 4),
    };
    let uploads = match (format, is_array) {
        (Format::Json, true) => from_json(bytes)?,
        (Format::Json, false) => vec![from_json(bytes)?],
        (Format::Cbor, true) => from_cbor(bytes)?,
        (Format::Cbor, false) => vec![from_cbor(bytes)?],
    };
    Ok((uploads, is_array))
}

/// Takes an array apart into its elements, still encoded, so that each can be read for itself and
/// one that does not fit spoils none of the others. Elements beyond the first `max` and one more
/// are left out.
///
/// # Errors
/// Another media type; what is not an array, or not well-formed.
pub fn split_array<'a>(
    media_type: &str,
    bytes: &'a [u8],
    max: usize,
) -> Result<Vec<&'a [u8]>, DecodeError> {
    match Format::of(media_type) {
        Some(Format::Json) => split_json(bytes, max),
        Some(Format::Cbor) => split_cbor(bytes, max),
        None => Err(DecodeError::MediaType(media_type.to_owned())),
    }
}

fn split_json(bytes: &[u8], max: usize) -> Result<Vec<&[u8]>, DecodeError> {
    /// Keeps the first `max` elements and one more.
    struct AtMost {
        max: usize,
    }
    impl<'de> Visitor<'de> for AtMost {
        type Value = Vec<&'de RawValue>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("an array")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut array: A) -> Result<Self::Value, A::Error> {
            let mut elements = Vec::new();
            while elements.len() <= self.max
                && let Some(element) = array.next_element()?
            {
                elements.push(element);
            }
            while array.next_element::<IgnoredAny>()?.is_some() {}
            Ok(elements)
        }
    }
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let elements = deserializer.deserialize_seq(AtMost { max });
    let whole = elements.and_then(|elements| deserializer.end().map(|()| elements));
    let elements = whole.map_err(|error| DecodeError::Json(error.to_string()))?;
    Ok(elements.into_iter().map(|element| element.get().as_bytes()).collect())
}

fn split_cbor(bytes: &[u8], max: usize) -> Result<Vec<&[u8]>, DecodeError> {
    let malformed = |error: &dyn ToString| DecodeError::Cbor(error.to_string());
    let mut deserializer = minicbor_serde::Deserializer::new(bytes);
    let decoder = deserializer.decoder_mut();
    let length = decoder.array().map_err(|e| malformed(&e))?;
    let mut elements = Vec::new();
    // An array may be of unknown length; a break then ends it.
    let ended = |elements: &Vec<&[u8]>, position: usize| match length {
        Some(length) => elements.len() as u64 >= length,
        None => bytes.get(position) == Some(&CBOR_BREAK),
    };
    while elements.len() <= max && !ended(&elements, decoder.position()) {
        let start = decoder.position();
        decoder.skip().map_err(|e| malformed(&e))?;
        elements.push(&bytes[start..decoder.position()]);
    }
    let end = decoder.position() + usize::from(length.is_none());
    if elements.len() <= max && end != bytes.len() {
        return Err(malformed(&"bytes follow the array"));
    }
    Ok(elements)
}

/// Writes JSON.
///
/// # Errors
/// A type that JSON cannot hold.
pub fn to_json<T: Serialize>(value: &T) -> Result<Vec<u8>, EncodeError> {
    serde_json::to_vec(value).map_err(|e| EncodeError(e.to_string()))
}

/// Reads JSON. Numbers come back bit for bit as they were written.
///
/// # Errors
/// What does not fit, with its place.
pub fn from_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, DecodeError> {
    serde_json::from_slice(bytes).map_err(|error| json_error::<T>(bytes, &error))
}

/// Writes CBOR: maps with field names as keys, in the order of the type's fields, so that equal
/// values give equal bytes.
///
/// # Errors
/// A type that CBOR cannot hold.
pub fn to_cbor<T: Serialize>(value: &T) -> Result<Vec<u8>, EncodeError> {
    minicbor_serde::to_vec(value).map_err(|e| EncodeError(e.to_string()))
}

/// Reads CBOR: one item and nothing behind it.
///
/// # Errors
/// What does not fit, with its place.
pub fn from_cbor<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, DecodeError> {
    let mut deserializer = minicbor_serde::Deserializer::new(bytes);
    let value =
        T::deserialize(&mut deserializer).map_err(|error| cbor_error::<T>(bytes, &error))?;
    match bytes.len() - deserializer.decoder().position() {
        0 => Ok(value),
        rest => Err(DecodeError::Cbor(format!("{rest} bytes follow the item"))),
    }
}

/// Why reading JSON failed. Only now is the body read again, first whether it is JSON at all, then
/// with its path kept: the way without fault pays nothing for it.
fn json_error<T: DeserializeOwned>(bytes: &[u8], error: &serde_json::Error) -> DecodeError {
    if let Err(error) = serde_json::from_slice::<IgnoredAny>(bytes) {
        return DecodeError::Json(error.to_string());
    }
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    match serde_path_to_error::deserialize::<_, T>(&mut deserializer) {
        Ok(_) => DecodeError::Json(error.to_string()),
        Err(traced) => shape(traced.path(), traced.inner()),
    }
}

/// Why reading CBOR failed, like [`json_error`]. minicbor does not tell bad bytes from bad shapes,
/// so the item is skipped first: what can be skipped whole is well-formed.
fn cbor_error<T: DeserializeOwned>(
    bytes: &[u8],
    error: &minicbor_serde::error::DecodeError,
) -> DecodeError {
    let mut deserializer = minicbor_serde::Deserializer::new(bytes);
    let skipped = deserializer.decoder_mut().skip();
    if skipped.is_err() || deserializer.decoder().position() != bytes.len() {
        return DecodeError::Cbor(error.to_string());
    }
    let mut deserializer = minicbor_serde::Deserializer::new(bytes);
    match serde_path_to_error::deserialize::<_, T>(&mut deserializer) {
        Ok(_) => DecodeError::Cbor(error.to_string()),
        Err(traced) => shape(traced.path(), traced.inner()),
    }
}

fn shape(path: &serde_path_to_error::Path, error: &impl ToString) -> DecodeError {
    use serde_path_to_error::Segment;
    let mut pointer = String::new();
    for step in path {
        let step = match step {
            Segment::Seq { index } => index.to_string(),
            // A key may be anything that the body holds.
            Segment::Map { key } => key.replace('~', "~0").replace('/', "~1"),
            // A variant that holds something is the key of an object.
            Segment::Enum { variant } => variant.clone(),
            Segment::Unknown => continue,
        };
        pointer.push('/');
        pointer.push_str(&step);
    }
    DecodeError::Shape(Violation {
        pointer: shortened(pointer),
        code: "unexpected_shape".to_owned(),
        detail: shortened(error.to_string()),
    })
}

/// At most [`ECHO_LENGTH_MAX`] bytes: errors quote the body, and the body may be megabytes.
fn shortened(mut text: String) -> String {
    text.truncate(text.floor_char_boundary(ECHO_LENGTH_MAX));
    text
}
