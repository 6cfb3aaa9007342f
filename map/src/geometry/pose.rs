//! Poses in the plane, SE(2), with covariance.
//!
//! Jacobians are named `j_out_in`: `j_ac_ab` is the derivative of the product's (x, y, heading)
//! with respect to the first factor's.

use std::marker::PhantomData;

use nalgebra::{Matrix2x3, Matrix3, Vector3};

use super::{Covariance, Point, wrap};

/// Position and heading of frame `B` in frame `A`: `a_from_b`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose<A, B> {
    /// Position, x, in metres.
    pub x: f64,
    /// Position, y, in metres.
    pub y: f64,
    heading: f64,
    frames: PhantomData<(A, B)>,
}

impl<A: Copy, B: Copy> Pose<A, B> {
    /// The pose at (x, y) with the heading wrapped to (-pi, pi].
    pub fn new(x: f64, y: f64, heading: f64) -> Self {
        Self { x, y, heading: wrap(heading), frames: PhantomData }
    }

    /// Both frames coincide.
    pub fn identity() -> Self {
        Self::new(0.0, 0.0, 0.0)
    }

    /// Heading of `B` in `A`, in (-pi, pi].
    pub fn heading(&self) -> f64 {
        self.heading
    }

    /// The origin of `B` in `A`.
    pub fn position(&self) -> Point {
        Point::new(self.x, self.y)
    }

    /// `a_from_c = a_from_b * b_from_c`.
    #[must_use]
    pub fn compose<C: Copy>(&self, b_from_c: &Pose<B, C>) -> Pose<A, C> {
        let p = self.act(&b_from_c.position());
        Pose::new(p.x, p.y, self.heading + b_from_c.heading)
    }

    /// `b_from_a`.
    #[must_use]
    pub fn inverse(&self) -> Pose<B, A> {
        let (s, c) = self.heading.sin_cos();
        Pose::new(-(c * self.x + s * self.y), s * self.x - c * self.y, -self.heading)
    }

    /// The point `p` of frame `B`, seen in `A`.
    pub fn act(&self, p: &Point) -> Point {
        let (s, c) = self.heading.sin_cos();
        Point::new(self.x + c * p.x - s * p.y, self.y + s * p.x + c * p.y)
    }

    /// Derivative of [`Self::act`] with respect to (x, y, heading) of the pose.
    pub fn j_point_pose(&self, p: &Point) -> Matrix2x3<f64> {
        let (s, c) = self.heading.sin_cos();
        Matrix2x3::new(
            1.0,
            0.0,
            -s * p.x - c * p.y, //
            0.0,
            1.0,
            c * p.x - s * p.y,
        )
    }

    /// Derivatives of [`Self::compose`] with respect to both factors, `(j_ac_ab, j_ac_bc)`.
    pub fn j_compose<C: Copy>(&self, b_from_c: &Pose<B, C>) -> (Matrix3<f64>, Matrix3<f64>) {
        let (s, c) = self.heading.sin_cos();
        let j = self.j_point_pose(&b_from_c.position());
        let j_ac_ab = Matrix3::new(
            1.0,
            0.0,
            j[(0, 2)], //
            0.0,
            1.0,
            j[(1, 2)], //
            0.0,
            0.0,
            1.0,
        );
        let j_ac_bc = Matrix3::new(
            c, -s, 0.0, //
            s, c, 0.0, //
            0.0, 0.0, 1.0,
        );
        (j_ac_ab, j_ac_bc)
    }

    /// Derivative of [`Self::inverse`] with respect to the pose.
    pub fn j_inverse(&self) -> Matrix3<f64> {
        let (s, c) = self.heading.sin_cos();
        Matrix3::new(
            -c,
            -s,
            s * self.x - c * self.y, //
            s,
            -c,
            c * self.x + s * self.y, //
            0.0,
            0.0,
            -1.0,
        )
    }

    /// (x, y, heading) as a vector.
    pub fn vector(&self) -> Vector3<f64> {
        Vector3::new(self.x, self.y, self.heading)
    }
}

/// A pose with the covariance of its (x, y, heading), first order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainPose<A, B> {
    /// The estimate.
    pub pose: Pose<A, B>,
    /// Covariance of (x, y, heading), in frame `A`.
    pub covariance: Covariance<3>,
}

impl<A: Copy, B: Copy> UncertainPose<A, B> {
    /// The product of two independent uncertain poses.
    #[must_use]
    pub fn compose<C: Copy>(&self, b_from_c: &UncertainPose<B, C>) -> UncertainPose<A, C> {
        let (j_ac_ab, j_ac_bc) = self.pose.j_compose(&b_from_c.pose);
        UncertainPose {
            pose: self.pose.compose(&b_from_c.pose),
            covariance: self.covariance.transformed(&j_ac_ab)
                + b_from_c.covariance.transformed(&j_ac_bc),
        }
    }

    /// The inverse with its covariance in frame `B`.
    #[must_use]
    pub fn inverse(&self) -> UncertainPose<B, A> {
        UncertainPose {
            pose: self.pose.inverse(),
            covariance: self.covariance.transformed(&self.pose.j_inverse()),
        }
    }
}
