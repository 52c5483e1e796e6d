// Twin of crates/lumbre-light/src/transport/camera/filter.rs.
#ifndef TRANSPORT_CAMERA_FILTER_GLSL
#define TRANSPORT_CAMERA_FILTER_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "scene.glsl"
#include "math/trig.glsl"

// A pixel filter: its kind (FILTER_BOX and so on), and its half width in pixels.
struct FilterSpec {
    uint kind;
    float radius;
};

// Coefficients of the window [Harris 1978, table 1].
const vec4 HARRIS = vec4(0.35875, 0.48829, 0.14128, 0.01168);
// Maximum deviation of a normal distribution that a 24-bit random number can produce, in standard
// deviations.
const float MAX_SIGMAS = 5.5;
// Radius of the truncated Gaussian in standard deviations.
const float SIGMAS = 3.0;
// Mass of the standard normal distribution outside three standard deviations, on one side.
const float TAIL = 1.349898e-3;

// Samples a number in -1..=1 whose density falls linearly from 0 to both ends, by inversion.
float tent(float u) {
    return u < 0.5 ? sqrt(2.0 * u) - 1.0 : 1.0 - sqrt(max(2.0 * (1.0 - u), 0.0));
}

// Samples a number in -1..=1 with the density of the Blackman-Harris window, by inverting its
// distribution function: Newton steps safeguarded by bisection. In single precision, where Rust
// uses double; near the ends of the window, where the density vanishes, the difference from Rust
// grows as the function flattens.
float blackman_harris(float u) {
    float target = abs(u - 0.5);
    float low = 0.0, high = 1.0;
    float x = min(0.9 * target, 0.5);
    [[dont_unroll]] for (uint i = 0u; i < 24u; ++i) {
        vec2 a = sin_cos(PI * x);
        // Sine and cosine of two and three times the angle.
        vec2 b = vec2(2.0 * a.x * a.y, a.y * a.y - a.x * a.x);
        vec2 c = vec2(b.x * a.y + b.y * a.x, b.y * a.y - b.x * a.x);
        float sines = HARRIS.y * a.x + HARRIS.z * b.x / 2.0 + HARRIS.w * c.x / 3.0;
        float mass = 0.5 * (x + sines / (PI * HARRIS.x)) - target;
        float density = 0.5 * (1.0 + (HARRIS.y * a.y + HARRIS.z * b.y + HARRIS.w * c.y) / HARRIS.x);
        if (mass > 0.0) {
            high = x;
        } else {
            low = x;
        }
        float step = x - mass / density;
        float next = step > low && step < high ? step : 0.5 * (low + high);
        bool done = abs(next - x) < 1e-7;
        x = next;
        if (done) {
            break;
        }
    }
    return copysign(x, u - 0.5);
}

// Returns the quantile of the standard normal distribution for `p` in (0, 1) [Giles 2010, table 5].
float inverse_normal_cdf(float p) {
    float x = 2.0 * p - 1.0;
    float w = -log((1.0 - x) * (1.0 + x));
    bool centre = w < 5.0;
    w = centre ? w - 2.5 : sqrt(w) - 3.0;
    float sum = centre ? 2.8102264e-8 : -2.0021426e-4;
    sum = sum * w + (centre ? 3.4327393e-7 : 1.0095056e-4);
    sum = sum * w + (centre ? -3.5233877e-6 : 1.3493432e-3);
    sum = sum * w + (centre ? -4.3915065e-6 : -3.6734284e-3);
    sum = sum * w + (centre ? 2.1858087e-4 : 5.7395077e-3);
    sum = sum * w + (centre ? -1.253725e-3 : -7.6224613e-3);
    sum = sum * w + (centre ? -4.1776816e-3 : 9.4388705e-3);
    sum = sum * w + (centre ? 2.4664073e-1 : 1.001674);
    sum = sum * w + (centre ? 1.5014094 : 2.8329768);
    return SQRT_2 * x * sum;
}

// Samples a standard normal number truncated to an absolute value of at most three, by inversion.
float truncated_normal(float u) {
    return clamp(inverse_normal_cdf(TAIL + u * (1.0 - 2.0 * TAIL)), -SIGMAS, SIGMAS);
}

// Returns the middle of the 2^-24 wide step of a sample number, kept below 1.
float middle_of_step(float u) {
    return min(u + 0.5 / 16777216.0, 1.0 - 0.5 * F32_EPSILON);
}

