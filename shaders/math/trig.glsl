// Twin of crates/lumbre-light/src/math/trig.rs, and of functions of Rust's standard library and of glam. Vulkan
// guarantees sine and cosine to 2^-11 and the arc tangent to 4096 units in the last place, which
// bends directions by half a milliradian. Here they are computed from their series, to a few units
// in the last place on every device.
#ifndef MATH_ELEMENTARY_GLSL
#define MATH_ELEMENTARY_GLSL

const float PI = 3.14159265358979;
const float TAU = 6.28318530717959;
const float FRAC_1_PI = 0.318309886183791;
const float FRAC_PI_2 = 1.57079632679490;
const float FRAC_PI_4 = 0.785398163397448;
const float SQRT_2 = 1.41421356237310;
const float F32_EPSILON = 1.1920928955078125e-7;
#define INFINITY uintBitsToFloat(0x7f800000u)

// Returns whether a number is neither infinite nor NaN, judged by its bits: compilers may assume
// that comparisons are finite.
bool is_finite(float x) {
    return (floatBitsToUint(x) & 0x7f800000u) != 0x7f800000u;
}

bool is_finite(double x) {
    return (unpackDouble2x32(x).y & 0x7ff00000u) != 0x7ff00000u;
}

bool is_finite(vec3 v) {
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

// Returns `x` with the sign of `from`; the sign of zero counts.
float copysign(float x, float from) {
    return uintBitsToFloat(
        (floatBitsToUint(x) & 0x7fffffffu) | (floatBitsToUint(from) & 0x80000000u)
    );
}

float length_squared(vec3 v) {
    return dot(v, v);
}

float max_element(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

// Returns the unit vector along `v`, or `fallback` if `v` has no direction.
vec3 normalize_or(vec3 v, vec3 fallback) {
    float scale = 1.0 / sqrt(dot(v, v));
    return is_finite(scale) && scale > 0.0 ? v * scale : fallback;
}

// Returns sine in x and cosine in y of an angle of at most a few thousand radians: the nearest
// multiple of a quarter turn is subtracted in three parts of few digits each, and the rest needs
// short Taylor series.
vec2 sin_cos(float x) {
    precise float turns = roundEven(x * (2.0 / PI));
    precise float r = ((x - turns * 1.5703125) - turns * 4.837512969970703125e-4)
        - turns * 7.549789948768648e-8;
    float r2 = r * r;
    float s = r
        + r * r2 * (-1.0 / 6.0 + r2 * (1.0 / 120.0 + r2 * (-1.0 / 5040.0 + r2 * (1.0 / 362880.0))));
    float c = 1.0 + r2 * (-0.5 + r2 * (1.0 / 24.0 + r2 * (-1.0 / 720.0 + r2 * (1.0 / 40320.0))));
    uint quarter = uint(int(turns)) & 3u;
    vec2 sc = (quarter & 1u) == 0u ? vec2(s, c) : vec2(c, s);
    return vec2(quarter >= 2u ? -sc.x : sc.x, quarter == 1u || quarter == 2u ? -sc.y : sc.y);
}

// Returns the angle of the point (x, y) about the origin, in -pi..=pi; 0 at the origin if x is not
// negative.
float atan2(float y, float x) {
    float ax = abs(x), ay = abs(y);
    float least = min(ax, ay), most = max(ax, ay);
    // The series is evaluated for arguments below tan(pi / 8).
    bool fold = least > 0.41421356 * most;
    float t = fold ? (least - most) / (least + most) : (most > 0.0 ? least / most : 0.0);
    float t2 = t * t;
    float series = -1.0 / 3.0
        + t2 * (1.0 / 5.0 + t2 * (-1.0 / 7.0 + t2 * (1.0 / 9.0
        + t2 * (-1.0 / 11.0 + t2 * (1.0 / 13.0
        + t2 * (-1.0 / 15.0 + t2 * (1.0 / 17.0)))))));
    float angle = t + t * t2 * series;
    if (fold) {
        angle += FRAC_PI_4;
    }
    if (ay > ax) {
        angle = FRAC_PI_2 - angle;
    }
    if ((floatBitsToUint(x) & 0x80000000u) != 0u) {
        angle = PI - angle;
    }
    return copysign(angle, y);
}

// Returns the angle in 0..=pi whose cosine is `x`, for -1..=1.
float arc_cos(float x) {
    return atan2(sqrt(max((1.0 - x) * (1.0 + x), 0.0)), x);
}

// Returns the angle in -pi / 2..=pi / 2 whose sine is `x`, for -1..=1.
float arc_sin(float x) {
    return atan2(x, sqrt(max((1.0 - x) * (1.0 + x), 0.0)));
}

// Returns the logarithm of `1 + x` for x above -1 with full relative precision for small x: Vulkan
// guarantees `log` only to 2^-21 near 1. The series is that of the inverse hyperbolic tangent,
// between the roots of a half and of two.
float ln_1p(float x) {
    precise float y = 1.0 + x;
    precise float lost = x - (y - 1.0);
    int exponent = int(floatBitsToUint(y) >> 23) - 127;
    float m = uintBitsToFloat((floatBitsToUint(y) & 0x7fffffu) | 0x3f800000u);
    if (m > SQRT_2) {
        m *= 0.5;
        exponent += 1;
    }
    float s = (m - 1.0) / (m + 1.0), s2 = s * s;
    float series = 2.0 * s
        * (1.0 + s2 * (1.0 / 3.0 + s2 * (1.0 / 5.0 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0)))));
    return float(exponent) * 0.693147180559945 + (series + lost / y);
}

#endif
