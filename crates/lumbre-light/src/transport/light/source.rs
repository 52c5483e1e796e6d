//! The interface that the file of each kind of light implements.

use super::SelectedLights;
use super::table::LightRows;
use super::tree::LightBounds;
use crate::math::simd::Lanes;
use crate::scene::CompiledScene;

/// Lights of one kind, as a scene stores them.
pub(super) trait LightSource {
    /// Returns the properties of the light.
    fn facts(&self, scene: &CompiledScene, context: &PowerContext) -> LightFacts;
}

/// Properties of a light, computed once.
pub(super) struct LightFacts {
    /// Parameters of the light, without the number of its kind.
    pub rows: LightRows,
    /// Estimated luminance of the power that the light sends into the scene.
    pub power: f64,
    /// Bounds in a tree, without the power; `None` for an infinitely distant light.
    pub bounds: Option<LightBounds>,
}

/// Quantities that the powers of several lights depend on.
pub(super) struct PowerContext {
    /// Area of the disk through which infinitely distant light enters the scene.
    pub disk_area: f64,
    /// Mean luminance of each texture of the scene.
    pub brightness: Vec<f64>,
    /// Luminance of the environment, integrated over all directions.
    pub environment: f64,
}

/// Lights of one kind without a surface, as lanes have selected them. Only the results in `lanes`
/// are used, at least one of which is set. Directions are those of emission; an emission is
/// radiance, the intensity of a point, or the irradiance of a single direction.
pub(super) trait EmittingLanes<R: Lanes<N>, const N: usize> {
    /// Samples unit directions: returns them, the emission, and the densities per solid angle; 1
    /// for a single direction.
    fn sample(lights: &SelectedLights<R, N>, v: [R; 2], lanes: R::Mask) -> ([R::Vec3; 2], R);

    /// Returns the densities with which [`EmittingLanes::sample`] samples `dir`.
    fn pdf_w(lights: &SelectedLights<R, N>, dir: R::Vec3, lanes: R::Mask) -> R;

    /// Returns the emission in the unit directions `dir`.
    fn emitted(lights: &SelectedLights<R, N>, dir: R::Vec3, lanes: R::Mask) -> R::Vec3;
}
