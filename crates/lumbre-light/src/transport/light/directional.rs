//! Parallel light from infinitely far away.

use glam::Vec3;

use super::SelectedLights;
use super::source::{EmittingLanes, LightFacts, LightSource, PowerContext};
use super::table::light_rows;
use crate::math::luminance::luminance_of;
use crate::math::real::Vector;
use crate::math::simd::Lanes;
use crate::scene::CompiledScene;
use crate::scene::compile::DirectionalLight;

impl LightSource for DirectionalLight {
    fn facts(&self, _: &CompiledScene, context: &PowerContext) -> LightFacts {
        let [x, y, z] = self.direction.to_array();
        let first = [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0];
        LightFacts {
            rows: light_rows(first, [0.0; 2], self.irradiance, [0.0; 2]),
            power: context.disk_area * luminance_of(self.irradiance),
            bounds: None,
        }
    }
}

impl<R: Lanes<N>, const N: usize> EmittingLanes<R, N> for DirectionalLight {
    #[inline(always)]
    fn sample(lights: &SelectedLights<R, N>, _: [R; 2], _: R::Mask) -> ([R::Vec3; 2], R) {
        ([lights.vector(0), lights.radiance()], R::splat(1.0))
    }

    #[inline(always)]
    fn pdf_w(lights: &SelectedLights<R, N>, dir: R::Vec3, _: R::Mask) -> R {
        R::select(lights.shines_into(dir), R::splat(1.0), R::splat(0.0))
    }

    #[inline(always)]
    fn emitted(lights: &SelectedLights<R, N>, dir: R::Vec3, _: R::Mask) -> R::Vec3 {
        let black = R::Vec3::broadcast(Vec3::ZERO);
        R::Vec3::select(lights.shines_into(dir), lights.radiance(), black)
    }
}

impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
    /// Returns whether `dir` is the only direction of emission of directional lights.
    #[inline(always)]
    fn shines_into(&self, dir: R::Vec3) -> R::Mask {
        dir.dot(self.vector(0)).gt(R::splat(1.0 - 1e-6))
    }
}
