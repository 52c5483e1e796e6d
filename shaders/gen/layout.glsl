// Generated from crates/lumbre-vulkan/src/layout/ by the test
// `the_committed_layouts_are_those_of_the_code`; do not edit.

const uint NONE = 4294967295u;
const uint CAMERA_PERSPECTIVE = 0u;
const uint CAMERA_ORTHOGRAPHIC = 1u;
const uint CAMERA_SPHERICAL = 2u;
const uint MIS_POWER = 0u;
const uint MIS_BALANCE = 1u;
const uint MIS_UNIFORM = 2u;
const uint SAMPLER_INDEPENDENT = 0u;
const uint SAMPLER_SOBOL = 1u;
const uint SAMPLER_ZSOBOL = 2u;
const uint TIME_FILTER_NONE = 0u;
const uint TIME_FILTER_BOX = 1u;
const uint TIME_FILTER_GAUSS = 2u;
const uint STEP_CLOSEST = 1u;
const uint STEP_SHADOW = 2u;
const uint STEP_LIGHT = 3u;
const uint MAX_PATH_EVENTS = 256u;
const uint INSTANCE_TRIANGLES = 0u;
const uint INSTANCE_SPHERES = 1u;
const uint INSTANCE_MESHES = 2u;
const uint BVH_STACK = 32u;
const uint NOT_CONNECTIBLE = 2147483648u;
const uint LIGHT_PATHS_ROW = 1024u;
const uint LIST_BLOCK = 256u;
const uint LIST_STEP_PATHS = 0u;
const uint LIST_STEP_BLOCKS = 1u;
const uint LIST_STEP_VERTICES = 2u;
const uint MODEL_DISNEY = 0u;
const uint MODEL_LAMBERT = 1u;
const uint MODEL_CONDUCTOR = 2u;
const uint MODEL_PLASTIC = 3u;
const uint MODEL_DIELECTRIC = 4u;
const uint MODEL_TRANSLUCENT = 5u;
const uint MODEL_OREN_NAYAR = 6u;
const uint DISTRIBUTION_GGX = 0u;
const uint DISTRIBUTION_BECKMANN = 1u;
const uint FORMULAS_LUMBRE = 0u;
const uint FORMULAS_MITSUBA = 1u;
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
const uint DELAY_NONE = 0u;
const uint DELAY_CONSTANT = 1u;
const uint DELAY_EXPONENTIAL = 2u;
const uint DELAY_EPANECHNIKOV = 3u;
const uint DELAY_TABLE = 4u;

// Corners of a triangle in world space, counter-clockwise seen from its front.
struct Triangle {
    vec3 a; // Position of the first corner.
    vec3 b; // Position of the second corner, weight `hit.uv.x`.
    vec3 c; // Position of the third corner, weight `hit.uv.y`.
};

// Shading attributes of a triangle.
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
    vec4 a; // Tangent at the first corner.
    vec4 b; // Tangent at the second corner.
    vec4 c; // Tangent at the third corner.
};

// Analytic sphere; its front is the outside.
struct Sphere {
    vec3 center; // Centre in world space.
    float radius; // Radius of the sphere, positive.
    uint material; // Index into `materials`.
    uint emitter; // Index into `emitters`, or NONE.
};

