//! Light sources, and the choice among them.
//!
//! [`Lights::sample_direct`] samples light that arrives at a point, [`Lights::sample_emission`]
//! starts a path at a light, and the densities of both serve paths that found light by other means.
//! Radiance itself is [`Surface::emitted`](super::surface::Surface::emitted) for surfaces and
//! [`Lights::environment`] for rays that leave the scene.
//!
//! Light that arrives at a point may be chosen by a [tree](LightTree), whose probabilities depend on
//! the point; starts of paths are chosen by the same table everywhere.
//!
//! A density includes the probability of choosing the light, except where a name contains `one`:
//! those serve integrators that sample every light in turn ([`Lights::indices`]).
//!
//! | light | [`Lights::sample_direct`] | [`Lights::sample_emission`] |
//! |---|---|---|
//! | triangle | uniform over its area | uniform over its area, cosine about its normal |
//! | sphere | uniform over the subtended cone; none from inside | same as for a triangle |
//! | point | certain | `pdf_a`: probability of the choice; `pdf_w`: uniform over all directions, |
//! | | | 1 / (4 pi), also with a map, or uniform over the cone of a spot |
//! | direction | certain | uniform over a disk that covers the scene; `pdf_w` is 1 |
//! | environment | its brightness times solid angle | the same, then uniform over a disk |
//!
//! Disks are perpendicular to the direction of emission.
//!
//! Throughput at the start of a light path is `radiance * cos / (pdf_a * pdf_w)` for every kind.
//!
//! # Densities of a path's last edge
//!
//! How the strategies of bidirectional methods find the last edge of a path, from the surface point
//! x to the light [Veach 1997, 8.2 and 10.3]: `w` is the unit direction from x to the light, `c`
//! the probability of choosing it ([`Lights::pdf_choice`]), `p(w)` the density with which the
//! surface samples `w`, R the radius of the bounding sphere of all surfaces
//! ([`Lights::pdf_emission_at`] has the disk's density). In a path that ends at an infinitely
//! distant light, the direction takes the place of the last vertex, and its density stays per solid
//! angle: the disk is only a way of sampling x.
//!
//! - Surface, at y. Hit (s = 0): p(w) cos_y / d^2 per area of y. Sampled from x (s = 1): c times
//!   [`Lights::pdf_direct_one_w`] cos_y / d^2 per area of y. Start of a light path (s >= 2), then x:
//!   c / area per area of y; then cos_y / pi per solid angle.
//! - Environment. Hit: p(w) per solid angle. Sampled: c p_env(w) per solid angle. Start: c p_env(w)
//!   per solid angle; then cos_x / (pi R^2) per area of x.
//! - Direction. Hit: never. Sampled: c, a Dirac. Start: c, a Dirac; then cos_x / (pi R^2) per area
//!   of x.
//! - Point. Hit: never. Sampled: c, a Dirac. Start: c, a Dirac; then 1 / (4 pi), or uniform over
//!   the cone, per solid angle.

mod area;
mod bounds;
mod direct;
mod directional;
mod emission;
mod environment;
mod environment_source;
mod kinds;
mod point;
mod select;
mod selected;
mod source;
mod sphere;
mod table;
mod tree;

use std::ops::Range;

use glam::Vec3;

use self::bounds::BoundingSphere;
use self::environment::EnvironmentLight;
use self::table::{LISTS, LightRows};
use crate::math::distribution::AliasTable;
use crate::math::real::{Real, Vector};
use crate::scene::compile::Uv;
use crate::transport::vertex::EdgeEnd;

pub use direct::DirectSample;
pub use emission::{EmissionPdf, EmissionSample};
pub use select::{COMPENSATE, FIELD as SELECT_FIELD, LightSampling, LightSelection};
pub use selected::SelectedLights;
pub use table::{LightId, Place};
pub use tree::LightTree;

