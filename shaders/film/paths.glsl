// The recorded events of a sample's path: twin of crates/lumbre-render/src/path_trace.rs. Without PATHS
// nothing is recorded.
#ifndef FILM_PATHS_GLSL
#define FILM_PATHS_GLSL

// For each column of the current row a fixed number of events; unused ones stay zero.
layout(set = 0, binding = 26, scalar) buffer PathSteps { PathStep path_steps[]; };

uint path_count;

void paths_add(PathStep s) {
    if (PATHS && path_count < MAX_PATH_EVENTS) {
        path_steps[film_pixel.x * MAX_PATH_EVENTS + path_count] = s;
        path_count++;
    }
}

void paths_begin() {
    path_count = 0u;
}

PathStep paths_ray(uint kind, Ray ray, float t_max) {
    PathStep s;
    s.kind = kind;
    s.met = NONE;
    s.origin = ray.origin;
    s.dir = ray.dir;
    s.t_max = t_max;
    s.t = t_max;
    s.uv = vec2(0.0);
    s.pixel = uvec2(0u);
    s.value = vec3(0.0);
    s.unweighted = vec3(0.0);
    s.light_vertices = 0u;
    s.camera_vertices = 0u;
    s.optical_length = 0.0;
    return s;
}

void paths_closest(Ray ray, float t_max, bool found, Hit hit) {
    PathStep s = paths_ray(STEP_CLOSEST, ray, t_max);
    if (found) {
        s.met = hit.primitive;
        s.t = hit.t;
        s.uv = hit.uv;
    }
    paths_add(s);
}

void paths_shadow(Ray ray, float t_max, bool blocked) {
    PathStep s = paths_ray(STEP_SHADOW, ray, t_max);
    s.met = blocked ? 1u : 0u;
    paths_add(s);
}

void paths_light(Contribution c) {
    PathStep s = paths_ray(STEP_LIGHT, Ray(vec3(0.0), vec3(0.0)), 0.0);
    s.pixel = c.pixel;
    s.value = c.value;
    s.unweighted = c.unweighted;
    s.light_vertices = c.s;
    s.camera_vertices = c.t;
    s.optical_length = float(c.optical_length);
    paths_add(s);
}

#endif
