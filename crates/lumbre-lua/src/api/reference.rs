//! `x:reference`: a rendered reference with an optional bias check, or an image file.

use std::collections::BTreeMap;

use mlua::{Function, Value as LuaValue};

use super::builder::{BiasCheck, Reference, RenderedReference, Stop};
use super::stop_rule::rule_from_value;
use super::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::kind::kind;
use crate::strict::Fields;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Ty, duration_s};
use lumbre_night::experiment::StopRule;

lumbre_light::table! {
    /// Option `agree` of `x:reference`.
    pub const AGREE = "Agree",
        "Bias check: a second technique that must converge to the same picture as the reference. A \
         difference raises an alarm with a map of the differing blocks.";
    with: Ty::Any("string|RenderChanges"),
        "integrator of the second picture, or a table with it, its parameters and other \
         differences from the reference's render table; parameters of the reference's own \
         integrator are not inherited";
    time = "the reference's stop rule": Ty::Duration, "render time of the second picture";
    samples = "the reference's stop rule": Ty::int(2, 1 << 53),
        "samples per pixel of the second picture";
    rate = "0.01": Ty::num(1e-9, 0.5),
        "accepted rate of false discoveries among the blocks reported as different; if nothing \
         differs, the probability of an alarm";
}

lumbre_light::table! {
    /// Options of `x:reference`.
    pub const REFERENCE = "Reference",
        "Reference of the cells: a picture that is rendered first and stored, or an image file.";
    from = "the cell's own render table": Ty::Object("fun(p: Point): RenderChanges"),
        "function that returns the differences from the cell's render table; `set`, `aa`, \
         `camera`, `rr` and `scene_options` are merged key by key";
    stop = "": Ty::Object("StopRule|fun(p: Point): StopRule"),
        "stop rule of the reference, or a function that returns the rule for each cell's \
         reference; required unless `image` is given";
    agree = "no comparison": Ty::Table(&AGREE),
        "second technique with which the reference is compared, block by block";
    parts = "1": Ty::int(1, 4096),
        "number of shards (ranges of samples) that workers render at the same time; only with \
         `stop.samples`";
    image = "": Ty::Object("string|fun(p: Point): string"),
        "OpenEXR file instead of a rendered reference, relative to the current folder or else to \
         the script's; or a function that returns the file";
    source = "": Ty::Str,
        "with `image`: origin of the image, printed wherever the reference is named";
}

functions! {
    /// Method that declares the reference.
    pub const METHODS;
    "x:reference" = reference,
        "Sets the reference with which cells are compared. Without it, no metrics are measured." {
        "options": "Reference", "Rendering or file of the reference.";
    }
}

fn reference(args: &Args) -> Result<LuaValue, ScriptError> {
    let fields = args.fields(0, "options", &REFERENCE, "reference")?;
    let reference = match fields.objects.get("image") {
        Some(image) => image_reference(&fields, image, args).map_err(|e| args.locate_error(e))?,
        None => rendered_reference(args, &fields)?,
    };
    let mut builder = args.shared.builder.borrow_mut();
    if builder.reference.is_some() {
        let problem = "called twice: an experiment has one reference";
        return Err(args.error(problem, None));
    }
    builder.reference = Some(reference);
    Ok(LuaValue::Nil)
}

/// Returns an error about an option of `x:reference`.
fn option_error(key: &str, problem: impl Into<String>, help: Option<&str>) -> SchemaError {
    SchemaError {
        path: format!("reference.{key}"),
        problem: problem.into(),
        help: help.map(str::to_owned),
        key: key.to_owned(),
    }
}

