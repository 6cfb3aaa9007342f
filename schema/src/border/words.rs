//! The closed sets of words (enumerations), between the wire and the map's types, both ways.

use mapfold_map::{gdb, landmarks, level, raster, vector};

use crate::v1;

/// Conversions between two enumerations with the same variants.
macro_rules! same_words {
    ($ours:ty, $theirs:ty, $($word:ident),+) => {
        impl From<$theirs> for $ours {
            fn from(word: $theirs) -> Self {
                match word {
                    $(<$theirs>::$word => Self::$word,)+
                }
            }
        }

        impl From<$ours> for $theirs {
            fn from(word: $ours) -> Self {
                match word {
                    $(<$ours>::$word => Self::$word,)+
                }
            }
        }
    };
}

same_words!(v1::Facing, vector::Facing, Origin, Away);
same_words!(v1::EndKind, vector::EndKind, Corner, Jump, Occluded);
same_words!(v1::ChainKind, vector::ChainKind, Polyline, Obstacle, Room);
same_words!(v1::SensorClass, raster::SensorClass, Scanner, Sonar);
same_words!(v1::ObjectKind, gdb::Kind, Wall, Doorway, Corridor, Machine, Furniture, Other);
same_words!(
    v1::LandmarkKind,
    landmarks::LandmarkKind,
    ConvexCorner,
    ConcaveCorner,
    WallEnd,
    Doorway
);

impl From<level::Provenance> for v1::Provenance {
    fn from(word: level::Provenance) -> Self {
        match word {
            level::Provenance::Datum => Self::Datum,
            level::Provenance::SharedMap => Self::SharedMap,
            level::Provenance::Odometry => Self::Odometry,
        }
    }
}

impl From<v1::Provenance> for level::Provenance {
    fn from(word: v1::Provenance) -> Self {
        match word {
            v1::Provenance::Datum => Self::Datum,
            // A robot's own map becomes part of the shared one, or stays out of it.
            v1::Provenance::SharedMap | v1::Provenance::OwnMap => Self::SharedMap,
            v1::Provenance::Odometry => Self::Odometry,
        }
    }
}