/// All light sources of a scene, with indices: emissive primitives first, then points, directions,
/// and the environment.
#[derive(Clone, Debug)]
pub struct Lights {
    /// Distribution over all indices; `None` if nothing emits.
    pub choice: Option<AliasTable>,
    /// Tree that chooses lights for points instead; `None` if the distribution does.
    pub tree: Option<LightTree>,
    /// Parameters of all lights.
    rows: Vec<LightRows>,
    /// Index of the first light of a kind: points, directions, environment.
    pub first: [u32; LISTS],
    /// Environment light with its distribution, if the scene has one.
    pub environment_light: Option<EnvironmentLight>,
    /// Map of each point light; `None` for one without a map.
    point_maps: Vec<Option<point::PointMap>>,
    /// Bounding sphere of the scene.
    pub ball: BoundingSphere,
    total_area: f64,
}

/// A point of the light of each lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint<R: Real = f32, const N: usize = 1> {
    /// Identities of the lights.
    pub lights: [LightId; N],
    /// Position in world space; for infinitely distant lights, a point outside the scene's bounding
    /// sphere.
    pub position: R::Vec3,
    /// Unit normal on the emitting side; for lights without a surface, the direction of emission.
    pub normal: R::Vec3,
    /// Greatest absolute coordinate of the primitive: see [`EdgeEnd::extent`].
    pub extent: R,
    /// Texture coordinates before tiling; zero for lights without a texture.
    pub uv: Uv<R>,
}

impl<R: Real, const N: usize> LightPoint<R, N> {
    /// Returns `yes` where the mask is set, else `no`, with the lights, the extent and the texture
    /// coordinates of `no`.
    #[inline(always)]
    fn select(mask: R::Mask, yes: Self, no: Self) -> Self {
        LightPoint {
            position: R::Vec3::select(mask, yes.position, no.position),
            normal: R::Vec3::select(mask, yes.normal, no.normal),
            ..no
        }
    }

    /// Returns the point as an end of edges.
    #[inline(always)]
    pub fn end(&self) -> EdgeEnd<R> {
        EdgeEnd {
            position: self.position,
            normal: self.normal,
            extent: self.extent,
        }
    }
}

impl LightPoint {
    /// Returns the identity of the light.
    #[inline]
    pub fn light(&self) -> LightId {
        self.lights[0]
    }
}

impl Lights {
    /// Returns the number of lights.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// Returns the indices of all lights, for [`Lights::sample_direct_from`].
    pub fn indices(&self) -> Range<u32> {
        0..self.rows.len() as u32
    }

    /// Returns the identity of the light with an index below [`Lights::count`].
    #[inline]
    pub fn id(&self, index: u32) -> LightId {
        LightId::new(self.first, index)
    }

    /// Returns the index of a light, also of an environment that the scene does not have.
    #[inline]
    pub fn index(&self, light: LightId) -> u32 {
        light.index(self.first)
    }

    /// Returns the total area of emissive surfaces in square scene units.
    pub fn total_area(&self) -> f64 {
        self.total_area
    }

    /// Returns the probability of choosing a light as the start of a path; zero for one that the
    /// scene does not have.
    #[inline]
    pub fn pdf_choice(&self, light: LightId) -> f32 {
        self.pdf_index(self.index(light))
    }

    /// Returns the probability of choosing the light with this index; zero for one that the scene
    /// does not have.
    #[inline]
    fn pdf_index(&self, index: u32) -> f32 {
        let index = index as usize;
        match &self.choice {
            Some(choice) if index < self.rows.len() => choice.pmf(index),
            _ => 0.0,
        }
    }

    /// Returns the probability of choosing a light for the point `from`; zero for one that the scene
    /// does not have.
    #[inline]
    pub fn pdf_direct_choice(&self, light: LightId, from: Vec3) -> f32 {
        let index = self.index(light);
        match &self.tree {
            None => self.pdf_index(index),
            Some(tree) => tree.probability(from, index),
        }
    }

    /// Returns the distance between `from` and the wave front of an infinitely distant light in the
    /// unit direction `wi` at the moment when the front touches the bounding sphere of all
    /// surfaces; negative for points beyond it. Scalar or vectorised.
    #[inline(always)]
    pub fn front_distance<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(&self, from: V, wi: V) -> R {
        R::splat(self.ball.radius) - (from - V::broadcast(self.ball.center)).dot(wi)
    }

    /// Chooses a light: returns its index and its probability, or `None` if nothing emits.
    #[inline]
    pub fn choose(&self, choice: f32) -> Option<(u32, f32)> {
        let (index, probability) = self.choice.as_ref()?.sample(choice);
        Some((index as u32, probability))
    }
}
