// Twin of crates/lumbre-light/src/transport/camera/lens.rs; the camera's fields are those of `job`.
#ifndef TRANSPORT_CAMERA_LENS_GLSL
#define TRANSPORT_CAMERA_LENS_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "scene.glsl"
#include "math/warp.glsl"
#include "transport/camera/filter.glsl"
#include "transport/ray.glsl"
#include "transport/sampler/mod.glsl"

// A point of the scene connected to a point of the lens; fields as in Rust.
struct CameraConnection {
    uvec2 pixel;
    vec3 lens;
    vec3 dir;
    float distance;
    float importance;
    float pdf_w;
};

FilterSpec camera_filter() {
    return FilterSpec(job.filter_kind, job.filter_radius);
}

// Samples a ray through a pixel; its weight is one. Uses two dimensions for the filter and, with a
// lens, two more.
Ray camera_sample_ray(uvec2 pixel, inout Sampler numbers) {
    vec2 offset = filter_sample(camera_filter(), next_2d(numbers));
    vec2 film = 2.0 * (vec2(pixel) + 0.5 + offset) / vec2(job.resolution) - 1.0;
    vec3 through = job.camera_forward + job.camera_right * (film.x * job.camera_half.x)
        - job.camera_up * (film.y * job.camera_half.y);
    if (job.lens_radius <= 0.0) {
        return Ray(job.camera_position, normalize_or(through, job.camera_forward));
    }
    vec2 lens = concentric_disk(next_2d(numbers)) * job.lens_radius;
    vec3 origin = job.camera_position + job.camera_right * lens.x + job.camera_up * lens.y;
    vec3 focus = job.camera_position + through * job.focus_distance;
    return Ray(origin, normalize_or(focus - origin, job.camera_forward));
}

vec2 camera_lens_offset(vec2 lens_u) {
    return job.lens_radius > 0.0 ? concentric_disk(lens_u) * job.lens_radius : vec2(0.0);
}

vec3 camera_lens_point(vec2 disk) {
    return job.camera_position + job.camera_right * disk.x + job.camera_up * disk.y;
}

// Returns the density per solid angle of a camera ray in the unit direction `dir` over all pixels.
float camera_pdf_w(vec3 dir) {
    float cos_axis = dot(dir, job.camera_forward);
    if (cos_axis <= 0.0 || filter_reach(camera_filter()) <= 0.0) {
        return 0.0;
    }
    return 1.0 / (4.0 * job.camera_half.x * job.camera_half.y * cos_axis * cos_axis * cos_axis);
}

// Projects light that arrives along `-dir` through a point of the lens onto the film, and chooses
// the pixel.
bool camera_project_direction(vec2 disk, vec3 dir, vec2 filter_u, out CameraConnection c) {
    float depth = dot(dir, job.camera_forward);
    vec2 xy = vec2(dot(dir, job.camera_right), dot(dir, job.camera_up)) / depth;
    vec2 shift = job.lens_radius > 0.0 ? disk / job.focus_distance : vec2(0.0);
    vec2 film = (xy + shift) / job.camera_half;
    vec2 raster = 0.5 * (vec2(film.x, -film.y) + 1.0) * vec2(job.resolution);
    c = CameraConnection(
        uvec2(0u), camera_lens_point(disk), dir, INFINITY, camera_pdf_w(dir), camera_pdf_w(dir)
    );
    if (!(depth > 0.0 && is_finite(dir))) {
        return false;
    }
    bool found = true;
    [[dont_unroll]] for (uint i = 0u; i < 2u && found; ++i) {
        uint chosen;
        float weight;
        found = filter_choose_pixel(
            camera_filter(), raster[i], job.resolution[i], filter_u[i], chosen, weight
        );
        c.pixel[i] = chosen;
        c.importance *= weight;
    }
    return found;
}

// Connects a scene point to the camera, or, if `far`, a unit direction from the lens out of the
// scene: `Camera::connect` and `Camera::connect_direction`. Visibility is not tested.
bool camera_connect(bool far, vec3 point, vec2 lens_u, vec2 filter_u, out CameraConnection c) {
    vec2 disk = camera_lens_offset(lens_u);
    vec3 to = point - camera_lens_point(disk);
    float distance = far ? INFINITY : length(to);
    bool met = camera_project_direction(disk, far ? point : to / distance, filter_u, c);
    if (!far) {
        c.distance = distance;
        c.importance /= distance * distance;
    }
    return met;
}

#endif
