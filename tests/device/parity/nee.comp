#include "transport/integrator/nee.glsl"
#include "brute.glsl"
