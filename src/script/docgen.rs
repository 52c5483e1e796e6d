//! The editor annotations (LuaLS `---@meta`), written from the tables that check scripts.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::api::{ApiFn, FUNCTIONS, Param, experiment, measure, render, report, stop};
use super::scene;
use crate::metrics::METRICS;
use crate::metrics::tonemap::TONEMAPS;
use crate::scene::desc::{MATERIAL_PARAMS, TextureSlot};
use crate::transport::integrator::external::EXTERNALS;
use crate::transport::integrator::{INTEGRATORS, IntegratorRow};
use crate::value::schema::{AUTO, Field, Table, Ty};

/// The tables of options, in the order of the annotations; tables inside them come before them.
const TABLES: &[&Table] = &[
    &experiment::EXPERIMENT,
    &render::RENDER,
    &experiment::REFERENCE,
    &measure::MEASURE,
    &stop::WHEN,
    &stop::PLATEAU,
    &report::FIGURE,
    &report::TABLE,
    &scene::PLACE,
    &scene::PART,
    &scene::PAINT,
    &scene::LAY,
    &scene::SCATTER,
];

const HEAD: &str = "\
---@meta
-- Lumbre's functions and tables, for the Lua language server. Written by `lumbre schema --lua`; not to be edited.

---A point of the sweep: one field for each axis. Reading a field that is no axis is an error.
---@class Point: { [string]: any }

---One measurement, as stop.predicate gets it. Metric columns are fields too, where there is a reference.
---@class Row: { [string]: number }
---@field wave integer number of the wave, from 1
---@field samples integer samples per pixel so far
---@field render_s number seconds inside the renderer so far
---@field wall_s number seconds that the cell has taken, everything included
---@field measure_s number seconds spent measuring
---@field paths integer camera paths so far
---@field rays integer rays so far
---@field invalid integer samples so far that were NaN or infinite

---When a cell is finished. Made by the functions of `stop`.
---@class StopRule

---An error measure. Made by the functions of `metric`.
---@class Metric

---A value of x:table. Made by time_to.
---@class TimeTo

---A shape. Made by the functions of `shape`.
---@class Shape

---Shapes and groups that belong together. Made by group.
---@class Group

---A picture on a surface, or around the scene. Made by the functions of `texture`.
---@class Texture

---Random numbers that are the same every time. Made by random.
---@class Random
---@field next fun(self: Random): number at least 0 and below 1
---@field between fun(self: Random, a: number, b: number): number
---@field integer fun(self: Random, a: integer, b: integer): integer both ends included
---@field pick fun(self: Random, list: any[]): any

---From radiance to what is shown. Made by the functions of `tonemap`.
---@class Tonemap
---@field kind string

";

/// The whole file of annotations. The same program writes the same text.
pub fn lua() -> String {
    let mut out = HEAD.to_owned();
    let mut written = BTreeSet::new();
    for row in integrators() {
        class(&mut out, &mut written, &row.params, "", &[]);
    }
    let integrators: Vec<&str> = integrators().map(|row| row.params.name).collect();
    for table in tables() {
        let parents = if table.name == render::RENDER.name { integrators.join(", ") } else { String::new() };
        let more = if table.name == measure::MEASURE.name { &["---@field [string] Metric"] as &[_] } else { &[] };
        class(&mut out, &mut written, table, &parents, more);
    }
    render_changes(&mut out, &integrators);
    scene_material(&mut out);
    constructors(&mut out, &mut written);
    functions(&mut out);
    material_paths(&mut out);
    out
}

/// One class with the classes of its nested tables before it.
fn class(out: &mut String, written: &mut BTreeSet<&'static str>, table: &Table, parents: &str, more: &[&str]) {
    if !written.insert(table.name) {
        return;
    }
    for field in table.fields {
        nested(out, written, &field.ty);
    }
    let parents = if parents.is_empty() { String::new() } else { format!(": {parents}") };
    line(out, format_args!("---{}", table.doc));
    line(out, format_args!("---@class {}{parents}", table.name));
    for field in table.fields {
        line(out, format_args!("---{}", field_line(field)));
    }
    more.iter().for_each(|m| line(out, format_args!("{m}")));
    out.push('\n');
}

/// The render table once more with nothing required, for what a reference changes of it.
fn render_changes(out: &mut String, integrators: &[&str]) {
    line(out, format_args!("---What a reference changes of its cell's render table."));
    line(out, format_args!("---@class RenderChanges: {}", integrators.join(", ")));
    for field in render::RENDER.fields {
        line(out, format_args!("---{}", field_line(&Field { required: false, default: "the cell's", ..*field })));
    }
    out.push('\n');
}

