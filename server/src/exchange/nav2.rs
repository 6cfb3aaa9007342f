//! The raster as Nav2's and ROS's `map_server` reads and writes it: a description in YAML beside a
//! greyscale picture, PGM or PNG.
//!
//! * [`Nav2Map`] writes what a level holds; yaw is 0, as most readers ignore it, and numbers are
//!   written in full.
//! * [`Description`] and [`Image`] read what others wrote, [`load`] makes cells of them by the
//!   rules of `map_server`, and [`Prior`] puts these on the grid of a level; [`Package`] does all of
//!   it with the files of a zip. Whatever comes in is
//!   bounded before room is made for it, and each refusal ([`ImportError`]) says where the fault is
//!   and what to do.

mod cells;
mod description;
mod image;
mod mapping;
mod package;
mod pgm;
mod png_image;
mod prior;
mod refusal;
mod walls;
mod writer;

pub use cells::{Cells, Loaded, UNKNOWN, load};
pub use description::{DESCRIPTION_BYTES_MAX, Description};
pub use image::{Image, ImageFormat, PIXELS_READ_MAX};
pub use package::{IMAGE_BYTES_MAX, Import, Package};
pub use prior::{FREE_NAT, OCCUPIED_NAT, Prior, Trust};
pub use refusal::{ImportError, Warning};
pub use walls::Explained;
pub use writer::{Content, Nav2Error, Nav2Map, PIXELS_MAX, Style};

/// Name of the description, where nobody chose another.
pub const YAML_NAME: &str = "map.yaml";

/// How greys stand for occupancy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Mode {
    /// Occupied, free or unknown.
    #[default]
    Trinary,
    /// As many greys as there are; transparent where nothing is known.
    Scale,
    /// The grey is the occupancy in per cent; beyond 100, nothing is known.
    Raw,
}

impl Mode {
    /// All modes.
    pub const ALL: [Self; 3] = [Self::Trinary, Self::Scale, Self::Raw];

    /// As descriptions name it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Trinary => "trinary",
            Self::Scale => "scale",
            Self::Raw => "raw",
        }
    }
}

#[cfg(test)]
mod changed_packages;
#[cfg(test)]
mod round_trips;
