// Twin of crates/lumbre-light/src/transport/bsdf/lambert.rs.
#ifndef TRANSPORT_BSDF_LAMBERT_GLSL
#define TRANSPORT_BSDF_LAMBERT_GLSL

#include "math/warp.glsl"
#include "transport/bsdf/lobe.glsl"

// Returns `albedo / pi` if both directions are on the same side, else black.
vec3 lambert_eval(vec3 albedo, vec3 wo, vec3 wi) {
    return wo.z * wi.z > 0.0 ? albedo * FRAC_1_PI : vec3(0.0);
}

// Returns the density of `lambert_sample` per solid angle.
float lambert_pdf_w(vec3 wo, vec3 wi) {
    return wo.z * wi.z > 0.0 ? cosine_hemisphere_pdf_w(abs(wi.z)) : 0.0;
}

// Samples a direction on the side of `wo` with cosine density; false for a grazing direction of
// zero weight.
bool lambert_sample(vec3 albedo, vec3 wo, vec2 u, out LobeSample s) {
    vec3 wi = cosine_hemisphere(u);
    s = LobeSample(vec3(wi.xy, copysign(wi.z, wo.z)), albedo, 1.0);
    return wi.z > 0.0 && wo.z != 0.0;
}

#endif
