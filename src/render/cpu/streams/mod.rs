//! Many paths of `nee` or `bpt` together, a step of all of them before the next: eight at a time are shaded in the lanes
//! of one vector, between steps sorted by what their surfaces need.
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
//! [`nee`]: crate::transport::integrator::nee
//! [`bpt`]: crate::transport::integrator::bpt

mod few;
mod joined;
mod lamps;
mod shade;
mod start;
mod table;

use std::ops::Range;

use glam::Vec3;

pub use self::few::Few;
use self::table::Table;
use super::accel::Accel;
use super::lanes::Isa;
use super::together::{self, alone};
use crate::math::lanes::{LANES, Reals, Row, transposed};
use crate::render::Job;
use crate::render::hierarchy::InLanes;
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::transport::contribution::Contribution;
use crate::transport::integrator::nee::{Last, State, StepFn};
use crate::transport::integrator::{Context, bpt};
use crate::transport::ray::{Hit, Ray};
use crate::transport::sampler::{Independent, Sampler};

/// Samples of a tile: their records fill half of a cache of the first level.
const TILE: usize = 256;

/// In the place of a density where the last event was specular.
const SPECULAR: f32 = -1.0;

/// What paths do that can go together.
struct Kind {
    /// Whether vertices are joined to lights.
    joined: bool,
    /// The step of one path by itself; `None` where samples have [two paths](joined).
    step: Option<StepFn>,
}

/// The kinds of [`together::INTEGRATORS`].
const KINDS: [Kind; together::INTEGRATORS.len()] = [
    Kind { joined: true, step: Some(State::step) },
    Kind { joined: false, step: Some(bpt::step) },
    Kind { joined: true, step: None },
];

/// The column and the index of a sample.
type Named = (u32, u64);

/// What is known of a scene before its rays are.
pub struct Streams {
    step: Option<StepFn>,
    table: Table,
    few: Option<Few>,
}

/// A path between two steps: 32 numbers, rows 0 and 1 what [`State`] has and how many random numbers were taken, row 2
/// where its ray met what, and the key of its numbers.
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
    values: Vec<Vec3>,
    waiting: Vec<Waiting>,
    next: Vec<u32>,
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

/// So many of a group as there are lanes. Lanes that have none do again what the first has, for nothing.
#[inline(always)]
fn filled<T: Copy>(group: &[T]) -> [T; LANES] {
    std::array::from_fn(|i| group[if i < group.len() { i } else { 0 }])
}

impl Streams {
    /// For a job that wants it and [can be done so](alone), in a scene where neither parts of materials nor overhangs matter, on
    /// a processor with AVX2. `None` for all others, where no surface would gain, and, unless lanes are asked for, where some
    /// surface is unknown to them: that could make one technique wait and not another.
    pub fn of(scene: &CompiledScene, job: &Job, accel: &Accel) -> Option<Streams> {
        let kind = &KINDS[together::INTEGRATORS.iter().position(|name| *name == job.integrator.name)?];
        let wanted = match job.accel.lanes {
            InLanes::Never => false,
            InLanes::Auto => table::knows_all(scene),
            InLanes::Always => true,
        };
        let (layered, timed) = (!job.layers.is_empty(), job.timing.is_some());
        let plain = alone(job.integrator, &job.params, job.sampler, layered, timed).is_none()
            && scene.delays.is_empty()
            && !scene.materials.iter().any(|m| m.shadow_terminator);
        if !wanted || !plain || accel.isa() != Isa::Avx2 {
            return None;
        }
        let pairs = kind.step.is_none();
        let table = Table::of(scene, kind.joined, pairs).filter(|table| !pairs || table.is_whole(scene));
        table.map(|table| Streams { step: kind.step, table, few: Few::of(scene, accel) })
    }

    /// What traces many rays at once, if anything does.
    pub fn few(&self) -> Option<&Few> {
        self.few.as_ref()
    }

