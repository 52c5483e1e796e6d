// The traversal of `vulkan`: rays traced by the pipeline. `miss.rmiss` reports NONE for rays that
// hit nothing.
#ifndef TRACE_PIPELINE_GLSL
#define TRACE_PIPELINE_GLSL

#extension GL_EXT_ray_tracing : require

#include "scene.glsl"
#include "trace/payload.glsl"
#include "trace/valid.glsl"

layout(set = 0, binding = 34) uniform accelerationStructureEXT structure;
layout(location = 0) rayPayloadEXT Payload payload;

bool traversal_closest(Ray ray, float t_max, out Hit hit) {
    payload.hit = Hit(t_max, NONE, NONE, vec2(0.0));
    if (is_traceable(ray, t_max)) {
        traceRayEXT(
            structure, gl_RayFlagsNoneEXT, 0xffu, 0u, 0u, 0u, ray.origin, 0.0, ray.dir, t_max, 0
        );
    }
    hit = payload.hit;
    return hit.primitive != NONE;
}

bool traversal_occluded(Ray ray, float t_max) {
    if (!is_traceable(ray, t_max)) {
        return false;
    }
    // Only the miss shader runs, which changes this value.
    payload.hit = Hit(t_max, 0u, NONE, vec2(0.0));
    const uint flags = gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;
    traceRayEXT(structure, flags, 0xffu, 0u, 0u, 0u, ray.origin, 0.0, ray.dir, t_max, 0);
    return payload.hit.primitive != NONE;
}

#endif
