//! A description and its image, together in a zip or each by itself, as a prior.

use std::borrow::Cow;
use std::io::{Cursor, Read};

use mapfold_map::raster::{TILE_SIDE, TileIndex};
use mapfold_schema::v1::{Bounds, ImportReport};
use sha2::{Digest, Sha256};
use zip::ZipArchive;

use super::cells::load;
use super::description::{DESCRIPTION_BYTES_MAX, Description};
use super::image::Image;
use super::prior::{Prior, Trust};
use super::refusal::ImportError;

/// Most bytes of an image's file: more than any image that is taken has as a binary PGM of 16 bits.
pub const IMAGE_BYTES_MAX: usize = 80 << 20;
/// Most files of a zip.
const FILES_MAX: usize = 32;

/// A map of another program on the grid of a level.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// What it says.
    pub prior: Prior,
    /// What was found in it.
    pub report: ImportReport,
}

/// The files of a map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Package {
    /// The YAML.
    pub description: Vec<u8>,
    /// The image that it names.
    pub image: Vec<u8>,
}

impl Package {
    /// Takes the two files out of a zip: the one YAML in it, and the image that this names, in
    /// whatever folders they are.
    ///
    /// # Errors
    /// No zip, or one without these two; a description that cannot be read.
    pub fn unzip(bytes: &[u8]) -> Result<Self, ImportError> {
        let broken = |error: zip::result::ZipError| ImportError::Zip(error.to_string());
        let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(broken)?;
        if zip.len() > FILES_MAX {
            let words = format!("it holds {} files; a map is two", zip.len());
            return Err(ImportError::Zip(words));
        }
        let names = zip.file_names().map(|name| name.map(Cow::into_owned));
        let names: Vec<String> = names.collect::<Result<_, _>>().map_err(broken)?;
        // What file managers add: folders, and files that begin with a dot.
        let is_file = |name: &&String| !base(name).is_empty() && !base(name).starts_with('.');
        let names: Vec<&String> = names.iter().filter(is_file).collect();
        let is_yaml = |name: &str| {
            let (_, end) = name.rsplit_once('.').unwrap_or_default();
            ["yaml", "yml"].iter().any(|known| end.eq_ignore_ascii_case(known))
        };
        let mut yamls = names.iter().filter(|name| is_yaml(name));
        let (Some(yaml), None) = (yamls.next(), yamls.next()) else {
            let words = format!("one file of it should end in .yaml; it holds {}", listed(&names));
            return Err(ImportError::Zip(words));
        };
        let mut file = |name: &str, most: usize| {
            let mut bytes = Vec::new();
            // One byte more than may be tells whether there is more; nothing beyond is unpacked.
            zip.by_name(name)
                .map_err(broken)?
                .take(most as u64 + 1)
                .read_to_end(&mut bytes)
                .map_err(|error| ImportError::Zip(error.to_string()))?;
            Ok::<_, ImportError>(bytes)
        };
        let description = file(yaml, DESCRIPTION_BYTES_MAX)?;
        let (Description { image, .. }, _) = Description::read(&description)?;
        let Some(name) = names.iter().find(|name| base(name) == base(&image)) else {
            return Err(ImportError::NoImage { image, found: listed(&names) });
        };
        let image = file(name, IMAGE_BYTES_MAX)?;
        if image.len() > IMAGE_BYTES_MAX {
            return Err(ImportError::ImageTooLong { max: IMAGE_BYTES_MAX });
        }
        Ok(Self { description, image })
    }

    /// SHA-256 of the files and the trust, lower-case hexadecimal: by this the same import is known.
    pub fn digest(&self, trust: Trust) -> String {
        use std::fmt::Write as _;
        let mut digest = Sha256::new();
        for part in [&self.description[..], &self.image, &trust.get().to_le_bytes()] {
            digest.update((part.len() as u64).to_le_bytes());
            digest.update(part);
        }
        digest.finalize().iter().fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}"); // writing to a String cannot fail
            text
        })
    }

    /// Puts the map on a grid of `resolution_m`.
    ///
    /// # Errors
    /// What cannot be read, or be no map of a building.
    pub fn import(&self, resolution_m: f64, trust: Trust) -> Result<Import, ImportError> {
        let (description, mut warnings) = Description::read(&self.description)?;
        let image = Image::read(&self.image)?;
        let loaded = load(&description, &image);
        warnings.extend(loaded.warnings);
        let cells = loaded.cells;
        let (prior, more) = Prior::on_grid(&cells, &description, resolution_m, trust)?;
        warnings.extend(more);
        let count = |wanted: fn(i8) -> bool| {
            cells.values.iter().filter(|value| wanted(**value)).count() as u64
        };
        let [x, y, yaw] = description.origin;
        let report = ImportReport {
            columns: cells.columns,
            rows: cells.rows,
            resolution_m: description.resolution_m,
            origin_m: [x, y],
            yaw_rad: yaw,
            mode: description.mode.word().to_owned(),
            occupied_thresh: Some(description.occupied_thresh),
            free_thresh: Some(description.free_thresh),
            negate: Some(description.negate),
            trust: trust.get(),
            occupied: count(|value| value > 50),
            free: count(|value| (0..50).contains(&value)),
            unknown: count(|value| value < 0 || value == 50),
            tiles: prior.tiles.len() as u32,
            bounds: bounds(&prior, resolution_m),
            warnings: warnings.iter().map(ToString::to_string).collect(),
            image: description.image,
        };
        Ok(Import { prior, report })
    }
}

