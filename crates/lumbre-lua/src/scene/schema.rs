//! Schemas of `scene` and of the methods for cameras, lights, environment and import.

use lumbre_light::scene::desc::light::CUTOFF_RANGE;
use lumbre_light::scene::desc::{CAMERA_KIND_NAMES, MAX_SIDE, VIEW_HEIGHT_RANGE};
use lumbre_light::value::schema::{Table, Ty};
use lumbre_render::settings::EDGES;
use lumbre_scene_io::edit::WINDOW;

/// Point or direction in scene coordinates.
const POINT: Ty = Ty::nums(3, -1e9, 1e9);
/// RGB radiometric quantity.
const LIGHT: Ty = Ty::nums(3, 0.0, 1e12);

lumbre_light::table! {
    /// Options of `scene`.
    pub const SCENE = "SceneOptions", "Options of `scene`; experiments can override both.";
    resolution = "{ 1280, 720 }": Ty::nums(2, 1.0, MAX_SIDE as f64), "width and height in pixels";
    max_depth = "8": EDGES,
        "largest number of path edges from camera to light: 1 is emission only, 2 adds direct \
         light";
}

lumbre_light::table! {
    /// Options of `s:camera` and `s:view`.
    pub const CAMERA = "SceneCamera",
        "Camera. Lens and sensor can also be given in photographic terms; all lengths are in scene \
         units.";
    position: POINT, "centre of the lens in scene coordinates";
    target: POINT, "point on the optical axis in scene coordinates";
    kind = "perspective": Ty::Word(&CAMERA_KIND_NAMES),
        "how the scene is mapped to the picture: `perspective`, with rays through a lens; \
         `orthographic`, with parallel rays from a rectangle about `position`, perpendicular to \
         them; `spherical`, with rays from `position` in all directions: the longitude over the \
         width, `target` in the middle and to the right of it what is on its right, and the \
         latitude over the height, `up` at the top. Only the first has a lens";
    view_height = "2": Ty::num(VIEW_HEIGHT_RANGE[0], VIEW_HEIGHT_RANGE[1]),
        "height of the picture of an orthographic camera in scene units";
    window = "{ 0, 1, 0, 1 }": WINDOW,
        "part of the view that the picture shows: left, right, upper and lower edge, in fractions \
         of the whole from its upper left corner; a left edge beyond the right one mirrors the \
         picture";
    up = "{ 0, 1, 0 }": POINT, "direction that is up in the picture";
    fov = "45": Ty::num(0.01, 179.0), "vertical field of view of a perspective camera in degrees";
    aperture = "0": Ty::num(0.0, 1e9), "diameter of the lens; 0 is a pinhole camera";
    focus_distance = "the distance of `target`": Ty::num(1e-9, 1e9),
        "distance from the lens to the plane in focus";
    f_number = "none": Ty::num(1e-3, 1e6),
        "f-number: focal length over diameter of the lens; needs `focal_length` or `sensor_height`";
    focal_length = "none": Ty::num(1e-9, 1e6),
        "focal length; together with `sensor_height` it determines `fov`";
    sensor_height = "none": Ty::num(1e-9, 1e6),
        "height of the sensor; together with `fov` it determines `focal_length`";
}

lumbre_light::table! {
    /// Options of `s:light`.
    pub const POINT_LIGHT = "SceneLight",
        "Light without a surface: a point light (`position`, `intensity`), a directional light \
         (`direction`, `irradiance`), a spot light (`position`, `direction`, `intensity`), a projector \
         (a spot light with a `map`) or a goniometric light (`position`, `intensity`, `map`).";
    name = "light_1, ..": Ty::Str, "name for changes with `set`: lights.NAME.intensity";
    position = "": POINT, "position of a point, spot or goniometric light";
    intensity = "": LIGHT,
        "RGB radiant intensity of a point light, of a spot light along its axis, or of a goniometric \
         light where its map is 1";
    direction = "": POINT, "direction in which directional light travels, or axis of a spot light";
    irradiance = "": LIGHT, "RGB irradiance of directional light on a surface that faces it";
    cutoff = "20": Ty::num(CUTOFF_RANGE[0], CUTOFF_RANGE[1]),
        "half angle of a spot light's cone in degrees, beyond which it emits nothing";
    beam = "three quarters of cutoff": Ty::num(0.0, CUTOFF_RANGE[1]),
        "half angle in degrees within which a spot light has its full intensity; it falls linearly \
         to zero at `cutoff`";
    map = "": Ty::Object("string|Texture"),
        "factor on the intensity of a goniometric light by direction: equirectangular picture with \
         +y at the top and +z in the middle; or the picture that a spot light projects";
    angle = "40": Ty::num(1e-3, 179.0),
        "angle of the width of a projected picture in degrees; `cutoff` is that of its corners unless \
         it is given";
    up = "{ 0, 1, 0 }": POINT, "direction that points up in a projected picture";
    rotation = "0": Ty::num(-1e6, 1e6),
        "rotation of the map of a goniometric light about +y in degrees, counter-clockwise seen \
         from above";
}

lumbre_light::table! {
    /// Options of `s:environment`.
    pub const ENVIRONMENT = "SceneEnvironment",
        "Light from infinity: one colour or an equirectangular map.";
    color = "": LIGHT, "RGB radiance from all directions";
    map = "": Ty::Object("string|Texture"),
        "equirectangular picture with +y at the top and +z in the middle";
    rotation = "0": Ty::num(-1e6, 1e6),
        "rotation about +y in degrees, counter-clockwise seen from above";
    scale = "1": Ty::num(0.0, 1e12), "factor on the radiance";
}

lumbre_light::table! {
    /// Options of `s:import`.
    pub const IMPORT = "Import", "Options of `s:import`.";
    prefix = "none": Ty::Str, "prefix of the names of its materials, entities and lights";
    material = "its own materials": Ty::Str,
        "material of this scene that replaces all materials of the file";
    place = "unchanged": Ty::Object("Place"), "placement of its entities";
    lights = "false": Ty::Bool, "whether its lights and its environment are imported";
    project = "none": Ty::Word(&["none", "plane"]),
        "texture coordinates for meshes without any: `plane` projects along z and divides by the \
         mesh's larger extent";
}

/// Option tables of scene methods, for the annotations and the reference page.
pub const TABLES: &[&Table] = &[&SCENE, &CAMERA, &POINT_LIGHT, &ENVIRONMENT, &IMPORT];
