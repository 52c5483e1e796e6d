// Twin of crates/lumbre-light/src/transport/bsdf/mirror.rs.
#ifndef TRANSPORT_BSDF_MIRROR_GLSL
#define TRANSPORT_BSDF_MIRROR_GLSL

#include "transport/bsdf/fresnel.glsl"
#include "transport/bsdf/lobe.glsl"

// Returns the mirrored direction, weighted by Schlick's reflectance.
LobeSample mirror_sample(vec3 f0, vec3 wo) {
    return LobeSample(vec3(-wo.x, -wo.y, wo.z), fresnel_schlick(f0, wo.z), 1.0);
}

#endif
