#include "transport/surface.glsl"
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
    Surface s = surface_at(ray, hit);
    out_word(s.material);
    out_word(s.emitter);
    out_word(s.terminator.present ? 1u : 0u);
    out_vec3(s.position);
    out_vec3(s.n_geometric);
    out_vec3(s.n_shading);
    out_vec3(s.tangent);
    out_vec2(s.uv.xy);
    out_vec3(s.terminator.present ? s.terminator.lifted_point : vec3(0.0));
    out_vec3(surface_base_color(s));
    out_vec3(surface_emitted(s, -ray.dir));
    out_vec3(surface_spawn(s, wi).origin);
    out_float(coverage(s.material, s.uv));
    out_word(is_masked_out(ray, hit) ? 1u : 0u);
}
