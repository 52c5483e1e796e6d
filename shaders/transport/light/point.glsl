// Twin of src/transport/light/point.rs.
#ifndef TRANSPORT_LIGHT_POINT_GLSL
#define TRANSPORT_LIGHT_POINT_GLSL

#include "math/warp.glsl"
#include "transport/light/types.glsl"

// Density per solid angle of every direction of emission.
const float POINT_PDF_W = 1.0 / (4.0 * PI);

LightPoint point_at(uint i, vec3 normal) {
    return LightPoint(job.light_first.x + i, points[i].position, normal, vec2(0.0));
}

// Light that arrives at `from` from point `i`; none at the light itself.
bool point_sample_direct(uint i, vec3 from, out DirectSample s) {
    vec3 to = points[i].position - from;
    float distance = length(to);
    vec3 radiance = points[i].intensity / (distance * distance);
    vec3 wi = to / distance;
    s = DirectSample(wi, distance, radiance, 1.0, true, point_at(i, -wi));
    return distance > 0.0 && is_finite(radiance);
}

// A direction uniform over the sphere.
EmissionSample point_sample_emission(uint i, vec2 v) {
    vec3 dir = uniform_sphere(v);
    return EmissionSample(point_at(i, dir), dir, points[i].intensity, 1.0, POINT_PDF_W, 1.0);
}

#endif