/// Every technique, other programs' last.
fn integrators() -> impl Iterator<Item = &'static IntegratorRow> {
    INTEGRATORS.iter().chain(EXTERNALS)
}

/// Every table of options.
fn tables() -> impl Iterator<Item = &'static Table> {
    TABLES.iter().chain(scene::SHAPE_TABLES).chain(scene::OBJECT_TABLES).copied()
}

/// What `s:material` takes: its own options, every parameter, every texture.
fn scene_material(out: &mut String) {
    line(out, format_args!("---A material of a scene."));
    line(out, format_args!("---@class SceneMaterial"));
    for field in scene::MATERIAL_OPTIONS.fields {
        line(out, format_args!("---{}", field_line(field)));
    }
    for param in MATERIAL_PARAMS {
        line(out, format_args!("---@field {}? {} {}", param.name, lua_type(&param.ty), param.doc));
    }
    for slot in TextureSlot::ALL {
        line(
            out,
            format_args!("---@field {}? string|Texture an image of the scene's folder, or a texture", slot.name()),
        );
    }
    out.push('\n');
}

fn nested(out: &mut String, written: &mut BTreeSet<&'static str>, ty: &Ty) {
    match ty {
        Ty::Table(table) => class(out, written, table, "", &[]),
        Ty::List(inner) | Ty::OneOrMany(inner) | Ty::OrAuto(inner) => nested(out, written, inner),
        _ => {}
    }
}

fn field_line(field: &Field) -> String {
    let optional = if field.required { "" } else { "?" };
    let mut notes = vec![];
    if let Some(range) = range(&field.ty) {
        notes.push(range);
    }
    if !field.default.is_empty() {
        notes.push(format!("default: {}", field.default));
    }
    let notes = if notes.is_empty() { String::new() } else { format!(" ({})", notes.join("; ")) };
    format!("@field {}{optional} {} {}{notes}", field.key, lua_type(&field.ty), field.doc)
}

/// The range of a number in words.
fn range(ty: &Ty) -> Option<String> {
    match ty {
        Ty::Int { .. } | Ty::Num { .. } | Ty::Nums { .. } => {
            let words = ty.describe();
            words
                .split_once(" of ")
                .or_else(|| words.split_once(" between ").map(|(a, _)| (a, &words[a.len() + 1..])))
                .map(|(_, range)| range.to_owned())
        }
        _ => None,
    }
}

/// The LuaLS type of a field.
fn lua_type(ty: &Ty) -> String {
    match ty {
        Ty::Bool => "boolean".to_owned(),
        Ty::Int { .. } => "integer".to_owned(),
        Ty::Num { .. } => "number".to_owned(),
        Ty::Str => "string".to_owned(),
        Ty::Word(words) => words.iter().map(|w| format!("\"{w}\"")).collect::<Vec<_>>().join("|"),
        Ty::Duration => "number|string".to_owned(),
        Ty::Nums { .. } => "number[]".to_owned(),
        Ty::List(item) => format!("({})[]", lua_type(item)),
        Ty::OneOrMany(item) => format!("{0}|({0})[]", lua_type(item)),
        Ty::OrAuto(item) => format!("{}|\"{AUTO}\"", lua_type(item)),
        Ty::Table(table) => table.name.to_owned(),
        Ty::Object(name) | Ty::Any(name) => (*name).to_owned(),
    }
}

/// `metric.NAME` and `tonemap.NAME`, one for each row.
fn constructors(out: &mut String, written: &mut BTreeSet<&'static str>) {
    for row in METRICS {
        class(out, written, &row.options, "", &[]);
    }
    for (_, table) in TONEMAPS {
        class(out, written, table, "", &[]);
    }
    out.push_str("metric = {}\n\n");
    for row in METRICS {
        line(out, format_args!("---{}: {} ({} is better)", row.long_name, row.doc, row.better));
        line(out, format_args!("---@param options? {}", row.options.name));
        line(out, format_args!("---@return Metric"));
        line(out, format_args!("function metric.{}(options) end\n", row.name));
    }
    out.push_str("tonemap = {}\n\n");
    for (name, table) in TONEMAPS {
        line(out, format_args!("---{}", table.doc));
        line(out, format_args!("---@param options? {}", table.name));
        line(out, format_args!("---@return Tonemap"));
        line(out, format_args!("function tonemap.{name}(options) end\n"));
    }
}

fn functions(out: &mut String) {
    out.push_str("stop = {}\n\nshape = {}\n\ntexture = {}\n\n");
    FUNCTIONS.iter().chain(scene::FUNCTIONS).copied().flatten().for_each(|row| function(out, row, row.name));
    out.push_str("---What experiment(..) returns, and what a script must return.\n---@class Experiment\nlocal Experiment = {}\n\n");
    for row in experiment::METHODS.iter().copied().flatten() {
        function(out, row, &row.name.replace("x:", "Experiment:"));
    }
    out.push_str(
        "---What scene {..} returns, and what a scene's file must return.\n---@class Scene\nlocal Scene = {}\n\n",
    );
    for row in scene::METHODS {
        function(out, row, &row.name.replace("s:", "Scene:"));
    }
}

