// Twin of crates/lumbre-light/src/transport/bsdf/diffuse.rs.
#ifndef TRANSPORT_BSDF_DIFFUSE_GLSL
#define TRANSPORT_BSDF_DIFFUSE_GLSL

#include "math/trig.glsl"
#include "transport/bsdf/fresnel.glsl"

// The parameters of the diffuse lobe at a point; fields as in Rust.
struct Diffuse {
    vec3 base_color;
    float roughness;
    float subsurface;
    vec3 sheen;
};

// Evaluates the lobe for two directions on the upper side [Burley 2012].
vec3 diffuse_eval(Diffuse d, vec3 wo, vec3 wi) {
    float l = schlick_weight(wi.z), v = schlick_weight(wo.z);
    float cos2_d = 0.5 + 0.5 * dot(wo, wi);
    float ss90 = d.roughness * cos2_d;
    float fd90 = 0.5 + 2.0 * ss90;
    float value = (1.0 + (fd90 - 1.0) * l) * (1.0 + (fd90 - 1.0) * v);
    if (d.subsurface > 0.0) {
        float fss = (1.0 + (ss90 - 1.0) * l) * (1.0 + (ss90 - 1.0) * v);
        float flat_value = 1.25 * (fss * (1.0 / max(wi.z + wo.z, 1e-6) - 0.5) + 0.5);
        value += (flat_value - value) * d.subsurface;
    }
    vec3 f = d.base_color * (value * FRAC_1_PI);
    if (d.sheen != vec3(0.0)) {
        f += d.sheen * schlick_weight(sqrt(max(cos2_d, 0.0)));
    }
    return f;
}

#endif
