// The film of a run: accumulates contributions and rays as `crates/lumbre-render/src/cpu/renderer.rs` and
// `layers.rs` do. Defines `sink`, `trace_closest` and `trace_occluded`; a traversal must have
// defined `traversal_closest` and `traversal_occluded`.
#ifndef FILM_FILM_GLSL
#define FILM_FILM_GLSL

#include "film/sums.glsl"
#include "film/splat.glsl"
#include "transport/contribution.glsl"
#include "transport/ray.glsl"
#include "transport/surface.glsl"

layout(set = 0, binding = 20, scalar) buffer PixelSums { SampleSums pixel_sums[]; };
layout(set = 0, binding = 21, scalar) buffer PixelInvalid { Invalid pixel_invalid[]; };
layout(set = 0, binding = 22, scalar) buffer CountersBlock { Counters counters; };
layout(push_constant, scalar) uniform WaveBlock { WaveParams wave; };

// The current sample: its pixel, its accumulated value, and the number of refused contributions.
uvec2 film_pixel;
vec3 film_value;
uint film_invalid;
// Number of rays of the current sample so far.
uint film_rays;

#include "film/layers.glsl"
#include "film/time.glsl"
#include "film/paths.glsl"

bool trace_closest(Ray ray, float t_max, out Hit hit) {
    bool found = traversal_closest(ray, t_max, hit);
    layers_trace(film_rays == 0u, ray, found, hit);
    film_rays++;
    paths_closest(ray, t_max, found, hit);
    return found;
}

bool trace_occluded(Ray ray, float t_max) {
    film_rays++;
    bool blocked = traversal_occluded(ray, t_max);
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
void film_end(inout SampleSums sums, inout Invalid invalid, uint at, uvec2 index) {
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
