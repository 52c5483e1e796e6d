// Twin of src/transport/sampler/mod.rs. Where SAMPLER_KIND is defined, one of SAMPLER_INDEPENDENT and SAMPLER_SOBOL, only
// that sampler is compiled into a shader; else `job.sampler_kind` decides, with both in it.
#ifndef TRANSPORT_SAMPLER_MOD_GLSL
#define TRANSPORT_SAMPLER_MOD_GLSL

#include "scene.glsl"
#include "transport/sampler/independent.glsl"
#include "transport/sampler/sobol.glsl"

#ifndef SAMPLER_KIND
#define SAMPLER_KIND job.sampler_kind
#endif

// The numbers of one sample of one pixel, of either kind; the other's are idle.
struct Sampler {
    Independent independent;
    Sobol sobol;
};

// Starts the numbers of a sample; `seed` and `index` are 64-bit numbers, low word first.
Sampler sampler_start(uvec2 seed, uvec2 pixel, uvec2 index) {
    Sampler s;
    if (SAMPLER_KIND == SAMPLER_SOBOL) {
        s.sobol = sobol_new(seed, pixel, index);
    } else {
        s.independent = independent_new(seed, pixel, index);
    }
    return s;
}

// The next number, in [0, 1).
float next_1d(inout Sampler s) {
    return SAMPLER_KIND == SAMPLER_SOBOL ? sobol_next_1d(s.sobol) : independent_next_1d(s.independent);
}

// The next two numbers, each in [0, 1), for a decision in two dimensions.
vec2 next_2d(inout Sampler s) {
    if (SAMPLER_KIND == SAMPLER_SOBOL) {
        return sobol_next_2d(s.sobol);
    }
    float x = independent_next_1d(s.independent);
    return vec2(x, independent_next_1d(s.independent));
}

// Tells the numbers beside a sampler's own from them.
const uint ASIDE = 0x7f4a7c15u;

// Numbers beside these, independent of them and of each other: see Rust.
Independent sampler_aside(Sampler s) {
    uvec4 key = s.independent.key;
    if (SAMPLER_KIND == SAMPLER_SOBOL) {
        key = sobol_key_of_sample(s.sobol);
    }
    return independent_keyed(pcg4d(uvec4(key.x ^ ASIDE, key.yzw)));
}

#endif
