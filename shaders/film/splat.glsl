// Splats: light for pixels other than the sample's own, which any invocation may add to. A slot
// holds three sums and three sums of squares; the slots of the picture come first, then those of
// layers, `splat_films` for each pixel. `splat_add` returns whether the splat was within range and
// was added.
//
// With SPLAT_NONE all splats are refused. With SPLAT_FLOAT a slot is six floats with atomic
// addition: fast, but the last bits depend on the order. With SPLAT_FIXED it is six 128-bit integers
// of four words each, as in crates/lumbre-light/src/film/splat.rs: the same bits in any order.
#ifndef FILM_SPLAT_GLSL
#define FILM_SPLAT_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "film/sums.glsl"

// Returns the number of slots of a pixel's time axis: its bins, and one slot each before and after
// them.
uint time_slots() {
    return job.time_bins + 2u;
}

// Returns the number of slots of the picture: one for each pixel or, with a time axis, for each of
// its slots. Those of layers follow.
uint splat_slots_of_picture() {
    uint pixels = job.resolution.x * job.resolution.y;
    return TIMES ? pixels * time_slots() : pixels;
}

// Maximum absolute value of one splat: 2^32.
const float MAX_SPLAT = 4294967296.0;

#ifdef SPLAT_NONE
bool splat_add(uint slot, vec3 value) {
    return false;
}
#elif defined(SPLAT_FLOAT)
#extension GL_EXT_shader_atomic_float : require
layout(set = 0, binding = 23, scalar) buffer Splats { float splats[]; };

bool splat_add(uint slot, vec3 value) {
    bool fits = finite(value) && all(lessThanEqual(abs(value), vec3(MAX_SPLAT)));
    if (fits) {
        for (uint c = 0u; c < 3u; c++) {
            atomicAdd(splats[6u * slot + c], value[c]);
            atomicAdd(splats[6u * slot + 3u + c], value[c] * value[c]);
        }
    }
    return fits;
}
#elif defined(SPLAT_FIXED)
layout(set = 0, binding = 23, scalar) buffer Splats { uint splats[]; };

// Returns word `i` of `mantissa * 2^shift`; digits below one are truncated.
uint wide_word(uvec2 mantissa, int shift, int i) {
    // Bit of the mantissa that is the word's lowest bit.
    int from = 32 * i - shift;
    if (from <= -32 || from >= 64) {
        return 0u;
    }
    if (from < 0) {
        return mantissa.x << -from;
    }
    uint part = uint(from) & 31u;
    uint low = from < 32 ? mantissa.x : mantissa.y;
    uint high = from < 32 ? mantissa.y : 0u;
    return part == 0u ? low : (low >> part) | (high << (32u - part));
}

// CPU drivers expand every atomic operation to a large loop; there is only one here, in a loop over
// the 24 words of a slot.
bool splat_add(uint slot, vec3 value) {
    bool fits = finite(value) && all(lessThanEqual(abs(value), vec3(MAX_SPLAT)));
    if (!fits) {
        return false;
    }
    bool room = true;
    uint carry = 0u;
    uvec2 mantissa = uvec2(0u);
    int shift = 0;
    bool negative = false;
    [[dont_unroll]] for (uint k = 0u; k < 24u; k++) {
        uint i = k & 3u;
        bool square = k >= 12u;
        if (i == 0u) {
            uint bits = floatBitsToUint(value[(k >> 2) % 3u]);
            int exponent = int((bits >> 23) & 0xffu);
            mantissa = uvec2((bits & 0x7fffffu) | (exponent == 0 ? 0u : 0x800000u), 0u);
            exponent = max(exponent, 1) - 150;
            // Fixed-point units are 2^-64 for sums and 2^-44 for squares.
            shift = square ? 2 * exponent + 44 : exponent + 64;
            negative = !square && (bits >> 31) != 0u;
            if (square) {
                umulExtended(mantissa.x, mantissa.x, mantissa.y, mantissa.x);
            }
            // A negative number is added in two's complement: its complement, plus one.
            carry = negative ? 1u : 0u;
        }
        uint digits = wide_word(mantissa, shift, int(i));
        digits = negative ? ~digits : digits;
        uint word = digits + carry;
        carry = word < carry ? 1u : 0u;
        if (word != 0u) {
            uint old = atomicAdd(splats[24u * slot + k], word);
            carry += old + word < old ? 1u : 0u;
        }
        room = room && !(square && i == 3u && carry != 0u);
    }
    return room;
}
#endif

#endif
