//! Reference pages of the Lua interface, generated from the tables that validate scripts.
//!
//! [`reference()`] returns the generated parts of the pages in docs/reference. [`EXPERIMENTS`] and
//! [`SCENES`] group the functions and option tables; a test checks that no function and no table is
//! missing.

use std::collections::BTreeSet;

use super::api::{ApiFn, FUNCTIONS, experiment, stop_rule};
use super::docgen::{integrators, tables};
use super::scene;
use lumbre_light::scene::desc::{MATERIAL_PARAMS, TextureSlot};
use lumbre_light::value::markdown::{fields_table, link, row, sentence, table_head, type_text};
use lumbre_light::value::schema::{Table, Ty};
use lumbre_metrics::METRICS;
use lumbre_metrics::tonemap::TONEMAPS;
use lumbre_scene_io::edit::{ENTITY_PARAMS, ENVIRONMENT_PARAMS, LIGHT_PARAMS, SCENE_PARAMS};

/// Section of a page.
struct Section {
    /// Heading of the section.
    title: &'static str,
    /// Introduction in a few sentences.
    intro: &'static str,
    /// Names of its functions, in order.
    functions: &'static [&'static str],
    /// Content that is generated from other tables.
    extra: Option<fn(&mut Page)>,
}

/// Sections on scripts of experiments, in order.
const EXPERIMENTS: &[Section] = &[
    Section {
        title: "Experiment",
        intro: "An experiment script creates one experiment, calls its methods, and ends with \
                `return x`.",
        functions: &[
            "experiment",
            "x:skip",
            "x:checkpoint",
            "x:deadline",
            "x:control",
            "x:notify",
            "require",
        ],
        extra: None,
    },
    Section {
        title: "Axes",
        intro: "The cells of an experiment are all combinations of the values of its axes, except \
                those that `x:skip` removes.",
        functions: &["x:axis", "range", "linspace", "logspace", "zip"],
        extra: None,
    },
    Section {
        title: "Render table",
        intro: "The function passed to `x:render` receives a point, reads the values of axes as \
                `p.NAME`, and returns the settings of one cell.",
        functions: &["x:render"],
        extra: Some(set_paths),
    },
    Section {
        title: "Integrators",
        intro: "`integrator` in the render table selects the technique. Its parameters are keys of \
                the render table itself.",
        functions: &[],
        extra: Some(integrator_params),
    },
    Section {
        title: "Other renderers",
        intro: "Any renderer can be a technique; [other renderers](external.md) explains commands, \
                placeholders, the protocol of servers, and permission.",
        functions: &["external"],
        extra: None,
    },
    Section {
        title: "Camera",
        intro: "`camera` in the render table changes the camera of the scene.",
        functions: &[],
        extra: Some(|page| page.table("CameraChanges")),
    },
    Section {
        title: "Film",
        intro: "`film` in the render table adds a time axis to every pixel; see [transient \
                rendering](transient.md).",
        functions: &[],
        extra: Some(|page| page.table("FilmOptions")),
    },
    Section {
        title: "Reference",
        intro: "Metrics compare a cell with its reference, which is rendered before the cell or \
                read from a file.",
        functions: &["x:reference"],
        extra: None,
    },
    Section {
        title: "Measure",
        intro: "Metrics are computed between waves while a cell renders, and once at its end.",
        functions: &["x:measure"],
        extra: Some(metrics_and_tonemaps),
    },
    Section {
        title: "Stop rules",
        intro: "Stop rules are checked between waves. `stop.any`, `stop.all` and `stop.not_` \
                combine them.",
        functions: &[
            "x:stop",
            "stop.time",
            "stop.samples",
            "stop.waves",
            "stop.when",
            "stop.plateau",
            "stop.nan",
            "stop.predicate",
            "stop.any",
            "stop.all",
            "stop.not_",
        ],
        extra: None,
    },
    Section {
        title: "Figures and tables",
        intro: "Figures, tables and sheets are written when a night ends; `lumbre report` draws \
                many more without any declaration.",
        functions: &[
            "x:report", "x:note", "x:figure", "x:table", "time_to", "x:sheet", "x:frames",
        ],
        extra: None,
    },
];

