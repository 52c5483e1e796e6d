// Twin of crates/lumbre-light/src/math/warp.rs.
#ifndef MATH_WARP_GLSL
#define MATH_WARP_GLSL

#include "math/trig.glsl"

// Maps to the unit disk, area-preserving [Shirley & Chiu 1997].
vec2 concentric_disk(vec2 u) {
    vec2 ab = 2.0 * u - 1.0;
    if (ab.x == 0.0 && ab.y == 0.0) {
        return vec2(0.0);
    }
    bool wide = abs(ab.x) > abs(ab.y);
    float r = wide ? ab.x : ab.y;
    float phi = wide ? FRAC_PI_4 * (ab.y / ab.x) : 2.0 * FRAC_PI_4 - FRAC_PI_4 * (ab.x / ab.y);
    return r * sin_cos(phi).yx;
}

// Returns a direction of the upper hemisphere with density `cos / pi` per solid angle.
vec3 cosine_hemisphere(vec2 u) {
    vec2 d = concentric_disk(u);
    return vec3(d, sqrt(max(1.0 - dot(d, d), 0.0)));
}

// Returns the density of `cosine_hemisphere` per solid angle.
float cosine_hemisphere_pdf_w(float cos_theta) {
    return max(cos_theta, 0.0) / PI;
}

// Returns a direction of the whole sphere with density `1 / (4 pi)` per solid angle.
vec3 uniform_sphere(vec2 u) {
    float z = 1.0 - 2.0 * u.x;
    float r = sqrt(max(1.0 - z * z, 0.0));
    return vec3(r * sin_cos(TAU * u.y).yx, z);
}

// Returns barycentric weights of the second and third corner of a triangle, uniform over its area
// [Heitz 2019].
vec2 uniform_triangle(vec2 u) {
    if (u.y > u.x) {
        float x = u.x * 0.5;
        return vec2(x, u.y - x);
    }
    float y = u.y * 0.5;
    return vec2(u.x - y, y);
}

#endif
