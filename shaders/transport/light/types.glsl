// Twin of the types at the top of src/transport/light/mod.rs, which all kinds of lights share. A light is named by its
// index among all: emissive primitives first, then points, directions, and the environment; `light_count` marks an
// environment that is not there.
#ifndef TRANSPORT_LIGHT_TYPES_GLSL
#define TRANSPORT_LIGHT_TYPES_GLSL

#include "scene.glsl"
#include "math/elementary.glsl"

const uint LIGHT_EMITTER = 0u;
const uint LIGHT_POINT = 1u;
const uint LIGHT_DIRECTIONAL = 2u;
const uint LIGHT_ENVIRONMENT = 3u;

// A point of a light; fields as in Rust.
struct LightPoint {
    uint light;
    vec3 position;
    vec3 normal;
    Uv uv;
};

// Light that arrives at a point, not yet tested for shadow; fields as in Rust.
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

// The densities that light which a path hit would have had, had it been sampled.
struct EmissionPdf {
    float pdf_a;
    float pdf_w;
};

// Which kind the light with an index is.
uint light_kind(uint light) {
    return light < job.light_first.x ? LIGHT_EMITTER
        : (light < job.light_first.y ? LIGHT_POINT
        : (light < job.light_first.z ? LIGHT_DIRECTIONAL : LIGHT_ENVIRONMENT));
}

#endif
