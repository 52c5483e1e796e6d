// Twin of crates/lumbre-light/src/transport/integrator/bdpt/weights.rs, which explains the weights and why they take
// constant time.
//
// Terms are doubles, as in Rust: squares of densities per area exceed the range of floats. Devices
// without doubles cannot run it.
#ifndef TRANSPORT_INTEGRATOR_BDPT_WEIGHTS_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_WEIGHTS_GLSL

#include "scene.glsl"
#include "math/trig.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/light/mod.glsl"
#include "transport/mis.glsl"
#include "transport/vertex.glsl"

// Returns the term of a density, or of a ratio of densities: `Heuristic::term`.
double heuristic_term(uint h, double p) {
    if (h == MIS_POWER) {
        return p * p;
    }
    return h == MIS_BALANCE ? p : (p > 0.0lf ? 1.0lf : 0.0lf);
}

// Partial sums of MIS terms for strategies that split the path nearer to this side's end; fields as
// in Rust. Also serves as Rust's `EdgePartials`.
struct MisPartials {
    double d_vcm;
    double d_vc;
};

// The densities at the light's end of a path; fields as in Rust.
struct LightEnd {
    double start;
    double direct;
    double next;
    float back;
};

// Divides the partials of an edge by the term of the density per area of its end vertex; false if
// rounding leaves no density.
bool mis_partials_new(uint h, MisPartials edge_partials, double density, out MisPartials partials) {
    double scale = 1.0lf / heuristic_term(h, density);
    partials = MisPartials(edge_partials.d_vcm * scale, edge_partials.d_vc * scale);
    return density > 0.0lf && is_finite(density);
}

// Returns the sum of `mis_partials_others` where this vertex is the other side's end: its density
// is `last` for the strategy that ends there, `here` for those that continue.
double mis_partials_others_at_end(MisPartials c, uint h, double last, double here, double before) {
    return c.d_vcm * heuristic_term(h, last)
        + c.d_vc * heuristic_term(h, here) * heuristic_term(h, before);
}

// Returns the sum of the terms of all strategies with fewer vertices on this side, over the term of
// the one that connects here.
double mis_partials_others(MisPartials c, uint h, double here, double before) {
    return mis_partials_others_at_end(c, h, here, here, before);
}

// Returns the partials of the next edge after an event here; `before` is the other side's density
// of the previous vertex.
MisPartials mis_partials_next_edge(MisPartials c, uint h, bool delta, double before) {
    return MisPartials(
        delta ? 0.0lf : 1.0lf, (delta ? 0.0lf : c.d_vcm) + c.d_vc * heuristic_term(h, before)
    );
}

// Computes the densities for a light's point, the unit direction from it to the next vertex, that
// vertex, and its normal: zero for a lens point, for which `next` and `direct` are unused.
LightEnd light_end_new(LightPoint point, vec3 dir, vec3 next, vec3 n_next) {
    EmissionPdf e = lights_pdf_emission_at(point, dir);
    double pdf_a = double(e.pdf_a), pdf_w = double(e.pdf_w);
    double spread = double(area_factor(point.position, next, n_next));
    uint kind = light_kind(point.light);
    if (kind == LIGHT_EMITTER) {
        float back = area_factor(next, point.position, point.normal);
        double direct = double(lights_pdf_direct_w(next, point.light, point.position, point.normal))
            * double(back);
        return LightEnd(pdf_a, direct, pdf_w * spread, back);
    }
    if (kind == LIGHT_POINT) {
        return LightEnd(pdf_a, pdf_a, pdf_w * spread, 0.0);
    }
    double choice = double(lights_pdf_choice(point.light));
    double across = choice > 0.0lf ? pdf_a / choice : 0.0lf;
    double start = choice * pdf_w;
    return LightEnd(
        start, start, across * double(abs(dot(dir, n_next))), kind == LIGHT_ENVIRONMENT ? 1.0 : 0.0
    );
}

// The functions below return the sum of the terms of all other strategies over the term of one
// strategy.

// Returns the sum for `s = 0` and a camera path of `t` vertices that hit its light; `partials` are
// the camera's at the light.
double others_s0(uint h, MisPartials partials, LightEnd end, uint t) {
    double last = t == 2u ? end.start : end.direct;
    return mis_partials_others_at_end(partials, h, last, end.start, end.next);
}

// Returns the sum for `s = 1`, `t >= 2`: `partials` belong to the end of the camera path, whose
// BSDF towards the light is `at_z`, and `before` is the light side's density of the vertex before
// it.
double others_s1(uint h, MisPartials partials, double before, LightEnd end, BsdfValue at_z) {
    double hit = end.back > 0.0
        ? heuristic_term(h, double(at_z.pdf_w) * double(end.back) / end.direct)
        : 0.0lf;
    return hit + heuristic_term(h, end.start / end.direct)
        * mis_partials_others(partials, h, end.next, before);
}

// Returns the sum for `s = 1`, `t = 1`: a light's point connected to a lens point.
double others_s1_t1(uint h, LightEnd end, float pdf_w) {
    return heuristic_term(h, double(pdf_w) * double(end.back) / end.start);
}

#endif
