// Twin of src/transport/bsdf/mod.rs.
#ifndef TRANSPORT_BSDF_MOD_GLSL
#define TRANSPORT_BSDF_MOD_GLSL

#include "scene.glsl"
#include "math/frame.glsl"
#include "transport/bsdf/disney.glsl"
#include "transport/bsdf/ideal.glsl"
#include "transport/bsdf/interface.glsl"
#include "transport/bsdf/lobe.glsl"
#include "transport/surface.glsl"

// A sampled direction in world space; fields as in Rust.
struct BsdfSample {
    vec3 wi;
    vec3 weight;
    float pdf_w;
    bool delta;
    float eta;
};

// A value with the densities of both directions in which a path may run through it; Dirac lobes are left out.
struct BsdfValue {
    vec3 f;
    float pdf_w;
    float reverse_pdf_w;
};

// The models of the scene, one bit each: a pipeline is made without the others. All, where nothing is said.
#ifndef MODELS
#define MODELS 31
#endif
const bool HAS_DISNEY = (MODELS & (1 << int(MODEL_DISNEY))) != 0;
const bool HAS_INTERFACE = (MODELS >> int(MODEL_CONDUCTOR)) != 0;

// The BSDF at a point of a surface, where `disney` holds more models than its own: of an ideal one base colour, index and
// weights; of an interface base colour, alpha and whether it is smooth, and the material's row says the rest.
struct Bsdf {
    Frame frame;
    vec3 n_geometric;
    bool overhang;
    uint model;
    uint material;
    Disney disney;
};

bool bsdf_is_disney(Bsdf b) {
    return HAS_DISNEY && b.model == MODEL_DISNEY;
}

bool bsdf_is_interface(Bsdf b) {
    return HAS_INTERFACE && b.model >= MODEL_CONDUCTOR;
}

OneInterface bsdf_interface(Bsdf b) {
    Facets facets = Facets(!b.disney.is_smooth, materials[b.material].distribution, b.disney.ggx.alpha);
    return OneInterface(b.material, b.disney.base_color, facets);
}

Ideal bsdf_ideal(Bsdf b) {
    return Ideal(b.disney.base_color, b.disney.ior, vec3(b.disney.opaque, b.disney.metallic, b.disney.refractive));
}

// A colour of luminance 1 with the hue of the given one; white for black.
vec3 hue_of(vec3 c) {
    float luminance = dot(c, vec3(0.2126, 0.7152, 0.0722));
    return luminance > 0.0 ? c / luminance : vec3(1.0);
}

// White, or the colour's hue by that part.
vec3 hue(vec3 base_color, float part) {
    return part > 0.0 ? mix(vec3(1.0), hue_of(base_color), part) : vec3(1.0);
}

// The local frame: its x axis along the direction of anisotropy, where there is one.
Frame bsdf_frame(Surface s) {
    vec3 n = s.n_shading;
    if (s.tangent != vec3(0.0)) {
        vec3 t = normalize_or(cross(n, s.tangent), vec3(0.0));
        if (t != vec3(0.0)) {
            return Frame(cross(t, n), t, n);
        }
    }
    return frame_from_normal(n);
}

// The BSDF of a surface.
Bsdf bsdf_new(Surface s) {
    Material m = materials[s.material];
    Bsdf b;
    b.frame = bsdf_frame(s);
    b.n_geometric = s.n_geometric;
    b.overhang = s.overhang.present;
    b.model = m.model;
    b.material = s.material;
    vec3 base_color = surface_base_color(s);
    float metallic = lookup_scalar(m.metallic_texture, s.uv, s.material, m.metallic);
    float opacity = lookup_scalar(m.opacity_texture, s.uv, s.material, m.opacity);
    b.disney.base_color = base_color;
    b.disney.opaque = (1.0 - metallic) * opacity;
    b.disney.metallic = metallic;
    b.disney.refractive = (1.0 - metallic) * (1.0 - opacity);
    b.disney.ior = m.ior;
    if (m.model == MODEL_LAMBERT) {
        return b;
    }
    float roughness = lookup_scalar(m.roughness_texture, s.uv, s.material, m.roughness);
    b.disney.ggx = ggx_new(roughness, m.anisotropic);
    b.disney.is_smooth = roughness < m.smooth_below;
    if (!bsdf_is_disney(b)) {
        return b;
    }
    b.disney.tinted = m.specular_tint > 0.0;
    b.disney.tinted_f0 = min(hue(base_color, m.specular_tint) * f0_of(m.ior), vec3(1.0));
    vec3 sheen = m.sheen > 0.0 ? hue(base_color, m.sheen_tint) * m.sheen : vec3(0.0);
    b.disney.diffuse = Diffuse(base_color, roughness, m.subsurface, sheen);
    b.disney.coat = clearcoat_new(m.clearcoat, m.clearcoat_gloss);
    return b;
}

