// Adds the samples that were rendered in parallel to their pixels, one invocation for each pixel.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 8, local_size_y = 8) in;

#include "film/pixel.glsl"

void main() {
    uvec2 pixel;
    if (!pixel_at(gl_GlobalInvocationID.xy, pixel)) {
        return;
    }
    uint at = pixel_index(pixel);
    SampleSums sums = pixel_sums[at];
    uint rays = 0u;
    for (uint i = 0u; i < wave.samples; i++) {
        SampleValue part = sample_values[sample_value_at(i, at)];
        pixel_add(at, sums, part, sample_index(i));
        rays += part.rays;
    }
    pixel_sums[at] = sums;
    count_rays(rays);
}
