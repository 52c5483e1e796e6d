//! Description of a technique of another program: its command, where its scene and its times come
//! from, and which settings it honours.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::clock::Clock;
use super::picture::{LAYERS, PictureFormat};
use super::words;
use lumbre_light::field;
use lumbre_light::transport::camera::FilterKind;
use lumbre_light::transport::integrator::external::{PREFIX, is_free_name};
use lumbre_light::value::Value;
use lumbre_light::value::schema::{Field, Table, Ty, duration_s, unknown_name};

/// Default of `timeout`, in seconds.
pub const DEFAULT_TIMEOUT_S: f64 = 600.0;
/// Greatest time that the version command may take.
const VERSION_TIMEOUT: Duration = Duration::from_secs(60);

/// Scene that is exported, and start of the name of a file that the program reads as it is.
const EXPORT: &str = "export:mitsuba";
const RAW: &str = "raw:";

/// Keys of the parameters of a run that the schema does not have: folder of the script, file of the
/// scene, and values of the technique's own parameters. The first two are no part of a run's
/// identity.
pub const FOLDER: &str = "folder";
/// Key of the path of a scene file that the program reads as it is.
pub const SCENE_FILE: &str = "scene_file";
/// Key of the version that was found when the run was planned, for people; the identity has it
/// elsewhere.
pub const FOUND_VERSION: &str = "found_version";
/// Key of the values of the technique's own parameters.
pub const VALUES: &str = "values";

/// Placeholders of a wave, which a server receives as requests instead.
const OF_WAVE: [&str; 4] = ["spp", "seed", "seconds", "out"];
/// All placeholders other than the technique's own parameters.
const PLACEHOLDERS: [&str; 13] = [
    "scene", "width", "height", "depth", "threads", "folder", "work", "filter", "radius", "spp",
    "seed", "seconds", "out",
];

/// Options of `external` in scripts.
pub const EXTERNAL: Table = Table {
    name: "External",
    doc: "Another renderer as a technique: the command that renders a wave of samples, or that \
          serves requests for them.",
    fields: &[
        field! {
            name: Ty::Str,
                "name of the technique: letters, digits, `_`, `-` and `.`; it appears as \
                 `external:NAME`"
        },
        field! {
            command: Ty::Any("string|string[]"),
                "program and arguments with placeholders, as a list or as a line that is split at \
                 white space outside quotes; no shell runs it"
        },
        field! {
            version = "no version": Ty::Any("string|string[]"),
                "command that prints the version of the program; it runs once for each plan, and \
                 the first line that it prints is part of the identity of runs; if it fails, the \
                 points of the technique are left out with the reason"
        },
        field! {
            params = "none": Ty::Any("table<string, string|number|boolean>"),
                "parameters of its own with their defaults: keys of the render table, and \
                 placeholders of the commands"
        },
        field! {
            time = "clock": Ty::Str,
                "render time: `clock` is the wall clock of the process, start and scene loading \
                 included; `json` is `seconds` in the last line of its output that is a JSON \
                 object; anything else is a line of its output with `{seconds}` or \
                 `{milliseconds}` in the place of the number"
        },
        Field::optional(
            "scene",
            Ty::Str,
            EXPORT,
            "scene that it reads: `export:mitsuba` is the cell's scene as a Mitsuba 3 scene file; \
             `raw:FILE` is a file of the program's own format, whose content is part of the \
             identity",
        ),
        field! {
            serve = "false": Ty::Bool,
                "whether one process renders all waves of a run, as lines on its standard input \
                 request them"
        },
        field! {
            picture = "exr": Ty::Word(PictureFormat::NAMES),
                "format of the pictures: OpenEXR, portable float map or Radiance HDR, with linear \
                 radiance"
        },
        field! {
            timeout = "600": Ty::Duration,
                "time after which a process that has not finished a wave is ended, and its cell \
                 fails"
        },
        field! {
            filters = "box of one pixel only": Ty::Any("table<string, string>"),
                "pixel filters that the program has, with its word for each: { gauss = \
                 \"gaussian\" }; the command receives them by `{filter}` and `{radius}`"
        },
        field! {
            layers = "none": Ty::Any("table<string, string>"),
                "layers in the program's EXR files, with the names of their channels: { albedo = \
                 \"Albedo\" } for the channels Albedo.R, Albedo.G and Albedo.B; `albedo`, `normal` \
                 and `distance` are possible"
        },
        field! {
            non_finite = "fail": Ty::Word(&["fail", "black"]),
                "treatment of values that are NaN or infinite: the cell fails, or they count as \
                 black and are reported, as for built-in techniques"
        },
    ],
};

