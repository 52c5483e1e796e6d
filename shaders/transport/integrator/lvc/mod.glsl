// Twin of crates/lumbre-light/src/transport/integrator/lvc/mod.rs.
#ifndef TRANSPORT_INTEGRATOR_LVC_MOD_GLSL
#define TRANSPORT_INTEGRATOR_LVC_MOD_GLSL

#include "transport/contribution.glsl"
#include "transport/integrator/bdpt/connect.glsl"
#include "transport/integrator/bdpt/draw.glsl"
#include "transport/integrator/iteration/light_paths.glsl"
#include "transport/integrator/lvc/cache.glsl"
#include "transport/integrator/settings.glsl"

// A connection with one of several drawn vertices.
struct Drawing {
    // Position of the first candidate, and the number that chooses among them.
    uvec2 first;
    float choice;
    // Probability with which the vertex was chosen.
    float probability;
};

// Draws candidate `i` of a connection, or the chosen one after them all; false if there is none.
// Random numbers are taken with the first.
bool drawn_vertex(uint i, inout Drawing drawing, inout Sampler numbers, out uint vertex) {
    if (i == 0u) {
        drawing.choice = next_1d(numbers);
        drawing.first = draw_first(next_2d(numbers));
    }
    if (light_list_head.count == 0u) {
        return false;
    }
    if (i < job.candidates) {
        candidate_targets[i] = 0.0;
    } else if (!draw_choose(drawing.choice, i, drawing.probability)) {
        return false;
    }
    vertex = draw_vertex(drawing.first, i);
    return true;
}

// Computes one sample of one pixel: traces the camera subpath and connects it with vertices of the
// cache, and the light subpaths of this pixel with the lens. As everywhere, one loop with one
// connection.
void lvc_sample(uvec2 pixel, inout Sampler numbers) {
    uint h = settings_heuristic();
    Subpaths paths = trace_camera(h, pixel, job.max_depth, numbers);
    uint pixels = job.resolution.x * job.resolution.y;
    uint own = pixel.y * job.resolution.x + pixel.x;
    uint drawn = job.candidates + 1u;
    // Light outside the scene first, then every camera vertex, then the lens with every light
    // subpath of this pixel.
    for (uint row = 0u; row <= paths.camera || own < job.light_path_count; ++row) {
        bool escaped = row == 0u, lens = row > paths.camera;
        uint t = escaped ? paths.camera + 2u : (lens ? 1u : row + 1u);
        if (escaped && !paths.escaped) {
            continue;
        }
        uint first = own * job.light_path_room;
        if (lens) {
            light_path_load(own, paths);
            own += pixels;
        }
        Vertex end_z;
        end_z.terminator = NO_TERMINATOR_OFFSET;
        Drawing drawing;
        // No light vertex, one, one again from a lifted point if the camera vertex has one, then
        // the candidates of every connection, each time with the chosen one after them, or every
        // vertex of the light subpath.
        uint slots = 3u + (lens ? paths.light : job.connections * drawn);
        for (uint slot = lens ? 1u : 0u; slot < slots; ++slot) {
            if (slot > 0u && !lens && (escaped || t > job.max_depth || !end_z.connectible)) {
                break;
            }
            bool further = slot >= 3u, draws = further && !lens;
            uint i = further ? (draws ? (slot - 3u) % drawn : slot - 3u) : 0u;
            uint s = min(slot, 1u), vertex = first + i;
            if (slot == 2u && !end_z.terminator.present || lens && slot == 1u && !paths.started) {
                continue;
            }
            if (draws && !drawn_vertex(i, drawing, numbers, vertex)) {
                continue;
            }
            bool loads_z = slot == 0u && !escaped;
            Vertex y;
            if (loads_z || further) {
                if (loads_z) {
                    vertex = own_vertices() + t - 2u;
                } else {
                    s = vertex % job.light_path_room + 2u;
                    uint material = subpath_vertices[vertex].material;
                    if (!is_connectible(material) || s + t - 1u > job.max_depth) {
                        continue;
                    }
                }
                y = vertex_at(vertex, loads_z ? RADIANCE : IMPORTANCE);
                if (loads_z) {
                    end_z = y;
                }
            }
            Vertex z = end_z;
            if (!lens && (slot == 2u || (further && z.terminator.present
                && terminator_offset_has_below(z.terminator, y.position)))) {
                vertex_lifted(end_z, z);
            }
            Connection c;
            if (!connect(h, s, t, pixel, escaped, paths, y, z, numbers, c)) {
                continue;
            }
            float count = counts_of(s, t);
            float weight = heuristic_weight_of_root(h, c.others, count);
            if (draws && i < job.candidates) {
                candidate_targets[i] = draw_target(luminance(c.unweighted), weight);
                continue;
            }
            if (c.shadowed && trace_occluded(c.ray, c.distance)) {
                continue;
            }
            vec3 unweighted = c.unweighted / (draws ? draw_samples(drawing.probability) : count);
            sink(Contribution(c.pixel, unweighted * weight, unweighted, s, t, c.optical_length));
        }
    }
}

#endif
