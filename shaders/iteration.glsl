// The data that the samples of an iteration share, for integrators that need any: light subpaths,
// and the list of their vertices that can be connected. They are computed before the samples, by
// entry/light_paths.glsl and entry/light_list.comp.
#ifndef ITERATION_GLSL
#define ITERATION_GLSL

#include "subpaths.glsl"

layout(set = 0, binding = 32, scalar) restrict buffer LightPaths { LightPath light_paths[]; };
// Sums for the blocks of LIST_BLOCK subpaths, then the numbers of the vertices that can be
// connected, ordered by subpath and vertex.
layout(set = 0, binding = 33, scalar) restrict buffer LightListBlock {
    LightListHead light_list_head;
    uint light_list[];
};

// Returns the number of blocks of `paths` subpaths.
uint light_list_blocks(uint paths) {
    return (paths + LIST_BLOCK - 1u) / LIST_BLOCK;
}

#endif
