// The loop over the samples of one pixel, shared by all backends. `generated/integrator.glsl` is
// generated with each pipeline: it includes the job's integrator and defines INTEGRATOR_SAMPLE.
#ifndef ENTRY_SAMPLES_GLSL
#define ENTRY_SAMPLES_GLSL

#include "film/film.glsl"
#include "transport/sampler/mod.glsl"
#include "generated/integrator.glsl"

// Adds the wave's samples to a pixel; rows count from the wave's first one.
void render_pixel(uvec2 place) {
    uvec2 pixel = uvec2(place.x, place.y + wave.first_row);
    if (place.y >= wave.rows || any(greaterThanEqual(pixel, job.resolution))) {
        return;
    }
    uint at = pixel.y * job.resolution.x + pixel.x;
    film_pixel = pixel;
    SampleSums sums = pixel_sums[at];
    Invalid invalid = pixel_invalid[at];
    uint refused = invalid.count;
    uint rays = 0u;
    for (uint i = 0u; i < wave.samples; i++) {
        uint low = wave.first_sample.x + i;
        uvec2 index = uvec2(low, wave.first_sample.y + (low < i ? 1u : 0u));
        film_begin();
        Sampler numbers = sampler_start(job.seed, pixel, index);
        INTEGRATOR_SAMPLE(pixel, numbers);
        rays += film_rays;
        film_end(sums, invalid, at, index);
    }
    pixel_sums[at] = sums;
    if (invalid.count != refused) {
        pixel_invalid[at] = invalid;
        atomicAdd(counters.invalid, invalid.count - refused);
    }
    uint before = atomicAdd(counters.rays.x, rays);
    if (before + rays < before) {
        atomicAdd(counters.rays.y, 1u);
    }
}

#endif
