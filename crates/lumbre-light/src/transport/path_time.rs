//! Optical lengths of paths, and the choice of parts of composed materials.
//!
//! The time of a path is its optical length: the length of every segment times the index of its
//! medium, plus the delays of the materials. Segments and delays are summed separately.
//!
//! The index follows from the crossings: it is 1 at the start of a subpath and is multiplied by the
//! ratio of indices at every refraction. For camera paths it is the index relative to the medium of
//! the camera. A light path starts with its own index of 1; where both subpaths are connected, the
//! connecting edge has the index of the camera's side, and the segments of the light's side
//! are scaled by the ratio. A light inside glass therefore gives the same length for every
//! strategy.
//!
//! Infinitely distant light has no start. Its wave front starts where it touches the bounding
//! sphere of all surfaces, as light paths do.
//!
//! # Composed materials
//!
//! At every vertex one part is drawn with its weight, and the path uses that part alone: its
//! colour, normal map, roughness and delays. The density of a path with its parts is a product in
//! which the weights of the parts, and the densities of delays, occur once for every vertex,
//! whichever strategy generated it; they also occur in the path's contribution. They cancel in
//! every estimator and in every weight [Veach 1997, 9.2]: only the choice itself has to be made.

use super::integrator::Context;
use super::light::DirectSample;
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::Lanes;

/// The optical length of a path up to a vertex; scalar or vectorised.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OpticalLength<R = f32> {
    /// Optical length of all segments so far.
    pub path: R,
    /// Sum of the delays of all previous vertices.
    pub delays: R,
    /// Delay of this vertex.
    pub delay: R,
    /// Index of the medium of the last segment.
    pub index: R,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> OpticalLength<R> {
    /// Returns the length at which light arrives at this vertex, or starts there.
    #[inline(always)]
    pub fn arrival(&self) -> R::Double {
        self.path.double() + self.delays.double()
    }

    /// Returns the length after this vertex's delay and a segment of `distance` in a medium whose
    /// index has this [ratio](super::bsdf::index_ratio) to that of the last segment.
    #[inline(always)]
    pub fn after_segment(&self, ratio: R, distance: R) -> R::Double {
        self.arrival() + self.delay.double() + (self.index * ratio * distance).double()
    }

    /// Returns the length of a light subpath up to this vertex, delay included, for a path that
    /// leaves it through a medium whose index has this ratio to that of the last segment and is
    /// `index` relative to the camera.
    #[inline(always)]
    pub fn from_light(&self, ratio: R, index: R) -> R::Double {
        let own = self.index * ratio;
        (self.path * (index / own)).double() + self.delays.double() + self.delay.double()
    }

    /// Adds the segment from `from` to `to`.
    #[inline(always)]
    pub fn add_segment(&mut self, from: V, to: V) {
        self.path = self.path + self.index * (from - to).length();
    }

    /// Adds the vertex's delay and crosses the index ratio `eta`.
    #[inline(always)]
    pub fn scatter(&mut self, eta: R) {
        self.delays = self.delays + std::mem::replace(&mut self.delay, R::splat(0.0));
        self.index = self.index * eta;
    }

    /// Returns the length for paths whose vertices at `from` are lit by light sampling, with the
    /// given ratios of indices towards the light. Infinitely distant light starts at its wave front
    /// where that touches the bounding sphere of all surfaces.
    #[inline(always)]
    pub fn direct_arrival<const N: usize>(
        &self,
        context: &Context,
        from: V,
        direct: &DirectSample<R, N>,
        ratio: R,
    ) -> R::Double
    where
        R: Lanes<N>,
    {
        let infinite = direct.is_infinite();
        let mut distance = direct.distance;
        if infinite.any() {
            let front = context.lights.front_distance(from, direct.wi);
            distance = R::select(infinite, front, distance);
        }
        self.after_segment(ratio, distance)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn segments_count_by_the_index_behind_the_interface_and_delays_once() {
        let mut optical = OpticalLength::<f32> {
            index: 1.5,
            ..OpticalLength::default()
        };
        optical.add_segment(Vec3::ZERO, 2.0 * Vec3::X);
        assert_eq!(optical.arrival(), 3.0);
        optical.delay = 0.25;
        // Into a medium of index 3.
        assert_eq!(optical.after_segment(2.0, 4.0), 3.0 + 0.25 + 12.0);
        assert_eq!(optical.after_segment(1.0, 4.0), 3.0 + 0.25 + 6.0);
        // The medium of this vertex has index 4 for the camera, so that earlier segments count more.
        assert_eq!(optical.from_light(2.0, 4.0), 3.0 * 4.0 / 3.0 + 0.25);
        optical.scatter(2.0);
        optical.add_segment(Vec3::ZERO, 4.0 * Vec3::Y);
        assert_eq!((optical.arrival(), optical.delay), (15.25, 0.0));
    }
}
