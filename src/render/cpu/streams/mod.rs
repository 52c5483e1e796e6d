//! Many paths of `nee` or `bpt` together, a step of all of them before the next: as many as a vector has lanes are shaded at a
//! time, between steps sorted by what their surfaces need. That is sixteen with AVX-512, and eight with AVX2 alone.
//!
//! A tile is 256 samples, one after the other as the loop over pixels has them, which begin [in lanes](start). In each step
//! their rays are traced one by one, as ever; those that met a surface which [lanes know](table) are gathered by its class
//! into full vectors and shaded together, all others make the step that [`nee`] or [`bpt`] makes of them. What is light
//! from [sampled points](lamps) waits for its shadow ray until all are shaded.
//!
//! Nothing of this can be seen in a picture. The equations are those of [`crate::transport`], written once for any number
//! of lanes, and every sample's light is added in the order of its path: so the film has the same bits, and a picture's
//! identity does not know who made it. Tests hold both against each other.
//!
//! Films with a time axis want more: paths then have [clocks](clock), and what each of them finds is kept apart until the
//! tile is through. All that is made for them is compiled apart, by the constant `TIMED`.
//!
//! [`nee`]: crate::transport::integrator::nee
//! [`bpt`]: crate::transport::integrator::bpt

mod clock;
mod few;
mod joined;
mod lamps;
mod shade;
mod start;
mod table;

use std::mem::{swap, take};
use std::ops::Range;

use glam::Vec3;

use self::clock::Emitted;
pub use self::few::Few;
use self::table::Table;
use super::accel::Accel;
use super::brought::{Named, Parts};
use super::lanes::Isa;
use super::row::RowSums;
use super::together::{Kind, alone};
use crate::math::lanes::{Row, Width};
use crate::render::Job;
use crate::render::hierarchy::InLanes;
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::transport::contribution::Contribution;
use crate::transport::flight::{Flight, Stamp};
use crate::transport::integrator::nee::{self, Last, State, StepFn, Walk};
use crate::transport::integrator::{Context, bpt};
use crate::transport::ray::{Hit, Ray};
use crate::transport::sampler::{Independent, Sampler};

/// Samples of a tile: their records fill half of a cache of the first level.
const TILE: usize = 256;

/// In the place of a density where the last event was specular.
const SPECULAR: f32 = -1.0;

/// The step of one path by itself; `None` where samples have [two paths](joined).
fn step_of<const TIMED: bool>(kind: Kind) -> Option<StepFn<TIMED>> {
    match kind {
        Kind::Nee => Some(nee::step),
        Kind::Bpt => Some(bpt::step),
        Kind::Bdpt => None,
    }
}

/// What is known of a scene before its rays are.
pub struct Streams {
    kind: Kind,
    table: Table,
    few: Option<Few>,
}

/// A path between two steps: 24 numbers, rows 0 and 1 what [`State`] has, how many random numbers were taken and the optical
/// length so far, row 2 where its ray met what, and the key of its numbers.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct Record {
    rows: [Row; 3],
}

/// Light that waits for its shadow ray: the ray and how far it goes, and what it brings to whom.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    ray: Ray,
    distance: f32,
    value: Vec3,
    path: u32,
}

/// The paths of a tile, and who of them is where.
#[derive(Default)]
struct Tile {
    records: Vec<Record>,
    /// When light was emitted, and the index of the medium in which each path is, where there is a time axis.
    emitted: Emitted,
    index: Vec<f32>,
    values: Vec<Vec3>,
    waiting: Vec<Waiting>,
    /// When what waits arrives, where there is a time axis: its place there.
    places: Vec<f64>,
    /// What makes up the values, where there is a time axis.
    parts: Parts,
    /// The paths that make a step, and those of them that go on.
    active: Vec<u32>,
    next: Vec<u32>,
    /// Of every class the paths that have met it; empty between steps.
    lists: Vec<Vec<u32>>,
    rays: Vec<(Ray, f32)>,
    hits: Vec<Option<Hit>>,
    hidden: Vec<bool>,
}

impl Record {
    fn put(&mut self, state: &State, taken: u32) {
        let State { ray: Ray { origin: o, dir: d }, throughput: t, eta_scale, last } = *state;
        let (from, pdf_w) = last.map_or((Vec3::ZERO, SPECULAR), |last| (last.from, last.pdf_w));
        self.rows[0].0 = [o.x, o.y, o.z, d.x, d.y, d.z, t.x, t.y];
        self.rows[1].0 = [t.z, from.x, from.y, from.z, pdf_w, eta_scale, f32::from_bits(taken), 0.0];
    }

    fn ray(&self) -> Ray {
        ray_in(&self.rows[0])
    }

    fn state(&self) -> State {
        let [.., tx, ty] = self.rows[0].0;
        let [tz, x, y, z, pdf_w, eta_scale, ..] = self.rows[1].0;
        let last = (pdf_w != SPECULAR).then_some(Last { from: Vec3::new(x, y, z), pdf_w });
        State { ray: self.ray(), throughput: Vec3::new(tx, ty, tz), eta_scale, last }
    }

