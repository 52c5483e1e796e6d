//! Supported elements of the scene folders of thesis S1.

use crate::load::SupportedElement;

/// One row for each element or key, from which `docs/reference/formats.md` is generated.
pub(in crate::load) const SUPPORTED: &[SupportedElement] = &[
    SupportedElement {
        name: "`xRes`, `yRes`",
        support: "resolution",
        limits: "",
    },
    SupportedElement {
        name: "`camera`",
        support: "`position`, `focalLength`, `sensorWidth`, `sensorHeight`; it looks along its z \
                  axis",
        limits: "rotations are noted",
    },
    SupportedElement {
        name: "`aperture`, `focusDistance`, `bokeh`",
        support: "the lens: f-number, focus distance, and whether depth of field is enabled",
        limits: "",
    },
    SupportedElement {
        name: "`materials`",
        support: "`name`, to which objects and texture files refer",
        limits: "",
    },
    SupportedElement {
        name: "`albedo`, `emission`",
        support: "colours; `Textures/NAME_albedo.bmp` and `NAME_emission.bmp`",
        limits: "",
    },
    SupportedElement {
        name: "`roughness`, `metallic`",
        support: "numbers, and textures with these suffixes",
        limits: "",
    },
    SupportedElement {
        name: "`transmission`, `eta`",
        support: "one minus the opacity, and the index of refraction",
        limits: "",
    },
    SupportedElement {
        name: "`specular`, `specularTint`, `sheen`, `sheenTint`, `subsurface`, `anisotropic`, \
               `clearcoat`, `clearcoatGloss`",
        support: "the Disney parameters of these names",
        limits: "",
    },
    SupportedElement {
        name: "`normal`",
        support: "the normal map: a texture `NAME_normal.bmp`",
        limits: "",
    },
    SupportedElement {
        name: "`objects`",
        support: "`name` of the file `Objects/NAME.obj`, and `material`",
        limits: "unknown materials are noted and replaced by grey",
    },
    SupportedElement {
        name: "`pointLights`",
        support: "`position`, and `radiance`, which is used as the radiant intensity",
        limits: "",
    },
    SupportedElement {
        name: "`hdri`",
        support: "`name` of `HDRI/NAME.hdr`, or `color`; `xOffset`",
        limits: "`yOffset` is noted",
    },
];
