// Twin of the types at the top of src/transport/bsdf/mod.rs, which the lobes share.
#ifndef TRANSPORT_BSDF_LOBE_GLSL
#define TRANSPORT_BSDF_LOBE_GLSL

// What is transported [Veach 1997, 5.2 and 5.3]: radiance along camera paths, importance along light paths.
const uint RADIANCE = 0u;
const uint IMPORTANCE = 1u;

// A sampled direction in a lobe's local frame: direction, `f |cos| / pdf_w` of this lobe alone, index ratio crossed.
struct LobeSample {
    vec3 wi;
    vec3 weight;
    float eta;
};

// A sampled direction of a mixture in the local frame, whose weight is that of the mixture; density of the mixture, or the
// probability of the choice of a Dirac lobe; whether it is one.
struct Local {
    LobeSample lobe;
    float pdf_w;
    bool delta;
};

// A value and the densities of both directions in which a path may run through it.
struct Densities {
    vec3 f;
    float pdf_w;
    float reverse_pdf_w;
};

const Densities NO_DENSITIES = Densities(vec3(0.0), 0.0, 0.0);

#endif
