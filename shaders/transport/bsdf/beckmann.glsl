// Twin of crates/lumbre-light/src/transport/bsdf/beckmann.rs.
#ifndef TRANSPORT_BSDF_BECKMANN_GLSL
#define TRANSPORT_BSDF_BECKMANN_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "math/trig.glsl"

// 1 / sqrt(pi).
const float INV_SQRT_PI = 0.5641896;
// Maximum number of Newton steps when inverting the distribution of slopes.
const uint MAX_STEPS = 24u;

// The error function [Abramowitz & Stegun 1964, 7.1.26].
float erf(float x) {
    float a = abs(x);
    float t = 1.0 / (1.0 + 0.3275911 * a);
    float poly = ((((1.0614054 * t - 1.453152) * t + 1.4214138) * t - 0.28449674) * t + 0.2548296)
        * t;
    return copysign(1.0 - poly * exp(-a * a), x);
}

// The inverse of the error function [Winitzki 2008], refined by one step of Halley's method.
float erf_inv(float y) {
    y = clamp(y, -0.999999, 0.999999);
    const float a = 0.147;
    float l = log(1.0 - y * y);
    float b = 2.0 / (PI * a) + 0.5 * l;
    float x = copysign(sqrt(max(sqrt(max(b * b - l / a, 0.0)) - b, 0.0)), y);
    float miss = (erf(x) - y) * 0.5 / INV_SQRT_PI * exp(x * x);
    return x - miss / (1.0 + x * miss);
}

// Returns the unnormalised distribution function of slopes at `x`, for a viewer with the cotangent
// `cot`.
float slopes_below(float cot, float x) {
    return 0.5 * cot * (1.0 + erf(x)) + 0.5 * INV_SQRT_PI * exp(-x * x);
}

// Samples the slope along the viewer's direction with density proportional to `max(0, cot - x)
// exp(-x^2)`.
float visible_slope(float cot, float u) {
    // Beyond this the factor (cot - x) is constant over the Gaussian.
    if (cot > 1e4) {
        return erf_inv(2.0 * u - 1.0);
    }
    float goal = clamp(u, 0.0, 1.0 - 1e-7) * slopes_below(cot, cot);
    float low = -6.0, high = min(cot, 6.0);
    float x = clamp(erf_inv(clamp(2.0 * u - 1.0, -0.99999, 0.99999)), low, high);
    [[dont_unroll]] for (uint i = 0u; i < MAX_STEPS; ++i) {
        float miss = slopes_below(cot, x) - goal;
        if (miss > 0.0) {
            high = x;
        } else {
            low = x;
        }
        float slope = max(cot - x, 0.0) * INV_SQRT_PI * exp(-x * x);
        // If the slope is zero, bisect instead of a Newton step.
        float next = slope > 0.0 ? x - miss / slope : low;
        next = next > low && next < high ? next : 0.5 * (low + high);
        if (abs(next - x) < 1e-6 * (1.0 + abs(x))) {
            return next;
        }
        x = next;
    }
    return x;
}

// Returns the density of microfacet normals per solid angle and area of the macroscopic surface.
float beckmann_d(vec2 alpha, vec3 h) {
    if (h.z <= 0.0) {
        return 0.0;
    }
    vec2 xy = h.xy / (alpha * h.z);
    float z2 = h.z * h.z;
    return FRAC_1_PI * exp(-dot(xy, xy)) / (alpha.x * alpha.y * z2 * z2);
}

// Returns Smith's masking over the cosine.
float beckmann_masking_over_cos(vec2 alpha, vec3 w) {
    float r = length(alpha * w.xy);
    float a = w.z / max(r, 1e-20);
    return 2.0 / (w.z * (1.0 + erf(a)) + r * INV_SQRT_PI * exp(-a * a));
}

// Samples a microfacet normal on the upper side with the density of those visible from `wo` [Heitz
// & d'Eon 2014].
vec3 beckmann_sample(vec2 alpha, vec3 wo, vec2 u) {
    vec3 stretched = normalize_or(vec3(alpha * wo.xy, wo.z), vec3(0.0, 0.0, 1.0));
    float across = length(stretched.xy);
    vec2 turn = across > 1e-9 ? stretched.xy / across : vec2(1.0, 0.0);
    float along = visible_slope(stretched.z / max(across, 1e-9), u.x);
    float aside = erf_inv(2.0 * u.y - 1.0);
    vec2 slope = alpha * vec2(turn.x * along - turn.y * aside, turn.y * along + turn.x * aside);
    return normalize_or(vec3(-slope, 1.0), vec3(0.0, 0.0, 1.0));
}

#endif
