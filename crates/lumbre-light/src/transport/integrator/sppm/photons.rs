//! Tracing of photons: light subpaths whose vertices are stored where camera paths may gather them.

use super::photon_map::{Grid, Photon, PhotonMap, PhotonRecord, SHARDS, UnitPhotons};
use crate::math::stats::median;
use crate::scene::compile::NONE;
use crate::transport::arrival::{Arrival, HitState};
use crate::transport::bsdf::TransportMode;
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::connect::Connection;
use crate::transport::integrator::bdpt::state::{ShadingState, Subpath, Vertex};
use crate::transport::integrator::bdpt::subpath::{Step, StepSink};
use crate::transport::integrator::camera_path::Path;
use crate::transport::integrator::iteration::{Iteration, Shared};
use crate::transport::light::LightId;
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;
use glam::Vec3;

/// Number of photons that a thread traces at a time.
const UNIT: u64 = 1024;

/// Greatest number of columns and of rows of the camera rays from which the radius is derived.
const PROBES: u32 = 8;

/// Width of the automatic radius of the first iteration, in pixels.
const RADIUS_IN_PIXELS: f32 = 3.0;

/// Automatic radius of a scene that no camera ray hits, in radii of the bounding sphere.
const UNSEEN_RADIUS: f32 = 0.003;

/// Traces the photons of an iteration and builds their map.
pub fn begin(iteration: &Iteration) -> Box<Shared> {
    let setup = iteration.map(1, |context, _| {
        let [width, height] = context.camera.resolution;
        let pixels = (width * height) as u64;
        let count = context.settings.photons.map_or(pixels, u64::from);
        let first = context
            .settings
            .radius
            .unwrap_or_else(|| automatic_radius(context));
        (count, first, context.settings.alpha)
    });
    let (count, first, alpha) = setup[0];
    let grid = Grid {
        radius: radius(first, alpha, iteration.index),
    };
    let units = iteration.map(count.div_ceil(UNIT) as usize, |context, unit| {
        let mut photons: UnitPhotons = vec![Vec::new(); SHARDS];
        let first = unit as u64 * UNIT;
        for path in first..(first + UNIT).min(count) {
            let sampler = iteration.path_sampler(path, count);
            trace(context, sampler, |position, photon| {
                grid.push(&mut photons, position, photon);
            });
        }
        photons
    });
    Box::new(PhotonMap::new(iteration, grid, count, &units))
}

/// Returns the radius of the iteration with an index from 0: the sequence of [Knaus & Zwicker
/// 2011], of which `r_1 i^((alpha - 1) / 2)` is the simple form.
pub fn radius(first: f32, alpha: f32, index: u64) -> f32 {
    let iteration = index as f64 + 1.0;
    first * iteration.powf(0.5 * (f64::from(alpha) - 1.0)) as f32
}

/// Returns the automatic radius of the first iteration, in scene units: [`RADIUS_IN_PIXELS`] times
/// the median width of a pixel at the first surfaces behind a grid of pixels.
fn automatic_radius(context: &Context) -> f32 {
    let camera = context.camera;
    let mut widths = Vec::new();
    let [columns, rows] = camera.resolution.map(|n| (n as u32).min(PROBES));
    for (i, j) in (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))) {
        let at = |k: u32, of: u32, n: f32| ((k as f32 + 0.5) / of as f32 * n).floor();
        let [x, y] = [
            at(i, columns, camera.resolution[0]),
            at(j, rows, camera.resolution[1]),
        ];
        let [origin, dir]: [Vec3; 2] = camera.ray([x, y], [0.5; 2], [0.5; 2]);
        let [_, beside]: [Vec3; 2] = camera.ray([x + 1.0, y], [0.5; 2], [0.5; 2]);
        if let Some(hit) = context.trace.closest(&Ray { origin, dir }, f32::INFINITY) {
            widths.push(f64::from(hit.t * (beside - dir).length()));
        }
    }
    let radius = if widths.is_empty() {
        UNSEEN_RADIUS * context.lights.ball.radius
    } else {
        RADIUS_IN_PIXELS * median(widths) as f32
    };
    radius.max(f32::MIN_POSITIVE.sqrt())
}

/// The vertex that a step found.
#[derive(Default)]
struct Found(Option<Vertex>);

impl StepSink<f32, 1> for Found {
    fn add_vertices(&mut self, lanes: bool, vertex: &Vertex, _: &ShadingState<f32>) {
        self.0 = lanes.then_some(*vertex);
    }

    fn add_light(&mut self, _: &Connection) {}
}

/// Follows a light subpath and passes position and photon of every vertex that may scatter light
/// from more than isolated directions.
fn trace(context: &Context, sampler: Sampler, mut store: impl FnMut(Vec3, PhotonRecord)) {
    let max_edges = context.max_depth.saturating_sub(1);
    let path = Path::unplaced(context, sampler);
    let (start, mut subpath, mut continues) = Subpath::from_light(context, path, 0.0, true);
    let light = context.lights.id(start.light);
    let mut unhittable = matches!(light, LightId::Point(_) | LightId::Directional(_));
    let mut edge = 0;
    while continues && edge < max_edges {
        edge += 1;
        let ray = Ray {
            origin: subpath.path.state.origin,
            dir: subpath.path.state.dir,
        };
        let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else {
            return;
        };
        let hit = HitState::new(context.scene, &ray, &hit, || subpath.path.next_auxiliary());
        let class = &context.classes[context.classes.index_of(context.scene, &hit)];
        let arrival = Arrival::<f32, 1>::new(class, ray, &hit);
        let step = Step {
            mode: TransportMode::Importance,
            edge,
            max_edges,
        };
        let mut found = Found::default();
        let departure = subpath.scatter(context, step, &arrival, true, &mut found);
        // Camera paths draw their own component of a composed material.
        if let Found(Some(vertex)) = found
            && (hit.component != NONE || vertex.bsdf.has_density())
        {
            let [photon] = PhotonRecord::store::<f32, 1>(Photon {
                wi: vertex.state.wo,
                flux: vertex.state.throughput,
                normal: vertex.state.n_geometric,
                edges: edge,
                unhittable: f32::from(u8::from(unhittable)),
                path: vertex.state.path,
                delays: vertex.state.delays,
                index: vertex.state.index,
            });
            store(vertex.state.position, photon);
        }
        continues = departure.continues;
        unhittable &= departure.delta;
    }
}
