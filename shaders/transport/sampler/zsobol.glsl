// Twin of crates/lumbre-light/src/transport/sampler/zsobol.rs.
#ifndef TRANSPORT_SAMPLER_ZSOBOL_GLSL
#define TRANSPORT_SAMPLER_ZSOBOL_GLSL

#include "transport/sampler/sobol.glsl"

const uint ZSOBOL_TILE_BITS = 11u;

// Returns the lower digits of a coordinate with a zero after each.
uint zsobol_spread(uint x) {
    x &= (1u << ZSOBOL_TILE_BITS) - 1u;
    x = (x | (x << 8)) & 0x00ff00ffu;
    x = (x | (x << 4)) & 0x0f0f0f0fu;
    x = (x | (x << 2)) & 0x33333333u;
    return (x | (x << 1)) & 0x55555555u;
}

// Starts the numbers of one sample of one pixel; 64-bit integers are low word first. A block has
// 2^block_bits samples of each pixel.
Sobol zsobol_new(uvec2 seed, uint block_bits, uvec2 pixel, uvec2 index) {
    uint within = index.x & ((1u << block_bits) - 1u);
    uvec2 tile = pixel >> ZSOBOL_TILE_BITS;
    uvec4 key = pcg4d(uvec4(
        tile.x | (tile.y << 16),
        seed.x,
        index.x - within,
        seed.y ^ ((index.y << 16) | (index.y >> 16))
    ));
    uint morton = zsobol_spread(pixel.x) | (zsobol_spread(pixel.y) << 1);
    return sobol_from(key, (morton << block_bits) + within);
}

#endif
