//! What is read of an OBJ and of its material files.

use crate::scene::load::Reads;

/// One row for each element or key; `docs/formats.md` is written from it.
pub(in crate::scene::load) const READS: &[Reads] = &[
    Reads {
        name: "`v`, `vt`, `vn`",
        read: "positions, texture coordinates, normals",
        noted: "a fourth number and colours behind a position are passed over",
    },
    Reads {
        name: "`f`",
        read: "polygons, cut as fans; negative indices count backwards",
        noted: "concave polygons, corners without normals among others",
    },
    Reads {
        name: "`usemtl`, `mtllib`",
        read: "materials by name, from the files that the mesh names",
        noted: "names that are not there",
    },
    Reads { name: "`o`, `g`", read: "they end what `usemtl` said", noted: "" },
    Reads { name: "`l`, `p`", read: "", noted: "left out" },
    Reads { name: "`kd`, `map_kd`", read: "base colour", noted: "" },
    Reads { name: "`ke`, `map_ke`", read: "emission; a picture alone shines with radiance 1", noted: "" },
    Reads {
        name: "`ks`, `ns`",
        read: "roughness from the exponent, where the highlight is not black and `Pr` says nothing",
        noted: "",
    },
    Reads { name: "`ni`", read: "index of refraction", noted: "" },
    Reads { name: "`d`, `tr`, `illum`", read: "opacity; models 4, 6, 7 and 9 are glass", noted: "" },
    Reads { name: "`map_d`", read: "the mask", noted: "" },
    Reads { name: "`pr`, `map_pr`, `pm`, `map_pm`", read: "roughness and metallic", noted: "" },
    Reads { name: "`ps`, `pc`, `pcr`, `aniso`", read: "sheen, clear coat and its roughness, anisotropy", noted: "" },
    Reads { name: "`norm`", read: "the normal map, `-bm` its strength", noted: "" },
    Reads {
        name: "`bump`, `map_bump`",
        read: "the bump map, in scene units times `-bm`; the normal map, where the picture holds normals",
        noted: "heights without `-bm`, pictures of normals",
    },
    Reads {
        name: "`-s`, `-o`, `-clamp`",
        read: "factors, offset and edges of each map; equal factors and the offset of the first are the material's `tiling` and `uv_offset`",
        noted: "maps beside one of factor 0",
    },
    Reads {
        name: "`ka`, `tf`, `map_ka`, `map_ks`, `map_ns`",
        read: "nothing: their meaning is another model's",
        noted: "",
    },
    Reads { name: "all other statements", read: "", noted: "named, such as `disp`" },
];
