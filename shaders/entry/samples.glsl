// The samples of one pixel, shared by all backends. `generated/integrator.glsl` is generated with
// each pipeline: it includes the job's integrator and defines INTEGRATOR_SAMPLE.
#ifndef ENTRY_SAMPLES_GLSL
#define ENTRY_SAMPLES_GLSL

#include "film/film.glsl"
#include "transport/sampler/mod.glsl"
#include "generated/integrator.glsl"

uint sample_number() {
    return film_sample;
}

#ifndef CAMERA_PATHS
// Whatever the integrator does for a sample is one step.
struct CameraPath {
    bool none;
};

CameraPath camera_path_new(uvec2 pixel, inout Sampler numbers) {
    return CameraPath(true);
}

bool camera_path_step(uvec2 pixel, inout CameraPath path, inout Sampler numbers) {
    INTEGRATOR_SAMPLE(pixel, numbers);
    return false;
}
#endif

// Ends a sample: adds it to its pixel or, with PARALLEL_SAMPLES, stores it, and `sum.comp` adds it. The
// sums are in memory between samples, where they cost no registers.
void end_sample(uint at, uint i, inout uint rays) {
    SampleValue part = film_end(at);
    if (PARALLEL_SAMPLES) {
        sample_values[sample_value_at(i, at)] = part;
        return;
    }
    SampleSums sums = pixel_sums[at];
    pixel_add(at, sums, part, sample_index(i));
    pixel_sums[at] = sums;
    rays += part.rays;
}

// Renders the samples of an invocation: all of the wave, or with PARALLEL_SAMPLES one. With REGENERATED
// the edges of all paths are one loop, so that an invocation whose path has ended does not wait for
// its neighbours.
void render(uvec3 place) {
    uvec2 pixel;
    if (!pixel_at(place.xy, pixel)) {
        return;
    }
    film_pixel = pixel;
    uint at = pixel_index(pixel), rays = 0u;
    uint i = PARALLEL_SAMPLES ? place.z : 0u;
    uint end = PARALLEL_SAMPLES ? place.z + 1u : wave.samples;
    film_sample = sample_value_at(i, at);
    CameraPath path;
    Sampler numbers;
    // The sample of the path: no flag, see `LastScatter`.
    uint begun = end;
    while (i < end) {
        if (!REGENERATED || begun != i) {
            begun = i;
            film_begin();
            numbers = sampler_start(job.seed, pixel, sample_index(i));
            path = camera_path_new(pixel, numbers);
        }
        bool goes_on;
        do {
            goes_on = camera_path_step(pixel, path, numbers);
        } while (goes_on && !REGENERATED);
        if (!goes_on) {
            end_sample(at, i, rays);
            i++;
        }
    }
    if (!PARALLEL_SAMPLES) {
        count_rays(rays);
    }
}

#endif
