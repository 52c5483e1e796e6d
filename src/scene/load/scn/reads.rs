//! What is read of a `.scn` beside the parameters of materials, whose table names their keys.

use crate::scene::load::Reads;

/// One row for each element or key; `docs/formats.md` is written from it.
pub(in crate::scene::load) const READS: &[Reads] = &[
    Reads {
        name: "`resolution`, `maxdepth`",
        read: "width and height in pixels, and the greatest number of path edges",
        noted: "values out of range",
    },
    Reads { name: "`camera`", read: "`position`, `lookat`, `fov` (vertical, in degrees)", noted: "" },
    Reads {
        name: "`aperture`, `focus_distance`, `f_number`, `focal_length`, `sensor_height`",
        read: "the lens: additions of Lumbre",
        noted: "",
    },
    Reads { name: "`antialiasing_radius`", read: "", noted: "the script decides the filter" },
    Reads { name: "`materials`", read: "`name`, and the keys below", noted: "keys that are not known" },
    Reads {
        name: "`entities`",
        read: "`type` `mesh` with its `file`, or `sphere` with its `radius`; `material`, `position`, `rotation`, `scale`, and a `name`, which is an addition",
        noted: "keys that are not known",
    },
    Reads { name: "`default_material`", read: "the material of faces that name none", noted: "" },
    Reads { name: "`anisotropic_direction`", read: "of an entity, in place of its material's", noted: "" },
    Reads { name: "`inverted_normal`", read: "", noted: "the front is the side of the normals" },
    Reads { name: "`lights`", read: "additions of Lumbre: `point`, `spot` and `directional`", noted: "" },
    Reads { name: "`environment`", read: "an addition of Lumbre: `file` or `color`, `rotation`, `scale`", noted: "" },
];
