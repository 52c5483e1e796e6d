//! The steps of subpaths: as many at once as there are lanes.

use glam::Vec3;

use super::start::Start;
use super::{Node, Subpaths, Walker, Work};
use crate::math::lanes::{AnyWidth, Lanes, each, filled, set};
use crate::math::real::{Mask, Vector, Word};
use crate::render::cpu::streams::clock;
use crate::render::cpu::streams::lamps::{plain_ends, with_singles};
use crate::render::cpu::streams::shade::{Vertices, points};
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::Mode;
use crate::transport::flight::Stamp;
use crate::transport::integrator::bdpt::weights::{Chain, Link, Side};
use crate::transport::ray::offset_by_axis;
use crate::transport::sampler::Independent;
use crate::transport::vertex::{area_factors, towards};

/// Follows the active subpaths of the light's side or of the camera's until they end, over so many edges at most. Light from
/// outside that camera paths find goes to `escaped`.
pub(super) fn all<const LIGHT: bool, const TIMED: bool>(
    work: &Work<TIMED>,
    paths: &mut Subpaths,
    max_edges: u32,
    starts: &[Start],
    escaped: &mut [(Vec3, f64)],
) {
    let mut active = std::mem::take(&mut paths.active);
    let (mut rays, mut hits) = (Vec::new(), Vec::new());
    let mut lists: Vec<Vec<u32>> = vec![Vec::new(); work.table.classes()];
    for edge in 1..=max_edges {
        // From the camera, the last edge finds light or nothing.
        let last = !LIGHT && edge == max_edges;
        rays.clear();
        rays.extend(active.iter().map(|path| (paths.walkers[*path as usize].ray(), f32::INFINITY)));
        hits.clear();
        work.context.trace.closest_each(&rays, &mut hits);
        for (path, hit) in active.drain(..).zip(&hits) {
            let Some(hit) = hit else {
                if !LIGHT {
                    escaped[path as usize] = work.escaped(paths, path as usize, edge);
                }
                continue;
            };
            let walker = &mut paths.walkers[path as usize];
            let met = if LIGHT { None } else { work.met(walker, hit, edge) };
            let found = met.map_or(Vec3::ZERO, |(found, _)| found);
            match work.table.class(hit.primitive).filter(|_| !last) {
                Some(class) => {
                    walker.meet(hit, found);
                    lists[class].push(path);
                }
                None if found != Vec3::ZERO => {
                    let mut node = Node { found, ..Node::default() };
                    if let (true, Some((_, at))) = (TIMED, met) {
                        let mut flight = work.flight(walker, path as usize, edge);
                        flight.travel(at);
                        let Stamp { path, late, index, .. } = flight.stamp();
                        node.set_stamp([path, late, index]);
                    }
                    paths.push(path as usize, node);
                }
                None => {}
            }
        }
        for (class, list) in lists.iter_mut().enumerate() {
            let step = Step { work, class, edge, goes_on: edge < max_edges, starts };
            work.table.width.run(Steps::<LIGHT, TIMED> { step, list, paths });
            list.clear();
        }
        std::mem::swap(&mut active, &mut paths.active);
    }
    paths.active = active;
}

/// A step of paths that have met surfaces of one class.
struct Step<'a, const TIMED: bool> {
    work: &'a Work<'a, TIMED>,
    class: usize,
    /// The edge on which they came.
    edge: u32,
    /// Whether there may be another.
    goes_on: bool,
    starts: &'a [Start],
}

/// The same step of all paths that are listed.
struct Steps<'a, const LIGHT: bool, const TIMED: bool> {
    step: Step<'a, TIMED>,
    list: &'a [u32],
    paths: &'a mut Subpaths,
}

impl<const LIGHT: bool, const TIMED: bool> AnyWidth for Steps<'_, LIGHT, TIMED> {
    type Out = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.list.chunks(N) {
            let lanes = each(filled(group), |path| path as usize);
            self.step.lanes::<R, N, LIGHT>(lanes, R::Mask::first(group.len()), self.paths);
        }
    }
}

