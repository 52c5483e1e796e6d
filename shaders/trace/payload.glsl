// What a traced ray brings back: what was hit, and nothing else.
#ifndef TRACE_PAYLOAD_GLSL
#define TRACE_PAYLOAD_GLSL

#include "transport/ray.glsl"

struct Payload {
    Hit hit;
};

#endif
