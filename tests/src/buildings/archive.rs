//! A map of `map_server` as the zip that an import wants: stored, not packed.

use std::path::Path;

use flate2::Crc;

use crate::Error;

/// The YAML `file`, and the image that it names, as a zip.
pub(super) fn zipped(file: &Path) -> Result<Vec<u8>, Error> {
    let read = |path: &Path| std::fs::read(path).map_err(|e| Error::file(path, e));
    let description = read(file)?;
    let text = String::from_utf8_lossy(&description).into_owned();
    let image = text.lines().find_map(|line| line.strip_prefix("image:")).unwrap_or_default();
    let image = image.trim().trim_matches(['"', '\'']).to_owned();
    let beside = file.parent().map(|folder| folder.join(&image)).unwrap_or_default();
    let pixels = read(&beside)?;
    Ok(zip(&[("map.yaml", &description), (&image, &pixels)]))
}

/// PKWARE's APPNOTE, sections 4.3.7, 4.3.12 and 4.3.16, method 0.
fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in files {
        let mut crc = Crc::new();
        crc.update(bytes);
        let offset = out.len() as u32;
        let mut common = Vec::new();
        // Version 2.0; no flags, no method, no time.
        common.extend([20, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        common.extend(crc.sum().to_le_bytes());
        common.extend((bytes.len() as u32).to_le_bytes());
        common.extend((bytes.len() as u32).to_le_bytes());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.as_bytes());
        out.extend(*bytes);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        // No comment, first disk, no attributes.
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (offset, count) = (out.len() as u32, files.len() as u16);
    let size = directory.len() as u32;
    out.extend(directory);
    out.extend(b"PK\x05\x06\x00\x00\x00\x00");
    out.extend(count.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.extend(size.to_le_bytes());
    out.extend(offset.to_le_bytes());
    out.extend([0, 0]);
    out
}
