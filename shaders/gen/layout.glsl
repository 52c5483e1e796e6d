// Written by the test `the_committed_layouts_are_those_of_the_code` from src/render/vulkan/layout/: edit that.

const uint NONE = 4294967295u;
const uint MODEL_DISNEY = 0u;
const uint MODEL_LAMBERT = 1u;
const uint MODEL_CONDUCTOR = 2u;
const uint MODEL_PLASTIC = 3u;
const uint MODEL_DIELECTRIC = 4u;
const uint DISTRIBUTION_GGX = 0u;
const uint DISTRIBUTION_BECKMANN = 1u;
const uint MASK_THRESHOLD = 0u;
const uint MASK_BLEND = 1u;
const uint WRAP_REPEAT = 0u;
const uint WRAP_MIRROR = 1u;
const uint WRAP_CLAMP = 2u;
const uint FILTER_BOX = 0u;
const uint FILTER_TENT = 1u;
const uint FILTER_GAUSS = 2u;
const uint FILTER_BLACKMAN_HARRIS = 3u;
const uint FILTER_ANTIALIASING_RADIUS = 4u;
const uint MIS_POWER = 0u;
const uint MIS_BALANCE = 1u;
const uint MIS_UNIFORM = 2u;
const uint SAMPLER_INDEPENDENT = 0u;
const uint SAMPLER_SOBOL = 1u;
const uint DELAY_NONE = 0u;
const uint DELAY_CONSTANT = 1u;
const uint DELAY_EXPONENTIAL = 2u;
const uint DELAY_EPANECHNIKOV = 3u;
const uint DELAY_TABLE = 4u;
const uint TIME_FILTER_NONE = 0u;
const uint TIME_FILTER_BOX = 1u;
const uint TIME_FILTER_GAUSS = 2u;
const uint STEP_CLOSEST = 1u;
const uint STEP_SHADOW = 2u;
const uint STEP_LIGHT = 3u;
const uint MOST_STEPS = 256u;
const uint INSTANCE_TRIANGLES = 0u;
const uint INSTANCE_SPHERES = 1u;
const uint INSTANCE_COPIES = 2u;
const uint BVH_STACK = 32u;

// Corners of a triangle in world space, counter-clockwise seen from its front.
struct Triangle {
    vec3 a; // First corner.
    vec3 b; // Second corner, weight `hit.uv.x`.
    vec3 c; // Third corner, weight `hit.uv.y`.
};

// What shading needs of a triangle.
struct TriangleAttributes {
    vec3 na; // Unit shading normal at the first corner.
    vec3 nb; // Unit shading normal at the second corner.
    vec3 nc; // Unit shading normal at the third corner.
    vec2 ta; // Texture coordinates at the first corner.
    vec2 tb; // Texture coordinates at the second corner.
    vec2 tc; // Texture coordinates at the third corner.
    uint material; // Index into `materials`.
    uint emitter; // Index into `emitters`, or NONE.
};

// MikkTSpace tangents of a triangle: a unit vector and in `w` the sign of the bitangent.
struct Tangents {
    vec4 a; // At the first corner.
    vec4 b; // At the second corner.
    vec4 c; // At the third corner.
};

// An analytic sphere; its front is the outside.
struct Sphere {
    vec3 center; // Centre in world space.
    float radius; // Radius, positive.
    uint material; // Index into `materials`.
    uint emitter; // Index into `emitters`, or NONE.
};

