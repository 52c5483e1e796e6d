/* Techniques of Lumbre in shared libraries: the C interface, version 2.
 *
 * A library exports two functions. LUMBRE_PLUGINS names the libraries that a program loads:
 *
 *     c++ -O2 -shared -fPIC nee.cpp -o nee.so
 *     LUMBRE_PLUGINS=$PWD/nee.so lumbre run script.lua
 *
 * Vectors are three floats in world space, directions are unit vectors, and colours are linear radiance in red, green
 * and blue. Functions may be called from many threads at a time, each with another sample. They must return, and must
 * not throw exceptions. A sample must be a function of what the host returns and of the iteration alone: then pictures have
 * the same bits for any number of threads.
 */
#ifndef LUMBRE_TECHNIQUE_H
#define LUMBRE_TECHNIQUE_H

#include <stdint.h>

#define LUMBRE_TECHNIQUE_ABI 2

#ifdef __cplusplus
extern "C" {
#endif

/* A sample that is being computed. */
typedef struct lumbre_sample lumbre_sample;

/* A point of a surface that a ray met. The host keeps it until the sample ends. */
typedef struct lumbre_vertex lumbre_vertex;

typedef struct lumbre_ray {
    float origin[3];
    float dir[3];
} lumbre_ray;

typedef struct lumbre_surface {
    float position[3];
    float normal[3];     /* shading normal, on the front side of the primitive */
    int32_t emits;       /* whether the surface may emit light */
    int32_t ends;        /* whether paths end here: the surface reflects nothing */
    int32_t has_density; /* whether the BSDF has a part that is no Dirac lobe */
} lumbre_surface;

typedef struct lumbre_bsdf_sample {
    float wi[3];     /* direction in which the path continues */
    float weight[3]; /* f |cos| / pdf: the factor on the path's throughput */
    float pdf;       /* density per solid angle; the probability of the choice if delta */
    float eta;       /* index ratio crossed; 1 without refraction */
    int32_t delta;   /* whether the lobe is a Dirac lobe */
} lumbre_bsdf_sample;

typedef struct lumbre_light_sample {
    float wi[3];       /* direction from the vertex to the light */
    float distance;    /* infinite for infinitely distant lights */
    float radiance[3]; /* radiance that arrives; of a Dirac light, irradiance on a surface that faces it */
    float pdf;         /* density per solid angle, times the probability of the light; of a Dirac light that alone */
    float position[3]; /* point on the light */
    float normal[3];   /* its normal; zero for points without a surface */
    float extent;      /* greatest coordinate of the primitive: a measure of the rounding errors of the position */
    int32_t delta;     /* whether only light sampling finds this light */
} lumbre_light_sample;

/* Functions of the program. They are valid during `sample`. */
typedef struct lumbre_host {
    uint32_t abi;             /* LUMBRE_TECHNIQUE_ABI */
    uint32_t max_depth;       /* greatest number of path edges: 1 is emission only, 2 adds direct light */
    uint32_t rr_start;        /* first edge after which Russian roulette may end a path; 0 without it */
    const double *parameters; /* values in the order of the description */

    /* Samples a ray of the camera through the sample's pixel. Its importance is 1. */
    void (*camera_ray)(lumbre_sample *, lumbre_ray *ray);
    /* Returns the nearest point that a ray meets, and describes its surface; NULL if the ray leaves the scene. */
    const lumbre_vertex *(*closest)(lumbre_sample *, const lumbre_ray *ray, lumbre_surface *surface);
    /* Returns whether something lies between a vertex and the point of a light sample. */
    int32_t (*occluded)(lumbre_sample *, const lumbre_vertex *from, const lumbre_light_sample *to);

    /* Return the next numbers in [0, 1) of the sample's sampler. */
    float (*next_1d)(lumbre_sample *);
    void (*next_2d)(lumbre_sample *, float numbers[2]);

    /* Samples a direction of the BSDF, for a path from the camera. Returns 0 if there is none. */
    int32_t (*bsdf_sample)(lumbre_sample *, const lumbre_vertex *, lumbre_bsdf_sample *sampled);
    /* Evaluates f |cos| for a direction, without Dirac lobes. Returns the density with which bsdf_sample samples it. */
    float (*bsdf_evaluate)(lumbre_sample *, const lumbre_vertex *, const float wi[3], float value[3]);
    /* Returns the ray that leaves a vertex in a direction. */
    void (*leave)(lumbre_sample *, const lumbre_vertex *, const float wi[3], lumbre_ray *ray);

    /* Samples light that arrives at a vertex, before the test of occlusion. Returns 0 if there is none. */
    int32_t (*light_sample)(lumbre_sample *, const lumbre_vertex *, lumbre_light_sample *sampled);
    /* Returns the density per solid angle with which light_sample at `from` samples the emitting point `hit`. */
    float (*light_pdf)(lumbre_sample *, const lumbre_vertex *from, const lumbre_vertex *hit);
    /* Evaluates the radiance that a vertex emits towards the origin of the ray that met it. */
    void (*emission)(lumbre_sample *, const lumbre_vertex *, float radiance[3]);
    /* Evaluates the radiance of the environment in a direction. Returns the density of light_sample for it. */
    float (*environment)(lumbre_sample *, const float dir[3], float radiance[3]);

    /* Adds light to the sample's pixel, divided by all densities and weighted. s is the number of vertices that were
     * generated from the light (0 if the path hit it by chance), t that from the camera, the lens included. */
    void (*add)(lumbre_sample *, const float value[3], uint32_t s, uint32_t t);
} lumbre_host;

/* A numeric parameter: a key of the render table. */
typedef struct lumbre_parameter {
    const char *key;
    const char *doc; /* one sentence */
    double min, max, value; /* range and default */
} lumbre_parameter;

/* The description of a technique. Everything that it refers to must stay valid and unchanged. */
typedef struct lumbre_technique {
    const char *name;      /* in scripts: a lower-case letter, then lower-case letters, digits and `_` */
    const char *long_name; /* in tables and plots */
    const char *doc;       /* one sentence with the source */
    const char *bias;      /* NULL if unbiased; else the source of the bias, in a clause */
    uint32_t revision;     /* raise it whenever pictures change; the hash of the library is part of run ids too */
    uint32_t parameter_count;
    const lumbre_parameter *parameters;
    /* Optional: returns data that the samples with this index read (an iteration is one sample of every pixel). It must
     * depend on the values of the parameters and on the index alone. */
    void *(*begin_iteration)(const double *parameters, uint64_t index);
    void (*end_iteration)(void *iteration);
    /* Computes one sample of one pixel. `iteration` is NULL without begin_iteration. */
    void (*sample)(const lumbre_host *host, lumbre_sample *sample, const void *iteration);
} lumbre_technique;

/* The two functions that a library exports. */
uint32_t lumbre_technique_abi(void); /* returns LUMBRE_TECHNIQUE_ABI */
const lumbre_technique *lumbre_technique_describe(void);

#ifdef __cplusplus
}
#endif

#endif
