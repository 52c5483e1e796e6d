// Layers of the film: twin of the tally in crates/lumbre-render/src/cpu/films/layers.rs. Without LAYERS
// nothing is recorded.
#ifndef FILM_LAYERS_GLSL
#define FILM_LAYERS_GLSL

// Sums of the samples, [pixel][film].
layout(set = 0, binding = 24, scalar) buffer LayerSums { SampleSums layer_sums[]; };
// Value of the current sample for each film of its own pixel, [pixel][film]; black between samples.
layout(set = 0, binding = 25, scalar) buffer LayerValues { vec3 layer_values[]; };

// The hit of the sample's camera ray.
bool first_found;
Ray first_ray;
Hit first_hit;

uint layers_row() {
    return pixel_index(film_pixel) * job.film_count;
}

// Adds a value to a film of the sample's own pixel, or of any pixel. Returns the number of films
// that refused it.
uint layers_add(bool own, uint pixel, uint film, vec3 value) {
    if (value == vec3(0.0)) {
        return 0u;
    }
    if (own) {
        layer_values[layers_row() + film] += value;
        return 0u;
    }
    uint slot = splat_slots[film];
    uint at = splat_slots_of_picture() + pixel * job.splat_films + slot;
    return slot != NONE && splat_add(at, value) ? 0u : 1u;
}

// Distributes a contribution among the films. Returns the number of refusals: one if its path
// exceeds the maximum depth.
uint layers_distribute(bool own, uint pixel, Contribution c) {
    uint k = contribution_depth(c);
    if (k < 1u || k > job.max_depth) {
        return 1u;
    }
    bool strategies = job.layer_strategies != NONE;
    uint strategy = job.layer_strategies + (k - 1u) * (k + 2u) + 2u * c.s;
    float luminance = dot(c.value, vec3(0.2126, 0.7152, 0.0722));
    uint refused = 0u;
    // A loop with one call, since compilers inline every call together with its atomic operations.
    [[dont_unroll]] for (uint i = 0u; i < 4u; i++) {
        uint film = i == 0u ? (job.layer_depth != NONE ? job.layer_depth + k - 1u : NONE)
            : i == 3u ? job.layer_bounces : (strategies ? strategy + i - 1u : NONE);
        vec3 value = i == 2u ? c.unweighted
            : i == 3u ? vec3(float(k - 1u) * luminance, luminance, 0.0) : c.value;
        if (film != NONE) {
            refused += layers_add(own, pixel, film, value);
        }
    }
    return refused;
}

uint layers_own(Contribution c) {
    if (!LAYERS) {
        return 0u;
    }
    return layers_distribute(true, 0u, c);
}

uint layers_splat(uint pixel, Contribution c) {
    if (!LAYERS) {
        return 0u;
    }
    return layers_distribute(false, pixel, c);
}

// Records every nearest hit; the first one of a sample is that of its camera ray.
void layers_trace(bool is_first, Ray ray, bool found, Hit hit) {
    if (LAYERS && is_first) {
        first_found = found;
        first_ray = ray;
        first_hit = hit;
    }
}

void layers_set(uint film, vec3 value) {
    if (film != NONE) {
        layer_values[layers_row() + film] = value;
    }
}

// Ends a sample; `counts` is whether the picture accepted it. Returns the number of films that
// refused their value.
uint layers_close(uint pixel, bool counts) {
    if (!LAYERS) {
        return 0u;
    }
    uint row = layers_row();
    if (!counts) {
        for (uint film = 0u; film < job.light_films; film++) {
            layer_values[row + film] = vec3(0.0);
        }
    }
    layers_set(job.layer_rays, vec3(float(film_rays)));
    bool surfaces = (job.layer_albedo & job.layer_normal & job.layer_distance) != NONE;
    if (surfaces && film_rays > 0u && first_found) {
        Surface surface = surface_at(first_ray, first_hit);
        layers_set(job.layer_albedo, surface_base_color(surface));
        bool behind = dot(surface.n_geometric, first_ray.dir) > 0.0;
        layers_set(job.layer_normal, behind ? -surface.n_shading : surface.n_shading);
        layers_set(
            job.layer_distance, vec3(distance(first_ray.origin, surface.position), 1.0, 0.0)
        );
    }
    uint refused = 0u;
    for (uint film = 0u; film < job.film_count; film++) {
        vec3 value = layer_values[row + film];
        layer_values[row + film] = vec3(0.0);
        if (!finite(value)) {
            refused++;
        } else if (value != vec3(0.0)) {
            SampleSums sums = layer_sums[row + film];
            add_sample(sums, value);
            layer_sums[row + film] = sums;
        }
    }
    return refused;
}

#endif
