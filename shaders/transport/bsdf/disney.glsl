// Twin of crates/lumbre-light/src/transport/bsdf/disney.rs and crates/lumbre-light/src/transport/bsdf/disney/sampling.rs.
#ifndef TRANSPORT_BSDF_DISNEY_GLSL
#define TRANSPORT_BSDF_DISNEY_GLSL

#include "math/warp.glsl"
#include "transport/bsdf/clearcoat.glsl"
#include "transport/bsdf/dielectric.glsl"
#include "transport/bsdf/diffuse.glsl"
#include "transport/bsdf/facets.glsl"
#include "transport/bsdf/fresnel.glsl"
#include "transport/bsdf/ggx.glsl"
#include "transport/bsdf/glass.glsl"
#include "transport/bsdf/lobe.glsl"

// Bend in radians below which a refractive interface is treated as smooth.
const float MIN_BEND = 1e-4;
// Minimum sampling probability of a rough lobe relative to its weight.
const float MIN_ROUGH = 0.02;

// The parameters of the Disney BSDF at a point; fields as in Rust. `tinted_f0` is used if `tinted`;
// `schlick_share` is negative by the formulas of this renderer.
struct Disney {
    vec3 base_color;
    float opaque;
    float metallic;
    float refractive;
    float ior;
    bool tinted;
    vec3 tinted_f0;
    float schlick_share;
    Diffuse diffuse;
    Ggx ggx;
    bool is_smooth;
    bool one_sided;
    Clearcoat coat;
};

// Sampling probabilities of the lobes: all zero if nothing is reflected.
struct LobeProbabilities {
    float diffuse;
    float reflection;
    float glass;
    float coat;
};

// Returns the reflectance at normal incidence of an index.
float f0_of(float ior) {
    float r = (ior - 1.0) / (ior + 1.0);
    return r * r;
}

// Returns the reflectance of the opaque dielectric, tinted at normal incidence and blending to
// white as the exact reflectance does.
vec3 disney_dielectric_reflectance(Disney k, float cos_theta) {
    float exact = fresnel_dielectric(abs(cos_theta), k.ior).reflectance;
    if (!k.tinted) {
        return vec3(exact);
    }
    float f0 = f0_of(k.ior);
    if (k.schlick_share >= 0.0) {
        float white = schlick_weight(abs(cos_theta)), rest = 1.0 - white;
        float plain = (1.0 - k.schlick_share) * (exact - f0 * rest);
        return k.tinted_f0 * rest + vec3(plain + k.schlick_share * white);
    }
    float blend = (exact - f0) / (1.0 - f0);
    return max(k.tinted_f0 + (vec3(1.0) - k.tinted_f0) * blend, vec3(0.0));
}

// Returns the weighted sum of the reflectances of the opaque dielectric and the metal.
vec3 disney_opaque_reflectance(Disney k, float cos_theta) {
    vec3 f = vec3(0.0);
    if (k.opaque > 0.0) {
        f += disney_dielectric_reflectance(k, cos_theta) * k.opaque;
    }
    if (k.metallic > 0.0) {
        f += fresnel_schlick(k.base_color, cos_theta) * k.metallic;
    }
    return f;
}

// Returns the BSDF without the lobes that are missing if `wo` is below the surface.
Disney disney_seen_from(Disney k, bool below) {
    if (k.one_sided && below) {
        k.opaque = 0.0;
        k.metallic = 0.0;
        k.coat.strength = 0.0;
    }
    return k;
}

// Returns whether the refractive lobe is a Dirac lobe.
bool disney_smooth_glass(Disney k) {
    return k.is_smooth || abs(k.ior - 1.0) * k.ggx.alpha.y < MIN_BEND;
}

// Returns whether any lobe has a density.
bool disney_has_density(Disney k) {
    return k.opaque > 0.0 || (k.metallic > 0.0 && !k.is_smooth)
        || (k.refractive > 0.0 && !disney_smooth_glass(k))
        || k.coat.strength > 0.0;
}

