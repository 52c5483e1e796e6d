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

// A point at which an edge of a path starts or ends; fields as in Rust.
struct EdgeEnd {
    vec3 position;
    vec3 normal;
    float extent;
};

// Returns a point without a surface.
EdgeEnd edge_end_free(vec3 position) {
    return EdgeEnd(position, vec3(0.0), 0.0);
}

// Returns a point of a light as an end of edges.
EdgeEnd edge_end_of(LightPoint point) {
    return EdgeEnd(point.position, point.normal, point.extent);
}

// Returns a point moved off its surface to the side of `dir`.
vec3 edge_end_off_surface(EdgeEnd end, vec3 dir) {
    return offset_origin(end.position, towards(end.normal, dir), end.extent);
}

// Computes the shadow ray between two points, each moved off its surface towards the other, and its
// length. Returns false if the points coincide: nothing lies between them.
bool connection_ray(EdgeEnd from, EdgeEnd to, out Ray ray, out float distance) {
    vec3 edge = to.position - from.position;
    ray.origin = edge_end_off_surface(from, edge);
    vec3 target = edge_end_off_surface(to, -edge);
    edge = target - ray.origin;
    distance = length(edge);
    ray.dir = edge / distance;
    return distance > 0.0;
}

// Returns a ray from a point in the unit direction `dir`, started off the surface on the side of
// `dir`.
Ray spawn_ray(EdgeEnd from, vec3 dir) {
    return Ray(edge_end_off_surface(from, dir), dir);
}

// Computes the shadow ray from a point to sampled light, and its length; false if nothing
// can lie between.
bool shadow_ray(EdgeEnd from, DirectSample direct, out Ray ray, out float distance) {
    if (is_finite(direct.distance)) {
        return connection_ray(from, edge_end_of(direct.point), ray, distance);
    }
    ray = spawn_ray(from, direct.wi);
    distance = INFINITY;
    return true;
}

#endif