/// A file's name without its folders.
fn base(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}

fn listed(names: &[&String]) -> String {
    const NAMES_MAX: usize = 5;
    let mut listed: Vec<String> = names.iter().take(NAMES_MAX).map(|n| format!("{n:?}")).collect();
    if names.len() > NAMES_MAX {
        listed.push(format!("{} more", names.len() - NAMES_MAX));
    }
    if listed.is_empty() { "nothing".to_owned() } else { listed.join(", ") }
}

fn bounds(prior: &Prior, resolution_m: f64) -> Option<Bounds> {
    let side_m = TILE_SIDE as f64 * resolution_m;
    let of = |TileIndex { x, y }: &TileIndex| Bounds {
        min_x_m: f64::from(*x) * side_m,
        min_y_m: f64::from(*y) * side_m,
        max_x_m: (f64::from(*x) + 1.0) * side_m,
        max_y_m: (f64::from(*y) + 1.0) * side_m,
    };
    prior.tiles.keys().map(of).reduce(|a, b| Bounds {
        min_x_m: a.min_x_m.min(b.min_x_m),
        min_y_m: a.min_y_m.min(b.min_y_m),
        max_x_m: a.max_x_m.max(b.max_x_m),
        max_y_m: a.max_y_m.max(b.max_y_m),
    })
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    use super::*;

    const YAML: &[u8] = b"image: maps/floor.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n\
        occupied_thresh: 0.65\nfree_thresh: 0.25\n";
    const PGM: &[u8] = b"P5\n3 1\n255\n\x00\xcd\xfe";

    fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in files {
            zip.start_file(*name, SimpleFileOptions::default()).unwrap();
            zip.write_all(bytes).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    #[test]
    fn the_yaml_and_the_image_that_it_names_are_found_in_whatever_folders() {
        let zip = zipped(&[
            ("__MACOSX/._floor.pgm", b"x"),
            (".DS_Store", b"x"),
            ("a/other.pgm", b"x"),
            ("a/floor.pgm", PGM),
            ("a/Floor.YAML", YAML),
        ]);
        let package = Package::unzip(&zip).unwrap();
        assert_eq!((package.description.as_slice(), package.image.as_slice()), (YAML, PGM));
        let Import { prior, report } = package.import(0.05, Trust::STANDARD).unwrap();
        assert_eq!((report.occupied, report.free, report.unknown, report.tiles), (1, 2, 0, 1));
        assert_eq!((report.columns, report.rows, report.image.as_str()), (3, 1, "maps/floor.pgm"));
        assert_eq!((report.occupied_thresh, report.free_thresh), (Some(0.65), Some(0.25)));
        assert_eq!(report.negate, Some(false));
        assert!(report.warnings[0].contains("grey 205"), "{:?}", report.warnings);
        assert_eq!(report.bounds, bounds(&prior, 0.05));
        assert_eq!(&prior.tiles[&TileIndex { x: 0, y: 0 }].cells()[..4], [200, -25, -25, 0]);
    }

    #[test]
    fn a_zip_that_is_no_map_is_told_why() {
        let (broken, swollen) = (&b"PK\x03\x04 and no more"[..], vec![b' '; IMAGE_BYTES_MAX + 9]);
        let many: Vec<String> = (0..40).map(|n| format!("{n}.pgm")).collect();
        let many: Vec<(&str, &[u8])> = many.iter().map(|name| (name.as_str(), PGM)).collect();
        for (zip, words) in [
            (broken.to_vec(), "zip"),
            (zipped(&[]), "it holds nothing"),
            (zipped(&[("floor.pgm", PGM)]), "it holds \"floor.pgm\""),
            (zipped(&[("a.yaml", YAML), ("b.yaml", YAML)]), "one file of it should end in .yaml"),
            (zipped(&[("a.yaml", YAML), ("b.pgm", PGM)]), "`maps/floor.pgm`"),
            (zipped(&[("a.yaml", b"image: [\n")]), "line 2"),
            (zipped(&many), "it holds 40 files"),
            (zipped(&[("a.yaml", YAML), ("floor.pgm", &swollen)]), "83886080"),
            (zipped(&[("a.yaml", &swollen)]), "the description has 65537 bytes"),
        ] {
            let told = Package::unzip(&zip).unwrap_err().to_string();
            assert!(told.contains(words), "{words}: {told}");
        }
    }
}
