// Twin of crates/lumbre-light/src/transport/integrator/lvc/cache.rs: the numbers of samples of all strategies. The
// host estimates that of connections once for each job.
#ifndef TRANSPORT_INTEGRATOR_LVC_CACHE_GLSL
#define TRANSPORT_INTEGRATOR_LVC_CACHE_GLSL

#include "iteration.glsl"

float counts_connecting() {
    return light_list_head.connecting;
}

float counts_lens() {
    return float(job.light_path_count) / float(job.resolution.x * job.resolution.y);
}

#endif
