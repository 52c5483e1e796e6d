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
use super::clock::{self, Emitted};
use super::table::Table;
use super::{Record, hand_over, numbers_in, put_hit, ray_in};
use crate::math::lanes::Row;
use crate::render::Job;
use crate::render::cpu::brought::{Named, Parts};
use crate::render::cpu::row::RowSums;
use crate::scene::compile::NONE;
use crate::transport::flight::{Flight, Stamp};
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::connect::{Connection, escape, met};
use crate::transport::integrator::bdpt::subpath::{Edge, Escape, Origin};
use crate::transport::integrator::bdpt::weights::Link;
use crate::transport::mis::Heuristic;
use crate::transport::ray::{Hit, Ray};
use crate::transport::sampler::Independent;

/// Samples of a tile.
pub(super) const TILE: usize = 128;

/// What all subpaths share; `TIMED` where the film has a time axis.
#[derive(Clone, Copy)]
struct Work<'a, const TIMED: bool> {
    table: &'a Table,
    context: &'a Context<'a>,
    h: Heuristic,
    emitted: &'a Emitted,
}

/// A subpath between two of its vertices. In rows: its ray and what it carries; what the ray left, by position and normal,
/// and the promise of its roulette; where the ray met what, and the key of its numbers; how many of them were taken, the
/// optical length so far and the index of the medium, where there is a time axis, and light that it met. What starts on a
/// light has, in the place of those two, probability and area of it if it is a plain triangle.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct Walker {
    rows: [Row; 4],
    /// Density of the ray's direction; its link.
    weights: [f64; 3],
}

/// A vertex of a subpath. In rows: position, geometric normal, the factor of the way back, and the row of its material;
/// shading normal, direction to the vertex before, what the path carries; the rest of that, and the optical length of the path,
/// when its light was emitted, and the index of the medium through which it came, where there is a time axis.
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
    emitted: Emitted,
    /// Light from outside that camera subpaths met, weighted, and when it arrives.
    escaped: Vec<(Vec3, f64)>,
    lists: Lists,
    own: Own,
}

/// What samples bring to their own pixels.
#[derive(Default)]
struct Own {
    values: Vec<Vec3>,
    /// What those are made up of, where there is a time axis.
    parts: Parts,
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

impl Node {
    /// The row of its material.
    #[inline]
    fn material(&self) -> usize {
        self.rows[0].0[7].to_bits() as usize
    }

    /// When the path is here, where there is a time axis.
    fn stamp(&self) -> Stamp {
        let [_, path, late, index, ..] = self.rows[2].0;
        Stamp { path, late, delay: 0.0, index }
    }

    /// Sets [`Node::stamp`].
    #[inline]
    fn set_stamp(&mut self, [path, late, index]: [f32; 3]) {
        self.rows[2].0[1..4].copy_from_slice(&[path, late, index]);
    }
}

impl<const TIMED: bool> Work<'_, TIMED> {
    /// The light of a connection, weighted.
    fn weighted(&self, found: Option<Connection>) -> Vec3 {
        found.map_or(Vec3::ZERO, |c| c.unweighted * c.weight(self.context.settings) as f32)
    }

    /// The clock of a walker of camera subpath `path` whose edge number `edge` is on its way.
    fn flight(&self, walker: &Walker, path: usize, edge: u32) -> Flight<'_, true> {
        let [_, _, _, length, index, ..] = walker.rows[3].0;
        let stamp = Stamp { path: length, late: self.emitted.of(path), delay: 0.0, index };
        Flight::resumed(self.context, stamp, walker.edge().from, !clock::counts(self.context, edge))
    }

    /// Light from outside that edge number `edge` of camera subpath `path` has found, and when it arrives.
    fn escaped(&self, camera: &Subpaths, path: usize, edge: u32) -> (Vec3, f64) {
        let context = self.context;
        if context.scene.environment.is_none() || !context.settings.wants(0, edge + 1) {
            return (Vec3::ZERO, 0.0);
        }
        let walker = &camera.walkers[path];
        let leaves = || self.flight(walker, path, edge).escaped(context, walker.ray().dir);
        let length = if TIMED { leaves() } else { 0.0 };
        let left = Escape { edge: walker.edge(), throughput: walker.throughput(), length };
        (self.weighted(escape(context, self.h, &left, edge + 1)), length)
    }

    /// Light of a surface that edge number `edge` of a camera subpath has met, and where.
    fn met(&self, walker: &Walker, hit: &Hit, edge: u32) -> Option<(Vec3, Vec3)> {
        let Work { context, h, .. } = *self;
        if context.scene.emitter_of(hit.primitive, NONE) == NONE || !context.settings.wants(0, edge + 1) {
            return None;
        }
        let found = met(context, h, &walker.edge(), &walker.ray(), hit, walker.throughput(), edge + 1)?;
        Some((self.weighted(Some(found)), found.point?.position))
    }

    /// The camera subpath of a sample, before its first edge.
    fn camera(&self, record: &Record) -> Walker {
        let [way, _, keys] = record.rows;
        let [x, y, z, u, v, w, ..] = way.0;
        let edge = Edge::from_lens(self.context, Vec3::new(x, y, z), Vec3::new(u, v, w));
        let left = Row([1.0, x, y, z, 0.0, 0.0, 0.0, 1.0]);
        let taken = Row([1.0, 1.0, record.rows[1].0[6], 0.0, self.context.medium(), 0.0, 0.0, 0.0]);
        Walker { rows: [way, left, keys, taken], weights: [edge.pdf_w, edge.link.joint, edge.link.tail] }
    }
}

/// All samples that are named, of row `y`: what each brings to its own pixel, and what to others.
pub(super) fn tile<const TIMED: bool>(
    table: &Table,
    context: &Context,
    job: &Job,
    y: u32,
    named: &[Named],
    tile: &mut Tile,
    row: &mut RowSums,
) {
    let Tile { records, camera, light, starts, emitted, escaped, lists, own } = tile;
    records.clear();
    super::start::begin(table.width, job, context.camera, y, named, records);
    emitted.begin(context, records);
    let work = Work::<TIMED> { table, context, h: context.settings.heuristic(), emitted };
    camera.reset(records.len());
    camera.walkers.clear();
    camera.walkers.extend(records.iter().map(|record| work.camera(record)));
    camera.active.extend(0..records.len() as u32);
    escaped.clear();
    escaped.resize(records.len(), (Vec3::ZERO, 0.0));
    walk::all::<false, TIMED>(&work, camera, context.max_depth, &[], escaped);
    light.reset(records.len());
    starts.begin(&work, camera, light);
    walk::all::<true, TIMED>(&work, light, context.max_depth.saturating_sub(1), &starts.of, escaped);
    lists.reset(table.classes());
    own.values.clear();
    own.values.resize(records.len(), Vec3::ZERO);
    own.parts.clear();
    let mut splat = |path: u32, pixel: [u32; 2], value: Vec3, length: f64| {
        row.elsewhere(named[path as usize], pixel, value, length);
    };
    for (path, escaped) in escaped.iter().enumerate() {
        let mut taken = lists.own(&work, path, [&*light, &*camera], *escaped);
        if context.settings.wants(1, 1) {
            taken = starts.list(path, taken);
        }
        lists.lens(&work, path, light, taken);
        if lists.are_full() {
            lists.make(&work, [light, camera], own, &mut splat);
        }
    }
    starts.see(&work, light, &mut lists.waiting, &mut splat);
    lists.make(&work, [light, camera], own, &mut splat);
    hand_over(context, named, &own.values, &mut own.parts, row);
}
