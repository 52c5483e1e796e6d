//! Light that the paths of a tile find: sums, and contributions that wait for their shadow rays.

use std::mem::take;

use glam::Vec3;

use super::wave::TileContext;
use crate::cpu::films::contributions::{PathOrder, TimedContributions};
use crate::cpu::films::first_hits::FirstHits;
use crate::cpu::films::layers::{LayerNeeds, LayerRowFilm};
use crate::cpu::films::row_film::RowFilm;
use lumbre_light::math::real::{Double, Mask, Vector};
use lumbre_light::math::simd::{F32x8, Lanes, active_lanes};
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::camera_path::{PathLight, PathSink, ShadowRay, needs_ray};
use lumbre_light::transport::integrator::iteration::recorded::RecordedPaths;
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::time_settings::Timing;

/// Fields of a [`Contribution`] that only layers need.
#[derive(Clone, Copy, Debug)]
pub(super) struct Details {
    pub unweighted: Vec3,
    pub s: u32,
    pub t: u32,
    /// Optical length of the path.
    pub length: f64,
}

/// Contribution whose shadow ray has not been traced.
#[derive(Clone, Copy, Debug)]
struct Pending {
    ray: Ray,
    distance: f32,
    value: Vec3,
    path: u32,
}

/// Light of all paths of a tile.
#[derive(Default)]
pub(super) struct TileLight {
    /// Radiance of each path so far.
    values: Vec<Vec3>,
    pending: Vec<Pending>,
    /// Positions of the pending contributions on the time axis; empty without one.
    pending_positions: Vec<f64>,
    /// Details of the pending contributions; empty unless layers need them.
    pending_details: Vec<Details>,
    /// Individual contributions that `values` is the sum of; used only with a time axis.
    timed: TimedContributions,
    /// Individual contributions with their paths; empty unless layers need them.
    layered: Vec<(u32, Vec3, Details)>,
    order: PathOrder,
    /// Number of rays of each path; empty unless layers need it.
    rays: Vec<u32>,
    /// Surfaces that the camera rays hit; empty unless layers need them.
    first_hits: FirstHits,
    needs: LayerNeeds,
    shadow_rays: Vec<(Ray, f32)>,
    occluded: Vec<bool>,
}

impl TileLight {
    /// Removes all light, for a tile of that many paths.
    pub fn reset(&mut self, paths: usize, needs: LayerNeeds) {
        self.values.clear();
        self.values.resize(paths, Vec3::ZERO);
        self.timed.clear();
        self.layered.clear();
        self.rays.clear();
        self.rays.resize(if needs.rays { paths } else { 0 }, 0);
        self.first_hits.clear();
        self.needs = needs;
    }

    /// Returns the facts that layers need.
    pub fn needs(&self) -> LayerNeeds {
        self.needs
    }

    /// Finds the surfaces that the camera rays of all paths hit, if a layer needs them.
    pub fn find_surfaces(&mut self, tile: &TileContext, rays: &[(Ray, f32)], hits: &[Option<Hit>]) {
        if self.needs.surfaces {
            self.first_hits.find(tile.width, tile.context, rays, hits);
        }
    }

    /// Counts one ray for each of the given paths, if a layer needs it.
    pub fn count_rays(&mut self, paths: &[u32]) {
        if self.needs.rays {
            paths.iter().for_each(|path| self.rays[*path as usize] += 1);
        }
    }

    /// Adds a contribution; `position` is on the time axis.
    #[inline(always)]
    pub fn add(
        &mut self,
        timing: Option<(&Timing, f64)>,
        path: u32,
        value: Vec3,
        details: Option<Details>,
    ) {
        self.values[path as usize] += value;
        if let Some((timing, position)) = timing {
            self.timed.push(timing, path, value, position);
        }
        if let Some(details) = details {
            self.layered.push((path, value, details));
        }
    }

    /// Traces the shadow rays of all contributions that wait for them, and adds those whose ray is
    /// not blocked.
    pub fn trace_pending(&mut self, context: &Context) {
        let (pending, mut occluded) = (take(&mut self.pending), take(&mut self.occluded));
        self.shadow_rays.clear();
        let rays = pending.iter().map(|light| (light.ray, light.distance));
        self.shadow_rays
            .extend(rays.filter(|(_, distance)| needs_ray(*distance)));
        occluded.clear();
        context
            .trace
            .occluded_each(&self.shadow_rays, &mut occluded);
        let mut results = occluded.iter();
        for (i, light) in pending.iter().enumerate() {
            let traced = needs_ray(light.distance);
            if traced && self.needs.rays {
                self.rays[light.path as usize] += 1;
            }
            if !traced || results.next() == Some(&false) {
                let timing = context
                    .timing
                    .map(|timing| (timing, self.pending_positions[i]));
                let details = self.pending_details.get(i).copied();
                self.add(timing, light.path, light.value, details);
            }
        }
        (self.pending, self.occluded) = (pending, occluded);
        self.pending.clear();
        self.pending_positions.clear();
        self.pending_details.clear();
    }

    /// Adds the samples of a tile to their own pixels, and to those of layers.
    pub fn add_to_film(
        &mut self,
        tile: &TileContext,
        film: &mut RowFilm,
        layers: Option<&mut LayerRowFilm>,
    ) {
        let TileContext { ids, y, .. } = *tile;
        let timed = tile.context.timing.map(|_| {
            self.timed.sort(ids.len());
            &mut self.timed
        });
        film.add_batch(ids, &self.values, timed);
        let Some(layers) = layers else { return };
        let order = self
            .order
            .sort(ids.len(), self.layered.iter().map(|(path, ..)| *path));
        let mut layered = order.iter().map(|i| &self.layered[*i as usize]).peekable();
        for (path, id) in ids.iter().enumerate() {
            let pixel = [id.0, y];
            let mut invalid = 0;
            while let Some((_, value, details)) = layered.next_if(|(p, ..)| *p == path as u32) {
                invalid += layers.add(&contribution(pixel, *value, details));
            }
            let rays = self.rays.get(path).copied().unwrap_or(0);
            let hit = self.first_hits.of_path(path);
            let finite = self.values[path].is_finite();
            invalid += layers.finish_sample(*id, finite, u64::from(rays), hit);
            film.record_invalid(id.0, id.1, invalid);
        }
    }
}

