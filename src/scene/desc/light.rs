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
    /// Shines in one direction from infinitely far away.
    Directional {
        /// The direction in which the light travels; any length but zero.
        direction: Vec3,
        /// Irradiance on a surface that faces it.
        irradiance: Vec3,
    },
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
