//! What the fold of segments and clusters depends on besides the observations.

/// Thresholds of the vector fold. Two replicas must fold with the same ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VectorConfig {
    /// Gate on the squared Mahalanobis distance of two lines: 99 % of chi-square with 2 degrees
    /// of freedom.
    pub gate: f64,
    /// Walls are not perfectly straight: standard deviation added to an offset, metres.
    pub offset_noise: f64,
    /// The same for an angle, radians.
    pub angle_noise: f64,
    /// However uncertain, looks further apart than this are not one wall, metres.
    pub offset_max: f64,
    /// However uncertain, looks turned more than this are not one wall, radians.
    pub angle_max: f64,
    /// Two pieces further apart than this along the wall are not joined, metres.
    pub gap_max: f64,
    /// Scales that make an offset (metres) and an angle (radians) comparable in a trace.
    pub trace_scale: [f64; 2],
    /// Error that all fixes on surveyed landmarks share: standard deviation of a position, metres.
    pub datum_position_sd: f64,
    /// The same for a heading, radians.
    pub datum_heading_sd: f64,
    /// Weight of one wall's error in the pose of a robot that localizes on it: across a corridor two
    /// walls fix it, each by a half.
    pub fed_back: f64,
    /// Cells below this many nats of scanner evidence count as free.
    pub free_below: f64,
    /// A look vouches for a wall up to this many standard deviations before where it saw it end.
    pub end_margin: f64,
    /// A wall ends where less than this share of the looks cover it that do nearby.
    pub thin_share: f64,
    /// How far along the wall nearby is, metres.
    pub thin_reach: f64,
    /// Scanner evidence that one look gives for a free cell, nats (positive).
    pub free_look: f64,
    /// A wall is seen through where more than this share of the looks at it went through it, and
    /// more than one.
    pub through_share: f64,
    /// How probably a look that should see a wall sees it.
    pub detection_probability: f64,
    /// How probably a look sees a wall where none is.
    pub false_alarm_probability: f64,
    /// A piece of wall fades from the map where the log-odds that it is there are not above this,
    /// nats.
    pub existence_min: f64,
    /// A wall is seen through where this much of it in a row lies in free cells only, metres.
    pub seen_through_min: f64,
    /// Shorter pieces are not published, metres.
    pub length_min: f64,
    /// Parts of two walls that are not further apart than this are one wall seen twice, metres.
    pub duplicate_offset: f64,
    /// Opposite faces that are not further apart than this may be those of one wall, metres.
    pub thickness_max: f64,
    /// Two clusters are one if their hulls are not further apart than this, metres, plus three
    /// standard deviations of their places.
    pub cluster_gap: f64,
    /// However uncertain, clusters whose hulls are further apart than this are two, metres.
    pub cluster_gap_max: f64,
    /// Standard deviation of a hit about the wall that it belongs to, metres: a cluster whose hull
    /// the gate allows to be such hits is explained by the wall.
    pub hit_sd: f64,
    /// Two walls whose directions have a smaller sine between them go on as each other; with a
    /// greater one they meet in a corner.
    pub corner_sine_min: f64,
    /// An end may lie this far from the corner that it is joined in, metres, plus three standard
    /// deviations of the distance.
    pub joint_margin: f64,
    /// However uncertain, an end further from a corner than this is not joined in it, metres.
    pub joint_max: f64,
    /// Standard deviation of a wall's end along it that comes from the spacing of beams, metres.
    pub end_sd: f64,
    /// Longer chains are cut where they are joined worst: the most pieces of one.
    pub chain_pieces_max: usize,
}

impl VectorConfig {
    /// The defaults (`docs/NOTATION.md` names their sources).
    pub const STANDARD: Self = Self {
        gate: 9.21,
        offset_noise: 0.005,
        angle_noise: 0.0035,
        offset_max: 0.25,
        angle_max: 0.35,
        gap_max: 0.25,
        trace_scale: [0.05, 0.035],
        datum_position_sd: 0.01,
        datum_heading_sd: 0.001,
        fed_back: 0.5,
        free_below: -0.5,
        end_margin: 2.0,
        thin_share: 0.3,
        thin_reach: 1.0,
        free_look: 0.4,
        through_share: 0.1,
        detection_probability: 0.9,
        false_alarm_probability: 0.05,
        existence_min: 1.5,
        seen_through_min: 0.10,
        length_min: 0.2,
        duplicate_offset: 0.18,
        thickness_max: 0.30,
        cluster_gap: 0.10,
        cluster_gap_max: 0.30,
        hit_sd: 0.03,
        corner_sine_min: 0.2,
        joint_margin: 0.10,
        joint_max: 0.40,
        end_sd: 0.03,
        chain_pieces_max: 256,
    };
}
