// Twin of crates/lumbre-light/src/math/frame.rs.
#ifndef MATH_FRAME_GLSL
#define MATH_FRAME_GLSL

#include "math/trig.glsl"

// A right-handed orthonormal frame whose third axis is a given unit vector.
struct Frame {
    vec3 s;
    vec3 t;
    vec3 n;
};

// Returns a frame about a unit vector [Duff et al. 2017].
Frame frame_from_normal(vec3 n) {
    float sign = copysign(1.0, n.z);
    float a = -1.0 / (sign + n.z);
    float b = n.x * n.y * a;
    return Frame(
        vec3(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        vec3(b, sign + n.y * n.y * a, -n.y), n
    );
}

vec3 frame_to_local(Frame f, vec3 v) {
    return vec3(dot(v, f.s), dot(v, f.t), dot(v, f.n));
}

vec3 frame_to_world(Frame f, vec3 v) {
    return f.s * v.x + f.t * v.y + f.n * v.z;
}

#endif