// A material, as `scene::compile::Material`.
struct Material {
    vec3 base_color; // Base colour, linear.
    vec3 emission; // Emitted radiance of the front side.
    uint model; // MODEL_DISNEY and so on.
    float roughness; // Perceptual roughness.
    float metallic; // 0 dielectric to 1 metal.
    float opacity; // 1 opaque to 0 refractive.
    float ior; // Index of refraction relative to the outside.
    float subsurface; // Part of the flatter diffuse lobe.
    float specular_tint; // Hue in the dielectric's reflectance at normal incidence.
    float anisotropic; // Stretch of highlights.
    vec3 anisotropic_direction; // World-space direction of the stretch; zero is the direction of growing u.
    float sheen; // Sheen.
    float sheen_tint; // Hue of the sheen.
    float clearcoat; // Clear coat.
    float clearcoat_gloss; // Gloss of the clear coat.
    float smooth_below; // Roughness below which specular lobes are Dirac lobes.
    float normal_strength; // Factor on the slope of the normal map.
    float bump_height; // How far 1 in the bump map stands out, in scene units.
    float mask_threshold; // Mask values below this are holes.
    uint mask_mode; // MASK_THRESHOLD or MASK_BLEND.
    uint shadow_terminator; // 1 where paths leave opaque triangles from the surface that their normals suggest, else 0.
    uint base_color_texture; // Texture that multiplies `base_color`, or NONE.
    uint emission_texture; // Texture that multiplies `emission`, or NONE.
    uint mask_texture; // Texture whose red channel is the mask, or NONE.
    uint roughness_texture; // Texture whose red channel replaces `roughness`, or NONE.
    uint metallic_texture; // Texture whose red channel replaces `metallic`, or NONE.
    uint opacity_texture; // Texture whose red channel replaces `opacity`, or NONE.
    uint anisotropic_texture; // Texture of directions in the tangent frame, or NONE.
    uint normal_texture; // Normal map, or NONE.
    uint bump_texture; // Texture whose red channel is a height, or NONE.
    float tiling_scale; // Factor from texture coordinates to places in the textures.
    vec2 tiling_offset; // Offset of the same, in repeats.
    uint emitter_reflects; // 1 where the surface of a light also reflects, else 0.
    vec3 specular; // Factor on what an interface reflects.
    vec3 eta; // Real part of a metal's index by channel.
    vec3 k; // Imaginary part of a metal's index by channel.
    uint distribution; // DISTRIBUTION_GGX or DISTRIBUTION_BECKMANN.
    uint thin; // 1 where a dielectric is a thin pane, else 0.
    uint nonlinear; // 1 where light that plastic reflects back inside takes on its colour each time, else 0.
    float internal_reflectance; // Part of diffuse light that is reflected back at the inside of plastic.
    uvec2 parts; // First row in `material_parts` of a composed or delayed material, and how many; none for a plain one.
};

// A part of a composed or delayed material.
struct MaterialPart {
    float upto; // The sum of the weights up to this part; exactly 1 for the last one.
    uint material; // Index into `materials`.
    uvec2 profiles; // First row in `delay_profiles`, and how many: their delays add up.
};

// A profile in time: each of its one or two parameters is `offset + value * texture`.
struct DelayProfile {
    uint kind; // DELAY_NONE and so on.
    vec2 value; // What textures multiply.
    vec2 offset; // What is added.
    uvec2 textures; // Textures whose red channel counts, or NONE.
    float tiling_scale; // Factor from texture coordinates to places in the textures.
    vec2 tiling_offset; // Offset of the same, in repeats.
    uvec2 knots; // First row in `knots` of a table, and how many.
};

// A point of the density of a table, as words of double precision, low word first.
struct Knot {
    uvec2 x; // Delay in scene units.
    uvec2 density; // Density in 1 / scene unit.
    uvec2 below; // Probability of everything below.
};

// A texture: texels `[y][x]` from `texel_at(first)`, linear, origin top-left.
struct Texture {
    uint first; // Index of the first texel.
    uint width; // Columns.
    uint height; // Rows.
    uvec2 wrap; // What is beyond the edges along u and v: WRAP_REPEAT and so on.
    uint second; // 1 where the second set of texture coordinates is meant, else 0.
    uint moved; // 1 where coordinates are moved by the three below, else 0.
    vec2 map_u; // Where the map takes growing u.
    vec2 map_v; // Where the map takes growing v.
    vec2 map_origin; // Where the map takes (0, 0).
};

// One emissive primitive.
struct Emitter {
    uint primitive; // Primitive id: triangles first, spheres after them.
    uint instance; // The copy of a mesh that it belongs to, or NONE.
    float area; // Area in square scene units.
};

