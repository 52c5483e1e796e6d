// Path tracing with next event estimation as a shared library for Lumbre: the example of technique.h.
//
//     c++ -O2 -shared -fPIC nee.cpp -o nee.so
//     LUMBRE_PLUGINS=$PWD/nee.so lumbre run script.lua        -- with integrator = "nee_cpp"

#include "technique.h"

namespace {

struct Color {
    float c[3];
    bool is_black() const { return !(c[0] > 0 || c[1] > 0 || c[2] > 0); }
};

Color times(const float *a, const float *b, float factor) {
    return {{a[0] * b[0] * factor, a[1] * b[1] * factor, a[2] * b[2] * factor}};
}

// The weight of one of two densities by the power heuristic [Veach 1997, 9.2], with an exponent as a parameter.
float weight(float own, float other, double exponent) {
    if (!(other > 0)) return 1;
    float ratio = other / own, power = 1;
    for (int i = 0; i < static_cast<int>(exponent); ++i) power *= ratio;
    return 1 / (1 + power);
}

void sample(const lumbre_host *host, lumbre_sample *s, const void *) {
    const double exponent = host->parameters[0];
    Color throughput = {{1, 1, 1}};
    lumbre_ray ray;
    host->camera_ray(s, &ray);
    const lumbre_vertex *last = nullptr; // where the ray started; null at the camera and after a Dirac lobe
    float last_pdf = 0;
    bool specular = true;

    for (uint32_t edge = 1; edge <= host->max_depth; ++edge) {
        lumbre_surface surface;
        const lumbre_vertex *vertex = host->closest(s, &ray, &surface);

        // 1. Light that the path hits by itself, which light sampling could have found too.
        if (!vertex) {
            Color sky;
            const float pdf = host->environment(s, ray.dir, sky.c);
            if (!sky.is_black()) {
                const float w = specular ? 1 : weight(last_pdf, pdf, exponent);
                host->add(s, times(throughput.c, sky.c, w).c, 0, edge + 1);
            }
            return;
        }
        if (surface.emits) {
            Color emitted;
            host->emission(s, vertex, emitted.c);
            if (!emitted.is_black()) {
                const float w = specular ? 1 : weight(last_pdf, host->light_pdf(s, last, vertex), exponent);
                host->add(s, times(throughput.c, emitted.c, w).c, 0, edge + 1);
            }
        }
        if (surface.ends || edge == host->max_depth) return;

        // 2. A connection to a sampled point of a light.
        lumbre_light_sample light;
        if (surface.has_density && host->light_sample(s, vertex, &light)) {
            Color value;
            const float pdf = host->bsdf_evaluate(s, vertex, light.wi, value.c);
            Color found = times(value.c, light.radiance, 1 / light.pdf);
            if (!found.is_black() && !host->occluded(s, vertex, &light)) {
                const float w = light.delta ? 1 : weight(light.pdf, pdf, exponent);
                host->add(s, times(throughput.c, found.c, w).c, 1, edge + 1);
            }
        }

        // 3. The next edge, in a direction of the BSDF.
        lumbre_bsdf_sample next;
        if (!host->bsdf_sample(s, vertex, &next)) return;
        throughput = times(throughput.c, next.weight, 1);
        if (throughput.is_black()) return;
        if (host->rr_start != 0 && edge >= host->rr_start) {
            const float survival = 0.9f;
            if (!(host->next_1d(s) < survival)) return;
            throughput = {{throughput.c[0] / survival, throughput.c[1] / survival, throughput.c[2] / survival}};
        }
        host->leave(s, vertex, next.wi, &ray);
        last = vertex;
        last_pdf = next.pdf;
        specular = next.delta != 0;
    }
}

const lumbre_parameter parameters[] = {
    {"exponent", "exponent of the power heuristic: 1 is the balance heuristic", 1, 4, 2},
};

const lumbre_technique technique = {
    "nee_cpp",
    "path tracing with next event estimation in C++",
    "Paths are connected to a light at every vertex [Veach 1997, 9.2]; written in C++ against technique.h.",
    nullptr, // unbiased
    1,
    1,
    parameters,
    nullptr, // no data that the samples of an iteration share
    nullptr,
    sample,
};

} // namespace

uint32_t lumbre_technique_abi(void) { return LUMBRE_TECHNIQUE_ABI; }
const lumbre_technique *lumbre_technique_describe(void) { return &technique; }
