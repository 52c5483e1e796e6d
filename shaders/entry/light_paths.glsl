// The light subpath of an invocation, for integrators that share some, with LIGHT_PATHS.
// `generated/integrator.glsl` includes the numbers of samples of the integrator's strategies.
#ifndef ENTRY_LIGHT_PATHS_GLSL
#define ENTRY_LIGHT_PATHS_GLSL

#include "film/film.glsl"
#include "transport/integrator/iteration/light_paths.glsl"
#include "generated/integrator.glsl"

// Traces a light subpath of the wave: a sample of the pixel that keys its random numbers.
void render(uvec3 place) {
    uint path = place.y * LIGHT_PATHS_ROW + place.x;
    if (path >= wave.samples) {
        return;
    }
    film_rays = 0u;
    Sampler numbers = sampler_start(job.seed, uvec2(wave.first_row), sample_index(path));
    Subpaths paths;
    uint vertices = light_path_trace(path, paths, numbers);
    light_path_end(path, paths, vertices);
    count_rays(film_rays);
}

#endif
