// Twin of crates/lumbre-light/src/transport/path_time.rs. With TIMES the optical length is tracked; with PARTS the
// scene has composed or delayed materials.
#ifndef TRANSPORT_PATH_TIME_GLSL
#define TRANSPORT_PATH_TIME_GLSL

#include "scene.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/contribution.glsl"
#include "transport/light/mod.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"
#include "transport/surface.glsl"
#ifdef EXTENDED
#include "transport/delay/profile.glsl"
#endif

// The auxiliary random numbers of one sample, for parts and delays.
struct AuxRng {
    Independent numbers;
};

// Starts the numbers of a sample.
AuxRng aux_rng_new(Sampler numbers) {
    AuxRng aux_rng;
    if (TIMES || PARTS) {
        aux_rng.numbers = sampler_auxiliary(numbers);
    }
    return aux_rng;
}

// Samples the time at which the light of this sample was emitted.
float aux_rng_emission(inout AuxRng aux_rng) {
#ifdef EXTENDED
    if (TIMES && job.time_emission != NONE) {
        return profile_sample(
            delay_profile_at(job.time_emission, Uv(0.0)), independent_next_1d(aux_rng.numbers)
        );
    }
#endif
    return 0.0;
}

// The optical length of a path up to a vertex; fields as in Rust.
struct OpticalLength {
    float path;
    float delays;
    float delay;
    float index;
};

// Returns the length at which light arrives at this vertex, or starts there.
Length optical_length_arrival(OpticalLength s) {
    return Length(s.path) + Length(s.delays);
}

// Returns the length after this vertex's delay and a segment of `distance` in a medium whose index
// has this ratio to that of the last segment.
Length optical_length_after_segment(OpticalLength s, float ratio, float distance) {
    return optical_length_arrival(s) + Length(s.delay) + Length(s.index * ratio * distance);
}

// Returns the length of a light subpath up to this vertex, delay included, for a path that leaves
// it through a medium whose index has this ratio to that of the last segment and is `index`
// relative to the camera.
Length optical_length_from_light(OpticalLength s, float ratio, float index) {
    float own = s.index * ratio;
    return Length(s.path * (index / own)) + Length(s.delays) + Length(s.delay);
}

// Tracks the optical length of a path while it is traced; fields as in Rust.
struct PathTime {
    OpticalLength optical;
    vec3 from;
    bool uncounted;
    uint part;
};

// Starts a camera path whose light was emitted at `emitted`.
PathTime path_time_from_camera(Ray ray, float emitted) {
    return PathTime(
        OpticalLength(0.0, emitted, 0.0, job.time_medium), ray.origin, job.time_camera == 0u, NONE
    );
}

// Starts a light path at a point of a light.
PathTime path_time_from_light(vec3 from) {
    return PathTime(OpticalLength(0.0, 0.0, 0.0, 1.0), from, false, NONE);
}

// Returns the surface that a ray of this path hit; for a composed material, one part of it.
Surface path_time_arrive(inout PathTime f, Ray ray, Hit hit, inout AuxRng aux_rng) {
    uint row = material_of(hit.primitive, hit.instance);
    uvec2 parts = PARTS ? materials[row].parts : uvec2(0u);
    f.part = NONE;
    if (PARTS && parts.y > 0u) {
        uint chosen = 0u;
        if (parts.y > 1u) {
            float u = independent_next_1d(aux_rng.numbers);
            while (chosen + 1u < parts.y && material_parts[parts.x + chosen].upto <= u) {
                chosen += 1u;
            }
        }
        f.part = parts.x + chosen;
        row = material_parts[f.part].material;
    }
    Surface surface = surface_with_material(ray, hit, row);
    if (TIMES) {
        if (!f.uncounted) {
            f.optical.path += f.optical.index * distance(f.from, surface.position);
        }
        f.uncounted = false;
        f.optical.delay = 0.0;
#ifdef EXTENDED
        if (PARTS && f.part != NONE) {
            f.optical.delay = delay_sample_all(
                material_parts[f.part].profiles, surface.uv, aux_rng.numbers
            );
        }
#endif
    }
    return surface;
}

// Continues the path from `from` after an event that crossed the index ratio `eta`.
void path_time_scatter(inout PathTime f, vec3 from, float eta) {
    if (TIMES) {
        f.optical.delays += f.optical.delay;
        f.optical.delay = 0.0;
        f.optical.index *= eta;
        f.from = from;
    }
}

// Returns the length of a path that left the scene in direction `dir`. Zero without a time axis.
Length path_time_escape_length(PathTime f, vec3 dir) {
    if (!TIMES) {
        return Length(0.0);
    }
    Length length = optical_length_arrival(f.optical);
    return f.uncounted
        ? length
        : length + Length(f.optical.index * lights_front_distance(f.from, dir));
}

// Returns the length of a path whose vertex is lit by light sampling from direction `wi` at
// `distance`; an infinite distance stands for the wave front where it touches the bounding sphere
// of all surfaces. Zero without a time axis.
Length path_time_direct_length(
    OpticalLength optical, Bsdf b, vec3 wo, vec3 from, vec3 wi, float distance
) {
    if (!TIMES) {
        return Length(0.0);
    }
    return optical_length_after_segment(
        optical, bsdf_index_ratio(b, wo, wi),
        is_finite(distance) ? distance : lights_front_distance(from, wi)
    );
}

#endif
