// Twin of crates/lumbre-light/src/transport/integrator/bpt.rs.
#ifndef TRANSPORT_INTEGRATOR_BPT_GLSL
#define TRANSPORT_INTEGRATOR_BPT_GLSL

#include "scene.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/camera/lens.glsl"
#include "transport/contribution.glsl"
#include "transport/path_time.glsl"
#include "transport/light/mod.glsl"
#include "transport/mod.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"
#include "transport/surface.glsl"

// Computes one sample of one pixel.
void bpt_sample(uvec2 pixel, inout Sampler numbers) {
    Ray ray = camera_sample_ray(pixel, numbers);
    AuxRng aux_rng = aux_rng_new(numbers);
    PathTime path_time = path_time_from_camera(ray, aux_rng_emission(aux_rng));
    vec3 throughput = vec3(1.0);
    // Undoes the scaling of radiance by refraction, so that roulette judges the expected
    // contribution.
    float eta_scale = 1.0;
    TerminatorOffset terminator = NO_TERMINATOR_OFFSET;
    for (uint depth = 1u; depth <= job.max_depth; ++depth) {
        Hit hit;
        bool met = trace_closest(ray, INFINITY, hit);
        vec3 wo = -ray.dir;
        Surface surface;
        vec3 radiance;
        Length length;
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
        } else {
            radiance = lights_environment(ray.dir);
            length = path_time_escape_length(path_time, ray.dir);
        }
        if (radiance != vec3(0.0)) {
            vec3 value = throughput * radiance;
            sink(Contribution(pixel, value, value, 0u, depth + 1u, length));
        }
        if (!met || depth == job.max_depth || surface_ends_paths(surface)) {
            break;
        }
        Bsdf bsdf = bsdf_new(surface);
        float choice = next_1d(numbers);
        BsdfSample s;
        if (!bsdf_sample(bsdf, wo, choice, next_2d(numbers), RADIANCE, s)) {
            break;
        }
        throughput *= s.weight;
        eta_scale *= s.eta * s.eta;
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
        terminator = terminator_into(surface, s.wi);
    }
}

#endif
