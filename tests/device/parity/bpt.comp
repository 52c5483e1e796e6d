#include "transport/integrator/bpt.glsl"
#include "brute.glsl"
