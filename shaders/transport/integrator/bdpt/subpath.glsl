// Twin of crates/lumbre-light/src/transport/integrator/bdpt/subpath.rs.
#ifndef TRANSPORT_INTEGRATOR_BDPT_SUBPATH_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_SUBPATH_GLSL

#include "subpaths.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/camera/lens.glsl"
#include "transport/path_time.glsl"
#include "transport/integrator/bdpt/weights.glsl"
#include "transport/light/mod.glsl"
#include "transport/mod.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"
#include "transport/surface.glsl"
#include "transport/vertex.glsl"

// A vertex on a surface, generated from the camera or from a light; fields as in Rust. The shading
// normal is that of the BSDF's frame.
struct Vertex {
    vec3 position;
    vec3 n_geometric;
    float extent;
    vec3 wo;
    float back;
    Bsdf bsdf;
    bool connectible;
    TerminatorOffset terminator;
    // Radiance emitted at a camera vertex, and the root of the MIS terms of the other strategies.
    vec3 emitted;
    float hit_others;
    vec3 throughput;
    MisPartials partials;
    OpticalLength optical;
};

// The vertex that an edge of a subpath leaves.
const uint ORIGIN_LENS = 0u;
const uint ORIGIN_LIGHT = 1u;
const uint ORIGIN_SURFACE = 2u;

// An edge of a subpath whose end vertex is not known yet; fields as in Rust. `point` is used if the
// edge leaves a light; `normal` is the unit normal of the origin, zero for a lens point or a lifted
// point.
struct Edge {
    uint origin;
    LightPoint point;
    vec3 normal;
    vec3 from;
    vec3 dir;
    float pdf_w;
    MisPartials partials;
};

// An edge with its ray and throughput. A camera subpath that left the scene ends with it.
struct Departure {
    Ray ray;
    Edge edge;
    vec3 throughput;
};

// The subpaths of a sample without their vertices; `start` is the start of the light subpath if
// `started`, `escape` the end of the camera subpath if `escaped`.
struct Subpaths {
    uint camera;
    uint light;
    bool started;
    EmissionSample start;
    bool escaped;
    Departure escape;
    Length escape_length;
    vec3 lens;
    float emitted;
};

// Returns the number of the sample among those that may be rendered at once: an entry must define it.
uint sample_number();

// Returns the index of the first vertex of the sample, in the buffers of `subpaths.glsl`.
uint own_vertices() {
    return job.light_path_count * job.light_path_room
        + sample_number() % job.subpath_slots * job.subpath_room;
}

const LightPoint NO_POINT = LightPoint(NONE, vec3(0.0), vec3(0.0), 0.0, Uv(0.0));

// Returns an edge that leaves a point of the lens.
Edge edge_from_lens(uint h, vec3 from, vec3 dir) {
    float pdf_w = camera_pdf_w(dir);
    bool found = pdf_w > 0.0;
    MisPartials edge_partials = MisPartials(
        found ? heuristic_root(h, counts_lens()) : 0.0, 0.0
    );
    return Edge(
        ORIGIN_LENS, NO_POINT, vec3(0.0), from, dir, found ? pdf_w : 1.0, edge_partials
    );
}

// Returns an edge that leaves a light.
Edge edge_from_light(LightPoint point, vec3 dir) {
    return Edge(
        ORIGIN_LIGHT, point, point.normal, point.position, dir, 0.0, MisPartials(0.0, 0.0)
    );
}

// Computes the MIS partials at the end of an edge; `spread` converts its density to that of the end
// point.
bool edge_partials_at(Edge e, uint h, float spread, out MisPartials partials) {
    return mis_partials_new(h, e.partials, e.pdf_w * spread, partials);
}

// Returns whether an edge is a parallel ray of the camera. Its density is then per area
// perpendicular to it.
bool edge_is_parallel(Edge e) {
    return e.origin == ORIGIN_LENS && camera_is_parallel();
}

// Computes the MIS partials at the infinitely distant end of an edge: zero for parallel rays, whose
// ends no other strategy finds.
bool edge_distant_partials(Edge e, uint h, out MisPartials partials) {
    if (edge_is_parallel(e)) {
        partials = MisPartials(0.0, 0.0);
        return true;
    }
    return edge_partials_at(e, h, 1.0, partials);
}

