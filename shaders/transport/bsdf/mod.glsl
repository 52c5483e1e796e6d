// Twin of crates/lumbre-light/src/transport/bsdf/mod.rs.
#ifndef TRANSPORT_BSDF_MOD_GLSL
#define TRANSPORT_BSDF_MOD_GLSL

#include "scene.glsl"
#include "math/frame.glsl"
#include "transport/bsdf/disney.glsl"
#include "transport/bsdf/ideal.glsl"
#include "transport/bsdf/interface.glsl"
#include "transport/bsdf/lobe.glsl"
#include "transport/bsdf/oren_nayar.glsl"
#include "transport/bsdf/translucent.glsl"
#include "transport/surface.glsl"

// A sampled direction in world space; fields as in Rust.
struct BsdfSample {
    vec3 wi;
    vec3 weight;
    float pdf_w;
    bool delta;
    float eta;
};

// A BSDF value with the densities of both directions of the path; Dirac lobes are left out.
struct BsdfValue {
    vec3 f;
    float pdf_w;
    float reverse_pdf_w;
};

// A pipeline omits the models that are not in the scene.
const bool HAS_DISNEY = (MODELS & (1u << MODEL_DISNEY)) != 0u;
const bool HAS_TRANSLUCENT = (MODELS & (1u << MODEL_TRANSLUCENT)) != 0u;
const bool HAS_OREN_NAYAR = (MODELS & (1u << MODEL_OREN_NAYAR)) != 0u;
const bool HAS_INTERFACE =
    (MODELS & (1u << MODEL_CONDUCTOR | 1u << MODEL_PLASTIC | 1u << MODEL_DIELECTRIC)) != 0u;

// The BSDF at a point of a surface. `disney` also stores the other models: base colour, index and
// weights of an ideal surface; base colour, alpha and smoothness of an interface, whose other
// parameters are in the material's row; base colour of a translucent sheet, its transmittance as
// `tinted_f0`, and an index of 1; base colour of a rough diffuse surface, its roughness as that of
// `diffuse`, and an index of 1.
struct Bsdf {
    Frame frame;
    vec3 n_geometric;
    bool terminator;
    uint model;
    uint material;
    Disney disney;
};

bool bsdf_is_disney(Bsdf b) {
    return HAS_DISNEY && b.model == MODEL_DISNEY;
}

bool bsdf_is_interface(Bsdf b) {
    return HAS_INTERFACE && b.model >= MODEL_CONDUCTOR && b.model <= MODEL_DIELECTRIC;
}

bool bsdf_is_translucent(Bsdf b) {
    return HAS_TRANSLUCENT && b.model == MODEL_TRANSLUCENT;
}

bool bsdf_is_oren_nayar(Bsdf b) {
    return HAS_OREN_NAYAR && b.model == MODEL_OREN_NAYAR;
}

OrenNayar bsdf_oren_nayar(Bsdf b) {
    return oren_nayar_new(b.disney.base_color, b.disney.diffuse.roughness);
}

Translucent bsdf_translucent(Bsdf b) {
    return translucent_new(b.disney.base_color, b.disney.tinted_f0);
}

InterfaceBsdf bsdf_interface(Bsdf b) {
    Facets facets = Facets(
        !b.disney.is_smooth, materials[b.material].distribution, b.disney.ggx.alpha
    );
    return InterfaceBsdf(b.material, b.disney.base_color, facets);
}

Ideal bsdf_ideal(Bsdf b) {
    return Ideal(
        b.disney.base_color, b.disney.ior,
        vec3(b.disney.opaque, b.disney.metallic, b.disney.refractive), b.disney.one_sided
    );
}

// Returns a colour of luminance 1 with the hue of `c`; white for black.
vec3 hue_of(vec3 c) {
    float luminance = dot(c, vec3(0.2126, 0.7152, 0.0722));
    return luminance > 0.0 ? c / luminance : vec3(1.0);
}

// Returns white blended with the colour's hue by `amount`.
vec3 hue(vec3 base_color, float amount) {
    return amount > 0.0 ? mix(vec3(1.0), hue_of(base_color), amount) : vec3(1.0);
}

// Builds the local frame: its x axis is the direction of anisotropy, if there is one.
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

