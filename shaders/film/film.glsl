// The film of a run: accumulates contributions and rays as `crates/lumbre-render/src/cpu/renderer.rs` and
// `layers.rs` do. Defines `sink`, `trace_closest` and `trace_occluded`; a traversal must have
// defined `traversal_closest` and `traversal_occluded`.
#ifndef FILM_FILM_GLSL
#define FILM_FILM_GLSL

#include "film/pixel.glsl"
#include "film/splat.glsl"
#include "transport/contribution.glsl"
#include "transport/ray.glsl"
#include "transport/surface.glsl"

// The current sample: its pixel, its accumulated value, and the number of refused contributions.
uvec2 film_pixel;
// Its number among those that may be rendered at once.
uint film_sample;
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
        time_own(pixel_index(film_pixel), c);
        film_invalid += layers_own(c);
    } else if (c.value != vec3(0.0)) {
        bool inside = all(lessThan(c.pixel, job.resolution));
        uint at = pixel_index(c.pixel);
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

// Ends a sample; returns what its pixel gets from it.
SampleValue film_end(uint pixel) {
    bool counts = finite(film_value);
    uint refused = film_invalid + time_close(pixel, counts) + layers_close(pixel, counts);
    return SampleValue(film_value, refused, film_rays);
}

#endif