// Computes the MIS partials of the surface point that an edge hits, and `back` there; false if
// rounding leaves the point without a density.
bool edge_partials_at_surface(
    Edge e, uint h, vec3 position, vec3 n, out MisPartials partials, out float back
) {
    if (e.origin == ORIGIN_LIGHT) {
        LightEnd end = light_end_new(e.point, e.dir, position, n);
        MisPartials edge_partials = MisPartials(
            heuristic_root(h, end.direct / end.start), 1.0 / heuristic_root(h, end.start)
        );
        back = end.back;
        return mis_partials_new(h, edge_partials, end.next, partials);
    }
    vec3 edge = position - e.from;
    float distance2 = length_squared(edge);
    float scale = 1.0 / (distance2 * sqrt(distance2));
    back = abs(dot(edge, e.normal)) * scale;
    float spread = abs(dot(edge, n) * scale);
    return edge_partials_at(e, h, edge_is_parallel(e) ? spread * distance2 : spread, partials);
}

// Builds the vertex at the surface that an edge hits; false if rounding leaves it without a
// density.
bool edge_vertex_at(Edge e, uint h, Surface surface, uint mode, vec3 throughput, out Vertex v) {
    v.position = surface.position;
    v.n_geometric = surface.n_geometric;
    v.extent = surface.extent;
    v.wo = -e.dir;
    v.bsdf = bsdf_new(surface);
    v.connectible = bsdf_has_density(v.bsdf) && !surface_ends_paths(surface);
    v.terminator = surface.terminator;
    v.emitted = mode == RADIANCE ? surface_emitted(surface, v.wo) : vec3(0.0);
    v.throughput = throughput;
    return edge_partials_at_surface(
        e, h, surface.position, surface.n_geometric, v.partials, v.back
    );
}

// Stores a vertex at a hit of `ray` on a surface of the given material.
void vertex_store(uint index, Vertex v, Ray ray, Hit hit, uint material) {
    subpath_vertices[index] = SubpathVertex(
        ray.origin, ray.dir, hit.t, hit.primitive, hit.instance, hit.uv,
        v.connectible ? material : material | NOT_CONNECTIBLE, v.back, v.hit_others, v.throughput,
        v.partials.d_vcm, v.partials.d_vc
    );
    if (TIMES) {
        subpath_lengths[index] = SubpathLength(
            v.optical.path, v.optical.delays, v.optical.delay, v.optical.index
        );
    }
}

// Returns a vertex as it was before it was stored: its surface and BSDF are derived again.
Vertex vertex_at(uint index, uint mode) {
    SubpathVertex stored = subpath_vertices[index];
    Ray ray = Ray(stored.origin, stored.dir);
    Hit hit = Hit(stored.t, stored.primitive, stored.instance, stored.uv);
    Surface surface = surface_with_material(ray, hit, stored.material & ~NOT_CONNECTIBLE);
    Vertex v;
    v.position = surface.position;
    v.n_geometric = surface.n_geometric;
    v.extent = surface.extent;
    v.wo = -stored.dir;
    v.back = stored.back;
    v.bsdf = bsdf_new(surface);
    v.connectible = is_connectible(stored.material);
    v.terminator = surface.terminator;
    v.emitted = mode == RADIANCE ? surface_emitted(surface, v.wo) : vec3(0.0);
    v.hit_others = stored.hit_others;
    v.throughput = stored.throughput;
    v.partials = MisPartials(stored.d_vcm, stored.d_vc);
    v.optical = OpticalLength(0.0, 0.0, 0.0, 1.0);
    if (TIMES) {
        SubpathLength length = subpath_lengths[index];
        v.optical = OpticalLength(length.path, length.delays, length.delay, length.index);
    }
    return v;
}

// Returns the root of the MIS terms of the other strategies if the camera subpath's vertex number
// `t`, the end of this edge, is a light that the path has hit; 0 if it is none.
float hit_others_of(Edge e, uint h, Surface surface, Vertex v, uint t) {
    if (v.emitted == vec3(0.0)) {
        return 0.0;
    }
    LightPoint point = LightPoint(surface.emitter, v.position, v.n_geometric, v.extent, surface.uv);
    return others_s0(h, v.partials, light_end_new(point, v.wo, e.from, e.normal), t);
}

