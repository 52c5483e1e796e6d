//! What is read of a folder of the second source.

use crate::scene::load::Reads;

/// One row for each element or key; `docs/formats.md` is written from it.
pub(in crate::scene::load) const READS: &[Reads] = &[
    Reads { name: "`xRes`, `yRes`", read: "resolution", noted: "" },
    Reads {
        name: "`camera`",
        read: "`position`, `focalLength`, `sensorWidth`, `sensorHeight`; it looks along its z axis",
        noted: "rotations",
    },
    Reads {
        name: "`aperture`, `focusDistance`, `bokeh`",
        read: "the lens: an f-number, its plane in focus, and whether it counts",
        noted: "",
    },
    Reads { name: "`materials`", read: "`name`, by which objects and pictures find it", noted: "" },
    Reads {
        name: "`albedo`, `emission`",
        read: "colours; `Textures/NAME_albedo.bmp` and `NAME_emission.bmp`",
        noted: "",
    },
    Reads { name: "`roughness`, `metallic`", read: "numbers, and pictures of these names", noted: "" },
    Reads { name: "`transmission`, `eta`", read: "1 - opacity, and the index of refraction", noted: "" },
    Reads {
        name: "`specular`, `specularTint`, `sheen`, `sheenTint`, `subsurface`, `anisotropic`, `clearcoat`, `clearcoatGloss`",
        read: "the Disney parameters of these names",
        noted: "",
    },
    Reads { name: "`normal`", read: "a picture `NAME_normal.bmp`: the normal map", noted: "" },
    Reads {
        name: "`objects`",
        read: "`name`, that of `Objects/NAME.obj`, and `material`",
        noted: "materials that are not there",
    },
    Reads { name: "`pointLights`", read: "`position` and `radiance`, which is the radiant intensity", noted: "" },
    Reads { name: "`hdri`", read: "`name` of `HDRI/NAME.hdr`, or `color`; `xOffset`", noted: "`yOffset`" },
];