/// Scene that a program reads.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneSource {
    /// Scene of the cell, exported for Mitsuba 3.
    Mitsuba,
    /// File that is passed on as it is.
    Raw(PathBuf),
}

/// Technique of another program with the values of its parameters.
#[derive(Clone, Debug)]
pub struct Technique {
    /// Name for people: that of the integrator without [`PREFIX`].
    pub name: String,
    /// Version that was found when the run was planned; empty if there is none.
    pub found_version: String,
    /// Words of the command with placeholders.
    pub command: Vec<String>,
    /// Words of the command that prints the version, if there is one.
    pub version: Option<Vec<String>>,
    /// Source of render times.
    pub clock: Clock,
    /// Scene that the program reads.
    pub scene: SceneSource,
    /// Whether one process serves all waves of a run.
    pub serve: bool,
    /// Format of the pictures.
    pub picture: PictureFormat,
    /// Greatest time for a wave, including the start of the program.
    pub timeout: Duration,
    /// The program's words for pixel filters, by the filter's name.
    pub filters: BTreeMap<String, String>,
    /// Names of EXR channels by the layer's name.
    pub layers: BTreeMap<String, String>,
    /// Whether values that are not finite count as black.
    pub non_finite_is_black: bool,
    /// Number of paths that it traces at a time, if known.
    pub lanes: Option<u32>,
    /// Script of a bridge of this program, with its file name, which `{work}` contains.
    pub bridge: Option<(&'static str, &'static str)>,
    /// Values of placeholders that are known before a run: own parameters, and `folder`.
    pub values: BTreeMap<String, String>,
}

impl Technique {
    /// Reads the parameters of a run with a technique that a script declares.
    ///
    /// # Errors
    /// Returns a message for the first parameter that is wrong.
    pub fn declared(
        integrator: &str,
        params: &BTreeMap<String, Value>,
    ) -> Result<Technique, String> {
        let text = |key: &str| params.get(key).and_then(Value::as_str);
        let mut values = own_values(params)?;
        values.insert(FOLDER.to_owned(), text(FOLDER).unwrap_or(".").to_owned());
        let known: Vec<&str> = PLACEHOLDERS
            .into_iter()
            .chain(values.keys().map(String::as_str))
            .collect();
        let command = words_of(params, "command", &known)?.ok_or("`command` is missing")?;
        let of_version: Vec<&str> = values.keys().map(String::as_str).collect();
        let technique = Technique {
            name: integrator
                .strip_prefix(PREFIX)
                .unwrap_or(integrator)
                .to_owned(),
            found_version: text(FOUND_VERSION).unwrap_or_default().to_owned(),
            command,
            version: words_of(params, "version", &of_version)?,
            clock: Clock::from_text(text("time").unwrap_or("clock"))?,
            scene: scene_source(params)?,
            serve: params.get("serve") == Some(&Value::Bool(true)),
            picture: text("picture")
                .and_then(PictureFormat::from_name)
                .unwrap_or(PictureFormat::Exr),
            timeout: timeout(params)?,
            filters: named_texts(params, "filters", FilterKind::NAMES)?,
            layers: named_texts(params, "layers", &LAYERS.map(|layer| layer.row().name))?,
            non_finite_is_black: text("non_finite") == Some("black"),
            lanes: None,
            bridge: None,
            values,
        };
        technique.check()?;
        Ok(technique)
    }

