#include "math/distribution.glsl"
#include "math/trig.glsl"
#include "math/frame.glsl"
#include "math/rng.glsl"
#include "math/warp.glsl"
#include "transport/mis.glsl"
#include "transport/vertex.glsl"
bool trace_closest(Ray ray, float t_max, out Hit hit) { return false; }
bool trace_occluded(Ray ray, float t_max) { return false; }

void twin() {
    uvec4 words = uvec4(in_word(), in_word(), in_word(), in_word());
    vec2 u = in_vec2();
    vec3 p = in_vec3(), n = in_vec3(), q = in_vec3();
    float own = in_float(), other = in_float();
    uint h = in_word();
    uvec4 hashed = pcg4d(words);
    out_words(hashed);
    out_float(unit(hashed.x));
    float probability;
    out_word(alias_sample(u.x, probability));
    out_float(probability);
    out_vec3(offset_origin(p, n, abs(q.x)));
    out_vec2(uniform_triangle(u));
    out_vec2(concentric_disk(u));
    out_vec3(cosine_hemisphere(u));
    out_float(cosine_hemisphere_pdf_w(n.z));
    out_vec3(uniform_sphere(u));
    Frame f = frame_from_normal(n);
    out_vec3(f.s);
    out_vec3(f.t);
    out_vec3(frame_to_local(f, p));
    out_vec3(frame_to_world(f, p));
    out_vec2(sin_cos(p.x));
    out_float(atan2(p.y, p.z));
    out_float(arc_cos(n.x));
    out_float(area_factor(p, q, n));
    out_float(heuristic_weight(h, own, other));
}