// Computes sampling probabilities in proportion to the estimated reflectance of each lobe; false if
// nothing is reflected.
bool disney_lobe_probabilities(Disney k, float cos_o, out LobeProbabilities c) {
    float rise = schlick_weight(cos_o);
    float color = dot(k.base_color, vec3(1.0)) * (1.0 / 3.0);
    float f0 = f0_of(k.ior);
    float reflection = k.opaque * (f0 + (1.0 - f0) * rise)
        + k.metallic * (color + (1.0 - color) * rise);
    if (!k.is_smooth) {
        reflection += MIN_ROUGH * (k.opaque + k.metallic);
    }
    float diffuse = k.opaque * (color + 0.25 * (dot(k.diffuse.sheen, vec3(1.0)) * (1.0 / 3.0)));
    float coat = clearcoat_reflectance(k.coat, cos_o);
    float total = diffuse + reflection + k.refractive + coat;
    bool any_lobe = total > 0.0;
    float scale = any_lobe ? 1.0 / total : 0.0;
    c = LobeProbabilities(diffuse * scale, reflection * scale, k.refractive * scale, coat * scale);
    return any_lobe;
}

// Mirrors both directions so that `wo` is on the upper side; returns the index of the lower side.
float disney_upper(Disney k, inout vec3 wo, inout vec3 wi) {
    if (wo.z >= 0.0) {
        return k.ior;
    }
    wo.z = -wo.z;
    wi.z = -wi.z;
    return 1.0 / k.ior;
}

// Returns value and densities of reflection: of `i` given `o` and of `o` given `i`. Densities are
// zero if the probabilities of the lobes are zero.
Densities disney_reflected(
    Disney k, vec3 o, vec3 i, float eta, LobeProbabilities from_o, LobeProbabilities from_i
) {
    Densities d = NO_DENSITIES;
    if (k.opaque > 0.0) {
        d.f += diffuse_eval(k.diffuse, o, i) * k.opaque;
        d.pdf_w += from_o.diffuse * cosine_hemisphere_pdf_w(i.z);
        d.reverse_pdf_w += from_i.diffuse * cosine_hemisphere_pdf_w(o.z);
    }
    vec3 h = normalize_or(o + i, vec3(0.0, 0.0, 1.0));
    float cos_h = dot(o, h);
    if (!k.is_smooth) {
        float quarter_d = 0.25 * ggx_d(k.ggx, h);
        float masking_o = ggx_masking_over_cos(k.ggx, o);
        float masking_i = ggx_masking_over_cos(k.ggx, i);
        vec3 reflectance = disney_opaque_reflectance(k, cos_h);
        float r = 0.0;
        if (k.refractive > 0.0 && !disney_smooth_glass(k)) {
            r = fresnel_dielectric(cos_h, eta).reflectance;
            reflectance += vec3(k.refractive * r);
        }
        d.f += reflectance * (masking_o * quarter_d * masking_i);
        d.pdf_w += (from_o.reflection + from_o.glass * r) * (masking_o * quarter_d);
        d.reverse_pdf_w += (from_i.reflection + from_i.glass * r) * (masking_i * quarter_d);
    }
    if (k.coat.strength > 0.0) {
        d.f = d.f * clearcoat_transmittance(k.coat, o.z, i.z)
            + vec3(clearcoat_eval(k.coat, o, i, h));
        float density = clearcoat_pdf_w(k.coat, o, h);
        d.pdf_w += from_o.coat * density;
        d.reverse_pdf_w += from_i.coat * density;
    }
    return d;
}

// Returns the factor on light that passes once: entering and leaving together give the base colour
// [Burley 2015, 5.3].
vec3 disney_tint(Disney k) {
    return sqrt(k.base_color);
}

// Returns value and density of rough refraction; `eta` is the index of the side of `i` over that of
// the side of `o`.
vec3 disney_transmitted(
    Disney k, vec3 o, vec3 i, float eta, uint mode, LobeProbabilities choice, out float pdf_w
) {
    pdf_w = 0.0;
    if (k.refractive <= 0.0 || disney_smooth_glass(k)) {
        return vec3(0.0);
    }
    Refraction refraction;
    if (!refraction_between(o, i, eta, refraction)) {
        return vec3(0.0);
    }
    float spread = refraction_direction_density(
        refraction, refraction.transmittance * ggx_pdf_over_dot(k.ggx, o, refraction.h)
    );
    float scale = refraction_scale(refraction, mode);
    float masking = ggx_masking_over_cos(k.ggx, vec3(i.xy, -i.z));
    pdf_w = choice.glass * spread * eta * eta;
    return disney_tint(k)
        * (k.refractive * spread * masking * scale * clearcoat_transmittance(k.coat, o.z, i.z));
}

