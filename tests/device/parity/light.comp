#include "transport/light/mod.glsl"
bool trace_closest(Ray ray, float t_max, out Hit hit) { return false; }
bool trace_occluded(Ray ray, float t_max) { return false; }

void put_point(LightPoint p) {
    out_word(p.light);
    out_vec3(p.position);
    out_vec3(p.normal);
    out_vec2(p.uv.xy);
}

void twin() {
    vec3 from = in_vec3();
    float choice = in_float();
    vec2 u = in_vec2(), v = in_vec2();
    vec3 dir = in_vec3();
    DirectSample d;
    bool found = lights_sample_direct(from, choice, u, d);
    out_word(found ? 1u : 0u);
    if (!found) {
        d = DirectSample(
            vec3(0.0), 0.0, vec3(0.0), 0.0, false, LightPoint(0u, vec3(0.0), vec3(0.0), 0.0, Uv(0.0))
        );
    }
    out_vec3(d.wi);
    out_float(d.distance);
    out_vec3(d.radiance);
    out_float(d.pdf_w);
    out_word(d.delta ? 1u : 0u);
    put_point(d.point);
    bool emitter = found && d.point.light < job.light_first.x;
    out_float(
        emitter ? lights_pdf_direct_w(from, d.point.light, d.point.position, d.point.normal) : 0.0
    );
    EmissionSample e;
    found = lights_sample_emission(choice, u, v, e);
    out_word(found ? 1u : 0u);
    out_vec3(e.dir);
    out_vec3(e.radiance);
    out_float(e.pdf_a);
    out_float(e.pdf_w);
    out_float(e.cos_theta);
    put_point(e.point);
    EmissionPdf pdf = lights_pdf_emission_at(e.point, e.dir);
    out_float(pdf.pdf_a);
    out_float(pdf.pdf_w);
    out_vec3(lights_emitted(e.point, e.dir));
    out_vec3(lights_environment(dir));
    out_float(lights_pdf_environment_w(dir));
}