// Whether a direction is on the same side of the real surface and of the one that the shading normal suggests.
bool bsdf_agrees(Bsdf b, vec3 w, vec3 local) {
    return dot(w, b.n_geometric) * local.z > 0.0;
}

// Whether light may pass between `wi` and a direction that is allowed.
bool bsdf_lets_in(Bsdf b, vec3 wi, vec3 i, vec3 o, uint mode) {
    return bsdf_agrees(b, wi, i) || (b.overhang && mode == RADIANCE && o.z * i.z > 0.0);
}

// |wo . n_s| |wi . n_g| / (|wo . n_g| |wi . n_s|) [Veach 1997, equation 5.19].
float bsdf_adjoint(Bsdf b, vec3 wo, vec3 wi, vec3 o, vec3 i) {
    if (b.frame.n == b.n_geometric) {
        return 1.0;
    }
    float factor = (o.z * dot(wi, b.n_geometric)) / (dot(wo, b.n_geometric) * i.z);
    return is_finite(factor) ? abs(factor) : 0.0;
}

// Value and both densities at once; `bsdf_eval` and `bsdf_pdf_w` are its parts.
BsdfValue bsdf_evaluate(Bsdf b, vec3 wo, vec3 wi, uint mode) {
    vec3 o = frame_to_local(b.frame, wo), i = frame_to_local(b.frame, wi);
    Densities d;
    if (bsdf_is_disney(b)) {
        d = disney_evaluate(b.disney, o, i, mode);
    } else if (bsdf_is_interface(b)) {
        d = interface_evaluate(bsdf_interface(b), o, i, mode);
    } else {
        Ideal k = bsdf_ideal(b);
        d = Densities(ideal_eval(k, o, i), ideal_pdf_w(k, o, i), ideal_pdf_w(k, i, o));
    }
    if (mode == IMPORTANCE) {
        d.f *= bsdf_adjoint(b, wo, wi, o, i);
    }
    bool agrees = bsdf_agrees(b, wo, o);
    return BsdfValue(
        agrees && bsdf_lets_in(b, wi, i, o, mode) ? d.f : vec3(0.0),
        agrees && bsdf_lets_in(b, wi, i, o, RADIANCE) ? d.pdf_w : 0.0,
        bsdf_agrees(b, wi, i) && bsdf_lets_in(b, wo, o, i, RADIANCE) ? d.reverse_pdf_w : 0.0
    );
}

// Value `f` without cosine, of the lobes that have one; for importance with the correction of shading normals.
vec3 bsdf_eval(Bsdf b, vec3 wo, vec3 wi, uint mode) {
    return bsdf_evaluate(b, wo, wi, mode).f;
}

// Density per solid angle with which `bsdf_sample` returns `wi`, Dirac lobes left out.
float bsdf_pdf_w(Bsdf b, vec3 wo, vec3 wi) {
    return bsdf_evaluate(b, wo, wi, RADIANCE).pdf_w;
}

// Index of the medium towards `wi` over that towards `wo`; 1 on one side of the surface.
float bsdf_index_ratio(Bsdf b, vec3 wo, vec3 wi) {
    float o = dot(wo, b.frame.n);
    if (o * dot(wi, b.frame.n) >= 0.0) {
        return 1.0;
    }
    float inside = bsdf_is_interface(b) ? interface_index_inside(bsdf_interface(b)) : b.disney.ior;
    return o > 0.0 ? inside : 1.0 / inside;
}

// Whether any lobe has a density.
bool bsdf_has_density(Bsdf b) {
    if (bsdf_is_disney(b)) {
        return disney_has_density(b.disney);
    }
    return bsdf_is_interface(b) ? interface_has_density(bsdf_interface(b)) : b.disney.opaque > 0.0;
}

// Samples a direction, if anything is reflected; `u` and `v` as in Rust.
bool bsdf_sample(Bsdf b, vec3 wo, float u, vec2 v, uint mode, out BsdfSample s) {
    vec3 o = frame_to_local(b.frame, wo);
    Local l;
    bool found;
    if (bsdf_is_disney(b)) {
        found = disney_sample(b.disney, o, u, v, mode, l);
    } else if (bsdf_is_interface(b)) {
        found = interface_sample(bsdf_interface(b), o, u, v, mode, l);
    } else {
        found = ideal_sample(bsdf_ideal(b), o, u, v, mode, l);
    }
    vec3 wi = frame_to_world(b.frame, l.lobe.wi);
    if (mode == IMPORTANCE) {
        l.lobe.weight *= bsdf_adjoint(b, wo, wi, o, l.lobe.wi);
    }
    s = BsdfSample(wi, l.lobe.weight, l.pdf_w, l.delta, l.lobe.eta);
    return found && l.pdf_w > 0.0 && bsdf_agrees(b, wo, o) && bsdf_lets_in(b, wi, l.lobe.wi, o, mode);
}

#endif
