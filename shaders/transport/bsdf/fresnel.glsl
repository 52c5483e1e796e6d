// Twin of crates/lumbre-light/src/transport/bsdf/fresnel.rs.
#ifndef TRANSPORT_BSDF_FRESNEL_GLSL
#define TRANSPORT_BSDF_FRESNEL_GLSL

// Reflection and refraction of unpolarised light at a dielectric interface: reflectance, cosine of
// the refracted direction (0 under total internal reflection), index of the far side over that of
// the near side.
struct DielectricFresnel {
    float reflectance;
    float cos_t;
    float eta;
};

// Evaluates the exact Fresnel equations for `cos_i` (positive outside, negative inside) and the
// index of the inside.
DielectricFresnel fresnel_dielectric(float cos_i, float ior) {
    float eta = cos_i >= 0.0 ? ior : 1.0 / ior;
    cos_i = min(abs(cos_i), 1.0);
    float cos2_t = 1.0 - (1.0 - cos_i * cos_i) / (eta * eta);
    if (cos2_t <= 0.0) {
        return DielectricFresnel(1.0, 0.0, eta);
    }
    float cos_t = sqrt(cos2_t);
    // Compute both amplitudes with one division.
    float along = eta * cos_i + cos_t, across = cos_i + eta * cos_t;
    float scale = 1.0 / (along * across);
    float parallel = (eta * cos_i - cos_t) * across * scale;
    float perpendicular = (cos_i - eta * cos_t) * along * scale;
    return DielectricFresnel(
        0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t, eta
    );
}

// Returns `(1 - |cos|)^5`.
float schlick_weight(float cos_theta) {
    float m = clamp(1.0 - abs(cos_theta), 0.0, 1.0);
    float m2 = m * m;
    return m2 * m2 * m;
}

// Returns the reflectance of a metal whose reflectance at normal incidence is `f0` [Schlick 1994].
vec3 fresnel_schlick(vec3 f0, float cos_theta) {
    return f0 + (vec3(1.0) - f0) * schlick_weight(cos_theta);
}

#endif
