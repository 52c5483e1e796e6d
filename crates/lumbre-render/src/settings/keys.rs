//! The table [`SETTINGS`]: the keys of the render table of scripts, how each is read, and what of it
//! belongs to the identity of a run.

use std::collections::BTreeMap;

use super::Settings;
use super::camera::{CAMERA, ENVIRONMENT_MAP, read_changes};
use super::find::{find_file, find_folder};
use super::given::Given;
use crate::denoise::atrous::ATROUS;
use crate::denoise::{self, Denoise};
use crate::external::technique;
use crate::hierarchy::{ACCEL, AccelSpec};
use crate::shaders::{BUILT_IN, ShaderFolder, Shaders};
use lumbre_light::field;
use lumbre_light::film::layer::{LAYER_NAMES, Layer};
use lumbre_light::scene::desc::MAX_SIDE;
use lumbre_light::transport::camera::FilterKind;
use lumbre_light::transport::integrator::external::{EXTERNALS, PYTHON, is_declared};
use lumbre_light::transport::integrator::{INTEGRATORS, integrator, own};
use lumbre_light::transport::sampler::{SAMPLER_NAMES, sampler};
use lumbre_light::transport::time_settings::FILM;
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{Field, SchemaError, Ty};
use lumbre_scene_io::load::is_named_as_model;
use lumbre_scene_io::stage;