// Material, as `scene::compile::Material`.
struct Material {
    vec3 base_color; // Base colour, linear.
    vec3 emission; // Emitted radiance of the front side.
    uint model; // MODEL_DISNEY and so on.
    float roughness; // Perceptual roughness of the surface.
    float metallic; // 0 dielectric to 1 metal.
    float opacity; // 1 opaque to 0 refractive.
    vec3 transmittance; // Share of the light that MODEL_TRANSLUCENT transmits.
    float ior; // Index of refraction relative to the outside.
    float subsurface; // Fraction of the flatter diffuse lobe.
    float specular_tint; // Hue in the dielectric's reflectance at normal incidence.
    float anisotropic; // Stretch of highlights.
    vec3 anisotropic_direction; // World-space direction of the stretch; zero is the direction of growing u.
    float sheen; // Strength of the sheen.
    float sheen_tint; // Hue of the sheen.
    float clearcoat; // Strength of the clear coat.
    float clearcoat_gloss; // Gloss of the clear coat.
    float smooth_below; // Roughness below which specular lobes are Dirac lobes.
    uint one_sided; // 1 if opaque lobes are missing at the back, else 0.
    float normal_strength; // Factor on the slope of the normal map.
    float bump_height; // Displacement of the value 1 in the bump map, in scene units.
    float mask_threshold; // Mask values below this are holes.
    uint mask_mode; // MASK_THRESHOLD or MASK_BLEND.
    uint shadow_terminator; // 1 if paths leave opaque triangles from the surface that their normals suggest, else 0.
    uint base_color_texture; // Texture that multiplies `base_color`, or NONE.
    uint emission_texture; // Texture that multiplies `emission`, or NONE.
    uint mask_texture; // Texture whose red channel is the mask, or NONE.
    uint roughness_texture; // Texture whose red channel replaces `roughness`, or NONE.
    uint metallic_texture; // Texture whose red channel replaces `metallic`, or NONE.
    uint opacity_texture; // Texture whose red channel replaces `opacity`, or NONE.
    uint transmittance_texture; // Texture that multiplies `transmittance`, or NONE.
    uint anisotropic_texture; // Texture of directions in the tangent frame, or NONE.
    uint normal_texture; // Normal map, or NONE.
    uint bump_texture; // Texture whose red channel is a height, or NONE.
    float tiling_scale; // Factor from texture coordinates to positions in the textures.
    vec2 tiling_offset; // Offset of these positions, in repeats.
    uint emitter_reflects; // 1 if the surface of a light also reflects, else 0.
    vec3 specular; // Factor on the light that an interface reflects.
    vec3 eta; // Real part of a metal's index by channel.
    vec3 k; // Imaginary part of a metal's index by channel.
    uint distribution; // DISTRIBUTION_GGX or DISTRIBUTION_BECKMANN.
    uint thin; // 1 if a dielectric is a thin pane, else 0.
    uint formulas; // FORMULAS_LUMBRE or FORMULAS_MITSUBA.
    uint alpha_texels; // 1 if texels of the roughness texture are alpha, the square of roughness, else 0.
    uint rough_body; // 1 if light passes the interface of plastic as its microfacets let it, else 0.
    vec4 transmittance_grazing; // Transmittance of the microfacets at cosine 0, and its slopes up to the fourth knot.
    vec4 transmittance_middle; // Its slopes up to the eighth knot.
    vec4 transmittance_steep; // Its slopes up to the last knot.
    uint nonlinear; // 1 if light that is reflected back inside plastic is tinted each time, else 0.
    float internal_reflectance; // Fraction of diffuse light that is reflected back at the inside of plastic.
    uvec2 parts; // First row in `material_parts` of a composed or delayed material and number of rows; none for others.
};

// Component of a composed or delayed material.
struct MaterialPart {
    float upto; // Sum of the weights up to this component; exactly 1 for the last one.
    uint material; // Index into `materials`.
    uvec2 profiles; // First row in `delay_profiles` and number of rows: their delays add up.
};

// Delay profile: each of its one or two parameters is `offset + value * texture`.
struct DelayProfile {
    uint kind; // DELAY_NONE and so on.
    vec2 value; // Factors on the textures.
    vec2 offset; // Offsets that are added.
    uvec2 textures; // Textures whose red channel is used, or NONE.
    float tiling_scale; // Factor from texture coordinates to positions in the textures.
    vec2 tiling_offset; // Offset of these positions, in repeats.
    uvec2 knots; // First row in `knots` of a table and number of rows.
};

// Knot of a tabulated density, as words of double precision, low word first.
struct Knot {
    uvec2 x; // Delay in scene units.
    uvec2 density; // Density in 1 / scene unit.
    uvec2 below; // Probability of smaller delays.
};

// Texture: texels `[y][x]` from word `first` on, origin at the top left.
struct Texture {
    uint first; // Index of the first word of the texels.
    uint table; // If a texel is a word, of four bytes, the index of the first of 256 linear values that a byte means; NONE if a texel is three words, which are linear floats.
    uint width; // Width in texels.
    uint height; // Height in texels.
    uvec2 wrap; // Wrap mode along u and v: WRAP_REPEAT and so on.
    uint nearest; // 1 if the filter is `nearest`, 0 if it is bilinear.
    uint second; // 1 if the second set of texture coordinates is used, else 0.
    uint moved; // 1 if coordinates are transformed by the map below, else 0.
    vec2 map_u; // Image of the u axis under the map.
    vec2 map_v; // Image of the v axis under the map.
    vec2 map_origin; // Image of (0, 0) under the map.
};

