#include "transport/integrator/bdpt/mod.glsl"

void integrate(uvec2 pixel, inout Sampler numbers) {
    bdpt_sample(pixel, numbers);
}

#include "brute.glsl"
