// Twin of src/transport/integrator/bdpt/subpath.rs.
//
// Whoever includes this may define MAX_DEPTH, no less than `job.max_depth`: so many vertices are kept of either subpath.
#ifndef TRANSPORT_INTEGRATOR_BDPT_SUBPATH_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_SUBPATH_GLSL

#include "scene.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/camera/lens.glsl"
#include "transport/flight.glsl"
#include "transport/integrator/bdpt/weights.glsl"
#include "transport/light/mod.glsl"
#include "transport/mod.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"
#include "transport/surface.glsl"
#include "transport/vertex.glsl"

#ifndef MAX_DEPTH
#define MAX_DEPTH 8u
#endif

// A vertex on a surface, generated from the camera or from a light; fields as in Rust. The shading normal is that of the
// BSDF's frame.
struct Vertex {
    vec3 position;
    vec3 n_geometric;
    vec3 wo;
    vec3 previous;
    vec3 n_previous;
    float back;
    Bsdf bsdf;
    bool connectible;
    Overhang overhang;
    uint emitter;
    Uv uv;
    vec3 emitted;
    vec3 throughput;
    Chain chain;
#ifdef TIMES
    Stamp stamp;
#endif
};

// Where an edge of a subpath comes from.
const uint ORIGIN_LENS = 0u;
const uint ORIGIN_LIGHT = 1u;
const uint ORIGIN_SURFACE = 2u;

// An edge of a subpath on its way to its next vertex; fields as in Rust. `point` counts where a light is left; `normal` is
// the unit normal of the origin, zero for a point of the lens or of an overhang.
struct Edge {
    uint origin;
    LightPoint point;
    vec3 normal;
    vec3 from;
    vec3 dir;
    double pdf_w;
    Chain link;
};

// An edge with what is needed to follow it. A camera subpath that left the scene is its last one.
struct Departure {
    Ray ray;
    Edge edge;
    vec3 throughput;
};

// What subpaths are besides their vertices; `start` is the start of the light subpath where `started`, `escape` the end of
// the camera subpath where `escaped`.
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

// The vertices of both subpaths: from the camera, then from the light.
Vertex vertices[2u * MAX_DEPTH];

const LightPoint NO_POINT = LightPoint(NONE, vec3(0.0), vec3(0.0), Uv(0.0));

// An edge from a point of the lens.
Edge edge_from_lens(vec3 from, vec3 dir) {
    float pdf_w = camera_pdf_w(dir);
    bool found = pdf_w > 0.0;
    Chain link = Chain(found ? 1.0lf : 0.0lf, 0.0lf);
    return Edge(ORIGIN_LENS, NO_POINT, vec3(0.0), from, dir, found ? double(pdf_w) : 1.0lf, link);
}

// An edge from a light.
Edge edge_from_light(LightPoint point, vec3 dir) {
    return Edge(ORIGIN_LIGHT, point, point.normal, point.position, dir, 0.0lf, Chain(0.0lf, 0.0lf));
}

// What weights need where an edge arrives; `spread` turns its density into one of that place.
bool edge_chain(Edge e, uint h, double spread, out Chain chain) {
    return chain_new(h, e.link, e.pdf_w * spread, chain);
}

// What weights need of the point of a surface that an edge meets, and `back` there; none where rounding leaves the point
// without a density.
bool edge_meet(Edge e, uint h, vec3 position, vec3 n, out Chain chain, out float back) {
    if (e.origin == ORIGIN_LIGHT) {
        LightEnd end = light_end_new(e.point, e.dir, position, n);
        Chain link = Chain(heuristic_term(h, end.direct / end.start), 1.0lf / heuristic_term(h, end.start));
        back = end.back;
        return chain_new(h, link, end.next, chain);
    }
    vec3 edge = position - e.from;
    float distance2 = length_squared(edge);
    float scale = 1.0 / (distance2 * sqrt(distance2));
    back = abs(dot(edge, e.normal)) * scale;
    return edge_chain(e, h, double(abs(dot(edge, n) * scale)), chain);
}

// The vertex where an edge meets a surface; none where rounding leaves it without a density.
bool edge_arrive(Edge e, uint h, Surface surface, uint mode, vec3 throughput, out Vertex v) {
    v.position = surface.position;
    v.n_geometric = surface.n_geometric;
    v.wo = -e.dir;
    v.previous = e.from;
    v.n_previous = e.normal;
    v.bsdf = bsdf_new(surface);
    v.connectible = bsdf_has_density(v.bsdf);
    v.overhang = surface.overhang;
    v.emitter = surface.emitter;
    v.uv = surface.uv;
    v.emitted = mode == RADIANCE ? surface_emitted(surface, v.wo) : vec3(0.0);
    v.throughput = throughput;
    return edge_meet(e, h, surface.position, surface.n_geometric, v.chain, v.back);
}

// The cosine by which a BSDF value towards `wi` is multiplied.
float vertex_cos(Vertex v, vec3 wi) {
    return abs(dot(wi, v.bsdf.frame.n));
}

// A vertex as edges meet it that leave from the crest of its overhang, if it has one.
bool vertex_raised(Vertex v, out Vertex raised) {
    raised = v;
    raised.position = v.overhang.crest;
    raised.n_geometric = vec3(0.0);
    raised.overhang.raised = true;
    return v.overhang.present;
}

// The other side's density of the vertex before, where its BSDF goes there with density `reverse_pdf_w`.
double vertex_density_before(Vertex v, float reverse_pdf_w) {
    return v.back > 0.0 ? double(reverse_pdf_w) * double(v.back) : 0.0lf;
}

