//! `own_technique`: path tracing that is connected to a light at some vertices only.
//!
//! A path starts at the camera and continues by sampling the BSDF. At every vertex, with the
//! probability `connect`, it is also connected to a sampled point of a light; the light of such
//! connections is divided by that probability. Light that the path hits by itself can be found both
//! ways, so both are weighted by the balance heuristic [Veach 1995], which makes the picture the
//! same for any value of `connect`: more connections have less noise and take more time.
//!
//! Everything is written for many paths at a time, one in each lane of a SIMD vector `R`: `R::Vec3`
//! is a vector of vectors, and `R::Mask` tells in which lanes something holds. One path at a time is
//! the case `R = f32`, in which a mask is a `bool`.

use lumbre::OwnTechnique;
use lumbre_light::prelude::*;

/// The parameter: a key of the render table, and so an axis of experiments if a script wants it.
pub const CONNECT: Field = Field::optional(
    "connect",
    Ty::Num {
        min: 0.01,
        max: 1.0,
    },
    "0.5",
    "probability with which a vertex is connected to a light",
);

/// Default of [`CONNECT`].
const CONNECT_DEFAULT: f32 = 0.5;

/// What the program has to know about the technique.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "own_technique",
    long_name: "path tracing with some connections",
    // Part of every run's identity. Raise it whenever pictures change, so that no old run is reused.
    revision: 1,
    doc: "Paths start at the camera and are connected to a light at some vertices.",
    params: Table {
        name: "OwnTechniqueParams",
        doc: "Parameters of `own_technique`.",
        fields: &[CONNECT],
    },
    // Whether a sample can add light to other pixels than its own.
    splats: false,
    // For a technique that is not unbiased: the source of its bias, in a clause.
    bias: None,
    // For a technique whose samples share data, such as photons: how they are computed.
    sharing: None,
    sample: camera_path::sample::<Steps>,
};

/// The technique, for [`lumbre::main_with`].
pub const TECHNIQUE: OwnTechnique = OwnTechnique::camera_paths::<Steps>(ROW);

/// The steps of the technique.
pub struct Steps;

impl CameraPaths for Steps {
    /// Handles paths whose edge number `edge` ends on a surface. Returns the lanes that go on.
    #[inline(always)]
    fn scatter<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        arrival: &Arrival<R, N>,
        path: &mut Path<R>,
        mut lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) -> R::Mask {
        let surface = arrival.surface(context.scene);
        if let Some(terminator) = &path.terminator {
            lanes = lanes & terminator.allows(surface.position);
        }
        // Optical lengths are there only if the film has a time axis.
        let counts = edge_counts(context, edge);
        let optical = path.arrive(context, counts, arrival, &surface, lanes);
        let connect = context.number(&CONNECT, CONNECT_DEFAULT);

        // 1. The path hit a light. Connections from the last vertex could have found it too.
        if arrival.class.surface.emits {
            let radiance = surface.emitted(&context.scene.textures, -path.state.dir);
            let lit = lanes & is_lit::<R>(radiance);
            let lights = context
                .lights
                .with_indices::<R, N>(R::store_words(surface.emitter), lit);
            let pdf_w: R =
                lights.pdf_direct_w(path.state.last, surface.position, surface.n_geometric);
            let weight = hit_weight(path, pdf_w * R::splat(connect));
            let length = optical
                .as_ref()
                .map_or(R::Double::splat(0.0), OpticalLength::arrival);
            path.add_hit_light(edge, radiance, weight, length, lit, sink);
        }
        lanes = lanes & !surface.ends_paths();
        if edge == context.max_depth || !lanes.any() {
            return R::Mask::default();
        }

        // 2. Connect some of the vertices to a light.
        let parameters = arrival.parameters(context.scene, &surface);
        let bsdf = arrival.bsdf(context.classes, &surface, parameters.as_ref());
        let out = bsdf.outgoing(-path.state.dir);
        let chosen = path.sampler.next_1d().lt(R::splat(connect));
        let connected = lanes & bsdf.has_density() & chosen;
        if connected.any() {
            let mut vertex = Vertex {
                edge,
                connect,
                surface: &surface,
                bsdf: &bsdf,
                out: &out,
                optical: optical.as_ref(),
            };
            vertex.connect(context, path, connected, sink);
            // Once more from the lifted points of surfaces with an offset against the terminator.
            if let Some(lifted) = surface.lifted_once() {
                vertex.surface = &lifted;
                vertex.connect(context, path, connected & lifted.lifted_lanes(), sink);
            }
        }

        // 3. Continue in a direction of the BSDF.
        let [choice, u, v] = path.sampler.next_three();
        let (sampled, s, _) = bsdf.samples::<false>(&out, choice, [u, v], TransportMode::Radiance);
        path.continue_from(context, edge, &surface, optical, &s, lanes & sampled)
    }

    /// Handles paths whose edge number `edge` left the scene.
    #[inline(always)]
    fn escape<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        path: &Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) {
        let dir = path.state.dir;
        let connect = R::splat(context.number(&CONNECT, CONNECT_DEFAULT));
        let radiance = context.lights.environment::<R::Vec3, N>(dir);
        let lit = lanes & is_lit::<R>(radiance);
        if !lit.any() {
            return;
        }
        let pdf_w = context.lights.pdf_environment_w::<R::Vec3, N>(dir);
        let weight = hit_weight(path, pdf_w * connect);
        let length = path.escape_length(context, edge);
        path.add_hit_light(edge, radiance, weight, length, lit, sink);
    }
}