    /// Some samples of all pixels of row `y`. What they bring is handed over with their column and index: first all that is
    /// for other pixels, which are named, and then what is for their own, in the order of the loops.
    pub fn row(
        &self,
        context: &Context,
        job: &Job,
        y: u32,
        samples: Range<u64>,
        mut done: impl FnMut(u32, u64, Option<[u32; 2]>, Vec3),
    ) {
        let (mut tile, mut pairs) = (Tile::default(), joined::Tile::default());
        let size = if self.step.is_some() { TILE } else { joined::TILE };
        let mut named: Vec<Named> = Vec::with_capacity(size);
        let mut render = |named: &mut Vec<Named>| {
            match self.step {
                Some(step) => self.tile(step, context, job, y, named, &mut tile, &mut done),
                None => joined::tile(&self.table, context, job, y, named, &mut pairs, &mut done),
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
    fn tile(
        &self,
        step: StepFn,
        context: &Context,
        job: &Job,
        y: u32,
        named: &[Named],
        tile: &mut Tile,
        done: &mut impl FnMut(u32, u64, Option<[u32; 2]>, Vec3),
    ) {
        tile.records.clear();
        start::begin(job, context.camera, y, named, &mut tile.records);
        tile.values.clear();
        tile.values.resize(tile.records.len(), Vec3::ZERO);
        self.paths(step, context, named, y, tile);
        for ((x, sample), value) in named.iter().zip(&tile.values) {
            done(*x, *sample, None, *value);
        }
    }

    fn paths(&self, step: StepFn, context: &Context, named: &[Named], y: u32, tile: &mut Tile) {
        let mut active: Vec<u32> = (0..tile.records.len() as u32).collect();
        let mut lists: Vec<Vec<u32>> = vec![Vec::new(); self.table.classes()];
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
                self.table.shade(class, context, depth, list, tile);
                list.clear();
            }
            tile.rays.clear();
            // Points that coincide are not hidden from each other.
            tile.rays.extend(tile.waiting.iter().map(|w| (w.ray, w.distance)).filter(|(_, d)| *d > 0.0 || d.is_nan()));
            tile.hidden.clear();
            context.trace.occluded_each(&tile.rays, &mut tile.hidden);
            let mut hidden = tile.hidden.iter();
            for light in tile.waiting.drain(..) {
                if light.distance <= 0.0 || hidden.next() == Some(&false) {
                    tile.values[light.path as usize] += light.value;
                }
            }
            std::mem::swap(&mut active, &mut tile.next);
        }
    }
}

/// A step of one path by itself; whether it goes on.
fn by_itself(
    step: StepFn,
    context: &Context,
    pixel: [u32; 2],
    depth: u32,
    hit: Option<Hit>,
    path: usize,
    tile: &mut Tile,
) -> bool {
    let record = &mut tile.records[path];
    let mut state = record.state();
    let mut sampler = Sampler::Independent(record.numbers());
    let value = &mut tile.values[path];
    let mut sink = |c: Contribution| *value += c.value;
    let goes_on = step(&mut state, context, pixel, &mut sampler, &mut sink, depth, hit);
    if let Sampler::Independent(numbers) = &sampler
        && goes_on
    {
        record.put(&state, numbers.taken());
    }
    goes_on
}

/// Whether a step would end the path without any light: known without making it.
#[inline]
fn brings_nothing(context: &Context, depth: u32, hit: Option<Hit>) -> bool {
    match hit {
        Some(hit) => depth == context.max_depth && context.scene.emitter_of(hit.primitive, hit.instance) == NONE,
        None => context.scene.environment.is_none(),
    }
}

/// What a function makes of each lane. Unlike `map` of arrays it is always inlined.
#[inline(always)]
fn each<T, U>([a, b, c, d, e, f, g, h]: [T; LANES], of: impl Fn(T) -> U) -> [U; LANES] {
    [of(a), of(b), of(c), of(d), of(e), of(f), of(g), of(h)]
}

/// Eight numbers of each lane in a row of its own.
#[inline(always)]
fn stored([a, b, c, d, e, f, g, h]: [Reals; 8]) -> [Row; LANES] {
    let rows = [a.store(), b.store(), c.store(), d.store(), e.store(), f.store(), g.store(), h.store()];
    let [a, b, c, d, e, f, g, h] = transposed(rows.each_ref());
    [a.store(), b.store(), c.store(), d.store(), e.store(), f.store(), g.store(), h.store()]
}

/// The lanes whose bits are set.
#[inline(always)]
fn set(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (lane < LANES).then_some(lane)
    })
}
