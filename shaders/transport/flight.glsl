// Twin of src/transport/flight.rs. With TIMES paths are timed; with PARTS a scene has composed or delayed materials. Without
// either nothing of it is left in a shader.
#ifndef TRANSPORT_FLIGHT_GLSL
#define TRANSPORT_FLIGHT_GLSL

#include "scene.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/contribution.glsl"
#include "transport/light/mod.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"
#include "transport/surface.glsl"
#ifdef TIMES
#include "transport/delay/profile.glsl"
#endif

// The random numbers of parts and delays of one sample.
struct Chance {
    Independent numbers;
};

// Those of a sample.
Chance chance_new(Sampler numbers) {
    Chance chance;
#if defined(TIMES) || defined(PARTS)
    chance.numbers = sampler_aside(numbers);
#endif
    return chance;
}

// When the light of this sample was emitted.
float chance_emission(inout Chance chance) {
#ifdef TIMES
    if (job.time_emission != NONE) {
        return profile_sample(delay_at(job.time_emission, vec2(0.0)), independent_next_1d(chance.numbers));
    }
#endif
    return 0.0;
}

// When a path is at a vertex; fields as in Rust.
struct Stamp {
    float path;
    float late;
    float delay;
    float index;
};

// When light arrives that comes to this vertex, or starts there.
Length stamp_arrived(Stamp s) {
    return Length(s.path) + Length(s.late);
}

// When light leaves that this vertex gives back, and goes on over `distance` through a medium whose index has this ratio to
// that through which the path came.
Length stamp_onward(Stamp s, float ratio, float distance) {
    return stamp_arrived(s) + Length(s.delay) + Length(s.index * ratio * distance);
}

// What of this vertex of a light path counts in a path that leaves it through a medium of this ratio, whose index is `index`
// as the camera's side knows it.
Length stamp_of_light(Stamp s, float ratio, float index) {
    float own = s.index * ratio;
    return Length(s.path * (index / own)) + Length(s.late) + Length(s.delay);
}

// The clock of a path while it is traced; fields as in Rust.
struct Flight {
    Stamp stamp;
    vec3 from;
    bool free;
    uint part;
};

// A path from the camera, whose light was emitted at `emitted`.
Flight flight_of_camera(Ray ray, float emitted) {
    return Flight(Stamp(0.0, emitted, 0.0, job.time_medium), ray.origin, job.time_camera == 0u, NONE);
}

// A path from a point of a light.
Flight flight_of_light(vec3 from) {
    return Flight(Stamp(0.0, 0.0, 0.0, 1.0), from, false, NONE);
}

// The surface that a ray of this path has met, as one part of its material if that is composed.
Surface flight_arrive(inout Flight f, Ray ray, Hit hit, inout Chance chance) {
    uint row = material_of(hit.primitive, hit.instance);
#ifdef PARTS
    uvec2 parts = materials[row].parts;
    f.part = NONE;
    if (parts.y > 0u) {
        uint chosen = 0u;
        if (parts.y > 1u) {
            float u = independent_next_1d(chance.numbers);
            while (chosen + 1u < parts.y && material_parts[parts.x + chosen].upto <= u) {
                chosen += 1u;
            }
        }
        f.part = parts.x + chosen;
        row = material_parts[f.part].material;
    }
#endif
    Surface surface = surface_of_material(ray, hit, row);
#ifdef TIMES
    if (!f.free) {
        f.stamp.path += f.stamp.index * distance(f.from, surface.position);
    }
    f.free = false;
    f.stamp.delay = 0.0;
#ifdef PARTS
    if (f.part != NONE) {
        f.stamp.delay = delay_sample_all(material_parts[f.part].profiles, surface.uv, chance.numbers);
    }
#endif
#endif
    return surface;
}

// The path goes on from `from` after an event that crossed the index ratio `eta`.
void flight_leave(inout Flight f, vec3 from, float eta) {
#ifdef TIMES
    f.stamp.late += f.stamp.delay;
    f.stamp.delay = 0.0;
    f.stamp.index *= eta;
    f.from = from;
#endif
}

// When light comes from outside the scene along the edge that is on its way, whose direction is `dir`. Zero without a time
// axis.
Length flight_escaped(Flight f, vec3 dir) {
#ifdef TIMES
    Length length = stamp_arrived(f.stamp);
    return f.free ? length : length + Length(f.stamp.index * lights_lead(f.from, dir));
#else
    return Length(0.0);
#endif
}

// When light arrives that a vertex gives back from a point of a light at `distance` towards `wi`; an infinite distance is that
// to the wave front where it touches the ball around all surfaces. Zero without a time axis.
Length flight_of_direct(Stamp stamp, Bsdf b, vec3 wo, vec3 from, vec3 wi, float distance) {
#ifdef TIMES
    return stamp_onward(stamp, bsdf_index_ratio(b, wo, wi), is_finite(distance) ? distance : lights_lead(from, wi));
#else
    return Length(0.0);
#endif
}

#endif
