// The film of a run: what `src/render/cpu/renderer.rs` and `layers.rs` do with contributions and rays. Defines the seams
// `sink`, `trace_closest` and `trace_occluded`; a traversal must have defined `seam_closest` and `seam_occluded`.
#ifndef FILM_FILM_GLSL
#define FILM_FILM_GLSL

#include "film/sums.glsl"
#include "film/splat.glsl"
#include "transport/contribution.glsl"
#include "transport/ray.glsl"
#include "transport/surface.glsl"

layout(set = 0, binding = 20, scalar) buffer PixelSums { Sums pixel_sums[]; };
layout(set = 0, binding = 21, scalar) buffer PixelInvalid { Invalid pixel_invalid[]; };
layout(set = 0, binding = 22, scalar) buffer CountersBlock { Counters counters; };
layout(push_constant, scalar) uniform WaveBlock { Wave wave; };

// The sample in progress: its pixel, what it has brought there, and what was refused.
uvec2 film_pixel;
vec3 film_value;
uint film_invalid;
// Rays so far, of this sample.
uint film_rays;

#include "film/layers.glsl"
#include "film/time.glsl"
#include "film/paths.glsl"

bool trace_closest(Ray ray, float t_max, out Hit hit) {
    bool found = seam_closest(ray, t_max, hit);
    layers_trace(film_rays == 0u, ray, found, hit);
    film_rays++;
    paths_closest(ray, t_max, found, hit);
    return found;
}

bool trace_occluded(Ray ray, float t_max) {
    film_rays++;
    bool blocked = seam_occluded(ray, t_max);
    paths_shadow(ray, t_max, blocked);
    return blocked;
}

void sink(Contribution c) {
    paths_light(c);
    if (c.t != 1u && c.pixel == film_pixel) {
        film_value += c.value;
        time_own(film_pixel.y * job.resolution.x + film_pixel.x, c);
        film_invalid += layers_own(c);
    } else if (c.value != vec3(0.0)) {
        bool inside = all(lessThan(c.pixel, job.resolution));
        uint at = c.pixel.y * job.resolution.x + c.pixel.x;
        if (!inside || !time_splat(at, c)) {
            film_invalid++;
        } else {
            film_invalid += layers_splat(at, c);
        }
    }
}

// Starts a sample.
void film_begin() {
    film_value = vec3(0.0);
    film_invalid = 0u;
    film_rays = 0u;
    time_begin();
    paths_begin();
}

// Ends a sample and adds it to the sums of its pixel.
void film_end(inout Sums sums, inout Invalid invalid, uint at, uvec2 index) {
    bool counts = finite(film_value);
    if (counts) {
        add_sample(sums, film_value);
    } else {
        film_invalid++;
    }
    film_invalid += time_close(at, counts) + layers_close(at, counts);
    if (film_invalid > 0u) {
        if (invalid.count == 0u) {
            invalid.first = index;
        }
        invalid.count += film_invalid;
    }
}

#endif
