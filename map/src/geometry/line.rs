//! Supporting lines in Hesse form, `x cos(alpha) + y sin(alpha) = rho`.

use std::f64::consts::PI;
use std::marker::PhantomData;

use nalgebra::{Matrix2, Matrix2x3};

use super::{Covariance, Point, Pose, wrap};

/// The unit vector at angle `alpha`: a line's normal n.
pub fn unit_normal(alpha: f64) -> Point {
    let (s, c) = alpha.sin_cos();
    Point::new(c, s)
}

/// The unit vector a quarter turn left of the normal: a line's direction u = dn/d(alpha).
pub fn tangent(alpha: f64) -> Point {
    let (s, c) = alpha.sin_cos();
    Point::new(-s, c)
}

/// An infinite line in frame `F`, in normal form: rho >= 0, alpha in (-pi, pi].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line<F> {
    rho: f64,
    alpha: f64,
    frame: PhantomData<F>,
}

impl<F: Copy> Line<F> {
    /// The line in normal form, and whether rho was negative, that is whether the normal was
    /// turned round (the correlation of rho and alpha then changes its sign, and so does every
    /// coordinate along the line).
    pub fn normal_form(rho: f64, alpha: f64) -> (Self, bool) {
        if rho < 0.0 {
            (Self { rho: -rho, alpha: wrap(alpha + PI), frame: PhantomData }, true)
        } else {
            (Self { rho, alpha: wrap(alpha), frame: PhantomData }, false)
        }
    }

    /// Distance of the line from the frame's origin, not negative.
    pub fn rho(&self) -> f64 {
        self.rho
    }

    /// Angle of the normal, in (-pi, pi].
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// The point of the line at coordinate `t` along u, counted from the foot point of the origin.
    pub fn at(&self, t: f64) -> Point {
        unit_normal(self.alpha) * self.rho + tangent(self.alpha) * t
    }

    /// Coordinate of `p` along the line, from the foot point of the origin.
    pub fn along(&self, p: &Point) -> f64 {
        tangent(self.alpha).dot(p)
    }

    /// Signed distance of `p` from the line, positive on the far side from the origin.
    pub fn across(&self, p: &Point) -> f64 {
        unit_normal(self.alpha).dot(p) - self.rho
    }
}

/// Variance of a line's offset at coordinate `along`: that of `rho - along * alpha`.
pub(crate) fn offset_variance(c: &Covariance<2>, along: f64) -> f64 {
    let c = c.matrix();
    (c[(0, 0)] - 2.0 * along * c[(0, 1)] + along * along * c[(1, 1)]).max(0.0)
}

/// A line with its unit vectors worked out, for many questions about it; the answers are those of
/// [`Line`] to the last bit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Axes {
    pub(crate) normal: Point,
    pub(crate) tangent: Point,
    rho: f64,
    foot: Point,
}

impl Axes {
    pub(crate) fn of<F: Copy>(line: &Line<F>) -> Self {
        let normal = unit_normal(line.alpha);
        Self { normal, tangent: tangent(line.alpha), rho: line.rho, foot: normal * line.rho }
    }

    /// As [`Line::at`].
    pub(crate) fn at(&self, t: f64) -> Point {
        self.foot + self.tangent * t
    }

    /// As [`Line::along`].
    pub(crate) fn along(&self, p: &Point) -> f64 {
        self.tangent.dot(p)
    }

    /// As [`Line::across`].
    pub(crate) fn across(&self, p: &Point) -> f64 {
        self.normal.dot(p) - self.rho
    }
}

/// A line with the covariance of (rho, alpha).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainLine<F> {
    /// The estimate.
    pub line: Line<F>,
    /// Covariance of (rho, alpha).
    pub covariance: Covariance<2>,
}

impl<F: Copy> UncertainLine<F> {
    /// The line (rho, alpha), rho of either sign, brought to normal form together with its
    /// covariance. The flag says whether the normal was turned round.
    pub fn normal_form(rho: f64, alpha: f64, covariance: Covariance<2>) -> (Self, bool) {
        let (line, turned) = Line::normal_form(rho, alpha);
        let covariance = if turned {
            covariance.transformed(&Matrix2::new(-1.0, 0.0, 0.0, 1.0))
        } else {
            covariance
        };
        (Self { line, covariance }, turned)
    }
}

/// A line of frame `B` moved to frame `A`, before normal form, with the Jacobians of its
/// (rho, alpha) with respect to the line and to the pose: rho and alpha of
/// `alpha' = alpha + heading`, `rho' = rho + x cos(alpha') + y sin(alpha')`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovedLine {
    /// Offset along the moved normal; may be negative.
    pub rho: f64,
    /// Angle of the moved normal, wrapped.
    pub alpha: f64,
    /// d(rho', alpha') / d(rho, alpha).
    pub j_line_line: Matrix2<f64>,
    /// d(rho', alpha') / d(x, y, heading).
    pub j_line_pose: Matrix2x3<f64>,
}

impl<A: Copy, B: Copy> Pose<A, B> {
    /// Moves a line of frame `B` to frame `A`.
    pub fn act_on_line(&self, line: &Line<B>) -> MovedLine {
        let alpha = wrap(line.alpha() + self.heading());
        let (n, u) = (unit_normal(alpha), tangent(alpha));
        let tau = u.dot(&self.position());
        MovedLine {
            rho: line.rho() + n.dot(&self.position()),
            alpha,
            j_line_line: Matrix2::new(1.0, tau, 0.0, 1.0),
            j_line_pose: Matrix2x3::new(n.x, n.y, tau, 0.0, 0.0, 1.0),
        }
    }
}
