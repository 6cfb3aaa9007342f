//! What the tests of this module share: contributions, and a server that misbehaves on demand.

pub(super) mod stub;

use mapfold_schema::v1;
use uuid::Uuid;

use super::{Api, ApiOptions, LevelAddress, tls};

/// Frame of the level that all tests are on.
pub(super) const FRAME: Uuid = Uuid::from_bytes([0xf0; 16]);

pub(super) fn level() -> LevelAddress {
    LevelAddress { site: "plant".to_owned(), level: "ground".to_owned() }
}

pub(super) fn api(url: &str, options: ApiOptions) -> Api {
    tls::install_provider();
    Api::new(url, stub::TOKEN, options).unwrap()
}

/// The id of the `n`-th contribution: a UUIDv7, as the border wants it.
pub(super) fn id(n: u64) -> Uuid {
    let mut bytes = [0; 16];
    bytes[..6].copy_from_slice(&(1_700_000_000_000 + n).to_be_bytes()[2..]);
    bytes[6] = 0x70;
    bytes[8] = 0x80;
    bytes[14..].copy_from_slice(&(n as u16).to_be_bytes());
    Uuid::from_bytes(bytes)
}

/// A valid contribution that sees one wall and the floor before it, from a place that depends
/// on `n`.
pub(super) fn contribution(n: u64) -> v1::Contribution {
    let end = || v1::ObservedEnd { kind: v1::EndKind::Jump, sd_m: 0.02 };
    let place = n as f64;
    v1::Contribution {
        id: id(n),
        robot: "robot-1".to_owned(),
        frame: FRAME,
        observed_at: "2026-11-22T04:00:00.000000Z".to_owned(),
        emulated: false,
        pose: v1::PoseEstimate {
            x_m: 3.0 * (place % 7.0),
            y_m: 4.0 * (place / 7.0).floor(),
            heading_rad: 0.1 * (place % 5.0),
            covariance: [[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-5]],
            provenance: v1::Provenance::Datum,
            basis: None,
        },
        segments: vec![v1::ObservedSegment {
            rho_m: 1.5,
            alpha_rad: 0.3 * (place % 3.0),
            covariance: [[1e-4, 0.0], [0.0, 1e-5]],
            from_m: -1.0,
            to_m: 1.25,
            facing: v1::Facing::Origin,
            ends: [end(), end()],
            points: 40,
            seen_through_m: Vec::new(),
        }],
        clusters: Vec::new(),
        evidence: vec![v1::EvidencePatch {
            sensor: v1::SensorClass::Scanner,
            tiles: vec![v1::TilePatch {
                x: (n % 4) as i32,
                y: (n / 4 % 4) as i32,
                runs: vec![(n % 64) as i32, 5, -40, 2000, 3, 85],
            }],
        }],
    }
}

pub(super) fn contributions(range: std::ops::Range<u64>) -> Vec<v1::Contribution> {
    range.map(contribution).collect()
}
