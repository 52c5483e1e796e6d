// Twin of crates/lumbre-light/src/transport/integrator/bdpt/connect.rs, with its strategies merged: first the
// connecting edge, then the BSDFs at its ends, then the contribution and the MIS terms of the other
// strategies.
#ifndef TRANSPORT_INTEGRATOR_BDPT_CONNECT_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_CONNECT_GLSL

#include "transport/integrator/bdpt/subpath.glsl"

// Light found by one strategy, before the shadow test; fields as in Rust, and the pixel that
// receives it.
struct Connection {
    uvec2 pixel;
    vec3 unweighted;
    // Root of the MIS terms of the other strategies, as in weights.glsl.
    float others;
    // Whether light arrives only if `ray` hits nothing up to `distance`.
    bool shadowed;
    Ray ray;
    float distance;
    Length optical_length;
};

// The connecting edge of a strategy.
struct Aim {
    // Unit direction from the camera's side towards the light.
    vec3 wi;
    float distance2;
    // For strategies with at most one light vertex: the point of the light, the unit direction from
    // there to the next vertex, that vertex, and its normal.
    LightPoint point;
    vec3 dir;
    vec3 next;
    vec3 n_next;
    // Light that arrives, without the BSDFs: multiplied by the values and throughputs of the
    // vertices.
    vec3 radiance;
    // For strategies with one camera vertex: the connection to the camera.
    CameraConnection camera;
};

// Strategy `s = 0`: the camera subpath has left the scene.
bool aim_at_escape(Departure escape, out Aim aim) {
    vec3 dir = escape.edge.dir;
    aim.point = LightPoint(job.light_first.z, escape.edge.from + dir, -dir, 0.0, Uv(0.0));
    aim.dir = -dir;
    aim.next = escape.edge.from;
    aim.n_next = escape.edge.normal;
    aim.radiance = lights_environment(dir);
    return aim.radiance != vec3(0.0);
}

// Strategy `s = 1`, `t >= 2`: a light point sampled from the end of the camera subpath.
bool aim_at_light(Vertex z, inout Sampler numbers, out Aim aim, out DirectSample d) {
    float choice = next_1d(numbers);
    bool found = lights_sample_direct(z.position, choice, next_2d(numbers), d);
    aim.wi = d.wi;
    aim.point = d.point;
    aim.dir = -d.wi;
    aim.next = z.position;
    aim.n_next = z.n_geometric;
    aim.radiance = d.radiance / d.pdf_w;
    return found && !terminator_offset_excludes(z.terminator, d) && !(d.pdf_w <= 0.0);
}

// Strategy `s >= 2`, `t >= 2`: the ends of two subpaths.
bool aim_at_end(Vertex y, Vertex z, out Aim aim) {
    vec3 edge = y.position - z.position;
    aim.distance2 = length_squared(edge);
    aim.wi = edge / sqrt(aim.distance2);
    return is_finite(aim.wi);
}

// Strategy `t = 1`: the start of the light subpath (`s = 1`) or its end `y`, connected to the
// camera. Point lights and directional lights are not connected.
bool aim_at_lens(uint s, EmissionSample start, Vertex y, inout Sampler numbers, out Aim aim) {
    vec2 lens_u = next_2d(numbers);
    vec2 filter_u = next_2d(numbers);
    uint kind = s == 1u ? light_kind(start.point.light) : LIGHT_EMITTER;
    bool far = kind == LIGHT_ENVIRONMENT;
    vec3 at = far ? -start.dir : (s == 1u ? start.point.position : y.position);
    bool met = camera_connect(far, at, lens_u, filter_u, aim.camera);
    aim.wi = aim.camera.dir;
    aim.point = start.point;
    aim.dir = -aim.wi;
    aim.next = aim.camera.lens;
    aim.n_next = vec3(0.0);
    return met && (kind == LIGHT_EMITTER || far);
}

// Returns the optical length of the path of a strategy, as `connect.rs` computes it for each.
Length connection_length(
    uint s, uint t, bool escaped, Subpaths paths, Vertex y, Vertex z, Aim aim, float direct_distance
) {
    if (!TIMES) {
        return Length(0.0);
    }
    if (s == 0u) {
        return escaped ? paths.escape_length : optical_length_arrival(z.optical);
    }
    if (t == 1u) {
        float far = aim.camera.distance;
        if (!is_finite(far)) {
            far = lights_front_distance(aim.camera.lens, aim.camera.dir);
        }
        Length length = Length(paths.emitted)
            + Length(job.time_camera != 0u ? job.time_medium * far : 0.0);
        if (s == 1u) {
            return length;
        }
        float ratio = bsdf_index_ratio(y.bsdf, y.wo, -aim.wi);
        return length + optical_length_from_light(y.optical, ratio, job.time_medium);
    }
    if (s == 1u) {
        return path_time_direct_length(
            z.optical, z.bsdf, z.wo, z.position, aim.wi, direct_distance
        );
    }
    float ratio = bsdf_index_ratio(z.bsdf, z.wo, aim.wi);
    Length near = optical_length_after_segment(z.optical, ratio, sqrt(aim.distance2));
    float far_ratio = bsdf_index_ratio(y.bsdf, y.wo, -aim.wi);
    return near + optical_length_from_light(y.optical, far_ratio, z.optical.index * ratio);
}

