// Twin of crates/lumbre-light/src/transport/sampler/independent.rs.
#ifndef TRANSPORT_SAMPLER_INDEPENDENT_GLSL
#define TRANSPORT_SAMPLER_INDEPENDENT_GLSL

#include "math/rng.glsl"

// Hashes seed, pixel, a third word and the upper word of the sample's index to a key; 64-bit
// integers are low word first.
uvec4 sample_key(uvec2 seed, uvec2 pixel, uint third, uint sample_high) {
    return pcg4d(uvec4(
        pixel.x | (pixel.y << 16),
        seed.x ^ (((pixel.x >> 16) << 8) | ((pixel.x >> 16) >> 24)) ^ (pixel.y >> 16),
        third,
        seed.y ^ ((sample_high << 16) | (sample_high >> 16))
    ));
}

// A stream of independent uniform numbers: a key and a counter of dimensions.
struct Independent {
    uvec4 key;
    uint block;
    uvec4 words;
    uint used;
};

// Starts the numbers of a key of four random words.
Independent independent_from_key(uvec4 key) {
    return Independent(key, 0u, uvec4(0u), 4u);
}

// Starts the numbers of one sample of one pixel.
Independent independent_new(uvec2 seed, uvec2 pixel, uvec2 index) {
    return independent_from_key(sample_key(seed, pixel, index.x, index.y));
}

// Returns the next number, in [0, 1).
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
