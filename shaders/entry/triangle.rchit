// Closest-hit shader of triangles.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require

#include "trace/instances.glsl"
#include "trace/payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT vec2 weights;

void main() {
    payload.hit = hit_of_instance(
        gl_WorldRayOriginEXT, gl_WorldRayDirectionEXT, gl_HitTEXT,
        uint(gl_InstanceCustomIndexEXT), uint(gl_GeometryIndexEXT), uint(gl_PrimitiveID), weights
    );
}
