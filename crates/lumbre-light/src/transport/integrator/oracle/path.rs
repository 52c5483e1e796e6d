//! A complete path, and its densities from their definition.

use glam::{DVec3, Vec3};

use super::Rule;
use crate::transport::bsdf::{Bsdf, TransportMode};
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::single::{ConnectedPath, SharedVertex};
use crate::transport::integrator::bdpt::state::Vertex;
use crate::transport::integrator::iteration::light_paths::LightPaths;
use crate::transport::light::{LightPoint, Place};

/// A vertex between the light and the lens.
#[derive(Clone, Copy, Debug)]
pub struct ScatterVertex {
    /// Position in world space.
    pub position: Vec3,
    /// Unit normal on the front side.
    pub n_geometric: Vec3,
    /// Unit shading normal on the same side.
    pub n_shading: Vec3,
    /// The BSDF at this vertex.
    pub bsdf: Bsdf,
    /// For a Dirac event, the index on the light's side over that on the camera's side.
    pub dirac: Option<f32>,
}

impl ScatterVertex {
    /// Converts a vertex of a subpath; `dirac` describes the event at the vertex.
    fn new(v: &Vertex, dirac: Option<f32>) -> ScatterVertex {
        ScatterVertex {
            position: v.state.position,
            n_geometric: v.state.n_geometric,
            n_shading: v.state.n_shading,
            bsdf: v.bsdf,
            dirac,
        }
    }
}

/// A complete path `x_0 .. x_k` from a light to the lens.
#[derive(Clone, Debug)]
pub struct Path {
    /// The light point `x_0`.
    pub light: LightPoint,
    /// The surface vertices `x_1 .. x_(k-1)`.
    pub surfaces: Vec<ScatterVertex>,
    /// The lens point `x_k`.
    pub lens: Vec3,
    /// Unit directions from `x_i` to `x_(i+1)` as they were traced: rays start a little off their
    /// surfaces, so they cannot be recomputed exactly from the positions.
    pub dirs: Vec<Vec3>,
}

/// A number for each strategy that may find a path.
#[derive(Clone, Debug, PartialEq)]
pub struct ByStrategy {
    /// Connections of the first `s = 0 ..= k` vertices with the others.
    pub connections: Vec<f64>,
    /// Merging at `x_i`, for `0 <= i < k`.
    pub merges: Vec<f64>,
}

impl ByStrategy {
    /// Returns the sum over all strategies.
    pub fn sum(&self) -> f64 {
        self.connections.iter().chain(&self.merges).sum()
    }

    /// Applies a function to all numbers.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> ByStrategy {
        let all = |numbers: &[f64]| numbers.iter().map(|n| f(*n)).collect();
        ByStrategy {
            connections: all(&self.connections),
            merges: all(&self.merges),
        }
    }
}

impl Path {
    /// Builds the path that a strategy found; `None` if the record is incomplete. A merged path has
    /// the vertex of its camera subpath. `shared` are the light subpaths of the iteration, if there
    /// are any.
    pub fn new(
        context: &Context,
        shared: Option<&LightPaths>,
        found: &ConnectedPath,
    ) -> Option<Path> {
        let (s, t) = (found.contribution.s as usize, found.contribution.t as usize);
        let subpaths = found.subpaths;
        let mut loaded = Vec::new();
        let (all_light, start) = match found.shared {
            None => (&subpaths.light, subpaths.start),
            Some(SharedVertex::Connected(id) | SharedVertex::Merged(id)) => {
                let paths = shared?;
                let start = paths.load(context, paths.path_of(id), &mut loaded);
                (&loaded, start)
            }
        };
        let merged = matches!(found.shared, Some(SharedVertex::Merged(_)));
        let light = match (found.point, start) {
            (Some(point), _) => point,
            (None, start) => {
                let start = start?;
                start.point(&context.lights.with_indices([start.light], true))
            }
        };
        let light_vertices = &all_light[..s.saturating_sub(1)];
        // A light that a camera subpath hits by chance is its last vertex, or outside the scene.
        let camera_vertices = &subpaths.camera[..if s == 0 { t - 2 } else { t - 1 }];
        let mut surfaces = Vec::with_capacity(s + t);
        let mut dirs = Vec::with_capacity(s + t);
        for (i, y) in light_vertices.iter().enumerate() {
            let connected = !merged && i + 1 == light_vertices.len();
            let turns = y.delta && !connected;
            surfaces.push(ScatterVertex::new(&y.vertex, turns.then_some(1.0 / y.eta)));
            dirs.push(-y.vertex.out.wo);
        }
        dirs.push(-found.wi);
        for (i, z) in camera_vertices.iter().enumerate().rev() {
            let turns = z.delta && (i + 1 < camera_vertices.len() || s == 0);
            surfaces.push(ScatterVertex::new(&z.vertex, turns.then_some(z.eta)));
            dirs.push(z.vertex.out.wo);
        }
        Some(Path {
            light,
            surfaces,
            lens: found.lens,
            dirs,
        })
    }

