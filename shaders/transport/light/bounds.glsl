// Twin of crates/lumbre-light/src/transport/light/bounds.rs; the bounding sphere of all surfaces is `job.ball_center`
// and `job.ball_radius`.
#ifndef TRANSPORT_LIGHT_BOUNDS_GLSL
#define TRANSPORT_LIGHT_BOUNDS_GLSL

#include "math/frame.glsl"
#include "math/warp.glsl"
#include "transport/light/types.glsl"

// Returns the density per area of a point of a disk of the sphere's radius; zero without surfaces.
float ball_pdf_a() {
    return job.ball_radius > 0.0 ? 1.0 / (PI * job.ball_radius * job.ball_radius) : 0.0;
}

// Returns a point outside the sphere in direction `wi` from `from`, as the point of an infinitely
// distant light.
LightPoint ball_outside(uint light, vec3 from, vec3 wi) {
    float away = distance(from, job.ball_center) + 2.0 * job.ball_radius;
    return LightPoint(light, from + wi * away, -wi, job.least_extent, Uv(0.0));
}

// Samples a point uniform over the disk that touches the sphere and faces it along its normal
// `dir`.
LightPoint ball_on_disk(uint light, vec3 dir, vec2 u) {
    vec2 d = concentric_disk(u) * job.ball_radius;
    vec3 position = job.ball_center
        + frame_to_world(frame_from_normal(dir), vec3(d, -job.ball_radius));
    return LightPoint(light, position, dir, job.least_extent, Uv(0.0));
}

#endif
