// Sums of floats that lose next to nothing: what rounding takes from a sum is gathered beside it [Knuth, TAOCP 2, 4.2.2].
#ifndef FILM_SUMS_GLSL
#define FILM_SUMS_GLSL

#include "scene.glsl"

void add_exactly(inout vec3 sum, inout vec3 rest, vec3 value) {
    precise vec3 total = sum + value;
    precise vec3 taken = total - sum;
    precise vec3 lost = (sum - (total - taken)) + (value - taken);
    // What was lost joins the sum as soon as the sum can show it, so that the rest stays below a half of its last place.
    precise vec3 small = rest + lost;
    precise vec3 joint = total + small;
    precise vec3 left = small - (joint - total);
    sum = joint;
    rest = left;
}

void add_sample(inout Sums sums, vec3 value) {
    add_exactly(sums.sum, sums.sum_rest, value);
    add_exactly(sums.sum2, sums.sum2_rest, value * value);
}

bool finite(vec3 v) {
    // By bits: devices may take it that there are no infinities.
    uvec3 exponent = floatBitsToUint(v) & 0x7f800000u;
    return all(notEqual(exponent, uvec3(0x7f800000u)));
}

#endif
