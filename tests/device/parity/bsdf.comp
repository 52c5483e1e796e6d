#include "transport/bsdf/mod.glsl"
bool trace_closest(Ray ray, float t_max, out Hit hit) { return false; }
bool trace_occluded(Ray ray, float t_max) { return false; }

void twin() {
    Hit hit;
    hit.primitive = in_word();
    hit.instance = NONE;
    hit.uv = in_vec2();
    Ray ray;
    ray.origin = in_vec3();
    ray.dir = in_vec3();
    hit.t = in_float();
    vec3 wi = in_vec3();
    uint mode = in_word();
    Bsdf b = bsdf_new(surface_at(ray, hit));
    BsdfValue value = bsdf_evaluate(b, -ray.dir, wi, mode);
    out_word(bsdf_has_density(b) ? 1u : 0u);
    out_vec3(value.f);
    out_float(value.pdf_w);
    out_float(value.reverse_pdf_w);
    out_vec3(bsdf_eval(b, -ray.dir, wi, mode));
    out_float(bsdf_pdf_w(b, -ray.dir, wi));
}
