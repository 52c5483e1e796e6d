// The samples of one pixel, shared by all backends. `generated/integrator.glsl` is generated with
// each pipeline: it includes the job's integrator and defines INTEGRATOR_SAMPLE.
#ifndef ENTRY_SAMPLES_GLSL
#define ENTRY_SAMPLES_GLSL

#include "film/film.glsl"
#include "transport/sampler/mod.glsl"
#include "generated/integrator.glsl"

// Renders a sample of a pixel; returns what the pixel gets from it.
SampleValue render_sample(uvec2 pixel, uint at, uvec2 index) {
    film_begin();
    Sampler numbers = sampler_start(job.seed, pixel, index);
    INTEGRATOR_SAMPLE(pixel, numbers);
    return film_end(at);
}

// Adds the wave's samples to a pixel. With PARALLEL_SAMPLES it stores the value of sample `place.z`
// instead, and `sum.comp` adds them.
void render(uvec3 place) {
    uvec2 pixel;
    if (!pixel_at(place.xy, pixel)) {
        return;
    }
    uint at = pixel_index(pixel);
    film_pixel = pixel;
    PixelFilm film = pixel_begin(at);
    uint first = PARALLEL_SAMPLES ? place.z : 0u;
    uint end = PARALLEL_SAMPLES ? place.z + 1u : wave.samples;
    // A loop with one call, since compilers inline every call.
    for (uint i = first; i < end; i++) {
        uvec2 index = sample_index(i);
        SampleValue part = render_sample(pixel, at, index);
        if (PARALLEL_SAMPLES) {
            sample_values[sample_value_at(i, at)] = part;
        } else {
            pixel_add(film, part, index);
        }
    }
    if (!PARALLEL_SAMPLES) {
        pixel_end(film, at);
    }
}

#endif