impl<const TIMED: bool> Step<'_, TIMED> {
    #[inline(always)]
    fn lanes<R: Lanes<N>, const N: usize, const LIGHT: bool>(
        &self,
        lanes: [usize; N],
        active: R::Mask,
        paths: &mut Subpaths,
    ) {
        let Step { work, edge, .. } = *self;
        let (table, context, h) = (work.table, work.context, work.h);
        let common = table.common(self.class);
        let mode = if LIGHT { Mode::Importance } else { Mode::Radiance };
        let zero = R::of(0.0);
        let walkers: [&Walker; N] = each(lanes, |i| &paths.walkers[i]);
        let way = R::transposed(each(walkers, |w| &w.rows[0]));
        let left = R::transposed(each(walkers, |w| &w.rows[1]));
        let met = R::transposed(each(walkers, |w| &w.rows[2]));
        let rest = R::transposed(each(walkers, |w| &w.rows[3]));
        let mut weights = [[0.0; N]; 3];
        let mut primitives = [0; N];
        let mut materials = [0; N];
        for (i, walker) in walkers.into_iter().enumerate() {
            [weights[0][i], weights[1][i], weights[2][i]] = walker.weights;
            primitives[i] = walker.rows[2].0[3].to_bits();
            materials[i] = table.row_of[primitives[i] as usize];
        }
        let (origin, dir) = (R::Vec3::new(way[0], way[1], way[2]), R::Vec3::new(way[3], way[4], way[5]));
        let throughput = R::Vec3::new(way[6], way[7], left[0]);
        let before = [R::Vec3::new(left[1], left[2], left[3]), R::Vec3::new(left[4], left[5], left[6])];

        let point = points::<R, N>(context.scene, common.sphere, primitives, [origin, dir], [met[0], met[1], met[2]]);
        let mut stamp = match LIGHT && edge == 1 {
            true => Stamp { path: zero, late: zero, delay: zero, index: R::of(1.0) },
            false => Stamp { path: rest[3], late: zero, delay: zero, index: rest[4] },
        };
        if TIMED {
            if !LIGHT {
                stamp.late = work.emitted.of_lanes(lanes);
            }
            if LIGHT || clock::counts(context, edge) {
                stamp.travel(before[0], point.position);
            }
        }
        let here = [point.position, point.n_geometric];
        let wo = -dir;
        let (some, chain, back) = if LIGHT && edge == 1 {
            let (chance, area) = (rest[3], rest[4]);
            let mut end = plain_ends::<R>(before, here, dir, [chance, area]);
            let known = area.gt(zero);
            if (!known).any() {
                let points = each(lanes, |i| match &self.starts[i] {
                    Start::Single(start) => Some(start.point),
                    _ => None,
                });
                end = with_singles::<R, N>(context, end, known, &points, here, dir);
            }
            let (some, chain) = Chain::new(h, end.link(h), end.next);
            (some, chain, end.back)
        } else {
            let [spread, back] = area_factors(before, here);
            let [pdf_w, joint, tail] = weights.each_ref();
            let link = Link { joint: R::load_doubles(joint), tail: R::load_doubles(tail) };
            let (some, chain) = Chain::new(h, link, R::load_doubles(pdf_w) * spread.double());
            (some, chain, back)
        };
        let rows = each(materials, |m| &table.rows[m as usize]);
        let vertices = Vertices::<R>::new(point, wo, rows, &common, active & some);
        let [p, n, ns, t] = [point.position, point.n_geometric, point.n_shading, throughput];
        let first = R::stored([p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), back, zero]);
        let second = R::stored([ns.x(), ns.y(), ns.z(), wo.x(), wo.y(), wo.z(), t.x(), t.y()]);
        let (last, joint, tail) = (t.z().store(), R::store_doubles(chain.joint), R::store_doubles(chain.tail));
        let made = (active & some).bits();
        let [length, late, index] = [stamp.path.store(), stamp.late.store(), stamp.index.store()];
        for i in set(made) {
            let mut rows = [first[i], second[i], Default::default()];
            rows[0].0[7] = f32::from_bits(materials[i]);
            rows[2].0[0] = last[i];
            let found = Vec3::from_slice(&paths.walkers[lanes[i]].rows[3].0[5..]);
            let class = Some(self.class as u8);
            let mut node = Node { rows, chain: [joint[i], tail[i]], class, found, next: 0 };
            if TIMED {
                node.set_stamp([length[i], late[i], index[i]]);
            }
            paths.push(lanes[i], node);
        }
        if !self.goes_on || made == 0 {
            return;
        }

        let key = [met[4].bits(), met[5].bits(), met[6].bits(), met[7].bits()];
        let mut taken = rest[2].bits();
        let [choice, u, v] = Independent::next_three(key, taken);
        taken = taken.add(R::Word::of(3));
        let (some, s, reverse) = vertices.sample::<true>(choice, [u, v], mode);
        let wi = vertices.frame.to_world(s.sample.wi);
        let cos_i = s.sample.wi.z();
        let mut on = vertices.seen & some & s.pdf_w.gt(zero) & vertices.agree(wi, cos_i);
        let mut weight = s.sample.weight;
        let eta = s.sample.eta;
        let mut promised = weight;
        if LIGHT {
            weight = weight * vertices.adjoint(wi, cos_i);
            promised = weight;
        } else {
            promised = promised * (eta * eta);
        }
        let mut promise = R::Vec3::new(left[7], rest[0], rest[1]) * promised;
        let mut throughput = throughput * weight;
        if context.rr_start.is_some_and(|start| edge >= start) {
            let most = promise.x().max(promise.y()).max(promise.z());
            let survival = most.min(R::of(MAX_SURVIVAL));
            let [u, ..] = Independent::next_three(key, taken);
            taken = R::Word::select(on, taken.add(R::Word::of(1)), taken);
            on = on & u.lt(survival);
            promise = promise / survival;
            throughput = throughput / survival;
        }
        on = on & !throughput.same(R::Vec3::of(Vec3::ZERO));
        let side = Side { chain, back };
        let (pdf_w, link) = side.onward(h, mode, [wo, wi, n], [s.pdf_w, reverse], (s.delta, eta));
        let start = offset_by_axis(p, towards(n, wi));
        let [o, d, t] = [start, wi, throughput];
        let way = R::stored([o.x(), o.y(), o.z(), d.x(), d.y(), d.z(), t.x(), t.y()]);
        let left = R::stored([t.z(), p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), promise.x()]);
        let (y, z) = (promise.y().store(), promise.z().store());
        let taken = taken.as_bits().store();
        let (pdf_w, joint, tail) = (R::store_doubles(pdf_w), R::store_doubles(link.joint), R::store_doubles(link.tail));
        if TIMED {
            stamp.leave(eta);
            let index = stamp.index.store();
            for i in set(on.bits()) {
                paths.walkers[lanes[i]].rows[3].0[3..5].copy_from_slice(&[length[i], index[i]]);
            }
        }
        for i in set(made) {
            paths.walkers[lanes[i]].rows[3].0[2] = taken[i];
        }
        for i in set(on.bits()) {
            let walker = &mut paths.walkers[lanes[i]];
            (walker.rows[0], walker.rows[1]) = (way[i], left[i]);
            walker.rows[3].0[..2].copy_from_slice(&[y[i], z[i]]);
            walker.weights = [pdf_w[i], joint[i], tail[i]];
            paths.active.push(lanes[i] as u32);
        }
    }
}
