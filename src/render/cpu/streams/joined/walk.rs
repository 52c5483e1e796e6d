//! The steps of subpaths: up to eight in the lanes of one vector.

use glam::Vec3;

use super::start::Start;
use super::{Node, Subpaths, Walker, Work};
use crate::math::lanes::{Doubles, LANES, Reals, Vectors, Words, Yes, transposed};
use crate::math::real::{Mask, Real, Vector, Word};
use crate::render::cpu::streams::lamps::{plain_ends, with_singles};
use crate::render::cpu::streams::shade::{Vertices, points};
use crate::render::cpu::streams::{each, filled, set, stored};
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::Mode;
use crate::transport::integrator::bdpt::weights::{Chain, Link, Side};
use crate::transport::ray::offset_by_axis;
use crate::transport::sampler::Independent;
use crate::transport::vertex::{area_factors, towards};

/// Follows the active subpaths of the light's side or of the camera's until they end, over so many edges at most. Light from
/// outside that camera paths find goes to `escaped`.
pub(super) fn all<const LIGHT: bool>(
    work: &Work,
    paths: &mut Subpaths,
    max_edges: u32,
    starts: &[Start],
    escaped: &mut [Vec3],
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
            let walker = &mut paths.walkers[path as usize];
            let Some(hit) = hit else {
                if !LIGHT {
                    escaped[path as usize] = work.escaped(walker, edge + 1);
                }
                continue;
            };
            let found = if LIGHT { Vec3::ZERO } else { work.met(walker, hit, edge + 1) };
            match work.table.class(hit.primitive).filter(|_| !last) {
                Some(class) => {
                    walker.meet(hit, found);
                    lists[class].push(path);
                }
                None if found != Vec3::ZERO => paths.push(path as usize, Node { found, ..Node::default() }),
                None => {}
            }
        }
        for (class, list) in lists.iter_mut().enumerate() {
            let step = Step { work, class, edge, goes_on: edge < max_edges, starts };
            #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
            // SAFETY: streams are made only where the processor has AVX2.
            unsafe {
                step.paths::<LIGHT>(list, paths);
            }
            list.clear();
        }
        std::mem::swap(&mut active, &mut paths.active);
    }
    paths.active = active;
}

/// A step of paths that have met surfaces of one class.
struct Step<'a> {
    work: &'a Work<'a>,
    class: usize,
    /// The edge on which they came.
    edge: u32,
    /// Whether there may be another.
    goes_on: bool,
    starts: &'a [Start],
}

