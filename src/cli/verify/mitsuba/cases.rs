//! The table of cases in `cases.txt`, and the XML of their scenes.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Text of the table.
const TABLE: &str = include_str!("cases.txt");

/// Greatest number of path edges of every scene of the table.
pub const MAX_DEPTH: u32 = 12;

/// Name of the list of exported materials.
pub const MATERIALS: &str = "materials";

/// Name of the list of scene files.
pub const FILES: &str = "scenes";

/// Name of the scene in which they are placed.
const MATERIAL_SCENE: &str = "ball";

/// Classes of plugins in Mitsuba; those that are not listed are surfaces.
const CLASSES: &[(&str, &str)] = &[
    ("bitmap", "texture"),
    ("checkerboard", "texture"),
    ("mesh_attribute", "texture"),
    ("hdrfilm", "film"),
    ("box", "rfilter"),
    ("area", "emitter"),
];

/// One case of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of its list.
    pub list: String,
    /// The line, with one of the values of each parameter.
    pub text: String,
    /// Whether it is part of the quick run.
    pub quick: bool,
    /// Scene or material that both programs render.
    pub subject: Subject,
}

/// Scene or material that both programs render.
#[derive(Clone, Debug, PartialEq)]
pub enum Subject {
    /// A scene in Mitsuba's XML.
    Scene(String),
    /// Parameters of a material, whose scene is exported.
    Material(Vec<(String, String)>),
    /// A file, which is rendered in a small picture.
    File(PathBuf),
}

impl Case {
    /// Returns the case of a scene file.
    pub fn of_file(file: &Path) -> Case {
        Case {
            list: FILES.to_owned(),
            text: file.display().to_string(),
            quick: true,
            subject: Subject::File(file.to_owned()),
        }
    }
}

/// Returns all cases in the order of the table.
///
/// # Errors
/// States the line that does not follow the syntax of the table.
pub fn all() -> Result<Vec<Case>, String> {
    parse(TABLE)
}

/// Returns the scene in which exported materials are placed, in XML.
///
/// # Errors
/// Fails if the table lacks the scene.
pub fn material_scene() -> Result<String, String> {
    let scenes = scenes(TABLE);
    let ball = scenes
        .get(MATERIAL_SCENE)
        .ok_or("the table has no scene for materials")?;
    Ok(whole_scene(ball, "<bsdf type=\"diffuse\" id=\"subject\"/>"))
}

/// Returns the scenes of a table by name.
fn scenes(table: &str) -> BTreeMap<&str, String> {
    let mut scenes = BTreeMap::new();
    let mut current = None;
    for line in table.lines() {
        if let Some(name) = line.strip_prefix("scene ") {
            current = Some(name);
        } else if line.starts_with("cases ") || line == MATERIALS {
            current = None;
        } else if let Some(name) = current {
            let text: &mut String = scenes.entry(name).or_default();
            text.push_str(line);
            text.push('\n');
        }
    }
    scenes
}

fn parse(table: &str) -> Result<Vec<Case>, String> {
    let scenes = scenes(table);
    let mut all = Vec::new();
    // The name of the list, and its scene; none for materials.
    let mut list: Option<(&str, Option<&str>)> = None;
    for line in table
        .lines()
        .filter(|line| !line.starts_with('#') && !line.is_empty())
    {
        if line.starts_with("scene ") {
            list = None;
        } else if line == MATERIALS {
            list = Some((MATERIALS, None));
        } else if let Some(head) = line.strip_prefix("cases ") {
            let (name, scene) = head
                .split_once(" in ")
                .ok_or_else(|| format!("no scene: {line}"))?;
            list = Some((name, Some(scene)));
        } else if let Some((name, scene)) = list {
            let template = match scene {
                Some(scene) => Some(
                    scenes
                        .get(scene)
                        .ok_or_else(|| format!("no scene: {scene}"))?,
                ),
                None => None,
            };
            all.extend(cases_of(line, name, template.map(String::as_str))?);
        }
    }
    Ok(all)
}

