//! A picture as a map reader sees it: greys, and where it is transparent.

use super::refusal::ImportError;
use super::{pgm, png_image};

/// Most pixels of an image that is read: 290 m by 290 m at 5 cm.
pub const PIXELS_READ_MAX: u64 = 1 << 25;

/// How a picture is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ImageFormat {
    /// Binary PGM, 8 bits.
    Pgm,
    /// PNG, 8 bits.
    Png,
}

impl ImageFormat {
    /// The end of its files' names, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Pgm => "pgm",
            Self::Png => "png",
        }
    }
}

/// A picture, the topmost row first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels across; at least 1.
    pub columns: u32,
    /// Pixels down; at least 1.
    pub rows: u32,
    /// Brightness of each pixel, 0 (black) to 255; of a colour, the mean of red, green and blue.
    pub grey: Vec<u8>,
    /// Whether each pixel is wholly opaque; `None` if the picture cannot be transparent.
    pub opaque: Option<Vec<bool>>,
}

impl Image {
    /// Reads a PGM (P2 or P5, 8 or 16 bits) or a PNG (any), told apart by their first bytes.
    ///
    /// # Errors
    /// Another format, a broken file, or more pixels than are taken.
    pub fn read(bytes: &[u8]) -> Result<Self, ImportError> {
        match bytes {
            [b'P', b'2' | b'5', ..] => pgm::read(bytes),
            [0x89, b'P', b'N', b'G', ..] => png_image::read(bytes),
            _ => Err(ImportError::ImageFormat),
        }
    }
}

/// How many pixels that are, if that is a number that is taken.
pub(super) fn checked_size(columns: u64, rows: u64) -> Result<usize, ImportError> {
    let pixels = columns.saturating_mul(rows);
    if pixels == 0 {
        return Err(ImportError::ImageEmpty { columns, rows });
    }
    if pixels > PIXELS_READ_MAX {
        return Err(ImportError::ImageTooLarge { columns, rows });
    }
    Ok(pixels as usize)
}
