// Twin of crates/lumbre-light/src/transport/light/environment.rs: the map is texture `job.environment_texture`, its
// distribution is in `environment_rows` and `environment_cells`.
#ifndef TRANSPORT_LIGHT_ENVIRONMENT_GLSL
#define TRANSPORT_LIGHT_ENVIRONMENT_GLSL

#include "scene.glsl"
#include "math/distribution.glsl"
#include "math/warp.glsl"

uvec2 environment_size() {
    return uvec2(textures[job.environment_texture].width, textures[job.environment_texture].height);
}

// Returns column and row of a direction as fractions of width and height, both in 0..=1, in a map
// that is turned by the angle with the sine and cosine `turn`.
vec2 directions_coordinates(vec2 turn, vec3 dir) {
    float x = dir.x * turn.y - dir.z * turn.x, z = dir.x * turn.x + dir.z * turn.y;
    float u = atan2(x, -z) / TAU;
    return vec2(u < 0.0 ? u + 1.0 : u, atan2(sqrt(x * x + z * z), dir.y) / PI);
}

// Returns texel number `i` of a map; `floats` states whether its texels are floats, as those of the
// environment are.
vec3 directions_texel(Texture map, bool floats, int i) {
    return floats ? float_texel(map.first, uint(i)) : texture_texel(map, uint(i));
}

// Returns the colour of a map interpolated between the centres of four texels: across the seam, if
// its columns wrap around.
vec3 map_bilinear(Texture map, bool floats, bool wraps, vec2 uv) {
    ivec2 size = ivec2(map.width, map.height);
    vec2 xy = uv * vec2(size) - 0.5;
    ivec2 low = ivec2(floor(xy));
    vec2 f = xy - floor(xy);
    // Columns are from -1 to the size, both included.
    ivec2 columns = ivec2(low.x, low.x + 1);
    columns = wraps ? (columns + size.x) % size.x : clamp(columns, 0, size.x - 1);
    ivec2 rows = clamp(ivec2(low.y, low.y + 1), 0, size.y - 1) * size.x;
    vec3 upper = mix(
        directions_texel(map, floats, rows.x + columns.x),
        directions_texel(map, floats, rows.x + columns.y), f.x
    );
    vec3 lower = mix(
        directions_texel(map, floats, rows.y + columns.x),
        directions_texel(map, floats, rows.y + columns.y), f.x
    );
    return mix(upper, lower, f.y);
}

// Returns the radiance that arrives from the unit direction `dir`; black without an environment.
vec3 environment_radiance(vec3 dir) {
    if (job.has_environment == 0u) {
        return vec3(0.0);
    }
    if (job.environment_texture == NONE) {
        return job.environment_radiance;
    }
    vec2 uv = directions_coordinates(job.environment_turn, dir);
    return job.environment_radiance
        * map_bilinear(textures[job.environment_texture], true, true, uv);
}

// Samples a direction towards the environment, with its density per solid angle.
vec3 environment_sample(vec2 u, out float pdf_w) {
    if (job.environment_texture == NONE) {
        pdf_w = 1.0 / (4.0 * PI);
        return uniform_sphere(u);
    }
    uvec2 size = environment_size();
    GridSample s = grid_sample(size, u);
    EnvironmentRow row = environment_rows[s.cell.y];
    pdf_w = s.probability * row.density;
    vec2 phi = sin_cos(TAU * ((float(s.cell.x) + s.inside.x) / float(size.x)));
    // One minus the absolute value of the cosine, measured from the row's edge nearer to its pole:
    // this keeps the digits for which Rust uses double precision.
    bool upper_half = row.upper >= 0.0;
    float edge = row.upper_rest;
    if (!upper_half) {
        edge = s.cell.y + 1u < size.y ? environment_rows[s.cell.y + 1u].upper_rest : 0.0;
    }
    float rest = edge - row.step * (upper_half ? s.inside.y : s.beyond.y);
    float cos_polar = upper_half ? 1.0 - rest : rest - 1.0;
    float sin_polar = sqrt(max(rest * (2.0 - rest), 0.0));
    float px = sin_polar * phi.x, pz = -sin_polar * phi.y;
    float turn_sin = job.environment_turn.x, turn_cos = job.environment_turn.y;
    return vec3(px * turn_cos + pz * turn_sin, cos_polar, pz * turn_cos - px * turn_sin);
}

// Returns the density per solid angle with which `environment_sample` samples a direction.
float environment_pdf_w(vec3 dir) {
    if (job.environment_texture == NONE) {
        return 1.0 / (4.0 * PI);
    }
    uvec2 size = environment_size();
    vec2 uv = directions_coordinates(job.environment_turn, dir);
    uvec2 cell = min(uvec2(uv * vec2(size)), size - 1u);
    return grid_probability(size.x, cell.x, cell.y) * environment_rows[cell.y].density;
}

#endif
