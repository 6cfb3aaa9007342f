//! PNG as maps use it: any kind is read as greys; 8 bit grey, with or without alpha, is written.

use std::io::{Cursor, Write};

use png::{BitDepth, ColorType, Transformations};

use super::image::{Image, checked_size};
use super::refusal::ImportError;

/// Most bytes of an unpacked picture, and of what else its file holds.
const BYTES_MAX: usize = 160 << 20;

/// Reads a PNG: a colour is the mean of its parts, 16 bits are rounded to 8, and what is not wholly
/// opaque is marked.
pub(super) fn read(bytes: &[u8]) -> Result<Image, ImportError> {
    let broken = |error: png::DecodingError| ImportError::Png(error.to_string());
    let limits = png::Limits { bytes: BYTES_MAX };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::EXPAND);
    let head = decoder.read_header_info().map_err(broken)?;
    let (columns, rows) = (head.width, head.height);
    let pixels = checked_size(u64::from(columns), u64::from(rows))?;
    let mut reader = decoder.read_info().map_err(broken)?;
    let too_large =
        || ImportError::ImageTooLarge { columns: u64::from(columns), rows: u64::from(rows) };
    let size = reader.output_buffer_size().filter(|size| *size <= BYTES_MAX);
    let mut samples = vec![0; size.ok_or_else(too_large)?];
    let frame = reader.next_frame(&mut samples).map_err(broken)?;
    let sample_bytes = if frame.bit_depth == BitDepth::Sixteen { 2 } else { 1 };
    let (colours, alpha) = match frame.color_type {
        ColorType::Grayscale => (1, false),
        ColorType::GrayscaleAlpha => (1, true),
        ColorType::Rgb => (3, false),
        ColorType::Rgba => (3, true),
        ColorType::Indexed => return Err(ImportError::Png("its palette is missing".to_owned())),
    };
    let pixel_bytes = sample_bytes * (colours + usize::from(alpha));
    let mut grey = Vec::with_capacity(pixels);
    let mut opaque = alpha.then(|| Vec::with_capacity(pixels));
    for pixel in samples.chunks_exact(pixel_bytes).take(pixels) {
        let (colour, coverage) = pixel.split_at(sample_bytes * colours);
        grey.push(mean(colour, sample_bytes));
        if let Some(opaque) = &mut opaque {
            opaque.push(coverage.iter().all(|byte| *byte == u8::MAX));
        }
    }
    Ok(Image { columns, rows, grey, opaque })
}

/// The mean of a colour's parts as 8 bits, rounded.
fn mean(colour: &[u8], sample_bytes: usize) -> u8 {
    let parts = (colour.len() / sample_bytes) as u32;
    let sum: u32 = match sample_bytes {
        1 => colour.iter().map(|byte| u32::from(*byte) * 257).sum(),
        _ => colour.chunks_exact(2).map(|b| u32::from(b[0]) << 8 | u32::from(b[1])).sum(),
    };
    let whole = 257 * parts;
    ((sum + whole / 2) / whole) as u8
}

/// A writer of rows: grey, or grey and alpha, 8 bits each; the topmost row first.
pub(super) fn writer<W: Write>(
    to: W,
    columns: usize,
    rows: usize,
    alpha: bool,
) -> Result<png::Writer<W>, png::EncodingError> {
    let mut encoder = png::Encoder::new(to, columns as u32, rows as u32);
    encoder.set_color(if alpha { ColorType::GrayscaleAlpha } else { ColorType::Grayscale });
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_filter(png::Filter::NoFilter);
    encoder.write_header()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How it is encoded, its bytes, and the greys and opaqueness that it has.
    type Case = (Kind, Vec<u8>, [u8; 2], Option<[bool; 2]>);

    struct Kind {
        color: ColorType,
        depth: BitDepth,
        palette: Option<&'static [u8]>,
        transparent: Option<&'static [u8]>,
    }

    fn encoded(kind: &Kind, columns: u32, rows: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, columns, rows);
        encoder.set_color(kind.color);
        encoder.set_depth(kind.depth);
        if let Some(palette) = kind.palette {
            encoder.set_palette(palette);
        }
        if let Some(transparent) = kind.transparent {
            encoder.set_trns(transparent);
        }
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn every_kind_is_read_as_greys_and_opaqueness() {
        use BitDepth::{Eight, One, Sixteen};
        use ColorType::{Grayscale, GrayscaleAlpha, Indexed, Rgb, Rgba};
        let kind = |color, depth| Kind { color, depth, palette: None, transparent: None };
        let with = |color, depth, palette, transparent| Kind { color, depth, palette, transparent };
        let cases: [Case; 9] = [
            (kind(Grayscale, Eight), vec![0, 205], [0, 205], None),
            (kind(Grayscale, One), vec![0b0100_0000], [0, 255], None),
            (kind(Grayscale, Sixteen), vec![0x80, 0x00, 0xcd, 0xcd], [128, 205], None),
            (kind(GrayscaleAlpha, Eight), vec![9, 255, 8, 254], [9, 8], Some([true, false])),
            (
                kind(GrayscaleAlpha, Sixteen),
                vec![9, 9, 255, 255, 8, 8, 255, 254],
                [9, 8],
                Some([true, false]),
            ),
            (kind(Rgb, Eight), vec![255, 0, 0, 10, 20, 31], [85, 20], None),
            (kind(Rgba, Eight), vec![0, 255, 0, 255, 1, 1, 1, 0], [85, 1], Some([true, false])),
            (
                with(Indexed, Eight, Some(&[0, 0, 0, 30, 60, 90]), Some(&[255, 0])),
                vec![0, 1],
                [0, 60],
                Some([true, false]),
            ),
            (with(Grayscale, Eight, None, Some(&[0, 7])), vec![7, 8], [7, 8], Some([false, true])),
        ];
        for (kind, data, grey, opaque) in cases {
            let image = read(&encoded(&kind, 2, 1, &data)).unwrap();
            let name = (kind.color, kind.depth);
            assert_eq!(image.grey, grey, "{name:?}");
            assert_eq!(image.opaque, opaque.map(|o| o.to_vec()), "{name:?}");
        }
    }

    #[test]
    fn what_is_broken_or_swells_is_refused() {
        let kind = Kind {
            color: ColorType::Grayscale,
            depth: BitDepth::Eight,
            palette: None,
            transparent: None,
        };
        let good = encoded(&kind, 40, 30, &[77; 1200]);
        for end in [8, 20, 40, good.len() - 13] {
            assert!(matches!(read(&good[..end]), Err(ImportError::Png(_))), "cut at {end}");
        }
        // A head of 100000 by 100000 pixels, as a hostile file would have it.
        let mut bomb = good.clone();
        bomb[16..24].copy_from_slice(&[0, 1, 0x86, 0xa0, 0, 1, 0x86, 0xa0]);
        let crc = crc32(&bomb[12..29]);
        bomb[29..33].copy_from_slice(&crc.to_be_bytes());
        assert!(matches!(read(&bomb), Err(ImportError::ImageTooLarge { columns: 100_000, .. })));
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 * (crc & 1)))
        })
    }
}
