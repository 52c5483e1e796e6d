//! Lights without a surface: point, spot, goniometric and directional lights, and the environment.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::TextureDesc;
use super::place::split;

/// A light without a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct LightDesc {
    /// Name used by edits, unique among the lights.
    pub name: String,
    /// Type and parameters of the light.
    pub kind: LightKind,
    /// Rest that single precision leaves of the position, which counts in scenes far from the origin.
    pub rest: Vec3,
}

impl LightDesc {
    /// Creates a light whose position is whole in single precision, or that has none.
    pub fn new(name: impl Into<String>, kind: LightKind) -> LightDesc {
        LightDesc {
            name: name.into(),
            kind,
            rest: Vec3::ZERO,
        }
    }

    /// Returns the position in double precision; `None` for a directional light.
    pub fn position(&self) -> Option<DVec3> {
        match self.kind {
            LightKind::Point { position, .. }
            | LightKind::Spot { position, .. }
            | LightKind::Goniometric { position, .. } => {
                Some(position.as_dvec3() + self.rest.as_dvec3())
            }
            LightKind::Directional { .. } => None,
        }
    }

    /// Places the light, in double precision; no effect on a directional one.
    pub fn place(&mut self, at: DVec3) {
        match &mut self.kind {
            LightKind::Point { position, .. }
            | LightKind::Spot { position, .. }
            | LightKind::Goniometric { position, .. } => (*position, self.rest) = split(at),
            LightKind::Directional { .. } => {}
        }
    }
}

/// Type and parameters of a light without a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum LightKind {
    /// Emits equally in all directions from one point.
    Point {
        /// Position in scene units.
        position: Vec3,
        /// Radiant intensity: the irradiance on a surface that faces it is `intensity /
        /// distance^2`.
        intensity: Vec3,
    },
    /// Emits from one point into a cone.
    Spot {
        /// Position in scene units.
        position: Vec3,
        /// Axis of the cone; any non-zero length.
        direction: Vec3,
        /// Radiant intensity along the axis.
        intensity: Vec3,
        /// Falloff from the axis.
        cone: ConeDesc,
    },
    /// Emits from one point, with an intensity by direction that an image gives.
    Goniometric {
        /// Position in scene units.
        position: Vec3,
        /// Radiant intensity where the map is 1.
        intensity: Vec3,
        /// Factor on the intensity by direction of emission, at least 0. Equirectangular, with the
        /// orientation of the map of an [`EnvironmentDesc`]; eight-bit maps are decoded from sRGB.
        map: Arc<TextureDesc>,
        /// Rotation of the map about +y, in degrees, counter-clockwise seen from above.
        rotation_deg: f32,
    },
    /// Emits in one direction from infinitely far away.
    Directional {
        /// Direction in which the light travels; any non-zero length.
        direction: Vec3,
        /// Irradiance on a surface that faces it.
        irradiance: Vec3,
    },
}

impl LightKind {
    /// Returns the content for hashes: the tag of the kind, its numbers, and the words of the edge
    /// of a cone or of the hash of a map. A tag is never used for another kind.
    pub(super) fn content(&self) -> (u64, Vec<f32>, Vec<u64>) {
        let numbers = |vectors: &[Vec3]| vectors.iter().flat_map(Vec3::to_array).collect();
        match *self {
            LightKind::Point {
                position,
                intensity,
            } => (0, numbers(&[position, intensity]), Vec::new()),
            LightKind::Directional {
                direction,
                irradiance,
            } => (1, numbers(&[direction, irradiance]), Vec::new()),
            LightKind::Spot {
                position,
                direction,
                intensity,
                cone,
            } => {
                let mut all: Vec<f32> = numbers(&[position, intensity, direction]);
                all.extend([cone.beam_deg, cone.cutoff_deg]);
                (2, all, vec![cone.edge as u64])
            }
            LightKind::Goniometric {
                position,
                intensity,
                ref map,
                rotation_deg,
            } => {
                let mut all: Vec<f32> = numbers(&[position, intensity]);
                all.push(rotation_deg);
                let (words, _) = map.content_hash.as_chunks::<8>();
                let words = words.iter().map(|bytes| u64::from_le_bytes(*bytes));
                (3, all, words.collect())
            }
        }
    }
}

/// Cone of a spot light. Angles are measured from the axis, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeDesc {
    /// Angle up to which the intensity is that of the axis; at least 0, at most `cutoff_deg`.
    pub beam_deg: f32,
    /// Angle from which the intensity is zero; above 0, below 180.
    pub cutoff_deg: f32,
    /// Falloff between the two angles.
    pub edge: ConeEdge,
}

/// Falloff of a spot light's intensity between beam and cutoff angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConeEdge {
    /// Linear in the angle, as in Mitsuba.
    Linear,
    /// Square of a ramp that is linear in the cosine, as in glTF.
    Smooth,
}

/// Least and greatest cutoff angle of a spot light in degrees.
pub const CUTOFF_RANGE: [f64; 2] = [0.01, 179.0];

impl ConeDesc {
    /// Returns whether the angles are in range and in order.
    pub fn is_possible(&self) -> bool {
        let [least, greatest] = CUTOFF_RANGE;
        let cutoff = f64::from(self.cutoff_deg);
        (least * 0.999..=greatest).contains(&cutoff)
            && self.beam_deg >= 0.0
            && self.beam_deg <= self.cutoff_deg
    }
}

/// Light that arrives from outside the scene.
///
/// A map is equirectangular with +y up, as in Mitsuba: its top row is +y, its middle column +z, its
/// left and right edge -z, and -x lies right of the middle, so that it appears unmirrored from
/// inside. Radiance is the map or the colour times `scale`.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentDesc {
    /// Source of the radiance.
    pub source: EnvironmentSource,
    /// Rotation of the map about +y, in degrees, counter-clockwise seen from above.
    pub rotation_deg: f32,
    /// Factor on the radiance, at least 0.
    pub scale: f32,
    /// Distribution with which directions towards a map are sampled.
    pub sampling: EnvironmentSampling,
}

impl EnvironmentDesc {
    /// Creates an environment that is neither turned nor scaled.
    pub fn new(source: EnvironmentSource) -> EnvironmentDesc {
        EnvironmentDesc {
            source,
            rotation_deg: 0.0,
            scale: 1.0,
            sampling: EnvironmentSampling::default(),
        }
    }
}

crate::named! {
    /// Distribution with which directions towards an environment map are sampled.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum EnvironmentSampling {
        /// In proportion to the luminance of the map.
        #[default]
        Luminance = "luminance",
        /// The same density in every direction.
        Uniform = "uniform",
    }
}

/// Source of an environment's radiance.
#[derive(Clone, Debug, PartialEq)]
pub enum EnvironmentSource {
    /// The same radiance from every direction.
    Color(Vec3),
    /// An equirectangular map; eight-bit maps are decoded from sRGB.
    Map(Arc<TextureDesc>),
}
