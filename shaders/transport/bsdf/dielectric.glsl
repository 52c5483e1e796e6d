// Twin of src/transport/bsdf/dielectric.rs.
#ifndef TRANSPORT_BSDF_DIELECTRIC_GLSL
#define TRANSPORT_BSDF_DIELECTRIC_GLSL

#include "math/elementary.glsl"
#include "transport/bsdf/fresnel.glsl"
#include "transport/bsdf/lobe.glsl"

// Reflection or refraction, chosen by `u` with the Fresnel reflectance as probability, and that probability. None where
// refraction has no direction.
bool dielectric_sample(vec3 base_color, float ior, vec3 wo, float u, uint mode, out LobeSample s, out float probability) {
    Interface surface = fresnel_dielectric(wo.z, ior);
    s = LobeSample(vec3(-wo.x, -wo.y, wo.z), vec3(1.0), 1.0);
    probability = surface.reflectance;
    if (u < surface.reflectance) {
        return true;
    }
    // From the tangential part rather than from the cosine, which says little of it near the normal.
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
