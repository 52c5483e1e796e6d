// Twin of crates/lumbre-light/src/transport/integrator/bdpt/draw.rs. Positions in the list of light vertices are
// 64-bit fractions of its length, where Rust has doubles.
#ifndef TRANSPORT_INTEGRATOR_BDPT_DRAW_GLSL
#define TRANSPORT_INTEGRATOR_BDPT_DRAW_GLSL

#include "iteration.glsl"

// The target densities of the candidates of one connection.
float candidate_targets[CANDIDATES];

// Returns the position of the first candidate for two numbers, of which the second one continues the
// 24 binary digits of the first.
uvec2 draw_first(vec2 u) {
    uvec2 digits = uvec2(u * 16777216.0);
    return uvec2(digits.y << 16, (digits.x << 8) | (digits.y >> 16));
}

// Returns the number of the vertex that is candidate `i`; the list must not be empty.
uint draw_vertex(uvec2 first, uint i) {
    uint low, high, carry, ignored;
    umulExtended(job.candidate_step.x, i, high, low);
    high += job.candidate_step.y * i;
    low = uaddCarry(first.x, low, carry);
    high += first.y + carry;
    // The upper 32 of the 96 bits of the position times the number of vertices.
    uint count = light_list_head.count, of_low, of_high, place;
    umulExtended(low, count, of_low, ignored);
    umulExtended(high, count, place, of_high);
    uaddCarry(of_high, of_low, carry);
    return light_list[light_list_blocks(job.light_path_count) + place + carry];
}

// Returns the number of samples by which the estimate of a connection is divided whose vertex was
// chosen with this probability: `samples_of` in Rust.
float draw_samples(float probability) {
    return float(job.light_path_count) * float(job.connections) / float(light_list_head.count)
        * float(job.candidates) * probability;
}

// Returns the target density of a candidate, up to a factor; 0 if it brings no light.
float draw_target(float luminance, float weight) {
    float target = luminance * weight;
    return target > 0.0 && is_finite(target) ? target : 0.0;
}

// Chooses a candidate in proportion to its target density; false if all of them are 0.
bool draw_choose(float choice, out uint chosen, out float probability) {
    float total = 0.0;
    for (uint i = 0u; i < job.candidates; ++i) {
        total += candidate_targets[i];
    }
    float rest = choice * total;
    chosen = NONE;
    for (uint i = 0u; i < job.candidates && (chosen == NONE || rest >= 0.0); ++i) {
        float target = candidate_targets[i];
        if (target > 0.0) {
            chosen = i;
            probability = target / total;
            rest -= target;
        }
    }
    return chosen != NONE;
}

#endif