    /// Checks that the parts of the description fit together.
    fn check(&self) -> Result<(), String> {
        let has = |name: &str| words::has(&self.command, name);
        if !is_free_name(&self.name) {
            return Err(format!(
                "`{}` cannot name a technique: use at most 40 letters, digits, `_`, `-` and `.`; \
                 `mitsuba` is a built-in bridge",
                self.name
            ));
        }
        if !has("scene") && self.scene == SceneSource::Mitsuba {
            return Err(
                "the command has no {scene}, the scene file that it reads; if it needs \
                        none, name the file that it renders: scene = \"raw:FILE\""
                    .to_owned(),
            );
        }
        if !self.layers.is_empty() && self.picture != PictureFormat::Exr {
            return Err("`layers` need pictures in OpenEXR: leave `picture` out".to_owned());
        }
        if !self.filters.is_empty() && !has("filter") {
            return Err("`filters` are declared, but the command has no {filter}".to_owned());
        }
        if self.filters.is_empty() && (has("filter") || has("radius")) {
            return Err("the command has {filter} or {radius}, but `filters` is empty".to_owned());
        }
        if self.serve {
            return match OF_WAVE.into_iter().find(|name| has(name)) {
                Some(name) => Err(format!(
                    "a server receives {{{name}}} in its requests: leave it out of the command"
                )),
                None if self.clock != Clock::Wall => {
                    Err("a server replies with its render time: leave `time` out".to_owned())
                }
                None => Ok(()),
            };
        }
        if !has("out") {
            return Err("the command has no {out}, the picture file that it writes".to_owned());
        }
        if !has("seed") {
            return Err(
                "the command has no {seed}: without one, all waves have the same samples, \
                        and their mean does not converge"
                    .to_owned(),
            );
        }
        match (has("spp"), &self.clock) {
            (false, _) if !has("seconds") => {
                Err("the command has no {spp}, the samples per pixel of a wave".to_owned())
            }
            (false, clock) if *clock != Clock::Json => Err(
                "the command has {seconds} but no {spp}: it must report its samples per pixel, \
                 with time = \"json\""
                    .to_owned(),
            ),
            _ => Ok(()),
        }
    }

    /// Returns whether the program renders pictures of one size only, that of its scene file.
    pub fn has_fixed_size(&self) -> bool {
        !words::has(&self.command, "width") && matches!(self.scene, SceneSource::Raw(_))
    }

    /// Returns the command and that of the version as they run, except for the placeholders of a
    /// run and its waves.
    pub fn command_lines(&self) -> (Vec<String>, Option<Vec<String>>) {
        let fill = |command: &[String]| words::fill(command, &self.values);
        (fill(&self.command), self.version.as_deref().map(fill))
    }

    /// Returns the files of the script's folder that the commands name, `{folder}/FILE`, with the
    /// words that name them; their content is part of the identity. So is that of a raw scene.
    pub fn files(&self) -> Vec<(String, PathBuf)> {
        let folder = self.values.get(FOLDER).map_or(".", String::as_str);
        let named = |word: &String| {
            let name = word.strip_prefix("{folder}/")?;
            let path = Path::new(folder).join(name);
            path.is_file().then(|| (word.clone(), path))
        };
        let version = self.version.iter().flatten();
        let mut files: Vec<_> = self
            .command
            .iter()
            .chain(version)
            .filter_map(named)
            .collect();
        if let SceneSource::Raw(file) = &self.scene {
            files.push(("scene".to_owned(), file.clone()));
        }
        files
    }

    /// Returns the time that the version command may take.
    pub(super) fn version_timeout(&self) -> Duration {
        self.timeout.min(VERSION_TIMEOUT)
    }
}

/// Returns the parameters of a declared technique that are part of a run's identity: all except
/// places and limits, which change no picture.
pub fn identity(params: &BTreeMap<String, Value>) -> BTreeMap<String, Value> {
    let mut params = params.clone();
    params.retain(|key, _| ![FOLDER, SCENE_FILE, FOUND_VERSION, "timeout"].contains(&key.as_str()));
    if let Some(Value::Str(scene)) = params.get_mut("scene")
        && scene.starts_with(RAW)
    {
        RAW.clone_into(scene);
    }
    params
}

/// Returns the file of a scene `raw:FILE`.
pub fn raw_scene(scene: &str) -> Option<&str> {
    scene.strip_prefix(RAW)
}

/// Splits the commands in the options of a script into words.
///
/// # Errors
/// Returns a message for a command that is not a line or a list of words.
pub fn split_commands(options: &mut BTreeMap<String, Value>) -> Result<(), String> {
    for key in ["command", "version"] {
        let Some(value) = options.get_mut(key) else {
            continue;
        };
        let words = match value {
            Value::Str(line) => words::split(line).map_err(|e| format!("`{key}`: {e}"))?,
            Value::List(items) => items
                .iter()
                .map(|item| match item {
                    Value::Str(_) | Value::Int(_) | Value::Num(_) => Ok(item.to_string()),
                    other => Err(format!("`{key}`: a word is {}, not text", other.kind())),
                })
                .collect::<Result<_, _>>()?,
            other => {
                let kind = other.kind();
                return Err(format!(
                    "`{key}`: expected a line or a list of words, found {kind}"
                ));
            }
        };
        *value = Value::List(words.into_iter().map(Value::Str).collect());
    }
    Ok(())
}

