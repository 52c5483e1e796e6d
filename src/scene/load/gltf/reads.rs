//! What is read of a glTF.

use crate::scene::load::Reads;

/// One row for each element or key; `docs/formats.md` is written from it.
pub(in crate::scene::load) const READS: &[Reads] = &[
    Reads {
        name: "`scenes`, `scene`",
        read: "the default scene, else the first; without any, all nodes that lie in no other",
        noted: "",
    },
    Reads {
        name: "`nodes`",
        read: "hierarchies: `matrix`, or `translation`, `rotation`, `scale`; nodes of one mesh share it",
        noted: "",
    },
    Reads { name: "`animations`, `skins`", read: "", noted: "everything stands as its nodes say" },
    Reads {
        name: "`meshes`",
        read: "`primitives` of triangles, strips and fans",
        noted: "points and lines are left out",
    },
    Reads { name: "`POSITION`, `NORMAL`", read: "positions; normals, without which faces are flat", noted: "" },
    Reads {
        name: "texture coordinates",
        read: "of each material the sets of two of its textures: of the normal map, else of the first one, and of the first with another",
        noted: "a third set",
    },
    Reads {
        name: "`COLOR_0`",
        read: "colours of vertices, linear: they multiply the base colour",
        noted: "their alpha",
    },
    Reads { name: "`COLOR_1`, `JOINTS_0`", read: "", noted: "not read" },
    Reads { name: "`targets`", read: "", noted: "morph targets are not read" },
    Reads { name: "`KHR_draco_mesh_compression`", read: "", noted: "an error" },
    Reads {
        name: "`accessors`",
        read: "floats and integers, normalised, quantised, interleaved by `byteStride`, and `sparse` ones",
        noted: "",
    },
    Reads {
        name: "`buffers`, `images`",
        read: "files beside the document, base64 in it, the binary chunk, and a `bufferView`",
        noted: "",
    },
    Reads {
        name: "`cameras`",
        read: "the first `perspective` one: place and `yfov`",
        noted: "further ones, orthographic ones",
    },
    Reads {
        name: "`KHR_lights_punctual`",
        read: "`point`, `spot` and `directional`, intensities as they are, without photometric factors; without lamps, white light from everywhere",
        noted: "other types",
    },
    Reads { name: "`baseColorFactor`, `baseColorTexture`", read: "base colour", noted: "" },
    Reads {
        name: "`metallicFactor`, `roughnessFactor`, `metallicRoughnessTexture`",
        read: "metallic and roughness; green and blue of the texture times the factors",
        noted: "",
    },
    Reads { name: "`normalTexture`", read: "normal map with its `scale`", noted: "a negative scale" },
    Reads {
        name: "`emissiveFactor`, `emissiveTexture`",
        read: "emission; a picture that shines is no lamp, so that white light is added",
        noted: "",
    },
    Reads { name: "`KHR_materials_emissive_strength`", read: "factor on the emission", noted: "" },
    Reads { name: "`alphaMode`, `alphaCutoff`", read: "MASK as a threshold, BLEND as a probability", noted: "" },
    Reads { name: "`KHR_materials_ior`", read: "index of refraction", noted: "" },
    Reads {
        name: "`KHR_materials_transmission`",
        read: "`transmissionFactor` and `transmissionTexture`: 1 - opacity",
        noted: "",
    },
    Reads {
        name: "`KHR_materials_specular`",
        read: "`specularFactor` as the index of opaque materials",
        noted: "its colour and textures",
    },
    Reads {
        name: "`KHR_materials_clearcoat`",
        read: "`clearcoatFactor`, a quarter as strong, and `clearcoatRoughnessFactor`",
        noted: "its strength, its textures",
    },
    Reads {
        name: "`KHR_materials_sheen`",
        read: "`sheenColorFactor`, the greatest channel, in Burley's form",
        noted: "its colour, roughness and textures",
    },
    Reads {
        name: "`KHR_materials_anisotropy`",
        read: "`anisotropyStrength`, in Burley's form, along growing u",
        noted: "its texture and direction",
    },
    Reads {
        name: "`KHR_texture_transform`",
        read: "`offset`, `rotation`, `scale` and `texCoord` of every texture",
        noted: "textures beside one of scale 0",
    },
    Reads {
        name: "`samplers`",
        read: "`wrapS` and `wrapT`: textures repeat, are mirrored, or are clamped; all are bilinear",
        noted: "`NEAREST`",
    },
    Reads {
        name: "all other extensions",
        read: "",
        noted: "named; that of volumes too: glass has no absorption here. `extensionsRequired` but for materials are errors",
    },
];
