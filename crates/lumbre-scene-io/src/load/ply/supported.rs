//! Supported elements of PLY.

use crate::load::SupportedElement;

/// One row for each element or property, from which `docs/reference/formats.md` is generated.
pub(in crate::load) const SUPPORTED: &[SupportedElement] = &[
    SupportedElement {
        name: "`ascii`, `binary_little_endian`, `binary_big_endian`",
        support: "all three encodings",
        limits: "",
    },
    SupportedElement {
        name: "`x`, `y`, `z`",
        support: "positions",
        limits: "",
    },
    SupportedElement {
        name: "`nx`, `ny`, `nz`",
        support: "normals, which determine the front",
        limits: "",
    },
    SupportedElement {
        name: "`u`, `v`, `s`, `t`, `texture_u`, `texture_v`",
        support: "texture coordinates, which start at the bottom left",
        limits: "",
    },
    SupportedElement {
        name: "`red`, `green`, `blue`, `color_0`, `color_1`, `color_2`",
        support: "vertex colours, which multiply the base colour: integers in sRGB, floats linear",
        limits: "floats above 2 are divided by 255, with a note",
    },
    SupportedElement {
        name: "`TextureFile`",
        support: "an image as base colour, in a comment by the convention of MeshLab",
        limits: "further images, and one without texture coordinates of vertices, are noted; a missing \
                 one is refused, or noted with `--lenient`",
    },
    SupportedElement {
        name: "`vertex_indices`, `vertex_index`",
        support: "faces, concave ones included",
        limits: "polygons whose edges intersect are noted",
    },
    SupportedElement {
        name: "`confidence`, `intensity`, `quality`, `flags`, `face_indices`",
        support: "none: they say nothing about the surface",
        limits: "",
    },
    SupportedElement {
        name: "all other elements and properties",
        support: "",
        limits: "noted by name, such as colours and texture coordinates of faces",
    },
];
