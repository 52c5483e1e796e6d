//! The parameters of the panel, made from the schemas of the render table, of the technique and of
//! the tone maps.

use lumbre_light::field;
use lumbre_light::transport::integrator::settings::STRATEGIES;
use lumbre_light::transport::integrator::{IntegratorRow, integrators};
use lumbre_light::value::Value;
use lumbre_light::value::schema::{AUTO, Field, Table, Ty};
use lumbre_lua::RENDER;
use lumbre_metrics::tonemap::TONEMAPS;

lumbre_light::named! {
    /// Group of parameters with a heading of its own.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum Group {
        /// The technique, its parameters, and the length of paths.
        Technique = "Technique",
        /// Random numbers and the pixel filter.
        Sampling = "Sampling",
        /// Position, direction and lens of the camera.
        Camera = "Camera",
        /// Films of the layers.
        Layers = "Layers",
        /// Tone map of the screen and of PNG files.
        Display = "Display",
        /// Limits after which rendering stops.
        Limits = "Limits",
    }
}

/// One parameter of the panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Path of the value in the [`Settings`](super::settings::Settings): the key of the render
    /// table, with a dot before the key of a nested table.
    pub path: String,
    /// Group under whose heading it stands.
    pub group: Group,
    /// Type, range, default and description.
    pub field: Field,
    /// Names that a value may have; empty for other types.
    pub names: Vec<String>,
}

/// Keys of the render table without a row: the scene has a list of its own, the resolution is that
/// of the pane, the backend is an option of the command line, pictures are not denoised, and the
/// others do not affect the picture or have no value that fits into a row.
const WITHOUT_ROW: [&str; 10] = [
    "scene",
    "scene_options",
    "resolution",
    "set",
    "film",
    "denoise",
    "atrous",
    "accel",
    "shaders",
    "backend",
];

/// Path of the technique.
pub const INTEGRATOR: &str = "integrator";

/// Path of the largest number of path edges.
pub const MAX_DEPTH: &str = "max_depth";

/// Path of the layers.
pub const FILMS: &str = "films";

/// Path of the name of the tone map.
pub const TONEMAP: &str = "display.kind";

/// Path of the exposure in stops.
pub const EXPOSURE: &str = "display.exposure";

/// Path of the seed of the experiment.
pub const SEED: &str = "seed";

/// Path of the largest number of samples per pixel.
pub const LIMIT_SAMPLES: &str = "limit.samples";

/// Path of the longest render time in seconds.
pub const LIMIT_TIME: &str = "limit.time";

/// Settings of the session that are no keys of the render table.
const SESSION: Table = Table {
    name: "Session",
    doc: "Settings of a session.",
    fields: &[
        Field::optional(
            SEED,
            Ty::int(0, u32::MAX as i64),
            "0",
            "seed of the experiment, from which the random numbers follow",
        ),
        Field::optional(
            LIMIT_SAMPLES,
            Ty::int(1, 1 << 40),
            "none",
            "samples per pixel after which rendering pauses",
        ),
        Field::optional(
            LIMIT_TIME,
            Ty::num(1e-3, 1e9),
            "none",
            "render time in seconds after which rendering pauses",
        ),
    ],
};

/// Returns the parameters of a technique, given the names of the scene's views and the name of the
/// tone map.
pub fn parameters(technique: &IntegratorRow, views: &[String], tonemap: &str) -> Vec<Parameter> {
    let mut all = Vec::new();
    for field in RENDER.fields {
        if WITHOUT_ROW.contains(&field.key) || (field.key == "view" && views.is_empty()) {
            continue;
        }
        match field.ty {
            Ty::Table(table) => all.extend(table.fields.iter().map(|inner| {
                let path = format!("{}.{}", field.key, inner.key);
                // Without a required field there is no table, as the default of the table states.
                let default = if inner.required {
                    field.default
                } else {
                    inner.default
                };
                parameter(path, Field { default, ..*inner }, views)
            })),
            _ => all.push(parameter(field.key.to_owned(), *field, views)),
        }
        if field.key == INTEGRATOR {
            let own = technique.params.fields.iter();
            all.extend(own.map(|field| parameter(field.key.to_owned(), *field, views)));
        }
    }
    all.push(parameter(TONEMAP.to_owned(), TONEMAP_FIELD, views));
    let map = TONEMAPS.iter().find(|(name, _)| *name == tonemap);
    let fields = map.map_or(&[][..], |(_, table)| table.fields);
    all.extend(
        fields
            .iter()
            .map(|field| parameter(format!("display.{}", field.key), *field, views)),
    );
    let session = SESSION.fields.iter();
    all.extend(session.map(|field| parameter(field.key.to_owned(), *field, views)));
    // The order within a group is that of the schemas.
    all.sort_by_key(|parameter| parameter.group);
    all
}

