// Twin of crates/lumbre-light/src/transport/light/directional.rs.
#ifndef TRANSPORT_LIGHT_DIRECTIONAL_GLSL
#define TRANSPORT_LIGHT_DIRECTIONAL_GLSL

#include "transport/light/bounds.glsl"
#include "transport/light/types.glsl"

// Returns light that arrives at `from` from directional light `i`.
DirectSample directional_sample_direct(uint i, vec3 from) {
    vec3 wi = -directionals[i].direction;
    LightPoint point = ball_outside(job.light_first.y + i, from, wi);
    return DirectSample(wi, INFINITY, directionals[i].irradiance, 1.0, true, point);
}

// Samples a ray through a point uniform over the disk that covers the scene.
EmissionSample directional_sample_emission(uint i, vec2 u) {
    vec3 dir = directionals[i].direction;
    LightPoint point = ball_on_disk(job.light_first.y + i, dir, u);
    return EmissionSample(point, dir, directionals[i].irradiance, ball_pdf_a(), 1.0, 1.0);
}

// Returns whether `dir` is the light's only direction of emission.
bool directional_shines_into(uint i, vec3 dir) {
    return dot(dir, directionals[i].direction) > 1.0 - 1e-6;
}

#endif
