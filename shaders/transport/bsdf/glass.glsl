// Twin of crates/lumbre-light/src/transport/bsdf/glass.rs.
#ifndef TRANSPORT_BSDF_GLASS_GLSL
#define TRANSPORT_BSDF_GLASS_GLSL

#include "transport/bsdf/dielectric.glsl"
#include "transport/bsdf/facets.glsl"
#include "transport/bsdf/fresnel.glsl"
#include "transport/bsdf/lobe.glsl"

// Glass at a point of a surface; fields as in Rust.
struct Glass {
    vec3 base_color;
    vec3 specular;
    float ior;
    bool thin;
    Facets facets;
};

vec3 glass_tint(Glass g) {
    return sqrt(g.base_color);
}

// Returns whether sampled directions have a density.
bool glass_has_density(Glass g) {
    return g.facets.present && !g.thin;
}

// Refraction at a microfacet; fields as in Rust.
struct Refraction {
    vec3 h;
    float transmittance;
    vec2 dots;
    float eta;
};

// Finds the microfacet that refracts `o` into `i`, if there is one; `eta` is the index of the lower
// side relative to the upper one.
bool refraction_between(vec3 o, vec3 i, float eta, out Refraction p) {
    vec3 h = normalize_or(o + i * eta, vec3(0.0, 0.0, 1.0));
    h = h.z < 0.0 ? -h : h;
    vec2 dots = vec2(dot(o, h), dot(i, h));
    p = Refraction(h, 1.0 - fresnel_dielectric(dots.x, eta).reflectance, dots, eta);
    return !(dots.x <= 0.0) && !(dots.y >= 0.0);
}

// Converts a density of facets over the cosine of `o` to a density of directions `i`, without the
// factor `eta^2`.
float refraction_direction_density(Refraction p, float density) {
    float bend = p.dots.x + p.eta * p.dots.y;
    return density * p.dots.x * -p.dots.y / (bend * bend);
}

// Returns the factor of the transport mode: radiance is compressed into `1 / eta^2` of the solid
// angle of importance.
float refraction_scale(Refraction p, uint mode) {
    return mode == RADIANCE ? 1.0 : p.eta * p.eta;
}

// Computes the direction refracted at `h`, a unit vector even near the normal; false if there is
// none.
bool refracted(vec3 o, vec3 h, float eta, out vec3 wi) {
    vec3 along = (h * dot(o, h) - o) / eta;
    float cos2_t = 1.0 - length_squared(along);
    wi = along - h * sqrt(max(cos2_t, 0.0));
    return cos2_t > 0.0;
}

// Returns value and density of `i` given `o`, for `o` on the upper side; `eta` is the index of the
// lower side relative to the upper one.
vec3 glass_density(Glass g, vec3 o, vec3 i, float eta, uint mode, out float pdf_w) {
    pdf_w = 0.0;
    if (!glass_has_density(g) || o.z <= 0.0 || i.z == 0.0) {
        return vec3(0.0);
    }
    if (i.z > 0.0) {
        vec3 h = normalize_or(o + i, vec3(0.0, 0.0, 1.0));
        float r = fresnel_dielectric(max(dot(o, h), 0.0), eta).reflectance;
        pdf_w = 0.25 * r * facets_pdf_over_dot(g.facets, o, h);
        return g.specular * (pdf_w * facets_masking_over_cos(g.facets, i));
    }
    Refraction refraction;
    if (!refraction_between(o, i, eta, refraction)) {
        return vec3(0.0);
    }
    float facet_density = refraction_direction_density(
        refraction, refraction.transmittance * facets_pdf_over_dot(g.facets, o, refraction.h)
    );
    pdf_w = facet_density * eta * eta;
    float masking = facets_masking_over_cos(g.facets, vec3(i.xy, -i.z));
    return glass_tint(g) * (facet_density * masking * refraction_scale(refraction, mode));
}

// Samples a thin pane: reflection by either face, or transmission.
MixtureSample glass_through_pane(Glass g, vec3 o, float u) {
    float once = fresnel_dielectric(o.z, max(g.ior, 1.0 / g.ior)).reflectance;
    float r = 2.0 * once / (1.0 + once);
    if (u < r) {
        return MixtureSample(LobeSample(vec3(-o.xy, o.z), g.specular, 1.0), r, true);
    }
    return MixtureSample(LobeSample(-o, glass_tint(g), 1.0), 1.0 - r, true);
}

// Samples a direction for `o` on the upper side.
bool glass_sample(Glass g, vec3 o, float eta, float u, vec2 v, uint mode, out MixtureSample s) {
    if (g.thin) {
        s = glass_through_pane(g, o, u);
        return true;
    }
    if (!g.facets.present) {
        s.delta = true;
        bool found = dielectric_sample(g.base_color, eta, o, u, mode, s.lobe, s.pdf_w);
        if (s.lobe.eta == 1.0) {
            s.lobe.weight *= g.specular;
        }
        return found;
    }
    vec3 h = facets_sample(g.facets, o, v);
    bool reflects = u < fresnel_dielectric(max(dot(o, h), 0.0), eta).reflectance;
    vec3 wi = mirrored(o, h);
    bool found = reflects || refracted(o, h, eta, wi);
    float pdf_w;
    vec3 f = glass_density(g, o, wi, eta, mode, pdf_w);
    s = MixtureSample(LobeSample(wi, f * (abs(wi.z) / pdf_w), reflects ? 1.0 : eta), pdf_w, false);
    return found && (wi.z > 0.0) == reflects && pdf_w > 0.0 && is_finite(s.lobe.weight);
}

#endif
