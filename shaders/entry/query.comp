// Entry point of `vulkan-query`: one invocation per pixel, sample or light subpath, with ray queries.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 8, local_size_y = 8) in;

#include "trace/query.glsl"
#include "entry/invocation.glsl"

void main() {
    render(gl_GlobalInvocationID);
}
