// Twin of crates/lumbre-light/src/transport/integrator/nee.rs.
#ifndef TRANSPORT_INTEGRATOR_NEE_GLSL
#define TRANSPORT_INTEGRATOR_NEE_GLSL

#include "transport/integrator/camera_path/single.glsl"
#include "transport/mis.glsl"

// Returns the weight of light that was found from a last event that light sampling could replace, given
// its density per solid angle with which it samples this light.
float hit_weight(LastScatter last, float pdf_w) {
    return job.mis == NONE ? 0.0 : heuristic_weight(job.mis, last.pdf_w, pdf_w);
}

float technique_hit_weight(LastScatter last, Surface surface) {
    if (last.pdf_w < 0.0) {
        return 1.0;
    }
    float choice = ALL_LIGHTS ? 1.0 : lights_pdf_choice(surface.emitter);
    float pdf_w = lights_pdf_direct_one_w(
        last.from, surface.emitter, surface.position, surface.n_geometric
    );
    return hit_weight(last, pdf_w * choice);
}

float technique_escape_weight(LastScatter last, vec3 dir) {
    if (last.pdf_w < 0.0) {
        return 1.0;
    }
    float choice = ALL_LIGHTS ? 1.0 : lights_pdf_choice(job.light_first.z);
    return hit_weight(last, lights_pdf_environment_one_w(dir) * choice);
}

// Contributes sampled light at a surface: from its base and, if it has a terminator offset, from
// its lifted point; from one light or from each in turn.
void technique_connect(
    uvec2 pixel, CameraPath path, vec3 wo, Surface base, Bsdf bsdf, inout Sampler numbers
) {
    if (!bsdf_has_density(bsdf)) {
        return;
    }
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
        vec3 unweighted = path.throughput * radiance;
        Length length = path_time_direct_length(
            path.time.optical, bsdf, wo, surface.position, direct.wi, direct.distance
        );
        sink(Contribution(pixel, unweighted * weight, unweighted, 1u, path.edge + 1u, length));
    }
}

#endif
