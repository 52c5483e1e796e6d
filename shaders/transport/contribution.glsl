// Twin of src/transport/contribution.rs.
#ifndef TRANSPORT_CONTRIBUTION_GLSL
#define TRANSPORT_CONTRIBUTION_GLSL

// Light that one path brings to one pixel; fields as in Rust.
struct Contribution {
    uvec2 pixel;
    vec3 value;
    vec3 unweighted;
    uint s;
    uint t;
};

// Edges of the path.
uint contribution_depth(Contribution c) {
    return c.s + c.t - 1u;
}

// The seam to the film and its layers: whoever includes this defines it. An own sample is one with `t` above 1; others
// may fall on any pixel.
void sink(Contribution c);

#endif