/// Sections on scripts of scenes, in order.
const SCENES: &[Section] = &[
    Section {
        title: "Scene scripts",
        intro: "A scene script creates one scene, calls its methods, and ends with `return s`. \
                Experiments name its file as `scene`. Files that it names are relative to its \
                folder.",
        functions: &["scene", "s:option", "s:camera", "s:view", "s:import"],
        extra: None,
    },
    Section {
        title: "Shapes",
        intro: "Lengths are in scene units; +y is up. A shape becomes visible when `s:add` places \
                it with a material.",
        functions: &[
            "s:add",
            "group",
            "shape.box",
            "shape.sphere",
            "shape.ball",
            "shape.grid",
            "shape.disk",
            "shape.heightfield",
            "shape.lathe",
            "shape.cylinder",
            "shape.tube",
            "shape.torus",
            "shape.extrude",
            "shape.mesh",
            "shape.join",
        ],
        extra: None,
    },
    Section {
        title: "Materials",
        intro: "The parameters below are keys of `s:material`, and of `set` in a render table as \
                `materials.NAME.PARAMETER`.",
        functions: &["s:material"],
        extra: Some(materials),
    },
    Section {
        title: "Textures",
        intro: "A texture is a value of a material's texture keys or of the environment's `map`.",
        functions: &[
            "texture.file",
            "texture.paint",
            "texture.lay",
            "texture.channel",
        ],
        extra: None,
    },
    Section {
        title: "Lights",
        intro: "Area lights are shapes whose material has an `emission`. The functions below add \
                lights without a surface.",
        functions: &["s:light", "s:environment"],
        extra: None,
    },
    Section {
        title: "Random numbers",
        intro: "Scene scripts have no `math.random`. These functions give the same values in every \
                run.",
        functions: &["random", "scatter", "noise"],
        extra: None,
    },
];

/// Types in signatures that have no option table, with their meaning.
const TYPES: &[(&str, &str)] = &[
    (
        "Point",
        "Point of the sweep: a table with one field for each axis.",
    ),
    (
        "RenderChanges",
        "Render table in which every key is optional.",
    ),
    ("Experiment", "Object returned by `experiment`."),
    ("StopRule", "Object returned by the functions of `stop`."),
    ("Metric", "Object returned by the functions of `metric`."),
    ("Tonemap", "Object returned by the functions of `tonemap`."),
    ("TimeTo", "Object returned by `time_to`."),
    ("Scene", "Object returned by `scene`."),
    ("Shape", "Object returned by the functions of `shape`."),
    ("Group", "Object returned by `group`."),
    ("Texture", "Object returned by the functions of `texture`."),
    (
        "SceneMaterial",
        "Table of material parameters and textures.",
    ),
    ("Random", "Object returned by `random`."),
    (
        "duration",
        "Number of seconds, or text such as `\"500ms\"`, `\"30s\"`, `\"5min\"`, `\"8h\"`.",
    ),
];

/// Names of the files in docs/reference whose generated parts [`reference()`] returns.
const FILES: [&str; 2] = ["script.md", "scene_script.md"];

