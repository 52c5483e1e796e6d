// Twin of crates/lumbre-light/src/transport/integrator/camera_path/single.rs, one edge at a time: an invocation
// whose path has ended starts the next sample while the paths of its neighbours go on.
#ifndef TRANSPORT_INTEGRATOR_CAMERA_PATH_SINGLE_GLSL
#define TRANSPORT_INTEGRATOR_CAMERA_PATH_SINGLE_GLSL

// States that `camera_path_new` and `camera_path_step` render a sample: see entry/samples.glsl.
#define CAMERA_PATHS

#include "scene.glsl"
#include "transport/bsdf/mod.glsl"
#include "transport/camera/lens.glsl"
#include "transport/contribution.glsl"
#include "transport/path_time.glsl"
#include "transport/light/mod.glsl"
#include "transport/mod.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"
#include "transport/surface.glsl"
#include "transport/vertex.glsl"

// The last event of a path: where it happened, and its density per solid angle, or NO_DENSITY if light
// sampling could not have replaced it. A `bool` that is false at first has no place here: NVIDIA's
// driver 580.159 compiles it wrongly for ray generation (docs/notes/devices.md).
struct LastScatter {
    vec3 from;
    float pdf_w;
};

const float NO_DENSITY = -1.0;

// A path between two of its edges.
struct CameraPath {
    Ray ray;
    // Number of the edge along `ray`, counted from 1.
    uint edge;
    vec3 throughput;
    // Undoes the scaling of radiance by refraction, so that roulette judges the expected
    // contribution.
    float eta_scale;
    LastScatter last;
    TerminatorOffset terminator;
    PathTime time;
    AuxRng aux_rng;
};

// The functions of a technique, which `scatter` and `escape` of `CameraPaths` are in Rust. The first
// two return the weight of light that a path hit, and of light outside the scene; the third
// contributes light to which it connects a vertex.
float technique_hit_weight(LastScatter last, Surface surface);
float technique_escape_weight(LastScatter last, vec3 dir);
void technique_connect(
    uvec2 pixel, CameraPath path, vec3 wo, Surface surface, Bsdf bsdf, inout Sampler numbers
);

// Starts the path of a sample.
CameraPath camera_path_new(uvec2 pixel, inout Sampler numbers) {
    CameraPath path;
    path.ray = camera_sample_ray(pixel, numbers);
    path.edge = 1u;
    path.throughput = vec3(1.0);
    path.eta_scale = 1.0;
    path.last = LastScatter(vec3(0.0), NO_DENSITY);
    path.terminator = NO_TERMINATOR_OFFSET;
    path.aux_rng = aux_rng_new(numbers);
    path.time = path_time_from_camera(path.ray, aux_rng_emission(path.aux_rng));
    return path;
}

// Traces an edge, contributes the light at its end, and samples the next edge; false if there is
// none.
bool camera_path_step(uvec2 pixel, inout CameraPath path, inout Sampler numbers) {
    Ray ray = path.ray;
    LastScatter last = path.last;
    TerminatorOffset terminator = path.terminator;
    // A compiler would keep these to the end of the function for paths that end before they are set.
    path.ray = Ray(vec3(0.0), vec3(0.0));
    path.last = LastScatter(vec3(0.0), NO_DENSITY);
    path.terminator = NO_TERMINATOR_OFFSET;
    Hit hit;
    bool met = trace_closest(ray, INFINITY, hit);
    vec3 wo = -ray.dir;
    bool is_last = path.edge == job.max_depth;
    Surface surface;
    vec3 radiance;
    Length length;
    if (met) {
        // The last edge can only find light.
        if (is_last && emitter_of(hit.primitive, hit.instance) == NONE) {
            return false;
        }
        surface = path_time_arrive(path.time, ray, hit, path.aux_rng);
        length = optical_length_arrival(path.time.optical);
        if (terminator.present && !terminator_offset_has_below(terminator, surface.position)) {
            return false;
        }
        radiance = surface_emitted(surface, wo);
    } else {
        radiance = lights_environment(ray.dir);
        length = path_time_escape_length(path.time, ray.dir);
    }
    if (radiance != vec3(0.0)) {
        float weight = met
            ? technique_hit_weight(last, surface) : technique_escape_weight(last, ray.dir);
        vec3 unweighted = path.throughput * radiance;
        sink(Contribution(pixel, unweighted * weight, unweighted, 0u, path.edge + 1u, length));
    }
    if (!met || is_last || surface_ends_paths(surface)) {
        return false;
    }
    Bsdf bsdf = bsdf_new(surface);
    technique_connect(pixel, path, wo, surface, bsdf, numbers);
    float choice = next_1d(numbers);
    BsdfSample s;
    if (!bsdf_sample(bsdf, wo, choice, next_2d(numbers), RADIANCE, s)) {
        return false;
    }
    path.throughput *= s.weight;
    path.eta_scale *= s.eta * s.eta;
    path.terminator = terminator_into(surface, s.wi);
    path.last = LastScatter(
        path.terminator.present ? path.terminator.lifted_point : surface.position,
        s.delta ? NO_DENSITY : s.pdf_w
    );
    if (path.edge >= job.rr_start) {
        float survival = min(max_element(path.throughput) * path.eta_scale, MAX_SURVIVAL);
        if (next_1d(numbers) >= survival) {
            return false;
        }
        path.throughput /= survival;
    }
    path_time_scatter(path.time, surface.position, s.eta);
    path.ray = surface_spawn(surface, s.wi);
    path.edge++;
    return path.throughput != vec3(0.0);
}

#endif
