//! The environment as a kind of light.

use glam::Vec3;

use super::SelectedLights;
use super::source::{EmittingLanes, LightFacts, LightSource, PowerContext};
use super::table::NO_LIGHT;
use crate::math::real::Vector;
use crate::math::simd::Lanes;
use crate::scene::CompiledScene;
use crate::scene::compile::Environment;

impl LightSource for Environment {
    fn facts(&self, _: &CompiledScene, context: &PowerContext) -> LightFacts {
        LightFacts {
            rows: NO_LIGHT,
            power: context.disk_area * context.environment,
            bounds: None,
        }
    }
}

impl<R: Lanes<N>, const N: usize> EmittingLanes<R, N> for Environment {
    #[inline(always)]
    fn sample(lights: &SelectedLights<R, N>, v: [R; 2], lanes: R::Mask) -> ([R::Vec3; 2], R) {
        match &lights.lights.environment_light {
            None => ([R::Vec3::broadcast(Vec3::ZERO); 2], R::splat(0.0)),
            Some(light) => {
                let (from, pdf_w) = light.sample::<R, N>(v, lanes);
                ([-from, light.radiance::<R, N>(from, lanes)], pdf_w)
            }
        }
    }

    #[inline(always)]
    fn pdf_w(lights: &SelectedLights<R, N>, dir: R::Vec3, lanes: R::Mask) -> R {
        match &lights.lights.environment_light {
            None => R::splat(0.0),
            Some(light) => light.pdf_w::<R, N>(-dir, lanes),
        }
    }

    #[inline(always)]
    fn emitted(lights: &SelectedLights<R, N>, dir: R::Vec3, lanes: R::Mask) -> R::Vec3 {
        match &lights.lights.environment_light {
            None => R::Vec3::broadcast(Vec3::ZERO),
            Some(light) => light.radiance::<R, N>(-dir, lanes),
        }
    }
}
