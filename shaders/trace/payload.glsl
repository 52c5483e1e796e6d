// The payload of a traced ray: its hit.
#ifndef TRACE_PAYLOAD_GLSL
#define TRACE_PAYLOAD_GLSL

#include "transport/ray.glsl"

struct Payload {
    Hit hit;
};

#endif
