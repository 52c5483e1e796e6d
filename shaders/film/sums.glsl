// Compensated sums of floats: the rounding error of a sum is accumulated beside it [Knuth, TAOCP 2,
// 4.2.2].
#ifndef FILM_SUMS_GLSL
#define FILM_SUMS_GLSL

#include "scene.glsl"

void add_exactly(inout vec3 sum, inout vec3 rest, vec3 value) {
    precise vec3 total = sum + value;
    precise vec3 taken = total - sum;
    precise vec3 lost = (sum - (total - taken)) + (value - taken);
    // The rest is added to the sum as soon as the sum can represent it, so that it stays below half
    // of the last place.
    precise vec3 small = rest + lost;
    precise vec3 joint = total + small;
    precise vec3 left = small - (joint - total);
    sum = joint;
    rest = left;
}

void add_sample(inout SampleSums sums, vec3 value) {
    add_exactly(sums.sum, sums.sum_rest, value);
    add_exactly(sums.sum2, sums.sum2_rest, value * value);
}

bool finite(vec3 v) {
    // Tested by bits, since compilers may assume that there are no infinities.
    uvec3 exponent = floatBitsToUint(v) & 0x7f800000u;
    return all(notEqual(exponent, uvec3(0x7f800000u)));
}

#endif
