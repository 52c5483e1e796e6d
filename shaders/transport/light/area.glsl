// Twin of crates/lumbre-light/src/transport/light/area.rs.
#ifndef TRANSPORT_LIGHT_AREA_GLSL
#define TRANSPORT_LIGHT_AREA_GLSL

#include "math/warp.glsl"
#include "transport/light/types.glsl"
#include "transport/surface.glsl"

// Returns whether emitter `i` is a sphere.
bool area_is_sphere(uint i) {
    return emitters[i].primitive >= job.triangle_count;
}

// Returns the sphere that emitter `i` is.
Sphere area_sphere(uint i) {
    return spheres[emitters[i].primitive - job.triangle_count];
}

// Samples a point uniform over the area of emitter `i`: its density is one over the area.
LightPoint area_sample(uint i, vec2 u) {
    uint p = emitters[i].primitive;
    if (p < job.triangle_count) {
        Triangle corners = triangle_corners(p, emitters[i].instance);
        vec2 vw = uniform_triangle(u);
        float rest = 1.0 - vw.x - vw.y;
        return LightPoint(
            i,
            corners.a * rest + corners.b * vw.x + corners.c * vw.y,
            normalize_or(cross(corners.b - corners.a, corners.c - corners.a), vec3(0.0)),
            triangle_extent(corners, emitters[i].instance),
            triangle_uv(p, vw)
        );
    }
    Sphere ball = area_sphere(i);
    vec3 normal = uniform_sphere(u);
    return LightPoint(
        i, ball.center + normal * ball.radius, normal, sphere_extent(ball), uv_of(sphere_uv(normal))
    );
}

// Returns the density per area with which `area_sample` samples any point of emitter `i`.
float area_pdf_a(uint i) {
    return 1.0 / emitters[i].area;
}

// Returns the density per solid angle of a point uniform over `area` in direction `to`; zero from
// behind, and if it is not a positive finite number.
float area_density(vec3 to, float distance, vec3 normal, float area) {
    float pdf_w = distance * distance * distance / (-dot(to, normal) * area);
    return pdf_w > 0.0 && is_finite(pdf_w) ? pdf_w : 0.0;
}

// Returns the material row of emitter `i`.
uint area_material(uint i) {
    return material_of(emitters[i].primitive, emitters[i].instance);
}

// Returns the radiance of the front of emitter `i` at texture coordinates, times the coverage of
// its mask.
vec3 area_emission(uint i, Uv uv) {
    uint m = area_material(i);
    return materials[m].emission * coverage(m, uv) * lookup(materials[m].emission_texture, uv, m);
}

// Samples light that arrives at `from` from a point uniform over the area, without its radiance;
// false from behind. The density does not include the choice of the light.
bool area_sample_direct(uint i, vec3 from, vec2 u, out DirectSample s) {
    LightPoint point = area_sample(i, u);
    vec3 to = point.position - from;
    float distance = length(to);
    float pdf_w = area_density(to, distance, point.normal, emitters[i].area);
    s = DirectSample(to / distance, distance, vec3(0.0), pdf_w, false, point);
    return pdf_w > 0.0;
}

// Returns the density per solid angle at `from` of a point uniform over the area; zero from behind.
float area_pdf_direct_w(uint i, vec3 from, vec3 at, vec3 normal) {
    vec3 to = at - from;
    return area_density(to, length(to), normal, emitters[i].area);
}

#endif
