//! Why a map of another program cannot be taken, and what is doubtful in one that can.

use super::image::PIXELS_READ_MAX;

/// Why a description or an image is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The description is no YAML, or not a flat list of keys.
    #[error("line {line}, column {column} of the description: {fault}")]
    Yaml {
        /// From 1.
        line: usize,
        /// From 1.
        column: usize,
        /// What is wrong there, and what should be.
        fault: String,
    },
    /// A key that every description has is not there.
    #[error("the description has no `{key}`: add {advice}")]
    MissingKey {
        /// The key.
        key: &'static str,
        /// What to add.
        advice: &'static str,
    },
    /// The description is longer than any is.
    #[error("the description has {bytes} bytes; {max} are the most that one has")]
    DescriptionTooLong {
        /// How long it is.
        bytes: usize,
        /// How long it may be.
        max: usize,
    },
    /// No zip, or one that does not hold a map.
    #[error(
        "the zip cannot be taken: {0}; send one of two files, a YAML and the image that it names"
    )]
    Zip(String),
    /// The image that the description names is not there.
    #[error("the description names the image `{image}`, but there is only {found}")]
    NoImage {
        /// The image.
        image: String,
        /// What is there.
        found: String,
    },
    /// The image's file is longer than any that is taken.
    #[error("the image has more than {max} bytes: save it as a binary PGM (P5) or a PNG")]
    ImageTooLong {
        /// How long it may be.
        max: usize,
    },
    /// Neither PGM nor PNG.
    #[error(
        "the image is neither PGM (P2, P5) nor PNG: convert it, for instance with `convert map.bmp map.pgm`"
    )]
    ImageFormat,
    /// The image has no pixels.
    #[error("the image says that it is {columns} by {rows} pixels: there is nothing in it")]
    ImageEmpty {
        /// Pixels across.
        columns: u64,
        /// Pixels down.
        rows: u64,
    },
    /// More pixels than are taken.
    #[error(
        "an image of {columns} by {rows} pixels is larger than the {PIXELS_READ_MAX} pixels that are \
         taken: crop it to the building, or save it with a coarser resolution"
    )]
    ImageTooLarge {
        /// Pixels across.
        columns: u64,
        /// Pixels down.
        rows: u64,
    },
    /// A PGM that cannot be read.
    #[error("byte {offset} of the PGM image: {fault}")]
    Pgm {
        /// From the start of the file.
        offset: usize,
        /// What is wrong there, and what should be.
        fault: String,
    },
    /// A PNG that cannot be read.
    #[error("the PNG image cannot be read: {0}; save it again, or as PGM")]
    Png(String),
    /// The resolutions of image and level are too far apart.
    #[error(
        "pixels of {image_m} m do not fit a grid of {level_m} m: check `resolution`, which is in \
         metres a pixel; from {finest_m} to {coarsest_m} are taken"
    )]
    Resolution {
        /// Of the image.
        image_m: f64,
        /// Of the level.
        level_m: f64,
        /// Least that is taken.
        finest_m: f64,
        /// Most that is taken.
        coarsest_m: f64,
    },
    /// The map would cover more of the level's grid than is taken, or lies off it.
    #[error(
        "the map would lie from ({min_x_m}, {min_y_m}) to ({max_x_m}, {max_y_m}) m of the level, which is \
         more cells than are taken or too far out: check `origin` and `resolution`"
    )]
    Extent {
        /// Left.
        min_x_m: f64,
        /// Below.
        min_y_m: f64,
        /// Right.
        max_x_m: f64,
        /// Above.
        max_y_m: f64,
    },
}

/// What is doubtful in a map that is taken all the same.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Warning {
    /// The grey of unknown cells is read as free space.
    #[error(
        "{cells} cells of grey 205, which map savers write for unknown, are read as free, because \
         `free_thresh` is {free_thresh}: set it to 0.196 if they were meant to be unknown"
    )]
    UnknownReadsFree {
        /// How many.
        cells: u64,
        /// As described.
        free_thresh: f64,
    },
    /// Keys that mean nothing here.
    #[error("`{0}` means nothing to map readers and was passed over")]
    ExtraKey(String),
    /// The image is turned.
    #[error(
        "the image is turned by {0} rad about its lower left corner; most other readers ignore that"
    )]
    Turned(f64),
    /// Pixels and cells do not coincide.
    #[error("pixels of {image_m} m are spread over cells of {level_m} m; obstacles win")]
    Resampled {
        /// Of the image.
        image_m: f64,
        /// Of the level.
        level_m: f64,
    },
    /// Nothing at all is occupied.
    #[error("no cell is occupied: check `negate` and the thresholds")]
    NothingOccupied,
    /// Nothing at all is known.
    #[error("no cell is known: check `mode` and the thresholds")]
    NothingKnown,
}
