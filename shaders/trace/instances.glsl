// The instances of acceleration structures, as built by crates/lumbre-vulkan/src/accel/structures.rs: the
// custom index identifies the triangles outside of instances, the spheres, or an instance of a mesh
// (INSTANCE_TRIANGLES and so on).
#ifndef TRACE_INSTANCES_GLSL
#define TRACE_INSTANCES_GLSL

#include "instance_transform.glsl"
#include "transport/ray.glsl"

// The first triangle of each geometry of the structure over the triangles outside of instances:
// opaque triangles and those with masks are in different geometries.
layout(set = 0, binding = 35, scalar) restrict readonly buffer GeometryStarts {
    uint geometry_starts[];
};

// Returns the hit of a triangle of an instance: `primitive` counts from its geometry's first. For an
// instance of a mesh the distance is that to the triangle in world space, which is not positive if
// the ray leaves that very triangle.
Hit hit_of_instance(
    vec3 origin, vec3 dir, float t, uint custom, uint geometry, uint primitive, vec2 uv
) {
    Hit hit = Hit(t, primitive, NONE, uv);
    if (custom == INSTANCE_TRIANGLES) {
        hit.primitive += geometry_starts[geometry];
    } else if (INSTANCES) {
        hit.instance = custom - INSTANCE_MESHES;
        hit.primitive += places[hit.instance].start;
        hit.t = instance_distance(origin, dir, hit.primitive, hit.instance);
    }
    return hit;
}

#endif
