// Twin of crates/lumbre-light/src/transport/light/point.rs.
#ifndef TRANSPORT_LIGHT_POINT_GLSL
#define TRANSPORT_LIGHT_POINT_GLSL

#include "math/frame.glsl"
#include "math/warp.glsl"
#include "transport/light/environment.glsl"
#include "transport/light/types.glsl"

LightPoint point_at(uint i, vec3 normal) {
    return LightPoint(
        job.light_first.x + i, points[i].position, normal, job.least_extent, Uv(0.0)
    );
}

// Returns one minus the cosine of a unit direction with the axis of point light `i`.
float point_height(uint i, vec3 dir) {
    vec3 away = dir - points[i].axis;
    return 0.5 * dot(away, away);
}

// Returns the fraction of the intensity of point light `i` in a unit direction, from 0 to 1.
float point_falloff(uint i, vec3 dir) {
    if (points[i].cutoff_height >= 2.0) {
        return 1.0;
    }
    float height = point_height(i, dir);
    if (height <= points[i].beam_height) {
        return 1.0;
    }
    if (height >= points[i].cutoff_height) {
        return 0.0;
    }
    if (points[i].is_smooth != 0u) {
        float t = (points[i].cutoff_height - height)
            / (points[i].cutoff_height - points[i].beam_height);
        return t * t;
    }
    float angle = 2.0 * atan2(length(dir - points[i].axis), length(dir + points[i].axis));
    return clamp((points[i].cutoff - angle) / (points[i].cutoff - points[i].beam), 0.0, 1.0);
}

// Returns the intensity of point light `i` in a unit direction.
vec3 point_intensity(uint i, vec3 dir) {
    vec3 intensity = points[i].intensity * point_falloff(i, dir);
    if (points[i].map == NONE) {
        return intensity;
    }
    if (points[i].right == vec3(0.0)) {
        vec2 uv = directions_coordinates(points[i].turn, dir);
        return intensity * map_bilinear(textures[points[i].map], false, true, uv);
    }
    float cos_axis = dot(dir, points[i].axis);
    vec2 at = vec2(dot(dir, points[i].right), dot(dir, points[i].up)) / cos_axis;
    if (!(cos_axis > 0.0 && abs(at.x) <= 1.0 && abs(at.y) <= 1.0)) {
        return vec3(0.0);
    }
    vec2 uv = 0.5 + vec2(0.5, -0.5) * at;
    vec3 color = map_bilinear(textures[points[i].map], false, false, uv);
    return intensity
        * (points[i].is_even != 0u ? color / (cos_axis * cos_axis * cos_axis) : color);
}

// Returns the density per solid angle of a direction of emission of point light `i`: uniform over
// the whole cone.
float point_pdf_w(uint i, vec3 dir) {
    if (points[i].cutoff_height >= 2.0) {
        return 1.0 / (4.0 * PI);
    }
    return point_height(i, dir) <= points[i].cutoff_height
        ? 1.0 / (TAU * points[i].cutoff_height)
        : 0.0;
}

// Returns light that arrives at `from` from point light `i`; false at the light itself and where it
// does not emit.
bool point_sample_direct(uint i, vec3 from, out DirectSample s) {
    vec3 to = points[i].position - from;
    float distance = length(to);
    vec3 wi = to / distance;
    vec3 intensity = point_intensity(i, -wi);
    vec3 radiance = intensity / (distance * distance);
    s = DirectSample(wi, distance, radiance, 1.0, true, point_at(i, -wi));
    return distance > 0.0 && intensity != vec3(0.0) && is_finite(radiance);
}

// Samples a direction uniform over the cone.
EmissionSample point_sample_emission(uint i, vec2 v) {
    vec3 dir;
    if (points[i].cutoff_height >= 2.0) {
        dir = uniform_sphere(v);
    } else {
        float height = v.x * points[i].cutoff_height;
        float r = sqrt(max(height * (2.0 - height), 0.0));
        dir = frame_to_world(
            frame_from_normal(points[i].axis), vec3(r * sin_cos(TAU * v.y).yx, 1.0 - height)
        );
    }
    vec3 radiance = point_intensity(i, dir);
    return EmissionSample(point_at(i, dir), dir, radiance, 1.0, point_pdf_w(i, dir), 1.0);
}

#endif
