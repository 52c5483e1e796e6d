//! Lights that are no surfaces: points, directions, and what surrounds the scene.

use std::sync::Arc;

use glam::Vec3;

use super::TextureDesc;

/// A light without a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct LightDesc {
    /// The name by which edits reach it, unique among the lights.
    pub name: String,
    /// What it is.
    pub kind: LightKind,
}

/// What a light without a surface is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines equally in all directions from one point.
    Point {
        /// Where it is, in scene units.
        position: Vec3,
        /// Radiant intensity: the irradiance on a surface that faces it is `intensity / distance^2`.
        intensity: Vec3,
    },
    /// Shines from one point into a cone.
    Spot {
        /// Where it is, in scene units.
        position: Vec3,
        /// The axis of the cone; any length but zero.
        direction: Vec3,
        /// Radiant intensity along the axis.
        intensity: Vec3,
        /// How it falls off from there.
        cone: ConeDesc,
    },
    /// Shines in one direction from infinitely far away.
    Directional {
        /// The direction in which the light travels; any length but zero.
        direction: Vec3,
        /// Irradiance on a surface that faces it.
        irradiance: Vec3,
    },
}

/// The cone of a spot. Angles are from the axis, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeDesc {
    /// Up to here the intensity is that of the axis; at least 0, at most `cutoff_deg`.
    pub beam_deg: f32,
    /// From here on nothing shines; above 0, below 180.
    pub cutoff_deg: f32,
    /// How it falls off between the two.
    pub edge: ConeEdge,
}

/// How the intensity of a spot falls off at the edge of its cone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConeEdge {
    /// In proportion to the angle, as in Mitsuba.
    Linear,
    /// With the square of what is linear in the cosine, as in glTF.
    Smooth,
}

/// The least and greatest cutoff of a spot in degrees.
pub const CUTOFF_RANGE: [f64; 2] = [0.01, 179.0];

impl ConeDesc {
    /// Whether the angles are ones that a cone can have.
    pub fn is_possible(&self) -> bool {
        let [least, greatest] = CUTOFF_RANGE;
        let cutoff = f64::from(self.cutoff_deg);
        (least * 0.999..=greatest).contains(&cutoff) && self.beam_deg >= 0.0 && self.beam_deg <= self.cutoff_deg
    }
}

/// Light that arrives from outside the scene.
///
/// A map is equirectangular with +y up, as in Mitsuba: its top row is +y, its middle column +z, its left and right
/// edge -z, and -x lies right of the middle, so that the map is seen unmirrored from inside. Radiance is the map or
/// the colour times `scale`.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentDesc {
    /// Where its colours come from.
    pub source: EnvironmentSource,
    /// Turns the map about +y, in degrees, counter-clockwise seen from above.
    pub rotation_deg: f32,
    /// Factor on the radiance, not negative.
    pub scale: f32,
}

/// The colours of an environment.
#[derive(Clone, Debug, PartialEq)]
pub enum EnvironmentSource {
    /// The same radiance from everywhere.
    Color(Vec3),
    /// An equirectangular map; eight-bit maps are decoded from sRGB.
    Map(Arc<TextureDesc>),
}
