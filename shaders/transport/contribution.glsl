// Twin of crates/lumbre-light/src/transport/contribution.rs.
#ifndef TRANSPORT_CONTRIBUTION_GLSL
#define TRANSPORT_CONTRIBUTION_GLSL

// Optical lengths are doubles, as in Rust. Without a time axis they are not computed, so they need no
// double precision.
#ifdef EXTENDED
#define Length double
#else
#define Length float
#endif

// Light of one path that reaches one pixel; fields as in Rust, whose `length` is a built-in of
// GLSL.
struct Contribution {
    uvec2 pixel;
    vec3 value;
    vec3 unweighted;
    uint s;
    uint t;
    Length optical_length;
};

// Returns the number of edges of the path.
uint contribution_depth(Contribution c) {
    return c.s + c.t - 1u;
}

// Receives contributions: the film must define it. A contribution with `t` above 1 belongs to the
// sample's own pixel; others may fall on any pixel.
void sink(Contribution c);

#endif