// Emissive primitive of the scene.
struct Emitter {
    uint primitive; // Primitive index: triangles first, spheres after them.
    uint instance; // Instance of a mesh that it belongs to, or NONE.
    float area; // Area in square scene units.
};

// Placement of an instance of a mesh: `scene::compile::Instance`. Words of doubles, low one first.
struct Placement {
    uvec2 xx; // World-space image of the mesh's x axis: its x.
    uvec2 xy; // Its y coordinate.
    uvec2 xz; // Its z coordinate.
    uvec2 yx; // World-space image of the mesh's y axis: its x.
    uvec2 yy; // Its y coordinate.
    uvec2 yz; // Its z coordinate.
    uvec2 zx; // World-space image of the mesh's z axis: its x.
    uvec2 zy; // Its y coordinate.
    uvec2 zz; // Its z coordinate.
    uvec2 tx; // World-space position of the mesh's origin: its x.
    uvec2 ty; // Its y coordinate.
    uvec2 tz; // Its z coordinate.
    vec3 normal_x; // Maps the mesh's normals to world space: first column.
    vec3 normal_y; // Second column of the matrix.
    vec3 normal_z; // Third column of the matrix.
    uint start; // Row in `triangles` of the mesh's first triangle.
    uint materials; // First row in `place_materials`.
    uint emitters; // Row in `emitters` of its first emissive triangle.
    uint first; // Index of its first triangle in the flattened scene.
};

// Transform of rays into the space of an instance's mesh: `render::instance_transform::InstanceTransform`.
struct InstanceTransform {
    vec3 inverse_x; // Maps directions of the world to those of the mesh: first column.
    vec3 inverse_y; // Second column of the matrix.
    vec3 inverse_z; // Third column of the matrix.
    vec3 pivot_world; // Middle of the mesh's box in world space.
    vec3 pivot_own; // Middle of the mesh's box in the mesh's space.
    uint root; // First node of the mesh's tree.
};

// Point light that shines in all directions, into a cone, or as a map states.
struct PointLight {
    vec3 position; // Position in world space.
    vec3 intensity; // Radiant intensity along the axis.
    vec3 axis; // Axis of the cone, a unit vector.
    float beam; // Angle in radians up to which the intensity is full.
    float cutoff; // Angle in radians from which on the intensity is zero.
    float beam_height; // One minus the cosine of `beam`.
    float cutoff_height; // One minus the cosine of `cutoff`; 2 is all directions.
    uint is_smooth; // 1 if the intensity falls off with the square of a term linear in the cosine, 0 if linearly with the angle.
    uint map; // Texture that multiplies the intensity by direction, or NONE.
    vec2 turn; // Sine and cosine of the rotation about +y of a map of all directions.
    vec3 right; // Vector whose product with a direction, over the cosine to the axis, is 1 at the right edge of an image across the axis; zero for a map of all directions.
    vec3 up; // The same for the upper edge.
    uint is_even; // 1 if the intensity of an image is divided by the cube of the cosine to the axis.
};

// Directional light from infinity.
struct DirectionalLight {
    vec3 direction; // Unit direction in which the light travels.
    vec3 irradiance; // Irradiance on a surface that faces the light.
};

// Column of the alias table that `transport::light::Lights` selects lights with, and a light's probability.
struct LightChoice {
    uint own; // Number of the column's steps that select its own light.
    uint above; // Light that the other steps select.
    float pmf; // Probability of the light with this index; 0 for columns that have no light.
};

// Row of an environment map with its cumulative probability.
struct EnvironmentRow {
    float marginal; // Cumulative probability after this row.
    float upper; // Cosine of the polar angle at the upper edge.
    float step; // Cosine at the lower edge minus cosine at the upper one: negative.
    float upper_rest; // One minus the absolute cosine at the upper edge, exact near the poles.
    float density; // Number of columns divided by the solid angle of the row: the density of a cell per solid angle is its probability times this.
};

