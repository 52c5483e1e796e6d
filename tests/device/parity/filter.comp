#include "transport/camera/filter.glsl"

void twin() {
    FilterSpec f;
    f.kind = in_word();
    f.radius = in_float();
    vec2 u = in_vec2();
    float x = in_float(), q = in_float(), pick = in_float();
    uint edge = in_word();
    out_vec2(filter_sample(f, u));
    out_float(filter_density(f, x));
    out_float(filter_reach(f));
    uint chosen;
    float weight;
    bool found = filter_choose_pixel(f, q, 7u, edge, pick, chosen, weight);
    out_word(found ? 1u : 0u);
    out_word(found ? chosen : 0u);
    out_float(found ? weight : 0.0);
}
