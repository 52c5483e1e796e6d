// Twin of crates/lumbre-light/src/transport/bsdf/interface.rs.
#ifndef TRANSPORT_BSDF_INTERFACE_GLSL
#define TRANSPORT_BSDF_INTERFACE_GLSL

#include "scene.glsl"
#include "transport/bsdf/conductor.glsl"
#include "transport/bsdf/glass.glsl"
#include "transport/bsdf/lobe.glsl"
#include "transport/bsdf/plastic.glsl"

// A material with one interface at a point: its row, and the values of its textures.
struct InterfaceBsdf {
    uint material;
    vec3 base_color;
    Facets facets;
};

Conductor interface_conductor(InterfaceBsdf k) {
    Material m = materials[k.material];
    return Conductor(k.base_color * m.specular, m.eta, m.k, k.facets);
}

Plastic interface_plastic(InterfaceBsdf k) {
    Material m = materials[k.material];
    return Plastic(
        k.base_color, m.specular, m.ior, m.internal_reflectance, m.nonlinear != 0u, k.material,
        k.facets
    );
}

Glass interface_glass(InterfaceBsdf k) {
    Material m = materials[k.material];
    Facets facets = k.facets;
    facets.present = facets.present && m.thin == 0u && m.ior != 1.0;
    return Glass(k.base_color, m.specular, m.ior, m.thin != 0u, facets);
}

// Returns the index of the inside relative to the outside; 1 if light is not refracted.
float interface_index_inside(InterfaceBsdf k) {
    Material m = materials[k.material];
    return m.model == MODEL_DIELECTRIC && m.thin == 0u ? m.ior : 1.0;
}

// Returns the index of the side opposite to `wo` relative to the side of `wo`.
float interface_eta_below(InterfaceBsdf k, vec3 wo) {
    float ior = materials[k.material].ior;
    return wo.z < 0.0 ? 1.0 / ior : ior;
}

vec3 flipped(vec3 w) {
    return vec3(w.xy, -w.z);
}

// Returns the value, and the densities of `wi` given `wo` and of `wo` given `wi`.
Densities interface_evaluate(InterfaceBsdf k, vec3 wo, vec3 wi, uint mode) {
    uint model = materials[k.material].model;
    bool upper = wo.z >= 0.0;
    vec3 o = upper ? wo : flipped(wo), i = upper ? wi : flipped(wi);
    if (model == MODEL_CONDUCTOR) {
        return conductor_evaluate(interface_conductor(k), o, i);
    }
    if (model == MODEL_PLASTIC) {
        return plastic_evaluate(interface_plastic(k), o, i);
    }
    Glass g = interface_glass(k);
    Densities d;
    d.f = glass_density(g, o, i, interface_eta_below(k, wo), mode, d.pdf_w);
    bool above = wi.z >= 0.0;
    vec3 back_o = above ? wi : flipped(wi), back_i = above ? wo : flipped(wo);
    glass_density(g, back_o, back_i, interface_eta_below(k, wi), RADIANCE, d.reverse_pdf_w);
    return d;
}

// Returns whether any lobe has a density.
bool interface_has_density(InterfaceBsdf k) {
    uint model = materials[k.material].model;
    if (model == MODEL_DIELECTRIC) {
        return glass_has_density(interface_glass(k));
    }
    return k.facets.present || (model == MODEL_PLASTIC && k.base_color != vec3(0.0));
}

// Samples a direction: `u` selects the lobe, `v` the direction within it.
bool interface_sample(InterfaceBsdf k, vec3 wo, float u, vec2 v, uint mode, out MixtureSample s) {
    uint model = materials[k.material].model;
    vec3 o = wo.z >= 0.0 ? wo : flipped(wo);
    s = MixtureSample(LobeSample(o, vec3(0.0), 1.0), 0.0, false);
    if (o.z <= 0.0) {
        return false;
    }
    bool found;
    if (model == MODEL_CONDUCTOR) {
        found = conductor_sample(interface_conductor(k), o, v, s);
    } else if (model == MODEL_PLASTIC) {
        found = plastic_sample(interface_plastic(k), o, u, v, s);
    } else {
        found = glass_sample(interface_glass(k), o, interface_eta_below(k, wo), u, v, mode, s);
    }
    if (wo.z < 0.0) {
        s.lobe.wi = flipped(s.lobe.wi);
    }
    return found;
}

#endif
