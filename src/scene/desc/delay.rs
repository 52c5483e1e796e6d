//! Materials that give light back later, and materials that are composed of others: their parameters and what these must
//! obey.
//!
//! A profile in time makes the material *separable*: its BSDF times the density of the profile. Names of parts with
//! weights make it *composed*: a weighted sum of other materials of the scene, each with its own profile, to any depth.
//! A composed material that has a profile too adds its delay to those of its parts.

use super::TextureSlot;
use super::material::MaterialParam;
use super::{MaterialDesc, SceneDesc};
use crate::value::Value;
use crate::value::schema::{SchemaError, Ty};

/// The kinds of profiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DelayKind {
    /// Light is given back at once.
    None,
    /// Always after the same delay.
    Constant,
    /// With the density `rate exp(-rate x)`.
    Exponential,
    /// With the density `3 / (4 width) (1 - ((x - mean) / width)^2)` about the mean.
    Epanechnikov,
    /// With a density of straight lines.
    Table,
}

impl DelayKind {
    /// Every kind, in the order of [`DelayKind::WORDS`].
    pub const ALL: [DelayKind; 5] =
        [DelayKind::None, DelayKind::Constant, DelayKind::Exponential, DelayKind::Epanechnikov, DelayKind::Table];

    /// The words for the kinds in scripts and scene files.
    pub const WORDS: &'static [&'static str] = &["none", "constant", "exponential", "epanechnikov", "table"];

    /// Its word.
    pub fn word(self) -> &'static str {
        DelayKind::WORDS[self as usize]
    }
}

/// When a material gives light back, as its file says it. All lengths are optical, in scene units. A parameter with a
/// texture is its offset plus itself times the texture's red channel; without one it is the sum of both.
#[derive(Clone, Debug, PartialEq)]
pub struct DelayDesc {
    /// Which profile.
    pub kind: DelayKind,
    /// The delay of `constant`, and its offset.
    pub constant: [f32; 2],
    /// The rate of `exponential`, in 1 / scene unit, and its offset.
    pub rate: [f32; 2],
    /// The mean of `epanechnikov`, and its offset.
    pub mean: [f32; 2],
    /// Half of the extent of `epanechnikov`, and its offset.
    pub width: [f32; 2],
    /// Delay, density, delay, density and so on, of `table`; the density up to a factor.
    pub table: Vec<f32>,
}

impl Default for DelayDesc {
    fn default() -> DelayDesc {
        DelayDesc {
            kind: DelayKind::None,
            constant: [0.0; 2],
            rate: [1.0, 0.0],
            mean: [1.0, 0.0],
            width: [1.0, 0.0],
            table: Vec::new(),
        }
    }
}

/// A parameter of a profile: its name, its value and offset, and where its texture is.
pub type DelayRow = (&'static str, fn(&DelayDesc) -> [f32; 2], TextureSlot);

impl DelayDesc {
    /// The parameters that the kind has: name, value, offset and texture slot.
    pub fn params(&self) -> &'static [DelayRow] {
        match self.kind {
            DelayKind::None | DelayKind::Table => &[],
            DelayKind::Constant => &[("delay_constant", |d| d.constant, TextureSlot::DelayConstant)],
            DelayKind::Exponential => &[("delay_rate", |d| d.rate, TextureSlot::DelayRate)],
            DelayKind::Epanechnikov => &[
                ("delay_mean", |d| d.mean, TextureSlot::DelayMean),
                ("delay_width", |d| d.width, TextureSlot::DelayWidth),
            ],
        }
    }

    /// The pairs of the table.
    pub fn pairs(&self) -> Vec<[f32; 2]> {
        self.table.chunks_exact(2).map(|p| [p[0], p[1]]).collect()
    }
}

/// Greatest delay, and greatest rate.
const FAR: f64 = 1e9;

macro_rules! number {
    ($name:literal, $field:ident, $i:literal, $min:expr, $texture:literal, $slot:expr, $unit:literal, $doc:literal) => {
        MaterialParam {
            name: $name,
            scn_key: $name,
            scn_texture_key: $texture,
            ty: Ty::Num { min: $min, max: FAR },
            unit: $unit,
            doc: $doc,
            get: |m| Value::number(f64::from(m.delay.$field[$i])),
            set_checked: |m, v| m.delay.$field[$i] = v.as_f64().unwrap_or_default() as f32,
            texture: $slot,
        }
    };
}

fn numbers(v: &Value) -> Vec<f32> {
    v.as_list().unwrap_or_default().iter().filter_map(Value::as_f64).map(|x| x as f32).collect()
}

fn list(xs: &[f32]) -> Value {
    Value::List(xs.iter().map(|x| Value::number(f64::from(*x))).collect())
}

