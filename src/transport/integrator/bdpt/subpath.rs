//! The two subpaths of a sample.

use glam::Vec3;

use super::weights::{Chain, Link};
use crate::scene::compile::NONE;
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::{Bsdf, Mode};
use crate::transport::integrator::Context;
use crate::transport::light::{LightId, LightPoint};
use crate::transport::mis::Heuristic;
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;
use crate::transport::surface::Surface;
use crate::transport::vertex;

/// A vertex on a surface, generated from the camera or from a light.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// Position in world space.
    pub position: Vec3,
    /// Unit normal on the front side.
    pub n_geometric: Vec3,
    /// Unit shading normal on the same side.
    pub n_shading: Vec3,
    /// Unit direction to the vertex before.
    pub wo: Vec3,
    /// Position of the vertex before; meaningless for a light without a place.
    pub previous: Vec3,
    /// Turns a density per solid angle here into the other side's density of the vertex before.
    pub back: f32,
    /// The BSDF.
    pub bsdf: Bsdf,
    /// Whether anything can be connected here: the BSDF has a density, and the surface does not end paths.
    pub connectible: bool,
    /// Row of the scene's emitters, or [`NONE`].
    pub emitter: u32,
    /// Radiance emitted towards the vertex before.
    pub emitted: Vec3,
    /// What the path carries here, over the density with which it came here.
    pub throughput: Vec3,
    /// What weights need.
    pub chain: Chain,
    /// Whether the event that led to the next vertex was a Dirac.
    pub delta: bool,
    /// Index ratio crossed by that event.
    pub eta: f32,
}

/// The start of a light subpath.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Where.
    pub point: LightPoint,
}

/// Both subpaths of a sample, kept for the next one so that nothing is allocated per path.
#[derive(Debug, Default)]
pub struct Subpaths {
    /// Vertices of the light subpath behind the light's own: the vertex `y_i` is at `i - 1`.
    pub light: Vec<Vertex>,
    /// Where the light subpath starts, if there is one.
    pub start: Option<Start>,
    /// Vertices of the camera subpath behind the lens: the vertex `z_i` is at `i - 1`.
    pub camera: Vec<Vertex>,
    /// The point on the lens.
    pub lens: Vec3,
}

/// A path on its way to its next vertex.
struct Departure {
    ray: Ray,
    /// Position and normal of the surface that it leaves.
    from: Vec3,
    n: Vec3,
    throughput: Vec3,
    pdf_w: f64,
    link: Link,
}

/// The roulette of one subpath. The weights know nothing of it: see [`crate::transport::mis`].
struct Roulette {
    start: Option<u32>,
    /// What the path will bring back, as far as BSDFs tell.
    promise: Vec3,
}

impl Roulette {
    /// By what to divide what goes on behind edge `edge`, if it does.
    fn play(&mut self, edge: u32, weight: Vec3, sampler: &mut Sampler) -> Option<f32> {
        self.promise *= weight;
        if self.start.is_none_or(|start| edge < start) {
            return Some(1.0);
        }
        let survival = self.promise.max_element().min(MAX_SURVIVAL);
        if sampler.next_1d() >= survival {
            return None;
        }
        self.promise /= survival;
        Some(survival)
    }
}

impl Subpaths {
    /// The subpath from the camera, up to `max_edges` edges.
    pub fn trace_camera(
        &mut self,
        context: &Context,
        h: Heuristic,
        pixel: [u32; 2],
        max_edges: u32,
        sampler: &mut Sampler,
    ) {
        self.camera.clear();
        let ray = context.camera.sample_ray(pixel, sampler);
        self.lens = ray.origin;
        // Every strategy with two or more camera vertices generates the first edge alike, so its density cancels.
        let link = Link { joint: 0.0, tail: 0.0 };
        let departure = Departure { ray, from: ray.origin, n: Vec3::ZERO, throughput: Vec3::ONE, pdf_w: 1.0, link };
        walk(context, h, Mode::Radiance, departure, max_edges, sampler, &mut self.camera);
    }

    /// The subpath from a light, up to `max_edges` edges.
    pub fn trace_light(&mut self, context: &Context, h: Heuristic, max_edges: u32, sampler: &mut Sampler) {
        self.light.clear();
        self.start = None;
        if max_edges == 0 {
            return;
        }
        let (choice, u, v) = (sampler.next_1d(), sampler.next_2d(), sampler.next_2d());
        let Some(e) = context.lights.sample_emission(context.scene, choice, u, v) else { return };
        let throughput = e.radiance * e.cos / (e.pdf_a * e.pdf_w);
        if throughput == Vec3::ZERO {
            return;
        }
        self.start = Some(Start { point: e.point });
        // The term of the strategy s = 1 is put in when the vertex is known from which it would sample the light.
        let link = Link { joint: 1.0, tail: 1.0 / h.term(f64::from(e.pdf_a)) };
        let departure = Departure {
            ray: vertex::leave(e.point.position, e.point.normal, e.dir),
            from: e.point.position,
            n: e.point.normal,
            throughput,
            pdf_w: f64::from(e.pdf_w),
            link,
        };
        walk(context, h, Mode::Importance, departure, max_edges, sampler, &mut self.light);
        if let Some(first) = self.light.first_mut() {
            // Only surfaces can be sampled from elsewhere by another density than they start paths with.
            let LightId::Emitter(i) = e.point.light else { return };
            let lights = context.lights;
            let direct_w = lights.pdf_direct_w(context.scene, first.position, i, e.point.position, e.point.normal);
            first.chain.joint = h.term(f64::from(direct_w * first.back) / f64::from(e.pdf_a));
        }
    }
}

