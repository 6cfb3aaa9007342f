//! The chunks of a GLB: twelve bytes at the head, then the JSON, then perhaps the binary part.

use super::super::incoming::FileFault;

pub(super) const MAGIC: u32 = 0x4654_6C67;
pub(super) const JSON: u32 = 0x4E4F_534A;
pub(super) const BINARY: u32 = 0x004E_4942;

/// The JSON and the binary part of a file; the latter may be empty.
pub(super) fn open(bytes: &[u8]) -> Result<(&[u8], &[u8]), FileFault> {
    let fault = |at: usize, fault: &str| Err(FileFault::at(format!("byte {at}"), fault));
    if word(bytes, 0) != Some(MAGIC) {
        return fault(
            0,
            "this is no binary glTF (GLB): a glTF of several files is not read, save it as one",
        );
    }
    if word(bytes, 4) != Some(2) {
        return fault(4, "only version 2 of glTF is read");
    }
    let length = word(bytes, 8).map(|length| length as usize);
    let Some(bytes) = length.filter(|length| *length >= 12).and_then(|length| bytes.get(..length))
    else {
        return fault(8, "the file is shorter than it says here: it breaks off");
    };
    let chunk = |at: usize| {
        let (length, kind) = (word(bytes, at)? as usize, word(bytes, at + 4)?);
        let from = at.checked_add(8)?;
        Some((kind, bytes.get(from..from.checked_add(length)?)?))
    };
    let json = match chunk(12) {
        Some((JSON, json)) => json,
        Some(_) => return fault(16, "the first chunk of a GLB is JSON"),
        None => return fault(12, "the first chunk breaks off"),
    };
    let next = 20 + json.len();
    if next == bytes.len() {
        return Ok((json, &[]));
    }
    match chunk(next) {
        Some((BINARY, binary)) => Ok((json, binary)),
        // Chunks that nobody knows are to be passed over; what we need is the second one.
        Some(_) => Ok((json, &[])),
        None => fault(next, "this chunk breaks off"),
    }
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let word = bytes.get(at..at.checked_add(4)?)?;
    word.try_into().ok().map(u32::from_le_bytes)
}