impl Step<'_> {
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn paths<const LIGHT: bool>(&self, list: &[u32], paths: &mut Subpaths) {
        for group in list.chunks(LANES) {
            let lanes = each(filled(group), |path| path as usize);
            self.eight::<LIGHT>(lanes, Yes::first(group.len()), paths);
        }
    }

    #[inline(always)]
    fn eight<const LIGHT: bool>(&self, lanes: [usize; LANES], active: Yes, paths: &mut Subpaths) {
        let Step { work, edge, .. } = *self;
        let (table, context, h) = (work.table, work.context, work.h);
        let common = table.common(self.class);
        let mode = if LIGHT { Mode::Importance } else { Mode::Radiance };
        let zero = Reals::of(0.0);
        let walkers: [&Walker; LANES] = std::array::from_fn(|i| &paths.walkers[lanes[i]]);
        let way = transposed(walkers.map(|w| &w.rows[0]));
        let left = transposed(walkers.map(|w| &w.rows[1]));
        let met = transposed(walkers.map(|w| &w.rows[2]));
        let rest = transposed(walkers.map(|w| &w.rows[3]));
        let mut weights = [[0.0; LANES]; 3];
        let mut primitives = [0; LANES];
        let mut materials = [0; LANES];
        for (i, walker) in walkers.into_iter().enumerate() {
            [weights[0][i], weights[1][i], weights[2][i]] = walker.weights;
            primitives[i] = walker.rows[2].0[3].to_bits();
            materials[i] = table.row_of[primitives[i] as usize];
        }
        let (origin, dir) = (Vectors::new(way[0], way[1], way[2]), Vectors::new(way[3], way[4], way[5]));
        let throughput = Vectors::new(way[6], way[7], left[0]);
        let before = [Vectors::new(left[1], left[2], left[3]), Vectors::new(left[4], left[5], left[6])];

        let point = points(context.scene, common.sphere, primitives, [origin, dir], [met[0], met[1], met[2]]);
        let here = [point.position, point.n_geometric];
        let wo = -dir;
        let (some, chain, back) = if LIGHT && edge == 1 {
            let (chance, area) = (rest[3], rest[4]);
            let mut end = plain_ends(before, here, dir, [chance, area]);
            let known = area.gt(zero);
            if (!known).any() {
                let points = each(lanes, |i| match &self.starts[i] {
                    Start::Single(start) => Some(start.point),
                    _ => None,
                });
                end = with_singles(context, end, known, &points, here, dir);
            }
            let (some, chain) = Chain::new(h, end.link(h), end.next);
            (some, chain, end.back)
        } else {
            let [spread, back] = area_factors(before, here);
            let [pdf_w, joint, tail] = weights.each_ref();
            let link = Link { joint: Doubles::load(joint), tail: Doubles::load(tail) };
            let (some, chain) = Chain::new(h, link, Doubles::load(pdf_w) * spread.double());
            (some, chain, back)
        };
        let rows = each(materials, |m| &table.rows[m as usize]);
        let vertices = Vertices::new(point, wo, rows, &common, active & some);
        let [p, n, ns, t] = [point.position, point.n_geometric, point.n_shading, throughput];
        let first = stored([p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), back, zero]);
        let second = stored([ns.x(), ns.y(), ns.z(), wo.x(), wo.y(), wo.z(), t.x(), t.y()]);
        let (last, joint, tail) = (t.z().store().0, chain.joint.store(), chain.tail.store());
        let made = (active & some).bits();
        for i in set(made) {
            let mut rows = [first[i], second[i], Default::default()];
            rows[0].0[7] = f32::from_bits(materials[i]);
            rows[2].0[0] = last[i];
            let found = Vec3::from_slice(&paths.walkers[lanes[i]].rows[3].0[5..]);
            let class = Some(self.class as u8);
            paths.push(lanes[i], Node { rows, chain: [joint[i], tail[i]], class, found, next: 0 });
        }
        if !self.goes_on || made == 0 {
            return;
        }

        let key = [met[4].bits(), met[5].bits(), met[6].bits(), met[7].bits()];
        let mut taken = rest[2].bits();
        let [choice, u, v] = Independent::next_three(key, taken);
        taken = taken.add(Words::of(3));
        let (some, s, reverse) = vertices.bsdf.sample::<true>(&vertices.view, choice, [u, v], mode);
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
        let mut promise = Vectors::new(left[7], rest[0], rest[1]) * promised;
        let mut throughput = throughput * weight;
        if context.rr_start.is_some_and(|start| edge >= start) {
            let most = promise.x().max(promise.y()).max(promise.z());
            let survival = most.min(Reals::of(MAX_SURVIVAL));
            let [u, ..] = Independent::next_three(key, taken);
            taken = Words::select(on, taken.add(Words::of(1)), taken);
            on = on & u.lt(survival);
            promise = promise / survival;
            throughput = throughput / survival;
        }
        on = on & !throughput.same(Vectors::of(Vec3::ZERO));
        let side = Side { chain, back };
        let (pdf_w, link) = side.onward(h, mode, [wo, wi, n], [s.pdf_w, reverse], (s.delta, eta));
        let start = offset_by_axis(p, towards(n, wi));
        let [o, d, t] = [start, wi, throughput];
        let way = stored([o.x(), o.y(), o.z(), d.x(), d.y(), d.z(), t.x(), t.y()]);
        let left = stored([t.z(), p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), promise.x()]);
        let (y, z) = (promise.y().store().0, promise.z().store().0);
        let taken = taken.as_bits().store().0;
        let (pdf_w, joint, tail) = (pdf_w.store(), link.joint.store(), link.tail.store());
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
