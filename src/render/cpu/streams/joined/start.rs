//! Where the light subpaths of a tile start, and those points as the camera sees them: in lanes for triangles that shine
//! alike everywhere, one by one for all other lights.

use glam::Vec3;

use super::connect::{Splat, To, Waiting, keys, words};
use super::{Subpaths, Walker, Work};
use crate::math::lanes::{LANES, Reals, Row, Vectors, Words, Yes, transposed};
use crate::math::real::{Double, Mask, Real, Vector, Word};
use crate::math::{Frame, warp};
use crate::render::cpu::streams::lamps::{Chosen, plain_ends};
use crate::render::cpu::streams::shade::shadow_rays;
use crate::render::cpu::streams::{each, filled, set, stored};
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
    pub fn begin(&mut self, work: &Work, camera: &Subpaths, light: &mut Subpaths) {
        self.sights.clear();
        self.of.clear();
        self.of.resize(camera.walkers.len(), Start::None);
        light.walkers.clear();
        light.walkers.extend_from_slice(&camera.walkers);
        if work.context.max_depth == 0 {
            return;
        }
        #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
        // SAFETY: streams are made only where the processor has AVX2.
        unsafe {
            self.begin_avx2(work, light);
        }
        if work.context.max_depth == 1 {
            light.active.clear();
        }
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn begin_avx2(&mut self, work: &Work, light: &mut Subpaths) {
        let paths: Vec<u32> = (0..self.of.len() as u32).collect();
        for group in paths.chunks(LANES) {
            self.begin_eight(work, filled(group), Yes::first(group.len()), light);
        }
    }

    #[inline(always)]
    fn begin_eight(&mut self, work: &Work, paths: [u32; LANES], active: Yes, light: &mut Subpaths) {
        let zero = Reals::of(0.0);
        let (key, taken) = (keys(light, paths), words(each(paths, |p| light.walkers[p as usize].taken())));
        let [choice, u0, u1] = Independent::next_three(key, taken);
        let [v0, v1, _] = Independent::next_three(key, taken.add(Words::of(3)));
        let Chosen { rows: [a, b], chance, alone, .. } = work.table.lamps.choose(work.context, choice, active);
        let corners = [Vectors::new(a[0], a[1], a[2]), Vectors::new(a[3], a[4], a[5]), Vectors::new(a[6], a[7], b[0])];
        let (at, normal) = area::on_triangle(corners, warp::uniform_triangle([u0, u1]));
        let local: Vectors = warp::cosine_hemisphere([v0, v1]);
        let dir = Frame::from_normal(normal).to_world(local);
        let radiance = Vectors::new(b[2], b[3], b[4]);
        let (one_a, pdf_w) = (Reals::of(1.0) / b[1], warp::cosine_hemisphere_pdf_w(local.z()));
        let throughput = radiance * local.z() / (one_a * chance * pdf_w);
        let usable = active & b[5].gt(zero) & pdf_w.gt(zero) & one_a.gt(zero);
        let goes = (usable & !throughput.same(Vectors::of(Vec3::ZERO))).bits();
        let [p, n, d, t] = [at, normal, dir, throughput];
        let o = offset_by_axis(p, towards(n, d));
        let way = stored([o.x(), o.y(), o.z(), d.x(), d.y(), d.z(), t.x(), t.y()]);
        let left = stored([t.z(), p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), Reals::of(1.0)]);
        let point = stored([p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), chance, b[1]]);
        let shines = stored([b[2], b[3], b[4], zero, zero, zero, zero, zero]);
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
    pub fn see(&self, work: &Work, light: &Subpaths, waiting: &mut Waiting, splat: &mut Splat) {
        let (plain, others): (Vec<Sight>, Vec<Sight>) =
            self.sights.iter().partition(|s| matches!(self.of[s.path as usize], Start::Plain(_)));
        for Sight { path, taken } in others {
            if let Start::Single(start) = &self.of[path as usize] {
                let mut sampler = Sampler::Independent(light.walkers[path as usize].numbers(taken));
                if let Some((found, at)) = seen(work.context, work.h, start, 0.0, &mut sampler) {
                    splat(path, at.pixel, work.weighted(Some(found)));
                }
            }
        }
        #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
        // SAFETY: streams are made only where the processor has AVX2.
        unsafe {
            self.see_avx2(work, &plain, light, waiting);
        }
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn see_avx2(&self, work: &Work, sights: &[Sight], light: &Subpaths, waiting: &mut Waiting) {
        for group in sights.chunks(LANES) {
            self.see_eight(work, filled(group), Yes::first(group.len()), light, waiting);
        }
    }

    /// `s = 1`, `t = 1`.
    #[inline(always)]
    fn see_eight(&self, work: &Work, sights: [Sight; LANES], active: Yes, light: &Subpaths, waiting: &mut Waiting) {
        let zero = Reals::of(0.0);
        let starts = each(sights, |s| match self.of[s.path as usize] {
            Start::Plain(rows) => rows,
            _ => [Row::default(); 2],
        });
        let [x, y, z, a, b, c, chance, area] = transposed(starts.each_ref().map(|rows| &rows[0]));
        let [red, green, blue, ..] = transposed(starts.each_ref().map(|rows| &rows[1]));
        let (at, normal) = (Vectors::new(x, y, z), Vectors::new(a, b, c));
        let numbers = work.lens_numbers(light, sights.map(|s| s.path), sights.map(|s| s.taken));
        let seen = work.onto_film(at, numbers, active);
        if !seen.inside.any() {
            return;
        }
        let (lens, dir) = (seen.at.lens, seen.at.dir);
        let nowhere = Vectors::of(Vec3::ZERO);
        let cos = normal.dot(-dir);
        let end = plain_ends([at, normal], [lens, nowhere], -dir, [chance, area]);
        let per_area = (seen.importance.double() / end.start).single();
        let unweighted = Vectors::new(red, green, blue) * cos * per_area;
        let lit = seen.inside & cos.gt(zero) & !unweighted.same(nowhere);
        let values = work.shared(unweighted, others_of_seen(work.h, &end, seen.at.pdf_w), lit);
        let rays = shadow_rays([at, normal], [lens, nowhere], dir, Yes::of(false));
        for i in set(lit.bits()) {
            waiting.push(&rays[i], &values[i], To::Pixel(sights[i].path, seen.pixels[i]));
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
fn single(work: &Work, walker: &mut Walker, numbers: Independent) -> Option<EmissionSample> {
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
