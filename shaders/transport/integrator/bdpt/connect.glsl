// Twin of src/transport/integrator/bdpt/connect.rs, its strategies side by side: first where the edge goes that joins the
// subpaths, then the BSDFs at its ends, then what light it carries and what the other strategies weigh.
#ifndef TRANSPORT_INTEGRATOR_BDPT_CONNECT_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_CONNECT_GLSL

#include "transport/integrator/bdpt/subpath.glsl"

// Light found by one strategy unless something lies in the way; fields as in Rust, and the pixel that it counts for.
struct Connection {
    uvec2 pixel;
    vec3 unweighted;
    double others;
    // Whether `ray` must meet nothing up to `distance`.
    bool shadowed;
    Ray ray;
    float distance;
    Length optical_length;
};

// Where the edge of a strategy goes that joins the subpaths.
struct Aim {
    // From the camera's side towards the light.
    vec3 wi;
    float distance2;
    // Of strategies with at most one light vertex: the point of the light, the unit direction from there to the next
    // vertex, that vertex, and its normal.
    LightPoint point;
    vec3 dir;
    vec3 next;
    vec3 n_next;
    // Light that arrives without the BSDFs: what is multiplied by the values and throughputs of the vertices.
    vec3 radiance;
    // Of strategies with one camera vertex.
    CameraConnection camera;
};

// `s = 0`: the camera subpath `z` has met a light, or has left the scene.
bool aim_at_hit(bool escaped, Departure escape, Vertex z, out Aim aim) {
    if (escaped) {
        vec3 dir = escape.edge.dir;
        aim.point = LightPoint(job.light_first.z, escape.edge.from + dir, -dir, Uv(0.0));
        aim.dir = -dir;
        aim.next = escape.edge.from;
        aim.n_next = escape.edge.normal;
        aim.radiance = lights_environment(dir);
    } else {
        aim.point = LightPoint(z.emitter, z.position, z.n_geometric, z.uv);
        aim.dir = z.wo;
        aim.next = z.previous;
        aim.n_next = z.n_previous;
        aim.radiance = z.emitter == NONE ? vec3(0.0) : z.emitted;
    }
    return aim.radiance != vec3(0.0);
}

// `s = 1`, `t >= 2`: a point of a light, sampled from the end of the camera subpath.
bool aim_at_light(Vertex z, inout Sampler numbers, out Aim aim, out DirectSample d) {
    float choice = next_1d(numbers);
    bool found = lights_sample_direct(z.position, choice, next_2d(numbers), d);
    aim.wi = d.wi;
    aim.point = d.point;
    aim.dir = -d.wi;
    aim.next = z.position;
    aim.n_next = z.n_geometric;
    aim.radiance = d.radiance / d.pdf_w;
    return found && !overhang_refuses(z.overhang, d) && !(d.pdf_w <= 0.0);
}

// `s >= 2`, `t >= 2`: the ends of two subpaths.
bool aim_at_end(Vertex y, Vertex z, out Aim aim) {
    vec3 edge = y.position - z.position;
    aim.distance2 = length_squared(edge);
    aim.wi = edge / sqrt(aim.distance2);
    return is_finite(aim.wi);
}

// `t = 1`: the start of the light subpath (`s = 1`) or its end `y`, seen by the camera. Points and parallel light are not
// seen.
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

// When light arrives along the path of a strategy, as `connect.rs` says it for each.
Length connection_length(
    uint s, uint t, bool escaped, Subpaths paths, Vertex y, Vertex z, Aim aim, float direct_distance
) {
#ifdef TIMES
    if (s == 0u) {
        return escaped ? paths.escape_length : stamp_arrived(z.stamp);
    }
    if (t == 1u) {
        float far = aim.camera.distance;
        if (!is_finite(far)) {
            far = lights_lead(aim.camera.lens, aim.camera.dir);
        }
        Length length = Length(paths.emitted) + Length(job.time_camera != 0u ? job.time_medium * far : 0.0);
        return s == 1u ? length : length + stamp_of_light(y.stamp, bsdf_index_ratio(y.bsdf, y.wo, -aim.wi), job.time_medium);
    }
    if (s == 1u) {
        return flight_of_direct(z.stamp, z.bsdf, z.wo, z.position, aim.wi, direct_distance);
    }
    float ratio = bsdf_index_ratio(z.bsdf, z.wo, aim.wi);
    Length near = stamp_onward(z.stamp, ratio, sqrt(aim.distance2));
    return near + stamp_of_light(y.stamp, bsdf_index_ratio(y.bsdf, y.wo, -aim.wi), z.stamp.index * ratio);
#else
    return Length(0.0);
#endif
}