fn words_of(
    params: &BTreeMap<String, Value>,
    key: &str,
    known: &[&str],
) -> Result<Option<Vec<String>>, String> {
    let Some(value) = params.get(key) else {
        return Ok(None);
    };
    let texts = |words: &[Value]| -> Option<Vec<String>> {
        words
            .iter()
            .map(|w| w.as_str().map(str::to_owned))
            .collect()
    };
    let words = value.as_list().and_then(texts);
    let words = words.ok_or_else(|| format!("`{key}`: expected a list of words"))?;
    words::check(&words, known).map_err(|e| format!("`{key}`: {e}"))?;
    Ok(Some(words))
}

/// Returns the technique's own parameters as text.
fn own_values(params: &BTreeMap<String, Value>) -> Result<BTreeMap<String, String>, String> {
    let values = match params.get(VALUES) {
        None => return Ok(BTreeMap::new()),
        Some(Value::Map(values)) => values,
        Some(other) => {
            return Err(format!(
                "`params`: expected a table, found {}",
                other.kind()
            ));
        }
    };
    let text = |(name, value): (&String, &Value)| {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic());
        if !starts_well || !name.chars().all(plain) || name.len() > 40 {
            return Err(format!("`{name}` cannot name a parameter"));
        }
        if PLACEHOLDERS.contains(&name.as_str()) {
            return Err(format!(
                "`{name}` is a placeholder already: choose another name"
            ));
        }
        match value {
            Value::Str(_) | Value::Bool(_) | Value::Int(_) | Value::Num(_) => {
                Ok((name.clone(), value.to_string()))
            }
            other => Err(format!(
                "`params.{name}`: expected text, a number or a boolean, found {}",
                other.kind()
            )),
        }
    };
    values.iter().map(text).collect()
}

fn scene_source(params: &BTreeMap<String, Value>) -> Result<SceneSource, String> {
    let scene = params
        .get("scene")
        .and_then(Value::as_str)
        .unwrap_or(EXPORT);
    match raw_scene(scene) {
        Some(file) => {
            let found = params.get(SCENE_FILE).and_then(Value::as_str);
            Ok(SceneSource::Raw(PathBuf::from(found.unwrap_or(file))))
        }
        None if scene == EXPORT => Ok(SceneSource::Mitsuba),
        None => Err(format!(
            "unknown scene `{scene}`: expected `{EXPORT}` or `{RAW}FILE`"
        )),
    }
}

fn timeout(params: &BTreeMap<String, Value>) -> Result<Duration, String> {
    let seconds = params
        .get("timeout")
        .map_or(Some(DEFAULT_TIMEOUT_S), duration_s);
    match seconds.and_then(|s| Duration::try_from_secs_f64(s).ok()) {
        Some(timeout) if !timeout.is_zero() && timeout.as_secs() < 10_000_000 => Ok(timeout),
        _ => Err("`timeout` must be a positive duration of at most 2777 hours".to_owned()),
    }
}