// Builds the BSDF of a surface.
Bsdf bsdf_new(Surface s) {
    Material m = materials[s.material];
    Bsdf b;
    b.frame = bsdf_frame(s);
    b.n_geometric = s.n_geometric;
    b.terminator = s.terminator.present;
    b.model = m.model;
    b.material = s.material;
    vec3 base_color = surface_base_color(s);
    if (bsdf_is_translucent(b)) {
        vec3 texel = lookup(m.transmittance_texture, s.uv, s.material);
        b.disney.base_color = base_color;
        b.disney.tinted_f0 = m.transmittance * texel;
        b.disney.ior = 1.0;
        b.disney.one_sided = false;
        return b;
    }
    float roughness = lookup_scalar(m.roughness_texture, s.uv, s.material, m.roughness);
    if (m.alpha_texels != 0u && m.roughness_texture != NONE) {
        roughness = sqrt(roughness);
    }
    if (bsdf_is_oren_nayar(b)) {
        b.disney.base_color = base_color;
        b.disney.diffuse.roughness = roughness;
        b.disney.ior = 1.0;
        b.disney.one_sided = m.one_sided != 0u;
        return b;
    }
    float metallic = lookup_scalar(m.metallic_texture, s.uv, s.material, m.metallic);
    float opacity = lookup_scalar(m.opacity_texture, s.uv, s.material, m.opacity);
    b.disney.base_color = base_color;
    b.disney.opaque = (1.0 - metallic) * opacity;
    b.disney.metallic = metallic;
    b.disney.refractive = (1.0 - metallic) * (1.0 - opacity);
    b.disney.ior = m.ior;
    b.disney.one_sided = m.one_sided != 0u;
    if (m.model == MODEL_LAMBERT) {
        return b;
    }
    b.disney.ggx = ggx_new(roughness, m.anisotropic);
    b.disney.is_smooth = roughness < m.smooth_below;
    if (!bsdf_is_disney(b)) {
        return b;
    }
    b.disney.tinted = m.specular_tint > 0.0;
    b.disney.tinted_f0 = min(hue(base_color, m.specular_tint) * f0_of(m.ior), vec3(1.0));
    vec3 sheen = m.sheen > 0.0 ? hue(base_color, m.sheen_tint) * m.sheen : vec3(0.0);
    b.disney.diffuse = Diffuse(base_color, roughness, m.subsurface, sheen);
    b.disney.schlick_share = m.formulas == FORMULAS_MITSUBA ? m.specular_tint : -1.0;
    b.disney.coat = clearcoat_new(m.clearcoat, m.clearcoat_gloss, m.formulas);
    return b;
}

// Returns whether a direction is on the same side of the geometric surface and of the surface that
// the shading normal suggests, and not at the back of a surface whose lobes are all missing there.
bool bsdf_same_side(Bsdf b, vec3 w, vec3 local) {
    bool front_only = b.disney.one_sided
        && (b.model == MODEL_CONDUCTOR || b.model == MODEL_PLASTIC || bsdf_is_oren_nayar(b));
    return dot(w, b.n_geometric) * local.z > 0.0 && !(front_only && local.z < 0.0);
}

// Returns whether light may pass between `wi` and an allowed outgoing direction.
bool bsdf_allows_incident(Bsdf b, vec3 wi, vec3 i, vec3 o, uint mode) {
    return bsdf_same_side(b, wi, i) || (b.terminator && mode == RADIANCE && o.z * i.z > 0.0);
}

// Returns |wo . n_s| |wi . n_g| / (|wo . n_g| |wi . n_s|) [Veach 1997, equation 5.19].
float bsdf_adjoint(Bsdf b, vec3 wo, vec3 wi, vec3 o, vec3 i) {
    if (b.frame.n == b.n_geometric) {
        return 1.0;
    }
    float factor = (o.z * dot(wi, b.n_geometric)) / (dot(wo, b.n_geometric) * i.z);
    return is_finite(factor) ? abs(factor) : 0.0;
}

