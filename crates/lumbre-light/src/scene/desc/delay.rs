//! Delay parameters and composed materials: materials that return light after a delay, and
//! materials that are weighted sums of others; their parameters and the checks on them.
//!
//! A temporal profile makes a material *separable*: its BSDF is multiplied by the density of the
//! profile. Names of components with weights make it *composed*: a weighted sum of other materials
//! of the scene, each with its own profile, nested to any depth. A composed material with a profile
//! of its own adds its delay to those of its components.

use super::delay_profile::DelayKind;
use super::material::MaterialParam;
use super::{MaterialDesc, MaterialNames, SceneDesc, TextureSlot};
use crate::value::Value;
use crate::value::schema::{SchemaError, Ty};

/// Greatest delay, and greatest rate.
const MAX_VALUE: f64 = 1e9;

/// Declares the parameter of one number of a profile, which is also a key in `.scn`:
/// `NAME: PLACE [SLOT "KEY"], "UNIT", "DOC"`, with the slot and the key in `.scn` of its texture.
macro_rules! number {
    ($name:ident: $field:ident[$i:literal] $([$slot:ident $texture:literal])?, $unit:literal,
     $doc:literal) => {
        MaterialParam {
            name: stringify!($name),
            scn_key: stringify!($name),
            scn_texture_key: concat!("" $(, $texture)?),
            ty: Ty::num(-MAX_VALUE, MAX_VALUE),
            unit: $unit,
            doc: $doc,
            get: |m| Value::number(f64::from(m.delay.$field[$i])),
            set_checked: |m, v| m.delay.$field[$i] = v.as_f64().unwrap_or_default() as f32,
            texture: [$(Some(TextureSlot::$slot),)? None][0],
        }
    };
}

fn numbers(v: &Value) -> Vec<f32> {
    v.as_list()
        .unwrap_or_default()
        .iter()
        .filter_map(Value::as_f64)
        .map(|x| x as f32)
        .collect()
}

fn list(xs: &[f32]) -> Value {
    Value::List(xs.iter().map(|x| Value::number(f64::from(*x))).collect())
}

/// The part of [`MATERIAL_PARAMS`](super::MATERIAL_PARAMS) for delays and components.
pub(super) const DELAY_PARAMS: [MaterialParam; 12] = [
    MaterialParam {
        name: "delay",
        scn_key: "delay",
        scn_texture_key: "",
        ty: Ty::Word(DelayKind::NAMES),
        unit: "",
        doc: "Temporal profile: light is returned immediately, or after an optical length drawn \
              from a distribution. It does not change the image, only the arrival time of its \
              light.",
        get: |m| Value::Str(m.delay.kind.name().to_owned()),
        set_checked: |m, v| {
            let kind = v.as_str().and_then(DelayKind::from_name);
            m.delay.kind = kind.unwrap_or(m.delay.kind);
        },
        texture: None,
    },
    number! {
        delay_constant: constant[0] [DelayConstant "delay_constant_texture"], "scene units",
            "Delay of the profile `constant`; the sum with its offset must be at least 0. A \
             texture multiplies it."
    },
    number! {
        delay_constant_offset: constant[1], "scene units",
            "Added to `delay_constant` after its texture is applied."
    },
    number! {
        delay_rate: rate[0] [DelayRate "delay_rate_texture"], "1 / scene unit",
            "Rate of the profile `exponential`, the reciprocal of the mean delay; the sum with its \
             offset must be positive. A texture multiplies it."
    },
    number! {
        delay_rate_offset: rate[1], "1 / scene unit",
            "Added to `delay_rate` after its texture is applied."
    },
    number! {
        delay_mean: mean[0] [DelayMean "delay_mean_texture"], "scene units",
            "Mean delay of the profile `epanechnikov`; the sum with its offset must be at least \
             the width. A texture multiplies it."
    },
    number! {
        delay_mean_offset: mean[1], "scene units",
            "Added to `delay_mean` after its texture is applied."
    },
    number! {
        delay_width: width[0] [DelayWidth "delay_width_texture"], "scene units",
            "Half width of the support of the profile `epanechnikov`, called sigma in thesis S2; \
             the sum with its offset must be positive. A texture multiplies it."
    },
    number! {
        delay_width_offset: width[1], "scene units",
            "Added to `delay_width` after its texture is applied."
    },
    MaterialParam {
        name: "delay_table",
        scn_key: "delay_table",
        scn_texture_key: "",
        ty: Ty::List(&Ty::num(0.0, MAX_VALUE)),
        unit: "scene units, then density",
        doc: "Density of the profile `table` as pairs of delay and density with increasing delays; \
              it is interpolated linearly and normalised to integrate to one.",
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
        doc: "Names of the materials of which this one is a weighted sum, each with its own \
              profile and components. Of its own parameters, only mask and profile have an effect \
              then.",
        get: |m| {
            Value::List(
                m.parts
                    .iter()
                    .map(|name| Value::Str(name.clone()))
                    .collect(),
            )
        },
        set_checked: |m, v| {
            let names = v
                .as_list()
                .unwrap_or_default()
                .iter()
                .filter_map(Value::as_str);
            m.parts = names.map(str::to_owned).collect();
        },
        texture: None,
    },
    MaterialParam {
        name: "weights",
        scn_key: "weights",
        scn_texture_key: "weightstexture",
        ty: Ty::List(&Ty::num(0.0, 1.0)),
        unit: "",
        doc: "Weights of `parts`, one for each; they must sum to one. With two parts, the red channel of \
              a texture can replace them: it is the weight of the second part.",
        get: |m| list(&m.weights),
        set_checked: |m, v| m.weights = numbers(v),
        texture: Some(TextureSlot::Weights),
    },
];

