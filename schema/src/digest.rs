//! The digest by which a contribution's content is known, and identities made of digests.

use std::fmt::Write as _;

use sha2::{Digest, Sha256};
use uuid::Uuid;

use crate::codec::{self, EncodeError};
use crate::v1;

/// SHA-256 of the contribution's CBOR as [`codec::to_cbor`] writes it, in lower-case hexadecimal.
/// The same content gives the same digest, whether it came as JSON or as CBOR.
///
/// # Errors
/// A contribution that CBOR cannot hold (none that was decoded).
pub fn content_digest(contribution: &v1::Contribution) -> Result<String, EncodeError> {
    let digest = Sha256::digest(codec::to_cbor(contribution)?);
    Ok(hexadecimal(&digest))
}

/// The identity that a digest gives, a UUID of version 8: the same whenever the same was digested.
pub fn identity(digest: &[u8; 32]) -> Uuid {
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&digest[..16]);
    uuid::Builder::from_custom_bytes(bytes).into_uuid()
}

/// Bytes in lower-case hexadecimal.
pub fn hexadecimal(bytes: &[u8]) -> String {
    let mut hex = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        let _ = write!(hex, "{byte:02x}"); // writing to a String cannot fail
    }
    hex
}
