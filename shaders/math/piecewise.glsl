// Twin of crates/lumbre-light/src/math/piecewise.rs: a piecewise linear density, as rows of `knots`.
#ifndef MATH_PIECEWISE_GLSL
#define MATH_PIECEWISE_GLSL

#include "scene.glsl"

double knot_x(uint i) {
    return packDouble2x32(knots[i].x);
}

double knot_density(uint i) {
    return packDouble2x32(knots[i].density);
}

double knot_below(uint i) {
    return packDouble2x32(knots[i].below);
}

// Returns the position at which the distribution function reaches `u`, for the density whose knots
// are `rows.y` from `rows.x`.
float piecewise_sample(uvec2 rows, float u) {
    uint next = 0u;
    while (next < rows.y && knot_below(rows.x + next) <= double(u)) {
        next += 1u;
    }
    uint b = rows.x + clamp(next, 1u, rows.y - 1u), a = b - 1u;
    double h = knot_x(b) - knot_x(a);
    double rest = double(u) - knot_below(a);
    if (h <= 0.0lf || rest <= 0.0lf) {
        return float(knot_x(a));
    }
    // The root of a.density t + (b.density - a.density) t^2 / 2h = rest, in the form without
    // cancellation.
    double density = knot_density(a);
    double slope = (knot_density(b) - density) / h;
    double square = density * density + 2.0lf * slope * rest;
    double root = square > 0.0lf ? sqrt(square) : 0.0lf;
    return float(knot_x(a) + min(2.0lf * rest / (density + root), h));
}

#endif
