//! Where the light subpaths of a tile start, and those points as the camera sees them: in lanes for triangles that shine
//! alike everywhere, one by one for all other lights.

use glam::Vec3;

use super::connect::{Splat, To, Waiting, keys, words};
use super::{Subpaths, Walker, Work};
use crate::math::lanes::{AnyWidth, Lanes, Row, each, filled, set};
use crate::math::real::{Double, Mask, Vector, Word};
use crate::math::{Frame, warp};
use crate::render::cpu::streams::lamps::{Chosen, plain_ends};
use crate::render::cpu::streams::shade::shadow_rays;
use crate::transport::integrator::bdpt::connect::seen;
use crate::transport::integrator::bdpt::weights::others_of_seen;
use crate::transport::light::{EmissionSample, area};
use crate::transport::ray::{Ray, offset_by_axis};
use crate::transport::sampler::{Independent, Sampler};
use crate::transport::vertex::{self, towards};

/// How many numbers the start of a light subpath takes.
const START: u32 = 5;

/// Where a light subpath starts.
#[derive(Clone, Copy, Debug)]
pub(super) enum Start {
    /// Nowhere.
    None,
    /// On a plain triangle: position and normal, the probability of choosing it, its area; radiance.
    Plain([Row; 2]),
    /// Anywhere else.
    Single(EmissionSample),
}

/// A start that is to be joined to the lens.
#[derive(Clone, Copy)]
struct Sight {
    path: u32,
    taken: u32,
}

/// The starts of a tile.
#[derive(Default)]
pub(super) struct Starts {
    /// Of every path.
    pub of: Vec<Start>,
    sights: Vec<Sight>,
}

impl Starts {
    /// Starts the light subpaths of samples whose camera subpaths have ended; those that have an edge are then active.
    pub fn begin<const TIMED: bool>(&mut self, work: &Work<TIMED>, camera: &Subpaths, light: &mut Subpaths) {
        self.sights.clear();
        self.of.clear();
        self.of.resize(camera.walkers.len(), Start::None);
        light.walkers.clear();
        light.walkers.extend_from_slice(&camera.walkers);
        if work.context.max_depth == 0 {
            return;
        }
        work.table.width.run(Begin { starts: self, work, light });
        if work.context.max_depth == 1 {
            light.active.clear();
        }
    }

    #[inline(always)]
    fn begin_lanes<R: Lanes<N>, const N: usize, const TIMED: bool>(
        &mut self,
        work: &Work<TIMED>,
        paths: [u32; N],
        active: R::Mask,
        light: &mut Subpaths,
    ) {
        let zero = R::of(0.0);
        let (key, taken) =
            (keys::<R, N>(light, paths), words::<R, N>(each(paths, |p| light.walkers[p as usize].taken())));
        let [choice, u0, u1] = Independent::next_three(key, taken);
        let [v0, v1, _] = Independent::next_three(key, taken.add(R::Word::of(3)));
        let Chosen { rows: [a, b], chance, alone, .. } = work.table.lamps.choose(work.context, choice, active);
        let corners = [R::Vec3::new(a[0], a[1], a[2]), R::Vec3::new(a[3], a[4], a[5]), R::Vec3::new(a[6], a[7], b[0])];
        let (at, normal) = area::on_triangle(corners, warp::uniform_triangle([u0, u1]));
        let local: R::Vec3 = warp::cosine_hemisphere([v0, v1]);
        let dir = Frame::from_normal(normal).to_world(local);
        let radiance = R::Vec3::new(b[2], b[3], b[4]);
        let (one_a, pdf_w) = (R::of(1.0) / b[1], warp::cosine_hemisphere_pdf_w(local.z()));
        let throughput = radiance * local.z() / (one_a * chance * pdf_w);
        let usable = active & b[5].gt(zero) & pdf_w.gt(zero) & one_a.gt(zero);
        let goes = (usable & !throughput.same(R::Vec3::of(Vec3::ZERO))).bits();
        let [p, n, d, t] = [at, normal, dir, throughput];
        let o = offset_by_axis(p, towards(n, d));
        let way = R::stored([o.x(), o.y(), o.z(), d.x(), d.y(), d.z(), t.x(), t.y()]);
        let left = R::stored([t.z(), p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), R::of(1.0)]);
        let point = R::stored([p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), chance, b[1]]);
        let shines = R::stored([b[2], b[3], b[4], zero, zero, zero, zero, zero]);
        for i in set(active.bits()) {
            let walker = &mut light.walkers[paths[i] as usize];
            let numbers = walker.numbers(walker.taken());
            walker.rows[3].0[2] = f32::from_bits(walker.taken() + START);
            if usable.bits() & 1 << i != 0 {
                let [.., chance, area] = point[i].0;
                (walker.rows[0], walker.rows[1]) = (way[i], left[i]);
                walker.depart([chance, area]);
                self.of[paths[i] as usize] = Start::Plain([point[i], shines[i]]);
                if goes & 1 << i != 0 {
                    light.active.push(paths[i]);
                }
            } else if alone & 1 << i != 0
                && let Some(start) = single(work, walker, numbers)
            {
                self.of[paths[i] as usize] = Start::Single(start);
                if walker.throughput() != Vec3::ZERO {
                    light.active.push(paths[i]);
                }
            }
        }
    }

    /// Lists the start of a path as the camera sees it, if there is one, when so many of its numbers are taken; how many
    /// then are.
    pub fn list(&mut self, path: usize, taken: u32) -> u32 {
        if matches!(self.of[path], Start::None) {
            return taken;
        }
        self.sights.push(Sight { path: path as u32, taken });
        taken + 4
    }

    /// Joins all starts that are listed to the lens; what lanes know then waits.
    pub fn see<const TIMED: bool>(
        &self,
        work: &Work<TIMED>,
        light: &Subpaths,
        waiting: &mut Waiting,
        splat: &mut Splat,
    ) {
        let (plain, others): (Vec<Sight>, Vec<Sight>) =
            self.sights.iter().partition(|s| matches!(self.of[s.path as usize], Start::Plain(_)));
        for Sight { path, taken } in others {
            if let Start::Single(start) = &self.of[path as usize] {
                let mut sampler = Sampler::Independent(light.walkers[path as usize].numbers(taken));
                let emitted = work.emitted.of(path as usize);
                if let Some((found, at)) = seen(work.context, work.h, start, emitted, &mut sampler) {
                    splat(path, at.pixel, work.weighted(Some(found)), found.length);
                }
            }
        }
        work.table.width.run(See { starts: self, work, sights: &plain, light, waiting });
    }

    /// `s = 1`, `t = 1`.
    #[inline(always)]
    fn see_lanes<R: Lanes<N>, const N: usize, const TIMED: bool>(
        &self,
        work: &Work<TIMED>,
        sights: [Sight; N],
        active: R::Mask,
        light: &Subpaths,
        waiting: &mut Waiting,
    ) {
        let zero = R::of(0.0);
        let starts = each(sights, |s| match self.of[s.path as usize] {
            Start::Plain(rows) => rows,
            _ => [Row::default(); 2],
        });
        let [x, y, z, a, b, c, chance, area] = R::transposed(starts.each_ref().map(|rows| &rows[0]));
        let [red, green, blue, ..] = R::transposed(starts.each_ref().map(|rows| &rows[1]));
        let (at, normal) = (R::Vec3::new(x, y, z), R::Vec3::new(a, b, c));
        let numbers = work.lens_numbers::<R, N>(light, each(sights, |s| s.path), each(sights, |s| s.taken));
        let seen = work.onto_film(at, numbers, active);
        if !seen.inside.any() {
            return;
        }
        let (lens, dir) = (seen.at.lens, seen.at.dir);
        let nowhere = R::Vec3::of(Vec3::ZERO);
        let cos = normal.dot(-dir);
        let end = plain_ends::<R>([at, normal], [lens, nowhere], -dir, [chance, area]);
        let per_area = (seen.importance.double() / end.start).single();
        let unweighted = R::Vec3::new(red, green, blue) * cos * per_area;
        let lit = seen.inside & cos.gt(zero) & !unweighted.same(nowhere);
        let values = work.shared::<R, N>(unweighted, others_of_seen(work.h, &end, seen.at.pdf_w), lit);
        let rays = shadow_rays::<R, N>([at, normal], [lens, nowhere], dir, R::Mask::of(false));
        if TIMED {
            let lengths = R::store_doubles(work.lens_lengths::<R, N>(each(sights, |s| s.path), seen.at.distance));
            waiting.lengths.extend(set(lit.bits()).map(|i| lengths[i]));
        }
        for i in set(lit.bits()) {
            waiting.push(&rays[i], &values[i], To::Pixel(sights[i].path, seen.pixels[i]));
        }
    }
}

