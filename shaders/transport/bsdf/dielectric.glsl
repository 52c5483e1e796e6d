// Twin of crates/lumbre-light/src/transport/bsdf/dielectric.rs.
#ifndef TRANSPORT_BSDF_DIELECTRIC_GLSL
#define TRANSPORT_BSDF_DIELECTRIC_GLSL

#include "math/trig.glsl"
#include "transport/bsdf/fresnel.glsl"
#include "transport/bsdf/lobe.glsl"

// Samples reflection or refraction with the Fresnel reflectance as the probability of the former;
// returns false if refraction was chosen but has no direction.
bool dielectric_sample(
    vec3 base_color, float ior, vec3 wo, float u, uint mode, out LobeSample s, out float probability
) {
    DielectricFresnel surface = fresnel_dielectric(wo.z, ior);
    s = LobeSample(vec3(-wo.x, -wo.y, wo.z), vec3(1.0), 1.0);
    probability = surface.reflectance;
    if (u < surface.reflectance) {
        return true;
    }
    // Use the tangential part rather than the cosine, which has few digits of it near the normal.
    vec2 along = -wo.xy / surface.eta;
    float cos2_t = 1.0 - dot(along, along);
    float scale = mode == RADIANCE ? 1.0 / (surface.eta * surface.eta) : 1.0;
    s = LobeSample(
        vec3(along, copysign(sqrt(max(cos2_t, 0.0)), -wo.z)), sqrt(base_color) * scale, surface.eta
    );
    probability = 1.0 - surface.reflectance;
    return cos2_t > 0.0;
}

#endif
