// Miss shader: the ray hits nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require

#include "scene.glsl"
#include "trace/payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.hit.primitive = NONE;
}
