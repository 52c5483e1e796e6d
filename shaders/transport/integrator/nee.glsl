// Twin of src/transport/integrator/nee.rs.
#ifndef TRANSPORT_INTEGRATOR_NEE_GLSL
#define TRANSPORT_INTEGRATOR_NEE_GLSL

#include "scene.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/camera/lens.glsl"
#include "transport/contribution.glsl"
#include "transport/flight.glsl"
#include "transport/light/mod.glsl"
#include "transport/mis.glsl"
#include "transport/mod.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"
#include "transport/surface.glsl"
#include "transport/vertex.glsl"

// The event that sent a path on its way, as far as light sampling could have done the same.
struct Last {
    bool present;
    vec3 from;
    float pdf_w;
};

// The weight of light that a path met by chance, given the density per solid angle with which light sampling finds it.
float weight_of_hit(Last last, float pdf_w) {
    if (!last.present) {
        return 1.0;
    }
    return job.mis == NONE ? 0.0 : heuristic_weight(job.mis, last.pdf_w, pdf_w);
}

// What light sampling finds from a surface: from its base and, where it has an overhang, from the crest; from one light or
// from each in turn.
void nee_connect(
    Surface base, Bsdf bsdf, Stamp stamp, vec3 wo, vec3 throughput, uvec2 pixel, uint depth, inout Sampler numbers
) {
    uint lights = job.all_lights != 0u ? job.light_count : 1u;
    uint rounds = base.overhang.present ? 2u * lights : lights;
    for (uint i = 0u; i < rounds; ++i) {
        Surface surface = base;
        if (i >= lights) {
            surface_raised(base, surface);
        }
        uint light = i >= lights ? i - lights : i;
        float probability = 1.0;
        if (job.all_lights == 0u) {
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
        vec3 radiance = value.f * abs(dot(direct.wi, surface.n_shading)) * direct.radiance / direct.pdf_w;
        if (overhang_refuses(surface.overhang, direct) || radiance == vec3(0.0) || direct.pdf_w <= 0.0) {
            continue;
        }
        Ray ray;
        float distance;
        if (shadow_ray(surface.position, surface.n_geometric, direct, ray, distance) && trace_occluded(ray, distance)) {
            continue;
        }
        bool weighted = job.mis != NONE && !direct.delta;
        float weight = weighted ? heuristic_weight(job.mis, direct.pdf_w, value.pdf_w) : 1.0;
        vec3 unweighted = throughput * radiance;
        Length length = flight_of_direct(stamp, bsdf, wo, surface.position, direct.wi, direct.distance);
        sink(Contribution(pixel, unweighted * weight, unweighted, 1u, depth + 1u, length));
    }
}

// One sample of one pixel.
void nee_sample(uvec2 pixel, inout Sampler numbers) {
    Ray ray = camera_sample_ray(pixel, numbers);
    Chance chance = chance_new(numbers);
    Flight flight = flight_of_camera(ray, chance_emission(chance));
    vec3 throughput = vec3(1.0);
    // Undoes the scaling of radiance by refraction, so that roulette judges what the path will bring back.
    float eta_scale = 1.0;
    Last last = Last(false, vec3(0.0), 0.0);
    Overhang over = NO_OVERHANG;
    for (uint depth = 1u; depth <= job.max_depth; ++depth) {
        Hit hit;
        bool met = trace_closest(ray, INFINITY, hit);
        vec3 wo = -ray.dir;
        Surface surface;
        vec3 radiance;
        Length length;
        float pdf_w = 0.0;
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
            if (radiance != vec3(0.0)) {
                pdf_w = lights_pdf_direct_one_w(last.from, surface.emitter, surface.position, surface.n_geometric);
                pdf_w *= job.all_lights != 0u ? 1.0 : lights_pdf_choice(surface.emitter);
            }
        } else {
            radiance = lights_environment(ray.dir);
            length = flight_escaped(flight, ray.dir);
            if (radiance != vec3(0.0)) {
                pdf_w = lights_pdf_environment_one_w(ray.dir);
                pdf_w *= job.all_lights != 0u ? 1.0 : lights_pdf_choice(job.light_first.z);
            }
        }
        if (radiance != vec3(0.0)) {
            vec3 unweighted = throughput * radiance;
            sink(Contribution(pixel, unweighted * weight_of_hit(last, pdf_w), unweighted, 0u, depth + 1u, length));
        }
        if (!met || depth == job.max_depth || surface_ends(surface)) {
            break;
        }
        Bsdf bsdf = bsdf_new(surface);
        if (bsdf_has_density(bsdf)) {
            nee_connect(surface, bsdf, flight.stamp, wo, throughput, pixel, depth, numbers);
        }
        float choice = next_1d(numbers);
        BsdfSample s;
        if (!bsdf_sample(bsdf, wo, choice, next_2d(numbers), RADIANCE, s)) {
            break;
        }
        throughput *= s.weight;
        eta_scale *= s.eta * s.eta;
        over = overhang_into(surface, s.wi);
        last = Last(!s.delta, over.present ? over.crest : surface.position, s.pdf_w);
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
    }
}

#endif
