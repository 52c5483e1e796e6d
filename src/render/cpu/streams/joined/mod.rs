//! Many samples of `bdpt` together: all camera subpaths of a tile, all light subpaths, and then all that joins them.
//!
//! Subpaths go on step by step as those of other integrators do, and [leave a node](Node) at each vertex. How many random
//! numbers a connection takes does not depend on what it finds, and the order of a sample's sum is that in which `bdpt`
//! goes through its connections: so both are known when connections are [listed](connect), and those may be made in any
//! order, surfaces of one class together.

mod connect;
mod start;
mod walk;

use glam::Vec3;

use self::connect::Lists;
use self::start::Starts;
use super::table::Table;
use super::{Named, Record, numbers_in, put_hit, ray_in};
use crate::math::lanes::Row;
use crate::render::Job;
use crate::scene::compile::NONE;
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::connect::{Connection, escape, met};
use crate::transport::integrator::bdpt::subpath::{Edge, Escape, Origin};
use crate::transport::integrator::bdpt::weights::Link;
use crate::transport::mis::Heuristic;
use crate::transport::ray::{Hit, Ray};
use crate::transport::sampler::Independent;

/// Samples of a tile.
pub(super) const TILE: usize = 128;

/// What all subpaths share.
#[derive(Clone, Copy)]
struct Work<'a> {
    table: &'a Table,
    context: &'a Context<'a>,
    h: Heuristic,
}

/// A subpath between two of its vertices. In rows: its ray and what it carries; what the ray left, by position and normal,
/// and the promise of its roulette; where the ray met what, and the key of its numbers; how many of them were taken,
/// probability and area of a plain triangle where the light path starts there, and light that it met.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct Walker {
    rows: [Row; 4],
    /// Density of the ray's direction; its link.
    weights: [f64; 3],
}

/// A vertex of a subpath. In rows: position, geometric normal, the factor of the way back, and the row of its material;
/// shading normal, direction to the vertex before, what the path carries; the rest of that.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct Node {
    rows: [Row; 3],
    chain: [f64; 2],
    /// The class of its surface; `None` where the path has ended and nothing is joined.
    class: Option<u8>,
    /// Light that the path met here, weighted.
    found: Vec3,
    /// The next vertex of the path, or [`NONE`].
    next: u32,
}

/// The subpaths of one side.
#[derive(Default)]
struct Subpaths {
    walkers: Vec<Walker>,
    nodes: Vec<Node>,
    /// Of every path its first and its last vertex, or [`NONE`].
    ends: Vec<[u32; 2]>,
    /// The paths that are on their way.
    active: Vec<u32>,
}

/// The samples of a tile.
#[derive(Default)]
pub(super) struct Tile {
    records: Vec<Record>,
    camera: Subpaths,
    light: Subpaths,
    starts: Starts,
    /// Light from outside that camera subpaths met, weighted.
    escaped: Vec<Vec3>,
    lists: Lists,
}

impl Walker {
    fn ray(&self) -> Ray {
        ray_in(&self.rows[0])
    }

    fn throughput(&self) -> Vec3 {
        let [.., x, y] = self.rows[0].0;
        Vec3::new(x, y, self.rows[1].0[0])
    }

    fn edge(&self) -> Edge {
        let [_, x, y, z, a, b, c, _] = self.rows[1].0;
        let [pdf_w, joint, tail] = self.weights;
        let origin = Origin::Surface(Vec3::new(a, b, c));
        Edge { origin, from: Vec3::new(x, y, z), dir: self.ray().dir, pdf_w, link: Link { joint, tail } }
    }

    fn taken(&self) -> u32 {
        self.rows[3].0[2].to_bits()
    }

    fn numbers(&self, taken: u32) -> Independent {
        numbers_in(&self.rows[2], taken)
    }

    fn meet(&mut self, hit: &Hit, found: Vec3) {
        put_hit(&mut self.rows[2], hit);
        self.rows[3].0[5..].copy_from_slice(&found.to_array());
    }
}

impl Subpaths {
    fn reset(&mut self, paths: usize) {
        self.nodes.clear();
        self.ends.clear();
        self.ends.resize(paths, [NONE; 2]);
        self.active.clear();
    }

