//! The map in the formats of other programs. Knows maps and wire types; knows neither HTTP, nor
//! SQL, nor where the bytes go.
//!
//! Equal maps give equal bytes: nothing here writes the time of day, an address or a version. GeoJSON,
//! which mirrors write too, is in `mapfold_schema::geojson`.
//!
//! * [`nav2`]: the raster as `map.yaml` and `map.pgm`.
//! * [`png_tiles`]: the raster as a picture pyramid.

pub mod nav2;
pub mod png_tiles;
