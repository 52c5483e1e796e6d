// Twin of crates/lumbre-light/src/transport/bsdf/clearcoat.rs.
#ifndef TRANSPORT_BSDF_CLEARCOAT_GLSL
#define TRANSPORT_BSDF_CLEARCOAT_GLSL

#include "math/trig.glsl"
#include "transport/bsdf/fresnel.glsl"
#include "transport/bsdf/ggx.glsl"

// A clear coat: scale of the lobe, and width of the GTR1 lobe.
struct Clearcoat {
    float strength;
    float alpha;
    uint formulas;
};

// Builds a coat from the parameters `clearcoat` and `clearcoat_gloss`.
Clearcoat clearcoat_new(float clearcoat, float gloss, uint formulas) {
    return Clearcoat(0.25 * clearcoat, 0.1 + (0.001 - 0.1) * gloss, formulas);
}

// Returns the reflectance at a cosine, for the index 1.5.
float clearcoat_reflectance(Clearcoat c, float cos_theta) {
    return c.strength * (0.04 + (1.0 - 0.04) * schlick_weight(cos_theta));
}

// Returns the transmittance on the way in along one direction and out along another.
float clearcoat_transmittance(Clearcoat c, float cos_o, float cos_i) {
    return c.formulas == FORMULAS_LUMBRE
        ? (1.0 - clearcoat_reflectance(c, cos_o)) * (1.0 - clearcoat_reflectance(c, cos_i))
        : 1.0;
}

// Returns the density of normals per solid angle: GTR with exponent 1.
float clearcoat_d(Clearcoat c, vec3 h) {
    float a2 = c.alpha * c.alpha;
    float s = h.x * h.x + h.y * h.y + a2 * h.z * h.z;
    return (a2 - 1.0) / (PI * log(a2) * s);
}

// Evaluates the lobe for two directions on the upper side.
float clearcoat_eval(Clearcoat c, vec3 wo, vec3 wi, vec3 h) {
    Ggx masking = Ggx(vec2(0.25));
    float value = 0.25 * clearcoat_reflectance(c, dot(wo, h)) * clearcoat_d(c, h)
        * ggx_masking_over_cos(masking, wo) * ggx_masking_over_cos(masking, wi);
    return c.formulas == FORMULAS_LUMBRE ? value : value * (4.0 * wo.z * wi.z);
}

// Returns the density per solid angle of reflecting about a normal from `clearcoat_sample`.
float clearcoat_pdf_w(Clearcoat c, vec3 wo, vec3 h) {
    return clearcoat_d(c, h) * h.z / max(4.0 * dot(wo, h), 1e-12);
}

// Samples a normal with density `D cos` [Burley 2012, B.2].
vec3 clearcoat_sample(Clearcoat c, vec2 u) {
    float a2 = c.alpha * c.alpha;
    float cos2 = clamp((1.0 - pow(a2, 1.0 - u.x)) / (1.0 - a2), 0.0, 1.0);
    return vec3(sqrt(1.0 - cos2) * sin_cos(2.0 * PI * u.y).yx, sqrt(cos2));
}

#endif
