// Twin of crates/lumbre-light/src/transport/bsdf/facets.rs.
#ifndef TRANSPORT_BSDF_FACETS_GLSL
#define TRANSPORT_BSDF_FACETS_GLSL

#include "scene.glsl"
#include "transport/bsdf/beckmann.glsl"
#include "transport/bsdf/ggx.glsl"

// Microfacets, if `present`: their distribution, and alpha along the tangent and the bitangent.
struct Facets {
    bool present;
    uint distribution;
    vec2 alpha;
};

// Returns the density of normals per solid angle and area.
float facets_d(Facets f, vec3 h) {
    return f.distribution == DISTRIBUTION_GGX ? ggx_d(Ggx(f.alpha), h) : beckmann_d(f.alpha, h);
}

// Returns Smith's masking over the cosine.
float facets_masking_over_cos(Facets f, vec3 w) {
    return f.distribution == DISTRIBUTION_GGX
        ? ggx_masking_over_cos(Ggx(f.alpha), w)
        : beckmann_masking_over_cos(f.alpha, w);
}

// Returns the density of `facets_sample` over `wo . h`.
float facets_pdf_over_dot(Facets f, vec3 wo, vec3 h) {
    return facets_masking_over_cos(f, wo) * facets_d(f, h);
}

// Samples a normal that is visible from `wo`.
vec3 facets_sample(Facets f, vec3 wo, vec2 u) {
    return f.distribution == DISTRIBUTION_GGX
        ? ggx_sample(Ggx(f.alpha), wo, u)
        : beckmann_sample(f.alpha, wo, u);
}

// Returns the mirror image of `o` about `h`.
vec3 mirrored(vec3 o, vec3 h) {
    return h * (2.0 * dot(o, h)) - o;
}

#endif