    /// Returns the number of edges.
    pub fn depth(&self) -> usize {
        self.surfaces.len() + 1
    }

    /// Returns whether the light is infinitely distant and has a direction in place of a position.
    pub fn outside(&self) -> bool {
        self.light.light().place().is_distant()
    }

    /// Returns whether no path can hit the light by chance.
    pub fn light_is_dirac(&self) -> bool {
        self.light.light().place().is_dirac()
    }

    /// Returns whether the event at `x_i` is a Dirac event.
    pub fn is_dirac(&self, i: usize) -> bool {
        i >= 1 && i <= self.surfaces.len() && self.surfaces[i - 1].dirac.is_some()
    }

    fn position(&self, i: usize) -> DVec3 {
        match i {
            0 => self.light.position,
            i if i <= self.surfaces.len() => self.surfaces[i - 1].position,
            _ => self.lens,
        }
        .as_dvec3()
    }

    /// Returns the factor from a density per solid angle at `x_from` to that of the neighbour
    /// `x_to` in its own measure.
    fn spread(&self, from: usize, to: usize) -> f64 {
        if from == 0 && self.outside() {
            return (self.dirs[0]
                .as_dvec3()
                .dot(self.surfaces[0].n_geometric.as_dvec3()))
            .abs();
        }
        let edge = self.position(to) - self.position(from);
        let cos = |n: Vec3| edge.dot(n.as_dvec3()).abs() / edge.length();
        let d2 = edge.length_squared();
        match (to, self.light.light().place()) {
            (0, Place::Surface) => cos(self.light.normal) / d2,
            (0, Place::Point) => 1.0 / d2,
            (0, Place::Direction | Place::Outside) => 1.0,
            _ => cos(self.surfaces[to - 1].n_geometric) / d2,
        }
    }

    /// Returns the density with which light paths start at `x_0`, in its measure.
    fn start(&self, context: &Context) -> f64 {
        let choice = f64::from(context.lights.pdf_choice(self.light.light()));
        match self.light.light().emitter() {
            Some(i) => choice / f64::from(context.scene.emitters[i as usize].area),
            None => choice * self.direction(context),
        }
    }

    /// Returns the density of a light without a surface in its measure, given its choice.
    fn direction(&self, context: &Context) -> f64 {
        if self.light_is_dirac() {
            return 1.0;
        }
        f64::from(context.lights.pdf_environment_one_w(-self.dirs[0]))
    }

    /// Returns the density with which `x_0` is sampled as the light of `x_1`.
    fn direct(&self, context: &Context) -> f64 {
        let (scene, light) = (context.scene, self.light.light());
        let from = self.surfaces[0].position;
        let choice = f64::from(context.lights.pdf_direct_choice(light, from));
        let Some(i) = light.emitter() else {
            return choice * self.direction(context);
        };
        let primitive = scene.emitters[i as usize].primitive as usize;
        let Some(sphere) = primitive
            .checked_sub(scene.triangles.len())
            .map(|s| &scene.spheres[s])
        else {
            return choice / f64::from(scene.emitters[i as usize].area);
        };
        let sin = f64::from(sphere.radius) / (self.position(1) - sphere.center.as_dvec3()).length();
        if sin >= 1.0 {
            return 0.0;
        }
        let one_minus_cos = sin * sin / (1.0 + (1.0 - sin * sin).sqrt());
        choice / (std::f64::consts::TAU * one_minus_cos) * self.spread(1, 0)
    }

    /// Returns the density with which a light path generates `x_i` after `x_(i-1)`, for `1 <= i <
    /// k`.
    fn light_density(&self, context: &Context, i: usize) -> f64 {
        let per_solid_angle = if i == 1 {
            let e = context.lights.pdf_emission_at(&self.light, self.dirs[0]);
            if self.outside() {
                // The start is uniform over a disk, the only density left once the direction is
                // known.
                f64::from(e.pdf_a) / f64::from(context.lights.pdf_choice(self.light.light()))
            } else {
                f64::from(e.pdf_w)
            }
        } else {
            let (v, wo, wi) = (&self.surfaces[i - 2], -self.dirs[i - 2], self.dirs[i - 1]);
            match v.dirac {
                None => f64::from(v.bsdf.pdf_w(wo, wi)),
                Some(_) => f64::from(wi.dot(v.n_geometric).abs()),
            }
        };
        per_solid_angle * self.spread(i - 1, i)
    }

    /// Returns the density with which a camera path generates `x_i` after `x_(i+1)`, for `i < k`.
    fn camera_density(&self, context: &Context, rule: &Rule, i: usize) -> f64 {
        if i == 0 && self.light_is_dirac() {
            return 0.0;
        }
        let per_solid_angle = if i + 1 == self.depth() {
            // If pixels are points there is no density, and no strategy can do without the camera's
            // choice.
            match context.camera.pdf_w(-self.dirs[i]) {
                0.0 => 1.0,
                pdf_w => f64::from(pdf_w),
            }
        } else {
            let (v, wo, wi) = (&self.surfaces[i], self.dirs[i + 1], -self.dirs[i]);
            match v.dirac {
                None => rule.camera_pdf_w(v.position, &v.bsdf, [wo, wi]),
                Some(eta) => f64::from(wi.dot(v.n_geometric).abs() * eta * eta),
            }
        };
        let spread = if i + 1 == self.depth() {
            self.lens_spread(context)
        } else {
            self.spread(i + 1, i)
        };
        per_solid_angle * spread
    }

