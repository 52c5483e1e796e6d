// Twin of crates/lumbre-light/src/transport/integrator/iteration/light_paths.rs: light subpaths that belong to no
// pixel, and their vertices in buffers.
#ifndef TRANSPORT_INTEGRATOR_ITERATION_LIGHT_PATHS_GLSL
#define TRANSPORT_INTEGRATOR_ITERATION_LIGHT_PATHS_GLSL

#include "iteration.glsl"
#include "transport/integrator/bdpt/subpath.glsl"
#include "transport/integrator/settings.glsl"

// Stores a vertex of a light subpath.
void light_vertex_put(uint index, StoredVertex stored) {
    light_vertices[index] = LightVertex(
        stored.ray.origin, stored.ray.dir, stored.hit.t, stored.hit.primitive,
        stored.hit.instance, stored.hit.uv, stored.material, stored.back, stored.throughput,
        stored.partials.d_vcm, stored.partials.d_vc
    );
    if (TIMES) {
        OpticalLength optical = stored.optical;
        light_lengths[index] = LightLength(
            optical.path, optical.delays, optical.delay, optical.index
        );
    }
}

// Returns a stored vertex of a light subpath: `vertex` in Rust, which also derives its BSDF.
StoredVertex light_vertex_at(uint index) {
    LightVertex v = light_vertices[index];
    OpticalLength optical = OpticalLength(0.0, 0.0, 0.0, 1.0);
    if (TIMES) {
        LightLength stored = light_lengths[index];
        optical = OpticalLength(stored.path, stored.delays, stored.delay, stored.index);
    }
    return StoredVertex(
        Ray(v.origin, v.dir), Hit(v.t, v.primitive, v.instance, v.uv), v.material, v.back, 0.0,
        v.throughput, MisPartials(v.d_vcm, v.d_vc), optical
    );
}

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
        settings_heuristic(), IMPORTANCE, path * light_path_room(), job.max_depth - 1u, d,
        path_time, paths, aux_rng, numbers
    );
}

// Stores the start of a light subpath, and the number of its vertices and of those that can be
// connected.
void light_path_end(uint path, Subpaths paths, uint vertices, uint connectible) {
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
