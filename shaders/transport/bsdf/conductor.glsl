// Twin of crates/lumbre-light/src/transport/bsdf/conductor.rs.
#ifndef TRANSPORT_BSDF_CONDUCTOR_GLSL
#define TRANSPORT_BSDF_CONDUCTOR_GLSL

#include "transport/bsdf/facets.glsl"
#include "transport/bsdf/lobe.glsl"

// A metal at a point of a surface; fields as in Rust.
struct Conductor {
    vec3 tint;
    vec3 eta;
    vec3 k;
    Facets facets;
};

// Returns a non-negative fraction; 1 if its denominator vanishes.
float conductor_part(float up, float down) {
    return down > 0.0 ? max(up / down, 0.0) : 1.0;
}

// Returns the reflectance of unpolarised light at a conductor [Born & Wolf 1999, 14.4].
float conductor_reflectance(float cos_theta, float eta, float k) {
    float cos2 = min(cos_theta * cos_theta, 1.0);
    float sin2 = 1.0 - cos2;
    float eta2 = eta * eta, k2 = k * k;
    float t0 = eta2 - k2 - sin2;
    float a2b2 = sqrt(t0 * t0 + 4.0 * eta2 * k2);
    float a = sqrt(max(0.5 * (a2b2 + t0), 0.0));
    float t1 = a2b2 + cos2, t2 = 2.0 * a * abs(cos_theta);
    float perpendicular = conductor_part(t1 - t2, t1 + t2);
    float t3 = cos2 * a2b2 + sin2 * sin2, t4 = t2 * sin2;
    float parallel = perpendicular * conductor_part(t3 - t4, t3 + t4);
    return 0.5 * (perpendicular + parallel);
}

vec3 conductor_fresnel(Conductor c, float cos_theta) {
    return c.tint * vec3(
        conductor_reflectance(cos_theta, c.eta.x, c.k.x),
        conductor_reflectance(cos_theta, c.eta.y, c.k.y),
        conductor_reflectance(cos_theta, c.eta.z, c.k.z)
    );
}

// Returns the value and the densities of both directions, for two directions on the upper side.
Densities conductor_evaluate(Conductor c, vec3 o, vec3 i) {
    if (!c.facets.present || o.z <= 0.0 || i.z <= 0.0) {
        return NO_DENSITIES;
    }
    vec3 h = normalize_or(o + i, vec3(0.0, 0.0, 1.0));
    float d = 0.25 * facets_d(c.facets, h);
    float masking_o = facets_masking_over_cos(c.facets, o);
    float masking_i = facets_masking_over_cos(c.facets, i);
    return Densities(
        conductor_fresnel(c, dot(o, h)) * (masking_o * d * masking_i), masking_o * d, masking_i * d
    );
}

// Samples a reflected direction for `o` on the upper side.
bool conductor_sample(Conductor c, vec3 o, vec2 v, out MixtureSample s) {
    if (!c.facets.present) {
        s = MixtureSample(LobeSample(vec3(-o.xy, o.z), conductor_fresnel(c, o.z), 1.0), 1.0, true);
        return true;
    }
    vec3 h = facets_sample(c.facets, o, v);
    vec3 wi = mirrored(o, h);
    // Use the half vector of both directions: for narrow lobes the sampled normal has digits that
    // `wi` cannot represent.
    Densities d = conductor_evaluate(c, o, wi);
    s = MixtureSample(LobeSample(wi, d.f * (wi.z / d.pdf_w), 1.0), d.pdf_w, false);
    return wi.z > 0.0 && dot(o, h) > 0.0 && d.pdf_w > 0.0 && is_finite(s.lobe.weight);
}

#endif
