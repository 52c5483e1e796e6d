#include "transport/integrator/bpt.glsl"

void integrate(uvec2 pixel, inout Sampler numbers) {
    bpt_sample(pixel, numbers);
}

#include "brute.glsl"
