// Appended to the kernel of an integrator: a traversal that tests every primitive, as `Brute` in
// tests/device/twins/integrator.rs does, and a film that sums the contributions of one sample to
// all pixels.
vec3 total = vec3(0.0), unweighted = vec3(0.0);
uint strategies = 0u, rays = 0u;
// Sum of optical lengths. Each strategy has another weight, so that exchanged lengths differ.
double lengths = 0.0lf;

void sink(Contribution c) {
    total += c.value;
    unweighted += c.unweighted;
    lengths += c.optical_length * double(1u + c.s * 3u + c.t);
    strategies += (c.s * 31u + c.t * 7u + 1u) * (c.pixel.x * 3u + c.pixel.y * 5u + 1u);
}

bool triangle_hit(Ray ray, uint i, out float t, out vec2 uv) {
    vec3 ab = triangles[i].b - triangles[i].a, ac = triangles[i].c - triangles[i].a;
    vec3 p = cross(ray.dir, ac);
    float inverse = 1.0 / dot(ab, p);
    vec3 s = ray.origin - triangles[i].a;
    vec3 q = cross(s, ab);
    uv = vec2(dot(s, p), dot(ray.dir, q)) * inverse;
    t = dot(ac, q) * inverse;
    return uv.x >= 0.0 && uv.y >= 0.0 && uv.x + uv.y <= 1.0;
}

bool sphere_hit(Ray ray, uint i, float t_max, out float t) {
    vec3 f = ray.origin - spheres[i].center;
    float b = -dot(f, ray.dir);
    float r2 = spheres[i].radius * spheres[i].radius;
    float discriminant = r2 - length_squared(f + ray.dir * b);
    float q = b + copysign(sqrt(max(discriminant, 0.0)), b);
    float other = (length_squared(f) - r2) / q;
    float near = min(other, q);
    t = near > 0.0 ? near : max(other, q);
    return discriminant >= 0.0 && q != 0.0;
}

bool brute(Ray ray, float t_max, out Hit hit) {
    bool found = false;
    hit.t = t_max;
    [[dont_unroll]] for (uint i = 0u; i < job.triangle_count + job.sphere_count; ++i) {
        Hit next = Hit(0.0, i, NONE, vec2(0.0));
        bool met = i < job.triangle_count
            ? triangle_hit(ray, i, next.t, next.uv)
            : sphere_hit(ray, i - job.triangle_count, t_max, next.t);
        if (met && next.t > 0.0 && next.t < hit.t && !is_masked_out(ray, next)) {
            hit = next;
            found = true;
        }
    }
    return found;
}

bool trace_closest(Ray ray, float t_max, out Hit hit) {
    rays++;
    return brute(ray, t_max, hit);
}

bool trace_occluded(Ray ray, float t_max) {
    rays++;
    Hit hit;
    return brute(ray, t_max, hit);
}

#ifdef CAMERA_PATHS
void integrate(uvec2 pixel, inout Sampler numbers) {
    CameraPath path = camera_path_new(pixel, numbers);
    while (camera_path_step(pixel, path, numbers)) {
    }
}
#endif

void twin() {
    uvec2 pixel = uvec2(in_word(), in_word());
    Sampler numbers = sampler_start(job.seed, pixel, uvec2(in_word(), 0u));
    integrate(pixel, numbers);
    out_vec3(total);
    out_vec3(unweighted);
    out_word(strategies);
    out_word(rays);
    out_float(float(lengths));
}
