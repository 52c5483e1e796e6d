// Twin of src/transport/integrator/bdpt/weights.rs, which says what the weights are and why they take constant time.
//
// Terms are doubles, as in Rust: squares of densities per area leave the range of floats. Devices without doubles cannot.
#ifndef TRANSPORT_INTEGRATOR_BDPT_WEIGHTS_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_WEIGHTS_GLSL

#include "scene.glsl"
#include "math/elementary.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/light/mod.glsl"
#include "transport/mis.glsl"
#include "transport/vertex.glsl"

// The term of a density, or of a ratio of densities: `Heuristic::term`.
double heuristic_term(uint h, double p) {
    if (h == MIS_POWER) {
        return p * p;
    }
    return h == MIS_BALANCE ? p : (p > 0.0lf ? 1.0lf : 0.0lf);
}

// What one side of a connection knows of the strategies that split the path further towards that side's end; fields as in
// Rust. It is also Rust's `Link`, a chain whose next vertex is not found yet.
struct Chain {
    double joint;
    double tail;
};

// The densities where a path meets its light; fields as in Rust.
struct LightEnd {
    double start;
    double direct;
    double next;
    float back;
};

// Where this side has generated a vertex with density `density` per area; none where rounding leaves none.
bool chain_new(uint h, Chain link, double density, out Chain chain) {
    double scale = 1.0lf / heuristic_term(h, density);
    chain = Chain(link.joint * scale, link.tail * scale);
    return density > 0.0lf && is_finite(density);
}

// As `chain_others`, where this vertex is the other side's end: its density is `last` for the strategy that generates no
// more than it, `here` for the ones that go on.
double chain_others_at_end(Chain c, uint h, double last, double here, double before) {
    return c.joint * heuristic_term(h, last) + c.tail * heuristic_term(h, here) * heuristic_term(h, before);
}

// Sum of the terms of all strategies with fewer vertices on this side, over the term of the one that connects here.
double chain_others(Chain c, uint h, double here, double before) {
    return chain_others_at_end(c, h, here, here, before);
}

// The chain behind an event here; `before` is the other side's density of the vertex before.
Chain chain_onward(Chain c, uint h, bool delta, double before) {
    return Chain(delta ? 0.0lf : 1.0lf, (delta ? 0.0lf : c.joint) + c.tail * heuristic_term(h, before));
}

// For a light's point, the unit direction from it to the next vertex, that vertex, and its normal: zero for a point on the
// lens, whose `next` and `direct` are then of no use.
LightEnd light_end_new(LightPoint point, vec3 dir, vec3 next, vec3 n_next) {
    EmissionPdf e = lights_pdf_emission_at(point, dir);
    double pdf_a = double(e.pdf_a), pdf_w = double(e.pdf_w);
    double spread = double(area_factor(point.position, next, n_next));
    uint kind = light_kind(point.light);
    if (kind == LIGHT_EMITTER) {
        float back = area_factor(next, point.position, point.normal);
        double direct = double(lights_pdf_direct_w(next, point.light, point.position, point.normal)) * double(back);
        return LightEnd(pdf_a, direct, pdf_w * spread, back);
    }
    if (kind == LIGHT_POINT) {
        return LightEnd(pdf_a, pdf_a, pdf_w * spread, 0.0);
    }
    double choice = double(lights_pdf_choice(point.light));
    double across = choice > 0.0lf ? pdf_a / choice : 0.0lf;
    double start = choice * pdf_w;
    return LightEnd(start, start, across * double(abs(dot(dir, n_next))), kind == LIGHT_ENVIRONMENT ? 1.0 : 0.0);
}

// The functions below: what all other strategies weigh beside one, the sum of their terms over the term of this one.

// Beside `s = 0`, for a camera path of `t` vertices that met its light; `chain` is the camera's at the light.
double others_of_hit(uint h, Chain chain, LightEnd end, uint t) {
    double last = t == 2u ? end.start : end.direct;
    return chain_others_at_end(chain, h, last, end.start, end.next);
}

// Beside `s = 1`, `t >= 2`: `chain` is that of the end of the camera path, whose BSDF towards the light is `at_z`, and
// `before` the light side's density of the vertex before it.
double others_of_next_event(uint h, Chain chain, double before, LightEnd end, BsdfValue at_z) {
    double met = end.back > 0.0 ? heuristic_term(h, double(at_z.pdf_w) * double(end.back) / end.direct) : 0.0lf;
    return met + heuristic_term(h, end.start / end.direct) * chain_others(chain, h, end.next, before);
}

// Beside `s = 1`, `t = 1`, for a light's point seen from a point of the lens.
double others_of_seen(uint h, LightEnd end, float pdf_w) {
    return heuristic_term(h, double(pdf_w) * double(end.back) / end.start);
}

#endif
