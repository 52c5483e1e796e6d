//! Schema of the render table: the keys that a script's `render` function may return.

use crate::backends::BACKENDS;
use lumbre_light::film::layer::LAYER_NAMES;
use lumbre_light::scene::desc::{CAMERA_KIND_NAMES, MAX_SIDE, VIEW_HEIGHT_RANGE};
use lumbre_light::scene::edit::WINDOW;
use lumbre_light::transport::camera::FILTER_NAMES;
use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_light::transport::integrator::external::EXTERNALS;
use lumbre_light::transport::sampler::SAMPLER_NAMES;
use lumbre_light::transport::time_settings::FILM;
use lumbre_light::value::schema::{Field, Table, Ty};
use lumbre_render::denoise;
use lumbre_render::denoise::atrous::ATROUS;
use lumbre_render::hierarchy::ACCEL;
use lumbre_render::shaders;

/// Names of the integrators, for the annotations.
pub const INTEGRATOR_NAMES: [&str; INTEGRATORS.len() + EXTERNALS.len()] = {
    let mut names = [""; INTEGRATORS.len() + EXTERNALS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = if i < INTEGRATORS.len() {
            INTEGRATORS[i].name
        } else {
            EXTERNALS[i - INTEGRATORS.len()].name
        };
        i += 1;
    }
    names
};

/// Names of the backends, for the annotations.
pub const BACKEND_NAMES: [&str; BACKENDS.len() + 1] = {
    let mut names = ["auto"; BACKENDS.len() + 1];
    let mut i = 0;
    while i < BACKENDS.len() {
        names[i + 1] = BACKENDS[i].name;
        i += 1;
    }
    names
};

/// Largest coordinate and length, in scene units.
const MAX_COORDINATE: f64 = 1e9;

/// Option `aa` of the render table.
pub const AA: Table = Table {
    name: "Antialiasing",
    doc: "Pixel filter. Samples are distributed by importance sampling of the filter.",
    fields: &[
        Field {
            key: "filter",
            ty: Ty::Word(&FILTER_NAMES),
            required: false,
            default: "box",
            doc: "shape of the filter: constant, linear, a Gaussian truncated at three sigma, a \
                  Blackman-Harris window, or the untruncated Gaussian of thesis S1 (sigma = 2 \
                  radius)",
        },
        Field {
            key: "radius",
            ty: Ty::Num {
                min: 0.0,
                max: 16.0,
            },
            required: false,
            default: "0.5",
            doc: "half width in pixels; a box of 0.5 is the pixel itself; for \
                  `antialiasing_radius`, half of sigma",
        },
    ],
};

/// Option `camera` of the render table.
pub const CAMERA: Table = Table {
    name: "CameraChanges",
    doc: "Changes to the scene's camera. Omitted keys keep the value of the scene.",
    fields: &[
        Field {
            key: "aperture",
            ty: Ty::Num {
                min: 0.0,
                max: MAX_COORDINATE,
            },
            required: false,
            default: "",
            doc: "diameter of the lens in scene units; 0 is a pinhole camera",
        },
        Field {
            key: "f_number",
            ty: Ty::Num {
                min: 1e-3,
                max: 1e6,
            },
            required: false,
            default: "",
            doc: "f-number: focal length over diameter of the lens; an alternative to `aperture` \
                  that needs `focal_length` or `sensor_height`",
        },
        Field {
            key: "focal_length",
            ty: Ty::Num {
                min: 1e-9,
                max: 1e6,
            },
            required: false,
            default: "",
            doc: "focal length in scene units; together with `sensor_height` it determines `fov`",
        },
        Field {
            key: "sensor_height",
            ty: Ty::Num {
                min: 1e-9,
                max: 1e6,
            },
            required: false,
            default: "",
            doc: "height of the sensor in scene units; together with `fov` it determines \
                  `focal_length`",
        },
        Field {
            key: "focus_distance",
            ty: Ty::Num {
                min: 1e-9,
                max: MAX_COORDINATE,
            },
            required: false,
            default: "",
            doc: "distance from the lens to the plane in focus, in scene units; by default the \
                  scene's, or the distance of `target`",
        },
        Field {
            key: "fov",
            ty: Ty::Num {
                min: 0.01,
                max: 179.0,
            },
            required: false,
            default: "",
            doc: "vertical field of view of a perspective camera in degrees",
        },
        Field {
            key: "kind",
            ty: Ty::Word(&CAMERA_KIND_NAMES),
            required: false,
            default: "",
            doc: "how the camera maps the scene to its picture; `orthographic` and `spherical` \
                  cameras have no lens",
        },
        Field {
            key: "position",
            ty: Ty::Nums {
                len: 3,
                min: -MAX_COORDINATE,
                max: MAX_COORDINATE,
            },
            required: false,
            default: "",
            doc: "centre of the lens in scene coordinates",
        },
        Field {
            key: "target",
            ty: Ty::Nums {
                len: 3,
                min: -MAX_COORDINATE,
                max: MAX_COORDINATE,
            },
            required: false,
            default: "",
            doc: "point on the optical axis in scene coordinates",
        },
        Field {
            key: "up",
            ty: Ty::Nums {
                len: 3,
                min: -MAX_COORDINATE,
                max: MAX_COORDINATE,
            },
            required: false,
            default: "",
            doc: "direction that is up in the picture",
        },
        Field {
            key: "view_height",
            ty: Ty::Num {
                min: VIEW_HEIGHT_RANGE[0],
                max: VIEW_HEIGHT_RANGE[1],
            },
            required: false,
            default: "",
            doc: "height of the picture of an orthographic camera in scene units",
        },
        Field {
            key: "window",
            ty: WINDOW,
            required: false,
            default: "",
            doc: "part of the view that the picture shows: left, right, upper and lower edge, in \
                  fractions of the whole from its upper left corner",
        },
    ],
};

