// Which rays may be given to the device's ray tracing: NaN or infinite origins and directions, NaN or
// negative distances, and directions of no length have undefined results there, and have hung
// drivers. Such a ray hits nothing, as on the CPU.
#ifndef TRACE_VALID_GLSL
#define TRACE_VALID_GLSL

#include "math/trig.glsl"
#include "transport/ray.glsl"

bool is_traceable(Ray ray, float t_max) {
    bool ends = (floatBitsToUint(t_max) & 0x7fffffffu) <= 0x7f800000u && t_max > 0.0;
    return ends && is_finite(ray.origin) && is_finite(ray.dir) && dot(ray.dir, ray.dir) > 0.0;
}

#endif