// Returns a vertex as an end of edges.
EdgeEnd vertex_end(Vertex v) {
    return EdgeEnd(v.position, v.n_geometric, v.extent);
}

// Returns the cosine by which a BSDF value towards `wi` is multiplied.
float vertex_cos(Vertex v, vec3 wi) {
    return abs(dot(wi, v.bsdf.frame.n));
}

// Computes a vertex as the start of edges from its lifted point; false if it has none.
bool vertex_lifted(Vertex v, out Vertex lifted) {
    lifted = v;
    lifted.position = v.terminator.lifted_point;
    lifted.n_geometric = vec3(0.0);
    lifted.terminator.lifted = true;
    return v.terminator.present;
}

// Returns the other side's density of the previous vertex, if its BSDF samples that direction with
// density `reverse_pdf_w`.
float vertex_density_before(Vertex v, float reverse_pdf_w) {
    return v.back > 0.0 ? reverse_pdf_w * v.back : 0.0;
}

// Returns the edge of the sampled direction.
Edge vertex_next_edge(Vertex v, uint h, uint mode, BsdfSample s) {
    float pdf_w, before;
    if (s.delta) {
        float towards_next = abs(dot(s.wi, v.n_geometric)), back = abs(dot(v.wo, v.n_geometric));
        if (mode == RADIANCE) {
            back /= s.eta * s.eta;
        } else {
            towards_next *= s.eta * s.eta;
        }
        pdf_w = towards_next;
        before = back * v.back;
    } else {
        pdf_w = s.pdf_w;
        before = vertex_density_before(v, bsdf_pdf_w(v.bsdf, s.wi, v.wo));
    }
    MisPartials edge_partials = mis_partials_next_edge(v.partials, h, s.delta, before);
    bool lifted = terminator_offset_applies_to(v.terminator, s.wi);
    return Edge(
        ORIGIN_SURFACE, NO_POINT, lifted ? vec3(0.0) : v.n_geometric,
        lifted ? v.terminator.lifted_point : v.position, s.wi, pdf_w,
        edge_partials
    );
}

// Starts the camera subpath.
Departure depart_from_camera(uint h, uvec2 pixel, inout Subpaths paths, inout Sampler numbers) {
    Ray ray = camera_sample_ray(pixel, numbers);
    paths.lens = ray.origin;
    return Departure(ray, edge_from_lens(h, ray.origin, ray.dir), vec3(1.0));
}

// Starts the light subpath; returns whether it is traced.
bool depart_from_light(
    uint max_edges, inout Subpaths paths, inout Sampler numbers, out Departure d
) {
    float choice = next_1d(numbers);
    vec2 u = next_2d(numbers);
    vec2 v = next_2d(numbers);
    EmissionSample e;
    paths.started = lights_sample_emission(choice, u, v, e);
    paths.start = e;
    vec3 throughput = e.radiance * e.cos_theta / (e.pdf_a * e.pdf_w);
    d = Departure(
        spawn_ray(edge_end_of(e.point), e.dir), edge_from_light(e.point, e.dir),
        throughput
    );
    return paths.started && throughput != vec3(0.0) && max_edges > 1u;
}

// Returns the subpaths of a sample before they are traced; its light is emitted at `emitted`.
Subpaths subpaths_new(float emitted) {
    Subpaths paths;
    paths.camera = 0u;
    paths.light = 0u;
    paths.started = false;
    paths.escaped = false;
    paths.emitted = emitted;
    return paths;
}