impl TileLight {
    /// Appends the light and the numbers of rays of the paths of a row's pixels to records. They must
    /// have been found as for layers.
    pub fn record(&mut self, tile: &TileContext, records: &mut RecordedPaths) {
        let TileContext { ids, y, .. } = *tile;
        let order = self
            .order
            .sort(ids.len(), self.layered.iter().map(|(path, ..)| *path));
        let mut layered = order.iter().map(|i| &self.layered[*i as usize]).peekable();
        for (path, id) in ids.iter().enumerate() {
            let own = std::iter::from_fn(|| {
                let (_, value, details) = layered.next_if(|(p, ..)| *p == path as u32)?;
                Some(contribution([id.0, y], *value, details))
            });
            records.push_path(own, self.rays[path]);
        }
    }
}

/// Stores shadow rays in rows, which [`stored_ray`] reads.
#[inline(always)]
pub(super) fn store_rays<R: Lanes<N>, const N: usize>(ray: &ShadowRay<R>) -> [F32x8; N] {
    let (o, d, zero) = (ray.origin, ray.dir, R::splat(0.0));
    R::transpose_store([o.x(), o.y(), o.z(), d.x(), d.y(), d.z(), ray.distance, zero])
}

/// Returns the ray and its length from a row of [`store_rays`].
#[inline]
pub(super) fn stored_ray(row: &F32x8) -> (Ray, f32) {
    let [x, y, z, u, v, w, distance, _] = row.0;
    let ray = Ray {
        origin: Vec3::new(x, y, z),
        dir: Vec3::new(u, v, w),
    };
    (ray, distance)
}

/// Returns a contribution as layers need it.
fn contribution(pixel: [u32; 2], value: Vec3, details: &Details) -> Contribution {
    let Details {
        unweighted,
        s,
        t,
        length,
    } = *details;
    Contribution {
        pixel,
        value,
        unweighted,
        s,
        t,
        length,
    }
}

/// Sink of the paths that are in the lanes of a vector.
pub(super) struct LaneSink<'a, const N: usize> {
    pub context: &'a Context<'a>,
    /// Index of each lane's path in the tile.
    pub paths: [usize; N],
    pub light: &'a mut TileLight,
}

/// Light in lanes, stored.
struct Stored<const N: usize> {
    values: [[f32; N]; 3],
    /// Positions on the time axis.
    positions: [f64; N],
    unweighted: [[f32; N]; 3],
    s: u32,
    t: u32,
    /// Optical lengths of the paths.
    lengths: [f64; N],
}

impl<const N: usize> Stored<N> {
    #[inline(always)]
    fn new<R: Lanes<N>>(context: &Context, detailed: bool, light: &PathLight<R>) -> Stored<N> {
        let store = |v: R::Vec3| [v.x().store(), v.y().store(), v.z().store()];
        Stored {
            values: store(light.value()),
            positions: match context.timing {
                None => [0.0; N],
                Some(timing) => {
                    R::store_doubles(timing.axis.bin_positions(light.length, R::Double::splat))
                }
            },
            unweighted: if detailed {
                store(light.unweighted)
            } else {
                [[0.0; N]; 3]
            },
            s: light.s,
            t: light.t,
            lengths: if detailed && context.timing.is_some() {
                R::store_doubles(light.length)
            } else {
                [0.0; N]
            },
        }
    }

    #[inline(always)]
    fn value(&self, lane: usize) -> Vec3 {
        let [x, y, z] = &self.values;
        Vec3::new(x[lane], y[lane], z[lane])
    }

    #[inline(always)]
    fn details(&self, lane: usize) -> Details {
        let [x, y, z] = &self.unweighted;
        Details {
            unweighted: Vec3::new(x[lane], y[lane], z[lane]),
            s: self.s,
            t: self.t,
            length: self.lengths[lane],
        }
    }
}

impl<R: Lanes<N>, const N: usize> PathSink<R> for LaneSink<'_, N> {
    #[inline(always)]
    fn add(&mut self, lanes: R::Mask, light: &PathLight<R>) {
        let detailed = self.light.needs.contributions;
        let stored = Stored::new::<R>(self.context, detailed, light);
        for i in active_lanes(lanes.bits()) {
            let timing = self
                .context
                .timing
                .map(|timing| (timing, stored.positions[i]));
            let details = detailed.then(|| stored.details(i));
            let path = self.paths[i] as u32;
            self.light.add(timing, path, stored.value(i), details);
        }
    }

    #[inline(always)]
    fn add_unless_occluded(&mut self, lanes: R::Mask, ray: &ShadowRay<R>, light: &PathLight<R>) {
        let detailed = self.light.needs.contributions;
        let stored = Stored::new::<R>(self.context, detailed, light);
        let rows = store_rays(ray);
        for i in active_lanes(lanes.bits()) {
            let (ray, distance) = stored_ray(&rows[i]);
            self.light.pending.push(Pending {
                ray,
                distance,
                value: stored.value(i),
                path: self.paths[i] as u32,
            });
            if self.context.timing.is_some() {
                self.light.pending_positions.push(stored.positions[i]);
            }
            if detailed {
                self.light.pending_details.push(stored.details(i));
            }
        }
    }
}
