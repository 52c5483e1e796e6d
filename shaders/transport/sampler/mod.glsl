// Twin of crates/lumbre-light/src/transport/sampler/mod.rs. A pipeline
// has only the sampler of SAMPLER_KIND.
#ifndef TRANSPORT_SAMPLER_MOD_GLSL
#define TRANSPORT_SAMPLER_MOD_GLSL

#include "scene.glsl"
#include "transport/sampler/independent.glsl"
#include "transport/sampler/sobol.glsl"
#include "transport/sampler/zsobol.glsl"

// The numbers of one sample of one pixel: independent ones, or points of a Sobol sequence. The
// other field is unused.
struct Sampler {
    Independent independent;
    Sobol sobol;
};

// Starts the numbers of a sample; `seed` and `index` are 64-bit integers, low word first.
Sampler sampler_start(uvec2 seed, uvec2 pixel, uvec2 index) {
    Sampler s;
    if (SAMPLER_KIND == SAMPLER_SOBOL) {
        s.sobol = sobol_new(seed, pixel, index);
    } else if (SAMPLER_KIND >= SAMPLER_ZSOBOL) {
        s.sobol = zsobol_new(seed, SAMPLER_KIND - SAMPLER_ZSOBOL, pixel, index);
    } else {
        s.independent = independent_new(seed, pixel, index);
    }
    return s;
}

// Returns the next number, in [0, 1).
float next_1d(inout Sampler s) {
    return SAMPLER_KIND == SAMPLER_INDEPENDENT
        ? independent_next_1d(s.independent)
        : sobol_next_1d(s.sobol);
}

// Returns the next two numbers, each in [0, 1), for a decision in two dimensions.
vec2 next_2d(inout Sampler s) {
    if (SAMPLER_KIND != SAMPLER_INDEPENDENT) {
        return sobol_next_2d(s.sobol);
    }
    float x = independent_next_1d(s.independent);
    return vec2(x, independent_next_1d(s.independent));
}

// Distinguishes the key of the auxiliary stream from the sampler's own.
const uint AUXILIARY_KEY = 0x7f4a7c15u;

// Starts an auxiliary stream, independent of the sampler's numbers: see Rust.
Independent sampler_auxiliary(Sampler s) {
    uvec4 key = s.independent.key;
    if (SAMPLER_KIND != SAMPLER_INDEPENDENT) {
        key = sobol_key_of_sample(s.sobol);
    }
    return independent_from_key(pcg4d(uvec4(key.x ^ AUXILIARY_KEY, key.yzw)));
}

#endif
