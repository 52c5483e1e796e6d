// Twin of crates/lumbre-light/src/transport/integrator/settings.rs; the parameters are those of `job`.
#ifndef TRANSPORT_INTEGRATOR_SETTINGS_GLSL
#define TRANSPORT_INTEGRATOR_SETTINGS_GLSL

#include "scene.glsl"

// Returns the heuristic for integrators that weight every strategy: uniform if none is set.
uint settings_heuristic() {
    return job.mis == NONE ? MIS_UNIFORM : job.mis;
}

// Returns whether a single strategy is kept with the weight one.
bool settings_unweighted() {
    return job.mis == NONE && job.one_strategy.x != NONE && job.keep_strategy != 0u;
}

// Returns whether the strategy of `s` light vertices and `t` camera vertices is enabled.
bool settings_includes(uint s, uint t) {
    return job.one_strategy.x == NONE
        || (job.one_strategy == uvec2(s, t)) == (job.keep_strategy != 0u);
}

#endif
