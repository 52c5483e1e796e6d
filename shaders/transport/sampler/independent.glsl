// Twin of src/transport/sampler/independent.rs.
#ifndef TRANSPORT_SAMPLER_INDEPENDENT_GLSL
#define TRANSPORT_SAMPLER_INDEPENDENT_GLSL

#include "math/rng.glsl"

// The words that seed, pixel and upper word of the sample's index make of a key; words of 64-bit numbers are low, high.
uvec4 sample_key(uvec2 seed, uvec2 pixel, uint third, uint sample_high) {
    return pcg4d(uvec4(
        pixel.x | (pixel.y << 16),
        seed.x ^ (((pixel.x >> 16) << 8) | ((pixel.x >> 16) >> 24)) ^ (pixel.y >> 16),
        third,
        seed.y ^ ((sample_high << 16) | (sample_high >> 16))
    ));
}

// Independent uniform numbers: a key and a counter of dimensions.
struct Independent {
    uvec4 key;
    uint block;
    uvec4 words;
    uint used;
};

// The numbers of a key, four random words.
Independent independent_keyed(uvec4 key) {
    return Independent(key, 0u, uvec4(0u), 4u);
}

// The numbers of one sample of one pixel.
Independent independent_new(uvec2 seed, uvec2 pixel, uvec2 index) {
    return independent_keyed(sample_key(seed, pixel, index.x, index.y));
}

// The next number, in [0, 1).
float independent_next_1d(inout Independent s) {
    if (s.used == 4u) {
        s.words = pcg4d(s.key + uvec4(0u, 0u, 0u, s.block));
        s.block += 1u;
        s.used = 0u;
    }
    uint word = s.words.x;
    s.words = s.words.yzwx;
    s.used += 1u;
    return unit(word);
}

#endif
