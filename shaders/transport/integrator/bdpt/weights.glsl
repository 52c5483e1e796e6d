// Twin of crates/lumbre-light/src/transport/integrator/bdpt/weights.rs, which explains the weights and why they take
// constant time.
//
// Rust sums terms in double precision, since squares of densities per area exceed the range of floats.
// Here a sum of terms is represented by its root: with the power heuristic the square root of the sum
// of squares, so that a term is the density itself and no square of it is ever stored.
#ifndef TRANSPORT_INTEGRATOR_BDPT_WEIGHTS_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_WEIGHTS_GLSL

#include "scene.glsl"
#include "math/trig.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/light/mod.glsl"
#include "transport/mis.glsl"
#include "transport/vertex.glsl"

// Expected numbers of samples of the strategies that connect two surfaces, and of those that connect
// light subpaths to the lens: see `StrategyCounts` in Rust. The integrator must define them. Devices
// sample one light from a camera vertex.
float counts_connecting();
float counts_lens();

// Returns the count of the strategy of `s` light vertices and `t` camera vertices that are connected.
float counts_of(uint s, uint t) {
    return s == 0u ? 1.0 : (t == 1u ? counts_lens() : (s == 1u ? 1.0 : counts_connecting()));
}

// Returns the root of the term of a density, or of a ratio of densities: see `Heuristic::term`.
float heuristic_root(uint h, float p) {
    return h == MIS_UNIFORM ? (p > 0.0 ? 1.0 : 0.0) : p;
}

// Returns the root of the sum of two terms, or of two sums of terms, of which `a` and `b` are the
// roots. The larger one is factored out, so that its square may exceed the range of floats.
float heuristic_add(uint h, float a, float b) {
    if (h != MIS_POWER) {
        return a + b;
    }
    float larger = max(a, b), smaller = min(a, b);
    if (!(smaller > 0.0) || !is_finite(larger)) {
        return larger;
    }
    float ratio = smaller / larger;
    return larger * sqrt(1.0 + ratio * ratio);
}

// Returns the weight of one of `count` samples of a strategy if `others` is the root of the sum of the
// terms of all others over its own.
float heuristic_weight_of_root(uint h, float others, float count) {
    float root = others / heuristic_root(h, count);
    return 1.0 / (1.0 + (h == MIS_POWER ? root * root : root));
}

// Roots of the partial sums of MIS terms for strategies that split the path nearer to this side's
// end; fields as in Rust. Also serves as Rust's `EdgePartials`.
struct MisPartials {
    float d_vcm;
    float d_vc;
};

// The densities at the light's end of a path; fields as in Rust.
struct LightEnd {
    float start;
    float direct;
    float next;
    float back;
};

// Divides the partials of an edge by the density per area of its end vertex; false if rounding
// leaves no density.
bool mis_partials_new(uint h, MisPartials edge_partials, float density, out MisPartials partials) {
    float scale = 1.0 / heuristic_root(h, density);
    partials = MisPartials(edge_partials.d_vcm * scale, edge_partials.d_vc * scale);
    return density > 0.0 && is_finite(density);
}

// Returns the root of the sum of `mis_partials_others` where this vertex is the other side's end:
// its density is `last` for the strategy that ends there, `here` for those that continue.
float mis_partials_others_at_end(MisPartials c, uint h, float last, float here, float before) {
    // The density here cancels the one that the partials were divided by.
    float earlier = c.d_vc * heuristic_root(h, here);
    return heuristic_add(
        h, c.d_vcm * heuristic_root(h, last), earlier * heuristic_root(h, before)
    );
}

// Returns the root of the sum of the terms of all strategies with fewer vertices on this side, over
// the term of the one that connects here.
float mis_partials_others(MisPartials c, uint h, float here, float before) {
    return mis_partials_others_at_end(c, h, here, here, before);
}

// Returns the partials of the next edge after an event here; `before` is the other side's density
// of the previous vertex.
MisPartials mis_partials_next_edge(MisPartials c, uint h, bool delta, float before) {
    return MisPartials(
        delta ? 0.0 : heuristic_root(h, counts_connecting()),
        heuristic_add(h, delta ? 0.0 : c.d_vcm, c.d_vc * heuristic_root(h, before))
    );
}

// Computes the densities for a light's point, the unit direction from it to the next vertex, that
// vertex, and its normal: zero for a lens point, for which `next` and `direct` are unused.
LightEnd light_end_new(LightPoint point, vec3 dir, vec3 next, vec3 n_next) {
    EmissionPdf e = lights_pdf_emission_at(point, dir);
    float pdf_a = e.pdf_a, pdf_w = e.pdf_w;
    float spread = area_factor(point.position, next, n_next);
    uint kind = light_kind(point.light);
    if (kind == LIGHT_EMITTER) {
        float back = area_factor(next, point.position, point.normal);
        float direct = lights_pdf_direct_w(next, point.light, point.position, point.normal) * back;
        return LightEnd(pdf_a, direct, pdf_w * spread, back);
    }
    if (kind == LIGHT_POINT) {
        return LightEnd(pdf_a, pdf_a, pdf_w * spread, 0.0);
    }
    float choice = lights_pdf_choice(point.light);
    float across = choice > 0.0 ? pdf_a / choice : 0.0;
    float start = choice * pdf_w;
    return LightEnd(
        start, start, across * abs(dot(dir, n_next)), kind == LIGHT_ENVIRONMENT ? 1.0 : 0.0
    );
}

// The functions below return the root of the sum of the terms of all other strategies over the term
// of one strategy.

// Returns the root for `s = 0` and a camera path of `t` vertices that hit its light; `partials` are
// the camera's at the light.
float others_s0(uint h, MisPartials partials, LightEnd end, uint t) {
    float last = t == 2u ? end.start : end.direct;
    // Unless the camera sees the light directly, the number of sampled lights replaces that of
    // connections.
    float connecting = t == 2u ? 1.0 : counts_connecting();
    partials.d_vcm *= heuristic_root(h, connecting > 0.0 ? 1.0 / connecting : 0.0);
    return mis_partials_others_at_end(partials, h, last, end.start, end.next);
}

// Returns the root for `s = 1`, `t >= 2`: `partials` belong to the end of the camera path, whose
// BSDF towards the light is `at_z`, and `before` is the light side's density of the vertex before
// it.
float others_s1(uint h, MisPartials partials, float before, LightEnd end, BsdfValue at_z) {
    float hit = end.back > 0.0 ? heuristic_root(h, at_z.pdf_w * end.back / end.direct) : 0.0;
    float earlier = mis_partials_others(partials, h, end.next, before);
    return heuristic_add(h, hit, heuristic_root(h, end.start / end.direct) * earlier);
}

// Returns the root for `s = 1`, `t = 1`: a light's point connected to a lens point.
float others_s1_t1(uint h, LightEnd end, float pdf_w) {
    return heuristic_root(h, pdf_w * end.back / end.start);
}

#endif
