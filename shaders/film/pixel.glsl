// The sums of a pixel's own samples. Samples are added in the order of their indices, also if they were rendered in parallel.
#ifndef FILM_PIXEL_GLSL
#define FILM_PIXEL_GLSL

#include "film/sums.glsl"

layout(set = 0, binding = 20, scalar) buffer PixelSums { SampleSums pixel_sums[]; };
layout(set = 0, binding = 21, scalar) buffer PixelInvalid { Invalid pixel_invalid[]; };
layout(set = 0, binding = 22, scalar) buffer CountersBlock { Counters counters; };
// Samples that wait to be added, [sample of the dispatch][pixel]; empty without PARALLEL_SAMPLES.
layout(set = 0, binding = 29, scalar) buffer SampleValues { SampleValue sample_values[]; };
layout(push_constant, scalar) uniform WaveBlock { WaveParams wave; };

// Returns whether an invocation has a pixel, and which; rows count from the wave's first one.
bool pixel_at(uvec2 place, out uvec2 pixel) {
    pixel = uvec2(place.x, place.y + wave.first_row);
    return place.y < wave.rows && all(lessThan(pixel, job.resolution));
}

uint pixel_index(uvec2 pixel) {
    return pixel.y * job.resolution.x + pixel.x;
}

// Returns the low and high word of the index of the dispatch's sample `i`.
uvec2 sample_index(uint i) {
    uint low = wave.first_sample.x + i;
    return uvec2(low, wave.first_sample.y + (low < i ? 1u : 0u));
}

// Returns the row of the dispatch's sample `i` among the values.
uint sample_value_at(uint i, uint pixel) {
    return i * job.resolution.x * job.resolution.y + pixel;
}

// Adds rays to those of the submission.
void count_rays(uint rays) {
    uint before = atomicAdd(counters.rays.x, rays);
    if (before + rays < before) {
        atomicAdd(counters.rays.y, 1u);
    }
}

// Adds a sample of a pixel to sums that began with those of the pixel: light that is not finite counts
// as another refused contribution.
void pixel_add(uint pixel, inout SampleSums sums, SampleValue part, uvec2 index) {
    uint refused = part.refused;
    if (finite(part.value)) {
        add_sample(sums, part.value);
    } else {
        refused++;
    }
    if (refused > 0u) {
        if (pixel_invalid[pixel].count == 0u) {
            pixel_invalid[pixel].first = index;
        }
        pixel_invalid[pixel].count += refused;
        atomicAdd(counters.invalid, refused);
    }
}

#endif
