// Splats: light for pixels other than the sample's own, to which any invocation adds. A slot holds three sums and three
// sums of squares; the slots of all pixels come first, and after them those of layers, `splat_films` for each pixel.
// `splat_add` returns whether the splat can be counted, and is.
//
// With SPLAT_NONE there are none, and they are refused. With SPLAT_FLOAT, six floats that are added to atomically: fast, and the last bits depend on the order. Else six
// 128-bit whole numbers, four words each, as in src/film/splat.rs: the same bits in any order.
#ifndef FILM_SPLAT_GLSL
#define FILM_SPLAT_GLSL

#include "film/sums.glsl"

// The greatest absolute value of one splat: 2^32.
const float MAX_SPLAT = 4294967296.0;

#ifdef SPLAT_NONE
bool splat_add(uint slot, vec3 value) {
    return false;
}
#elif defined(SPLAT_FLOAT)
#extension GL_EXT_shader_atomic_float : require
layout(set = 0, binding = 18, scalar) buffer Splats { float splats[]; };

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
#else
layout(set = 0, binding = 18, scalar) buffer Splats { uint splats[]; };

// Adds a number of four words, low word first, to a sum. Returns whether that went past the end.
bool wide_add(uint first, uvec4 number) {
    uint carry = 0u;
    for (uint i = 0u; i < 4u; i++) {
        uint word = number[i] + carry;
        carry = word < carry ? 1u : 0u;
        if (word != 0u) {
            uint old = atomicAdd(splats[first + i], word);
            carry += old + word < old ? 1u : 0u;
        }
    }
    return carry != 0u;
}

// `mantissa * 2^shift` in four words; what lies below one is cut off.
uvec4 wide_shifted(uvec2 mantissa, int shift) {
    uvec4 number = uvec4(0u);
    for (int i = 0; i < 4; i++) {
        // The word's lowest bit is bit `32 i - shift` of the mantissa.
        int from = 32 * i - shift;
        if (from <= -32 || from >= 64) {
            continue;
        }
        uint word = 0u;
        if (from < 0) {
            word = mantissa.x << -from;
        } else {
            uint part = uint(from) & 31u;
            uint low = from < 32 ? mantissa.x : mantissa.y;
            uint high = from < 32 ? mantissa.y : 0u;
            word = part == 0u ? low : (low >> part) | (high << (32u - part));
        }
        number[i] = word;
    }
    return number;
}

uvec4 wide_negated(uvec4 number) {
    uvec4 n = ~number;
    for (uint i = 0u; i < 4u; i++) {
        n[i] += 1u;
        if (n[i] != 0u) {
            break;
        }
    }
    return n;
}

bool splat_add(uint slot, vec3 value) {
    bool fits = finite(value) && all(lessThanEqual(abs(value), vec3(MAX_SPLAT)));
    if (!fits) {
        return false;
    }
    bool room = true;
    for (uint c = 0u; c < 3u; c++) {
        uint bits = floatBitsToUint(value[c]);
        int exponent = int((bits >> 23) & 0xffu);
        uint mantissa = (bits & 0x7fffffu) | (exponent == 0 ? 0u : 0x800000u);
        exponent = max(exponent, 1) - 150;
        // Units of 2^-64; going past the end is how a negative number is added.
        uvec4 number = wide_shifted(uvec2(mantissa, 0u), exponent + 64);
        wide_add(24u * slot + 4u * c, (bits >> 31) != 0u ? wide_negated(number) : number);
        // Units of 2^-44.
        uvec2 square;
        umulExtended(mantissa, mantissa, square.y, square.x);
        room = !wide_add(24u * slot + 12u + 4u * c, wide_shifted(square, 2 * exponent + 44)) && room;
    }
    return room;
}
#endif

#endif
