// Everything that shaders read: one descriptor set for all techniques and backends. The structs are made from
// src/render/vulkan/layout/; src/render/vulkan/upload.rs fills the buffers. Scalar block layout everywhere, so that an
// array of vec3 has a stride of 12 bytes. An array without rows is bound with one row of zeros.
#ifndef SCENE_GLSL
#define SCENE_GLSL

#extension GL_EXT_scalar_block_layout : require

#include "gen/layout.glsl"

layout(set = 0, binding = 0, scalar) restrict readonly buffer JobBlock { Job job; };
layout(set = 0, binding = 1, scalar) restrict readonly buffer Triangles { Triangle triangles[]; };
layout(set = 0, binding = 2, scalar) restrict readonly buffer Attributes { TriangleAttributes attributes[]; };
layout(set = 0, binding = 3, scalar) restrict readonly buffer TangentRows { Tangents tangents[]; };
layout(set = 0, binding = 4, scalar) restrict readonly buffer Spheres { Sphere spheres[]; };
layout(set = 0, binding = 5, scalar) restrict readonly buffer Materials { Material materials[]; };
layout(set = 0, binding = 6, scalar) restrict readonly buffer Textures { Texture textures[]; };
#ifdef TEXEL_SHIFT
// Texels that are more than one buffer may hold lie in blocks of 2^TEXEL_SHIFT, whose addresses are bound. A switch between
// bound blocks would be a branch for every texel, which devices pay for, and drivers that compile it.
#extension GL_EXT_buffer_reference_uvec2 : require
layout(buffer_reference, scalar, buffer_reference_align = 4) restrict readonly buffer TexelBlock { vec3 rows[]; };
layout(set = 0, binding = 7, scalar) restrict readonly buffer TexelBlocks { uvec2 texel_blocks[]; };
vec3 texel_at(uint index) {
    return TexelBlock(texel_blocks[index >> TEXEL_SHIFT]).rows[index & ((1u << TEXEL_SHIFT) - 1u)];
}
#else
layout(set = 0, binding = 7, scalar) restrict readonly buffer Texels { vec3 texels[]; };
vec3 texel_at(uint index) {
    return texels[index];
}
#endif
layout(set = 0, binding = 8, scalar) restrict readonly buffer Emitters { Emitter emitters[]; };
layout(set = 0, binding = 9, scalar) restrict readonly buffer Points { PointLight points[]; };
layout(set = 0, binding = 10, scalar) restrict readonly buffer Directionals { DirectionalLight directionals[]; };
// Copies of meshes: where each stands, and their rows of materials.
layout(set = 0, binding = 11, scalar) restrict readonly buffer Places { Place places[]; };
layout(set = 0, binding = 12, scalar) restrict readonly buffer PlaceMaterials { uint place_materials[]; };

// From here on it is the job's.
layout(set = 0, binding = 13, scalar) restrict readonly buffer LightChoices { LightChoice light_choices[]; };
layout(set = 0, binding = 14, scalar) restrict readonly buffer EnvironmentRows { EnvironmentRow environment_rows[]; };
// Cumulative probabilities of the environment's cells, [row][column].
layout(set = 0, binding = 15, scalar) restrict readonly buffer EnvironmentCells { float environment_cells[]; };
// Of every film of layers its place among those on which splats land, or NONE.
layout(set = 0, binding = 16, scalar) restrict readonly buffer SplatSlots { uint splat_slots[]; };

// Composed and delayed materials: the parts of all, the profiles of all parts, and the knots of tables.
layout(set = 0, binding = 17, scalar) restrict readonly buffer MaterialParts { MaterialPart material_parts[]; };
layout(set = 0, binding = 18, scalar) restrict readonly buffer DelayProfiles { DelayProfile delay_profiles[]; };
layout(set = 0, binding = 19, scalar) restrict readonly buffer Knots { Knot knots[]; };

// Texture coordinates of a point: those of the first set, and with SECOND_UVS, where some mesh has a second one, those.
#ifdef SECOND_UVS
#define Uv vec4
Uv uv_of(vec2 uv) {
    return uv.xyxy;
}
#else
#define Uv vec2
Uv uv_of(vec2 uv) {
    return uv;
}
#endif

#endif
