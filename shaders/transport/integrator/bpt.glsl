// Twin of crates/lumbre-light/src/transport/integrator/bpt.rs.
#ifndef TRANSPORT_INTEGRATOR_BPT_GLSL
#define TRANSPORT_INTEGRATOR_BPT_GLSL

#include "transport/integrator/camera_path/single.glsl"

float technique_hit_weight(LastScatter last, Surface surface) {
    return 1.0;
}

float technique_escape_weight(LastScatter last, vec3 dir) {
    return 1.0;
}

// Only paths that hit light contribute.
void technique_connect(
    uvec2 pixel, CameraPath path, vec3 wo, Surface surface, Bsdf bsdf, inout Sampler numbers
) {
}

#endif