/// Returns the generated parts of the pages on experiments and on scenes, each with the name of its
/// file in docs/reference.
pub fn reference() -> [(&'static str, String); 2] {
    let mut page = Page::default();
    page.text("## Types");
    page.push(&table_head(["type", "meaning"]));
    for (name, meaning) in TYPES {
        page.push(&row([&format!("`{name}`"), meaning]));
    }
    page.push("\n");
    let texts = [EXPERIMENTS, SCENES].map(|sections| {
        sections.iter().for_each(|section| page.section(section));
        std::mem::take(&mut page.out).trim_end().to_owned() + "\n"
    });
    let places = texts.each_ref().map(|text| places(text));
    [0, 1].map(|i| {
        let there = |place: &str| !places[i].contains(place) && places[1 - i].contains(place);
        (FILES[i], linked(&texts[i], FILES[1 - i], there))
    })
}

/// Returns the addresses of the headings of a page, as renderers of Markdown form them.
fn places(page: &str) -> BTreeSet<String> {
    let headings = page.lines().filter_map(|line| {
        let heading = line.trim_start_matches('#');
        (heading.len() < line.len()).then_some(heading.trim())
    });
    let address = |heading: &str| -> String {
        let kept = heading.to_lowercase().replace(' ', "-");
        kept.replace(|c: char| !c.is_alphanumeric() && c != '-' && c != '_', "")
    };
    headings.map(address).collect()
}

/// Directs the links of a page to those headings that stand on another one.
fn linked(page: &str, other: &str, is_there: impl Fn(&str) -> bool) -> String {
    let mut parts = page.split("](#");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let place = part.split(')').next().unwrap_or_default();
        let file = if is_there(place) { other } else { "" };
        text += &format!("]({file}#{part}");
    }
    text
}

/// Page under construction.
#[derive(Default)]
struct Page {
    out: String,
    /// Names of the option tables that were printed.
    printed: BTreeSet<&'static str>,
}

/// Returns all functions and methods.
fn functions() -> impl Iterator<Item = &'static ApiFn> {
    FUNCTIONS
        .iter()
        .chain(experiment::METHODS)
        .chain(scene::FUNCTIONS)
        .copied()
        .flatten()
        .chain(scene::METHODS)
}

/// Returns the option table with this name, which may be nested in another one.
fn table_named(name: &str) -> Option<&'static Table> {
    fn find(table: &'static Table, name: &str) -> Option<&'static Table> {
        if table.name == name {
            return Some(table);
        }
        let nested = table.fields.iter().filter_map(|f| nested_table(&f.ty));
        nested.into_iter().find_map(|table| find(table, name))
    }
    tables()
        .chain([&stop_rule::ROW])
        .find_map(|table| find(table, name))
}

impl Page {
    /// Appends Markdown as it is.
    fn push(&mut self, markdown: &str) {
        self.out += markdown;
    }

    /// Appends a section with its functions and tables.
    fn section(&mut self, section: &Section) {
        self.text(&format!("## {}", section.title));
        self.text(section.intro);
        for name in section.functions {
            self.function(name);
        }
        if let Some(extra) = section.extra {
            extra(self);
        }
    }

    /// Appends a paragraph.
    fn text(&mut self, markdown: &str) {
        self.push(markdown);
        self.push("\n\n");
    }

    /// Appends a function with its parameters, and the option tables that its signature names.
    fn function(&mut self, name: &str) {
        let Some(row) = functions().find(|row| row.name == name) else {
            return;
        };
        self.text(&format!("### `{}`", signature(row)));
        self.text(row.doc);
        for param in row.params {
            let name = param.name.trim_end_matches('?');
            let optional = if param.name.ends_with('?') {
                ", optional"
            } else {
                ""
            };
            self.push(&format!(
                "- `{name}` (`{}`{optional}): {}\n",
                param.ty, param.doc
            ));
        }
        if !row.returns.is_empty() {
            self.push(&format!("- returns `{}`\n", row.returns));
        }
        if !row.params.is_empty() || !row.returns.is_empty() {
            self.push("\n");
        }
        for param in row.params {
            self.tables_in(param.ty);
        }
    }

    /// Appends the option tables that a LuaLS type names, or links to those that were printed.
    fn tables_in(&mut self, ty: &str) {
        let names: BTreeSet<&str> = ty.split(|c: char| !c.is_alphanumeric()).collect();
        for table in names.into_iter().filter_map(table_named) {
            if self.printed.contains(table.name) {
                self.text(&format!("Keys: see {}.", link(table)));
            } else {
                self.option_table(table);
            }
        }
    }