// The edge on which a path goes on as sampled.
Edge vertex_onward(Vertex v, uint h, uint mode, BsdfSample s) {
    double pdf_w, before;
    if (s.delta) {
        float towards_next = abs(dot(s.wi, v.n_geometric)), back = abs(dot(v.wo, v.n_geometric));
        if (mode == RADIANCE) {
            back /= s.eta * s.eta;
        } else {
            towards_next *= s.eta * s.eta;
        }
        pdf_w = double(towards_next);
        before = double(back) * double(v.back);
    } else {
        pdf_w = double(s.pdf_w);
        before = vertex_density_before(v, bsdf_pdf_w(v.bsdf, s.wi, v.wo));
    }
    Chain link = chain_onward(v.chain, h, s.delta, before);
    bool raised = overhang_carries(v.overhang, s.wi);
    return Edge(
        ORIGIN_SURFACE, NO_POINT, raised ? vec3(0.0) : v.n_geometric, raised ? v.overhang.crest : v.position, s.wi, pdf_w,
        link
    );
}

// The start of the subpath from the camera.
Departure depart_from_camera(uvec2 pixel, inout Subpaths paths, inout Sampler numbers) {
    Ray ray = camera_sample_ray(pixel, numbers);
    paths.lens = ray.origin;
    return Departure(ray, edge_from_lens(ray.origin, ray.dir), vec3(1.0));
}

// The start of the subpath from a light; whether it is followed.
bool depart_from_light(uint max_edges, inout Subpaths paths, inout Sampler numbers, out Departure d) {
    float choice = next_1d(numbers);
    vec2 u = next_2d(numbers);
    vec2 v = next_2d(numbers);
    EmissionSample e;
    paths.started = lights_sample_emission(choice, u, v, e);
    paths.start = e;
    vec3 throughput = e.radiance * e.cos_theta / (e.pdf_a * e.pdf_w);
    d = Departure(leave(e.point.position, e.point.normal, e.dir), edge_from_light(e.point, e.dir), throughput);
    return paths.started && throughput != vec3(0.0) && max_edges > 1u;
}

// Both subpaths of a sample, of up to `max_edges` edges: `trace_camera`, `trace_light` and `walk`.
Subpaths trace_subpaths(uint h, uvec2 pixel, uint max_edges, inout Sampler numbers) {
    Subpaths paths;
    paths.camera = 0u;
    paths.light = 0u;
    paths.started = false;
    paths.escaped = false;
    Chance chance = chance_new(numbers);
    paths.emitted = chance_emission(chance);
    [[dont_unroll]] for (uint mode = RADIANCE; mode <= IMPORTANCE; ++mode) {
        Departure d;
        bool camera = mode == RADIANCE;
        if (camera) {
            d = depart_from_camera(pixel, paths, numbers);
        } else if (max_edges == 0u || !depart_from_light(max_edges, paths, numbers, d)) {
            break;
        }
        uint edges = camera ? max_edges : max_edges - 1u;
        Flight flight = flight_of_light(d.edge.from);
        if (camera) {
            flight = flight_of_camera(d.ray, paths.emitted);
        }
        // What the path will bring back, as far as BSDFs tell: roulette goes by it. The weights know nothing of roulette.
        vec3 promise = vec3(1.0);
        Overhang over = NO_OVERHANG;
        uint count = 0u;
        while (count < edges) {
            Hit hit;
            if (!trace_closest(d.ray, INFINITY, hit)) {
                if (camera) {
                    paths.escaped = true;
                    paths.escape = d;
                    paths.escape_length = flight_escaped(flight, d.edge.dir);
                }
                break;
            }
            // From the camera, the last edge finds light or nothing.
            if (camera && count + 1u == edges && emitter_of(hit.primitive, hit.instance) == NONE) {
                break;
            }
            Surface surface = flight_arrive(flight, d.ray, hit, chance);
            Vertex v;
            if ((over.present && !overhang_reaches(over, surface.position))
                || !edge_arrive(d.edge, h, surface, mode, d.throughput, v)) {
                break;
            }
#ifdef TIMES
            v.stamp = flight.stamp;
#endif
            bool ends = surface_ends(surface);
            v.connectible = v.connectible && !ends;
            vertices[(camera ? 0u : MAX_DEPTH) + count] = v;
            count += 1u;
            if (ends || count == edges) {
                break;
            }
            float choice = next_1d(numbers);
            BsdfSample s;
            if (!bsdf_sample(v.bsdf, v.wo, choice, next_2d(numbers), mode, s)) {
                break;
            }
            // Undoes the scaling of radiance by refraction.
            promise *= s.weight * (camera ? s.eta * s.eta : 1.0);
            float survival = 1.0;
            if (count >= job.rr_start) {
                survival = min(max_element(promise), MAX_SURVIVAL);
                if (next_1d(numbers) >= survival) {
                    break;
                }
                promise /= survival;
            }
            d.throughput = v.throughput * s.weight / survival;
            if (d.throughput == vec3(0.0)) {
                break;
            }
            flight_leave(flight, v.position, s.eta);
            d.ray = surface_spawn(surface, s.wi);
            d.edge = vertex_onward(v, h, mode, s);
            over = overhang_into(surface, s.wi);
        }
        if (camera) {
            paths.camera = count;
        } else {
            paths.light = count;
        }
    }
    return paths;
}

#endif
