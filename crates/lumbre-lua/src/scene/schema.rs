//! Schemas of `scene` and of the methods for cameras, lights, environment and import.

use lumbre_light::scene::desc::light::CUTOFF_RANGE;
use lumbre_light::scene::desc::{CAMERA_KIND_NAMES, MAX_SIDE, VIEW_HEIGHT_RANGE};
use lumbre_light::value::schema::{Field, Table, Ty};
use lumbre_render::settings::EDGES;
use lumbre_scene_io::edit::WINDOW;

/// Point or direction in scene coordinates.
const POINT: Ty = Ty::Nums {
    len: 3,
    min: -1e9,
    max: 1e9,
};
/// RGB radiometric quantity.
const LIGHT: Ty = Ty::Nums {
    len: 3,
    min: 0.0,
    max: 1e12,
};

/// Options of `scene`.
pub const SCENE: Table = Table {
    name: "SceneOptions",
    doc: "Options of `scene`; experiments can override both.",
    fields: &[
        Field::optional(
            "resolution",
            Ty::Nums {
                len: 2,
                min: 1.0,
                max: MAX_SIDE as f64,
            },
            "{ 1280, 720 }",
            "width and height in pixels",
        ),
        Field::optional(
            "max_depth",
            EDGES,
            "8",
            "largest number of path edges from camera to light: 1 is emission only, 2 adds direct \
             light",
        ),
    ],
};

/// Options of `s:camera` and `s:view`.
pub const CAMERA: Table = Table {
    name: "SceneCamera",
    doc: "Camera. Lens and sensor can also be given in photographic terms; all lengths are in \
          scene units.",
    fields: &[
        Field::required("position", POINT, "centre of the lens in scene coordinates"),
        Field::required(
            "target",
            POINT,
            "point on the optical axis in scene coordinates",
        ),
        Field::optional(
            "kind",
            Ty::Word(&CAMERA_KIND_NAMES),
            "perspective",
            "how the scene is mapped to the picture: `perspective`, with rays through a lens; \
             `orthographic`, with parallel rays from a rectangle about `position`, perpendicular \
             to them; `spherical`, with rays from `position` in all directions: the longitude \
             over the width, `target` in the middle and to the right of it what is on its right, \
             and the latitude over the height, `up` at the top. Only the first has a lens",
        ),
        Field::optional(
            "view_height",
            Ty::Num {
                min: VIEW_HEIGHT_RANGE[0],
                max: VIEW_HEIGHT_RANGE[1],
            },
            "2",
            "height of the picture of an orthographic camera in scene units",
        ),
        Field::optional(
            "window",
            WINDOW,
            "{ 0, 1, 0, 1 }",
            "part of the view that the picture shows: left, right, upper and lower edge, in \
             fractions of the whole from its upper left corner; a left edge beyond the right one \
             mirrors the picture",
        ),
        Field::optional(
            "up",
            POINT,
            "{ 0, 1, 0 }",
            "direction that is up in the picture",
        ),
        Field::optional(
            "fov",
            Ty::Num {
                min: 0.01,
                max: 179.0,
            },
            "45",
            "vertical field of view of a perspective camera in degrees",
        ),
        Field::optional(
            "aperture",
            Ty::Num { min: 0.0, max: 1e9 },
            "0",
            "diameter of the lens; 0 is a pinhole camera",
        ),
        Field::optional(
            "focus_distance",
            Ty::Num {
                min: 1e-9,
                max: 1e9,
            },
            "the distance of `target`",
            "distance from the lens to the plane in focus",
        ),
        Field::optional(
            "f_number",
            Ty::Num {
                min: 1e-3,
                max: 1e6,
            },
            "none",
            "f-number: focal length over diameter of the lens; needs `focal_length` or \
             `sensor_height`",
        ),
        Field::optional(
            "focal_length",
            Ty::Num {
                min: 1e-9,
                max: 1e6,
            },
            "none",
            "focal length; together with `sensor_height` it determines `fov`",
        ),
        Field::optional(
            "sensor_height",
            Ty::Num {
                min: 1e-9,
                max: 1e6,
            },
            "none",
            "height of the sensor; together with `fov` it determines `focal_length`",
        ),
    ],
};

/// Options of `s:light`.
pub const POINT_LIGHT: Table = Table {
    name: "SceneLight",
    doc: "Light without a surface: a point light (`position`, `intensity`), a directional light \
          (`direction`, `irradiance`) or a spot light (`position`, `direction`, `intensity`).",
    fields: &[
        Field::optional(
            "name",
            Ty::Str,
            "light_1, ..",
            "name for changes with `set`: lights.NAME.intensity",
        ),
        Field::optional("position", POINT, "", "position of a point or spot light"),
        Field::optional(
            "intensity",
            LIGHT,
            "",
            "RGB radiant intensity of a point light, or of a spot light along its axis",
        ),
        Field::optional(
            "direction",
            POINT,
            "",
            "direction in which directional light travels, or axis of a spot light",
        ),
        Field::optional(
            "irradiance",
            LIGHT,
            "",
            "RGB irradiance of directional light on a surface that faces it",
        ),
        Field::optional(
            "cutoff",
            Ty::Num {
                min: CUTOFF_RANGE[0],
                max: CUTOFF_RANGE[1],
            },
            "20",
            "half angle of a spot light's cone in degrees, beyond which it emits nothing",
        ),
        Field::optional(
            "beam",
            Ty::Num {
                min: 0.0,
                max: CUTOFF_RANGE[1],
            },
            "three quarters of cutoff",
            "half angle in degrees within which a spot light has its full intensity; it falls \
             linearly to zero at `cutoff`",
        ),
    ],
};

/// Options of `s:environment`.
pub const ENVIRONMENT: Table = Table {
    name: "SceneEnvironment",
    doc: "Light from infinity: one colour or an equirectangular map.",
    fields: &[
        Field::optional("color", LIGHT, "", "RGB radiance from all directions"),
        Field::optional(
            "map",
            Ty::Object("string|Texture"),
            "",
            "equirectangular picture with +y at the top and +z in the middle",
        ),
        Field::optional(
            "rotation",
            Ty::Num {
                min: -1e6,
                max: 1e6,
            },
            "0",
            "rotation about +y in degrees, counter-clockwise seen from above",
        ),
        Field::optional(
            "scale",
            Ty::Num {
                min: 0.0,
                max: 1e12,
            },
            "1",
            "factor on the radiance",
        ),
    ],
};

/// Options of `s:import`.
pub const IMPORT: Table = Table {
    name: "Import",
    doc: "Options of `s:import`.",
    fields: &[
        Field::optional(
            "prefix",
            Ty::Str,
            "none",
            "prefix of the names of its materials, entities and lights",
        ),
        Field::optional(
            "material",
            Ty::Str,
            "its own materials",
            "material of this scene that replaces all materials of the file",
        ),
        Field::optional(
            "place",
            Ty::Object("Place"),
            "unchanged",
            "placement of its entities",
        ),
        Field::optional(
            "lights",
            Ty::Bool,
            "false",
            "whether its lights and its environment are imported",
        ),
        Field::optional(
            "project",
            Ty::Word(&["none", "plane"]),
            "none",
            "texture coordinates for meshes without any: `plane` projects along z and divides by \
             the mesh's larger extent",
        ),
    ],
};

/// Option tables of scene methods, for the annotations and the reference page.
pub const TABLES: &[&Table] = &[&SCENE, &CAMERA, &POINT_LIGHT, &ENVIRONMENT, &IMPORT];