    /// Returns whether the camera generates `x_0` with certainty, as the one direction of its
    /// parallel rays: then no light path has a density there.
    pub fn direction_is_certain(&self, context: &Context) -> bool {
        context.camera.is_parallel() && self.depth() == 1 && self.outside()
    }

    /// Returns the distance between the lens and the vertex that it sees.
    pub fn lens_distance(&self) -> f64 {
        let k = self.depth();
        (self.position(k) - self.position(k - 1)).length()
    }

    /// Returns the factor from the density of the camera, which for parallel rays is per area
    /// perpendicular to them, to that of `x_(k-1)` in its own measure.
    fn lens_spread(&self, context: &Context) -> f64 {
        let k = self.depth();
        if !context.camera.is_parallel() || self.direction_is_certain(context) {
            return self.spread(k, k - 1);
        }
        let n = match self.surfaces.last() {
            Some(v) => v.n_geometric,
            None => self.light.normal,
        };
        self.dirs[k - 1].as_dvec3().dot(n.as_dvec3()).abs()
    }

    /// Returns the densities of the path under all strategies, times their numbers of samples. That
    /// of connecting is the product of the densities of the vertices, the first `s` as light paths
    /// generate them and the others as camera paths do, without the lens. That of merging at `x_i`
    /// is the product of those of `x_0 .. x_i` as a light path generates them and of those of `x_i
    /// .. x_(k-1)` as a camera path does, times the area of the disk. Zero for strategies that
    /// cannot find the path.
    ///
    /// A Dirac event has no density. Its place is taken by `|cos| eta^2` of the outgoing side,
    /// which makes the ratio of both directions correct, and with it the ratios of strategies.
    pub fn densities(&self, context: &Context, rule: &Rule) -> ByStrategy {
        let counts = &rule.counts;
        let k = self.depth();
        let possible = |s: usize| match s {
            0 => !self.light_is_dirac(),
            s if s == k && context.camera.pdf_w(-self.dirs[k - 1]) <= 0.0 => false,
            s if s == k && self.direction_is_certain(context) => false,
            1 if k == 1 => !self.light_is_dirac(),
            s => !self.is_dirac(s - 1) && !self.is_dirac(s),
        };
        let density = |s: usize| {
            let mut p = 1.0;
            for i in 0..k {
                p *= match i {
                    i if i >= s => self.camera_density(context, rule, i),
                    0 if s == 1 && k > 1 => self.direct(context),
                    0 => self.start(context),
                    i => self.light_density(context, i),
                };
            }
            p
        };
        let connection = |s: usize| {
            if possible(s) {
                counts.of(s as u32, (k + 1 - s) as u32) * density(s)
            } else {
                0.0
            }
        };
        let merge = |i: usize| {
            if i == 0 || self.is_dirac(i) {
                return 0.0;
            }
            let light = (1..=i).map(|j| self.light_density(context, j));
            let camera = (i..k).map(|j| self.camera_density(context, rule, j));
            counts.merging * self.start(context) * light.chain(camera).product::<f64>()
        };
        ByStrategy {
            connections: (0..=k).map(connection).collect(),
            merges: (0..k).map(merge).collect(),
        }
    }

    /// Returns the weights of all strategies [Veach 1997, 9.2].
    pub fn weights(&self, context: &Context, rule: &Rule) -> ByStrategy {
        let densities = self.densities(context, rule);
        let all = densities.connections.iter().chain(&densities.merges);
        let greatest = all.copied().fold(0.0, f64::max);
        let terms = densities.map(|p| rule.heuristic.term(p / greatest));
        let sum = terms.sum();
        terms.map(|t| t / sum)
    }

    /// Returns the contribution of the path to a pixel of a box filter, per unit of all its
    /// vertices' measures: emission, BSDFs, geometry, and the importance of the lens [Veach 1997,
    /// equation 8.7]. `None` for a path with Dirac events.
    pub fn contribution(&self, context: &Context) -> Option<DVec3> {
        let k = self.depth();
        let mut value = context
            .lights
            .emitted(context.scene, &self.light, self.dirs[0])
            .as_dvec3();
        for (i, v) in self.surfaces.iter().enumerate() {
            if v.dirac.is_some() {
                return None;
            }
            let (wo, wi) = (self.dirs[i + 1], -self.dirs[i]);
            let cos = wi.as_dvec3().dot(v.n_shading.as_dvec3()).abs();
            value *= v.bsdf.eval(wo, wi, TransportMode::Radiance).as_dvec3()
                * cos
                * self.spread(i + 1, i);
        }
        let importance = f64::from(context.camera.pdf_w(-self.dirs[k - 1]));
        Some(value * importance * self.lens_spread(context))
    }
}