// Returns value and both densities at once; `bsdf_eval` and `bsdf_pdf_w` return its parts.
BsdfValue bsdf_evaluate(Bsdf b, vec3 wo, vec3 wi, uint mode) {
    vec3 o = frame_to_local(b.frame, wo), i = frame_to_local(b.frame, wi);
    Densities d;
    if (bsdf_is_disney(b)) {
        d = disney_evaluate(b.disney, o, i, mode);
    } else if (bsdf_is_interface(b)) {
        d = interface_evaluate(bsdf_interface(b), o, i, mode);
    } else if (bsdf_is_translucent(b)) {
        Translucent k = bsdf_translucent(b);
        d = Densities(
            translucent_eval(k, o, i), translucent_pdf_w(k, o, i), translucent_pdf_w(k, i, o)
        );
    } else if (bsdf_is_oren_nayar(b)) {
        d = Densities(
            oren_nayar_eval(bsdf_oren_nayar(b), o, i), lambert_pdf_w(o, i), lambert_pdf_w(i, o)
        );
    } else {
        Ideal k = bsdf_ideal(b);
        d = Densities(ideal_eval(k, o, i), ideal_pdf_w(k, o, i), ideal_pdf_w(k, i, o));
    }
    if (mode == IMPORTANCE) {
        d.f *= bsdf_adjoint(b, wo, wi, o, i);
    }
    bool same_side = bsdf_same_side(b, wo, o);
    return BsdfValue(
        same_side && bsdf_allows_incident(b, wi, i, o, mode) ? d.f : vec3(0.0),
        same_side && bsdf_allows_incident(b, wi, i, o, RADIANCE) ? d.pdf_w : 0.0,
        bsdf_same_side(b, wi, i) && bsdf_allows_incident(b, wo, o, i, RADIANCE)
            ? d.reverse_pdf_w : 0.0
    );
}

// Returns the value `f` without cosine, of the lobes that have a density; for importance with the
// correction of shading normals.
vec3 bsdf_eval(Bsdf b, vec3 wo, vec3 wi, uint mode) {
    return bsdf_evaluate(b, wo, wi, mode).f;
}

// Returns the density per solid angle with which `bsdf_sample` returns `wi`, without Dirac lobes.
float bsdf_pdf_w(Bsdf b, vec3 wo, vec3 wi) {
    return bsdf_evaluate(b, wo, wi, RADIANCE).pdf_w;
}

// Returns the index of the medium on the side of `wi` over that on the side of `wo`; 1 on the same
// side of the surface.
float bsdf_index_ratio(Bsdf b, vec3 wo, vec3 wi) {
    float o = dot(wo, b.frame.n);
    if (o * dot(wi, b.frame.n) >= 0.0) {
        return 1.0;
    }
    float inside = bsdf_is_interface(b) ? interface_index_inside(bsdf_interface(b)) : b.disney.ior;
    return o > 0.0 ? inside : 1.0 / inside;
}

// Returns whether any lobe has a density.
bool bsdf_has_density(Bsdf b) {
    if (bsdf_is_disney(b)) {
        return disney_has_density(b.disney);
    }
    if (bsdf_is_translucent(b)) {
        return translucent_has_density(bsdf_translucent(b));
    }
    if (bsdf_is_oren_nayar(b)) {
        return true;
    }
    return bsdf_is_interface(b) ? interface_has_density(bsdf_interface(b)) : b.disney.opaque > 0.0;
}

// Samples a direction; false if nothing is reflected. `u` and `v` as in Rust.
bool bsdf_sample(Bsdf b, vec3 wo, float u, vec2 v, uint mode, out BsdfSample s) {
    vec3 o = frame_to_local(b.frame, wo);
    MixtureSample l;
    bool found;
    if (bsdf_is_disney(b)) {
        found = disney_sample(b.disney, o, u, v, mode, l);
    } else if (bsdf_is_interface(b)) {
        found = interface_sample(bsdf_interface(b), o, u, v, mode, l);
    } else if (bsdf_is_translucent(b)) {
        found = translucent_sample(bsdf_translucent(b), o, u, v, l);
    } else if (bsdf_is_oren_nayar(b)) {
        found = oren_nayar_sample(bsdf_oren_nayar(b), o, v, l);
    } else {
        found = ideal_sample(bsdf_ideal(b), o, u, v, mode, l);
    }
    vec3 wi = frame_to_world(b.frame, l.lobe.wi);
    if (mode == IMPORTANCE) {
        l.lobe.weight *= bsdf_adjoint(b, wo, wi, o, l.lobe.wi);
    }
    s = BsdfSample(wi, l.lobe.weight, l.pdf_w, l.delta, l.lobe.eta);
    return found && l.pdf_w > 0.0 && bsdf_same_side(b, wo, o)
        && bsdf_allows_incident(b, wi, l.lobe.wi, o, mode);
}

#endif
