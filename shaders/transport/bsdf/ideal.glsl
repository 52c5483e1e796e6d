// Twin of crates/lumbre-light/src/transport/bsdf/ideal.rs.
#ifndef TRANSPORT_BSDF_IDEAL_GLSL
#define TRANSPORT_BSDF_IDEAL_GLSL

#include "transport/bsdf/dielectric.glsl"
#include "transport/bsdf/lambert.glsl"
#include "transport/bsdf/mirror.glsl"

// An ideal surface: base colour, index of the inside, and the probabilities of Lambert, mirror and
// dielectric, which are also the weights of the mixture. A one-sided one has no Lambert and no mirror
// at the back.
struct Ideal {
    vec3 base_color;
    float ior;
    vec3 mixture;
    bool one_sided;
};

// Returns the probabilities of the lobes for light that leaves towards `wo`.
vec3 ideal_mixture_at(Ideal k, vec3 wo) {
    return k.one_sided && wo.z < 0.0 ? vec3(0.0, 0.0, k.mixture.z) : k.mixture;
}

// Evaluates the diffuse part.
vec3 ideal_eval(Ideal k, vec3 wo, vec3 wi) {
    return lambert_eval(k.base_color, wo, wi) * ideal_mixture_at(k, wo).x;
}

// Returns the density of the diffuse part.
float ideal_pdf_w(Ideal k, vec3 wo, vec3 wi) {
    return lambert_pdf_w(wo, wi) * ideal_mixture_at(k, wo).x;
}

// Samples a direction of one lobe. Its weight equals that of the mixture, since probabilities and
// weights coincide.
bool ideal_sample(Ideal k, vec3 wo, float u, vec2 v, uint mode, out MixtureSample s) {
    vec3 mixture = ideal_mixture_at(k, wo);
    float diffuse = mixture.x, metal = mixture.y, glass = mixture.z;
    if (k.one_sided && wo.z < 0.0 && u >= glass) {
        return false;
    }
    if (u < diffuse) {
        s.delta = false;
        bool found = lambert_sample(k.base_color, wo, v, s.lobe);
        s.pdf_w = diffuse * lambert_pdf_w(wo, s.lobe.wi);
        return found;
    }
    s.delta = true;
    if (u < diffuse + metal || glass <= 0.0) {
        s.lobe = mirror_sample(k.base_color, wo);
        s.pdf_w = metal;
        return true;
    }
    float rest = clamp((u - diffuse - metal) / glass, 0.0, 1.0);
    float probability;
    bool found = dielectric_sample(k.base_color, k.ior, wo, rest, mode, s.lobe, probability);
    s.pdf_w = glass * probability;
    return found;
}

#endif
