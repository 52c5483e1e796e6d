// Twin of crates/lumbre-light/src/transport/bsdf/plastic.rs.
#ifndef TRANSPORT_BSDF_PLASTIC_GLSL
#define TRANSPORT_BSDF_PLASTIC_GLSL

#include "math/warp.glsl"
#include "scene.glsl"
#include "transport/bsdf/facets.glsl"
#include "transport/bsdf/fresnel.glsl"
#include "transport/bsdf/lobe.glsl"

// Plastic at a point of a surface; fields as in Rust.
struct Plastic {
    vec3 diffuse;
    vec3 specular;
    float ior;
    float internal;
    bool nonlinear;
    uint material;
    Facets facets;
};

// Returns the transmittance of the surface at a cosine at which a smooth one reflects `r`. That of
// microfacets is read from the material's row, so that others keep no table.
float plastic_through(Plastic p, float cos_theta, float r) {
    if (materials[p.material].rough_body == 0u) {
        return 1.0 - r;
    }
    vec4 first = materials[p.material].transmittance_grazing;
    float sum = first.x;
    for (int k = 1; k < 12; k++) {
        float slope = k < 4 ? first[k]
            : k < 8 ? materials[p.material].transmittance_middle[k - 4]
            : materials[p.material].transmittance_steep[k - 8];
        float from = float((k - 1) * (k - 1)) / 121.0, to = float(k * k) / 121.0;
        sum += slope * clamp(cos_theta - from, 0.0, to - from);
    }
    return sum;
}

// Returns the albedo of the body with all internal reflections, over the squared index.
vec3 plastic_body(Plastic p) {
    vec3 recurring = p.nonlinear ? p.diffuse * p.internal : vec3(p.internal);
    return p.diffuse / max(vec3(1.0) - recurring, vec3(1e-6)) / (p.ior * p.ior);
}

// Returns the probability of sampling the surface reflection, for a reflectance `r`.
float plastic_surface_probability(Plastic p, float r) {
    float surface = r * (dot(p.specular, vec3(1.0)) * (1.0 / 3.0));
    float body = (1.0 - r) * (dot(p.diffuse, vec3(1.0)) * (1.0 / 3.0));
    return surface + body > 0.0 ? surface / (surface + body) : 0.5;
}

// Returns the value and the densities of both directions, for two directions on the upper side.
Densities plastic_evaluate(Plastic p, vec3 o, vec3 i) {
    if (o.z <= 0.0 || i.z <= 0.0) {
        return NO_DENSITIES;
    }
    float r_o = fresnel_dielectric(o.z, p.ior).reflectance;
    float r_i = fresnel_dielectric(i.z, p.ior).reflectance;
    float surface_o = plastic_surface_probability(p, r_o);
    float surface_i = plastic_surface_probability(p, r_i);
    Densities d = Densities(
        plastic_body(p)
            * (plastic_through(p, o.z, r_o) * plastic_through(p, i.z, r_i) * FRAC_1_PI),
        (1.0 - surface_o) * cosine_hemisphere_pdf_w(i.z),
        (1.0 - surface_i) * cosine_hemisphere_pdf_w(o.z)
    );
    if (p.facets.present) {
        vec3 h = normalize_or(o + i, vec3(0.0, 0.0, 1.0));
        float quarter_d = 0.25 * facets_d(p.facets, h);
        float masking_o = facets_masking_over_cos(p.facets, o);
        float masking_i = facets_masking_over_cos(p.facets, i);
        float r = fresnel_dielectric(max(dot(o, h), 0.0), p.ior).reflectance;
        d.f += p.specular * (r * masking_o * quarter_d * masking_i);
        d.pdf_w += surface_o * masking_o * quarter_d;
        d.reverse_pdf_w += surface_i * masking_i * quarter_d;
    }
    return d;
}

// Samples a direction of the surface reflection or of the body, for `o` on the upper side.
bool plastic_sample(Plastic p, vec3 o, float u, vec2 v, out MixtureSample s) {
    float r = fresnel_dielectric(o.z, p.ior).reflectance;
    float surface = plastic_surface_probability(p, r);
    vec3 wi;
    if (u >= surface) {
        wi = cosine_hemisphere(v);
    } else if (p.facets.present) {
        wi = mirrored(o, facets_sample(p.facets, o, v));
    } else {
        s = MixtureSample(
            LobeSample(vec3(-o.xy, o.z), p.specular * (r / surface), 1.0), surface, true
        );
        return true;
    }
    Densities d = plastic_evaluate(p, o, wi);
    s = MixtureSample(LobeSample(wi, d.f * (wi.z / d.pdf_w), 1.0), d.pdf_w, false);
    return wi.z > 0.0 && d.pdf_w > 0.0 && is_finite(s.lobe.weight);
}

#endif
