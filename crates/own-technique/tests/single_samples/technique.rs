//! Path tracing with next event estimation, as a technique that computes its samples itself.

use lumbre::OwnTechnique;
use lumbre_light::prelude::*;

/// The technique, for [`lumbre::main_with`].
pub const TECHNIQUE: OwnTechnique = OwnTechnique::single_samples(IntegratorRow {
    name: "single_nee",
    long_name: "path tracing with single samples",
    revision: 1,
    doc: "Paths start at the camera and are connected to a light at every vertex.",
    params: Table {
        name: "SingleNeeParams",
        doc: "Parameters of `single_nee`.",
        fields: &[],
    },
    splats: false,
    bias: None,
    sharing: None,
    sample,
});

/// Computes one sample of one pixel.
fn sample(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    let mut add = |unweighted: Vec3, weight: f32, [s, t]: [u32; 2], length: f64| {
        let value = unweighted * weight;
        sink(Contribution {
            pixel,
            value,
            unweighted,
            s,
            t,
            length,
        });
    };
    let mut path = Path::<f32>::from_camera(context, pixel.map(|n| n as f32), *sampler);
    for edge in 1..=context.max_depth {
        if !follow(context, edge, &mut path, &mut add) {
            return;
        }
    }
}

/// Follows edge number `edge`, and samples the next one. Returns whether the path continues.
fn follow(
    context: &Context,
    edge: u32,
    path: &mut Path<f32>,
    add: &mut impl FnMut(Vec3, f32, [u32; 2], f64),
) -> bool {
    let (lights, dir) = (context.lights, path.state.dir);
    let ray = Ray {
        origin: path.state.origin,
        dir,
    };
    let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else {
        // 1. Light of the environment, weighted against connections.
        let light = path.state.throughput * lights.environment::<Vec3, 1>(dir);
        let weight = hit_weight(path, lights.pdf_environment_w::<Vec3, 1>(dir));
        let length = path.escape_length(context, edge);
        add(light, weight, [0, edge + 1], length);
        return false;
    };
    let hit = HitState::new(context.scene, &ray, &hit, || path.next_auxiliary());
    let class = &context.classes[context.classes.index_of(context.scene, &hit)];
    let arrival = Arrival::<f32, 1>::new(class, ray, &hit);
    let surface = arrival.surface(context.scene);
    // Optical lengths are there only if the film has a time axis.
    let counts = edge_counts(context, edge);
    let optical = path.arrive(context, counts, &arrival, &surface, true);
    if class.surface.emits {
        // 2. Light of the surface, weighted against connections.
        let light = path.state.throughput * surface.emitted(&context.scene.textures, -dir);
        let (last, at, n) = (path.state.last, surface.position, surface.n_geometric);
        let weight = hit_weight(path, lights.pdf_direct_w(last, surface.emitter, at, n));
        let length = optical.as_ref().map_or(0.0, OpticalLength::arrival);
        add(light, weight, [0, edge + 1], length);
    }
    if edge == context.max_depth || surface.ends_paths() {
        return false;
    }
    let parameters = arrival.parameters(context.scene, &surface);
    let bsdf = arrival.bsdf(context.classes, &surface, parameters.as_ref());
    let out = bsdf.outgoing(-dir);
    // 3. A connection, unless the BSDF has Dirac lobes alone.
    if bsdf.has_density() {
        let numbers = path.sampler.next_three();
        let found = connect(context, &surface, &bsdf, &out, optical, numbers);
        if let Some((radiance, weight, length)) = found {
            add(
                path.state.throughput * radiance,
                weight,
                [1, edge + 1],
                length,
            );
        }
    }
    // 4. The next edge.
    let [choice, u, v] = path.sampler.next_three();
    let (sampled, s, _) = bsdf.samples::<false>(&out, choice, [u, v], TransportMode::Radiance);
    path.continue_from(context, edge, &surface, optical, &s, sampled)
}

/// Connects a vertex to a point of a light. Returns the light that arrives, divided by the density,
/// its weight, and the optical length of the path; `None` if no light arrives.
fn connect(
    context: &Context,
    surface: &Surface<f32, 1>,
    bsdf: &Bsdf<f32>,
    out: &Outgoing<f32>,
    optical: Option<OpticalLength<f32>>,
    [choice, u, v]: [f32; 3],
) -> Option<(Vec3, f32, f64)> {
    let (lights, from) = (context.lights, surface.position);
    let light = lights.sample_direct(context.scene, from, choice, [u, v])?;
    let value = bsdf.values::<false>(out, light.wi, TransportMode::Radiance, true);
    let cos = light.wi.dot(surface.n_shading).abs();
    let radiance = value.f * cos * light.radiance / light.pdf_w;
    let infinite = light.is_infinite();
    let ray = ShadowRay::between(surface.end(), light.point.end(), light.wi, infinite);
    if !out.same_side || radiance == Vec3::ZERO || !unoccluded(context, &ray) {
        return None;
    }
    // No path can hit the light of points and of single directions.
    let weight = if light.delta {
        1.0
    } else {
        light.pdf_w / (light.pdf_w + value.pdf_w)
    };
    let length = optical.map_or(0.0, |optical| {
        let ratio = bsdf.index_ratio(out.wo, light.wi);
        optical.direct_arrival(context, from, &light, ratio)
    });
    Some((radiance, weight, length))
}

/// Returns the weight of light that a path hits, which connections find with the density `pdf_w`.
/// After a Dirac lobe, and from the camera, no connection can find it.
fn hit_weight(path: &Path<f32>, pdf_w: f32) -> f32 {
    if path.is_specular() {
        1.0
    } else {
        path.state.last_pdf_w / (path.state.last_pdf_w + pdf_w)
    }
}
