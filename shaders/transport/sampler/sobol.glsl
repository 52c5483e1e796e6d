// Twin of crates/lumbre-light/src/transport/sampler/sobol.rs.
#ifndef TRANSPORT_SAMPLER_SOBOL_GLSL
#define TRANSPORT_SAMPLER_SOBOL_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "transport/sampler/independent.glsl"

// Number of single numbers in a group, before its pair.
const uint SINGLES = 2u;

// The numbers of one sample of one pixel; fields as in Rust.
struct Sobol {
    uvec4 key;
    uint reversed;
    uint group;
    uvec4 words;
    uint point;
    uint singles;
    bool pair;
};

// Starts the numbers of the sample with this index in the sequence of a key.
Sobol sobol_from(uvec4 key, uint index) {
    return Sobol(key, bitfieldReverse(index), 0u, uvec4(0u), 0u, SINGLES, false);
}

Sobol sobol_new(uvec2 seed, uvec2 pixel, uvec2 index) {
    return sobol_from(sample_key(seed, pixel, index.y, 0u), index.x);
}

// Returns random words that depend on the pixel's sequence and the sample's index in it.
uvec4 sobol_key_of_sample(Sobol s) {
    return pcg4d(uvec4(s.key.xy, s.key.z ^ s.reversed, s.key.w));
}

// Permutes words such that every bit depends on itself and the less significant ones only [Laine &
// Karras 2011].
uint permute(uint x, uint word) {
    x += word;
    x ^= x * 0xa666a200u;
    x *= ((word << 16) | (word >> 16)) | 1u;
    x ^= x * 0xf160de5cu;
    return x ^ (x * 0xa418e192u);
}

// Applies Owen scrambling to a number whose most significant digit is the first after the binary
// point.
uint scramble(uint x, uint word) {
    return bitfieldReverse(permute(bitfieldReverse(x), word));
}

// Returns the product of a generator matrix and an index, in arithmetic modulo two: for the third
// dimension, x^2 + x + 1, or the fourth, x^3 + x + 1. Rust uses tables; here the columns are
// computed from the polynomial.
uint multiply(bool third, uint index) {
    uint product = 0u;
    // The next three columns.
    uvec3 v = third ? uvec3(1u << 31, 3u << 30, 0u) : uvec3(1u << 31, 3u << 30, 1u << 29);
    if (third) {
        v.z = v.x ^ (v.x >> 2) ^ v.y;
    }
    [[dont_unroll]] for (uint i = 0u; i < 32u; ++i) {
        if (((index >> i) & 1u) != 0u) {
            product ^= v.x;
        }
        uint next = third ? v.y ^ (v.y >> 2) ^ v.z : v.x ^ (v.x >> 3) ^ v.y;
        v = uvec3(v.y, v.z, next);
    }
    return product;
}

// Returns the second dimension, x + 1: Pascal's triangle modulo two, in five steps.
uint dimension_1(uint index) {
    uint x = bitfieldReverse(index);
    x ^= (x & 0x55555555u) << 1;
    x ^= (x & 0x33333333u) << 2;
    x ^= (x & 0x0f0f0f0fu) << 4;
    x ^= (x & 0x00ff00ffu) << 8;
    return x ^ (x << 16);
}

// Starts the next group.
void sobol_open(inout Sobol s) {
    s.words = pcg4d(s.key + uvec4(0u, 0u, 0u, s.group));
    s.group += 1u;
    s.point = bitfieldReverse(permute(s.reversed, s.words.x));
    s.singles = 0u;
    s.pair = true;
}

// Returns the next number, in [0, 1).
float sobol_next_1d(inout Sobol s) {
    if (s.singles == SINGLES) {
        sobol_open(s);
    }
    s.singles += 1u;
    bool third = s.singles == 1u;
    uint word = third ? s.words.w : pcg4d(s.words).x;
    return unit(scramble(multiply(third, s.point), word));
}

// Returns the next two numbers, each in [0, 1).
vec2 sobol_next_2d(inout Sobol s) {
    if (!s.pair) {
        sobol_open(s);
    }
    s.singles = SINGLES;
    s.pair = false;
    return vec2(
        unit(scramble(bitfieldReverse(s.point), s.words.y)),
        unit(scramble(dimension_1(s.point), s.words.z))
    );
}

#endif