    /// Appends the option table `name`, followed by its nested tables.
    fn table(&mut self, name: &str) {
        if let Some(table) = table_named(name) {
            self.option_table(table);
        }
    }

    /// Appends an option table and its nested tables, unless it was printed before. Tables with a
    /// section of their own are left to that section.
    fn option_table(&mut self, table: &'static Table) {
        if !self.printed.insert(table.name) {
            return;
        }
        self.text(&format!("#### {}", table.name));
        self.text(table.doc);
        let keys = fields_table(table);
        self.text(keys.trim_end());
        for field in table.fields {
            let nested = match field.ty {
                Ty::Object(name) => table_named(name),
                ty => nested_table(&ty),
            };
            if let Some(nested) = nested
                && !OWN_SECTION.contains(&nested.name)
            {
                self.option_table(nested);
            }
        }
    }
}

/// Nested tables of the render table that have sections of their own.
const OWN_SECTION: [&str; 2] = ["CameraChanges", "FilmOptions"];

/// Returns the table inside a type.
fn nested_table(ty: &Ty) -> Option<&'static Table> {
    match ty {
        Ty::Table(table) => Some(table),
        Ty::List(item) | Ty::OneOrMany(item) | Ty::OrAuto(item) => nested_table(item),
        _ => None,
    }
}

/// Returns the call of a function, with optional parameters in brackets. Constructors that take one
/// table are written with braces.
fn signature(row: &ApiFn) -> String {
    if let [param] = row.params
        && table_named(param.ty).is_some()
    {
        return format!("{} {{ .. }}", row.name);
    }
    let mut call = format!("{}(", row.name);
    for (i, param) in row.params.iter().enumerate() {
        let comma = if i == 0 { "" } else { ", " };
        call += &match param.name.strip_suffix('?') {
            Some(name) => format!("[{comma}{name}]"),
            None => format!("{comma}{}", param.name),
        };
    }
    call + ")"
}

/// Appends the paths of `set`.
fn set_paths(page: &mut Page) {
    page.text("### Paths of `set`");
    page.text(
        "`set` changes any value of the scene by its path, as in `set = { [\"materials.egg.ior\"] \
         = 1.5, [\"lights.key.intensity\"] = { 5, 5, 5 } }`. `lumbre check SCENE` lists the names \
         of a scene. The paths `materials.NAME.PARAMETER` accept the parameters and textures of \
         [materials](#materials); `materials.*.PARAMETER` changes all materials that do not emit \
         light. `camera = \"NAME\"` selects a view, as `view` does.",
    );
    page.push(&table_head(["path", "type", "meaning"]));
    let mut push = |path: &str, ty: &Ty, doc: &str| {
        page.push(&row([&format!("`{path}`"), &type_text(ty), &sentence(doc)]));
    };
    for setting in SCENE_PARAMS {
        push(setting.name, &setting.ty, setting.doc);
    }
    for setting in ENTITY_PARAMS {
        push(
            &format!("entities.NAME.{}", setting.name),
            &setting.ty,
            setting.doc,
        );
    }
    for setting in LIGHT_PARAMS {
        push(
            &format!("lights.NAME.{}", setting.name),
            &setting.ty,
            setting.doc,
        );
    }
    for setting in ENVIRONMENT_PARAMS {
        push(
            &format!("environment.{}", setting.name),
            &setting.ty,
            setting.doc,
        );
    }
    page.push("\n");
}

/// Appends all integrators with their parameters.
fn integrator_params(page: &mut Page) {
    for integrator in integrators() {
        page.text(&format!("### `{}`", integrator.name));
        page.text(&format!(
            "{}. {}",
            sentence(integrator.long_name).trim_end_matches('.'),
            sentence(integrator.doc)
        ));
        if let Some(bias) = integrator.bias {
            page.text(&format!(
                "It is biased: {bias}. `agree` refuses it, and a reference by it raises a warning."
            ));
        }
        if !integrator.params.fields.is_empty() {
            let keys = fields_table(&integrator.params);
            page.text(keys.trim_end());
        }
    }
}