/// Returns a reference that is an image file; options of rendered references are errors.
fn image_reference(
    fields: &Fields,
    image: &LuaValue,
    args: &Args,
) -> Result<Reference, SchemaError> {
    let is_given = |key: &str| fields.objects.contains_key(key) || fields.values.contains_key(key);
    if is_given("agree") {
        let problem = "`agree` does not apply to an `image`, whose noise is unknown";
        return Err(option_error("agree", problem, None));
    }
    if let Some(key) = ["stop", "from", "parts"]
        .into_iter()
        .find(|key| is_given(key))
    {
        let problem = format!("`{key}` does not apply to an `image`");
        return Err(option_error(key, problem, None));
    }
    let source = fields.text("source").unwrap_or_default().to_owned();
    match image {
        LuaValue::String(s) => Ok(Reference::Image {
            file: s.to_string_lossy(),
            source,
            place: args.place.clone(),
        }),
        LuaValue::Function(f) => Ok(Reference::ImageFunction {
            file: f.clone(),
            source,
        }),
        other => {
            let problem = format!("expected a file or a function, found {}", kind(other));
            Err(option_error("image", problem, None))
        }
    }
}

/// Returns a reference that is rendered.
fn rendered_reference(args: &Args, fields: &Fields) -> Result<Reference, ScriptError> {
    let fail = |error: SchemaError| args.locate_error(error);
    if fields.values.contains_key("source") {
        let problem = "`source` describes an `image`, but no `image` is given";
        return Err(fail(option_error("source", problem, None)));
    }
    let Some(rule) = fields.objects.get("stop") else {
        let help = "add a stop rule, such as stop = stop.samples(4096)".to_owned();
        return Err(args.shared.sources.borrow().field(
            &args.place,
            "reference",
            "`stop` is missing",
            Some(help),
        ));
    };
    let stop = reference_stop(rule).map_err(fail)?;
    let from = overrides(fields.objects.get("from")).map_err(fail)?;
    let bias_check = fields
        .values
        .get("agree")
        .and_then(Value::as_map)
        .map(bias_check)
        .transpose()
        .map_err(fail)?;
    let shards = fields.i64("parts").and_then(|n| u32::try_from(n).ok());
    Ok(Reference::Render(RenderedReference {
        from,
        stop,
        bias_check,
        shards: shards.unwrap_or(1),
        place: args.place.clone(),
    }))
}

/// Converts the option `stop`.
fn reference_stop(rule: &LuaValue) -> Result<Stop, SchemaError> {
    match (rule_from_value(rule), rule) {
        (Some(rule), _) => Ok(Stop::Rule(rule)),
        (None, LuaValue::Function(f)) => Ok(Stop::Function(f.clone())),
        (None, _) => {
            let problem = format!("expected a stop rule, found {}", kind(rule));
            let help = "use stop.samples(n), stop.time(t) and others, or a function that returns \
                        one";
            Err(option_error("stop", problem, Some(help)))
        }
    }
}

/// Converts the option `from`.
fn overrides(from: Option<&LuaValue>) -> Result<Option<Function>, SchemaError> {
    match from {
        None => Ok(None),
        Some(LuaValue::Function(f)) => Ok(Some(f.clone())),
        Some(other) => {
            let problem = format!("expected a function, found {}", kind(other));
            let help = "from = function(p) return { max_depth = 64 } end";
            Err(option_error("from", problem, Some(help)))
        }
    }
}

/// Converts the option `agree`, which was checked against its schema.
fn bias_check(map: &BTreeMap<String, Value>) -> Result<BiasCheck, SchemaError> {
    let mut stops = Vec::new();
    stops.extend(map.get("time").and_then(duration_s).map(StopRule::Time));
    stops.extend(
        map.get("samples")
            .and_then(Value::as_i64)
            .map(|n| StopRule::Samples(n.unsigned_abs())),
    );
    let stop = if stops.len() > 1 {
        Some(StopRule::Any(stops))
    } else {
        stops.pop()
    };
    let changes = match map.get("with") {
        Some(name @ Value::Str(_)) => BTreeMap::from([("integrator".to_owned(), name.clone())]),
        Some(Value::Map(changes)) if changes.contains_key("integrator") => changes.clone(),
        _ => {
            let mut error = option_error(
                "agree.with",
                "expected the name of an integrator, or a table with `integrator`",
                Some("with = { integrator = \"bdpt\", mis = \"balance\" }"),
            );
            error.key = "with".to_owned();
            return Err(error);
        }
    };
    Ok(BiasCheck {
        changes,
        stop,
        rate: map.get("rate").and_then(Value::as_f64).unwrap_or(0.01),
    })
}
