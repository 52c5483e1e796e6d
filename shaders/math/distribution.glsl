// Twin of the sampling half of crates/lumbre-light/src/math/distribution.rs: tables are built on the host.
#ifndef MATH_DISTRIBUTION_GLSL
#define MATH_DISTRIBUTION_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "scene.glsl"
#include "math/trig.glsl"

// Number of distinct sample numbers: 2^24.
const uint STEPS = 1u << 24;

// Returns the step of a number in [0, 1).
uint step_of(float u) {
    return min(uint(u * float(STEPS)), STEPS - 1u);
}

// Returns the light for `u` in [0, 1) and its probability. Must not be called if `job.alias_shift`
// is NONE.
uint alias_sample(float u, out float probability) {
    uint step = step_of(u);
    uint column = step >> job.alias_shift;
    LightChoice choice = light_choices[column];
    uint item = (step & ((1u << job.alias_shift) - 1u)) < choice.own ? column : choice.above;
    probability = light_choices[item].pmf;
    return item;
}

// Returns the probability of light `i`.
float alias_pmf(uint i) {
    return light_choices[i].pmf;
}

// A sample of the grid over the environment map: column and row; position inside the cell in [0,
// 1); its complement (one minus the position, with the digits that a subtraction would lose); and
// the probability of the cell.
struct GridSample {
    uvec2 cell;
    vec2 inside;
    vec2 beyond;
    float probability;
};

// Returns the cumulative probability before item `i` of the rows (if `row` is NONE) or of the cells
// of a row.
float grid_before(uint row, uint width, uint i) {
    if (i == 0u) {
        return 0.0;
    }
    return row == NONE
        ? environment_rows[i - 1u].marginal
        : environment_cells[row * width + i - 1u];
}

// Returns the probability of the cell in a column and a row of a map of `width` columns.
float grid_probability(uint width, uint x, uint y) {
    float row = environment_rows[y].marginal - grid_before(NONE, width, y);
    return row * (environment_cells[y * width + x] - grid_before(y, width, x));
}

// Samples a cell and a point in it for `u` in [0, 1)^2: `u.x` selects the column, `u.y` the row.
GridSample grid_sample(uvec2 size, vec2 u) {
    GridSample s;
    s.probability = 1.0;
    uint row = NONE;
    // The row first, then the column, by the same search.
    [[dont_unroll]] for (int axis = 1; axis >= 0; --axis) {
        uint low = 0u, count = size[axis];
        while (count > 0u) {
            uint half_count = count / 2u;
            if (grid_before(row, size.x, low + half_count + 1u) <= u[axis]) {
                low += half_count + 1u;
                count -= half_count + 1u;
            } else {
                count = half_count;
            }
        }
        uint i = min(low, size[axis] - 1u);
        float start = grid_before(row, size.x, i), end = grid_before(row, size.x, i + 1u);
        float width = end - start;
        s.cell[axis] = i;
        // Exact in this order of operations only.
        precise float behind = u[axis] - start + 0.5 / float(STEPS);
        precise float ahead = end - u[axis] - 0.5 / float(STEPS);
        s.inside[axis] = clamp(behind / width, 0.0, 1.0 - F32_EPSILON);
        s.beyond[axis] = clamp(ahead / width, F32_EPSILON, 1.0);
        s.probability *= width;
        row = i;
    }
    return s;
}

#endif