fn function(out: &mut String, row: &ApiFn, name: &str) {
    line(out, format_args!("---{}", row.doc));
    for Param { name, ty, doc } in row.params {
        line(out, format_args!("---@param {name} {ty} {doc}"));
    }
    if !row.returns.is_empty() {
        line(out, format_args!("---@return {}", row.returns));
    }
    let names: Vec<&str> = row.params.iter().map(|p| p.name.trim_end_matches('?')).collect();
    line(out, format_args!("function {name}({}) end\n", names.join(", ")));
}

/// The paths that `set` knows for every material: no type can say them, so a comment does.
fn material_paths(out: &mut String) {
    out.push_str("-- Paths of materials for `set`, as in set = { [\"materials.egg.ior\"] = 1.5 }:\n");
    for param in MATERIAL_PARAMS {
        line(out, format_args!("--   materials.NAME.{}: {}; {}", param.name, param.ty.describe(), param.doc));
    }
    for slot in TextureSlot::ALL {
        line(
            out,
            format_args!(
                "--   materials.NAME.{}: a file relative to the current folder or else to the script's, \"\" for none",
                slot.name()
            ),
        );
    }
}

fn line(out: &mut String, text: std::fmt::Arguments) {
    // Writing to a string cannot fail.
    let _ = writeln!(out, "{text}");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn each_field(table: &Table, visit: &mut dyn FnMut(&Table, &Field)) {
        for field in table.fields {
            visit(table, field);
            if let Ty::Table(inner) = field.ty {
                each_field(inner, visit);
            }
        }
    }

    #[test]
    fn every_field_function_and_row_is_written() {
        let text = lua();
        let rows = METRICS.iter().map(|m| &m.options).chain(TONEMAPS.iter().map(|(_, t)| t));
        let tables: Vec<&Table> = tables().chain(rows).chain(integrators().map(|i| &i.params)).collect();
        for table in tables {
            assert!(text.contains(&format!("---@class {}", table.name)), "{}", table.name);
            each_field(table, &mut |table, field| {
                let wanted = format!("---{}\n", field_line(field));
                assert!(text.contains(&wanted), "{}.{}: {wanted}", table.name, field.key);
                assert!(!field.doc.is_empty(), "{}.{} has no documentation", table.name, field.key);
            });
        }
        let functions = FUNCTIONS.iter().chain(experiment::METHODS).chain(scene::FUNCTIONS).copied().flatten();
        for row in functions.chain(scene::METHODS) {
            assert!(text.contains(row.doc), "{}", row.name);
            assert!(row.params.iter().all(|p| text.contains(p.doc)), "{}", row.name);
        }
        assert!(METRICS.iter().all(|m| text.contains(&format!("function metric.{}(options) end", m.name))));
        assert!(MATERIAL_PARAMS.iter().all(|p| text.contains(&format!("materials.NAME.{}:", p.name))));
    }

    #[test]
    fn the_text_is_lua_and_always_the_same() {
        let text = lua();
        assert_eq!(text, lua());
        mlua::Lua::new().load(&text).exec().unwrap();
        assert!(text.lines().filter(|l| l.starts_with("---@class ")).count() > 10);
    }

    #[test]
    fn every_class_that_is_named_is_declared() {
        let text = lua();
        let declared: BTreeSet<&str> = text
            .lines()
            .filter_map(|l| l.strip_prefix("---@class "))
            .filter_map(|l| l.split(|c: char| !c.is_alphanumeric()).next())
            .collect();
        let tags = text.lines().filter(|l| ["---@param", "---@return", "---@field"].iter().any(|t| l.starts_with(t)));
        for tag in tags {
            let ty = tag.split_whitespace().nth(if tag.starts_with("---@return") { 1 } else { 2 }).unwrap_or("");
            let names = ty.split(|c: char| !c.is_alphanumeric()).filter(|w| w.starts_with(char::is_uppercase));
            names.for_each(|name| assert!(declared.contains(name), "{name} in {tag}"));
        }
    }

    #[test]
    fn ranges_read_like_ranges() {
        assert_eq!(range(&Ty::Int { min: 1, max: 9 }).as_deref(), Some("between 1 and 9"));
        assert_eq!(range(&Ty::Num { min: 0.0, max: f64::MAX }).as_deref(), Some("at least 0"));
        assert_eq!(range(&Ty::Str), None);
    }
}