/// Follows a path until it ends.
fn walk(
    context: &Context,
    h: Heuristic,
    mode: Mode,
    mut departure: Departure,
    max_edges: u32,
    sampler: &mut Sampler,
    path: &mut Vec<Vertex>,
) {
    let mut roulette = Roulette { start: context.rr_start, promise: Vec3::ONE };
    for edge in 1..=max_edges {
        let Some(hit) = context.trace.closest(&departure.ray, f32::INFINITY) else { return };
        let surface = Surface::at(context.scene, &departure.ray, &hit);
        let Some(mut v) = departure.arrive(context, &surface, mode) else { return };
        let ends = v.emitter != NONE && !surface.material.emitter_reflects;
        if ends || edge == max_edges {
            v.connectible &= !ends;
            path.push(v);
            return;
        }
        let next = v.depart(h, mode, &surface, edge, &mut roulette, sampler);
        path.push(v);
        match next {
            Some(next) => departure = next,
            None => return,
        }
    }
}

impl Departure {
    /// The vertex where the path meets a surface; `None` where rounding leaves it without a density.
    #[inline]
    fn arrive(&self, context: &Context, surface: &Surface, mode: Mode) -> Option<Vertex> {
        let wo = -self.ray.dir;
        let density = self.pdf_w * f64::from(vertex::area_factor(self.from, surface.position, surface.n_geometric));
        let bsdf = Bsdf::new(surface, &context.scene.textures);
        let emitted = if mode == Mode::Radiance { surface.emitted(&context.scene.textures, wo) } else { Vec3::ZERO };
        (density > 0.0 && density.is_finite()).then(|| Vertex {
            position: surface.position,
            n_geometric: surface.n_geometric,
            n_shading: surface.n_shading,
            wo,
            previous: self.from,
            back: vertex::area_factor(surface.position, self.from, self.n),
            connectible: bsdf.has_density(),
            bsdf,
            emitter: surface.emitter,
            emitted,
            throughput: self.throughput,
            chain: Chain { density, joint: self.link.joint, tail: self.link.tail },
            delta: false,
            eta: 1.0,
        })
    }
}

impl Vertex {
    /// The cosine by which a BSDF value towards `wi` is multiplied.
    #[inline]
    pub fn cos(&self, wi: Vec3) -> f32 {
        wi.dot(self.n_shading).abs()
    }

    /// The other side's density of the vertex before, for a path that comes from `wi`.
    #[inline]
    pub fn density_before(&self, wi: Vec3) -> f64 {
        f64::from(self.bsdf.pdf_w(wi, self.wo) * self.back)
    }

    /// Samples where the path goes on.
    #[inline]
    fn depart(
        &mut self,
        h: Heuristic,
        mode: Mode,
        surface: &Surface,
        edge: u32,
        roulette: &mut Roulette,
        sampler: &mut Sampler,
    ) -> Option<Departure> {
        let choice = sampler.next_1d();
        let s = self.bsdf.sample(self.wo, choice, sampler.next_2d(), mode)?;
        (self.delta, self.eta) = (s.delta, s.eta);
        // Undoes the scaling of radiance by refraction, so that roulette judges what the path will bring back.
        let eta2 = if mode == Mode::Radiance { s.eta * s.eta } else { 1.0 };
        let survival = roulette.play(edge, s.weight * eta2, sampler)?;
        let throughput = self.throughput * s.weight / survival;
        if throughput == Vec3::ZERO {
            return None;
        }
        let (pdf_w, before) = if s.delta {
            let (out, back) = (s.wi.dot(self.n_geometric).abs(), self.wo.dot(self.n_geometric).abs());
            match mode {
                Mode::Radiance => (out, back / (s.eta * s.eta)),
                Mode::Importance => (out * s.eta * s.eta, back),
            }
        } else {
            (s.pdf_w, self.bsdf.pdf_w(s.wi, self.wo))
        };
        let link = self.chain.onward(h, s.delta, f64::from(before * self.back));
        Some(Departure {
            ray: surface.spawn(s.wi),
            from: self.position,
            n: self.n_geometric,
            throughput,
            pdf_w: f64::from(pdf_w),
            link,
        })
    }
}