/// Returns the cases of a line.
fn cases_of(line: &str, list: &str, template: Option<&str>) -> Result<Vec<Case>, String> {
    let (quick, text) = match line.strip_prefix("quick ") {
        Some(rest) => (true, rest),
        None => (false, line),
    };
    let mut cases = Vec::new();
    for (i, text) in alternatives(text).into_iter().enumerate() {
        let subject = match template {
            Some(template) => {
                let mut parser = Parser { rest: &text };
                let object = parser.object(None)?;
                Subject::Scene(whole_scene(template, &object))
            }
            None => Subject::Material(settings(&text)?),
        };
        cases.push(Case {
            list: list.replace('_', " "),
            text,
            quick: quick && i == 0,
            subject,
        });
    }
    Ok(cases)
}

/// Returns the text of a scene with an object in place of `CASE`.
fn whole_scene(template: &str, object: &str) -> String {
    format!(
        "<scene version=\"3.0.0\">\n<integrator type=\"path\"><integer name=\"max_depth\" \
         value=\"{MAX_DEPTH}\"/><integer name=\"rr_depth\" value=\"1000\"/></integrator>\n{}</scene>\n",
        template.replace("CASE", object)
    )
}

/// Returns the texts with one of the values of each `A|B`, the values of the last one changing
/// fastest.
fn alternatives(text: &str) -> Vec<String> {
    let Some(bar) = text.find('|') else {
        return vec![text.to_owned()];
    };
    let ends = |c: char| " {}[]=;".contains(c);
    let start = text[..bar].rfind(ends).map_or(0, |i| i + 1);
    let end = text[bar..].find(ends).map_or(text.len(), |i| bar + i);
    let values = text[start..end].split('|');
    values
        .flat_map(|value| alternatives(&format!("{}{value}{}", &text[..start], &text[end..])))
        .collect()
}

/// Returns the parameters of a material.
fn settings(text: &str) -> Result<Vec<(String, String)>, String> {
    text.split_whitespace()
        .map(|word| {
            word.split_once('=')
                .map(|(key, value)| (key.to_owned(), value.to_owned()))
                .ok_or_else(|| format!("expected KEY=VALUE, found `{word}`"))
        })
        .collect()
}

/// Parser of objects.
struct Parser<'a> {
    rest: &'a str,
}

impl<'a> Parser<'a> {
    /// Returns the next word, up to a space or a bracket.
    fn word(&mut self) -> &'a str {
        let end = self
            .rest
            .find([' ', '{', '}', '[', ']', '='])
            .unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        word
    }

    fn skip(&mut self, c: char) -> bool {
        self.rest = self.rest.trim_start();
        match self.rest.strip_prefix(c) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    /// Parses an object up to its closing brace or the end; returns its XML.
    fn object(&mut self, name: Option<&str>) -> Result<String, String> {
        self.rest = self.rest.trim_start();
        let head = self.word();
        let (class, plugin) = head.split_once(':').unwrap_or_else(|| {
            let known = CLASSES.iter().find(|(plugin, _)| *plugin == head);
            (known.map_or("bsdf", |(_, class)| class), head)
        });
        let name = name.map_or(String::new(), |name| format!(" name=\"{name}\""));
        let mut xml = format!("<{class} type=\"{plugin}\"{name}>");
        loop {
            if self.skip('{') {
                xml.push_str(&self.object(None)?);
            } else if self.rest.is_empty() || self.skip('}') {
                break;
            } else {
                let key = self.word();
                if key.is_empty() || !self.skip('=') {
                    return Err(format!("expected KEY=VALUE at `{}`", self.rest));
                }
                xml.push_str(&self.value(key)?);
            }
        }
        Ok(format!("{xml}</{class}>"))
    }

    /// Parses the value of a parameter; returns its XML.
    fn value(&mut self, key: &str) -> Result<String, String> {
        if self.skip('{') {
            return self.object(Some(key));
        }
        if self.skip('[') {
            let (steps, rest) = self
                .rest
                .split_once(']')
                .ok_or("a transform does not end")?;
            self.rest = rest;
            return transform(key, steps);
        }
        let word = self.word();
        if let Some(point) = word.strip_prefix('@') {
            let class = if key == "direction" {
                "vector"
            } else {
                "point"
            };
            let [x, y, z] = numbers(point, ',')?;
            return Ok(format!(
                "<{class} name=\"{key}\" x=\"{x}\" y=\"{y}\" z=\"{z}\"/>"
            ));
        }
        if let Some(spectrum) = word.strip_prefix('~') {
            return Ok(format!("<spectrum name=\"{key}\" value=\"{spectrum}\"/>"));
        }
        let class = match word {
            "true" | "false" => "boolean",
            _ if word.contains(',') => "rgb",
            _ if word.parse::<f64>().is_err() => "string",
            _ if ["width", "height", "shape_index"].contains(&key) => "integer",
            _ if key.starts_with("crop_") => "integer",
            _ => "float",
        };
        Ok(format!("<{class} name=\"{key}\" value=\"{word}\"/>"))
    }
}

