//! Measures the ray rates of the CPU hierarchy by kind of ray, for `lumbre bench`. Rays are
//! generated before the clock starts, and each rate is the median of its repeats.

use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::accel::{Accel, AccelError};
use lumbre_light::math::{Frame, stats::median, warp};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::camera::{Camera, FilterKind, FilterSpec};
use lumbre_light::transport::light::{LightSelection, Lights};
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::sampler::Sampler;
use lumbre_light::transport::surface::Surface;

/// Rates in one scene, in million rays per second over all threads; `None` if the scene has no such
/// rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayRates {
    /// Time to build the hierarchy in seconds.
    pub build_s: f64,
    /// Number of eight-wide nodes.
    pub nodes: usize,
    /// Size of nodes and primitives as traversal reads them, in bytes.
    pub bytes: usize,
    /// Nearest-hit queries of camera rays, in pixel order.
    pub primary: Option<f64>,
    /// Nearest-hit queries of cosine-distributed rays from the hits of the camera rays.
    pub bounce: Option<f64>,
    /// Occlusion queries between those hits and points on the lights.
    pub shadow: Option<f64>,
}

/// Ray and its maximum distance.
type Query = (Ray, f32);

/// Builds the hierarchy `repeats` times, traces all rays of each kind `repeats` times, and returns
/// medians. Uses `threads` threads; 0 means all.
///
/// # Errors
/// Returns a message if threads cannot be started or the scene's hierarchy cannot be used.
pub fn measure(
    scene: &Arc<CompiledScene>,
    resolution: [u32; 2],
    threads: usize,
    repeats: usize,
) -> Result<RayRates, String> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|i| format!("rays-{i}"))
        .build();
    let pool = pool.map_err(|e| format!("cannot start threads: {e}"))?;
    pool.install(|| measure_in_pool(scene, resolution, repeats))
        .map_err(|e| e.to_string())
}

/// Does the work of [`measure`] on the threads of the current pool.
fn measure_in_pool(
    scene: &Arc<CompiledScene>,
    resolution: [u32; 2],
    repeats: usize,
) -> Result<RayRates, AccelError> {
    let mut builds = Vec::new();
    let mut accel = Accel::build(Arc::clone(scene))?;
    for _ in 0..repeats {
        accel = Accel::build(Arc::clone(scene))?;
        builds.push(accel.build_s);
    }
    let camera = Camera::new(
        &scene.camera,
        resolution,
        FilterSpec {
            kind: FilterKind::Box,
            radius: 0.5,
        },
    );
    let primary: Vec<Query> = (0..resolution[1])
        .flat_map(|y| (0..resolution[0]).map(move |x| [x, y]))
        .map(|pixel| {
            (
                camera.sample_ray(pixel, &mut Sampler::new(1, pixel, 0)),
                f32::INFINITY,
            )
        })
        .collect();
    let hits: Vec<(Query, Hit)> = primary
        .iter()
        .filter_map(|q| Some((*q, accel.closest(&q.0, q.1)?)))
        .collect();
    let (bounce, shadow) = secondary_queries(scene, &hits);
    let rate = |queries: &[Query], occlusion: bool| {
        (!queries.is_empty()).then(|| {
            median((0..repeats).map(|_| {
                let start = Instant::now();
                let hits: usize = queries
                    .par_chunks(1024)
                    .map(|chunk| count_hits(&accel, chunk, occlusion))
                    .sum();
                std::hint::black_box(hits);
                queries.len() as f64 / start.elapsed().as_secs_f64() / 1e6
            }))
        })
    };
    Ok(RayRates {
        build_s: median(builds),
        nodes: accel.node_count(),
        bytes: accel.bytes(),
        primary: rate(&primary, false),
        bounce: rate(&bounce, false),
        shadow: rate(&shadow, true),
    })
}

/// Returns the bounce rays and the shadow rays that start at hits of camera rays.
fn secondary_queries(scene: &CompiledScene, hits: &[(Query, Hit)]) -> (Vec<Query>, Vec<Query>) {
    let lights = Lights::with_select(scene, LightSelection::Area);
    let mut bounce: Vec<Query> = Vec::with_capacity(hits.len());
    let mut shadow: Vec<Query> = Vec::new();
    for (i, ((ray, _), hit)) in hits.iter().enumerate() {
        let mut sampler = Sampler::new(2, [i as u32, 0], 0);
        let surface = Surface::at(scene, ray, hit);
        let normal = if ray.dir.dot(surface.n_geometric) > 0.0 {
            -surface.n_geometric
        } else {
            surface.n_geometric
        };
        let wi = Frame::from_normal(normal).to_world(warp::cosine_hemisphere(sampler.next_2d()));
        bounce.push((surface.spawn(wi), f32::INFINITY));
        if let Some(light) =
            lights.sample_emission(scene, sampler.next_1d(), sampler.next_2d(), [0.5; 2])
        {
            let edge: Vec3 = light.point.position - surface.position;
            let distance = edge.length();
            if let Some(dir) = edge.try_normalize() {
                shadow.push((surface.spawn(dir), distance * (1.0 - 1e-3)));
            }
        }
    }
    (bounce, shadow)
}

/// Returns the number of rays that hit anything, by occlusion queries or nearest-hit queries.
fn count_hits(accel: &Accel, queries: &[Query], occlusion: bool) -> usize {
    let is_hit = |(ray, t_max): &&Query| {
        if occlusion {
            accel.occluded(ray, *t_max)
        } else {
            accel.closest(ray, *t_max).is_some()
        }
    };
    queries.iter().filter(is_hit).count()
}
