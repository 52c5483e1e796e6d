// Entry point of `vulkan-compute`: one invocation per pixel, sample or light subpath, traversing a
// hierarchy in buffers.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 8, local_size_y = 8) in;

#include "trace/bvh.glsl"
#include "entry/invocation.glsl"

void main() {
    render(gl_GlobalInvocationID);
}
