//! The lights that lanes have selected, with their parameters.

use super::table::{LightId, LightRows, NO_LIGHT, Place, SourceKind};
use super::{LightPoint, Lights};
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::{Lanes, active_lanes, map_array, store_vectors};
use crate::scene::compile::Uv;

/// The light of each lane, with its parameters.
#[derive(Clone, Copy, Debug)]
pub struct SelectedLights<'a, R: Real, const N: usize> {
    pub(super) lights: &'a Lights,
    /// Indices of the lights: see [`Lights::id`].
    pub indices: [u32; N],
    /// Probability with which each light is selected as the start of a path; 0 in lanes without a
    /// light.
    pub probability: R,
    /// Probability with which each light was selected.
    pub chosen: R,
    pub(super) rows: [[R; 8]; 2],
}

impl Lights {
    /// Selects a light that may send light to the point `from`, for each lane of `wanted` from a
    /// random number.
    #[inline(always)]
    pub fn select_for<R: Lanes<N>, const N: usize>(
        &self,
        from: R::Vec3,
        choice: R,
        wanted: R::Mask,
    ) -> SelectedLights<'_, R, N> {
        let Some(tree) = &self.tree else {
            return self.select(choice, wanted);
        };
        let (choices, points) = (choice.store(), store_vectors::<R, N>(from));
        let (mut indices, mut chosen) = ([0; N], [0.0; N]);
        for i in active_lanes(wanted.bits()) {
            (indices[i], chosen[i]) = tree.choose(points[i], choices[i]);
        }
        SelectedLights {
            chosen: R::load(&chosen),
            ..self.with_indices(indices, wanted)
        }
    }

    /// Selects the start of a path for each lane of `wanted` from a random number.
    #[inline(always)]
    pub fn select<R: Lanes<N>, const N: usize>(
        &self,
        choice: R,
        wanted: R::Mask,
    ) -> SelectedLights<'_, R, N> {
        let choices = choice.store();
        let (mut indices, mut probabilities) = ([0; N], [0.0; N]);
        let mut rows = [&NO_LIGHT; N];
        for i in active_lanes(wanted.bits()) {
            if let Some((index, probability)) = self.choose(choices[i]) {
                (indices[i], probabilities[i]) = (index, probability);
                rows[i] = &self.rows[index as usize];
            }
        }
        self.with_rows(indices, R::load(&probabilities), rows)
    }

    /// Loads the lights with these indices in the lanes of `wanted`.
    #[inline(always)]
    pub fn with_indices<R: Lanes<N>, const N: usize>(
        &self,
        indices: [u32; N],
        wanted: R::Mask,
    ) -> SelectedLights<'_, R, N> {
        let mut probabilities = [0.0; N];
        let mut rows = [&NO_LIGHT; N];
        for i in active_lanes(wanted.bits()) {
            if let Some(light) = self.rows.get(indices[i] as usize) {
                rows[i] = light;
                probabilities[i] = self.pdf_index(indices[i]);
            }
        }
        self.with_rows(indices, R::load(&probabilities), rows)
    }

    #[inline(always)]
    fn with_rows<R: Lanes<N>, const N: usize>(
        &self,
        indices: [u32; N],
        probability: R,
        rows: [&LightRows; N],
    ) -> SelectedLights<'_, R, N> {
        SelectedLights {
            lights: self,
            indices,
            probability,
            chosen: probability,
            rows: [
                R::transpose_load(map_array(rows, |r| &r[0])),
                R::transpose_load(map_array(rows, |r| &r[1])),
            ],
        }
    }
}

impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
    /// Returns the probability with which [`Lights::select_for`] selects each light for the point
    /// `from`.
    #[inline(always)]
    pub fn probability_for(&self, from: R::Vec3) -> R {
        let Some(tree) = &self.lights.tree else {
            return self.probability;
        };
        let (exist, points) = (self.probability.store(), store_vectors::<R, N>(from));
        let mut probabilities = [0.0; N];
        for i in 0..N {
            if exist[i] > 0.0 {
                probabilities[i] = tree.probability(points[i], self.indices[i]);
            }
        }
        R::load(&probabilities)
    }

    /// Returns the lanes whose light is of a kind.
    #[inline(always)]
    pub(super) fn are(&self, kind: SourceKind) -> R::Mask {
        self.rows[1][7].eq(R::splat(kind.number()))
    }

    /// Returns the lanes with emissive primitives.
    #[inline(always)]
    pub fn are_emitters(&self) -> R::Mask {
        self.are_at(|place| matches!(place, Place::Surface))
    }

    /// Returns the lanes with point lights.
    #[inline(always)]
    pub fn are_points(&self) -> R::Mask {
        self.are_at(|place| matches!(place, Place::Point))
    }

    /// Returns the lanes with infinitely distant lights.
    #[inline(always)]
    pub fn are_infinite(&self) -> R::Mask {
        self.are_at(Place::is_distant)
    }

    /// Returns the lanes with infinitely distant lights that paths can hit.
    #[inline(always)]
    pub fn are_environments(&self) -> R::Mask {
        self.are_at(|place| matches!(place, Place::Outside))
    }

    /// Returns the lanes with lights that no path can hit by chance.
    #[inline(always)]
    pub fn are_dirac(&self) -> R::Mask {
        self.are_at(Place::is_dirac)
    }

    /// Returns points of the lights without texture coordinates.
    #[inline(always)]
    pub(super) fn point(&self, position: R::Vec3, normal: R::Vec3) -> LightPoint<R, N> {
        LightPoint {
            lights: self.ids(),
            position,
            normal,
            extent: self.extent(),
            uv: Uv::zero(),
        }
    }

    /// Returns the identities of the lights.
    #[inline(always)]
    pub fn ids(&self) -> [LightId; N] {
        map_array(self.indices, |index| self.lights.id(index))
    }

    /// Returns the three numbers of the first row that start at a column: a corner of a triangle,
    /// the centre of a sphere, the position or axis of a point light, or a direction.
    #[inline(always)]
    pub(super) fn vector(&self, column: usize) -> R::Vec3 {
        let row = &self.rows[0];
        R::Vec3::new(row[column], row[column + 1], row[column + 2])
    }

    /// Returns the corners of triangles.
    #[inline(always)]
    pub(super) fn corners(&self) -> [R::Vec3; 3] {
        let [first, second] = &self.rows;
        [
            self.vector(0),
            self.vector(3),
            R::Vec3::new(first[6], first[7], second[0]),
        ]
    }

    /// Returns centre and radius of spheres.
    #[inline(always)]
    pub(super) fn sphere(&self) -> (R::Vec3, R) {
        (self.vector(0), self.rows[0][3])
    }

    /// Returns the extents of the lights' points: see [`EdgeEnd::extent`](crate::transport::vertex::EdgeEnd::extent).
    #[inline(always)]
    pub fn extent(&self) -> R {
        self.rows[1][6]
    }

    /// Returns the area of emissive primitives.
    #[inline(always)]
    pub(super) fn area(&self) -> R {
        self.rows[1][1]
    }

    /// Returns the radiance of emissive primitives without their textures, the intensity of point
    /// lights in the beam, and the irradiance of directional lights.
    #[inline(always)]
    pub(super) fn radiance(&self) -> R::Vec3 {
        R::Vec3::new(self.rows[1][2], self.rows[1][3], self.rows[1][4])
    }

    /// Returns the flags of the lights.
    #[inline(always)]
    pub(super) fn flags(&self) -> R {
        self.rows[1][5]
    }
}
