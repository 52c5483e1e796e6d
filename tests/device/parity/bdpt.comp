#include "transport/integrator/bdpt/mod.glsl"

uint sample_number() {
    return gl_LaunchIDEXT.x;
}

void integrate(uvec2 pixel, inout Sampler numbers) {
    bdpt_sample(pixel, numbers);
}

#include "brute.glsl"