    fn numbers(&self) -> Independent {
        numbers_in(&self.rows[2], self.rows[1].0[6].to_bits())
    }

    fn meet(&mut self, hit: &Hit) {
        put_hit(&mut self.rows[2], hit);
    }
}

/// The ray with which a row begins.
#[inline]
fn ray_in(row: &Row) -> Ray {
    let [x, y, z, u, v, w, ..] = row.0;
    Ray { origin: Vec3::new(x, y, z), dir: Vec3::new(u, v, w) }
}

/// The numbers with whose key a row ends, once so many of them are taken.
#[inline]
fn numbers_in(row: &Row, taken: u32) -> Independent {
    let [.., a, b, c, d] = row.0;
    Independent::resumed([a, b, c, d].map(f32::to_bits), taken)
}

/// Lets a row begin with where a ray met what.
#[inline]
fn put_hit(row: &mut Row, hit: &Hit) {
    row.0[..4].copy_from_slice(&[hit.t, hit.uv[0], hit.uv[1], f32::from_bits(hit.primitive)]);
}

impl Streams {
    /// For a job that wants it and [can be done so](alone), in a scene where neither parts of materials nor overhangs matter, on
    /// a processor with AVX2. `None` for all others, where no surface would gain, and, unless lanes are asked for, where some
    /// surface is unknown to them: that could make one technique wait and not another.
    pub fn of(scene: &CompiledScene, job: &Job, accel: &Accel) -> Option<Streams> {
        let kind = Kind::of(job.integrator)?;
        let wanted = match job.accel.lanes {
            InLanes::Never => false,
            InLanes::Auto => table::knows_all(scene),
            InLanes::Always => true,
        };
        let plain = alone(job.integrator, &job.params, job.sampler, !job.layers.is_empty()).is_none()
            && scene.delays.is_empty()
            && !scene.materials.iter().any(|m| m.shadow_terminator);
        if !wanted || !plain {
            return None;
        }
        let width = match accel.isa() {
            Isa::Portable => None,
            Isa::Avx2 => Width::eight(),
            Isa::Avx512 => Width::sixteen(),
        }?;
        let pairs = kind == Kind::Bdpt;
        let table = Table::of(scene, width, kind != Kind::Bpt, pairs).filter(|table| !pairs || table.is_whole(scene));
        table.map(|table| Streams { kind, table, few: Few::of(accel, width) })
    }

    /// What traces many rays at once, if anything does.
    pub fn few(&self) -> Option<&Few> {
        self.few.as_ref()
    }

    /// Some samples of all pixels of row `y`. What they bring is handed over with their column and index: first all that is
    /// for other pixels, and then what is for their own, in the order of the loops.
    pub fn row(&self, context: &Context, job: &Job, y: u32, samples: Range<u64>, row: &mut RowSums) {
        match context.timing {
            None => self.row_of::<false>(context, job, y, samples, row),
            Some(_) => self.row_of::<true>(context, job, y, samples, row),
        }
    }

    fn row_of<const TIMED: bool>(&self, context: &Context, job: &Job, y: u32, samples: Range<u64>, row: &mut RowSums) {
        let (mut tile, mut pairs) = (Tile::default(), joined::Tile::default());
        let step = step_of::<TIMED>(self.kind);
        let size = if step.is_some() { TILE } else { joined::TILE };
        let mut named: Vec<Named> = Vec::with_capacity(size);
        let mut render = |named: &mut Vec<Named>| {
            match step {
                Some(step) => self.tile::<TIMED>(step, context, job, y, named, &mut tile, row),
                None => joined::tile::<TIMED>(&self.table, context, job, y, named, &mut pairs, row),
            }
            named.clear();
        };
        for x in 0..job.resolution[0] {
            for sample in samples.clone() {
                named.push((x, sample));
                if named.len() == size {
                    render(&mut named);
                }
            }
        }
        render(&mut named);
    }

    #[expect(clippy::too_many_arguments, reason = "a tile is all of them")]
    fn tile<const TIMED: bool>(
        &self,
        step: StepFn<TIMED>,
        context: &Context,
        job: &Job,
        y: u32,
        named: &[Named],
        tile: &mut Tile,
        row: &mut RowSums,
    ) {
        tile.records.clear();
        start::begin(self.table.width, job, context.camera, y, named, &mut tile.records);
        tile.values.clear();
        tile.values.resize(tile.records.len(), Vec3::ZERO);
        if TIMED {
            tile.emitted.begin(context, &tile.records);
            tile.index.clear();
            tile.index.resize(tile.records.len(), context.medium());
            tile.parts.clear();
        }
        self.paths::<TIMED>(step, context, named, y, tile);
        hand_over(context, named, &tile.values, &mut tile.parts, row);
    }

