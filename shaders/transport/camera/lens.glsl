// Twin of crates/lumbre-light/src/transport/camera/lens.rs; the camera's fields are those of `job`.
#ifndef TRANSPORT_CAMERA_LENS_GLSL
#define TRANSPORT_CAMERA_LENS_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "scene.glsl"
#include "math/warp.glsl"
#include "transport/camera/filter.glsl"
#include "transport/camera/orthographic.glsl"
#include "transport/camera/spherical.glsl"
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
    film = film * job.camera_half + job.camera_center;
    if (camera_is_parallel()) {
        return camera_parallel_ray(film);
    }
    if (job.camera_kind == CAMERA_SPHERICAL) {
        return Ray(job.camera_position, camera_direction_at(film));
    }
    vec3 through = job.camera_forward + job.camera_right * film.x - job.camera_up * film.y;
    if (job.lens_radius <= 0.0) {
        return Ray(job.camera_position, normalize_or(through, job.camera_forward));
    }
    vec2 lens = concentric_disk(next_2d(numbers)) * job.lens_radius;
    vec3 origin = camera_plane_point(lens);
    vec3 focus = job.camera_position + through * job.focus_distance;
    return Ray(origin, normalize_or(focus - origin, job.camera_forward));
}

vec2 camera_lens_offset(vec2 lens_u) {
    return job.lens_radius > 0.0 ? concentric_disk(lens_u) * job.lens_radius : vec2(0.0);
}

// Returns the density per solid angle of a camera ray in the unit direction `dir` over all pixels;
// of parallel rays, per area perpendicular to them.
float camera_pdf_w(vec3 dir) {
    float area = 4.0 * job.camera_half.x * job.camera_half.y;
    float cos_axis = dot(dir, job.camera_forward);
    if (filter_reach(camera_filter()) <= 0.0) {
        return 0.0;
    }
    if (job.camera_kind == CAMERA_SPHERICAL) {
        return camera_off_poles(dir) ? 1.0 / (area * camera_sin_theta(dir)) : 0.0;
    }
    if (cos_axis <= 0.0) {
        return 0.0;
    }
    return 1.0 / (camera_is_parallel() ? area : area * cos_axis * cos_axis * cos_axis);
}

// Returns the film position in pixels of coordinates from the axis: `Camera::raster`.
vec2 camera_raster(vec2 film) {
    return 0.5 * ((film - job.camera_center) / job.camera_half + 1.0) * vec2(job.resolution);
}

// Projects light that arrives along `-dir` through a point of the lens onto the film, in pixels;
// false if it is not ahead of the camera.
bool camera_project_direction(vec2 disk, vec3 dir, out vec2 raster) {
    float depth = dot(dir, job.camera_forward);
    vec2 xy = vec2(dot(dir, job.camera_right), dot(dir, job.camera_up)) / depth;
    vec2 shift = job.lens_radius > 0.0 ? disk / job.focus_distance : vec2(0.0);
    vec2 film = xy + shift;
    film.y = -film.y;
    bool ahead = depth > 0.0 && is_finite(dir) && !camera_is_parallel();
    if (job.camera_kind == CAMERA_SPHERICAL) {
        film = camera_angles_of(dir);
        ahead = camera_off_poles(dir);
    }
    raster = camera_raster(film);
    return ahead;
}

// Chooses the pixel at a film position, and multiplies the importance by the weight of the choice.
bool camera_choose_pixel(vec2 raster, vec2 filter_u, inout CameraConnection c) {
    bool found = true;
    bool sphere = job.camera_kind == CAMERA_SPHERICAL;
    [[dont_unroll]] for (uint i = 0u; i < 2u && found; ++i) {
        uint chosen;
        float weight;
        uint edge = sphere ? (i == 0u ? FILM_EDGE_WRAPS : FILM_EDGE_REFLECTS) : FILM_EDGE_OPEN;
        found = filter_choose_pixel(
            camera_filter(), raster[i], job.resolution[i], edge, filter_u[i], chosen, weight
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
    vec3 to = point - camera_plane_point(disk);
    float distance = far ? INFINITY : length(to);
    vec3 dir = far ? point : to / distance;
    bool parallel = camera_is_parallel() && !far;
    vec2 raster;
    bool ahead = camera_project_direction(disk, dir, raster);
    c = CameraConnection(uvec2(0u), camera_plane_point(disk), dir, distance, 0.0, 0.0);
    if (parallel) {
        vec3 at = camera_project_parallel(point);
        ahead = at.z > 0.0 && is_finite(at);
        raster = camera_raster(vec2(at.x, -at.y));
        c.lens = camera_plane_point(at.xy);
        c.dir = job.camera_forward;
        c.distance = at.z;
    }
    c.pdf_w = camera_pdf_w(c.dir);
    if (parallel) {
        c.pdf_w *= c.distance * c.distance;
    }
    c.importance = far ? c.pdf_w : c.pdf_w / (c.distance * c.distance);
    return ahead && camera_choose_pixel(raster, filter_u, c);
}

#endif
