// Twin of src/transport/integrator/settings.rs; the parameters are those of `job`.
#ifndef TRANSPORT_INTEGRATOR_SETTINGS_GLSL
#define TRANSPORT_INTEGRATOR_SETTINGS_GLSL

#include "scene.glsl"

// The heuristic of an integrator that must give every strategy its weight: all alike where none is asked for.
uint settings_heuristic() {
    return job.mis == NONE ? MIS_UNIFORM : job.mis;
}

// Whether every weight is one: a single strategy, not weighted.
bool settings_raw() {
    return job.mis == NONE && job.one_strategy.x != NONE && job.keep_strategy != 0u;
}

// Whether the strategy of `s` light vertices and `t` camera vertices counts.
bool settings_wants(uint s, uint t) {
    return job.one_strategy.x == NONE || (job.one_strategy == uvec2(s, t)) == (job.keep_strategy != 0u);
}

#endif
