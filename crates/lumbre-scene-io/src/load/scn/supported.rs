//! Supported elements of `.scn`, except material parameters, whose own table lists their keys.

use crate::load::SupportedElement;

/// One row for each element or key, from which `docs/reference/formats.md` is generated.
pub(in crate::load) const SUPPORTED: &[SupportedElement] = &[
    SupportedElement {
        name: "`resolution`, `maxdepth`",
        support: "width and height in pixels, and the greatest number of path edges",
        limits: "values out of range are refused or noted",
    },
    SupportedElement {
        name: "`camera`",
        support: "`position`, `lookat`, `fov` (vertical, in degrees)",
        limits: "",
    },
    SupportedElement {
        name: "`aperture`, `focus_distance`, `f_number`, `focal_length`, `sensor_height`",
        support: "the lens; an addition of Lumbre",
        limits: "",
    },
    SupportedElement {
        name: "`antialiasing_radius`",
        support: "",
        limits: "noted; the script sets the pixel filter",
    },
    SupportedElement {
        name: "`materials`",
        support: "`name`, and the keys below",
        limits: "unknown keys are noted",
    },
    SupportedElement {
        name: "`entities`",
        support: "`type` `mesh` with its `file`, or `sphere` with its `radius`; `material`, \
                  `position`, `rotation`, `scale`, and `name`, an addition of Lumbre",
        limits: "unknown keys are noted",
    },
    SupportedElement {
        name: "`default_material`",
        support: "the material of faces without one",
        limits: "",
    },
    SupportedElement {
        name: "`anisotropic_direction`",
        support: "replaces that of the material on one entity",
        limits: "",
    },
    SupportedElement {
        name: "`inverted_normal`",
        support: "",
        limits: "noted; the front is the side of the normals",
    },
    SupportedElement {
        name: "`lights`",
        support: "`point`, `spot`, also with an image, `goniometric` and `directional`; an addition of Lumbre",
        limits: "",
    },
    SupportedElement {
        name: "`environment`",
        support: "`file` or `color`, `rotation`, `scale`; an addition of Lumbre",
        limits: "",
    },
];
