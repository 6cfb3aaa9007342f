//! The map in the formats of other programs. Knows maps and wire types; knows neither HTTP, nor
//! SQL, nor where the bytes go.
//!
//! Equal maps give equal bytes: nothing here writes the time of day, an address or a version. GeoJSON,
//! which mirrors write too, is written by `mapfold_schema::geojson`.
//!
//! * [`building`]: a building of Open-RMF's traffic editor, in.
//! * [`dxf`]: drawings, in and out.
//! * [`geojson`]: flat plans, in.
//! * [`glb`]: models in three dimensions, in and out.
//! * [`incoming`], [`outgoing`]: models of any format on their way in and out.
//! * [`jsonfg`]: a model with its prototypes, whole, out and in.
//! * [`layers`]: which layers a raster has, and where they are found.
//! * [`nav2`]: the raster as `map.yaml` and an image, out and in.
//! * [`png_tiles`]: the raster as a picture pyramid.

mod affine;
pub mod building;
pub mod dxf;
mod few;
pub mod geojson;
pub mod glb;
pub mod incoming;
pub mod jsonfg;
pub mod layers;
pub mod nav2;
pub mod outgoing;
mod paired;
pub mod png_tiles;

#[cfg(test)]
mod sample;
