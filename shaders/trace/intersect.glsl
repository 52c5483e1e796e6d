// Twin of crates/lumbre-render/src/cpu/bvh/intersect.rs: one triangle at a time, with double precision by pairs
// of floats.
#ifndef TRACE_INTERSECT_GLSL
#define TRACE_INTERSECT_GLSL

#include "scene.glsl"
#include "transport/ray.glsl"

// A ray prepared for triangle tests [Woop et al. 2013].
struct ShearedRay {
    vec3 origin;
    uvec3 k;
    vec3 shear;
};

ShearedRay sheared_ray(Ray ray) {
    vec3 a = abs(ray.dir);
    uint kz = a.x >= a.y && a.x >= a.z ? 0u : (a.y >= a.z ? 1u : 2u);
    uint kx = kz == 2u ? 0u : kz + 1u;
    uint ky = kx == 2u ? 0u : kx + 1u;
    if (ray.dir[kz] < 0.0) {
        uint swap = kx;
        kx = ky;
        ky = swap;
    }
    float inverse = 1.0 / ray.dir[kz];
    ShearedRay s;
    s.origin = vec3(ray.origin[kx], ray.origin[ky], ray.origin[kz]);
    s.k = uvec3(kx, ky, kz);
    s.shear = vec3(ray.dir[kx] * inverse, ray.dir[ky] * inverse, inverse);
    return s;
}

vec3 sheared(ShearedRay ray, vec3 corner) {
    precise float z = corner[ray.k.z] - ray.origin.z;
    precise float x = corner[ray.k.x] - ray.origin.x - z * ray.shear.x;
    precise float y = corner[ray.k.y] - ray.origin.y - z * ray.shear.y;
    precise float d = z * ray.shear.z;
    return vec3(x, y, d);
}

// Returns the rounding error of the product of two floats [Dekker 1971]; without fused operations,
// which devices may lack.
float product_rest(float a, float b, float product) {
    precise float ca = 4097.0 * a;
    precise float a_high = ca - (ca - a);
    precise float a_low = a - a_high;
    precise float cb = 4097.0 * b;
    precise float b_high = cb - (cb - b);
    precise float b_low = b - b_high;
    precise float rest = ((a_high * b_high - product) + a_high * b_low + a_low * b_high)
        + a_low * b_low;
    return rest;
}

// Returns an edge function whose sign is correct where single precision gives zero.
float exact_edge(vec3 p, vec3 q) {
    precise float first = p.x * q.y;
    precise float second = p.y * q.x;
    precise float edge = (first - second)
        + (product_rest(p.x, q.y, first) - product_rest(p.y, q.x, second));
    return edge;
}

float edge(vec3 p, vec3 q) {
    precise float e = p.x * q.y - p.y * q.x;
    return e;
}

// Tests whether a triangle is hit with 0 < t < t_max; watertight: a zero counts as inside.
bool intersect_triangle(ShearedRay ray, Triangle corners, float t_max, out float t, out vec2 uv) {
    vec3 a = sheared(ray, corners.a);
    vec3 b = sheared(ray, corners.b);
    vec3 c = sheared(ray, corners.c);
    float u = edge(c, b);
    float v = edge(a, c);
    float w = edge(b, a);
    if (u == 0.0 || v == 0.0 || w == 0.0) {
        u = exact_edge(c, b);
        v = exact_edge(a, c);
        w = exact_edge(b, a);
    }
    precise float det = u + v + w;
    precise float distance = (u * a.z + v * b.z + w * c.z) / det;
    t = distance;
    uv = vec2(v / det, w / det);
    bool outside = min(u, min(v, w)) < 0.0 && max(u, max(v, w)) > 0.0;
    // Comparisons with the results of `det == 0`, infinite or NaN, must be false; compilers may
    // assume that there is no NaN.
    return !outside && det != 0.0 && t > 0.0 && t < t_max;
}

// Returns the distances, positive or not, at which the line of a ray enters and leaves a sphere
// [Haines et al. 2019]; zeros if it misses the sphere.
vec2 sphere_crossings(Sphere sphere, Ray ray) {
    vec3 f = ray.origin - sphere.center;
    float b = -dot(f, ray.dir);
    vec3 nearest = f + ray.dir * b;
    float r2 = sphere.radius * sphere.radius;
    float discriminant = r2 - dot(nearest, nearest);
    float q = b + (b < 0.0 ? -1.0 : 1.0) * sqrt(max(discriminant, 0.0));
    if (discriminant < 0.0 || q == 0.0) {
        return vec2(0.0);
    }
    float other = (dot(f, f) - r2) / q;
    return vec2(min(other, q), max(other, q));
}

// Tests whether a sphere is hit with 0 < t < t_max.
bool intersect_sphere(Sphere sphere, Ray ray, float t_max, out float t) {
    vec2 crossings = sphere_crossings(sphere, ray);
    t = crossings.x > 0.0 ? crossings.x : crossings.y;
    return t > 0.0 && t < t_max;
}

// Tests whether the ray leaves a sphere that it has entered with t > 0, at t < t_max.
bool intersect_sphere_exit(Sphere sphere, Ray ray, float t_max, out float t) {
    vec2 crossings = sphere_crossings(sphere, ray);
    t = crossings.y;
    return crossings.x > 0.0 && t < t_max;
}

#endif
