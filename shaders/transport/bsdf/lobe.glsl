// Twin of crates/lumbre-light/src/transport/bsdf/lobe.rs.
#ifndef TRANSPORT_BSDF_LOBE_GLSL
#define TRANSPORT_BSDF_LOBE_GLSL

// The transported quantity [Veach 1997, 5.2 and 5.3]: radiance along camera paths, importance along
// light paths.
const uint RADIANCE = 0u;
const uint IMPORTANCE = 1u;

// A sampled direction of one lobe in the local frame: direction, `f |cos| / pdf_w` of this lobe
// alone, index ratio crossed.
struct LobeSample {
    vec3 wi;
    vec3 weight;
    float eta;
};

// A sampled direction of a mixture of lobes in the local frame, with the weight of the mixture;
// density of the mixture, or the probability of the choice of a Dirac lobe; whether it is a Dirac
// lobe.
struct MixtureSample {
    LobeSample lobe;
    float pdf_w;
    bool delta;
};

// A value with the densities of both directions of the path.
struct Densities {
    vec3 f;
    float pdf_w;
    float reverse_pdf_w;
};

const Densities NO_DENSITIES = Densities(vec3(0.0), 0.0, 0.0);

#endif
