//! What is read of a PLY.

use crate::scene::load::Reads;

/// One row for each element or key; `docs/formats.md` is written from it.
pub(in crate::scene::load) const READS: &[Reads] = &[
    Reads { name: "`ascii`, `binary_little_endian`, `binary_big_endian`", read: "all three encodings", noted: "" },
    Reads { name: "`x`, `y`, `z`", read: "positions", noted: "" },
    Reads { name: "`nx`, `ny`, `nz`", read: "normals, which decide the front", noted: "" },
    Reads {
        name: "`u`, `v`, `s`, `t`, `texture_u`, `texture_v`",
        read: "texture coordinates, from the bottom left",
        noted: "",
    },
    Reads {
        name: "`red`, `green`, `blue`",
        read: "colours of vertices, which multiply the base colour: integers in sRGB, floats linear",
        noted: "",
    },
    Reads { name: "`vertex_indices`, `vertex_index`", read: "faces, cut as fans", noted: "" },
    Reads { name: "all other elements and properties", read: "stepped over", noted: "" },
];
