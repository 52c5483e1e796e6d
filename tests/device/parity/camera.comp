#include "transport/camera/lens.glsl"
bool trace_closest(Ray ray, float t_max, out Hit hit) { return false; }
bool trace_occluded(Ray ray, float t_max) { return false; }

void put(bool found, CameraConnection c) {
    if (!found) {
        c = CameraConnection(uvec2(0u), vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0);
    }
    out_word(found ? 1u : 0u);
    out_words(c.pixel);
    out_vec3(c.lens);
    out_vec3(c.dir);
    out_float(c.distance);
    out_float(c.importance);
    out_float(c.pdf_w);
}

void twin() {
    uvec2 pixel = uvec2(in_word(), in_word());
    uvec2 index = uvec2(in_word(), 0u);
    vec3 point = in_vec3(), dir = in_vec3();
    vec2 lens_u = in_vec2(), filter_u = in_vec2();
    Sampler numbers = sampler_start(job.seed, pixel, index);
    Ray ray = camera_sample_ray(pixel, numbers);
    out_vec3(ray.origin);
    out_vec3(ray.dir);
    out_float(camera_pdf_w(dir));
    CameraConnection c;
    bool found = camera_connect(false, point, lens_u, filter_u, c);
    put(found, c);
    found = camera_connect(true, dir, lens_u, filter_u, c);
    put(found, c);
}
