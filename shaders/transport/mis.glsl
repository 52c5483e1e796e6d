// Twin of crates/lumbre-light/src/transport/mis.rs. A heuristic is one of MIS_POWER, MIS_BALANCE and MIS_UNIFORM. Its
// `term` is in `transport/integrator/bdpt/weights.glsl`.
#ifndef TRANSPORT_MIS_GLSL
#define TRANSPORT_MIS_GLSL

#include "scene.glsl"
#include "math/trig.glsl"

// Returns the weight of a strategy of density `own` against one other of density `other` in the
// same measure. A ratio outside the range of floats leaves no digit of the weight in Rust either.
float heuristic_weight(uint h, float own, float other) {
    if (!(own > 0.0)) {
        return 0.0;
    }
    float ratio = other / own;
    if (!is_finite(ratio)) {
        return h == MIS_UNIFORM ? 0.5 : 0.0;
    }
    float term = h == MIS_POWER
        ? ratio * ratio
        : (h == MIS_BALANCE ? ratio : (ratio > 0.0 ? 1.0 : 0.0));
    return 1.0 / (1.0 + term);
}

#endif
