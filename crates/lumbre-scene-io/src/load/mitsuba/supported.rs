//! Supported elements of Mitsuba scenes.

use crate::load::SupportedElement;

/// One row for each element or plugin, from which `docs/reference/formats.md` is generated.
pub(in crate::load) const SUPPORTED: &[SupportedElement] = &[
    SupportedElement {
        name: "`default`, `include`, `path`, `alias`, `ref`",
        support: "variables, which are options of the scene, included files, folders in which files \
                  are searched, references to earlier and later objects",
        limits: "document types and entities are refused",
    },
    SupportedElement {
        name: "`rgb`, `spectrum`, `blackbody`",
        support: "linear sRGB, `#rrggbb`, `srgb`; a number, pairs `nm:value`, a `filename`, `uniform`, `d65`, \
                  `regular` and `irregular` as in Mitsuba's RGB variants; `temperature` and `scale`; a \
                  spectrum that is a texture. In files of version 0.6 a number of an emitter is D65",
        limits: "other spectra are refused",
    },
    SupportedElement {
        name: "`integrator`",
        support: "`max_depth`, also of an integrator inside of another; two edges for `direct`",
        limits: "the script sets the integrator",
    },
    SupportedElement {
        name: "`perspective`, `thinlens`",
        support: "`to_world`, `fov`, `fov_axis`, `focal_length`, `aperture_radius`, \
                  `focus_distance`, `principal_point_offset_x` and `_y`; size and crop of the \
                  `film`",
        limits: "further sensors are noted",
    },
    SupportedElement {
        name: "`orthographic`",
        support: "`to_world`, of which the scale gives the extent; size and crop of the `film`",
        limits: "pixels that are not square are noted",
    },
    SupportedElement {
        name: "`obj`, `ply`, `serialized`",
        support: "meshes; `shape_index`, `face_normals`, `flip_normals`, `flip_tex_coords`. Texture coordinates \
                  start at the top left, those of OBJ files at the bottom left. In version 0.6 faces of \
                  an OBJ have the surfaces that are named after their `usemtl` or, without any surface, \
                  those of its material files",
        limits: "",
    },
    SupportedElement {
        name: "`rectangle`, `cube`, `disk`, `cylinder`",
        support: "meshes with the texture coordinates of Mitsuba",
        limits: "",
    },
    SupportedElement {
        name: "`sphere`",
        support: "an analytic sphere, or a mesh if it is textured, anisotropic, stretched or \
                  mirrored, which turns it inside out, or has `flip_normals`",
        limits: "meshes are noted",
    },
    SupportedElement {
        name: "`shapegroup`, `instance`",
        support: "instances that share a mesh",
        limits: "",
    },
    SupportedElement {
        name: "other shapes",
        support: "",
        limits: "ignored, with a note",
    },
    SupportedElement {
        name: "`diffuse`",
        support: "`reflectance`",
        limits: "",
    },
    SupportedElement {
        name: "`roughdiffuse`",
        support: "`reflectance`, `alpha`; a plugin of version 0.6, which version 3 lacks",
        limits: "textures of `alpha`, and light from facet to facet, are noted",
    },
    SupportedElement {
        name: "`difftrans`",
        support: "`transmittance`; a plugin of version 0.6, which version 3 lacks",
        limits: "",
    },
    SupportedElement {
        name: "`conductor`, `roughconductor`",
        support: "`material`, or `eta` and `k`; `specular_reflectance`, `distribution`, `alpha`, \
                  `alpha_u`, `alpha_v`",
        limits: "textures of the last two are replaced by their mean, with a note",
    },
    SupportedElement {
        name: "`dielectric`, `thindielectric`, `roughdielectric`",
        support: "`int_ior`, `ext_ior`, `specular_reflectance`, `specular_transmittance`, `alpha`",
        limits: "textures of the two colours are noted",
    },
    SupportedElement {
        name: "`plastic`, `roughplastic`",
        support: "`diffuse_reflectance`, `int_ior`, `ext_ior`, `nonlinear`, `alpha`",
        limits: "a texture of `specular_reflectance` is noted",
    },
    SupportedElement {
        name: "`principled`",
        support: "`base_color`, `roughness`, `metallic`, `spec_trans`, `eta` or `specular`, \
                  `anisotropic`, `spec_tint`, `sheen`, `sheen_tint`, `flatness`, `clearcoat`, \
                  `clearcoat_gloss`",
        limits: "textures of parameters other than the first four are noted",
    },
    SupportedElement {
        name: "`twosided`",
        support: "opaque surfaces reflect on both sides, or a second one inside on the back; without it \
                  their back is black",
        limits: "",
    },
    SupportedElement {
        name: "`mask`",
        support: "`opacity`, as a probability",
        limits: "coloured opacity becomes grey, with a note",
    },
    SupportedElement {
        name: "`bumpmap`",
        support: "its texture as a height map times `scale`, in scene units",
        limits: "",
    },
    SupportedElement {
        name: "`normalmap`",
        support: "the normal map",
        limits: "",
    },
    SupportedElement {
        name: "`null`",
        support: "transmits everything",
        limits: "",
    },
    SupportedElement {
        name: "`blendbsdf`",
        support: "`weight` of the second surface: one of the two is drawn at every vertex",
        limits: "a mask inside is noted",
    },
    SupportedElement {
        name: "`mixturebsdf`",
        support: "`weights`; what they lack to one is absorbed. A plugin of version 0.6",
        limits: "weights above one in all are divided by their sum, with a note",
    },
    SupportedElement {
        name: "`phong`, `ward`",
        support: "`diffuse_reflectance`, `specular_reflectance`, `exponent`, `alpha_u`, `alpha_v`: a diffuse \
                  surface and a rough mirror. Plugins of version 0.6",
        limits: "the shape of the lobe is noted",
    },
    SupportedElement {
        name: "`coating`, `roughcoating`",
        support: "over a diffuse surface: a plastic. Plugins of version 0.6",
        limits: "absorption is noted; over other surfaces the coating is left out, with a note",
    },
    SupportedElement {
        name: "`Separable`, `Composed`, `TemporalProfile`",
        support: "the transient extension: [transient.md](transient.md)",
        limits: "",
    },
    SupportedElement {
        name: "other surfaces",
        support: "",
        limits: "replaced by a grey one, with a note",
    },
    SupportedElement {
        name: "`bitmap`",
        support: "`filename`, `raw`, `to_uv`, `wrap_mode`; of version 0.6 `gamma`, `uscale`, `vscale`, \
                  `uoffset`, `voffset`, `wrap_mode_u`, `wrap_mode_v`",
        limits: "other filters are noted",
    },
    SupportedElement {
        name: "`checkerboard`",
        support: "`color0`, `color1`, colours or textures, `to_uv`, or `uscale`, `vscale`, \
                  `uoffset`, `voffset`",
        limits: "textures that do not repeat with the fields are replaced by their mean, with a \
                 note",
    },
    SupportedElement {
        name: "`scale` of version 0.6",
        support: "a texture times `scale`, a number or a colour",
        limits: "",
    },
    SupportedElement {
        name: "`mesh_attribute`",
        support: "`vertex_color` of a PLY, in floats from 0 to 1, as the colour of a surface; `scale`",
        limits: "other attributes are noted; colours in integers are decoded from sRGB; in a blend all \
                 surfaces have them",
    },
    SupportedElement {
        name: "other textures",
        support: "",
        limits: "ignored, with a note",
    },
    SupportedElement {
        name: "`area`",
        support: "`radiance`, a colour or a texture",
        limits: "",
    },
    SupportedElement {
        name: "`constant`, `envmap`",
        support: "`radiance`; `filename`, `scale`, `to_world`; for a tilted map a finer one in the axes of the \
                  scene is computed",
        limits: "tilted maps and further environments are noted",
    },
    SupportedElement {
        name: "`sunsky`; `sky`, `sun` of version 0.6",
        support: "an environment map that is computed: `turbidity`, `albedo`, `sun_direction`, or \
                  `latitude`, `longitude`, `timezone`, `year`, `month`, `day`, `hour`, `minute`, \
                  `second`; `sun_scale`, `sky_scale`, `sun_aperture`, `to_world`; of version 0.6 \
                  also `scale`, `sun_radius_scale`, `stretch`, `extend`",
        limits: "`complex_sun`, textures of `albedo`, of which the mean is used, and suns below 0.2 \
                 degrees are noted; a black light is ignored, with a note",
    },
    SupportedElement {
        name: "`point`, `directional`",
        support: "`position` and `intensity`, `direction` and `irradiance`",
        limits: "",
    },
    SupportedElement {
        name: "`spot`",
        support: "`cutoff_angle`, `beam_width`, `intensity`, `texture`, `to_world`",
        limits: "other filters and `to_uv` of the texture are noted",
    },
    SupportedElement {
        name: "`projector`",
        support: "`irradiance`, `scale`, `fov`, `fov_axis`, `focal_length`, `to_world`",
        limits: "other filters and `to_uv` of the image are noted",
    },
    SupportedElement {
        name: "other emitters",
        support: "",
        limits: "ignored, with a note",
    },
];
