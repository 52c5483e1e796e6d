// Twin of crates/lumbre-light/src/transport/bsdf/translucent.rs.
#ifndef TRANSPORT_BSDF_TRANSLUCENT_GLSL
#define TRANSPORT_BSDF_TRANSLUCENT_GLSL

#include "math/warp.glsl"
#include "transport/bsdf/lobe.glsl"

// A translucent sheet: albedos of both sides, and the probability of sampling the reflection.
struct Translucent {
    vec3 reflectance;
    vec3 transmittance;
    float reflects;
};

Translucent translucent_new(vec3 reflectance, vec3 transmittance) {
    float reflected = reflectance.x + reflectance.y + reflectance.z;
    float sum = reflected + (transmittance.x + transmittance.y + transmittance.z);
    return Translucent(reflectance, transmittance, sum > 0.0 ? reflected / sum : 1.0);
}

// Returns the albedo of the side of `wi` over pi; black for a direction in the surface.
vec3 translucent_eval(Translucent k, vec3 wo, vec3 wi) {
    float sides = wo.z * wi.z;
    return sides == 0.0 ? vec3(0.0) : (sides > 0.0 ? k.reflectance : k.transmittance) * FRAC_1_PI;
}

// Returns the density of `translucent_sample` per solid angle.
float translucent_pdf_w(Translucent k, vec3 wo, vec3 wi) {
    float sides = wo.z * wi.z;
    float side = sides > 0.0 ? k.reflects : 1.0 - k.reflects;
    return sides == 0.0 ? 0.0 : side * cosine_hemisphere_pdf_w(abs(wi.z));
}

// Samples a direction with cosine density on a side that `u` selects; false for a grazing direction
// of zero weight.
bool translucent_sample(Translucent k, vec3 wo, float u, vec2 v, out MixtureSample s) {
    bool reflected = u < k.reflects;
    float side = reflected ? k.reflects : 1.0 - k.reflects;
    vec3 wi = cosine_hemisphere(v);
    bool found = wi.z > 0.0 && side > 0.0 && wo.z != 0.0;
    wi.z = copysign(wi.z, wo.z) * (reflected ? 1.0 : -1.0);
    s.lobe = LobeSample(wi, (reflected ? k.reflectance : k.transmittance) / side, 1.0);
    s.pdf_w = translucent_pdf_w(k, wo, wi);
    s.delta = false;
    return found;
}

// Returns whether anything is reflected or transmitted.
bool translucent_has_density(Translucent k) {
    return k.reflectance != vec3(0.0) || k.transmittance != vec3(0.0);
}

#endif
