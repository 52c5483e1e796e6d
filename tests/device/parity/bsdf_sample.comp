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
    in_vec3();
    uint mode = in_word();
    float u = in_float();
    vec2 v = in_vec2();
    Bsdf b = bsdf_new(surface_at(ray, hit));
    BsdfSample s;
    bool found = bsdf_sample(b, -ray.dir, u, v, mode, s);
    if (!found) {
        s = BsdfSample(vec3(0.0), vec3(0.0), 0.0, false, 0.0);
    }
    out_word(found ? 1u : 0u);
    out_word(s.delta ? 1u : 0u);
    out_vec3(s.wi);
    out_vec3(s.weight);
    out_float(s.pdf_w);
    out_float(s.eta);
}
