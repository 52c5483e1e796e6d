// Twin of crates/lumbre-light/src/transport/integrator/bdpt/mod.rs.
#ifndef TRANSPORT_INTEGRATOR_BDPT_MOD_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_MOD_GLSL

#include "transport/contribution.glsl"
#include "transport/integrator/bdpt/connect.glsl"
#include "transport/integrator/settings.glsl"

float counts_connecting() {
    return 1.0;
}

float counts_lens() {
    return 1.0;
}

// Computes one sample of one pixel: traces both subpaths and connects them in every way.
void bdpt_sample(uvec2 pixel, inout Sampler numbers) {
    uint h = settings_heuristic();
    bool raw = settings_unweighted();
    Subpaths paths = trace_subpaths(h, pixel, job.max_depth, numbers);
    uint first = own_vertices();
    // Light outside the scene first, then every camera vertex, then the lens alone.
    for (uint row = 0u; row <= paths.camera + 1u; ++row) {
        bool escaped = row == 0u;
        uint t = escaped ? paths.camera + 2u : (row <= paths.camera ? row + 1u : 1u);
        if (escaped && !paths.escaped) {
            continue;
        }
        Vertex end_z;
        end_z.terminator = NO_TERMINATOR_OFFSET;
        // No light vertex, one, one again from a lifted point if the camera vertex has one, then
        // every vertex of the light subpath.
        uint slot = 0u;
        for (uint step = 1u; slot < paths.light + 3u; slot += step) {
            step = slot == 1u && !end_z.terminator.present ? 2u : 1u;
            uint s = slot < 2u ? slot : slot - 1u;
            bool from_lifted = slot == 2u;
            if (slot > 0u
                && (escaped || s + t - 1u > job.max_depth || (t >= 2u && !end_z.connectible))) {
                break;
            }
            bool possible = t >= 2u || s >= 2u || (s == 1u && paths.started);
            bool used = possible && settings_includes(s, t);
            // The camera vertex is loaded first, then each light vertex: one call for both, since
            // compilers inline it.
            bool loads_z = slot == 0u && !escaped && t >= 2u;
            Vertex y;
            if (loads_z || (used && s >= 2u)) {
                uint index = first + (loads_z ? t - 2u : job.max_depth + s - 2u);
                if (!loads_z && !is_connectible(subpath_vertices[index].material)) {
                    continue;
                }
                y = vertex_at(index, loads_z ? RADIANCE : IMPORTANCE);
                if (loads_z) {
                    end_z = y;
                }
            }
            if (!used) {
                continue;
            }
            Vertex z = end_z;
            if (t >= 2u
                && (from_lifted || (s >= 2u && z.terminator.present
                    && terminator_offset_has_below(z.terminator, y.position)))) {
                vertex_lifted(end_z, z);
            }
            Connection c;
            if (!connect(h, s, t, pixel, escaped, paths, y, z, numbers, c)) {
                continue;
            }
            if (c.shadowed && trace_occluded(c.ray, c.distance)) {
                continue;
            }
            float weight = raw ? 1.0 : heuristic_weight_of_root(h, c.others, 1.0);
            sink(
                Contribution(c.pixel, c.unweighted * weight, c.unweighted, s, t, c.optical_length)
            );
        }
    }
}

#endif