/// The rows of [`MATERIAL_PARAMS`](super::MATERIAL_PARAMS) that say when a material gives light back and what it is
/// composed of.
pub(super) const ROWS: [MaterialParam; 12] = [
    MaterialParam {
        name: "delay",
        scn_key: "delay",
        scn_texture_key: "",
        ty: Ty::Word(DelayKind::WORDS),
        unit: "",
        doc: "Profile in time of the light that the material gives back: at once, or after an optical length drawn from \
              a distribution. It changes no picture, only when its light arrives.",
        get: |m| Value::Str(m.delay.kind.word().to_owned()),
        set_checked: |m, v| {
            let said = DelayKind::ALL.into_iter().find(|kind| v.as_str() == Some(kind.word()));
            m.delay.kind = said.unwrap_or(m.delay.kind);
        },
        texture: None,
    },
    number!(
        "delay_constant",
        constant,
        0,
        -FAR,
        "delay_constant_texture",
        Some(TextureSlot::DelayConstant),
        "scene units",
        "Delay of the profile `constant`, at least 0 with its offset; a texture multiplies it."
    ),
    number!(
        "delay_constant_offset",
        constant,
        1,
        -FAR,
        "",
        None,
        "scene units",
        "Added to `delay_constant` after its texture."
    ),
    number!(
        "delay_rate",
        rate,
        0,
        -FAR,
        "delay_rate_texture",
        Some(TextureSlot::DelayRate),
        "1 / scene unit",
        "Rate of the profile `exponential`, positive with its offset: one over the mean delay; a texture multiplies it."
    ),
    number!("delay_rate_offset", rate, 1, -FAR, "", None, "1 / scene unit", "Added to `delay_rate` after its texture."),
    number!(
        "delay_mean",
        mean,
        0,
        -FAR,
        "delay_mean_texture",
        Some(TextureSlot::DelayMean),
        "scene units",
        "Mean delay of the profile `epanechnikov`, with its offset at least the width; a texture multiplies it."
    ),
    number!("delay_mean_offset", mean, 1, -FAR, "", None, "scene units", "Added to `delay_mean` after its texture."),
    number!(
        "delay_width",
        width,
        0,
        -FAR,
        "delay_width_texture",
        Some(TextureSlot::DelayWidth),
        "scene units",
        "Half of the extent of the profile `epanechnikov`, positive with its offset, the sigma of the third source; a \
         texture multiplies it."
    ),
    number!("delay_width_offset", width, 1, -FAR, "", None, "scene units", "Added to `delay_width` after its texture."),
    MaterialParam {
        name: "delay_table",
        scn_key: "delay_table",
        scn_texture_key: "",
        ty: Ty::List(&Ty::Num { min: 0.0, max: FAR }),
        unit: "scene units, then density",
        doc: "The profile `table`: delay, density, delay, density and so on, with rising delays; straight lines lie between, \
              and the whole is scaled to integrate to one.",
        get: |m| list(&m.delay.table),
        set_checked: |m, v| m.delay.table = numbers(v),
        texture: None,
    },
    MaterialParam {
        name: "parts",
        scn_key: "parts",
        scn_texture_key: "",
        ty: Ty::List(&Ty::Str),
        unit: "",
        doc: "Names of the materials of which this one is a weighted sum, each with its own profile and parts. Of its \
              own parameters it then has only mask and profile.",
        get: |m| Value::List(m.parts.iter().map(|name| Value::Str(name.clone())).collect()),
        set_checked: |m, v| {
            let names = v.as_list().unwrap_or_default().iter().filter_map(Value::as_str);
            m.parts = names.map(str::to_owned).collect();
        },
        texture: None,
    },
    MaterialParam {
        name: "weights",
        scn_key: "weights",
        scn_texture_key: "",
        ty: Ty::List(&Ty::Num { min: 0.0, max: 1.0 }),
        unit: "",
        doc: "The weights of `parts`, one for each; they sum to one.",
        get: |m| list(&m.weights),
        set_checked: |m, v| m.weights = numbers(v),
        texture: None,
    },
];

/// How far the sum of weights may be from one.
const SUM_TOLERANCE: f64 = 1e-4;

/// The most parts that a material may have, nested ones counted.
pub const MAX_PARTS: usize = 1 << 16;

/// How deep materials may be composed of composed ones.
pub const MAX_NESTING: usize = 64;

fn refuse(m: &MaterialDesc, param: &str, problem: String, help: &str) -> SchemaError {
    SchemaError {
        path: format!("materials.{}.{param}", m.name),
        problem,
        help: (!help.is_empty()).then(|| help.to_owned()),
        key: param.to_owned(),
    }
}

/// Whether profiles and compositions mean something, as far as it does not depend on textures.
///
/// # Errors
/// Naming the material and the parameter: a negative constant delay, a rate or width that is not positive, a mean below
/// the width, a table without area or with falling delays, weights that do not sum to one or do not belong to the parts,
/// a part that is no material, that shines, or that contains itself.
pub fn check(desc: &SceneDesc) -> Result<(), SchemaError> {
    for m in &desc.materials {
        profile(m)?;
        composition(desc, m)?;
    }
    Ok(())
}