/// The work of [`Starts::begin`].
struct Begin<'a, const TIMED: bool> {
    starts: &'a mut Starts,
    work: &'a Work<'a, TIMED>,
    light: &'a mut Subpaths,
}

impl<const TIMED: bool> AnyWidth for Begin<'_, TIMED> {
    type Out = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let paths: Vec<u32> = (0..self.starts.of.len() as u32).collect();
        for group in paths.chunks(N) {
            let active = R::Mask::first(group.len());
            self.starts.begin_lanes::<R, N, TIMED>(self.work, filled(group), active, self.light);
        }
    }
}

/// The work of [`Starts::see`].
struct See<'a, const TIMED: bool> {
    starts: &'a Starts,
    work: &'a Work<'a, TIMED>,
    sights: &'a [Sight],
    light: &'a Subpaths,
    waiting: &'a mut Waiting,
}

impl<const TIMED: bool> AnyWidth for See<'_, TIMED> {
    type Out = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.sights.chunks(N) {
            let active = R::Mask::first(group.len());
            self.starts.see_lanes::<R, N, TIMED>(self.work, filled(group), active, self.light, self.waiting);
        }
    }
}

impl Walker {
    /// With a fresh roulette, from a light of this probability and area.
    fn depart(&mut self, [chance, area]: [f32; 2]) {
        let taken = self.rows[3].0[2];
        self.rows[3].0[..5].copy_from_slice(&[1.0, 1.0, taken, chance, area]);
    }
}

/// The start of a light subpath on any light, from these numbers; the walker then leaves it.
fn single<const TIMED: bool>(work: &Work<TIMED>, walker: &mut Walker, numbers: Independent) -> Option<EmissionSample> {
    let mut sampler = Sampler::Independent(numbers);
    let (choice, u, v) = (sampler.next_1d(), sampler.next_2d(), sampler.next_2d());
    let start = work.context.lights.sample_emission(work.context.scene, choice, u, v)?;
    let throughput = start.radiance * start.cos / (start.pdf_a * start.pdf_w);
    let (p, n) = (start.point.position, start.point.normal);
    let Ray { origin: o, dir: d } = vertex::leave(p, n, start.dir);
    walker.rows[0] = Row([o.x, o.y, o.z, d.x, d.y, d.z, throughput.x, throughput.y]);
    walker.rows[1] = Row([throughput.z, p.x, p.y, p.z, n.x, n.y, n.z, 1.0]);
    walker.depart([0.0; 2]);
    Some(start)
}