/// Greatest deviation of a sum of weights from one.
const SUM_TOLERANCE: f64 = 1e-4;

/// Greatest number of components of a material, nested ones included.
pub const MAX_COMPONENTS: usize = 1 << 16;

/// Greatest nesting depth of composed materials.
pub const MAX_NESTING: usize = 64;

fn param_error(m: &MaterialDesc, param: &str, problem: String, help: &str) -> SchemaError {
    SchemaError {
        path: format!("materials.{}.{param}", m.name),
        problem,
        help: (!help.is_empty()).then(|| help.to_owned()),
        key: param.to_owned(),
    }
}

/// Checks all profiles and compositions of a scene, except for values that depend on textures.
///
/// # Errors
/// Names the material and the parameter: a negative constant delay, a rate or width that is not
/// positive, a mean below the width, a table without area or with decreasing delays, weights that
/// do not sum to one or do not match the components, a texture of weights for other than two
/// components, a component that does not exist, emits light, contains itself, or has a texture of
/// weights inside a delayed material.
pub fn check(desc: &SceneDesc) -> Result<(), SchemaError> {
    let names = desc.material_names();
    for m in &desc.materials {
        check_profile(m)?;
        check_composition(desc, &names, m)?;
    }
    Ok(())
}

/// Checks the profile of one material, except for values that depend on textures.
///
/// # Errors
/// Fails like [`check`] does for profiles.
pub fn check_profile(m: &MaterialDesc) -> Result<(), SchemaError> {
    let d = &m.delay;
    if d.kind == DelayKind::Table {
        return check_table(m);
    }
    let values: Vec<(&str, f32)> = d
        .params()
        .iter()
        .filter(|(_, _, slot)| m.texture(*slot).is_none())
        .map(|(name, get, _)| (*name, get(d).iter().sum()))
        .collect();
    values
        .iter()
        .try_for_each(|(name, value)| check_value(m, name, *value))?;
    match values[..] {
        [(_, mean), (_, width)] => check_mean_and_width(m, mean, width),
        _ => Ok(()),
    }
}

/// Checks the value of one parameter of a material's profile.
///
/// # Errors
/// Names the parameter if its value is out of range.
pub fn check_value(m: &MaterialDesc, name: &str, value: f32) -> Result<(), SchemaError> {
    let may_be_zero = name == "delay_constant" || name == "delay_mean";
    if value.is_finite() && (value > 0.0 || (may_be_zero && value == 0.0)) {
        return Ok(());
    }
    let expected = if may_be_zero {
        "0 or more"
    } else {
        "a positive number"
    };
    let problem = format!(
        "{value} is out of range for the profile `{}`: expected {expected}",
        m.delay.kind.name()
    );
    Err(param_error(m, name, problem, ""))
}

/// Checks that an Epanechnikov profile has no negative delays.
///
/// # Errors
/// Names the mean if it is below the width.
pub fn check_mean_and_width(m: &MaterialDesc, mean: f32, width: f32) -> Result<(), SchemaError> {
    if mean >= width {
        return Ok(());
    }
    let problem =
        format!("the mean {mean} is below the width {width}, so some delays would be negative");
    Err(param_error(
        m,
        "delay_mean",
        problem,
        "raise delay_mean or lower delay_width",
    ))
}

