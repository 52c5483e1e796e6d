// Twin of the types at the top of crates/lumbre-light/src/transport/light/mod.rs, shared by all kinds of lights. A
// light is identified by its index: emissive primitives first, then points, directions, and the
// environment; `light_count` stands for a missing environment.
#ifndef TRANSPORT_LIGHT_TYPES_GLSL
#define TRANSPORT_LIGHT_TYPES_GLSL

#include "scene.glsl"
#include "math/trig.glsl"

const uint LIGHT_EMITTER = 0u;
const uint LIGHT_POINT = 1u;
const uint LIGHT_DIRECTIONAL = 2u;
const uint LIGHT_ENVIRONMENT = 3u;

// A point of a light; fields as in Rust.
struct LightPoint {
    uint light;
    vec3 position;
    vec3 normal;
    float extent;
    Uv uv;
};

// Light that arrives at a point, before the shadow test; fields as in Rust.
struct DirectSample {
    vec3 wi;
    float distance;
    vec3 radiance;
    float pdf_w;
    bool delta;
    LightPoint point;
};

// The start of a path at a light; fields as in Rust.
struct EmissionSample {
    LightPoint point;
    vec3 dir;
    vec3 radiance;
    float pdf_a;
    float pdf_w;
    float cos_theta;
};

// The densities with which a light that a path hit would have been sampled.
struct EmissionPdf {
    float pdf_a;
    float pdf_w;
};

// Returns the kind of the light with this index.
uint light_kind(uint light) {
    // The missing environment has another kind, but no radiance for which it would matter.
    if (!OTHER_LIGHTS) {
        return LIGHT_EMITTER;
    }
    return light < job.light_first.x ? LIGHT_EMITTER
        : (light < job.light_first.y ? LIGHT_POINT
        : (light < job.light_first.z ? LIGHT_DIRECTIONAL : LIGHT_ENVIRONMENT));
}

#endif
