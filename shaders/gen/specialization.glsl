// Generated from crates/lumbre-vulkan/src/layout/specialization.rs by the test
// `the_committed_constants_are_those_of_the_code`; do not edit.

// SAMPLER_INDEPENDENT, SAMPLER_SOBOL, or SAMPLER_ZSOBOL plus the binary logarithm of a block.
layout(constant_id = 0) const uint SAMPLER_KIND = 0u;
// Bit mask of the material models of the scene.
layout(constant_id = 1) const uint MODELS = 127u;
// Whether the film has layers.
layout(constant_id = 2) const bool LAYERS = false;
// Whether the events of paths are recorded.
layout(constant_id = 3) const bool PATHS = false;
// Whether the scene has composed or delayed materials.
layout(constant_id = 4) const bool PARTS = false;
// Whether a mesh has a second set of texture coordinates.
layout(constant_id = 5) const bool SECOND_UVS = false;
// Binary logarithm of the number of words of a block of texels; NONE if all are in one buffer.
#ifdef EXTENDED
layout(constant_id = 6) const uint TEXEL_SHIFT = 4294967295u;
#else
const uint TEXEL_SHIFT = 4294967295u;
#endif
// Whether the film has a time axis.
#ifdef EXTENDED
layout(constant_id = 7) const bool TIMES = false;
#else
const bool TIMES = false;
#endif
// Whether the scene has instances of meshes.
#ifdef EXTENDED
layout(constant_id = 8) const bool INSTANCES = false;
#else
const bool INSTANCES = false;
#endif
// Whether a parameter of a material, such as its base colour, has a texture.
layout(constant_id = 9) const bool TEXTURES = true;
// Whether a texture has texels of bytes.
layout(constant_id = 10) const bool BYTE_TEXELS = true;
// Whether a texture has texels of floats.
layout(constant_id = 11) const bool FLOAT_TEXELS = true;
// Whether a material has a mask.
layout(constant_id = 12) const bool MASKS = true;
// Whether shading needs tangents: for a normal map or for stretched highlights.
layout(constant_id = 13) const bool TANGENTS = true;
// Whether a material has a bump map.
layout(constant_id = 14) const bool BUMPS = true;
// Whether a material has offsets against the shadow terminator.
layout(constant_id = 15) const bool TERMINATORS = true;
// Whether there are lights other than emissive surfaces.
layout(constant_id = 16) const bool OTHER_LIGHTS = true;
// Whether light is sampled from every light at every vertex, not from one.
layout(constant_id = 17) const bool ALL_LIGHTS = false;
// Whether each sample of a pixel is an invocation, and its value is added afterwards.
layout(constant_id = 18) const bool PARALLEL_SAMPLES = false;
// Whether an invocation starts its next sample as soon as a camera path has ended, whatever its neighbours do.
layout(constant_id = 19) const bool REGENERATED = false;
// Number of light vertices that are drawn for a connection.
layout(constant_id = 20) const uint CANDIDATES = 1u;
