#include "film/sums.glsl"
#include "transport/path_time.glsl"
#include "film/splat.glsl"
#include "film/time.glsl"
bool trace_closest(Ray ray, float t_max, out Hit hit) { return false; }
bool trace_occluded(Ray ray, float t_max) { return false; }

void twin() {
    float u = in_float(), optical = in_float();
    vec2 uv = in_vec2();
    uint row = in_word();
    out_float(profile_sample(delay_profile_at(row, uv_of(uv)), u));
    double place = time_position(double(optical));
    out_word(time_slot(place));
    out_float(float(time_below(double(in_float()), place, 2.25lf)));
    out_float(ln_1p(-u));
    out_float(arc_sin(2.0 * u - 1.0));
    out_float(lights_front_distance(in_vec3(), in_vec3()));
    Independent auxiliary = sampler_auxiliary(
        sampler_start(job.seed, uvec2(row, 3u), uvec2(row, 0u))
    );
    out_float(independent_next_1d(auxiliary));
}
