// Twin of crates/lumbre-light/src/transport/light/mod.rs.
#ifndef TRANSPORT_LIGHT_MOD_GLSL
#define TRANSPORT_LIGHT_MOD_GLSL

#include "math/distribution.glsl"
#include "transport/light/area.glsl"
#include "transport/light/bounds.glsl"
#include "transport/light/directional.glsl"
#include "transport/light/environment.glsl"
#include "transport/light/point.glsl"
#include "transport/light/sphere.glsl"
#include "transport/light/types.glsl"

// Returns the relative luminance of linear sRGB [IEC 61966-2-1].
float luminance(vec3 color) {
    return dot(color, vec3(0.2126, 0.7152, 0.0722));
}

// Returns the probability of choosing a light; zero for one that the scene does not have.
float lights_pdf_choice(uint light) {
    return light < job.light_count && job.alias_shift != NONE ? alias_pmf(light) : 0.0;
}

// Returns the radiance that arrives along `-dir` from outside the scene.
vec3 lights_environment(vec3 dir) {
    return environment_radiance(dir);
}

// Returns the distance between `from` and the wave front of an infinitely distant light in
// direction `wi` when the front touches the bounding sphere of all surfaces.
float lights_front_distance(vec3 from, vec3 wi) {
    return job.ball_radius - dot(from - job.ball_center, wi);
}

// Samples light that arrives at `from` from the light with this index. The density does not include
// the choice; for a Dirac light it is 1.
bool lights_sample_direct_from(uint light, vec3 from, vec2 u, out DirectSample s) {
    uint kind = light_kind(light);
    if (kind == LIGHT_EMITTER) {
        bool found;
        if (area_is_sphere(light)) {
            Sphere ball = area_sphere(light);
            ConeSample cone;
            found = sphere_sample(ball, from, u, cone);
            vec3 position = ball.center + cone.normal * ball.radius;
            LightPoint point = LightPoint(
                light, position, cone.normal, sphere_extent(ball), uv_of(sphere_uv(cone.normal))
            );
            s = DirectSample(
                cone.wi, distance(position, from), vec3(0.0), cone.pdf_w, false, point
            );
        } else {
            found = area_sample_direct(light, from, u, s);
        }
        s.radiance = area_emission(light, s.point.uv);
        return found;
    }
    if (kind == LIGHT_POINT) {
        return point_sample_direct(light - job.light_first.x, from, s);
    }
    if (kind == LIGHT_DIRECTIONAL) {
        s = directional_sample_direct(light - job.light_first.y, from);
        return true;
    }
    float pdf_w;
    vec3 wi = environment_sample(u, pdf_w);
    s = DirectSample(
        wi, INFINITY, environment_radiance(wi), pdf_w, false, ball_outside(light, from, wi)
    );
    return pdf_w > 0.0;
}

// Samples light that arrives at `from`; false if the sampled point does not emit towards it.
bool lights_sample_direct(vec3 from, float choice, vec2 u, out DirectSample s) {
    if (job.alias_shift == NONE) {
        return false;
    }
    float probability;
    uint light = alias_sample(choice, probability);
    bool found = lights_sample_direct_from(light, from, u, s);
    s.pdf_w *= probability;
    return found;
}

// Returns the density per solid angle at `from` with which `lights_sample_direct_from` samples the
// point `at` of emitter `i`, whose front side has the unit normal `normal` there; zero from behind.
float lights_pdf_direct_one_w(vec3 from, uint i, vec3 at, vec3 normal) {
    return area_is_sphere(i)
        ? sphere_pdf_w(area_sphere(i), from, at, normal)
        : area_pdf_direct_w(i, from, at, normal);
}

// Returns the same density for `lights_sample_direct`: the choice is included.
float lights_pdf_direct_w(vec3 from, uint i, vec3 at, vec3 normal) {
    return lights_pdf_choice(i) * lights_pdf_direct_one_w(from, i, at, normal);
}

// Returns the density per solid angle with which `lights_sample_direct_from` samples the
// environment in direction `dir`.
float lights_pdf_environment_one_w(vec3 dir) {
    return job.has_environment != 0u ? environment_pdf_w(dir) : 0.0;
}

// Returns the same density for `lights_sample_direct`: the choice is included.
float lights_pdf_environment_w(vec3 dir) {
    return lights_pdf_choice(job.light_first.z) * lights_pdf_environment_one_w(dir);
}

// Samples the start of a path at a light, in the measures of the table in Rust; false if the path
// would carry nothing.
bool lights_sample_emission(float choice, vec2 u, vec2 v, out EmissionSample s) {
    if (job.alias_shift == NONE) {
        return false;
    }
    float probability;
    uint light = alias_sample(choice, probability);
    uint kind = light_kind(light);
    if (kind == LIGHT_EMITTER) {
        LightPoint point = area_sample(light, u);
        vec3 local = cosine_hemisphere(v);
        s = EmissionSample(
            point, frame_to_world(frame_from_normal(point.normal), local),
            area_emission(light, point.uv), area_pdf_a(light), cosine_hemisphere_pdf_w(local.z),
            local.z
        );
    } else if (kind == LIGHT_POINT) {
        s = point_sample_emission(light - job.light_first.x, v);
    } else if (kind == LIGHT_DIRECTIONAL) {
        s = directional_sample_emission(light - job.light_first.y, u);
    } else {
        float pdf_w;
        vec3 from = environment_sample(v, pdf_w);
        s = EmissionSample(
            ball_on_disk(light, -from, u), -from, environment_radiance(from),
            ball_pdf_a(), pdf_w, 1.0
        );
    }
    bool usable = s.pdf_w > 0.0 && s.pdf_a > 0.0;
    s.pdf_a *= probability;
    return usable;
}

// Returns the densities with which `lights_sample_emission` starts a path at a point of any light
// in the unit direction `dir`.
EmissionPdf lights_pdf_emission_at(LightPoint point, vec3 dir) {
    float choice = lights_pdf_choice(point.light);
    uint kind = light_kind(point.light);
    if (kind == LIGHT_EMITTER) {
        return EmissionPdf(
            choice * area_pdf_a(point.light), cosine_hemisphere_pdf_w(dot(point.normal, dir))
        );
    }
    if (kind == LIGHT_POINT) {
        return EmissionPdf(choice, point_pdf_w(point.light - job.light_first.x, dir));
    }
    if (kind == LIGHT_DIRECTIONAL) {
        bool own = directional_shines_into(point.light - job.light_first.y, dir);
        return EmissionPdf(choice * ball_pdf_a(), own ? 1.0 : 0.0);
    }
    return EmissionPdf(choice * ball_pdf_a(), lights_pdf_environment_one_w(-dir));
}

// Returns the emission of a light point in the unit direction `dir`: radiance, the intensity of a
// point light, the irradiance of a directional light; black behind a surface.
vec3 lights_emitted(LightPoint point, vec3 dir) {
    uint kind = light_kind(point.light);
    if (kind == LIGHT_EMITTER) {
        return dot(point.normal, dir) > 0.0 ? area_emission(point.light, point.uv) : vec3(0.0);
    }
    if (kind == LIGHT_POINT) {
        return point_intensity(point.light - job.light_first.x, dir);
    }
    if (kind == LIGHT_DIRECTIONAL) {
        uint i = point.light - job.light_first.y;
        return directional_shines_into(i, dir) ? directionals[i].irradiance : vec3(0.0);
    }
    return environment_radiance(-dir);
}

#endif