// Everything that is constant over the samples: camera, limits, settings, lights.
struct JobParams {
    vec3 camera_position; // Position of the camera in world space.
    vec3 camera_right; // Unit vector to the picture's right.
    vec3 camera_up; // Unit vector to the picture's top.
    vec3 camera_forward; // Unit vector along the optical axis.
    vec2 camera_half; // Half extent of the picture, horizontally and vertically: at distance 1; of an orthographic camera in scene units; of a spherical one in radians.
    vec2 camera_center; // Vector from the axis to the middle of the picture, in the unit of `camera_half`.
    uint camera_kind; // CAMERA_PERSPECTIVE and so on.
    uvec2 resolution; // Width and height in pixels.
    float lens_radius; // Radius of the lens; 0 is a pinhole.
    float focus_distance; // Distance of the plane of focus.
    uint filter_kind; // FILTER_BOX and so on.
    float filter_radius; // Half width of the filter in pixels.
    uint max_depth; // Maximum number of path edges.
    uint rr_start; // First path edge after which roulette may end a path, or NONE.
    uint mis; // MIS_POWER, MIS_BALANCE, or NONE.
    uvec2 one_strategy; // Strategy (s, t) that is selected or left out; NONE, NONE for all.
    uint keep_strategy; // 1 if only that strategy is used, 0 if it is left out.
    uint light_path_count; // Number of light subpaths of an iteration; 0 if samples share none.
    uint light_path_room; // Number of vertices for which each of them has room.
    uint subpath_room; // Number of vertices for which a sample has room, of all subpaths that it traces.
    uint subpath_slots; // Number of samples that have that room at the same time.
    uint connections; // Number of connections of a camera vertex with drawn light vertices.
    uint candidates; // Number of vertices that are drawn for each connection.
    uvec2 candidate_step; // Low and high word of 2^64 divided by that number, rounded down; 0 if it is 1.
    uvec2 seed; // Low and high word of the seed.
    float least_extent; // Least extent of primitives: see `offset_origin`.
    uint triangle_count; // Number of triangles: primitive indices from here on are spheres.
    uint sphere_count; // Number of spheres.
    uint has_tangents; // 1 if `tangents` has a row for every triangle, else 0.
    uint first_color; // First word of three texels of floats for each triangle that multiply base colours at its corners, or NONE.
    uint first_second_uv; // First word of three texels of floats for each triangle that hold its second texture coordinates, or NONE.
    uint light_count; // Number of lights.
    uvec3 light_first; // Indices of the first point light, directional light and environment among the lights.
    uint alias_shift; // Binary logarithm of the steps of a column in `light_choices`; NONE if there is nothing to select.
    vec3 ball_center; // Centre of the ball around all surfaces.
    float ball_radius; // Radius of that ball; 0 without surfaces.
    uint has_environment; // 1 if there is an environment, else 0.
    uint environment_texture; // Texture of the environment, or NONE if it is constant.
    vec3 environment_radiance; // Radiance, or factor on the texture.
    vec2 environment_turn; // Sine and cosine of its rotation about +y.
    uint film_count; // Number of layer films per pixel.
    uint light_films; // Number of them that are made of contributions; they come first.
    uint splat_films; // Number of them that receive splats.
    uint layer_depth; // First film of the layer `depth`, or NONE.
    uint layer_strategies; // First film of the layer `strategies`, or NONE.
    uint layer_bounces; // Film of the layer `bounces`, or NONE.
    uint layer_rays; // Film of the layer `rays`, or NONE.
    uint layer_albedo; // Film of the layer `albedo`, or NONE.
    uint layer_normal; // Film of the layer `normal`, or NONE.
    uint layer_distance; // Film of the layer `distance`, or NONE.
    uvec2 time_start; // Start of the first bin of the time axis, in scene units: a double, low word first.
    uvec2 time_bin; // Width of a bin, in scene units: a double, low word first.
    uint time_bins; // Number of bins; 0 without a time axis.
    uint time_filter; // TIME_FILTER_NONE and so on.
    uvec2 time_radius; // Half width of the box or sigma of the Gaussian in bins: a double, low word first.
    uint time_camera; // 1 if the first path segment from the camera counts, else 0.
    float time_medium; // Index of refraction of the medium around the camera.
    uint time_emission; // Row in `delay_profiles` of the emission profile of lights, or NONE if they emit instantaneously.
};

