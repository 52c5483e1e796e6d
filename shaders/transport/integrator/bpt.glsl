// Twin of src/transport/integrator/bpt.rs.
#ifndef TRANSPORT_INTEGRATOR_BPT_GLSL
#define TRANSPORT_INTEGRATOR_BPT_GLSL

#include "scene.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/camera/lens.glsl"
#include "transport/contribution.glsl"
#include "transport/flight.glsl"
#include "transport/light/mod.glsl"
#include "transport/mod.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"
#include "transport/surface.glsl"

// One sample of one pixel.
void bpt_sample(uvec2 pixel, inout Sampler numbers) {
    Ray ray = camera_sample_ray(pixel, numbers);
    Chance chance = chance_new(numbers);
    Flight flight = flight_of_camera(ray, chance_emission(chance));
    vec3 throughput = vec3(1.0);
    // Undoes the scaling of radiance by refraction, so that roulette judges what the path will bring back.
    float eta_scale = 1.0;
    Overhang over = NO_OVERHANG;
    for (uint depth = 1u; depth <= job.max_depth; ++depth) {
        Hit hit;
        bool met = trace_closest(ray, INFINITY, hit);
        vec3 wo = -ray.dir;
        Surface surface;
        vec3 radiance;
        Length length;
        if (met) {
            // The last edge finds light or nothing.
            if (depth == job.max_depth && emitter_of(hit.primitive, hit.instance) == NONE) {
                break;
            }
            surface = flight_arrive(flight, ray, hit, chance);
            length = stamp_arrived(flight.stamp);
            if (over.present && !overhang_reaches(over, surface.position)) {
                break;
            }
            radiance = surface_emitted(surface, wo);
        } else {
            radiance = lights_environment(ray.dir);
            length = flight_escaped(flight, ray.dir);
        }
        if (radiance != vec3(0.0)) {
            vec3 value = throughput * radiance;
            sink(Contribution(pixel, value, value, 0u, depth + 1u, length));
        }
        if (!met || depth == job.max_depth || surface_ends(surface)) {
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
        flight_leave(flight, surface.position, s.eta);
        ray = surface_spawn(surface, s.wi);
        over = overhang_into(surface, s.wi);
    }
}

#endif
