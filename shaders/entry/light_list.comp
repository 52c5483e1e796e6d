// Lists the vertices of light subpaths that can be connected, ordered by subpath and vertex, in three
// steps: sums within blocks of subpaths, sums of blocks, and the list. One invocation for each
// subpath; one workgroup for the sums of blocks.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "film/pixel.glsl"
#include "iteration.glsl"

layout(local_size_x = LIST_BLOCK) in;

shared uint sums[LIST_BLOCK];

// Returns the sum of the values of the invocations before this one, and that of the whole workgroup.
uint sum_before(uint value, out uint total) {
    uint own = gl_LocalInvocationIndex;
    sums[own] = value;
    for (uint step = 1u; step < LIST_BLOCK; step *= 2u) {
        barrier();
        uint earlier = own >= step ? sums[own - step] : 0u;
        barrier();
        sums[own] += earlier;
    }
    barrier();
    total = sums[LIST_BLOCK - 1u];
    uint sum = sums[own];
    barrier();
    return sum - value;
}

void main() {
    uint block = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint path = block * LIST_BLOCK + gl_LocalInvocationIndex;
    uint blocks = light_list_blocks(wave.samples);
    bool exists = path < wave.samples;
    uint total;
    if (wave.step == LIST_STEP_PATHS) {
        uint before = sum_before(exists ? light_paths[path].connectible : 0u, total);
        if (exists) {
            light_paths[path].before = before;
        }
        if (block < blocks && gl_LocalInvocationIndex == 0u) {
            light_list[block] = total;
        }
    } else if (wave.step == LIST_STEP_BLOCKS) {
        uint count = 0u;
        for (uint first = 0u; first < blocks; first += LIST_BLOCK) {
            uint at = first + gl_LocalInvocationIndex;
            uint before = count + sum_before(at < blocks ? light_list[at] : 0u, total);
            if (at < blocks) {
                light_list[at] = before;
            }
            count += total;
        }
        if (gl_LocalInvocationIndex == 0u) {
            light_list_head.count = count;
        }
    } else if (exists) {
        uint to = blocks + light_list[block] + light_paths[path].before;
        uint first = path * job.light_path_room;
        for (uint i = 0u; i < light_paths[path].vertices; ++i) {
            if (is_connectible(subpath_vertices[first + i].material)) {
                light_list[to++] = first + i;
            }
        }
    }
}