// Sums of a pixel's own samples. Each sum is `sum + rest`, where `rest` collects rounding errors.
struct SampleSums {
    vec3 sum; // Sum of the samples.
    vec3 sum_rest; // Its rounding error.
    vec3 sum2; // Sum of the squared samples.
    vec3 sum2_rest; // Its rounding error.
};

// Sums of a pixel's own samples in one slot of its time axis.
struct SlotSums {
    vec3 sum; // Sum of the samples.
    vec3 sum_rest; // Its rounding error.
    vec3 square; // Sum of the squared samples.
};

// Invalid samples of a pixel.
struct Invalid {
    uint count; // Number of its samples and of their splats that were refused.
    uvec2 first; // Low and high word of the index of the first such sample.
};

// Result of a sample that is an invocation of its own, until it is added to its pixel.
struct SampleValue {
    vec3 value; // Light for its own pixel.
    uint refused; // Number of its contributions that were refused.
    uint rays; // Number of its rays.
};

// Counters of the dispatches of one submission.
struct Counters {
    uvec2 rays; // Low and high word of the number of rays.
    uint invalid; // Number of samples and splats that were refused.
};

// Event of a sample, as `render::path_trace::PathEvent`.
struct PathStep {
    uint kind; // STEP_CLOSEST, STEP_SHADOW or STEP_LIGHT; 0 if there is none.
    uint met; // Primitive that was hit, or NONE; for a shadow ray 1 if it was occluded, else 0.
    vec3 origin; // Origin of the ray.
    vec3 dir; // Direction of the ray.
    float t_max; // Distance up to which it is traced.
    float t; // Distance of the hit.
    vec2 uv; // Barycentric weights of the hit.
    uvec2 pixel; // Column and row of the pixel that receives light.
    vec3 value; // Contribution with its weight.
    vec3 unweighted; // Contribution without its weight.
    uint light_vertices; // Number of vertices of the light subpath.
    uint camera_vertices; // Number of vertices of the camera subpath.
    float optical_length; // Optical length of the path; 0 without a time axis.
};

// Parameters of a dispatch, as push constants. Of light subpaths it traces `samples` in all, whose random numbers are those of the pixel in column and row `first_row`.
struct WaveParams {
    uvec2 first_sample; // Low and high word of the first sample's index.
    uint samples; // Number of samples of every pixel.
    uint first_row; // First row of pixels.
    uint rows; // Number of rows of pixels.
    uint step; // Step of `light_list.comp`.
};

// A light subpath: its start, and its vertices.
struct LightPath {
    uint light; // Index of its light; NONE if there is no subpath.
    vec3 position; // Position of the start in world space.
    vec3 normal; // Unit normal there, or direction of the light.
    float extent; // Greatest absolute coordinate of the primitive.
    vec4 uv; // Texture coordinates of both sets.
    vec3 dir; // Unit direction of the first edge.
    vec3 radiance; // Radiance that the light emits there.
    uint vertices; // Number of vertices on surfaces.
    uint connectible; // Number of those that can be connected.
    uint before; // Number of those of the earlier subpaths of its block.
};

// A vertex of a subpath: the ray that hit the surface, and the hit. Everything that depends only on the scene is derived again when the vertex is connected.
struct SubpathVertex {
    vec3 origin; // Origin of the ray.
    vec3 dir; // Direction of the ray.
    float t; // Distance of the hit.
    uint primitive; // Primitive that was hit.
    uint instance; // Instance of a mesh, or NONE.
    vec2 uv; // Barycentric weights of the hit.
    uint material; // Row of the material, with NOT_CONNECTIBLE.
    float back; // Factor from a density per solid angle to the other side's density of the previous vertex.
    float hit_others; // Root of the MIS terms of the other strategies if a camera vertex emits; else 0.
    vec3 throughput; // Throughput of the subpath up to this vertex.
    float d_vcm; // Root of the first partial sum of MIS terms.
    float d_vc; // Root of the second partial sum of MIS terms.
};

// Optical length of a subpath up to a vertex.
struct SubpathLength {
    float path; // Length of all segments.
    float delays; // Delays of previous vertices.
    float delay; // Delay of this vertex.
    float index; // Index of the last medium.
};

// Start of the list of vertices that can be connected.
struct LightListHead {
    uint count; // Number of vertices in the list.
    float connecting; // Expected number of connections with each vertex of a light subpath, for weights.
};