// Computes the connection of the strategy of `s` and `t` vertices; `y` and `z` are the ends of the
// subpaths, if there are any. `escaped` is whether the camera subpath reached light outside the
// scene.
bool connect(
    uint h, uint s, uint t, uvec2 pixel, bool escaped, Subpaths paths, Vertex y, Vertex z,
    inout Sampler numbers, out Connection c
) {
    Aim aim;
    DirectSample direct;
    direct.distance = 0.0;
    bool aimed;
    if (s == 0u) {
        aimed = escaped ? aim_at_escape(paths.escape, aim) : z.emitted != vec3(0.0);
    } else if (t == 1u) {
        aimed = aim_at_lens(s, paths.start, y, numbers, aim);
    } else if (s == 1u) {
        aimed = aim_at_light(z, numbers, aim, direct);
    } else {
        aimed = aim_at_end(y, z, aim);
    }
    if (!aimed) {
        return false;
    }
    LightEnd end;
    if (s == 1u || escaped) {
        end = light_end_new(aim.point, aim.dir, aim.next, aim.n_next);
    }
    BsdfValue at_y, at_z;
    float before_y = 0.0, before_z = 0.0;
    if (s >= 1u && t >= 2u) {
        at_z = bsdf_evaluate(z.bsdf, z.wo, aim.wi, RADIANCE);
        before_z = vertex_density_before(z, at_z.reverse_pdf_w);
        if (at_z.f == vec3(0.0)) {
            return false;
        }
    }
    if (s >= 2u) {
        at_y = bsdf_evaluate(y.bsdf, y.wo, -aim.wi, IMPORTANCE);
        before_y = vertex_density_before(y, at_y.reverse_pdf_w);
    }
    c.pixel = pixel;
    c.shadowed = true;
    c.optical_length = connection_length(s, t, escaped, paths, y, z, aim, direct.distance);
    if (s == 0u) {
        c.shadowed = false;
        if (!escaped) {
            c.unweighted = z.throughput * z.emitted;
            c.others = z.hit_others;
            return true;
        }
        MisPartials partials;
        if (!edge_distant_partials(paths.escape.edge, h, partials)) {
            return false;
        }
        c.unweighted = paths.escape.throughput * aim.radiance;
        c.others = others_s0(h, partials, end, t);
        return true;
    }
    if (t == 1u) {
        c.pixel = aim.camera.pixel;
        if (s == 1u) {
            bool far = !is_finite(aim.camera.distance);
            float cos_light = far ? 1.0 : dot(aim.point.normal, aim.dir);
            // The light emits towards the lens what it emitted along the path: from a surface the
            // same in all directions of its front, from the environment in the same direction.
            c.unweighted = paths.start.radiance * cos_light
                * (aim.camera.importance / end.start);
            c.others = others_s1_t1(h, end, aim.camera.pdf_w);
            if (cos_light <= 0.0) {
                return false;
            }
            if (far) {
                c.ray = spawn_ray(edge_end_free(aim.camera.lens), aim.wi);
                c.distance = INFINITY;
            } else {
                c.shadowed = connection_ray(
                    edge_end_of(aim.point), edge_end_free(aim.camera.lens), c.ray, c.distance
                );
            }
        } else {
            c.unweighted = y.throughput * at_y.f * vertex_cos(y, -aim.wi) * aim.camera.importance;
            float here = aim.camera.pdf_w
                * area_factor(aim.camera.lens, y.position, y.n_geometric);
            c.others = mis_partials_others(y.partials, h, here, before_y);
            c.shadowed = connection_ray(
                vertex_end(y), edge_end_free(aim.camera.lens), c.ray, c.distance
            );
        }
    } else if (s == 1u) {
        c.unweighted = z.throughput * at_z.f * vertex_cos(z, aim.wi) * aim.radiance;
        // Rounding may place a point at the rim of a sphere on its hidden side, where no strategy
        // has a density.
        if (!(end.direct > 0.0)) {
            return false;
        }
        c.others = others_s1(h, z.partials, before_z, end, at_z);
        c.shadowed = shadow_ray(vertex_end(z), direct, c.ray, c.distance);
    } else {
        c.unweighted = y.throughput * at_y.f * vertex_cos(y, -aim.wi) * at_z.f
            * vertex_cos(z, aim.wi) * z.throughput / aim.distance2;
        float density_y = at_z.pdf_w * (abs(dot(aim.wi, y.n_geometric)) / aim.distance2);
        float density_z = at_y.pdf_w * (abs(dot(aim.wi, z.n_geometric)) / aim.distance2);
        c.others = heuristic_add(
            h, mis_partials_others(y.partials, h, density_y, before_y),
            mis_partials_others(z.partials, h, density_z, before_z)
        );
        c.shadowed = connection_ray(vertex_end(z), vertex_end(y), c.ray, c.distance);
    }
    return c.unweighted != vec3(0.0);
}

#endif
