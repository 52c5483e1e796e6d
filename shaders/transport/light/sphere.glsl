// Twin of crates/lumbre-light/src/transport/light/sphere.rs.
#ifndef TRANSPORT_LIGHT_SPHERE_GLSL
#define TRANSPORT_LIGHT_SPHERE_GLSL

#include "math/trig.glsl"
#include "math/frame.glsl"
#include "transport/light/types.glsl"

// A direction to a sphere, the unit normal of its front there, and the density per solid angle.
struct ConeSample {
    vec3 wi;
    vec3 normal;
    float pdf_w;
};

// The cone of directions from a point to a sphere; fields as in Rust.
struct SubtendedCone {
    vec3 axis;
    float sin_angle;
    float one_minus_cos;
};

// Computes the cone; false from inside, where only the back of the sphere is visible.
bool cone_new(Sphere ball, vec3 from, out SubtendedCone cone) {
    vec3 to = ball.center - from;
    float d = length(to);
    float r = ball.radius;
    float sin_angle = r / d;
    float cos_angle = sqrt(max((d - r) / d * ((d + r) / d), 0.0));
    cone = SubtendedCone(to / d, sin_angle, sin_angle * sin_angle / (1.0 + cos_angle));
    return d > r && is_finite(d) && cone.one_minus_cos > 0.0;
}

float cone_pdf_w(SubtendedCone cone) {
    return 1.0 / (TAU * cone.one_minus_cos);
}

// Samples a direction uniform over the subtended cone; false from inside.
bool sphere_sample(Sphere ball, vec3 from, vec2 u, out ConeSample s) {
    SubtendedCone cone;
    bool outside = cone_new(ball, from, cone);
    float q = u.x * cone.one_minus_cos;
    float cos_angle = 1.0 - q;
    float sin_angle = sqrt(q * (2.0 - q));
    vec2 phi = sin_cos(TAU * u.y).yx;
    // The sine is computed separately: see Rust.
    float rim = min(sin_angle / cone.sin_angle, 1.0);
    float rim_cos = sqrt((1.0 - rim) * (1.0 + rim));
    float sin_center = max(rim * cos_angle - rim_cos * sin_angle, 0.0);
    float cos_center = rim_cos * cos_angle + rim * sin_angle;
    Frame frame = frame_from_normal(cone.axis);
    s = ConeSample(
        frame_to_world(frame, vec3(sin_angle * phi, cos_angle)),
        normalize_or(frame_to_world(frame, vec3(sin_center * phi, -cos_center)), -cone.axis),
        cone_pdf_w(cone)
    );
    return outside;
}

// Returns the density per solid angle with which `sphere_sample` samples a point with the normal
// `normal`; zero from inside and for points that the sphere itself occludes.
float sphere_pdf_w(Sphere ball, vec3 from, vec3 at, vec3 normal) {
    SubtendedCone cone;
    return cone_new(ball, from, cone) && dot(from - at, normal) > 0.0 ? cone_pdf_w(cone) : 0.0;
}

#endif
