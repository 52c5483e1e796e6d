//! What is read of a scene of Mitsuba.

use crate::scene::load::Reads;

/// One row for each element or key; `docs/formats.md` is written from it.
pub(in crate::scene::load) const READS: &[Reads] = &[
    Reads {
        name: "`default`, `include`, `alias`, `ref`",
        read: "variables, files in files, names",
        noted: "document types and entities are errors",
    },
    Reads { name: "`integrator`", read: "`max_depth`", noted: "which one it is says the script" },
    Reads {
        name: "`perspective`, `thinlens`",
        read: "`to_world`, `fov`, `fov_axis`, `focal_length`, `aperture_radius`, `focus_distance`; the size of the `film`",
        noted: "mirrored cameras, further sensors",
    },
    Reads {
        name: "`obj`, `ply`",
        read: "meshes; `face_normals`, `flip_normals`, `flip_tex_coords`. Texture coordinates start at the top left, of OBJ files at the bottom left",
        noted: "",
    },
    Reads { name: "`rectangle`, `cube`, `disk`, `cylinder`", read: "as Mitsuba lays pictures on them", noted: "" },
    Reads {
        name: "`sphere`",
        read: "a true sphere, or a mesh where its place stretches it or `flip_normals` turns it",
        noted: "the latter",
    },
    Reads { name: "`shapegroup`, `instance`", read: "copies that share their mesh", noted: "" },
    Reads { name: "other shapes", read: "", noted: "left out" },
    Reads { name: "`diffuse`", read: "`reflectance`", noted: "" },
    Reads {
        name: "`conductor`, `roughconductor`",
        read: "`material`, or `eta` and `k`; `specular_reflectance`, `distribution`, `alpha`, `alpha_u`, `alpha_v`",
        noted: "",
    },
    Reads {
        name: "`dielectric`, `thindielectric`, `roughdielectric`",
        read: "`int_ior`, `ext_ior`, `specular_reflectance`, `specular_transmittance`, `alpha`",
        noted: "textures of the two colours",
    },
    Reads {
        name: "`plastic`, `roughplastic`",
        read: "`diffuse_reflectance`, `int_ior`, `ext_ior`, `nonlinear`, `alpha`",
        noted: "the texture of `specular_reflectance`",
    },
    Reads {
        name: "`principled`",
        read: "`base_color`, `roughness`, `metallic`, `spec_trans`, `eta` or `specular`, `anisotropic`, `spec_tint`, `sheen`, `sheen_tint`, `flatness`, `clearcoat`, `clearcoat_gloss`",
        noted: "textures of others than the first four",
    },
    Reads { name: "`twosided`", read: "opaque surfaces are so here anyway", noted: "where a file does not say so" },
    Reads { name: "`mask`", read: "`opacity` as a probability", noted: "coloured ones are grey" },
    Reads { name: "`bumpmap`", read: "its texture as heights times `scale`, in scene units", noted: "" },
    Reads { name: "`normalmap`", read: "the normal map", noted: "" },
    Reads { name: "`null`", read: "lets everything pass", noted: "" },
    Reads { name: "`blendbsdf`", read: "", noted: "its first surface alone" },
    Reads {
        name: "`Separable`, `Composed`, `TemporalProfile`",
        read: "the transient extension: [transient.md](transient.md)",
        noted: "",
    },
    Reads { name: "other surfaces", read: "", noted: "grey" },
    Reads { name: "`bitmap`", read: "`filename`, `raw`, `to_uv`, `wrap_mode`", noted: "other filters" },
    Reads { name: "`checkerboard`", read: "`color0`, `color1`, `to_uv`", noted: "textures of its colours" },
    Reads { name: "other textures", read: "", noted: "left out" },
    Reads { name: "`area`", read: "`radiance`, a colour or a texture", noted: "" },
    Reads {
        name: "`constant`, `envmap`",
        read: "`radiance`; `filename`, `scale`, and of `to_world` the turn about +y",
        noted: "other turns, further environments",
    },
    Reads {
        name: "`point`, `directional`",
        read: "`position` and `intensity`, `direction` and `irradiance`",
        noted: "",
    },
    Reads { name: "`spot`", read: "`cutoff_angle`, `beam_width`, `intensity`, `to_world`", noted: "its texture" },
    Reads { name: "other emitters", read: "", noted: "left out" },
];
