// The input data of all shaders: one descriptor set for all integrators and backends. The structs
// are generated from crates/lumbre-vulkan/src/layout/; crates/lumbre-vulkan/src/memory/upload.rs fills the
// buffers. All blocks use scalar layout, so an array of vec3 has a stride of 12 bytes. An empty
// array is bound with one row of zeros.
#ifndef SCENE_GLSL
#define SCENE_GLSL

#extension GL_EXT_scalar_block_layout : require

#include "gen/layout.glsl"
#include "gen/specialization.glsl"

layout(set = 0, binding = 0, scalar) uniform JobBlock { JobParams job; };
layout(set = 0, binding = 1, scalar) restrict readonly buffer Triangles { Triangle triangles[]; };
layout(set = 0, binding = 2, scalar) restrict readonly buffer Attributes {
    TriangleAttributes attributes[];
};
layout(set = 0, binding = 3, scalar) restrict readonly buffer TangentRows { Tangents tangents[]; };
layout(set = 0, binding = 4, scalar) restrict readonly buffer Spheres { Sphere spheres[]; };
layout(set = 0, binding = 5, scalar) restrict readonly buffer Materials { Material materials[]; };
layout(set = 0, binding = 6, scalar) restrict readonly buffer Textures { Texture textures[]; };
layout(set = 0, binding = 7, scalar) restrict readonly buffer Texels { uint texels[]; };
#ifdef EXTENDED
// Texels that exceed the maximum size of a buffer are stored in blocks of 2^TEXEL_SHIFT words, whose
// addresses are bound. Switching between bound blocks would add a branch for every texel, which is
// expensive on devices and in compilation.
#extension GL_EXT_buffer_reference_uvec2 : require
layout(buffer_reference, scalar, buffer_reference_align = 4) restrict readonly buffer TexelBlock {
    uint words[];
};
layout(set = 0, binding = 7, scalar) restrict readonly buffer TexelBlocks { uvec2 texel_blocks[]; };
#endif

// Returns the word of texels with this index, in one buffer or in blocks.
uint texel_word(uint index) {
#ifdef EXTENDED
    if (TEXEL_SHIFT != NONE) {
        uint word = index & ((1u << TEXEL_SHIFT) - 1u);
        return TexelBlock(texel_blocks[index >> TEXEL_SHIFT]).words[word];
    }
#endif
    return texels[index];
}

// Returns texel number `i` of those of floats from word `first` on.
vec3 float_texel(uint first, uint i) {
    uint word = first + 3u * i;
    return uintBitsToFloat(
        uvec3(texel_word(word), texel_word(word + 1u), texel_word(word + 2u))
    );
}

// Returns texel number `i` of those of bytes from word `first` on, by the table of their values from
// word `table` on.
vec3 byte_texel(uint first, uint i, uint table) {
    uint bytes = texel_word(first + i);
    uvec3 at = table + ((uvec3(bytes) >> uvec3(0u, 8u, 16u)) & 255u);
    return uintBitsToFloat(uvec3(texel_word(at.x), texel_word(at.y), texel_word(at.z)));
}

// Returns texel number `i` of a texture.
vec3 texture_texel(Texture t, uint i) {
    if (BYTE_TEXELS && (!FLOAT_TEXELS || t.table != NONE)) {
        return byte_texel(t.first, i, t.table);
    }
    return float_texel(t.first, i);
}

layout(set = 0, binding = 8, scalar) restrict readonly buffer Emitters { Emitter emitters[]; };
layout(set = 0, binding = 9, scalar) restrict readonly buffer Points { PointLight points[]; };
layout(set = 0, binding = 10, scalar) restrict readonly buffer Directionals {
    DirectionalLight directionals[];
};
// Instances of meshes: their transforms, and their material rows.
layout(set = 0, binding = 11, scalar) restrict readonly buffer Places { Placement places[]; };
layout(set = 0, binding = 12, scalar) restrict readonly buffer PlaceMaterials {
    uint place_materials[];
};

// The following buffers belong to the job.
layout(set = 0, binding = 13, scalar) restrict readonly buffer LightChoices {
    LightChoice light_choices[];
};
layout(set = 0, binding = 14, scalar) restrict readonly buffer EnvironmentRows {
    EnvironmentRow environment_rows[];
};
// Cumulative probabilities of the environment's cells, [row][column].
layout(set = 0, binding = 15, scalar) restrict readonly buffer EnvironmentCells {
    float environment_cells[];
};
// For every film of layers its index among those that receive splats, or NONE.
layout(set = 0, binding = 16, scalar) restrict readonly buffer SplatSlots { uint splat_slots[]; };

// Composed and delayed materials: all parts, the profiles of all parts, and the knots of tables.
layout(set = 0, binding = 17, scalar) restrict readonly buffer MaterialParts {
    MaterialPart material_parts[];
};
layout(set = 0, binding = 18, scalar) restrict readonly buffer DelayProfiles {
    DelayProfile delay_profiles[];
};
layout(set = 0, binding = 19, scalar) restrict readonly buffer Knots { Knot knots[]; };

// Texture coordinates of a point: the first set, and the second one with SECOND_UVS.
#define Uv vec4

// Returns the texture coordinates of a point with only one set, which also serves as the second.
Uv uv_of(vec2 uv) {
    return uv.xyxy;
}

#endif
