// Twin of src/transport/vertex.rs.
#ifndef TRANSPORT_VERTEX_GLSL
#define TRANSPORT_VERTEX_GLSL

#include "math/elementary.glsl"
#include "transport/light/types.glsl"
#include "transport/ray.glsl"

// What turns a density per solid angle at `from` into one per area at `to`, where the unit normal is `n_to` [Veach 1997,
// 8.2.2.2]. Zero where the two coincide.
float area_factor(vec3 from, vec3 to, vec3 n_to) {
    vec3 edge = to - from;
    float d2 = length_squared(edge);
    return d2 > 0.0 ? abs(dot(edge, n_to)) / (d2 * sqrt(d2)) : 0.0;
}

// The normal on the side of `dir`.
vec3 towards(vec3 n, vec3 dir) {
    return dot(n, dir) < 0.0 ? -n : n;
}

// The ray between two points of surfaces, each moved off its surface to the side of the other, and its length; a point
// without a surface has the normal zero. False where the points coincide: nothing lies between them.
bool join(vec3 from, vec3 n_from, vec3 to, vec3 n_to, out Ray ray, out float distance) {
    vec3 edge = to - from;
    ray.origin = offset_origin(from, towards(n_from, edge));
    vec3 target = offset_origin(to, towards(n_to, -edge));
    edge = target - ray.origin;
    distance = length(edge);
    ray.dir = edge / distance;
    return distance > 0.0;
}

// A ray from a point of a surface into the unit direction `dir`, started off the surface on the side to which it goes.
Ray leave(vec3 from, vec3 n, vec3 dir) {
    return Ray(offset_origin(from, towards(n, dir)), dir);
}

// The ray that must meet nothing for light that was drawn from a point of a surface, and how far it goes; false where
// nothing can lie between.
bool shadow_ray(vec3 from, vec3 n_from, DirectSample direct, out Ray ray, out float distance) {
    if (is_finite(direct.distance)) {
        return join(from, n_from, direct.point.position, direct.point.normal, ray, distance);
    }
    ray = leave(from, n_from, direct.wi);
    distance = INFINITY;
    return true;
}

#endif
