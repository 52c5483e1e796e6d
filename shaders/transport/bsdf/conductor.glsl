// Twin of src/transport/bsdf/conductor.rs.
#ifndef TRANSPORT_BSDF_CONDUCTOR_GLSL
#define TRANSPORT_BSDF_CONDUCTOR_GLSL

#include "transport/bsdf/facets.glsl"
#include "transport/bsdf/lobe.glsl"

// A metal at a point; fields as in Rust.
struct Conductor {
    vec3 tint;
    vec3 eta;
    vec3 k;
    Facets facets;
};

// A fraction of what is not negative; 1 where index and cosine say that nothing is there.
float conductor_part(float up, float down) {
    return down > 0.0 ? max(up / down, 0.0) : 1.0;
}

// Reflectance of unpolarised light at a conductor [Born & Wolf 1999, 14.4].
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

// Value and densities of both directions, for two on the upper side.
Densities conductor_evaluate(Conductor c, vec3 o, vec3 i) {
    if (!c.facets.present || o.z <= 0.0 || i.z <= 0.0) {
        return NO_DENSITIES;
    }
    vec3 h = normalize_or(o + i, vec3(0.0, 0.0, 1.0));
    float d = 0.25 * facets_d(c.facets, h);
    float seen_o = facets_masking_over_cos(c.facets, o), seen_i = facets_masking_over_cos(c.facets, i);
    return Densities(conductor_fresnel(c, dot(o, h)) * (seen_o * d * seen_i), seen_o * d, seen_i * d);
}

// A reflected direction for `o` on the upper side.
bool conductor_sample(Conductor c, vec3 o, vec2 v, out Local s) {
    if (!c.facets.present) {
        s = Local(LobeSample(vec3(-o.xy, o.z), conductor_fresnel(c, o.z), 1.0), 1.0, true);
        return true;
    }
    vec3 h = facets_sample(c.facets, o, v);
    vec3 wi = mirrored(o, h);
    // From the direction, not from the normal, which narrow lobes know better than the direction can say.
    Densities d = conductor_evaluate(c, o, wi);
    s = Local(LobeSample(wi, d.f * (wi.z / d.pdf_w), 1.0), d.pdf_w, false);
    return wi.z > 0.0 && dot(o, h) > 0.0 && d.pdf_w > 0.0 && is_finite(s.lobe.weight);
}

#endif