/// Appends the constructors of metrics and tone maps.
fn metrics_and_tonemaps(page: &mut Page) {
    page.text("### `metric.NAME([options])`");
    page.text(
        "Returns a metric for a column of `x:measure`. [Metrics](metrics.md) lists definitions and \
         options.",
    );
    page.push(&table_head(["function", "meaning", "better"]));
    for metric in METRICS {
        page.push(&row([
            &format!("[`metric.{0}`](metrics.md#{0})", metric.name),
            &sentence(metric.long_name),
            &metric.better.to_string(),
        ]));
    }
    page.push("\n");
    page.text("### `tonemap.NAME([options])`");
    page.text("Returns a tone map, for `display` of `x:measure` and for `on` of metrics.");
    for (name, table) in TONEMAPS {
        page.text(&format!("#### `tonemap.{name}`"));
        page.text(table.doc);
        if !table.fields.is_empty() {
            let keys = fields_table(table);
            page.text(keys.trim_end());
        }
    }
}

/// Appends the options, parameters and textures of materials.
fn materials(page: &mut Page) {
    page.text(&format!("#### {}", scene::MATERIAL_OPTIONS.name));
    page.text(scene::MATERIAL_OPTIONS.doc);
    let keys = fields_table(&scene::MATERIAL_OPTIONS);
    page.text(keys.trim_end());
    page.text("#### Material parameters");
    page.push(&table_head(["key", "type", "unit", "texture", "meaning"]));
    for param in MATERIAL_PARAMS {
        let texture = param.texture.map(|slot| format!("`{}`", slot.name()));
        page.push(&row([
            &format!("`{}`", param.name),
            &type_text(&param.ty),
            if param.unit.is_empty() {
                "–"
            } else {
                param.unit
            },
            &texture.unwrap_or_else(|| "–".to_owned()),
            &sentence(param.doc),
        ]));
    }
    page.push("\n");
    let slots: Vec<String> = TextureSlot::ALL
        .into_iter()
        .map(|slot| format!("`{}`", slot.name()))
        .collect();
    page.text(&format!(
        "Texture keys: {}. Their value is a texture, or the name of an image file in the scene's \
         folder; in `set`, a file relative to the current folder or else to the script's, or \
         `\"\"` for none.",
        slots.join(", ")
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_function_and_every_key_is_on_the_page() {
        let pages = reference();
        let page = pages.map(|(_, text)| text).concat();
        for row in functions() {
            let heading = format!("### `{}`\n", signature(row));
            assert_eq!(page.matches(&heading).count(), 1, "{}", row.name);
        }
        let rows = integrators().map(|row| &row.params);
        let tone_maps = TONEMAPS.iter().map(|(_, table)| table);
        for table in tables().chain(rows).chain(tone_maps) {
            for field in table.fields {
                let line = format!(
                    "| `{}` | {}",
                    field.key,
                    type_text(&field.ty).replace('|', "\\|")
                );
                assert!(page.contains(&line), "{}.{}: {line}", table.name, field.key);
            }
        }
        for table in tables() {
            let heading = format!("#### {}\n", table.name);
            assert_eq!(page.matches(&heading).count(), 1, "{}", table.name);
        }
        assert!(page.contains(&format!(
            "#### {}\n",
            super::super::api::render_schema::RENDER.name
        )));
    }

    #[test]
    fn every_type_in_a_signature_is_explained() {
        let pages = reference();
        let page = pages.map(|(_, text)| text).concat();
        for row in functions() {
            let types = row.params.iter().map(|p| p.ty).chain([row.returns]);
            let words = types.flat_map(|ty| ty.split(|c: char| !c.is_alphanumeric()));
            for word in words.filter(|word| word.starts_with(char::is_uppercase)) {
                let known = page.contains(&format!("#### {word}\n"))
                    || TYPES.iter().any(|(name, _)| *name == word);
                assert!(known, "{}: {word}", row.name);
            }
        }
    }
}