/// Number of edges of a path.
pub const EDGES: Ty = Ty::Int {
    min: 1,
    max: 10_000,
};

/// Option `rr` of the render table.
pub const ROULETTE: Table = Table {
    name: "RussianRoulette",
    doc: "Russian roulette: terminates paths at random without changing the mean.",
    fields: &[Field {
        key: "start",
        ty: EDGES,
        required: true,
        default: "",
        doc: "first path edge after which a path may be terminated",
    }],
};

/// Table that the render function returns, without the integrators' own parameters.
pub const RENDER: Table = Table {
    name: "Render",
    doc: "Settings of one cell. The integrator's own parameters are keys of the same table.",
    fields: &[
        Field {
            key: "scene",
            ty: Ty::Str,
            required: true,
            default: "",
            doc: "scene file, relative to the current folder or else to the script's",
        },
        Field {
            key: "scene_options",
            ty: Ty::Any("table<string, string|number|boolean>"),
            required: false,
            default: "the scene's defaults",
            doc: "options of a Lua scene: { light = \"sun\" }",
        },
        Field {
            key: "view",
            ty: Ty::Str,
            required: false,
            default: "the scene's camera",
            doc: "name of a view of the scene; the changes of `camera` apply to it",
        },
        Field {
            key: "integrator",
            ty: Ty::WordOrDeclared(&INTEGRATOR_NAMES),
            required: true,
            default: "",
            doc: "integrator (technique), or another renderer that `external` returned; its own \
                  parameters are keys of this table",
        },
        Field {
            key: "max_depth",
            ty: EDGES,
            required: false,
            default: "the scene's",
            doc: "largest number of path edges from camera to light: 1 is emission only, 2 adds \
                  direct light",
        },
        Field {
            key: "resolution",
            ty: Ty::Nums {
                len: 2,
                min: 1.0,
                max: MAX_SIDE as f64,
            },
            required: false,
            default: "the scene's",
            doc: "width and height in pixels",
        },
        Field {
            key: "aa",
            ty: Ty::Table(&AA),
            required: false,
            default: "a box of one pixel",
            doc: "pixel filter",
        },
        Field {
            key: "sampler",
            ty: Ty::Word(&SAMPLER_NAMES),
            required: false,
            default: "independent",
            doc: "source of sample numbers: `independent` is uniform random, `sobol` \
                  low-discrepancy in each pixel, `zsobol16` over neighbouring pixels together in \
                  blocks of 16 samples, so that their errors cancel; except for `independent`, \
                  standard errors are mostly too large",
        },
        Field {
            key: "camera",
            ty: Ty::Table(&CAMERA),
            required: false,
            default: "the scene's",
            doc: "changes to the scene's camera",
        },
        Field {
            key: "set",
            ty: Ty::Any("table<string, number|string|boolean|number[]>"),
            required: false,
            default: "",
            doc: "changes to the scene, by path: { [\"materials.egg.ior\"] = 1.5 }",
        },
        Field {
            key: "films",
            ty: Ty::OneOrMany(&Ty::Word(&LAYER_NAMES)),
            required: false,
            default: "none",
            doc: "layers to store besides the picture, as files below films/ in the run's folder: \
                  { \"depth\", \"strategies\" }; a reference does not inherit them",
        },
        Field {
            key: "film",
            ty: Ty::Table(&FILM),
            required: false,
            default: "no time axis",
            doc: "time axis: { time = { bin = 0.01, bins = 300 } }; a reference does not inherit \
                  it",
        },
        Field {
            key: "rr",
            ty: Ty::Table(&ROULETTE),
            required: false,
            default: "never",
            doc: "Russian roulette",
        },
        Field {
            key: "denoise",
            ty: Ty::Word(&denoise::NAMES),
            required: false,
            default: "none",
            doc: "denoiser of the picture before it is measured and stored, on the clock of the run: \
                  the built-in wavelet filter `atrous`, or `oidn`, Open Image Denoise, which \
                  LUMBRE_OIDN names; denoised pictures are biased, and references are never denoised",
        },
        Field {
            key: "atrous",
            ty: Ty::Table(&ATROUS),
            required: false,
            default: "its defaults",
            doc: "parameters of `denoise = \"atrous\"`",
        },
        Field {
            key: "accel",
            ty: Ty::Table(&ACCEL),
            required: false,
            default: "ploc",
            doc: "construction of the acceleration structure; affects only times, never pictures",
        },
        Field {
            key: "shaders",
            ty: Ty::Str,
            required: false,
            default: shaders::BUILT_IN,
            doc: "folder whose shaders replace those of the program on Vulkan backends, relative to \
                  the current folder or else to the script's; needs the compiler of shaders, a \
                  program on PATH; a reference does not inherit it",
        },
        Field {
            key: "backend",
            ty: Ty::Word(&BACKEND_NAMES),
            required: false,
            default: "auto",
            doc: "backend that renders; `auto` is the first usable one",
        },
    ],
};
