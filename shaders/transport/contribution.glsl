// Twin of src/transport/contribution.rs.
#ifndef TRANSPORT_CONTRIBUTION_GLSL
#define TRANSPORT_CONTRIBUTION_GLSL

// Optical lengths are doubles where there is a time axis, as in Rust; without one none is counted.
#ifdef TIMES
#define Length double
#else
#define Length float
#endif

// Light that one path brings to one pixel; fields as in Rust, whose `length` is a word of GLSL.
struct Contribution {
    uvec2 pixel;
    vec3 value;
    vec3 unweighted;
    uint s;
    uint t;
    Length optical_length;
};

// Edges of the path.
uint contribution_depth(Contribution c) {
    return c.s + c.t - 1u;
}

// The seam to the film and its layers: whoever includes this defines it. An own sample is one with `t` above 1; others
// may fall on any pixel.
void sink(Contribution c);

#endif
