//! Levels: one floor of a site each.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

/// A level to be made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewLevel {
    /// Slug: lower-case letters, digits and hyphens.
    pub level: String,
    /// Name for people; the slug if absent.
    #[serde(default)]
    pub name: Option<String>,
    /// Edge of a cell; 0.05 if absent.
    #[serde(default)]
    pub resolution_m: Option<f64>,
    /// Height of the floor; 0 if absent.
    #[serde(default)]
    pub elevation_m: Option<f64>,
    /// How fast the raster yields to change: evidence is summed up for stretches of so many seconds
    /// since 1970, and what the earlier ones come to counts for no more than a few looks against a
    /// later one. 600 to 2592000; a day (86400) if absent. Never changed.
    #[serde(default)]
    pub evidence_slice_s: Option<u32>,
}

/// A level as it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LevelDescription {
    /// Slug of its site.
    pub site: String,
    /// Slug.
    pub level: String,
    /// Name for people.
    pub name: String,
    /// UUID of its frame: x right, y up, metres.
    pub frame: Uuid,
    /// Edge of a cell.
    pub resolution_m: f64,
    /// Cells along a tile's side.
    pub tile_cells: u32,
    /// Height of the floor.
    pub elevation_m: f64,
    /// Length of the stretches of time for which evidence is summed up, seconds.
    pub evidence_slice_s: u32,
    /// Newest revision of the log.
    pub revision: i64,
    /// Revision that the published map has reached.
    pub folded_revision: i64,
    /// What the map covers; absent while it is empty.
    #[serde(default)]
    pub bounds: Option<Bounds>,
    /// How much there is.
    pub counts: Counts,
    /// Name of the published version, if any.
    #[serde(default)]
    pub published: Option<String>,
}

/// A rectangle of the level frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Bounds {
    /// Left edge.
    pub min_x_m: f64,
    /// Lower edge.
    pub min_y_m: f64,
    /// Right edge.
    pub max_x_m: f64,
    /// Upper edge.
    pub max_y_m: f64,
}

impl Bounds {
    /// Reads `min_x,min_y,max_x,max_y` in metres, as queries name a rectangle; `None` for anything
    /// but four finite numbers, the minima not above the maxima.
    pub fn parse(text: &str) -> Option<Self> {
        let numbers: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>().ok()?;
        let [min_x_m, min_y_m, max_x_m, max_y_m] = numbers[..] else { return None };
        let ordered = min_x_m <= max_x_m && min_y_m <= max_y_m;
        let finite = numbers.iter().all(|n| n.is_finite());
        (ordered && finite).then_some(Self { min_x_m, min_y_m, max_x_m, max_y_m })
    }
}

/// How much a level holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
pub struct Counts {
    /// Contributions in the log.
    pub contributions: i64,
    /// Those of them that are in the map: neither held nor reverted.
    #[serde(default)]
    pub in_force: i64,
    /// Published segments.
    pub segments: i64,
    /// Published clusters.
    pub clusters: i64,
    /// Published chains.
    #[serde(default)]
    pub chains: i64,
    /// Published tiles of all layers of evidence.
    pub tiles: i64,
    /// Tiles of the prior, if one was imported.
    #[serde(default)]
    pub prior_tiles: i64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_is_four_finite_numbers_in_order() {
        let bounds = Bounds { min_x_m: -1.0, min_y_m: 2.5, max_x_m: 3.0, max_y_m: 4.0 };
        assert_eq!(Bounds::parse("-1,2.5,3,4"), Some(bounds));
        for bad in ["", "1,2,3", "1,2,3,4,5", "3,0,1,1", "0,0,NaN,1", "0,0,inf,1", "a,b,c,d"] {
            assert_eq!(Bounds::parse(bad), None, "{bad:?}");
        }
    }
}
