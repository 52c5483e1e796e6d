// Twin of crates/lumbre-light/src/math/rng.rs.
#ifndef MATH_RNG_GLSL
#define MATH_RNG_GLSL

// Hashes four words to four well-mixed words [Jarzynski & Olano 2020].
uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> 16;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Returns a number in [0, 1) from the 24 upper bits of a word.
float unit(uint word) {
    return float(word >> 8) * (1.0 / 16777216.0);
}

#endif