    /// Appends a vertex to a path.
    fn push(&mut self, path: usize, node: Node) {
        let index = self.nodes.len() as u32;
        let [first, last] = &mut self.ends[path];
        match *last {
            NONE => *first = index,
            last => self.nodes[last as usize].next = index,
        }
        *last = index;
        self.nodes.push(Node { next: NONE, ..node });
    }

    /// The vertices of a path in their order.
    fn path(&self, path: usize) -> impl Iterator<Item = u32> {
        let some = |index: u32| (index != NONE).then_some(index);
        std::iter::successors(some(self.ends[path][0]), move |i| some(self.nodes[*i as usize].next))
    }
}

impl Work<'_> {
    /// The light of a connection, weighted.
    fn weighted(&self, found: Option<Connection>) -> Vec3 {
        found.map_or(Vec3::ZERO, |c| c.unweighted * c.weight(self.context.settings) as f32)
    }

    /// Light from outside that a subpath has found, as camera vertex number `t`.
    fn escaped(&self, walker: &Walker, t: u32) -> Vec3 {
        if self.context.scene.environment.is_none() || !self.context.settings.wants(0, t) {
            return Vec3::ZERO;
        }
        let left = Escape { edge: walker.edge(), throughput: walker.throughput(), length: 0.0 };
        self.weighted(escape(self.context, self.h, &left, t))
    }

    /// Light of a surface that a subpath has met, as camera vertex number `t`.
    fn met(&self, walker: &Walker, hit: &Hit, t: u32) -> Vec3 {
        let Work { context, h, .. } = *self;
        if context.scene.emitter_of(hit.primitive, NONE) == NONE || !context.settings.wants(0, t) {
            return Vec3::ZERO;
        }
        self.weighted(met(context, h, &walker.edge(), &walker.ray(), hit, walker.throughput(), t))
    }

    /// The camera subpath of a sample, before its first edge.
    fn camera(&self, record: &Record) -> Walker {
        let [way, _, keys] = record.rows;
        let [x, y, z, u, v, w, ..] = way.0;
        let edge = Edge::from_lens(self.context, Vec3::new(x, y, z), Vec3::new(u, v, w));
        let left = Row([1.0, x, y, z, 0.0, 0.0, 0.0, 1.0]);
        let taken = Row([1.0, 1.0, record.rows[1].0[6], 0.0, 0.0, 0.0, 0.0, 0.0]);
        Walker { rows: [way, left, keys, taken], weights: [edge.pdf_w, edge.link.joint, edge.link.tail] }
    }
}

/// All samples that are named, of row `y`: what each brings to its own pixel, and what to others, `done` is told.
pub(super) fn tile(
    table: &Table,
    context: &Context,
    job: &Job,
    y: u32,
    named: &[Named],
    tile: &mut Tile,
    done: &mut impl FnMut(u32, u64, Option<[u32; 2]>, Vec3),
) {
    let work = Work { table, context, h: context.settings.heuristic() };
    let Tile { records, camera, light, starts, escaped, lists } = tile;
    records.clear();
    super::start::begin(job, context.camera, y, named, records);
    camera.reset(records.len());
    camera.walkers.clear();
    camera.walkers.extend(records.iter().map(|record| work.camera(record)));
    camera.active.extend(0..records.len() as u32);
    escaped.clear();
    escaped.resize(records.len(), Vec3::ZERO);
    walk::all::<false>(&work, camera, context.max_depth, &[], escaped);
    light.reset(records.len());
    starts.begin(&work, camera, light);
    walk::all::<true>(&work, light, context.max_depth.saturating_sub(1), &starts.of, escaped);
    lists.reset(table.classes());
    let mut values = vec![Vec3::ZERO; records.len()];
    let mut splat = |path: u32, pixel: [u32; 2], value: Vec3| {
        let (x, sample) = named[path as usize];
        done(x, sample, Some(pixel), value);
    };
    for (path, escaped) in escaped.iter().enumerate() {
        let mut taken = lists.own(&work, path, [&*light, &*camera], *escaped);
        if context.settings.wants(1, 1) {
            taken = starts.list(path, taken);
        }
        lists.lens(&work, path, light, taken);
        if lists.are_full() {
            lists.make(&work, light, camera, &mut values, &mut splat);
        }
    }
    starts.see(&work, light, &mut lists.waiting, &mut splat);
    lists.make(&work, light, camera, &mut values, &mut splat);
    for ((x, sample), value) in named.iter().zip(values) {
        done(*x, *sample, None, value);
    }
}