/// Returns three numbers of a text.
fn numbers(text: &str, separator: char) -> Result<[&str; 3], String> {
    let all: Vec<&str> = text.split(separator).collect();
    all.try_into()
        .map_err(|_| format!("expected three numbers, found `{text}`"))
}

/// Returns the XML of a transform.
fn transform(key: &str, steps: &str) -> Result<String, String> {
    let mut xml = format!("<transform name=\"{key}\">");
    for step in steps.split(';').map(str::trim) {
        let (name, rest) = step
            .split_once(' ')
            .ok_or_else(|| format!("no step: `{step}`"))?;
        match (name, &rest.split(' ').collect::<Vec<_>>()[..]) {
            ("scale", [all]) => _ = write!(xml, "<scale value=\"{all}\"/>"),
            ("scale" | "translate", [x, y, z]) => {
                _ = write!(xml, "<{name} x=\"{x}\" y=\"{y}\" z=\"{z}\"/>");
            }
            ("rotate", [axis, angle]) if axis.contains(',') => {
                let [x, y, z] = numbers(axis, ',')?;
                _ = write!(
                    xml,
                    "<rotate x=\"{x}\" y=\"{y}\" z=\"{z}\" angle=\"{angle}\"/>"
                );
            }
            ("rotate", [axis, angle]) => {
                _ = write!(xml, "<rotate {axis}=\"1\" angle=\"{angle}\"/>");
            }
            ("lookat", [origin, target, up]) => {
                _ = write!(
                    xml,
                    "<lookat origin=\"{origin}\" target=\"{target}\" up=\"{up}\"/>"
                );
            }
            _ => return Err(format!("unknown step of a transform: `{step}`")),
        }
    }
    Ok(xml + "</transform>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_a_grid_over_its_values() {
        assert_eq!(
            alternatives("a x=1|2 {b y=p|q}"),
            [
                "a x=1 {b y=p}",
                "a x=1 {b y=q}",
                "a x=2 {b y=p}",
                "a x=2 {b y=q}"
            ]
        );
    }

    #[test]
    fn objects_become_xml_with_typed_values() {
        let text = "mask opacity={bitmap filename=a.png raw=true to_uv=[scale 2 3 1; rotate z 30]} \
                    {diffuse reflectance=1,0.5,0 alpha=0.25}";
        let xml = Parser { rest: text }.object(None).unwrap();
        assert_eq!(
            xml,
            "<bsdf type=\"mask\"><texture type=\"bitmap\" name=\"opacity\">\
             <string name=\"filename\" value=\"a.png\"/><boolean name=\"raw\" value=\"true\"/>\
             <transform name=\"to_uv\"><scale x=\"2\" y=\"3\" z=\"1\"/>\
             <rotate z=\"1\" angle=\"30\"/></transform></texture>\
             <bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"1,0.5,0\"/>\
             <float name=\"alpha\" value=\"0.25\"/></bsdf></bsdf>"
        );
        assert!(Parser { rest: "diffuse x" }.object(None).is_err());
    }

    #[test]
    fn the_table_has_at_least_150_scenes_and_40_materials() {
        let all = all().unwrap();
        let materials = all.iter().filter(|case| case.list == MATERIALS).count();
        assert!(
            all.len() - materials >= 150 && materials >= 40,
            "{} {materials}",
            all.len()
        );
        assert!(all.iter().any(|case| case.quick));
    }
}