/// Row of [`SETTINGS`].
pub struct Setting {
    /// Key in scripts, with its type, range, default and meaning.
    pub field: Field,
    /// Whether the reference of a cell has the setting of the cell, unless it sets its own.
    pub inherited: bool,
    /// Reads the setting from a table that satisfies `field`.
    pub read: fn(&mut Settings, &Given<'_>) -> Result<(), SchemaError>,
    /// Key and value of the setting in the identity of a run; `None` if it does not belong to it, or
    /// has the value of runs from before it existed.
    pub identity: fn(&Settings) -> Option<(&'static str, Value)>,
}

/// Returns the row of a key of the render table; `None` for a parameter of an integrator.
pub fn setting(key: &str) -> Option<&'static Setting> {
    SETTINGS.iter().find(|row| row.field.key == key)
}

/// Number of edges of a path.
pub const EDGES: Ty = Ty::int(1, 10_000);

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

lumbre_light::table! {
    /// Option `aa` of the render table.
    const AA = "Antialiasing",
        "Pixel filter. Samples are distributed by importance sampling of the filter.";
    filter = "box": Ty::Word(FilterKind::NAMES),
        "shape of the filter: constant, linear, a Gaussian truncated at three sigma, a \
         Blackman-Harris window, or the untruncated Gaussian of thesis S0 (sigma = 2 radius)";
    radius = "0.5": Ty::num(0.0, 16.0),
        "half width in pixels; a box of 0.5 is the pixel itself; for `antialiasing_radius`, half \
         of sigma";
}

lumbre_light::table! {
    /// Option `rr` of the render table.
    const ROULETTE = "RussianRoulette",
        "Russian roulette: terminates paths at random without changing the mean.";
    start: EDGES, "first path edge after which a path may be terminated";
}

/// Settings by their keys in scripts, in the order of the documentation. `view` and `camera` are
/// changes to the scene, which the row `set` reads, and `atrous` the parameters that `denoise` reads.
/// The integrator and its parameters are read by the caller, who knows those that a script declares.
pub static SETTINGS: [Setting; 18] = [
    Setting {
        field: field! {
            scene: Ty::Str, "scene file, relative to the current folder or else to the script's"
        },
        inherited: true,
        read: |settings, given| {
            settings.scene = given.text("scene").unwrap_or_default().to_owned();
            let at = given.at("scene");
            settings.scene_file = find_file(&settings.scene, given.folder, &at, "scene")?;
            Ok(())
        },
        identity: |_| None,
    },
    Setting {
        field: field! {
            scene_options = "the scene's defaults": Ty::Any("table<string, string|number|boolean>"),
                "options of a Lua scene: { light = \"sun\" }"
        },
        inherited: true,
        read: |settings, given| {
            if let Some(options) = given.map.get("scene_options") {
                settings.scene_options = scene_options(options, &given.at("scene_options"))?;
            }
            Ok(())
        },
        identity: |_| None,
    },
    Setting {
        field: field! {
            view = "the scene's camera": Ty::Str,
                "name of a view of the scene; the changes of `camera` apply to it"
        },
        inherited: true,
        read: |_, _| Ok(()),
        identity: |_| None,
    },
    Setting {
        field: field! {
            integrator: Ty::WordOrDeclared(&INTEGRATOR_NAMES),
                "integrator (technique), or another renderer that `external` returned; its own \
                 parameters are keys of this table"
        },
        inherited: true,
        read: |_, _| Ok(()),
        identity: |settings| Some(("integrator", integrator_identity(settings)?)),
    },
    Setting {
        field: field! {
            max_depth = "the scene's": EDGES,
                "largest number of path edges from camera to light: 1 is emission only, 2 adds \
                 direct light"
        },
        inherited: true,
        read: |settings, given| {
            settings.max_depth = integer(given.map.get("max_depth"));
            Ok(())
        },
        identity: |settings| Some(("max_depth", optional(settings.max_depth))),
    },
    Setting {
        field: field! {
            resolution = "the scene's": Ty::nums(2, 1.0, MAX_SIDE as f64),
                "width and height in pixels"
        },
        inherited: true,
        read: |settings, given| {
            settings.resolution = resolution(given)?;
            Ok(())
        },
        identity: |settings| {
            let sides = |sides: [u32; 2]| Value::List(sides.map(Value::from).into());
            let resolution = settings.resolution.map_or(Value::Nil, sides);
            Some(("resolution", resolution))
        },
    },
    Setting {
        field: field!(aa = "a box of one pixel": Ty::Table(&AA), "pixel filter"),
        inherited: true,
        read: |settings, given| {
            let kind = given.nested("aa", "filter").and_then(Value::as_str);
            if let Some(kind) = kind.and_then(FilterKind::from_name) {
                settings.filter.kind = kind;
            }
            if let Some(radius) = given.nested("aa", "radius").and_then(Value::as_f64) {
                settings.filter.radius = radius as f32;
            }
            Ok(())
        },
        identity: |settings| {
            let radius = Value::number(f64::from(settings.filter.radius));
            let kind = settings.filter.kind.name().into();
            Some((
                "filter",
                Value::from_iter([("kind", kind), ("radius", radius)]),
            ))
        },
    },
    Setting {
        field: field! {
            sampler = "independent": Ty::Word(&SAMPLER_NAMES),
                "source of sample numbers: `independent` is uniform random, `sobol` \
                 low-discrepancy in each pixel, `zsobol16` over neighbouring pixels together in \
                 blocks of 16 samples, so that their errors cancel; except for `independent`, \
                 standard errors are mostly too large"
        },
        inherited: true,
        read: |settings, given| {
            if let Some(sampler) = given.text("sampler") {
                settings.sampler = sampler.to_owned();
            }
            Ok(())
        },
        identity: |settings| {
            let row = sampler(&settings.sampler)?;
            Some(("sampler", Value::from_iter(named(row.name, row.revision))))
        },
    },
    Setting {
        field: field!(camera = "the scene's": Ty::Table(&CAMERA), "changes to the scene's camera"),
        inherited: true,
        read: |_, _| Ok(()),
        identity: |_| None,
    },
    Setting {
        field: field! {
            set = "": Ty::Any("table<string, number|string|boolean|number[]>"),
                "changes to the scene, by path: { [\"materials.egg.ior\"] = 1.5 }"
        },
        inherited: true,
        read: |settings, given| {
            settings.set = read_changes(given)?;
            let file = &settings.scene_file;
            if settings.set.contains_key(ENVIRONMENT_MAP) && is_named_as_model(file) {
                // The map lights the model alone: the stage that it replaces has nothing else.
                let stage = settings.scene_options.entry(stage::OPTION.to_owned());
                stage.or_insert_with(|| stage::WHITE.into());
            }
            Ok(())
        },
        identity: |_| None,
    },
    Setting {
        field: field! {
            films = "none": Ty::OneOrMany(&Ty::Word(&LAYER_NAMES)),
                "layers to store besides the picture, as further channels of its OpenEXR file or, \
                 for `depth` and `strategies`, as files below films/ in the run's folder: { \
                 \"albedo\", \"depth\" }; a reference does not inherit them"
        },
        inherited: false,
        read: |settings, given| {
            settings.films = films(given.map.get("films"));
            Ok(())
        },
        identity: |settings| {
            let names = settings.films.iter().map(|layer| layer.row().name.into());
            let films = (!settings.films.is_empty()).then(|| Value::List(names.collect()));
            films.map(|films| ("films", films))
        },
    },
    Setting {
        field: field! {
            film = "no time axis": Ty::Table(&FILM),
                "time axis: { time = { bin = 0.01, bins = 300 } }; a reference does not inherit it"
        },
        inherited: false,
        read: |settings, given| {
            if let Some(film) = given.table("film") {
                settings.timing = Timing::from_film(film, &given.at("film"))?;
            }
            Ok(())
        },
        identity: |settings| Some(("film", settings.timing.as_ref()?.to_film(false))),
    },
    Setting {
        field: field!(rr = "never": Ty::Table(&ROULETTE), "Russian roulette"),
        inherited: true,
        read: |settings, given| {
            settings.rr_start = integer(given.nested("rr", "start"));
            Ok(())
        },
        identity: |settings| Some(("rr_start", optional(settings.rr_start))),
    },
    Setting {
        field: field! {
            denoise = "none": Ty::Word(&denoise::NAMES),
                "denoiser of the picture before it is measured and stored, on the clock of the \
                 run: the built-in wavelet filter `atrous`, or `oidn`, Open Image Denoise, which \
                 LUMBRE_OIDN names; denoised pictures are biased, and references are never denoised"
        },
        inherited: false,
        read: |settings, given| {
            let none = BTreeMap::new();
            let parameters = given.table("atrous").unwrap_or(&none);
            let name = given.text("denoise");
            settings.denoise = name.and_then(|name| Denoise::from_name(name, parameters));
            Ok(())
        },
        identity: |settings| Some(("denoise", settings.denoise.as_ref()?.to_value())),
    },
    Setting {
        field: field! {
            atrous = "its defaults": Ty::Table(&ATROUS), "parameters of `denoise = \"atrous\"`"
        },
        inherited: false,
        read: |_, _| Ok(()),
        identity: |_| None,
    },
    Setting {
        field: field! {
            accel = "ploc": Ty::Table(&ACCEL),
                "construction of the acceleration structure; affects only times, never pictures"
        },
        inherited: false,
        read: |settings, given| {
            if let Some(accel) = given.table("accel") {
                settings.accel = AccelSpec::from_map(accel);
            }
            Ok(())
        },
        // It changes no picture, but measured times.
        identity: |settings| {
            let accel = settings.accel.identity();
            (!accel.is_empty()).then_some(("accel", Value::Map(accel)))
        },
    },
    Setting {
        field: Field::optional(
            "shaders",
            Ty::Str,
            BUILT_IN,
            "folder whose shaders replace those of the program on Vulkan backends, relative to the \
             current folder or else to the script's; needs the compiler of shaders, a program on \
             PATH; a reference does not inherit it",
        ),
        inherited: false,
        read: |settings, given| {
            settings.shaders = match given.text("shaders") {
                None => Shaders::Unset,
                Some(name) if name == BUILT_IN => Shaders::BuiltIn,
                Some(name) => Shaders::Folder(ShaderFolder {
                    path: find_folder(name, given.folder, &given.at("shaders"), "shaders")?,
                    hash: String::new(),
                }),
            };
            Ok(())
        },
        identity: |settings| Some(("shaders", settings.shaders.folder()?.hash.as_str().into())),
    },
    Setting {
        // The caller, who knows the backends, checks the name.
        field: field! {
            backend = "auto": Ty::Str, "backend that renders; `auto` is the first usable one"
        },
        inherited: true,
        read: |settings, given| {
            if let Some(backend) = given.text("backend") {
                settings.backend = backend.to_owned();
            }
            Ok(())
        },
        // A run that may fall back to another backend must not share its id with one that cannot.
        identity: |settings| {
            let may_fall_back = settings.fallback.is_some();
            let name = if may_fall_back {
                "auto"
            } else {
                &settings.backend
            };
            Some(("backend", name.into()))
        },
    },
];

/// Returns what identifies an integrator: its row and its parameters, or the declared technique.
fn integrator_identity(settings: &Settings) -> Option<Value> {
    let row = integrator(&settings.integrator)?;
    let params = if is_declared(row) {
        technique::identity(&settings.params)
    } else {
        let mut params = settings.params.clone();
        params.remove(PYTHON.key);
        params
    };
    let library = own::library(row).map(|hash| (LIBRARY, hash.into()));
    let row = named(&settings.integrator, row.revision);
    let params = [("params", Value::Map(params))];
    Some(Value::from_iter(
        row.into_iter().chain(params).chain(library),
    ))
}

/// Returns what identifies a row of a table.
fn named(name: &str, revision: u32) -> [(&'static str, Value); 2] {
    [("name", name.into()), ("revision", revision.into())]
}

/// Key of the hash of a technique's library among the fields of the integrator in an identity.
pub const LIBRARY: &str = "library";

fn optional(number: Option<u32>) -> Value {
    number.map_or(Value::Nil, Value::from)
}

fn integer(value: Option<&Value>) -> Option<u32> {
    value
        .and_then(Value::as_i64)
        .and_then(|i| u32::try_from(i).ok())
}

/// Checks the options of a scene: named strings, numbers and booleans.
fn scene_options(value: &Value, path: &str) -> Result<BTreeMap<String, Value>, SchemaError> {
    let fail = |problem: String, key: &str| Err(SchemaError::new(path, key, problem));
    let plain = |v: &Value| {
        matches!(
            v,
            Value::Bool(_) | Value::Int(_) | Value::Num(_) | Value::Str(_)
        )
    };
    match value {
        Value::List(items) if items.is_empty() => Ok(BTreeMap::new()),
        Value::Map(map) => match map.iter().find(|(_, v)| !plain(v)) {
            Some((name, v)) => {
                let kind = v.kind();
                let expected = "expected a string, a number or a boolean";
                fail(format!("{name}: {expected}, found {kind}"), name)
            }
            None => Ok(map.clone()),
        },
        other => {
            let kind = other.kind();
            let problem = format!("expected a table of options, found {kind}");
            fail(problem, "scene_options")
        }
    }
}

fn resolution(given: &Given<'_>) -> Result<Option<[u32; 2]>, SchemaError> {
    let Some(items) = given.map.get("resolution").and_then(Value::as_list) else {
        return Ok(None);
    };
    let sides: Option<Vec<u32>> = items.iter().map(|v| integer(Some(v))).collect();
    match sides.as_deref() {
        Some([width, height]) => Ok(Some([*width, *height])),
        _ => Err(SchemaError::new(
            given.at("resolution"),
            "resolution",
            "expected a whole number of pixels in each direction",
        )),
    }
}

/// Returns the layers of a checked field in the order of their table, so that the order in the
/// script has no effect.
fn films(value: Option<&Value>) -> Vec<Layer> {
    let named = value
        .map(|v| v.as_list().unwrap_or(std::slice::from_ref(v)))
        .unwrap_or_default();
    let mut layers: Vec<Layer> = named
        .iter()
        .filter_map(|v| Layer::from_name(v.as_str()?))
        .collect();
    layers.sort();
    layers.dedup();
    layers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_in_the_order_of_their_table_each_once() {
        let asked = ["normal", "depth", "albedo", "depth"]
            .map(Value::from)
            .to_vec();
        assert_eq!(
            films(Some(&Value::List(asked))),
            [Layer::Depth, Layer::Albedo, Layer::Normal]
        );
        assert_eq!(films(Some(&"rays".into())), [Layer::Rays]);
        assert!(films(None).is_empty() && films(Some(&Value::List(Vec::new()))).is_empty());
    }

    #[test]
    fn names_in_the_schema_are_those_of_the_table() {
        assert!(INTEGRATOR_NAMES.iter().all(|n| integrator(n).is_some()));
    }
}