// Where a copy of a mesh stands: `scene::compile::Instance`. Words of doubles, low one first.
struct Place {
    uvec2 xx; // What the mesh's x axis is in the world, its x.
    uvec2 xy; // Its y.
    uvec2 xz; // Its z.
    uvec2 yx; // What the mesh's y axis is in the world, its x.
    uvec2 yy; // Its y.
    uvec2 yz; // Its z.
    uvec2 zx; // What the mesh's z axis is in the world, its x.
    uvec2 zy; // Its y.
    uvec2 zz; // Its z.
    uvec2 tx; // Where the mesh's origin is in the world, its x.
    uvec2 ty; // Its y.
    uvec2 tz; // Its z.
    vec3 normal_x; // From the mesh's normals to the world's, first column.
    vec3 normal_y; // Second column.
    vec3 normal_z; // Third column.
    uint start; // Row in `triangles` of the mesh's first triangle.
    uint materials; // First row in `place_materials`.
    uint emitters; // Row in `emitters` of the first of its triangles that shine.
    uint first; // The number of its first triangle where nothing is shared.
};

// How rays enter the space of a copy's mesh: `render::entrance::Entrance`.
struct Entrance {
    vec3 inverse_x; // From directions of the world to those of the mesh, first column.
    vec3 inverse_y; // Second column.
    vec3 inverse_z; // Third column.
    vec3 pivot_world; // The middle of the mesh's box in the world.
    vec3 pivot_own; // The same in the mesh's space.
    uint root; // The first node of the mesh's tree.
};

// A point that shines in all directions or into a cone.
struct PointLight {
    vec3 position; // Position in world space.
    vec3 intensity; // Radiant intensity along the axis.
    vec3 axis; // Axis of the cone, a unit vector.
    float beam; // Angle in radians up to which the intensity is whole.
    float cutoff; // Angle in radians from which on there is none.
    float beam_height; // One minus the cosine of `beam`.
    float cutoff_height; // One minus the cosine of `cutoff`; 2 is all directions.
    uint is_smooth; // 1 where it falls off with the square of what is linear in the cosine, 0 where linearly with the angle.
};

// Parallel light.
struct DirectionalLight {
    vec3 direction; // Unit direction in which the light travels.
    vec3 irradiance; // Irradiance on a surface that faces the light.
};

// A light as `transport::light::Lights` chooses it: a column of its alias table, and the light's own probability.
struct LightChoice {
    uint own; // How many of the column's steps mean its own light.
    uint above; // The light that the others mean.
    float pmf; // Probability of the light with this index; 0 for columns that have no light.
};

// A row of an environment's map, and its cumulative probability.
struct EnvironmentRow {
    float marginal; // Cumulative probability after this row.
    float upper; // Cosine of the polar angle at the upper edge.
    float step; // Cosine at the lower edge minus cosine at the upper one: negative.
    float upper_rest; // One minus the absolute cosine at the upper edge, exact near the poles.
    float density; // Columns over the solid angle of the row: density per solid angle of a cell is its probability times this.
};

