// Twin of src/transport/integrator/bdpt/mod.rs.
#ifndef TRANSPORT_INTEGRATOR_BDPT_MOD_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_MOD_GLSL

#include "transport/contribution.glsl"
#include "transport/integrator/bdpt/connect.glsl"
#include "transport/integrator/settings.glsl"

// One sample of one pixel: makes both subpaths and joins them in every way.
void bdpt_sample(uvec2 pixel, inout Sampler numbers) {
    uint h = settings_heuristic();
    bool raw = settings_raw();
    Subpaths paths = trace_subpaths(h, pixel, job.max_depth, numbers);
    // Light outside first, then every camera vertex, then the lens alone.
    for (uint row = 0u; row <= paths.camera + 1u; ++row) {
        bool escaped = row == 0u;
        uint t = escaped ? paths.camera + 2u : (row <= paths.camera ? row + 1u : 1u);
        if (escaped && !paths.escaped) {
            continue;
        }
        Vertex end_z;
        if (!escaped && t >= 2u) {
            end_z = vertices[t - 2u];
        }
        // No light vertex, one, one again from the crest of an overhang, then every vertex of the light subpath.
        for (uint slot = 0u; slot < paths.light + 3u; ++slot) {
            uint s = slot < 2u ? slot : slot - 1u;
            bool crest = slot == 2u;
            if (slot > 0u && (escaped || s + t - 1u > job.max_depth || (t >= 2u && !end_z.connectible))) {
                break;
            }
            bool possible = t >= 2u ? !crest || end_z.overhang.present : s >= 2u || (slot == 1u && paths.started);
            if (!possible || !settings_wants(s, t)) {
                continue;
            }
            Vertex y, z = end_z;
            if (s >= 2u) {
                y = vertices[MAX_DEPTH + s - 2u];
                if (!y.connectible) {
                    continue;
                }
            }
            if (t >= 2u && (crest || (s >= 2u && z.overhang.present && overhang_reaches(z.overhang, y.position)))) {
                vertex_raised(end_z, z);
            }
            Connection c;
            if (!connect(h, s, t, pixel, escaped, paths, y, z, numbers, c)) {
                continue;
            }
            if (c.shadowed && trace_occluded(c.ray, c.distance)) {
                continue;
            }
            float weight = raw ? 1.0 : float(1.0lf / (1.0lf + c.others));
            sink(Contribution(c.pixel, c.unweighted * weight, c.unweighted, s, t, c.optical_length));
        }
    }
}

#endif