// What the strategy of `s` and `t` vertices finds; `y` and `z` are the ends of the subpaths, as far as there are any.
// `escaped` is whether it is about light outside that the camera subpath met.
bool connect(
    uint h, uint s, uint t, uvec2 pixel, bool escaped, Subpaths paths, Vertex y, Vertex z, inout Sampler numbers,
    out Connection c
) {
    Aim aim;
    DirectSample direct;
    direct.distance = 0.0;
    bool aimed;
    if (s == 0u) {
        aimed = aim_at_hit(escaped, paths.escape, z, aim);
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
    if (s <= 1u) {
        end = light_end_new(aim.point, aim.dir, aim.next, aim.n_next);
    }
    BsdfValue at_y, at_z;
    double before_y = 0.0lf, before_z = 0.0lf;
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
        Chain chain = z.chain;
        if (escaped && !edge_chain(paths.escape.edge, h, 1.0lf, chain)) {
            return false;
        }
        c.unweighted = (escaped ? paths.escape.throughput : z.throughput) * aim.radiance;
        c.others = others_of_hit(h, chain, end, t);
        c.shadowed = false;
        return true;
    }
    if (t == 1u) {
        c.pixel = aim.camera.pixel;
        if (s == 1u) {
            bool far = !is_finite(aim.camera.distance);
            float cos_light = far ? 1.0 : dot(aim.point.normal, aim.dir);
            // What the light sends from this point to the lens is what it sent along the path: from a surface the same in
            // all directions of its front, from outside the same direction.
            c.unweighted = paths.start.radiance * cos_light
                * float(double(aim.camera.importance) / end.start);
            c.others = others_of_seen(h, end, aim.camera.pdf_w);
            if (cos_light <= 0.0) {
                return false;
            }
            if (far) {
                c.ray = leave(aim.camera.lens, vec3(0.0), aim.wi);
                c.distance = INFINITY;
            } else {
                c.shadowed = join(
                    aim.point.position, aim.point.normal, aim.camera.lens, vec3(0.0), c.ray, c.distance
                );
            }
        } else {
            c.unweighted = y.throughput * at_y.f * vertex_cos(y, -aim.wi) * aim.camera.importance;
            double here = double(aim.camera.pdf_w) * double(area_factor(aim.camera.lens, y.position, y.n_geometric));
            c.others = chain_others(y.chain, h, here, before_y);
            c.shadowed = join(y.position, y.n_geometric, aim.camera.lens, vec3(0.0), c.ray, c.distance);
        }
    } else if (s == 1u) {
        c.unweighted = z.throughput * at_z.f * vertex_cos(z, aim.wi) * aim.radiance;
        // At the rim of a sphere rounding may put the point on the side that is hidden, where no strategy has a density.
        if (!(end.direct > 0.0lf)) {
            return false;
        }
        c.others = others_of_next_event(h, z.chain, before_z, end, at_z);
        c.shadowed = shadow_ray(z.position, z.n_geometric, direct, c.ray, c.distance);
    } else {
        c.unweighted = y.throughput * at_y.f * vertex_cos(y, -aim.wi) * at_z.f * vertex_cos(z, aim.wi) * z.throughput
            / aim.distance2;
        double reaches_y = double(at_z.pdf_w) * double(abs(dot(aim.wi, y.n_geometric)) / aim.distance2);
        double reaches_z = double(at_y.pdf_w) * double(abs(dot(aim.wi, z.n_geometric)) / aim.distance2);
        c.others = chain_others(y.chain, h, reaches_y, before_y) + chain_others(z.chain, h, reaches_z, before_z);
        c.shadowed = join(z.position, z.n_geometric, y.position, y.n_geometric, c.ray, c.distance);
    }
    return c.unweighted != vec3(0.0);
}

#endif
