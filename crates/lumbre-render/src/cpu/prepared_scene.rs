//! A scene with everything that does not depend on a job: its hierarchy, surfaces, lights and
//! threads. Runs of several jobs share it, so that a change of technique, camera or resolution
//! neither builds a hierarchy nor starts threads.

use std::sync::{Arc, Mutex, PoisonError};

use glam::Vec3;

use super::bvh::accel::Accel;
use super::bvh::simd::Isa;
use super::clock::RenderClock;
use crate::RenderError;
use crate::hierarchy::AccelSpec;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::desc::CameraDesc;
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::{Camera, FilterSpec};
use lumbre_light::transport::light::{LightSampling, Lights};
use lumbre_light::transport::ray::{Hit, Ray};

/// Threads that render, and the clock that measures them.
pub(super) struct RenderThreads {
    pub(super) pool: rayon::ThreadPool,
    pub(super) clock: RenderClock,
}

impl RenderThreads {
    /// Starts threads; 0 for one for each core.
    pub(super) fn start(count: usize) -> Result<Arc<RenderThreads>, RenderError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .thread_name(|i| format!("render-{i}"))
            .build()
            .map_err(|e| RenderError::failed("cpu", format!("cannot start render threads: {e}")))?;
        let clock = RenderClock::new(&pool);
        Ok(Arc::new(RenderThreads { pool, clock }))
    }
}

/// A scene with its hierarchy, surfaces, lights and threads.
pub struct PreparedScene {
    pub(super) accel: Arc<Accel>,
    pub(super) threads: Arc<RenderThreads>,
    pub(super) classes: Arc<SurfaceClasses>,
    /// Lights for the selection that was used last.
    lights: Mutex<Option<(LightSampling, Arc<Lights>)>>,
}

impl PreparedScene {
    /// Starts the threads and builds the hierarchy. 0 threads mean one for each core.
    ///
    /// # Errors
    /// Returns an error if threads cannot be started or the scene's hierarchy cannot be used.
    pub fn new(
        scene: Arc<CompiledScene>,
        accel: &AccelSpec,
        threads: usize,
    ) -> Result<PreparedScene, RenderError> {
        PreparedScene::with_isa(scene, accel, threads, Isa::detect())
    }

    /// Prepares a scene for a given instruction set, which must be one of [`Isa::available`].
    ///
    /// # Errors
    /// Returns an error in the cases of [`PreparedScene::new`].
    pub fn with_isa(
        scene: Arc<CompiledScene>,
        accel: &AccelSpec,
        threads: usize,
        isa: Isa,
    ) -> Result<PreparedScene, RenderError> {
        PreparedScene::on_threads(RenderThreads::start(threads)?, scene, accel, isa)
    }

    /// Prepares a scene on threads that may render other scenes, too.
    pub(super) fn on_threads(
        threads: Arc<RenderThreads>,
        scene: Arc<CompiledScene>,
        accel: &AccelSpec,
        isa: Isa,
    ) -> Result<PreparedScene, RenderError> {
        let build = || Accel::build_as(scene, accel, isa);
        let accel = threads.pool.install(build);
        let accel = accel.map_err(|e| RenderError::failed("cpu", e))?;
        Ok(PreparedScene {
            classes: Arc::new(SurfaceClasses::new(&accel.scene)),
            accel: Arc::new(accel),
            threads,
            lights: Mutex::default(),
        })
    }

    /// Returns the scene that hits refer to.
    pub fn scene(&self) -> &Arc<CompiledScene> {
        &self.accel.scene
    }

    /// Returns the lights, of which one is chosen by the given probabilities.
    pub(super) fn lights(&self, sampling: LightSampling) -> Arc<Lights> {
        let mut known = self.lights.lock().unwrap_or_else(PoisonError::into_inner);
        match &*known {
            Some((of, lights)) if *of == sampling => Arc::clone(lights),
            _ => {
                let lights = Arc::new(Lights::with_select(self.scene(), sampling));
                *known = Some((sampling, Arc::clone(&lights)));
                lights
            }
        }
    }

    /// Returns the ray through the centre of a pixel and of the lens, and what it hits first.
    pub fn center_hit(
        &self,
        camera: &CameraDesc,
        resolution: [u32; 2],
        pixel: [u32; 2],
    ) -> (Ray, Option<Hit>) {
        let camera = Camera::new(camera, resolution, FilterSpec::PIXEL);
        let center = [0.5; 2];
        let [origin, dir] = camera.ray::<Vec3>(pixel.map(|n| n as f32), center, center);
        let ray = Ray { origin, dir };
        (ray, self.accel.closest(&ray, f32::INFINITY))
    }
}

#[cfg(test)]
mod tests {
    use lumbre_light::scene::desc::{
        EntityDesc, LightDesc, LightKind, MaterialDesc, SceneDesc, ShapeDesc,
    };
    use lumbre_light::transport::light::{LightId, LightSelection};

    use super::*;

    /// Returns a ball between two point lights, the second of which has three times the power.
    fn two_lights() -> Arc<CompiledScene> {
        let light = |(i, (x, intensity)): (usize, &(f32, f32))| {
            let kind = LightKind::Point {
                position: Vec3::X * *x,
                intensity: Vec3::splat(*intensity),
            };
            LightDesc::new(format!("l{i}"), kind)
        };
        let ball = EntityDesc::new("ball", ShapeDesc::Sphere { radius: 1.0 });
        let desc = SceneDesc {
            resolution: [1, 1],
            max_depth: 1,
            camera: CameraDesc {
                position: Vec3::Z * 9.0,
                target: Vec3::ZERO,
                ..CameraDesc::default()
            },
            materials: vec![MaterialDesc::new("m")].into(),
            entities: vec![ball].into(),
            lights: [(3.0, 1.0), (-3.0, 3.0)]
                .iter()
                .enumerate()
                .map(light)
                .collect(),
            ..SceneDesc::default()
        };
        Arc::new(lumbre_light::scene::compile(&desc).unwrap().0)
    }

    #[test]
    fn every_selection_has_its_own_probabilities_of_lights() {
        let scene = PreparedScene::new(two_lights(), &AccelSpec::default(), 1).unwrap();
        let expected = [
            (LightSelection::Uniform, 0.5),
            (LightSelection::Power, 0.75),
            (LightSelection::Uniform, 0.5),
        ];
        for (selection, probability) in expected {
            for _ in 0..2 {
                let found = scene.lights(selection.into()).pdf_choice(LightId::Point(1));
                assert!((found - probability).abs() < 1e-6, "{selection:?}: {found}");
            }
        }
    }
}