// Everything that stays the same from sample to sample: camera, limits, settings, lights.
struct Job {
    vec3 camera_position; // Position of the camera in world space.
    vec3 camera_right; // Unit vector to the picture's right.
    vec3 camera_up; // Unit vector to the picture's top.
    vec3 camera_forward; // Unit vector along the optical axis.
    vec2 camera_half; // Half extent of the picture at distance 1, horizontally and vertically.
    uvec2 resolution; // Width and height in pixels.
    float lens_radius; // Radius of the lens; 0 is a pinhole.
    float focus_distance; // Distance of the plane of focus.
    uint filter_kind; // FILTER_BOX and so on.
    float filter_radius; // Half width of the filter in pixels.
    uint max_depth; // Greatest number of path edges.
    uint rr_start; // First path edge after which roulette may end a path, or NONE.
    uint mis; // MIS_POWER, MIS_BALANCE, or NONE.
    uint all_lights; // 1 where every light is asked at every vertex, else 0.
    uvec2 one_strategy; // The strategy (s, t) that is kept or left out; NONE, NONE for all.
    uint keep_strategy; // 1 where that strategy is kept, 0 where it is left out.
    uint sampler_kind; // SAMPLER_INDEPENDENT or SAMPLER_SOBOL.
    uvec2 seed; // Low and high word of the seed.
    uint triangle_count; // Number of triangles: primitive ids from here on are spheres.
    uint sphere_count; // Number of spheres.
    uint has_tangents; // 1 if `tangents` has a row for every triangle, else 0.
    uint first_color; // First of three texels for each triangle that multiply base colours at its corners, or NONE.
    uint first_second_uv; // First of three texels for each triangle that hold its second texture coordinates, or NONE.
    uint light_count; // Number of lights.
    uvec3 light_first; // Index of the first point, direction, environment among the lights.
    uint alias_shift; // Binary logarithm of the steps of a column in `light_choices`; NONE if nothing can be chosen.
    vec3 ball_center; // Centre of the ball around all surfaces.
    float ball_radius; // Its radius; 0 without surfaces.
    uint has_environment; // 1 if there is an environment, else 0.
    uint environment_texture; // Texture of the environment, or NONE for the same colour from everywhere.
    vec3 environment_radiance; // Colour, or factor on the texture.
    vec2 environment_turn; // Sine and cosine of its rotation about +y.
    uint film_count; // Films of layers for each pixel.
    uint light_films; // Those of them that are made of contributions; they stand first.
    uint splat_films; // Those of them on which splats land.
    uint layer_depth; // The first film of the layer `depth`, or NONE.
    uint layer_strategies; // The first film of the layer `strategies`, or NONE.
    uint layer_bounces; // The film of the layer `bounces`, or NONE.
    uint layer_rays; // The film of the layer `rays`, or NONE.
    uint layer_albedo; // The film of the layer `albedo`, or NONE.
    uint layer_normal; // The film of the layer `normal`, or NONE.
    uint layer_distance; // The film of the layer `distance`, or NONE.
    uvec2 time_start; // Where the first bin of the time axis begins, in scene units: a double, low word first.
    uvec2 time_bin; // Width of a bin, likewise.
    uint time_bins; // Number of bins; 0 without a time axis.
    uint time_filter; // TIME_FILTER_NONE and so on.
    uvec2 time_radius; // Half width of the box or sigma of the Gaussian in bins: a double, low word first.
    uint time_camera; // 1 where the segment between the camera and what it sees first counts, else 0.
    float time_medium; // Index of refraction of the medium around the camera.
    uint time_emission; // Row in `delay_profiles` of the pulse of lights, or NONE where they emit at once.
};

// Sums of a pixel's own samples. Each sum is `sum + rest`, where `rest` gathers what rounding took.
struct Sums {
    vec3 sum; // Sum.
    vec3 sum_rest; // What rounding took from it.
    vec3 sum2; // Sum of squares.
    vec3 sum2_rest; // What rounding took from it.
};

// Sums of a pixel's own samples in one slot of its time axis.
struct TimeSums {
    vec3 sum; // Sum.
    vec3 sum_rest; // What rounding took from it.
    vec3 square; // Sum of squares.
};

// What else a pixel's samples leave.
struct Invalid {
    uint count; // How many of its samples and of their splats were refused.
    uvec2 first; // Low and high word of the index of the first such sample.
};

// What the dispatches of one submission count.
struct Counters {
    uvec2 rays; // Low and high word of the number of rays.
    uint invalid; // Samples and splats that were refused.
};

// A step of a sample, as `render::paths::Step`.
struct PathStep {
    uint kind; // STEP_CLOSEST, STEP_SHADOW or STEP_LIGHT; 0 where there is none.
    uint met; // The primitive that was met, or NONE; of a shadow ray 1 if it was blocked, else 0.
    vec3 origin; // Where the ray starts.
    vec3 dir; // Where it goes.
    float t_max; // How far it is followed.
    float t; // How far it came.
    vec2 uv; // Barycentric weights of what it met.
    uvec2 pixel; // Column and row that light is for.
    vec3 value; // The light.
    vec3 unweighted; // The same without its weight.
    uint light_vertices; // Vertices found from the light.
    uint camera_vertices; // Vertices found from the camera.
    float optical_length; // When the light arrives, as an optical length; 0 without a time axis.
};

// Which samples a dispatch adds, as push constants.
struct Wave {
    uvec2 first_sample; // Low and high word of the first sample's index.
    uint samples; // How many samples of every pixel.
    uint first_row; // The first row of pixels.
    uint rows; // The number of rows.
};