fn check_table(m: &MaterialDesc) -> Result<(), SchemaError> {
    let fail = |problem: &str| {
        Err(param_error(
            m,
            "delay_table",
            problem.to_owned(),
            "write pairs of delay and density, such as delay_table = { 0, 1, 2, 0 }",
        ))
    };
    let pairs = m.delay.pairs();
    if !m.delay.table.len().is_multiple_of(2) || pairs.len() < 2 {
        return fail("expected at least two pairs of delay and density");
    }
    if m.delay.table.iter().any(|x| !x.is_finite() || *x < 0.0) {
        return fail("delays and densities must be finite numbers of 0 or more");
    }
    if pairs.windows(2).any(|w| w[1][0] < w[0][0]) {
        return fail("delays must not decrease");
    }
    if pairs
        .windows(2)
        .all(|w| (w[0][1] + w[1][1]) * (w[1][0] - w[0][0]) <= 0.0)
    {
        return fail("the density is zero everywhere");
    }
    Ok(())
}

fn check_composition(
    desc: &SceneDesc,
    names: &MaterialNames,
    m: &MaterialDesc,
) -> Result<(), SchemaError> {
    if m.parts.is_empty() && m.weights.is_empty() {
        return Ok(());
    }
    if m.parts.len() != m.weights.len() {
        let problem = format!("{} weights for {} parts", m.weights.len(), m.parts.len());
        return Err(param_error(
            m,
            "weights",
            problem,
            "give one weight for each part",
        ));
    }
    let sum: f64 = m.weights.iter().map(|w| f64::from(*w)).sum();
    let positive = m.weights.iter().all(|w| (0.0..=1.0).contains(w));
    if !positive || (sum - 1.0).abs() > SUM_TOLERANCE {
        let problem =
            format!("the weights must be between 0 and 1 and sum to 1, but their sum is {sum}");
        return Err(param_error(
            m,
            "weights",
            problem,
            "divide each weight by the sum",
        ));
    }
    if m.emission != glam::Vec3::ZERO {
        return Err(param_error(
            m,
            "emission",
            "a composed material cannot emit light".to_owned(),
            "set emission to 0, or remove parts and weights",
        ));
    }
    check_blend(m)?;
    let mut components = 0;
    check_components(desc, names, m, m, 0, &mut components)
}

/// Checks a material of which a part is chosen at each hit: by a texture of weights, or by the side.
fn check_blend(m: &MaterialDesc) -> Result<(), SchemaError> {
    let textured = m.texture(TextureSlot::Weights).is_some();
    let (param, what) = match (textured, m.by_side) {
        (false, false) => return Ok(()),
        (true, false) => (TextureSlot::Weights.name(), "a texture of weights"),
        (false, true) => ("by_side", "a part for each side"),
        (true, true) => {
            let problem = "parts are chosen by their side or by a texture of weights".to_owned();
            return Err(param_error(m, "by_side", problem, "leave out one of both"));
        }
    };
    if m.parts.len() != 2 {
        let problem = format!("{what} needs two parts, found {}", m.parts.len());
        return Err(param_error(m, param, problem, ""));
    }
    if m.delay.kind != DelayKind::None {
        let problem = format!("a material with {what} cannot have a delay");
        return Err(param_error(m, param, problem, "give its parts the delay"));
    }
    Ok(())
}

/// Checks the components of `m`, which is at nesting level `depth` below `root`, and adds their
/// number to `components`.
fn check_components(
    desc: &SceneDesc,
    names: &MaterialNames,
    root: &MaterialDesc,
    m: &MaterialDesc,
    depth: usize,
    components: &mut usize,
) -> Result<(), SchemaError> {
    if depth > MAX_NESTING {
        let problem =
            format!("it contains itself, or is nested more than {MAX_NESTING} levels deep");
        return Err(param_error(root, "parts", problem, ""));
    }
    for name in &m.parts {
        *components += 1;
        if *components > MAX_COMPONENTS {
            return Err(param_error(
                root,
                "parts",
                format!("more than {MAX_COMPONENTS} parts, nested ones included"),
                "",
            ));
        }
        let Some(index) = names.index(name) else {
            let known: Vec<&str> = desc.materials.iter().map(|m| m.name.as_str()).collect();
            let path = format!("materials.{}.parts", m.name);
            return Err(crate::value::schema::unknown_name(
                &path, name, "material", known,
            ));
        };
        let component = &desc.materials[index];
        if component.emission != glam::Vec3::ZERO {
            return Err(param_error(
                m,
                "parts",
                format!("the part `{name}` emits light"),
                "use materials without emission",
            ));
        }
        if root.delay.kind != DelayKind::None && component.is_blend() {
            let problem = format!(
                "the part `{name}` of a delayed material has a texture of weights, or a part for each \
                 side"
            );
            return Err(param_error(
                root,
                "parts",
                problem,
                "give its parts the delay",
            ));
        }
        check_components(desc, names, root, component, depth + 1, components)?;
    }
    Ok(())
}
