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
    PixelFilm film = pixel_begin(at);
    for (uint i = 0u; i < wave.samples; i++) {
        pixel_add(film, sample_values[sample_value_at(i, at)], sample_index(i));
    }
    pixel_end(film, at);
}
