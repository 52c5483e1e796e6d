// What an invocation does, for all backends: `render`. With LIGHT_PATHS it traces a light subpath, else
// the samples of a pixel or one of them.
#ifdef LIGHT_PATHS
#include "entry/light_paths.glsl"
#else
#include "entry/samples.glsl"
#endif
