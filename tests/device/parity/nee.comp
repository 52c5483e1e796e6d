#include "transport/integrator/nee.glsl"

void integrate(uvec2 pixel, inout Sampler numbers) {
    nee_sample(pixel, numbers);
}

#include "brute.glsl"
