#include "transport/sampler/mod.glsl"

void twin() {
    uvec2 seed = uvec2(in_word(), in_word());
    uvec2 pixel = uvec2(in_word(), in_word());
    uvec2 index = uvec2(in_word(), in_word());
    Independent independent = independent_new(seed, pixel, index);
    Sobol sobol = sobol_new(seed, pixel, index);
    Sobol zsobol = zsobol_new(seed, 4u, pixel, index);
    // Dimensions of the numbers taken: 1d, 2d, 1d, 1d, 1d, 2d, 2d, and so on.
    for (uint i = 0u; i < 14u; ++i) {
        if (i % 7u == 1u || i % 7u > 4u) {
            out_vec2(sobol_next_2d(sobol));
            out_vec2(sobol_next_2d(zsobol));
        } else {
            out_float(sobol_next_1d(sobol));
            out_float(sobol_next_1d(zsobol));
        }
        out_float(independent_next_1d(independent));
    }
    Sampler either = sampler_start(job.seed, pixel, index);
    out_float(next_1d(either));
    out_vec2(next_2d(either));
}
