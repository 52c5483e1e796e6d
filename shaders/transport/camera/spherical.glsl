// Twin of crates/lumbre-light/src/transport/camera/spherical.rs.
#ifndef TRANSPORT_CAMERA_SPHERICAL_GLSL
#define TRANSPORT_CAMERA_SPHERICAL_GLSL

#include "scene.glsl"
#include "math/trig.glsl"

// Returns the unit direction at angles in radians: the longitude, and the latitude counted
// downwards, which may lie beyond the poles and is then reflected.
vec3 camera_direction_at(vec2 angles) {
    vec2 x = sin_cos(angles.x), y = sin_cos(angles.y);
    vec3 level = job.camera_right * x.x + job.camera_forward * x.y;
    return normalize_or(level * abs(y.y) - job.camera_up * y.x, job.camera_forward);
}

// Returns the sine of the angle between a unit direction and the camera's up direction.
float camera_sin_theta(vec3 dir) {
    return length(vec2(dot(dir, job.camera_right), dot(dir, job.camera_forward)));
}

// Returns the angles of a unit direction, as `camera_direction_at` takes them.
vec2 camera_angles_of(vec3 dir) {
    float longitude = atan2(dot(dir, job.camera_right), dot(dir, job.camera_forward));
    float down = atan2(-dot(dir, job.camera_up), camera_sin_theta(dir));
    // The right edge is the left one.
    return vec2(longitude < PI ? longitude : -PI, down);
}

// Returns whether a direction is no pole, at which the density has no value.
bool camera_off_poles(vec3 dir) {
    return camera_sin_theta(dir) > 0.0 && is_finite(dir);
}

#endif