// Samples one coordinate of the offset from the pixel's centre, in pixels.
float filter_sample_1d(FilterSpec f, float u) {
    switch (f.kind) {
        case FILTER_BOX:
            return (2.0 * u - 1.0) * f.radius;
        case FILTER_TENT:
            return tent(u) * f.radius;
        case FILTER_GAUSS:
            return truncated_normal(u) * f.radius / SIGMAS;
        case FILTER_BLACKMAN_HARRIS:
            return blackman_harris(u) * f.radius;
        default:
            return clamp(inverse_normal_cdf(middle_of_step(u)), -MAX_SIGMAS, MAX_SIGMAS) * 2.0
                * f.radius;
    }
}

// Samples an offset from the pixel's centre, in pixels.
vec2 filter_sample(FilterSpec f, vec2 u) {
    vec2 offset;
    [[dont_unroll]] for (uint i = 0u; i < 2u; ++i) {
        offset[i] = filter_sample_1d(f, u[i]);
    }
    return offset;
}

// Returns the largest absolute offset in pixels.
float filter_reach(FilterSpec f) {
    return f.kind == FILTER_ANTIALIASING_RADIUS ? 2.0 * MAX_SIGMAS * f.radius : f.radius;
}

float gauss(float x, float sigma) {
    return exp(-0.5 * (x / sigma) * (x / sigma)) / (sigma * sqrt(TAU));
}

// Returns the density of one coordinate of `filter_sample` at an offset `x`, per pixel; zero for a
// filter of radius zero.
float filter_density(FilterSpec f, float x) {
    float r = f.radius;
    if (r <= 0.0 || abs(x) > filter_reach(f)) {
        return 0.0;
    }
    switch (f.kind) {
        case FILTER_BOX:
            return 0.5 / r;
        case FILTER_TENT:
            return (1.0 - abs(x) / r) / r;
        case FILTER_GAUSS:
            return gauss(x, r / SIGMAS) / (1.0 - 2.0 * TAIL);
        case FILTER_BLACKMAN_HARRIS:
            vec3 c = vec3(
                sin_cos(PI * x / r).y, sin_cos(2.0 * PI * x / r).y, sin_cos(3.0 * PI * x / r).y
            );
            return (HARRIS.x + dot(HARRIS.yzw, c)) / (2.0 * r * HARRIS.x);
        default:
            return gauss(x, 2.0 * r);
    }
}

// What lies beyond the first and the last column, or row, of a film: `FilmEdge`.
const uint FILM_EDGE_OPEN = 0u;
const uint FILM_EDGE_WRAPS = 1u;
const uint FILM_EDGE_REFLECTS = 2u;

// Returns the index on a film of `count` pixels that the pixel with an index counted beyond its
// edges is.
uint film_edge_fold(uint edge, int index, int count) {
    if (edge == FILM_EDGE_OPEN) {
        return uint(index);
    }
    bool reflects = edge == FILM_EDGE_REFLECTS;
    int period = reflects ? 2 * count : count;
    int folded = index - period * int(floor(float(index) / float(period)));
    return uint(reflects ? min(folded, period - 1 - folded) : folded);
}

// Chooses the column (or row) among `count` that receives a light path at the film position `q`, in
// pixels from the edge, with the sum of the densities as weight; false if no pixel's filter covers
// the position.
bool filter_choose_pixel(
    FilterSpec f, float q, uint count, uint edge, float u, out uint chosen, out float weight
) {
    chosen = 0u;
    weight = 1.0;
    if (f.kind == FILTER_BOX && f.radius == 0.5) {
        chosen = min(uint(max(q, 0.0)), count - 1u);
        return q >= 0.0 && q < float(count);
    }
    float reach = filter_reach(f);
    if (reach <= 0.0 || !(q + reach >= 0.0 && q - reach <= float(count))) {
        return false;
    }
    float least = ceil(q - reach - 0.5), past = floor(q + reach - 0.5) + 1.0;
    bool open = edge == FILM_EDGE_OPEN;
    int first = int(open ? max(least, 0.0) : least);
    int end = int(open ? clamp(past, 0.0, float(count)) : past);
    float total = 0.0, rest = 0.0;
    bool found = false;
    // The first pass sums, the second one chooses.
    [[dont_unroll]] for (uint pass = 0u; pass < 2u; ++pass) {
        [[dont_unroll]] for (int i = first; i < end; ++i) {
            float d = filter_density(f, q - float(i) - 0.5);
            if (pass == 0u) {
                total += d;
                continue;
            }
            if (d > 0.0) {
                chosen = film_edge_fold(edge, i, int(count));
                found = true;
                if (rest < d) {
                    break;
                }
            }
            rest -= d;
        }
        rest = u * total;
    }
    weight = total;
    return found && total > 0.0;
}

#endif