// Returns value and both densities for `wo` and `wi` in the local frame. Also called if only one of
// them is needed: the code of the lobes is large, and unused results cost little.
Densities disney_evaluate(Disney k, vec3 wo, vec3 wi, uint mode) {
    vec3 o = wo, i = wi;
    float eta = disney_upper(k, o, i);
    if (o.z <= 0.0 || i.z == 0.0) {
        return NO_DENSITIES;
    }
    LobeProbabilities from_o, from_i;
    Disney at_o = disney_seen_from(k, wo.z < 0.0);
    disney_lobe_probabilities(at_o, o.z, from_o);
    disney_lobe_probabilities(disney_seen_from(k, wi.z < 0.0), abs(i.z), from_i);
    if (i.z > 0.0) {
        return disney_reflected(at_o, o, i, eta, from_o, from_i);
    }
    Densities d;
    d.f = disney_transmitted(k, o, i, eta, mode, from_o, d.pdf_w);
    vec3 back_o = wi, back_i = wo;
    float back_eta = disney_upper(k, back_o, back_i);
    disney_transmitted(k, back_o, back_i, back_eta, mode, from_i, d.reverse_pdf_w);
    return d;
}

// Samples a direction: `u` selects a lobe, `v` a direction in it; the weight is that of the whole
// mixture.
bool disney_sample(Disney k, vec3 wo, float u, vec2 v, uint mode, out MixtureSample s) {
    vec3 o = wo, unused = wo;
    float eta = disney_upper(k, o, unused);
    s = MixtureSample(LobeSample(o, vec3(0.0), 1.0), 0.0, false);
    LobeProbabilities c;
    Disney side = disney_seen_from(k, wo.z < 0.0);
    if (o.z <= 0.0 || !disney_lobe_probabilities(side, o.z, c)) {
        return false;
    }
    vec3 i;
    if (u < c.diffuse) {
        i = cosine_hemisphere(v);
    } else if (u < c.diffuse + c.reflection) {
        i = mirrored(o, k.is_smooth ? vec3(0.0, 0.0, 1.0) : ggx_sample(k.ggx, o, v));
        if (k.is_smooth) {
            vec3 weight = disney_opaque_reflectance(k, o.z) / c.reflection
                * clearcoat_transmittance(k.coat, o.z, o.z);
            s = MixtureSample(LobeSample(vec3(-o.xy, o.z), weight, 1.0), c.reflection, true);
        } else if (i.z <= 0.0) {
            return false;
        }
    } else if (u < c.diffuse + c.reflection + c.glass || c.coat <= 0.0) {
        float rest = clamp((u - c.diffuse - c.reflection) / c.glass, 0.0, 1.0);
        if (disney_smooth_glass(k)) {
            float probability;
            if (!dielectric_sample(k.base_color, eta, o, rest, mode, s.lobe, probability)) {
                return false;
            }
            // Light that is reflected at the back of a one-sided surface does not pass the coat.
            Clearcoat coat = k.coat;
            if (s.lobe.wi.z > 0.0) {
                coat = side.coat;
            }
            s.lobe.weight *= k.refractive / c.glass
                * clearcoat_transmittance(coat, o.z, s.lobe.wi.z);
            s.pdf_w = c.glass * probability;
            s.delta = true;
        } else {
            vec3 h = ggx_sample(k.ggx, o, v);
            bool reflects = rest < fresnel_dielectric(max(dot(o, h), 0.0), eta).reflectance;
            i = mirrored(o, h);
            if (!reflects && !refracted(o, h, eta, i)) {
                return false;
            }
            if ((i.z > 0.0) != reflects) {
                return false;
            }
        }
    } else {
        vec3 h = clearcoat_sample(k.coat, v);
        i = mirrored(o, h);
        if (dot(o, h) <= 0.0 || i.z <= 0.0) {
            return false;
        }
    }
    if (!s.delta) {
        // Compute the weight and density of the whole mixture.
        Densities d = NO_DENSITIES;
        if (i.z > 0.0) {
            d = disney_reflected(side, o, i, eta, c, LobeProbabilities(0.0, 0.0, 0.0, 0.0));
        } else if (i.z < 0.0) {
            d.f = disney_transmitted(k, o, i, eta, mode, c, d.pdf_w);
        }
        s = MixtureSample(
            LobeSample(i, d.f * (abs(i.z) / d.pdf_w), i.z < 0.0 ? eta : 1.0), d.pdf_w, false
        );
        if (!(d.pdf_w > 0.0) || !is_finite(s.lobe.weight)) {
            return false;
        }
    }
    if (wo.z < 0.0) {
        s.lobe.wi.z = -s.lobe.wi.z;
    }
    return true;
}

#endif
