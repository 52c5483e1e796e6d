// What the instances of acceleration structures hold, as src/render/vulkan/accel.rs makes them: by their custom index the
// triangles that are no copies, the spheres, or a copy of a mesh (INSTANCE_TRIANGLES and so on).
#ifndef TRACE_INSTANCES_GLSL
#define TRACE_INSTANCES_GLSL

#include "copies.glsl"
#include "transport/ray.glsl"

// The hit of a triangle of an instance. Of a copy the distance is that to the triangle as it lies in the world, which is not
// above zero where the ray leaves that very triangle.
Hit hit_of_instance(vec3 origin, vec3 dir, float t, uint custom, int primitive, vec2 uv) {
    Hit hit = Hit(t, uint(primitive), NONE, uv);
#ifdef COPIES
    if (custom >= INSTANCE_COPIES) {
        hit.instance = custom - INSTANCE_COPIES;
        hit.primitive += places[hit.instance].start;
        hit.t = copy_distance(origin, dir, hit.primitive, hit.instance);
    }
#endif
    return hit;
}

#endif
