//! Vertices that are drawn from those of all light subpaths, of which one is connected with a camera
//! vertex.

use glam::Vec3;

use super::connect::{ShadowQueue, Target};
use super::pending::{OwnContributions, VertexPair};
use super::stored::{store_colors, stored_light};
use crate::cpu::wavefront::light::{store_rays, stored_ray};
use lumbre_light::math::luminance::luminance_of;
use lumbre_light::math::real::Mask;
use lumbre_light::math::simd::{Lanes, active_lanes};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::connect::Connection;
use lumbre_light::transport::integrator::bdpt::draw::{LightVertexCache, choose, target};
use lumbre_light::transport::ray::Ray;

/// A drawn vertex, with its connection once that is evaluated.
#[derive(Clone, Copy)]
struct Candidate {
    /// Number of light vertices.
    s: u32,
    ray: (Ray, f32),
    unweighted: Vec3,
    /// Weight of multiple importance sampling.
    weight: f64,
    length: f64,
    /// Density of choosing it, up to a factor; 0 if it finds no light.
    target: f64,
}

/// A connection of which the candidates are drawn.
#[derive(Clone, Copy)]
struct Draw {
    /// Index into [`OwnContributions`].
    index: u32,
    /// Random number that chooses one.
    choice: f32,
    /// Index after that of its last candidate.
    end: u32,
}

/// Pending choices among drawn vertices.
#[derive(Default)]
pub(super) struct Draws {
    draws: Vec<Draw>,
    candidates: Vec<Candidate>,
}

impl Draws {
    /// Returns the number of candidates.
    pub fn candidates(&self) -> usize {
        self.candidates.len()
    }

    /// Appends a candidate with a number of light vertices, and returns its index.
    pub fn push_candidate(&mut self, s: u32) -> u32 {
        self.candidates.push(Candidate {
            s,
            ray: (
                Ray {
                    origin: Vec3::ZERO,
                    dir: Vec3::ZERO,
                },
                0.0,
            ),
            unweighted: Vec3::ZERO,
            weight: 0.0,
            length: 0.0,
            target: 0.0,
        });
        self.candidates.len() as u32 - 1
    }

    /// Completes a connection whose candidates were appended.
    pub fn push_draw(&mut self, index: u32, choice: f32) {
        let end = self.candidates.len() as u32;
        self.draws.push(Draw { index, choice, end });
    }

    /// Stores the connections of candidates, to which the pairs lead.
    #[inline(always)]
    pub fn set<R: Lanes<N>, const N: usize>(
        &mut self,
        context: &Context,
        (c, count): (&Connection<R, N>, f64),
        pairs: &[VertexPair; N],
    ) {
        let Some(ray) = &c.ray else { return };
        let rays = store_rays(ray);
        let light = store_colors::<R, N>([c.unweighted; 2]);
        let weights = R::store_doubles(c.weight(context.settings, count));
        let lengths = R::store_doubles(c.length);
        for i in active_lanes(c.lanes.bits()) {
            let candidate = &mut self.candidates[pairs[i].index as usize];
            candidate.ray = stored_ray(&rays[i]);
            [_, candidate.unweighted] = stored_light(&light[i]);
            candidate.weight = weights[i];
            candidate.length = lengths[i];
            candidate.target = target(luminance_of(candidate.unweighted), weights[i]);
        }
    }

    /// Chooses a candidate of each connection, queues their shadow rays, and removes all. `resolve`
    /// is called after each.
    pub fn choose(
        &mut self,
        context: &Context,
        cache: &LightVertexCache,
        own: &mut OwnContributions,
        queue: &mut ShadowQueue,
        mut resolve: impl FnMut(&mut ShadowQueue, &mut OwnContributions),
    ) {
        let mut first = 0;
        for Draw { index, choice, end } in self.draws.drain(..) {
            let candidates = &self.candidates[first..end as usize];
            first = end as usize;
            let targets = candidates.iter().map(|candidate| candidate.target);
            let Some((chosen, probability)) = choose(targets, choice) else {
                continue;
            };
            let chosen = &candidates[chosen];
            let samples = cache.samples_of(context.settings.candidates, probability);
            let unweighted = chosen.unweighted / samples as f32;
            let light = [unweighted * chosen.weight as f32, unweighted];
            own.set_strategy(index, chosen.s);
            let length = context.timing.map(|_| chosen.length);
            queue.push_one(chosen.ray, light, length, Target::Own(index));
            resolve(queue, own);
        }
        self.candidates.clear();
    }
}
