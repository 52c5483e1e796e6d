//! Supported elements of glTF.

use crate::load::SupportedElement;

/// One row for each element or key, from which `docs/reference/formats.md` is generated.
pub(in crate::load) const SUPPORTED: &[SupportedElement] = &[
    SupportedElement {
        name: "`scenes`, `scene`",
        support: "the default scene, else the first; without scenes, all root nodes",
        limits: "",
    },
    SupportedElement {
        name: "`nodes`",
        support: "hierarchies with `matrix`, or `translation`, `rotation`, `scale`; nodes may \
                  share a mesh",
        limits: "",
    },
    SupportedElement {
        name: "`animations`",
        support: "the pose at the scene option `time`, in seconds, of the animation with the name or \
                  index of the option `animation`, else of the first: `STEP`, `LINEAR` and \
                  `CUBICSPLINE` of `translation`, `rotation`, `scale` and `weights`. Before the first \
                  and after the last time their values hold",
        limits: "without `time` every node has its static transform, with a note; \
                 `KHR_animation_pointer` is noted",
    },
    SupportedElement {
        name: "`skins`, `JOINTS_0`",
        support: "vertices moved by the joints of `JOINTS_0`, `WEIGHTS_0` and further sets in the pose \
                  of the nodes, whatever the transform of the mesh's node",
        limits: "a skin whose joints are not in the scene is ignored, with a note",
    },
    SupportedElement {
        name: "`EXT_mesh_gpu_instancing`",
        support: "`TRANSLATION`, `ROTATION` and `SCALE`: instances that share the mesh of a node",
        limits: "other attributes are noted, except those whose names start with `_`; a mesh with a \
                 skin has one instance, with a note",
    },
    SupportedElement {
        name: "primitives without `material`",
        support: "a rough white metal, the material of an empty object",
        limits: "",
    },
    SupportedElement {
        name: "`meshes`",
        support: "`primitives` of triangles, strips and fans",
        limits: "points and lines are left out, with a note",
    },
    SupportedElement {
        name: "`POSITION`, `NORMAL`, `TANGENT`",
        support: "positions; normals, without which triangles are flat; tangents of normal maps and \
                  anisotropy, without which they are computed in MikkTSpace",
        limits: "",
    },
    SupportedElement {
        name: "texture coordinates",
        support: "two sets per material: that of the normal map or else of the first texture, and \
                  another one",
        limits: "a third set is noted",
    },
    SupportedElement {
        name: "`COLOR_0`",
        support: "linear vertex colours, which multiply the base colour",
        limits: "alpha is noted",
    },
    SupportedElement {
        name: "`COLOR_1`",
        support: "",
        limits: "noted",
    },
    SupportedElement {
        name: "`targets`",
        support: "morph targets: displacements of `POSITION`, `NORMAL` and `TANGENT` times the \
                  `weights` of the node or else of the mesh",
        limits: "displacements of other attributes are noted",
    },
    SupportedElement {
        name: "`EXT_meshopt_compression`, `KHR_meshopt_compression`",
        support: "buffer views in all modes, versions and filters",
        limits: "",
    },
    SupportedElement {
        name: "`KHR_draco_mesh_compression`",
        support: "meshes in the bit stream 2.2, with all their attributes",
        limits: "",
    },
    SupportedElement {
        name: "`accessors`",
        support: "floats and integers, normalised, quantised, interleaved by `byteStride`, and \
                  `sparse` ones",
        limits: "",
    },
    SupportedElement {
        name: "`buffers`, `images`",
        support: "files beside the document, embedded base64, the binary chunk, and a `bufferView`",
        limits: "",
    },
    SupportedElement {
        name: "`cameras`",
        support: "the first camera: position, orientation, and `yfov` or `ymag`",
        limits: "further cameras are noted, and an `xmag` that does not fit the picture",
    },
    SupportedElement {
        name: "`KHR_lights_punctual`",
        support: "`point`, `spot` and `directional` lights; intensities are radiometric values, \
                  without photometric factors. A document without lights gets a studio",
        limits: "other types are noted",
    },
    SupportedElement {
        name: "`baseColorFactor`, `baseColorTexture`",
        support: "base colour",
        limits: "",
    },
    SupportedElement {
        name: "`metallicFactor`, `roughnessFactor`, `metallicRoughnessTexture`",
        support: "metallic and roughness: the blue and green channels of the texture times the \
                  factors",
        limits: "",
    },
    SupportedElement {
        name: "`normalTexture`",
        support: "normal map with its `scale`",
        limits: "a negative scale disables the map, with a note",
    },
    SupportedElement {
        name: "`emissiveFactor`, `emissiveTexture`",
        support: "emission; emissive textures do not count as lights, so a studio is added",
        limits: "",
    },
    SupportedElement {
        name: "`KHR_materials_emissive_strength`",
        support: "factor on the emission",
        limits: "",
    },
    SupportedElement {
        name: "`alphaMode`, `alphaCutoff`",
        support: "MASK is a threshold, BLEND a probability",
        limits: "",
    },
    SupportedElement {
        name: "`KHR_materials_ior`",
        support: "index of refraction",
        limits: "",
    },
    SupportedElement {
        name: "`KHR_materials_transmission`",
        support: "`transmissionFactor` and `transmissionTexture`: thin walls of smooth glass, which do not \
                  bend light; glass that refracts with a `thicknessFactor` of \
                  `KHR_materials_volume`",
        limits: "the roughness of thin walls is noted; thin walls that emit and transmit partly \
                 refract, with a note",
    },
    SupportedElement {
        name: "`KHR_materials_diffuse_transmission`",
        support: "`diffuseTransmissionFactor`, `diffuseTransmissionColorFactor` and its texture, by \
                  the model `translucent`",
        limits: "the other lobes are left out, with a note; a texture of the factor is noted",
    },
    SupportedElement {
        name: "`KHR_materials_specular`",
        support: "`specularFactor`, as the index of refraction of opaque materials",
        limits: "colour and textures are noted",
    },
    SupportedElement {
        name: "`KHR_materials_clearcoat`",
        support: "`clearcoatFactor`, a quarter as strong as in glTF, and \
                  `clearcoatRoughnessFactor`",
        limits: "the strength is noted; textures are not supported",
    },
    SupportedElement {
        name: "`KHR_materials_sheen`",
        support: "`sheenColorFactor`: its greatest channel in Burley's model",
        limits: "colour, roughness and textures are noted",
    },
    SupportedElement {
        name: "`KHR_materials_anisotropy`",
        support: "`anisotropyStrength` in Burley's model, along increasing u",
        limits: "texture and rotation are noted",
    },
    SupportedElement {
        name: "`KHR_materials_unlit`",
        support: "a surface that emits its base colour and reflects nothing. Like an emissive texture \
                  it does not count as a light, so a studio is added",
        limits: "noted, since it lights other surfaces; vertex colours are noted",
    },
    SupportedElement {
        name: "`KHR_materials_pbrSpecularGlossiness`",
        support: "base colour, metallic and roughness by the conversion in Khronos' examples of the \
                  extension, texel by texel: `diffuseFactor`, `diffuseTexture`, `specularFactor`, \
                  `glossinessFactor`, `specularGlossinessTexture`",
        limits: "textures that are mapped differently are converted with the mean of the other, \
                 with a note",
    },
    SupportedElement {
        name: "`KHR_texture_transform`",
        support: "`offset`, `rotation`, `scale` and `texCoord` of every texture",
        limits: "a material whose first texture has scale 0 cannot have others mapped differently; \
                 noted",
    },
    SupportedElement {
        name: "`textures`, `EXT_texture_webp`",
        support: "`source`, and the one of the extension first",
        limits: "images that only an extension gives, such as `KHR_texture_basisu`, are errors, or \
                 with `--lenient` notes",
    },
    SupportedElement {
        name: "`samplers`",
        support: "`wrapS` and `wrapT`: repeat, mirror, clamp; `magFilter`: `NEAREST` takes the nearest texel, else bilinear",
        limits: "",
    },
    SupportedElement {
        name: "all other extensions",
        support: "",
        limits: "noted by name, volumes included: glass does not absorb. Required extensions \
                 (`extensionsRequired`) are refused, except material extensions",
    },
];
