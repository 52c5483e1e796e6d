// Twin of crates/lumbre-light/src/transport/bsdf/oren_nayar.rs.
#ifndef TRANSPORT_BSDF_OREN_NAYAR_GLSL
#define TRANSPORT_BSDF_OREN_NAYAR_GLSL

#include "transport/bsdf/lambert.glsl"

// A rough diffuse surface: albedo of the facets, and factors on the Lambertian part and on the part
// that brightens towards the light.
struct OrenNayar {
    vec3 base_color;
    float a;
    float b;
};

OrenNayar oren_nayar_new(vec3 base_color, float roughness) {
    float sigma = roughness * (0.5 * PI);
    float sigma2 = sigma * sigma;
    return OrenNayar(
        base_color, 1.0 - 0.5 * sigma2 / (sigma2 + 0.33), 0.45 * sigma2 / (sigma2 + 0.09)
    );
}

// Returns the value over that of a Lambertian surface, for directions on the same side.
float oren_nayar_factor(OrenNayar k, vec3 wo, vec3 wi) {
    float across = wo.x * wi.x + wo.y * wi.y;
    return k.a + k.b * max(across, 0.0) / max(abs(wo.z), abs(wi.z));
}

// Returns the value; black for directions on different sides.
vec3 oren_nayar_eval(OrenNayar k, vec3 wo, vec3 wi) {
    return wo.z * wi.z > 0.0
        ? k.base_color * (oren_nayar_factor(k, wo, wi) * FRAC_1_PI)
        : vec3(0.0);
}

// Samples a direction on the side of `wo` with cosine density; false for a grazing direction of
// zero weight.
bool oren_nayar_sample(OrenNayar k, vec3 wo, vec2 v, out MixtureSample s) {
    bool found = lambert_sample(k.base_color, wo, v, s.lobe);
    s.lobe.weight *= oren_nayar_factor(k, wo, s.lobe.wi);
    s.pdf_w = lambert_pdf_w(wo, s.lobe.wi);
    s.delta = false;
    return found;
}

#endif
