// Twin of crates/lumbre-light/src/transport/ray.rs.
#ifndef TRANSPORT_RAY_GLSL
#define TRANSPORT_RAY_GLSL

// A ray: start in world space, and a unit direction.
struct Ray {
    vec3 origin;
    vec3 dir;
};

// The first intersection of a ray: distance; primitive id, triangles first and spheres after them;
// the instance of a mesh, or NONE; barycentric weights of the second and third corner, zero for
// spheres.
struct Hit {
    float t;
    uint primitive;
    uint instance;
    vec2 uv;
};

// The interface to ray traversal, masks included: the film must define both functions.
// Returns the nearest hit with 0 < t < t_max, if there is one.
bool trace_closest(Ray ray, float t_max, out Hit hit);
// Returns whether anything is hit with 0 < t < t_max.
bool trace_occluded(Ray ray, float t_max);

float offset_axis(float p, float n, float near, float fixed_step, float least) {
    int steps = int(256.0 * n);
    float moved = intBitsToFloat(floatBitsToInt(p) + (p < 0.0 ? -steps : steps));
    moved = abs(p) < near ? p + n * fixed_step : moved;
    least *= n;
    return abs(moved - p) < abs(least) ? p + least : moved;
}

// Moves a point off its surface along `n` just far enough that a ray from there does not hit the
// surface again; `extent` is the greatest absolute coordinate of the primitive
// [Waechter & Binder 2019; see Rust].
vec3 offset_origin(vec3 p, vec3 n, float extent) {
    float least = (1.0 / 2097152.0) * extent;
    bool small = extent < 1.0 / 32.0;
    float near = small ? (1.0 / 32.0) * extent : 1.0 / 32.0;
    float fixed_step = small ? least : 1.0 / 65536.0;
    return vec3(
        offset_axis(p.x, n.x, near, fixed_step, least),
        offset_axis(p.y, n.y, near, fixed_step, least),
        offset_axis(p.z, n.z, near, fixed_step, least)
    );
}

#endif
