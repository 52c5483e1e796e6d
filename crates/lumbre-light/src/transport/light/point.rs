//! Point lights: with the same intensity in every direction, or with the intensity of a spot
//! light's cone.

use std::f32::consts::{PI, TAU};

use super::SelectedLights;
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::Lanes;
use crate::math::{Frame, warp};

/// The cones of point lights: [`Cone`](crate::scene::compile::Cone) in lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cones<R: Real> {
    axis: R::Vec3,
    beam: R,
    cutoff: R,
    beam_height: R,
    cutoff_height: R,
    smooth: R::Mask,
    /// Whether the cone contains all directions.
    whole: R::Mask,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Cones<R> {
    /// Returns one minus the cosine of a unit direction with the axis.
    #[inline(always)]
    fn height(&self, dir: V) -> R {
        R::splat(0.5) * (dir - self.axis).length_squared()
    }

    /// Returns the fraction of the intensity in a unit direction, from 0 to 1.
    #[inline(always)]
    pub fn falloff(&self, dir: V) -> R {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        if !(!self.whole).any() {
            return one;
        }
        let height = self.height(dir);
        let t = (self.cutoff_height - height) / (self.cutoff_height - self.beam_height);
        let mut edge = t * t;
        if (!self.smooth).any() {
            let (near, far) = ((dir - self.axis).length(), (dir + self.axis).length());
            let angle = R::splat(2.0) * near.zip_lanes(far, f32::atan2);
            let linear = ((self.cutoff - angle) / (self.cutoff - self.beam)).clamp(0.0, 1.0);
            edge = R::select(self.smooth, edge, linear);
        }
        let outside = R::select(height.ge(self.cutoff_height), zero, edge);
        R::select(self.whole | height.le(self.beam_height), one, outside)
    }

    /// Returns the density per solid angle of a direction of emission: uniform over the whole cone.
    #[inline(always)]
    pub fn pdf_w(&self, dir: V) -> R {
        let one = R::splat(1.0);
        let inside = self.height(dir).le(self.cutoff_height);
        let cone = one / (R::splat(TAU) * self.cutoff_height);
        let everywhere = R::splat(1.0 / (4.0 * PI));
        R::select(
            self.whole,
            everywhere,
            R::select(inside, cone, R::splat(0.0)),
        )
    }

    /// Samples a direction uniform over the cone.
    #[inline(always)]
    pub fn sample(&self, v: [R; 2]) -> V {
        let (zero, one, two) = (R::splat(0.0), R::splat(1.0), R::splat(2.0));
        let sphere = warp::uniform_sphere(v);
        if !(!self.whole).any() {
            return sphere;
        }
        let height = v[0] * self.cutoff_height;
        let r = (height * (two - height)).max(zero).sqrt();
        let angle = R::splat(TAU) * v[1];
        let (sin, cos) = (angle.map_lanes(f32::sin), angle.map_lanes(f32::cos));
        let local = V::new(r * cos, r * sin, one - height);
        let cone = Frame::from_normal(self.axis).to_world(local);
        V::select(self.whole, sphere, cone)
    }
}

impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
    /// Returns the cones of point lights.
    #[inline(always)]
    pub(super) fn cones(&self) -> Cones<R> {
        let [first, second] = &self.rows;
        Cones {
            axis: self.vector(3),
            beam: second[0],
            cutoff: second[1],
            beam_height: first[6],
            cutoff_height: first[7],
            smooth: second[5].gt(R::splat(0.0)),
            whole: first[7].ge(R::splat(2.0)),
        }
    }
}
