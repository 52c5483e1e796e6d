// Twin of crates/lumbre-light/src/transport/integrator/nee.rs.
#ifndef TRANSPORT_INTEGRATOR_NEE_GLSL
#define TRANSPORT_INTEGRATOR_NEE_GLSL

#include "scene.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/camera/lens.glsl"
#include "transport/contribution.glsl"
#include "transport/path_time.glsl"
#include "transport/light/mod.glsl"
#include "transport/mis.glsl"
#include "transport/mod.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"
#include "transport/surface.glsl"
#include "transport/vertex.glsl"

// The last event of a path: where it happened, and its density per solid angle, or NO_DENSITY if light
// sampling could not have replaced it. A `bool` that is false at first has no place here: NVIDIA's
// driver 580.159 compiles it wrongly for ray generation (docs/notes/devices.md).
struct LastScatter {
    vec3 from;
    float pdf_w;
};

const float NO_DENSITY = -1.0;

// Returns the weight of light that a path hit, given the density per solid angle with which light
// sampling samples it.
float hit_weight(LastScatter last, float pdf_w) {
    if (last.pdf_w < 0.0) {
        return 1.0;
    }
    return job.mis == NONE ? 0.0 : heuristic_weight(job.mis, last.pdf_w, pdf_w);
}

// Contributes sampled light at a surface: from its base and, if it has a terminator offset, from
// its lifted point; from one light or from each in turn.
void nee_connect(
    Surface base, Bsdf bsdf, OpticalLength optical, vec3 wo, vec3 throughput, uvec2 pixel,
    uint depth, inout Sampler numbers
) {
    uint lights = ALL_LIGHTS ? job.light_count : 1u;
    uint rounds = base.terminator.present ? 2u * lights : lights;
    for (uint i = 0u; i < rounds; ++i) {
        Surface surface = base;
        if (i >= lights) {
            surface_lifted(base, surface);
        }
        uint light = i >= lights ? i - lights : i;
        float probability = 1.0;
        if (!ALL_LIGHTS) {
            float choice = next_1d(numbers);
            light = job.alias_shift != NONE ? alias_sample(choice, probability) : NONE;
        }
        vec2 u = next_2d(numbers);
        DirectSample direct;
        if (light == NONE || !lights_sample_direct_from(light, surface.position, u, direct)) {
            continue;
        }
        direct.pdf_w *= probability;
        BsdfValue value = bsdf_evaluate(bsdf, wo, direct.wi, RADIANCE);
        vec3 radiance = value.f * abs(dot(direct.wi, surface.n_shading)) * direct.radiance
            / direct.pdf_w;
        if (terminator_offset_excludes(surface.terminator, direct)
            || radiance == vec3(0.0)
            || direct.pdf_w <= 0.0) {
            continue;
        }
        Ray ray;
        float distance;
        if (shadow_ray(surface_end(surface), direct, ray, distance)
            && trace_occluded(ray, distance)) {
            continue;
        }
        bool weighted = job.mis != NONE && !direct.delta;
        float weight = weighted ? heuristic_weight(job.mis, direct.pdf_w, value.pdf_w) : 1.0;
        vec3 unweighted = throughput * radiance;
        Length length = path_time_direct_length(
            optical, bsdf, wo, surface.position, direct.wi, direct.distance
        );
        sink(Contribution(pixel, unweighted * weight, unweighted, 1u, depth + 1u, length));
    }
}

// Computes one sample of one pixel.
void nee_sample(uvec2 pixel, inout Sampler numbers) {
    Ray ray = camera_sample_ray(pixel, numbers);
    AuxRng aux_rng = aux_rng_new(numbers);
    PathTime path_time = path_time_from_camera(ray, aux_rng_emission(aux_rng));
    vec3 throughput = vec3(1.0);
    // Undoes the scaling of radiance by refraction, so that roulette judges the expected
    // contribution.
    float eta_scale = 1.0;
    LastScatter last = LastScatter(vec3(0.0), NO_DENSITY);
    TerminatorOffset terminator = NO_TERMINATOR_OFFSET;
    for (uint depth = 1u; depth <= job.max_depth; ++depth) {
        Hit hit;
        bool met = trace_closest(ray, INFINITY, hit);
        vec3 wo = -ray.dir;
        Surface surface;
        vec3 radiance;
        Length length;
        float pdf_w = 0.0;
        if (met) {
            // The last edge can only find light.
            if (depth == job.max_depth && emitter_of(hit.primitive, hit.instance) == NONE) {
                break;
            }
            surface = path_time_arrive(path_time, ray, hit, aux_rng);
            length = optical_length_arrival(path_time.optical);
            if (terminator.present && !terminator_offset_has_below(terminator, surface.position)) {
                break;
            }
            radiance = surface_emitted(surface, wo);
            if (radiance != vec3(0.0)) {
                pdf_w = lights_pdf_direct_one_w(
                    last.from, surface.emitter, surface.position, surface.n_geometric
                );
                pdf_w *= ALL_LIGHTS ? 1.0 : lights_pdf_choice(surface.emitter);
            }
        } else {
            radiance = lights_environment(ray.dir);
            length = path_time_escape_length(path_time, ray.dir);
            if (radiance != vec3(0.0)) {
                pdf_w = lights_pdf_environment_one_w(ray.dir);
                pdf_w *= ALL_LIGHTS ? 1.0 : lights_pdf_choice(job.light_first.z);
            }
        }
        if (radiance != vec3(0.0)) {
            vec3 unweighted = throughput * radiance;
            sink(
                Contribution(
                    pixel, unweighted * hit_weight(last, pdf_w), unweighted, 0u, depth + 1u, length
                )
            );
        }
        if (!met || depth == job.max_depth || surface_ends_paths(surface)) {
            break;
        }
        Bsdf bsdf = bsdf_new(surface);
        if (bsdf_has_density(bsdf)) {
            nee_connect(surface, bsdf, path_time.optical, wo, throughput, pixel, depth, numbers);
        }
        float choice = next_1d(numbers);
        BsdfSample s;
        if (!bsdf_sample(bsdf, wo, choice, next_2d(numbers), RADIANCE, s)) {
            break;
        }
        throughput *= s.weight;
        eta_scale *= s.eta * s.eta;
        terminator = terminator_into(surface, s.wi);
        last = LastScatter(
            terminator.present ? terminator.lifted_point : surface.position,
            s.delta ? NO_DENSITY : s.pdf_w
        );
        if (depth >= job.rr_start) {
            float survival = min(max_element(throughput) * eta_scale, MAX_SURVIVAL);
            if (next_1d(numbers) >= survival) {
                break;
            }
            throughput /= survival;
        }
        if (throughput == vec3(0.0)) {
            break;
        }
        path_time_scatter(path_time, surface.position, s.eta);
        ray = surface_spawn(surface, s.wi);
    }
}

#endif
