//! Zips, descriptions and images that somebody or something has changed: they are read, or refused with what is wrong.

use std::collections::BTreeMap;
use std::io::{Cursor, Write};

use proptest::prelude::*;
use uuid::Uuid;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::super::sample::changed;
use super::*;

const YAML: &str = "image: map.FORMAT\nmode: trinary\nresolution: 0.05\norigin: [-1.0, 2.0, 0.1]\nnegate: 0\n\
    occupied_thresh: 0.65\nfree_thresh: 0.196\n";

/// A room of 40 by 30 cells with a thing in it.
fn grey(column: u32, row: u32) -> u8 {
    let is_border = column < 3 || row < 3 || column >= 37 || row >= 27;
    let is_thing = (15..22).contains(&column) && (10..18).contains(&row);
    if is_border || is_thing { 0 } else { 254 }
}

fn image(format: ImageFormat) -> Vec<u8> {
    let greys: Vec<u8> =
        (0..30).flat_map(|row| (0..40).map(move |column| grey(column, row))).collect();
    match format {
        ImageFormat::Pgm => [&b"P5\n40 30\n255\n"[..], &greys].concat(),
        ImageFormat::Png => {
            let mut bytes = Vec::new();
            let mut encoder = png::Encoder::new(&mut bytes, 40, 30);
            encoder.set_color(png::ColorType::Grayscale);
            encoder.set_depth(png::BitDepth::Eight);
            encoder.write_header().unwrap().write_image_data(&greys).unwrap();
            bytes
        }
    }
}

fn zipped(yaml: &[u8], format: ImageFormat, image: &[u8], is_deflated: bool) -> Vec<u8> {
    let name = format!("map.{}", end(format));
    let method = if is_deflated { CompressionMethod::Deflated } else { CompressionMethod::Stored };
    let options = SimpleFileOptions::default().compression_method(method);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in [("map.yaml", yaml), (name.as_str(), image)] {
        zip.start_file(name, options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn end(format: ImageFormat) -> &'static str {
    match format {
        ImageFormat::Pgm => "pgm",
        ImageFormat::Png => "png",
    }
}

/// What must be so whatever a zip holds.
fn held(bytes: &[u8]) -> Result<(), TestCaseError> {
    let package = match Package::unzip(bytes) {
        Ok(package) => package,
        Err(error) => {
            prop_assert!(!error.to_string().is_empty());
            return Ok(());
        }
    };
    if let Err(error) = package.import(0.05, Trust::STANDARD) {
        prop_assert!(!error.to_string().is_empty());
    }
    if let Err(fault) = package.walls(Uuid::from_u128(3), &BTreeMap::new()) {
        prop_assert!(!fault.place.is_empty() && !fault.fault.is_empty(), "{fault:?}");
    }
    Ok(())
}

type Edits = Vec<(prop::sample::Index, u8, u8)>;

fn edits(count: std::ops::Range<usize>) -> impl Strategy<Value = Edits> {
    prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..5_u8), count)
}

fn formats() -> impl Strategy<Value = ImageFormat> {
    prop::sample::select(vec![ImageFormat::Pgm, ImageFormat::Png])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// Of the zip itself: its directory, its checksums, what it has packed.
    #[test]
    fn changed_zips_are_read_or_refused(edits in edits(1..6), format in formats(), is_deflated: bool) {
        let yaml = YAML.replace("FORMAT", end(format));
        let mut bytes = zipped(yaml.as_bytes(), format, &image(format), is_deflated);
        changed(&mut bytes, &edits);
        held(&bytes)?;
    }

    /// Of what is in it, with sound checksums about it.
    #[test]
    fn changed_maps_are_read_or_refused(
        of_yaml in edits(0..4),
        of_image in edits(0..4),
        format in formats(),
    ) {
        let mut yaml = YAML.replace("FORMAT", end(format)).into_bytes();
        let mut image = image(format);
        changed(&mut yaml, &of_yaml);
        changed(&mut image, &of_image);
        held(&zipped(&yaml, format, &image, true))?;
    }

    /// Numbers that a description may say.
    #[test]
    fn other_numbers_are_read_or_refused(
        numbers in prop::collection::vec(any::<f64>(), 6),
        negate in any::<i64>(),
    ) {
        let [resolution, x, y, yaw, occupied, free] = numbers[..] else { unreachable!() };
        let yaml = format!(
            "image: map.pgm\nresolution: {resolution:?}\norigin: [{x:?}, {y:?}, {yaw:?}]\nnegate: {negate}\n\
             occupied_thresh: {occupied:?}\nfree_thresh: {free:?}\n"
        );
        held(&zipped(yaml.as_bytes(), ImageFormat::Pgm, &image(ImageFormat::Pgm), true))?;
    }
}