/// Whether the profile of one material means something, as far as it does not depend on textures.
///
/// # Errors
/// Those of [`check`] about profiles.
pub fn profile(m: &MaterialDesc) -> Result<(), SchemaError> {
    let d = &m.delay;
    if d.kind == DelayKind::Table {
        return table(m);
    }
    let values: Vec<(&str, f32)> = d
        .params()
        .iter()
        .filter(|(_, _, slot)| m.texture(*slot).is_none())
        .map(|(name, get, _)| (*name, get(d).iter().sum()))
        .collect();
    values.iter().try_for_each(|(name, value)| number(m, name, *value))?;
    match values[..] {
        [(_, mean), (_, width)] => mean_and_width(m, mean, width),
        _ => Ok(()),
    }
}

/// Whether one parameter of a material's profile may have this value.
///
/// # Errors
/// Naming the parameter.
pub fn number(m: &MaterialDesc, name: &str, value: f32) -> Result<(), SchemaError> {
    let fits = if name == "delay_constant" || name == "delay_mean" { value >= 0.0 } else { value > 0.0 };
    if fits && value.is_finite() {
        return Ok(());
    }
    let wanted = if name == "delay_constant" || name == "delay_mean" { "0 or more" } else { "a positive number" };
    let problem = format!("{value} is out of range for the profile `{}`: expected {wanted}", m.delay.kind.word());
    Err(refuse(m, name, problem, ""))
}

/// Whether an Epanechnikov profile stays on the side of positive delays.
///
/// # Errors
/// Naming the mean.
pub fn mean_and_width(m: &MaterialDesc, mean: f32, width: f32) -> Result<(), SchemaError> {
    if mean >= width {
        return Ok(());
    }
    let problem = format!("the mean {mean} is below the width {width}: some light would be given back before it came");
    Err(refuse(m, "delay_mean", problem, "raise delay_mean or lower delay_width"))
}

fn table(m: &MaterialDesc) -> Result<(), SchemaError> {
    let fail = |problem: &str| Err(refuse(m, "delay_table", problem.to_owned(), "delay_table = { 0, 1, 2, 0 }"));
    let pairs = m.delay.pairs();
    if !m.delay.table.len().is_multiple_of(2) || pairs.len() < 2 {
        return fail("expected at least two pairs of delay and density");
    }
    if m.delay.table.iter().any(|x| !x.is_finite() || *x < 0.0) {
        return fail("delays and densities are 0 or more");
    }
    if pairs.windows(2).any(|w| w[1][0] < w[0][0]) {
        return fail("delays must not fall");
    }
    if pairs.windows(2).all(|w| (w[0][1] + w[1][1]) * (w[1][0] - w[0][0]) <= 0.0) {
        return fail("the density is zero everywhere");
    }
    Ok(())
}

fn composition(desc: &SceneDesc, m: &MaterialDesc) -> Result<(), SchemaError> {
    if m.parts.is_empty() && m.weights.is_empty() {
        return Ok(());
    }
    if m.parts.len() != m.weights.len() {
        let problem = format!("{} weights for {} parts", m.weights.len(), m.parts.len());
        return Err(refuse(m, "weights", problem, "each part has one"));
    }
    let sum: f64 = m.weights.iter().map(|w| f64::from(*w)).sum();
    let positive = m.weights.iter().all(|w| (0.0..=1.0).contains(w));
    if !positive || (sum - 1.0).abs() > SUM_TOLERANCE {
        let problem = format!("the weights sum to {sum}, not to 1, or are not between 0 and 1");
        return Err(refuse(m, "weights", problem, "a composed material gives back what its parts give on average"));
    }
    if m.emission != glam::Vec3::ZERO {
        return Err(refuse(m, "emission", "a composed material cannot shine by itself".to_owned(), ""));
    }
    let mut leaves = 0;
    descend(desc, m, m, 0, &mut leaves)
}

fn descend(
    desc: &SceneDesc,
    root: &MaterialDesc,
    m: &MaterialDesc,
    depth: usize,
    leaves: &mut usize,
) -> Result<(), SchemaError> {
    if depth > MAX_NESTING {
        let problem = format!("it contains itself, or is composed more than {MAX_NESTING} times over");
        return Err(refuse(root, "parts", problem, ""));
    }
    for name in &m.parts {
        *leaves += 1;
        if *leaves > MAX_PARTS {
            return Err(refuse(root, "parts", format!("more than {MAX_PARTS} parts, nested ones counted"), ""));
        }
        let Some(row) = desc.material_row(name) else {
            let known: Vec<&str> = desc.materials.iter().map(|m| m.name.as_str()).collect();
            let path = format!("materials.{}.parts", m.name);
            return Err(crate::value::schema::unknown_name(&path, name, "material", known));
        };
        let part = &desc.materials[row];
        if part.emission != glam::Vec3::ZERO {
            return Err(refuse(m, "parts", format!("the part `{name}` shines"), "parts only reflect"));
        }
        descend(desc, root, part, depth + 1, leaves)?;
    }
    Ok(())
}
