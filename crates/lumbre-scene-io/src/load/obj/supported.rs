//! Supported elements of OBJ and of its material files.

use crate::load::SupportedElement;

/// One row for each statement, from which `docs/reference/formats.md` is generated.
pub(in crate::load) const SUPPORTED: &[SupportedElement] = &[
    SupportedElement {
        name: "`v`, `vt`, `vn`",
        support: "positions, texture coordinates, normals; after a position, a colour in sRGB, \
                  which multiplies the base colour",
        limits: "a fourth coordinate, the weight in free-form surfaces, is noted",
    },
    SupportedElement {
        name: "`f`",
        support: "polygons, concave ones included; negative indices count backwards",
        limits: "polygons whose edges intersect and faces with only some normals are noted",
    },
    SupportedElement {
        name: "`usemtl`, `mtllib`",
        support: "materials by name, from the files that the mesh refers to; one `mtllib` may name \
                  several",
        limits: "unreadable files, and names that no file has, are noted and white",
    },
    SupportedElement {
        name: "`s`",
        support: "smoothing groups, whose faces share normals unless they have their own",
        limits: "",
    },
    SupportedElement {
        name: "`o`, `g`",
        support: "none: material and smoothing group stay until `usemtl` or `s`",
        limits: "",
    },
    SupportedElement {
        name: "`mg`, `vp`",
        support: "none: they belong to free-form surfaces, whose other statements are noted",
        limits: "",
    },
    SupportedElement {
        name: "`l`, `p`",
        support: "",
        limits: "ignored, with a note",
    },
    SupportedElement {
        name: "`kd`, `map_kd`",
        support: "base colour",
        limits: "",
    },
    SupportedElement {
        name: "`ke`, `map_ke`",
        support: "emission; a texture without `Ke` emits with radiance 1",
        limits: "",
    },
    SupportedElement {
        name: "`ks`, `ns`",
        support: "roughness from the exponent, if the highlight is not black and `Pr` is absent",
        limits: "",
    },
    SupportedElement {
        name: "`ni`",
        support: "index of refraction",
        limits: "",
    },
    SupportedElement {
        name: "`d`, `tr`, `map_d`",
        support: "coverage, as a probability: what is behind is seen unchanged. Of a `map_d`, the \
                  alpha or else the luminance",
        limits: "materials that become invisible are noted",
    },
    SupportedElement {
        name: "`illum`",
        support: "models 4, 6, 7 and 9 are glass",
        limits: "",
    },
    SupportedElement {
        name: "`pr`, `map_pr`, `pm`, `map_pm`",
        support: "roughness and metallic",
        limits: "",
    },
    SupportedElement {
        name: "`ps`, `pc`, `pcr`, `aniso`",
        support: "sheen, clear coat and its roughness, anisotropy",
        limits: "",
    },
    SupportedElement {
        name: "`norm`",
        support: "the normal map; `-bm` is its strength",
        limits: "",
    },
    SupportedElement {
        name: "`bump`, `map_bump`",
        support: "the bump map, in scene units times `-bm`; a normal map if the image contains \
                  normals",
        limits: "height maps without `-bm` and images of normals are noted",
    },
    SupportedElement {
        name: "`-s`, `-o`, `-clamp`",
        support: "factors, offset and wrap mode of each map; equal factors and the offset of the \
                  first map become the material's `tiling` and `uv_offset`",
        limits: "a material whose first map has factor 0 cannot have others mapped differently; \
                 noted",
    },
    SupportedElement {
        name: "`ka`, `tf`, `map_ka`, `map_ks`, `map_ns`, `sharpness`, `map_aat`",
        support: "none: they belong to other material models",
        limits: "",
    },
    SupportedElement {
        name: "all other statements",
        support: "",
        limits: "noted by name, such as `disp`",
    },
];

/// Statements of OBJ and of its material files that are not supported.
const UNSUPPORTED: &str = "anisor km nr bevel bmat bsp bzp c_interp call cdc con cstype csh ctech curv curv2 \
                           d_interp decal deg disp end hole lod map_disp map_opacity map_pc map_pcr \
                           map_ps map_refl map_tr maplib parm refl res rim scrv shadow_obj sp stech \
                           step surf trace_obj trim usemap";

/// Greatest number of keywords that are noted in one file.
const MAX_NOTED: usize = 16;

/// Unsupported keywords of a file that have been noted.
#[derive(Default)]
pub(super) struct NotedKeywords(Vec<String>);

impl NotedKeywords {
    /// Returns the note about an unsupported statement: once for each keyword, and at most 16 times.
    /// Keywords that the format does not have are noted once and not quoted, since the file may be
    /// of another kind.
    pub(super) fn note(&mut self, keyword: &str) -> Option<String> {
        let is_known = UNSUPPORTED.split(' ').any(|known| known == keyword);
        let keyword = if is_known { keyword } else { "" };
        if self.0.iter().any(|k| k == keyword) || self.0.len() >= MAX_NOTED {
            return None;
        }
        self.0.push(keyword.to_owned());
        Some(if is_known {
            format!("statements `{keyword}` are not supported; ignored")
        } else {
            "not a statement of OBJ; ignored, as others like it".to_owned()
        })
    }
}
