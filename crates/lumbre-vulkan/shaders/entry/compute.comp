// Entry point of `vulkan-compute`: one invocation per pixel or sample, traversing a hierarchy in buffers.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 8, local_size_y = 8) in;

#include "trace/bvh.glsl"
#include "entry/samples.glsl"

void main() {
    render_pixel(gl_GlobalInvocationID);
}