// Follows a subpath from `d` on, with up to `edges` edges, and stores its vertices from the index
// `first` on; returns their number. A camera subpath that leaves the scene ends in `paths`.
uint walk(
    uint h, uint mode, uint first, uint edges, inout Departure d, inout PathTime path_time,
    inout Subpaths paths, inout AuxRng aux_rng, inout Sampler numbers
) {
    bool camera = mode == RADIANCE;
    // Product of the BSDF weights, by which roulette chooses the survival probability. Weights do
    // not involve roulette.
    vec3 rr_throughput = vec3(1.0);
    TerminatorOffset terminator = NO_TERMINATOR_OFFSET;
    uint count = 0u;
    while (count < edges) {
        Hit hit;
        if (!trace_closest(d.ray, INFINITY, hit)) {
            if (camera) {
                paths.escaped = true;
                paths.escape = d;
                paths.escape_length = path_time_escape_length(path_time, d.edge.dir);
            }
            break;
        }
        // The last edge of a camera subpath can only find light.
        if (camera && count + 1u == edges && emitter_of(hit.primitive, hit.instance) == NONE) {
            break;
        }
        Surface surface = path_time_arrive(path_time, d.ray, hit, aux_rng);
        Vertex v;
        if ((terminator.present && !terminator_offset_has_below(terminator, surface.position))
            || !edge_vertex_at(d.edge, h, surface, mode, d.throughput, v)) {
            break;
        }
        v.optical = path_time.optical;
        v.hit_others = hit_others_of(d.edge, h, surface, v, count + 2u);
        vertex_store(first + count, v, d.ray, hit, surface.material);
        count += 1u;
        if (surface_ends_paths(surface) || count == edges) {
            break;
        }
        float choice = next_1d(numbers);
        BsdfSample s;
        if (!bsdf_sample(v.bsdf, v.wo, choice, next_2d(numbers), mode, s)) {
            break;
        }
        // Undo the scaling of radiance by refraction.
        rr_throughput *= s.weight * (camera ? s.eta * s.eta : 1.0);
        float survival = 1.0;
        if (count >= job.rr_start) {
            survival = min(max_element(rr_throughput), MAX_SURVIVAL);
            if (next_1d(numbers) >= survival) {
                break;
            }
            rr_throughput /= survival;
        }
        d.throughput = v.throughput * s.weight / survival;
        if (d.throughput == vec3(0.0)) {
            break;
        }
        path_time_scatter(path_time, v.position, s.eta);
        d.ray = surface_spawn(surface, s.wi);
        d.edge = vertex_next_edge(v, h, mode, s);
        terminator = terminator_into(surface, s.wi);
    }
    return count;
}

// Traces the camera subpath of a sample, with up to `max_edges` edges.
Subpaths trace_camera(uint h, uvec2 pixel, uint max_edges, inout Sampler numbers) {
    AuxRng aux_rng = aux_rng_new(numbers);
    Subpaths paths = subpaths_new(aux_rng_emission(aux_rng));
    Departure d = depart_from_camera(h, pixel, paths, numbers);
    PathTime path_time = path_time_from_camera(d.ray, paths.emitted);
    paths.camera = walk(
        h, RADIANCE, own_vertices(), max_edges, d, path_time, paths, aux_rng, numbers
    );
    return paths;
}

// Traces both subpaths of a sample, with up to `max_edges` edges; the vertices of the light subpath
// are stored `max_edges` behind the first one of the camera subpath.
Subpaths trace_subpaths(uint h, uvec2 pixel, uint max_edges, inout Sampler numbers) {
    AuxRng aux_rng = aux_rng_new(numbers);
    Subpaths paths = subpaths_new(aux_rng_emission(aux_rng));
    [[dont_unroll]] for (uint mode = RADIANCE; mode <= IMPORTANCE; ++mode) {
        Departure d;
        bool camera = mode == RADIANCE;
        if (camera) {
            d = depart_from_camera(h, pixel, paths, numbers);
        } else if (max_edges == 0u || !depart_from_light(max_edges, paths, numbers, d)) {
            break;
        }
        PathTime path_time = path_time_from_light(d.edge.from);
        if (camera) {
            path_time = path_time_from_camera(d.ray, paths.emitted);
        }
        uint first = own_vertices() + (camera ? 0u : max_edges);
        uint edges = camera ? max_edges : max_edges - 1u;
        uint count = walk(h, mode, first, edges, d, path_time, paths, aux_rng, numbers);
        if (camera) {
            paths.camera = count;
        } else {
            paths.light = count;
        }
    }
    return paths;
}

#endif