/// The name of the tone map.
const TONEMAP_FIELD: Field = field! {
    tonemap = "srgb": Ty::Str, "tone map of the screen and of PNG files"
};

fn parameter(path: String, field: Field, views: &[String]) -> Parameter {
    let group = match path.split('.').next().unwrap_or_default() {
        "camera" | "view" => Group::Camera,
        "aa" | "sampler" | SEED => Group::Sampling,
        FILMS => Group::Layers,
        "display" => Group::Display,
        "limit" => Group::Limits,
        _ => Group::Technique,
    };
    let owned = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
    let names = match (path.as_str(), field.ty) {
        (INTEGRATOR, _) => integrators().map(|row| row.name.to_owned()).collect(),
        (TONEMAP, _) => TONEMAPS
            .iter()
            .map(|(name, _)| (*name).to_owned())
            .collect(),
        ("view", _) => views.to_vec(),
        (_, Ty::Word(words)) => owned(words),
        (_, Ty::OneOrMany(Ty::Word(words))) => owned(words),
        (_, Ty::Bool) => owned(&["true", "false"]),
        _ => Vec::new(),
    };
    Parameter {
        path,
        group,
        field,
        names,
    }
}

/// Size of a step of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The next smaller value, or the previous name.
    Down,
    /// The next larger value, or the next name.
    Up,
    /// A value that is about ten steps smaller.
    FarDown,
    /// A value that is about ten steps larger.
    FarUp,
}

impl Step {
    fn is_up(self) -> bool {
        matches!(self, Step::Up | Step::FarUp)
    }

    fn count(self) -> i64 {
        let count = match self {
            Step::Down | Step::Up => 1,
            Step::FarDown | Step::FarUp => 10,
        };
        if self.is_up() { count } else { -count }
    }
}

impl Parameter {
    /// Name in the panel: the last key of the path.
    pub fn name(&self) -> &str {
        match self.path.as_str() {
            TONEMAP => "tonemap",
            "rr.start" => "roulette",
            path => path.rsplit('.').next().unwrap_or(path),
        }
    }

    /// Returns the value one step away from `current`, or from `default` if there is none.
    /// `Some(None)` means that the value becomes the default, `None` that there is no such step.
    pub fn step(
        &self,
        step: Step,
        current: Option<&Value>,
        default: Option<&Value>,
        max_depth: u32,
    ) -> Option<Option<Value>> {
        if !self.names.is_empty() {
            return Some(self.next_name(step, current.or(default)));
        }
        let value = current.or(default).and_then(Value::as_f64);
        let ty = match self.field.ty {
            Ty::OrAuto(inner) => *inner,
            ty => ty,
        };
        match ty {
            Ty::Int { min, max } => {
                let next = match (value, step.is_up()) {
                    (Some(value), _) => value as i64 + step.count() * magnitude(value, max),
                    (None, true) => min,
                    (None, false) => return None,
                };
                // Below the smallest value of an optional field is the default.
                if next < min && default.is_none() {
                    return Some(None);
                }
                Some(Some(Value::Int(next.clamp(min, max))))
            }
            Ty::Num { min, max } => {
                let next = next_number(value?, step, self.path == EXPOSURE);
                Some(Some(Value::number(next.clamp(min, max))))
            }
            Ty::Nums { len: 2, .. } if self.path == STRATEGIES.key => {
                Some(next_strategy(step, current, max_depth))
            }
            _ => None,
        }
    }