    fn paths<const TIMED: bool>(
        &self,
        step: StepFn<TIMED>,
        context: &Context,
        named: &[Named],
        y: u32,
        tile: &mut Tile,
    ) {
        let (mut active, mut lists) = (take(&mut tile.active), take(&mut tile.lists));
        active.clear();
        active.extend(0..tile.records.len() as u32);
        lists.resize_with(self.table.classes(), Vec::new);
        for depth in 1..=context.max_depth {
            tile.next.clear();
            tile.rays.clear();
            tile.rays.extend(active.iter().map(|path| (tile.records[*path as usize].ray(), f32::INFINITY)));
            tile.hits.clear();
            context.trace.closest_each(&tile.rays, &mut tile.hits);
            for (i, path) in active.iter().copied().enumerate() {
                let hit = tile.hits[i];
                let record = &mut tile.records[path as usize];
                let class = hit.filter(|h| h.instance == NONE && depth < context.max_depth);
                if let Some((class, hit)) = class.and_then(|h| Some((self.table.class(h.primitive)?, h))) {
                    record.meet(&hit);
                    lists[class].push(path);
                } else if brings_nothing(context, depth, hit) {
                    continue;
                } else if by_itself(step, context, [named[path as usize].0, y], depth, hit, path as usize, tile) {
                    tile.next.push(path);
                }
            }
            for (class, list) in lists.iter_mut().enumerate() {
                self.table.shade::<TIMED>(class, context, depth, list, tile);
                list.clear();
            }
            tile.rays.clear();
            // Points that coincide are not hidden from each other.
            tile.rays.extend(tile.waiting.iter().map(|w| (w.ray, w.distance)).filter(|(_, d)| *d > 0.0 || d.is_nan()));
            tile.hidden.clear();
            context.trace.occluded_each(&tile.rays, &mut tile.hidden);
            let mut hidden = tile.hidden.iter();
            for (i, light) in tile.waiting.drain(..).enumerate() {
                if light.distance <= 0.0 || hidden.next() == Some(&false) {
                    let Waiting { path, value, .. } = light;
                    tile.values[path as usize] += value;
                    if TIMED && let Some(timing) = context.timing {
                        tile.parts.push(timing, path, value, tile.places[i]);
                    }
                }
            }
            tile.places.clear();
            swap(&mut active, &mut tile.next);
        }
        (tile.active, tile.lists) = (active, lists);
    }
}

/// A step of one path by itself; whether it goes on.
fn by_itself<const TIMED: bool>(
    step: StepFn<TIMED>,
    context: &Context,
    pixel: [u32; 2],
    depth: u32,
    hit: Option<Hit>,
    path: usize,
    tile: &mut Tile,
) -> bool {
    let record = &mut tile.records[path];
    let mut sampler = Sampler::Independent(record.numbers());
    let flight = if TIMED {
        let [_, x, y, z, .., length] = record.rows[1].0;
        let from = if depth == 1 { record.ray().origin } else { Vec3::new(x, y, z) };
        let stamp = Stamp { path: length, late: tile.emitted.of(path), delay: 0.0, index: tile.index[path] };
        Flight::resumed(context, stamp, from, !clock::counts(context, depth))
    } else {
        Flight::resumed(context, Stamp::default(), Vec3::ZERO, false)
    };
    let mut walk = Walk::resumed(record.state(), flight, &sampler);
    let (value, parts) = (&mut tile.values[path], &mut tile.parts);
    let mut sink = |c: Contribution| {
        *value += c.value;
        if TIMED && let Some(timing) = context.timing {
            parts.push(timing, path as u32, c.value, timing.axis.place(c.length));
        }
    };
    let goes_on = step(&mut walk, context, pixel, &mut sampler, &mut sink, depth, hit);
    if let Sampler::Independent(numbers) = &sampler
        && goes_on
    {
        record.put(&walk.state, numbers.taken());
        if TIMED {
            record.rows[1].0[1..4].copy_from_slice(&walk.flight.from().to_array());
            let stamp = walk.flight.stamp();
            (record.rows[1].0[7], tile.index[path]) = (stamp.path, stamp.index);
        }
    }
    goes_on
}

/// Hands over what samples bring to their own pixels: the values, and, where there is a time axis, what makes them up.
fn hand_over(context: &Context, named: &[Named], values: &[Vec3], parts: &mut Parts, row: &mut RowSums) {
    let parts = context.timing.map(|_| {
        parts.sort(named.len());
        parts
    });
    row.own(named, values, parts);
}

/// Whether a step would end the path without any light: known without making it.
#[inline]
fn brings_nothing(context: &Context, depth: u32, hit: Option<Hit>) -> bool {
    match hit {
        Some(hit) => depth == context.max_depth && context.scene.emitter_of(hit.primitive, hit.instance) == NONE,
        None => context.scene.environment.is_none(),
    }
}
