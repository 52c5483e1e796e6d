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

    /// Creates a light at a position in double precision, which replaces that of its kind.
    pub fn placed(name: impl Into<String>, kind: LightKind, position: DVec3) -> LightDesc {
        let mut light = LightDesc::new(name, kind);
        light.place(position);
        light
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
        /// Image that it projects.
        image: Option<SpotImage>,
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
        let numbers =
            |vectors: &[Vec3]| -> Vec<f32> { vectors.iter().flat_map(Vec3::to_array).collect() };
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
                ref image,
            } => {
                let mut all: Vec<f32> = numbers(&[position, intensity, direction]);
                all.extend([cone.beam_deg, cone.cutoff_deg]);
                let mut words = vec![cone.edge as u64];
                let Some(image) = image else {
                    return (2, all, words);
                };
                all.extend(numbers(&[image.right, image.up]));
                words.push(u64::from(image.even));
                words.extend(hash_words(&image.texture));
                (4, all, words)
            }
            LightKind::Goniometric {
                position,
                intensity,
                ref map,
                rotation_deg,
            } => {
                let mut all: Vec<f32> = numbers(&[position, intensity]);
                all.push(rotation_deg);
                (3, all, hash_words(map).collect())
            }
        }
    }
}

/// Returns the content hash of a texture in words.
fn hash_words(texture: &TextureDesc) -> impl Iterator<Item = u64> + '_ {
    let (words, _) = texture.content_hash.as_chunks::<8>();
    words.iter().map(|bytes| u64::from_le_bytes(*bytes))
}

/// Image that a spot light projects, upright and not mirrored for a viewer behind the light if
/// `right` is the axis times `up`.
#[derive(Clone, Debug, PartialEq)]
pub struct SpotImage {
    /// Factor on the intensity, at least 0; eight-bit images are decoded from sRGB. Beyond its edges
    /// the light emits nothing.
    pub texture: Arc<TextureDesc>,
    /// Vector from the middle of the image to that of its right edge, at distance 1 from the light
    /// along the axis.
    pub right: Vec3,
    /// Vector from the middle of the image to that of its upper edge.
    pub up: Vec3,
    /// Whether a white image lights a screen across the axis evenly, as that of a projector does:
    /// the intensity is divided by the cube of the cosine to the axis.
    pub even: bool,
}

impl SpotImage {
    /// Full angle of the width of an image in degrees, unless it is given.
    pub const ANGLE: f64 = 40.0;

    /// Creates the image of a projector that looks in a direction, with the full angle of its width
    /// in degrees and the shape of its pixels; `up` is any vector that is not parallel to the
    /// direction.
    pub fn projected(
        texture: Arc<TextureDesc>,
        direction: Vec3,
        up: Vec3,
        angle_deg: f32,
    ) -> SpotImage {
        let axis = direction.normalize_or(Vec3::Z);
        let right = axis
            .cross(up)
            .try_normalize()
            .unwrap_or_else(|| axis.any_orthonormal_vector());
        let half = (angle_deg.to_radians() / 2.0).tan();
        let height = texture.height as f32 / texture.width.max(1) as f32;
        SpotImage {
            right: right * half,
            up: right.cross(axis) * (half * height),
            texture,
            even: true,
        }
    }

    /// Returns the cone of an image around its axis, which no falloff dims.
    pub fn cone(&self) -> ConeDesc {
        let corner = (self.right + self.up)
            .length()
            .max((self.right - self.up).length());
        let cutoff_deg = (corner.atan().to_degrees() * 1.000_01).max(CUTOFF_RANGE[0] as f32);
        ConeDesc {
            beam_deg: cutoff_deg,
            cutoff_deg,
            edge: ConeEdge::Linear,
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
