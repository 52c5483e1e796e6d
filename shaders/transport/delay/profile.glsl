// Twin of crates/lumbre-light/src/transport/delay/profile.rs, for films with a time axis.
#ifndef TRANSPORT_DELAY_PROFILE_GLSL
#define TRANSPORT_DELAY_PROFILE_GLSL

#include "scene.glsl"
#include "math/trig.glsl"
#include "math/piecewise.glsl"
#include "transport/sampler/independent.glsl"
#include "transport/surface.glsl"

// A distribution of delays: its kind, its one or two parameters, and the rows of a table's knots.
struct Profile {
    uint kind;
    vec2 params;
    uvec2 knots;
};

// Returns the delay at which the distribution function reaches `u` in [0, 1).
float profile_sample(Profile p, float u) {
    float delay = p.kind == DELAY_CONSTANT ? p.params.x : 0.0;
    if (p.kind == DELAY_EXPONENTIAL) {
        delay = -ln_1p(-u) / p.params.x;
    } else if (p.kind == DELAY_EPANECHNIKOV) {
        float x = clamp(2.0 * u - 1.0, -1.0, 1.0);
        delay = p.params.x + 2.0 * p.params.y * sin_cos(arc_sin(x) / 3.0).x;
    } else if (p.kind == DELAY_TABLE) {
        delay = piecewise_sample(p.knots, u);
    }
    return max(delay, 0.0);
}

// Returns the profile in a row of `delay_profiles` at texture coordinates.
Profile delay_profile_at(uint row, Uv uv) {
    DelayProfile d = delay_profiles[row];
    vec2 texels = vec2(1.0);
    [[dont_unroll]] for (uint i = 0u; i < 2u; ++i) {
        if (d.textures[i] != NONE) {
            vec2 place = texture_place(d.textures[i], uv, d.tiling_scale, d.tiling_offset);
            texels[i] = texture_filtered(d.textures[i], place).x;
        }
    }
    return Profile(d.kind, d.offset + d.value * texels, d.knots);
}

// Samples one delay of each profile, `rows.y` from `rows.x`, at texture coordinates and returns the
// sum.
float delay_sample_all(uvec2 rows, Uv uv, inout Independent aux_rng) {
    float sum = 0.0;
    [[dont_unroll]] for (uint i = 0u; i < rows.y; ++i) {
        sum += profile_sample(delay_profile_at(rows.x + i, uv), independent_next_1d(aux_rng));
    }
    return sum;
}

#endif
