//! PGM, the portable graymap: P5 (binary) is read and written, P2 (text) is read.

use std::io::{self, Write};

use super::image::{Image, checked_size};
use super::refusal::ImportError;

/// Writes the head of a binary PGM of 8 bits; the rows follow, the topmost first.
pub(super) fn write_head(to: &mut impl Write, columns: usize, rows: usize) -> io::Result<()> {
    write!(to, "P5\n{columns} {rows}\n255\n")
}

/// Reads a P2 or P5. Greys beyond 8 bits are scaled and rounded to 8, as map readers do.
pub(super) fn read(bytes: &[u8]) -> Result<Image, ImportError> {
    let binary = bytes.get(1) == Some(&b'5');
    let mut words = Words { bytes, at: 2 };
    let columns = words.number("the width")?;
    let rows = words.number("the height")?;
    let head_end = words.at;
    let maximum = words.number("the largest grey")?;
    if maximum == 0 || maximum > 65_535 {
        return Err(fault(
            head_end,
            format!("the largest grey is {maximum}; it is from 1 to 65535"),
        ));
    }
    let pixels = checked_size(columns, rows)?;
    let grey = if binary {
        words.binary(pixels, maximum as u32)?
    } else {
        words.text(pixels, maximum as u32)?
    };
    Ok(Image { columns: columns as u32, rows: rows as u32, grey, opaque: None })
}

fn fault(offset: usize, fault: impl Into<String>) -> ImportError {
    ImportError::Pgm { offset, fault: fault.into() }
}

/// `value` of `maximum` as 8 bits.
fn eight_bits(value: u32, maximum: u32) -> u8 {
    ((value * 255 + maximum / 2) / maximum) as u8
}

struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Words<'_> {
    /// Passes over white space, and comments from `#` to the end of their line.
    fn skip(&mut self) {
        while let Some(byte) = self.bytes.get(self.at) {
            match byte {
                b'#' => {
                    let rest = &self.bytes[self.at..];
                    let end = rest.iter().position(|b| matches!(b, b'\n' | b'\r'));
                    self.at += end.unwrap_or(rest.len());
                }
                byte if byte.is_ascii_whitespace() || *byte == 0x0b => self.at += 1,
                _ => return,
            }
        }
    }

    fn number(&mut self, what: &str) -> Result<u64, ImportError> {
        let before = self.at;
        self.skip();
        let start = self.at;
        let mut value = 0_u64;
        while let Some(digit) = self.bytes.get(self.at).filter(|b| b.is_ascii_digit()) {
            // Beyond any number that is taken, its digits no longer matter.
            value = value.saturating_mul(10).saturating_add(u64::from(digit - b'0'));
            self.at += 1;
        }
        let found = self.bytes.get(self.at);
        if start == before || start == self.at {
            let instead = found.map_or("the file ends".to_owned(), |b| {
                format!("`{}` stands there", b.escape_ascii())
            });
            return Err(fault(start, format!("{what} should follow, a whole number; {instead}")));
        }
        Ok(value)
    }

    /// Exactly one white space separates the head from the greys.
    fn binary(&self, pixels: usize, maximum: u32) -> Result<Vec<u8>, ImportError> {
        match self.bytes.get(self.at) {
            Some(byte) if byte.is_ascii_whitespace() => {}
            _ => return Err(fault(self.at, "one line end should follow the head, then the greys")),
        }
        let start = self.at + 1;
        let width = if maximum > 255 { 2 } else { 1 };
        let raster = &self.bytes[start..];
        let Some(raster) = raster.get(..pixels * width) else {
            return Err(fault(
                self.bytes.len(),
                format!("the file ends after {} of {pixels} pixels", raster.len() / width),
            ));
        };
        let mut grey = Vec::with_capacity(pixels);
        for (index, bytes) in raster.chunks_exact(width).enumerate() {
            let value = bytes.iter().fold(0, |value, byte| value << 8 | u32::from(*byte));
            grey.push(self.checked(value, maximum, start + index * width)?);
        }
        Ok(grey)
    }

    fn text(&mut self, pixels: usize, maximum: u32) -> Result<Vec<u8>, ImportError> {
        // Each grey takes two bytes at least, so no file makes more room than it is long.
        let mut grey = Vec::with_capacity(pixels.min(self.bytes.len()));
        for pixel in 0..pixels {
            let at = self.at;
            let value = self.number(&format!("the grey of pixel {pixel} of {pixels}"))?;
            let value = u32::try_from(value).unwrap_or(u32::MAX);
            grey.push(self.checked(value, maximum, at)?);
        }
        Ok(grey)
    }

    #[expect(clippy::unused_self, reason = "reads like the other steps of reading")]
    fn checked(&self, value: u32, maximum: u32, at: usize) -> Result<u8, ImportError> {
        if value > maximum {
            return Err(fault(at, format!("a grey of {value}, but the largest is {maximum}")));
        }
        Ok(eight_bits(value, maximum))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn greys(bytes: &[u8]) -> Vec<u8> {
        let image = read(bytes).unwrap();
        assert_eq!(image.grey.len(), (image.columns * image.rows) as usize);
        image.grey
    }

    #[test]
    fn all_four_kinds_are_read_with_comments_anywhere_in_the_head() {
        assert_eq!(greys(b"P5\n2 2\n255\n\x00\x7f\xcd\xfe"), [0, 127, 205, 254]);
        assert_eq!(
            greys(b"P5 # CREATOR\n# two\n2 #w\n2\n# max\n255\n\x0a#\x20\xff"),
            [10, 35, 32, 255]
        );
        assert_eq!(greys(b"P2 2 2 255 0 127\n205 # a grey\n254"), [0, 127, 205, 254]);
        assert_eq!(greys(b"P5\r2 1\r65535\r\x00\x00\xcd\xcd"), [0, 205]);
        assert_eq!(greys(b"P2\n3 1\n65535\n0 32768 65535"), [0, 128, 255]);
        assert_eq!(greys(b"P2 3 1 100 0 50 100"), [0, 128, 255]);
        assert_eq!(greys(b"P5\n1 1\n15\n\x0f trailing"), [255]);
    }

    #[test]
    fn every_fault_names_its_byte() {
        let many = format!("P5\n{} {}\n255\n", u64::MAX, u64::MAX);
        for (bytes, offset, words) in [
            (&b"P5"[..], 2, "the width"),
            (b"P5x2 2\n255\n", 2, "`x` stands there"),
            (b"P5\n2 two\n255\n", 5, "the height"),
            (b"P5\n2 2", 6, "the largest grey"),
            (b"P5\n2 2\n0\n", 6, "from 1 to 65535"),
            (b"P5\n2 2\n65536\n", 6, "from 1 to 65535"),
            (b"P5\n2 2\n255", 10, "one line end"),
            (b"P5\n2 2\n255\nabc", 14, "after 3 of 4 pixels"),
            (b"P5\n2 2\n256\nabcdefg", 18, "after 3 of 4 pixels"),
            (b"P5\n2 1\n7\n\x07\x08", 10, "a grey of 8"),
            (b"P2\n2 1\n7\n7 8", 10, "a grey of 8"),
            (b"P2\n2 1\n7\n7", 10, "pixel 1 of 2"),
            (b"P2\n2 1\n7\n7 -1", 11, "`-` stands there"),
        ] {
            match read(bytes).unwrap_err() {
                ImportError::Pgm { offset: at, fault } => {
                    assert_eq!(at, offset, "{}: {fault}", bytes.escape_ascii());
                    assert!(fault.contains(words), "{}: {fault}", bytes.escape_ascii());
                }
                other => panic!("{}: {other}", bytes.escape_ascii()),
            }
        }
        assert!(matches!(read(many.as_bytes()), Err(ImportError::ImageTooLarge { .. })));
        assert!(matches!(
            read(b"P5 0 7 255\n"),
            Err(ImportError::ImageEmpty { columns: 0, rows: 7 })
        ));
        // A head that promises far more than the file holds takes no room for it.
        assert!(matches!(read(b"P5 5000 5000 255\n"), Err(ImportError::Pgm { .. })));
        assert!(matches!(read(b"P2 5000 5000 255\n1"), Err(ImportError::Pgm { .. })));
    }
}
