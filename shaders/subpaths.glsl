// The vertices of subpaths, for integrators that store any: those of the light subpaths that samples
// share, `job.light_path_room` for each, then those of the samples that are rendered at once.
#ifndef SUBPATHS_GLSL
#define SUBPATHS_GLSL

#include "scene.glsl"

layout(set = 0, binding = 30, scalar) restrict buffer SubpathVertices {
    SubpathVertex subpath_vertices[];
};
// Optical lengths of the same vertices; empty without a time axis.
layout(set = 0, binding = 31, scalar) restrict buffer SubpathLengths {
    SubpathLength subpath_lengths[];
};

// Returns whether a stored vertex can be connected, from its field `material`.
bool is_connectible(uint material) {
    return (material & NOT_CONNECTIBLE) == 0u;
}

#endif