/// Returns the lanes in which there is light.
#[inline(always)]
fn is_lit<R: Real>(radiance: R::Vec3) -> R::Mask {
    let brightest = radiance.x().max(radiance.y()).max(radiance.z());
    brightest.gt(R::splat(0.0))
}

/// Returns the weight of light that paths hit, which connections find with the density `light_w` per
/// solid angle. After a Dirac lobe, and from the camera, no connection can find it.
#[inline(always)]
fn hit_weight<R: Real>(path: &Path<R>, light_w: R) -> R {
    let own = path.state.last_pdf_w;
    R::select(path.is_specular(), R::splat(1.0), own / (own + light_w))
}

/// Vertices at the end of edge number `edge`.
struct Vertex<'a, R: Real, const N: usize> {
    edge: u32,
    connect: f32,
    surface: &'a Surface<'a, R, N>,
    bsdf: &'a Bsdf<R>,
    out: &'a Outgoing<R>,
    optical: Option<&'a OpticalLength<R>>,
}

impl<R: Lanes<N>, const N: usize> Vertex<'_, R, N> {
    /// Connects the vertices in the given lanes to sampled points of lights.
    #[inline(always)]
    fn connect(
        &self,
        context: &Context,
        path: &mut Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) {
        let before = path.sampler;
        let [choice, u, v] = path.sampler.next_three();
        // Lanes without a connection keep their numbers: a sample must not depend on other lanes.
        path.sampler.keep(lanes, &before);
        let position = self.surface.position;
        let lights = context.lights.select_for(position, choice, lanes);
        let mut light = lights.sample_direct_one(context.scene, position, [u, v]);
        light.pdf_w = light.pdf_w * lights.chosen;
        let mut lanes = lanes & light.arrives() & self.out.same_side;
        if let Some(offset) = &self.surface.terminator {
            lanes = lanes & !offset.excludes(&light);
        }

        let mode = TransportMode::Radiance;
        let value = self.bsdf.values::<false>(self.out, light.wi, mode, lanes);
        let cos = light.wi.dot(self.surface.n_shading).abs();
        // The density of this way of finding the light, times the probability of a connection.
        let own = light.pdf_w * R::splat(self.connect);
        let radiance = value.f * cos * light.radiance / own;
        let lit = lanes & is_lit::<R>(radiance);
        if !lit.any() {
            return;
        }
        // Only connections can find the light of points and of single directions.
        let weight = R::select(light.delta, R::splat(1.0), own / (own + value.pdf_w));
        let ray = ShadowRay::between(
            self.surface.end(),
            light.point.end(),
            light.wi,
            light.is_infinite(),
        );
        let length = match self.optical {
            None => R::Double::splat(0.0),
            Some(optical) => {
                let ratio = self.bsdf.index_ratio(self.out.wo, light.wi);
                optical.direct_arrival(context, position, &light, ratio)
            }
        };
        let found = PathLight {
            unweighted: path.state.throughput * radiance,
            weight,
            s: 1,
            t: self.edge + 1,
            length,
        };
        sink.add_unless_occluded(lit, &ray, &found);
    }
}