    fn next_name(&self, step: Step, current: Option<&Value>) -> Option<Value> {
        let now = current.map(Value::to_string);
        let index = now.and_then(|now| self.names.iter().position(|name| *name == now));
        // Layers are optional: before the first and after the last is none.
        let optional = self.path == FILMS || self.path == "view";
        let count = self.names.len() + usize::from(optional);
        let index = index.map_or(if optional { count - 1 } else { 0 }, |index| index);
        let next = if step.is_up() {
            (index + 1) % count
        } else {
            (index + count - 1) % count
        };
        let name = self.names.get(next)?;
        Some(match self.field.ty {
            Ty::Bool => Value::Bool(name == "true"),
            _ => Value::from(name.as_str()),
        })
    }

    /// Parses a value as a user types it: a number, several numbers, or a name.
    ///
    /// # Errors
    /// Returns a message if the value has the wrong type or is out of range.
    pub fn parse(&self, text: &str) -> Result<Value, String> {
        let number = |word: &str| {
            let int = word.parse::<i64>().map(Value::Int);
            int.or_else(|_| word.parse::<f64>().map(Value::number))
        };
        let words: Vec<&str> = text
            .split([',', ' '])
            .filter(|word| !word.is_empty())
            .collect();
        let numbers: Result<Vec<Value>, _> = words.iter().map(|word| number(word)).collect();
        let value = match (&words[..], numbers) {
            (["true"], _) => Value::Bool(true),
            (["false"], _) => Value::Bool(false),
            ([_], Ok(mut numbers)) => numbers.remove(0),
            ([], _) => return Err("there is no value".to_owned()),
            (_, Ok(numbers)) => Value::List(numbers),
            (_, Err(_)) => Value::from(text.trim()),
        };
        let known = self.names.is_empty() || self.names.contains(&value.to_string());
        if !known {
            return Err(format!("known: {}", self.names.join(", ")));
        }
        let checked = self.field.ty.check(self.name(), self.field.key, &value);
        checked.map_err(|e| e.to_string())?;
        Ok(value)
    }

    /// Whether a value can be typed; otherwise only names can be chosen.
    pub fn is_typed(&self) -> bool {
        self.names.is_empty()
    }
}

/// Returns the text of a value in the panel.
pub fn text(value: &Value) -> String {
    match value {
        Value::List(items) => items.iter().map(text).collect::<Vec<_>>().join(" "),
        Value::Num(x) => format!("{}", rounded(*x)),
        Value::Nil => AUTO.to_owned(),
        other => other.to_string(),
    }
}

/// Rounds a number to four significant digits.
pub fn rounded(x: f64) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// Size of a step of an integer: 1, or about a tenth of large values.
fn magnitude(value: f64, max: i64) -> i64 {
    if max <= 10_000 || value < 100.0 {
        1
    } else {
        10i64.pow(value.log10() as u32 - 1)
    }
}

/// Returns the next number: a quarter of a stop for exposures, else a twentieth of the value, and
/// from zero a hundredth.
fn next_number(value: f64, step: Step, is_exposure: bool) -> f64 {
    let count = step.count() as f64;
    if is_exposure {
        return ((4.0 * value).round() + count) / 4.0;
    }
    if value.abs() < 1e-9 {
        return if step.is_up() { 0.01 } else { 0.0 };
    }
    let next = rounded(value * 1.05f64.powf(count * value.signum()));
    // A hundredth is the first step from zero.
    if next.abs() < 0.0095 && !step.is_up() && value > 0.0 && value <= 0.0101 {
        0.0
    } else {
        next
    }
}

/// Returns the strategy `{ s, t }` after or before one, in order of path length; all strategies
/// come after the last.
fn next_strategy(step: Step, current: Option<&Value>, max_depth: u32) -> Option<Value> {
    let pairs: Vec<[i64; 2]> = (1..=i64::from(max_depth.min(30)))
        .flat_map(|edges| (0..=edges).map(move |s| [s, edges + 1 - s]))
        .collect();
    let now = current.and_then(Value::as_list).and_then(|list| {
        let pair = [0, 1].map(|i| list.get(i).and_then(Value::as_i64).unwrap_or(-1));
        pairs.iter().position(|known| *known == pair)
    });
    let count = pairs.len() as i64 + 1;
    let index = now.map_or(count - 1, |index| index as i64);
    let next = (index + step.count()).rem_euclid(count) as usize;
    let [s, t] = *pairs.get(next)?;
    Some(Value::List(vec![Value::Int(s), Value::Int(t)]))
}
