//! The map in the formats of other programs. Knows maps and wire types; knows neither HTTP, nor
//! SQL, nor where the bytes go.
//!
//! Equal maps give equal bytes: nothing here writes the time of day, an address or a version.
//!
//! * [`geojson`]: segments and clusters as a `FeatureCollection` in level metres.
//! * [`nav2`]: the raster as `map.yaml` and `map.pgm`.
//! * [`png_tiles`]: the raster as a picture pyramid.

pub mod geojson;
pub mod nav2;
pub mod png_tiles;
