//! Tracing of photons: light subpaths whose vertices are stored where camera paths may gather them.

use crate::math::real::Real;
use crate::math::stats::median;
use crate::record;
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::weights::StrategyCounts;
use crate::transport::integrator::iteration::light_batch::LightUnit;
use crate::transport::integrator::iteration::light_paths::UNIT;
use crate::transport::integrator::iteration::photon_map::{Grid, PhotonMap, UnitPoints};
use crate::transport::integrator::iteration::{Iteration, Resources, Shared};
use crate::transport::path_time::OpticalLength;
use crate::transport::ray::Ray;
use glam::Vec3;

/// Greatest number of columns and of rows of the camera rays from which the radius is derived.
const PROBES: u32 = 8;

/// Width of the automatic radius of the first iteration, in pixels, where all light is gathered.
pub const RADIUS_IN_PIXELS: f32 = 3.0;

/// Automatic radius of a scene that no camera ray hits, in radii of the bounding sphere.
const UNSEEN_RADIUS: f32 = 0.003;

record! {
    /// Photons that arrived at surfaces.
    pub struct Photon => PhotonRecord {
        /// Unit direction to the previous vertex of the light subpath.
        wi: Vec3,
        /// Emitted radiance times all cosines and BSDF values over all densities: the flux, times
        /// the number of photons, and over the probability with which the mask of the surface
        /// accepted the photon. Camera paths that gather it were accepted themselves.
        flux: Vec3,
        /// Unit normal of the surface's front side.
        normal: Vec3,
        /// Number of edges from the light.
        edges: Word,
        /// 1 if camera paths could not hit the light, and all events on the way were Dirac events;
        /// else 0.
        unhittable: Real,
        /// Length of all segments: see [`OpticalLength::path`].
        path: Real,
        /// Delays of the previous vertices: see [`OpticalLength::delays`].
        delays: Real,
        /// Index of the last medium: see [`OpticalLength::index`].
        index: Real,
    }
}

impl<R: Real> Photon<R> {
    /// Returns the optical length up to the surface. Its delay is that of the camera path's vertex.
    #[inline(always)]
    pub fn optical(&self) -> OpticalLength<R> {
        OpticalLength {
            path: self.path,
            delays: self.delays,
            delay: R::splat(0.0),
            index: self.index,
        }
    }
}

/// Data that all iterations of a job need to trace photons or light subpaths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSetup {
    /// Number of photons of an iteration.
    pub count: u64,
    /// Number of pixels of the picture.
    pub pixels: u64,
    /// Radius of the first iteration, in scene units.
    first_radius: f32,
    /// Exponent of the radius: see [`ALPHA`](crate::transport::integrator::settings::ALPHA).
    alpha: f32,
}

impl PhotonSetup {
    /// Computes it from the parameters, of which the camera and the scene complete the automatic
    /// ones: the radius is then `radius_in_pixels` times the width of a pixel.
    pub fn new(context: &Context, radius_in_pixels: f32) -> PhotonSetup {
        let settings = context.settings;
        let [width, height] = context.camera.resolution();
        let pixels = u64::from(width) * u64::from(height);
        PhotonSetup {
            count: settings.light_paths(pixels),
            pixels,
            first_radius: settings
                .radius
                .unwrap_or_else(|| automatic_radius(context, radius_in_pixels)),
            alpha: settings.alpha,
        }
    }

    /// Returns the grid of the iteration with an index from 0.
    pub fn grid(&self, index: u64) -> Grid {
        Grid {
            radius: radius(self.first_radius, self.alpha, index),
        }
    }
}

/// Computes the [`PhotonSetup`] of a job.
pub fn prepare(resources: &Resources) -> Box<Shared> {
    let setup = resources.map(1, |context, _| PhotonSetup::new(context, RADIUS_IN_PIXELS));
    Box::new(setup[0])
}

/// Traces the photons of an iteration and builds their map.
pub fn begin(iteration: &Iteration) -> Box<Shared> {
    let setup: &PhotonSetup = iteration.prepared();
    let (count, grid) = (setup.count, setup.grid(iteration.index));
    let units = iteration.map(count.div_ceil(UNIT) as usize, |context, unit| {
        let mut photons = UnitPoints::new(grid);
        let first = unit as u64 * UNIT;
        let (paths, counts) = (first..(first + UNIT).min(count), StrategyCounts::ONE_EACH);
        let paths = iteration.trace_light(context, paths, count, counts);
        for_each_photon(context, &paths, |position, photon| {
            photons.push(position, photon);
        });
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

/// Returns the automatic radius of the first iteration, in scene units: `in_pixels` times the median
/// width of a pixel at the first surfaces behind a grid of pixels.
fn automatic_radius(context: &Context, in_pixels: f32) -> f32 {
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
        let [start, beside]: [Vec3; 2] = camera.ray([x + 1.0, y], [0.5; 2], [0.5; 2]);
        if let Some(hit) = context.trace.closest(&Ray { origin, dir }, f32::INFINITY) {
            // Of two neighbouring rays, either the origins or the directions differ.
            let width = (start - origin).length() + hit.t * (beside - dir).length();
            widths.push(f64::from(width));
        }
    }
    let radius = if widths.is_empty() {
        UNSEEN_RADIUS * context.lights.ball.radius
    } else {
        in_pixels * median(widths) as f32
    };
    radius.max(f32::MIN_POSITIVE.sqrt())
}

/// Passes position and photon of every vertex of light subpaths that may scatter light from more
/// than isolated directions.
fn for_each_photon(
    context: &Context,
    paths: &LightUnit,
    mut visit: impl FnMut(Vec3, PhotonRecord),
) {
    let store = paths.store();
    for (start, vertices) in paths.paths().filter(|(_, vertices)| !vertices.is_empty()) {
        let unhittable = context.lights.id(start.light).place().is_dirac();
        // Whether all events were Dirac events.
        let mut straight = true;
        for index in vertices {
            let event = &store.events()[index];
            if event.scatters() {
                let (state, _) = store.state(index);
                let [photon] = PhotonRecord::store::<f32, 1>(Photon {
                    wi: state.wo,
                    flux: state.throughput * (1.0 / event.acceptance()),
                    normal: state.n_geometric,
                    edges: event.edges(),
                    unhittable: f32::from(u8::from(unhittable && straight)),
                    path: state.path,
                    delays: state.delays,
                    index: state.index,
                });
                visit(state.position, photon);
            }
            straight &= event.is_delta();
        }
    }
}
