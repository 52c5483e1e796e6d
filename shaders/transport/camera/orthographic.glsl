// Twin of crates/lumbre-light/src/transport/camera/orthographic.rs, which derives the densities.
#ifndef TRANSPORT_CAMERA_ORTHOGRAPHIC_GLSL
#define TRANSPORT_CAMERA_ORTHOGRAPHIC_GLSL

#include "scene.glsl"
#include "transport/ray.glsl"

// Returns whether all rays have the same direction.
bool camera_is_parallel() {
    return job.camera_kind == CAMERA_ORTHOGRAPHIC;
}

// Returns the point of the film, or of a lens, at coordinates in scene units, to the right and
// upwards: `Camera::plane_point`.
vec3 camera_plane_point(vec2 at) {
    return job.camera_position + job.camera_right * at.x + job.camera_up * at.y;
}

// Returns a ray through a film position in scene units from the centre, to the right and downwards.
Ray camera_parallel_ray(vec2 at) {
    return Ray(camera_plane_point(vec2(at.x, -at.y)), job.camera_forward);
}

// Projects a scene point along the viewing direction: film coordinates in scene units, to the right
// and upwards, and the distance, which is negative behind the film.
vec3 camera_project_parallel(vec3 point) {
    vec3 to = point - job.camera_position;
    return vec3(
        dot(to, job.camera_right), dot(to, job.camera_up), dot(to, job.camera_forward)
    );
}

#endif
