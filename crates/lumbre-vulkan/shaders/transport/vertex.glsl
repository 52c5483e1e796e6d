// Twin of crates/lumbre-light/src/transport/vertex.rs.
#ifndef TRANSPORT_VERTEX_GLSL
#define TRANSPORT_VERTEX_GLSL

#include "math/trig.glsl"
#include "transport/light/types.glsl"
#include "transport/ray.glsl"

// Returns the factor from a density per solid angle at `from` to one per area at `to`, where the
// unit normal is `n_to` [Veach 1997, 8.2.2.2]. Zero if the points coincide.
float area_factor(vec3 from, vec3 to, vec3 n_to) {
    vec3 edge = to - from;
    float d2 = length_squared(edge);
    return d2 > 0.0 ? abs(dot(edge, n_to)) / (d2 * sqrt(d2)) : 0.0;
}

// Returns the normal flipped to the side of `dir`.
vec3 towards(vec3 n, vec3 dir) {
    return dot(n, dir) < 0.0 ? -n : n;
}

// Computes the shadow ray between two surface points, each moved off its surface towards the other,
// and its length; a point without a surface has the normal zero. Returns false if the points
// coincide: nothing lies between them.
bool connection_ray(vec3 from, vec3 n_from, vec3 to, vec3 n_to, out Ray ray, out float distance) {
    vec3 edge = to - from;
    ray.origin = offset_origin(from, towards(n_from, edge));
    vec3 target = offset_origin(to, towards(n_to, -edge));
    edge = target - ray.origin;
    distance = length(edge);
    ray.dir = edge / distance;
    return distance > 0.0;
}

// Returns a ray from a surface point in the unit direction `dir`, started off the surface on the
// side of `dir`.
Ray spawn_ray(vec3 from, vec3 n, vec3 dir) {
    return Ray(offset_origin(from, towards(n, dir)), dir);
}

// Computes the shadow ray from a surface point to sampled light, and its length; false if nothing
// can lie between.
bool shadow_ray(vec3 from, vec3 n_from, DirectSample direct, out Ray ray, out float distance) {
    if (is_finite(direct.distance)) {
        return connection_ray(
            from, n_from, direct.point.position, direct.point.normal, ray, distance
        );
    }
    ray = spawn_ray(from, n_from, direct.wi);
    distance = INFINITY;
    return true;
}

#endif