/// Reads a table from names of this program to those of the other one.
fn named_texts(
    params: &BTreeMap<String, Value>,
    key: &str,
    known: &[&str],
) -> Result<BTreeMap<String, String>, String> {
    let map = match params.get(key) {
        None => return Ok(BTreeMap::new()),
        Some(Value::List(items)) if items.is_empty() => return Ok(BTreeMap::new()),
        Some(Value::Map(map)) => map,
        Some(other) => return Err(format!("`{key}`: expected a table, found {}", other.kind())),
    };
    let pair = |(name, value): (&String, &Value)| {
        if !known.contains(&name.as_str()) {
            let path = format!("`{key}.{name}`");
            return Err(unknown_name(&path, name, "name", known.iter().copied()).to_string());
        }
        let text = value.as_str().filter(|text| !text.is_empty());
        let text = text.ok_or_else(|| format!("`{key}.{name}`: expected a word of the program"))?;
        Ok((name.clone(), text.to_owned()))
    };
    map.iter().map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params(pairs: &[(&str, Value)]) -> BTreeMap<String, Value> {
        let mut params: BTreeMap<String, Value> = pairs
            .iter()
            .map(|(key, value)| ((*key).to_owned(), value.clone()))
            .collect();
        split_commands(&mut params).unwrap();
        params
    }

    fn problem(pairs: &[(&str, Value)]) -> String {
        Technique::declared("external:toy", &params(pairs)).unwrap_err()
    }

    #[test]
    fn a_command_without_what_it_needs_is_refused_with_help() {
        for (command, reason) in [
            ("p {spp} {seed} {out}", "has no {scene}"),
            ("p {scene} {spp} {seed}", "has no {out}"),
            ("p {scene} {spp} {out}", "has no {seed}"),
            ("p {scene} {seed} {out}", "has no {spp}"),
            ("p {scene} {seconds} {seed} {out}", "time = \"json\""),
            (
                "p {scene} {spp} {seed} {out} {filter}",
                "`filters` is empty",
            ),
            (
                "p {scene} {spp} {seed} {out} {guide}",
                "unknown placeholder {guide}",
            ),
        ] {
            let found = problem(&[("command", command.into())]);
            assert!(found.contains(reason), "{command}: {found}");
        }
        let whole = ("command", Value::from("p {scene} {spp} {seed} {out}"));
        for (key, value, reason) in [
            ("serve", Value::Bool(true), "leave it out of the command"),
            ("time", "{second}".into(), "no source of times"),
            ("timeout", 0.0.into(), "`timeout` must be"),
            ("scene", "export:pbrt".into(), "unknown scene"),
        ] {
            let found = problem(&[whole.clone(), (key, value)]);
            assert!(found.contains(reason), "{key}: {found}");
        }
        let technique = Technique::declared("external:toy", &params(&[whole])).unwrap();
        assert_eq!(
            (technique.name.as_str(), technique.timeout.as_secs()),
            ("toy", 600)
        );
        assert!(!technique.has_fixed_size());
    }

    #[test]
    fn own_parameters_are_placeholders_and_part_of_the_identity() {
        let values = BTreeMap::from([("guide".to_owned(), Value::Bool(true))]);
        let mut all = params(&[
            (
                "command",
                "{folder}/p --guide={guide} {scene} {spp} {seed} {out}".into(),
            ),
            ("version", "p --version".into()),
            (VALUES, Value::Map(values)),
            (FOLDER, "/scripts".into()),
            ("timeout", 5.0.into()),
        ]);
        let technique = Technique::declared("external:toy", &all).unwrap();
        let (command, version) = technique.command_lines();
        assert_eq!(
            words::line(&command),
            "/scripts/p --guide=true {scene} {spp} {seed} {out}"
        );
        assert_eq!(version.unwrap(), ["p", "--version"]);
        let before = identity(&all);
        all.insert(FOLDER.to_owned(), "/elsewhere".into());
        all.insert("timeout".to_owned(), 9.0.into());
        assert_eq!(
            identity(&all),
            before,
            "places and limits change no picture"
        );
        let other = BTreeMap::from([("guide".to_owned(), Value::Bool(false))]);
        all.insert(VALUES.to_owned(), Value::Map(other));
        assert_ne!(identity(&all), before);
    }

    #[test]
    fn a_raw_scene_is_identified_by_its_content_alone() {
        let raw = |file: &str| {
            params(&[
                ("command", "p {spp} {seed} {out}".into()),
                ("scene", format!("raw:{file}").as_str().into()),
                (SCENE_FILE, format!("/scenes/{file}").as_str().into()),
            ])
        };
        assert_eq!(identity(&raw("a.pbrt")), identity(&raw("b.pbrt")));
        let technique = Technique::declared("external:toy", &raw("a.pbrt")).unwrap();
        assert!(technique.has_fixed_size());
        assert_eq!(
            technique.files(),
            [("scene".to_owned(), "/scenes/a.pbrt".into())]
        );
    }

    #[test]
    fn every_option_except_the_timeout_is_part_of_the_identity() {
        for key in EXTERNAL.fields.iter().map(|field| field.key) {
            let identity = identity(&BTreeMap::from([(key.to_owned(), "other".into())]));
            assert_eq!(identity.is_empty(), key == "timeout", "{key}");
        }
    }
}
