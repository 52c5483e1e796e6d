// Twin of crates/lumbre-light/src/transport/bsdf/ggx.rs.
#ifndef TRANSPORT_BSDF_GGX_GLSL
#define TRANSPORT_BSDF_GGX_GLSL

#include "math/trig.glsl"

// Minimum alpha.
const float MIN_ALPHA = 0.001;

// A surface of GGX microfacets: roughness along the tangent and the bitangent.
struct Ggx {
    vec2 alpha;
};

// Builds the surface from perceptual roughness and anisotropy [Burley 2012].
Ggx ggx_new(float roughness, float anisotropic) {
    float alpha = roughness * roughness;
    float aspect = sqrt(1.0 - 0.9 * anisotropic);
    return Ggx(max(vec2(alpha / aspect, alpha * aspect), vec2(MIN_ALPHA)));
}

// Returns the density of microfacet normals per solid angle and area of the macroscopic surface
// [Walter et al. 2007].
float ggx_d(Ggx g, vec3 h) {
    vec2 xy = h.xy / g.alpha;
    float s = dot(xy, xy) + h.z * h.z;
    return FRAC_1_PI / (g.alpha.x * g.alpha.y * s * s);
}

// Returns Smith's masking over the cosine [Heitz 2014].
float ggx_masking_over_cos(Ggx g, vec3 w) {
    vec2 xy = g.alpha * w.xy;
    return 2.0 / (w.z + sqrt(w.z * w.z + dot(xy, xy)));
}

// Returns the density with which `ggx_sample` samples the normal `h`, over `wo . h`.
float ggx_pdf_over_dot(Ggx g, vec3 wo, vec3 h) {
    return ggx_masking_over_cos(g, wo) * ggx_d(g, h);
}

// Samples a microfacet normal with the density of those visible from `wo` [Heitz 2018; Dupuy &
// Benyoub 2023].
vec3 ggx_sample(Ggx g, vec3 wo, vec2 u) {
    vec3 w = normalize_or(vec3(g.alpha * wo.xy, wo.z), vec3(0.0, 0.0, 1.0));
    float z = (1.0 - u.y) * (1.0 + w.z) - w.z;
    float r = sqrt(max(1.0 - z * z, 0.0));
    vec3 h = vec3(r * sin_cos(TAU * u.x).yx, z) + w;
    return normalize_or(vec3(g.alpha * h.xy, max(h.z, 0.0)), vec3(0.0, 0.0, 1.0));
}

#endif
