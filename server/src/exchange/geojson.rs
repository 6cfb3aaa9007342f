//! A flat plan as GeoJSON: what is solid is drawn up, in metres of a level or out of longitude and latitude.
//!
//! * `document`: the collection, its features and what they are said to be.
//! * `globe`: longitude and latitude as metres about a place.
//! * `nesting`: which rooms lie in which outlines.
//! * `reading`: features as objects.
//!
//! A document that is JSON-FG is read as that. Written by [`mapfold_schema::geojson`].

mod document;
mod globe;
mod nesting;
mod reading;

pub use reading::{Options, read};

#[cfg(test)]
mod tests;
