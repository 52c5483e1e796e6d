//! `lumbre schema`: the script interface, generated from the tables that validate scripts.

use serde_json::{Value as Json, json};

use crate::cli::args::SchemaArgs;
use crate::cli::exit::{Exit, Failure, print_result};
use lumbre_light::scene::desc::{MATERIAL_PARAMS, TextureSlot};
use lumbre_light::transport::integrator::integrators;
use lumbre_light::transport::sampler::SAMPLERS;
use lumbre_light::value::schema::{Field, Table, Ty};
use lumbre_lua::docgen;
use lumbre_metrics::METRICS;
use lumbre_metrics::tonemap::TONEMAPS;
use lumbre_night::backends::BACKENDS;
use lumbre_scene_io::load::FORMATS;

/// Runs `lumbre schema`: prints Lua annotations for editors, or the tables as JSON.
pub fn main(args: &SchemaArgs) -> Result<Exit, Failure> {
    if args.lua {
        print_result(&docgen::lua())?;
    } else {
        crate::cli::json::print(tables())?;
    }
    Ok(Exit::Done)
}

/// Returns the tables of integrators, samplers, metrics, tone maps, backends, material parameters
/// and formats.
fn tables() -> Json {
    json!({
        "integrators": integrators().map(|r| json!({
            "name": r.name, "long_name": r.long_name, "revision": r.revision, "doc": r.doc,
            "bias": r.bias, "params": table(&r.params),
        })).collect::<Vec<_>>(),
        "samplers": SAMPLERS.iter().map(|r| json!({ "name": r.name, "revision": r.revision,
            "doc": r.doc }))
            .collect::<Vec<_>>(),
        "metrics": METRICS.iter().map(|r| json!({
            "name": r.name, "long_name": r.long_name, "doc": r.doc, "options": table(&r.options),
            "better": r.better.to_string(),
        })).collect::<Vec<_>>(),
        "tonemaps": TONEMAPS.iter().map(|(name, options)| json!({ "name": name,
            "options": table(options) }))
            .collect::<Vec<_>>(),
        "backends": BACKENDS.iter().map(|r| json!({ "name": r.name,
            "doc": r.doc })).collect::<Vec<_>>(),
        "material_params": MATERIAL_PARAMS.iter().map(|r| json!({
            "name": r.name, "type": r.ty.describe(), "doc": r.doc, "scn_key": r.scn_key,
            "texture": r.texture.map(TextureSlot::name),
        })).collect::<Vec<_>>(),
        "formats": FORMATS.iter().map(|r| json!({ "name": r.name, "extensions": r.extensions,
            "doc": r.doc }))
            .collect::<Vec<_>>(),
    })
}

/// Returns the description of a table and its fields.
fn table(table: &Table) -> Json {
    json!({ "name": table.name, "doc": table.doc,
        "fields": table.fields.iter().map(field).collect::<Vec<_>>() })
}

/// Returns the description of a field, including the fields of a nested table.
fn field(field: &Field) -> Json {
    let inner: Option<Vec<Json>> = match field.ty {
        Ty::Table(inner) => Some(inner.fields.iter().map(self::field).collect()),
        _ => None,
    };
    let mut described = json!({
        "key": field.key, "type": field.ty.describe(), "required": field.required,
        "default": field.default,
        "doc": field.doc,
    });
    if let (Some(inner), Some(fields)) = (inner, described.as_object_mut()) {
        fields.insert("fields".to_owned(), inner.into());
    }
    described
}
