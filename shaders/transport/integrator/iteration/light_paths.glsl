// Twin of crates/lumbre-light/src/transport/integrator/iteration/light_paths.rs: light subpaths that belong to no
// pixel, and their vertices in buffers.
#ifndef TRANSPORT_INTEGRATOR_ITERATION_LIGHT_PATHS_GLSL
#define TRANSPORT_INTEGRATOR_ITERATION_LIGHT_PATHS_GLSL

#include "iteration.glsl"
#include "transport/integrator/bdpt/subpath.glsl"
#include "transport/integrator/settings.glsl"

// Traces light subpath number `path` and stores it: `follow` in Rust. Returns how many of its
// vertices were stored; `light_path_end` completes it.
uint light_path_trace(uint path, inout Subpaths paths, inout Sampler numbers) {
    AuxRng aux_rng = aux_rng_new(numbers);
    paths = subpaths_new(0.0);
    Departure d;
    if (!depart_from_light(job.max_depth, paths, numbers, d)) {
        return 0u;
    }
    PathTime path_time = path_time_from_light(d.edge.from);
    return walk(
        settings_heuristic(), IMPORTANCE, path * job.light_path_room, job.max_depth - 1u, d,
        path_time, paths, aux_rng, numbers
    );
}

// Stores the start of a light subpath, and the number of its vertices and of those that can be
// connected.
void light_path_end(uint path, Subpaths paths, uint vertices) {
    uint first = path * job.light_path_room, connectible = 0u;
    for (uint i = 0u; i < vertices; ++i) {
        connectible += is_connectible(subpath_vertices[first + i].material) ? 1u : 0u;
    }
    EmissionSample start = paths.start;
    light_paths[path] = LightPath(
        paths.started ? start.point.light : NONE, start.point.position, start.point.normal,
        start.point.extent, start.point.uv, start.dir, start.radiance, vertices, connectible, 0u
    );
}

// Makes a light subpath the one of a sample: `load` in Rust. Its vertices stay in the buffer.
void light_path_load(uint path, inout Subpaths paths) {
    LightPath stored = light_paths[path];
    paths.started = stored.light != NONE;
    paths.start.point = LightPoint(
        stored.light, stored.position, stored.normal, stored.extent, stored.uv
    );
    paths.start.dir = stored.dir;
    paths.start.radiance = stored.radiance;
    paths.light = stored.vertices;
}

#endif
