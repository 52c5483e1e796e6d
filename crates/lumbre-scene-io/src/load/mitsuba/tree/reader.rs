//! Reading of XML files as a tree of [`XmlObject`]s.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::{DAffine3, DVec3};
use roxmltree::Node;

use super::references::{Draft, DraftProperty, Drafts, MAX_DEPTH, Reference};
use super::{PropertyValue, XmlObject, find_file};
use crate::load::mitsuba::values::{self, Spectrum};
use crate::load::spectrum::{KELVIN, Sampled};
use crate::load::{Variables, canonical, read_file};
use lumbre_light::scene::{Note, SceneError};
use lumbre_light::value::schema::unknown_name;

/// Greatest size of a scene file in bytes.
const MAX_XML_BYTES: u64 = 64 << 20;
/// Greatest number of folders in which files are searched.
const MAX_FOLDERS: usize = 16;
/// Greatest number of bytes by which the variables in an attribute may lengthen it.
const MAX_GROWTH: usize = 4096;
/// Greatest number of variables that a message lists.
const MAX_LISTED: usize = 32;
/// Greatest ratio of the bytes read to the size of all files: how often files may be included on
/// average.
const MAX_READ_RATIO: usize = 16;
/// Number of bytes that may be read from files of any size.
const MIN_READ_BUDGET: usize = 1 << 20;

/// Plugins of textures that `spectrum` elements may have.
const TEXTURES: [&str; 3] = ["bitmap", "checkerboard", "mesh_attribute"];

/// Elements that are objects with a plugin.
const CLASSES: &[&str] = &[
    "scene",
    "integrator",
    "sensor",
    "sampler",
    "film",
    "rfilter",
    "bsdf",
    "texture",
    "shape",
    "emitter",
    "medium",
    "phase",
    "volume",
    "subsurface",
    "TemporalProfile",
    "temporal_profile",
];

/// Reads a file and everything that it includes, with values for its variables. Returns the root
/// object and the size of these files in bytes.
pub(in crate::load::mitsuba) fn scene(
    path: &Path,
    variables: &Variables,
    notes: &mut Vec<Note>,
) -> Result<(Rc<XmlObject>, usize), SceneError> {
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let mut reader = XmlReader {
        drafts: Drafts::default(),
        folders: vec![folder],
        longest_name: variables.keys().map(String::len).max().unwrap_or_default(),
        variables: variables.clone(),
        named: RefCell::default(),
        files: Vec::new(),
        sizes: BTreeMap::new(),
        bytes_read: 0,
        legacy: false,
        notes,
    };
    let root = reader.file(path)?;
    reader.check_named(path, variables)?;
    let bytes = reader.sizes.values().sum();
    Ok((reader.drafts.object(root, reader.folders)?, bytes))
}

/// State while files are read.
struct XmlReader<'n> {
    drafts: Drafts,
    /// Folders in which files are searched, in order.
    folders: Vec<PathBuf>,
    /// Values of variables: given ones, and those of `default` elements so far.
    variables: Variables,
    /// Length of the longest name in `variables`.
    longest_name: usize,
    /// Names of the variables that the files name.
    named: RefCell<BTreeSet<String>>,
    /// Files that are being read, to detect cycles of includes.
    files: Vec<PathBuf>,
    /// Size of every file read, in bytes.
    sizes: BTreeMap<PathBuf, usize>,
    /// Number of bytes read in total, each inclusion counted.
    bytes_read: usize,
    /// Whether the current file is one of version 0.6 or older.
    legacy: bool,
    notes: &'n mut Vec<Note>,
}

/// An element with its location.
struct Element<'a, 'i> {
    node: Node<'a, 'i>,
    file: Rc<Path>,
    /// Offsets of the line ends in the file, in bytes.
    ends: &'a [usize],
}

impl Element<'_, '_> {
    /// Returns the line of the element, counted from 1.
    fn line(&self) -> u32 {
        self.ends
            .partition_point(|end| *end < self.node.range().start) as u32
            + 1
    }

    /// Returns another element of the same file.
    fn with_node<'b>(&self, node: Node<'b, 'b>) -> Element<'b, 'b>
    where
        Self: 'b,
    {
        Element {
            node,
            file: self.file.clone(),
            ends: self.ends,
        }
    }

    /// Creates an error about the element.
    fn error(&self, problem: impl Into<String>) -> SceneError {
        let place = format!("line {}, <{}>", self.line(), self.node.tag_name().name());
        SceneError::malformed(self.file.to_path_buf(), place, problem)
    }
}

impl XmlReader<'_> {
    /// Reads a file as an object, and returns its index.
    fn file(&mut self, path: &Path) -> Result<usize, SceneError> {
        let malformed =
            |place: String, problem: String| SceneError::malformed(path, place, problem);
        let canonical_path = canonical(path);
        if self.files.len() >= MAX_DEPTH || self.files.contains(&canonical_path) {
            return Err(malformed(
                "include".to_owned(),
                format!(
                    "files include one another in a cycle, or more than {MAX_DEPTH} levels deep"
                ),
            ));
        }
        let bytes = read_file(path, MAX_XML_BYTES)?;
        self.sizes.insert(canonical_path.clone(), bytes.len());
        self.bytes_read += bytes.len();
        if self.bytes_read > MIN_READ_BUDGET + MAX_READ_RATIO * self.sizes.values().sum::<usize>() {
            let problem = "files are included too often for their size";
            return Err(malformed("include".to_owned(), problem.to_owned()));
        }
        let text = std::str::from_utf8(&bytes).map_err(|e| {
            malformed(
                format!("byte {}", e.valid_up_to()),
                "the file is not UTF-8 text".to_owned(),
            )
        })?;
        let text = &*with_plain_comments(text);
        if nesting(text) > MAX_DEPTH * 4 {
            return Err(malformed(
                "whole file".to_owned(),
                "elements are nested too deep".to_owned(),
            ));
        }
        // This parser refuses document types, and with them entities that expand.
        let options = roxmltree::ParsingOptions {
            nodes_limit: (bytes.len() as u32).saturating_add(16),
            ..Default::default()
        };
        let document = roxmltree::Document::parse_with_options(text, options).map_err(|e| {
            malformed(
                format!("line {}, column {}", e.pos().row, e.pos().col),
                format!("invalid XML: {e}"),
            )
        })?;
        self.files.push(canonical_path);
        let ends = line_ends(text);
        let element = Element {
            node: document.root_element(),
            file: Rc::from(path),
            ends: &ends,
        };
        let outer = self.legacy;
        if let Some(version) = element.node.attribute("version") {
            self.legacy = version.trim_start().starts_with("0.");
        }
        let root = self.object(&element, 0);
        self.legacy = outer;
        self.files.pop();
        root
    }

    /// Reads an element as an object, and returns its index.
    fn object(&mut self, element: &Element, depth: usize) -> Result<usize, SceneError> {
        if depth > MAX_DEPTH {
            return Err(element.error(format!(
                "objects are nested more than {MAX_DEPTH} levels deep"
            )));
        }
        let node = element.node;
        let id = self.attribute(element, "id")?;
        let mut object = Draft {
            class: node.tag_name().name().to_owned(),
            plugin: self.attribute(element, "type")?.unwrap_or_default(),
            id: id.clone(),
            file: element.file.clone(),
            line: element.line(),
            legacy: self.legacy,
            properties: Vec::new(),
        };
        for child in node.children().filter(Node::is_element) {
            self.child(&element.with_node(child), &mut object, depth)?;
        }
        let index = self.drafts.objects.len();
        self.drafts.objects.push(object);
        if let Some(id) = id
            && self.drafts.ids.insert(id.clone(), index).is_some()
        {
            let shown = values::truncated(&id);
            return Err(element.error(format!("two objects have the id `{shown}`")));
        }
        Ok(index)
    }

    /// Reads a child element: a directive, a reference, an object or a value.
    fn child(
        &mut self,
        child: &Element,
        object: &mut Draft,
        depth: usize,
    ) -> Result<(), SceneError> {
        let name = values::snake_case(&self.attribute(child, "name")?.unwrap_or_default());
        match child.node.tag_name().name() {
            "default" => {
                let (name, value) = (
                    self.required(child, "name")?,
                    self.required(child, "value")?,
                );
                self.longest_name = self.longest_name.max(name.len());
                self.named.get_mut().insert(name.clone());
                self.variables.entry(name).or_insert(value);
            }
            "include" => {
                let file = self.required(child, "filename")?;
                let included = self.file(&find_file(&self.folders, &child.file, &file))?;
                let inside = &mut self.drafts.objects[included].properties;
                object.properties.append(inside);
            }
            "alias" => {
                let of = self.reference(child)?;
                let alias = self.required(child, "as")?;
                self.drafts.aliases.insert(alias, of);
            }
            "ref" => {
                let target = DraftProperty::Reference(self.reference(child)?);
                object.properties.push((name, target));
            }
            "path" => self.search_path(child)?,
            class if CLASSES.contains(&class) => {
                let inner = self.object(child, depth + 1)?;
                object.properties.push((name, DraftProperty::Object(inner)));
            }
            // A spectrum that is no spectrum but an image, for example.
            "spectrum" if self.is_texture(child)? => {
                let inner = self.object(child, depth + 1)?;
                self.drafts.objects[inner].class = "texture".to_owned();
                object.properties.push((name, DraftProperty::Object(inner)));
            }
            _ => {
                let value = self.value(child, object.class == "emitter")?;
                object.properties.push((name, DraftProperty::Value(value)));
            }
        }
        Ok(())
    }

    /// Reads a reference to an object.
    fn reference(&self, element: &Element) -> Result<Reference, SceneError> {
        Ok(Reference {
            id: self.required(element, "id")?,
            file: element.file.clone(),
            line: element.line(),
        })
    }

    /// Adds a folder in which files are searched before all others.
    fn search_path(&mut self, element: &Element) -> Result<(), SceneError> {
        let value = self.required(element, "value")?;
        let own = element.file.parent().unwrap_or(Path::new(""));
        let folder = own.join(value.replace('\\', "/"));
        if self.folders.len() >= MAX_FOLDERS {
            return Err(element.error(format!("more than {MAX_FOLDERS} folders are searched")));
        }
        self.folders.insert(0, folder);
        Ok(())
    }

    /// Reads an element as the value of a property. `emits` is set inside of emitters.
    fn value(&mut self, element: &Element, emits: bool) -> Result<PropertyValue, SceneError> {
        let fail = |problem: String| element.error(problem);
        let value = |reader: &Self| reader.required(element, "value");
        Ok(match element.node.tag_name().name() {
            "float" | "integer" => {
                PropertyValue::Number(values::number(&value(self)?).map_err(fail)?)
            }
            "boolean" => {
                let word = value(self)?;
                match word.trim().to_ascii_lowercase().as_str() {
                    "true" => PropertyValue::Flag(true),
                    "false" => PropertyValue::Flag(false),
                    other => {
                        let shown = values::truncated(other);
                        return Err(fail(format!("expected true or false, found `{shown}`")));
                    }
                }
            }
            "string" => PropertyValue::Text(value(self)?),
            "rgb" => PropertyValue::Color(values::color(&value(self)?).map_err(fail)?),
            "srgb" => PropertyValue::Color(values::srgb_color(&value(self)?).map_err(fail)?),
            "spectrum" | "blackbody" => {
                let spectrum = match self.spectrum(element)? {
                    // Version 0.6 takes D65 for a single value in an emitter.
                    Spectrum::Constant(x) if self.legacy => Spectrum::Grey(x),
                    other => other,
                };
                PropertyValue::Color(spectrum.color(emits).map_err(fail)?)
            }
            "point" | "vector" => PropertyValue::Vector(self.vector(element, DVec3::ZERO)?),
            "transform" => {
                let mut map = DAffine3::IDENTITY;
                for child in element.node.children().filter(Node::is_element) {
                    map = self.transform_step(&element.with_node(child))? * map;
                }
                if !map.is_finite() {
                    return Err(fail("the transform must be finite".to_owned()));
                }
                PropertyValue::Map(map)
            }
            other => {
                return Err(fail(format!(
                    "`{}` is not an element of Mitsuba scenes",
                    values::truncated(other)
                )));
            }
        })
    }

    /// Returns whether an element named `spectrum` has the plugin of a texture.
    fn is_texture(&self, element: &Element) -> Result<bool, SceneError> {
        let plugin = self.attribute(element, "type")?;
        Ok(plugin.is_some_and(|plugin| TEXTURES.contains(&plugin.as_str())))
    }

    /// Reads a spectrum: its `value`, a file, or a plugin.
    fn spectrum(&self, element: &Element) -> Result<Spectrum, SceneError> {
        let fail = |problem: String| element.error(problem);
        if element.node.tag_name().name() == "blackbody" {
            return self.black_body(element);
        }
        if let Some(file) = self.attribute(element, "filename")? {
            let path = find_file(&self.folders, &element.file, &file);
            let read = Sampled::read(&path)?;
            return read.map(Spectrum::Sampled).ok_or_else(|| {
                let shown = path.display();
                fail(format!("{shown}: expected pairs of wavelength and value"))
            });
        }
        let Some(plugin) = self.attribute(element, "type")? else {
            return values::spectrum(&self.required(element, "value")?).map_err(fail);
        };
        let number = |key: &str, default: Option<f64>| -> Result<f64, SceneError> {
            match (self.parameter(element, key)?, default) {
                (Some(text), _) => values::number(&text).map_err(fail),
                (None, Some(default)) => Ok(default),
                (None, None) => Err(fail(format!("the spectrum `{plugin}` needs `{key}`"))),
            }
        };
        let list = |key: &str| -> Result<Vec<f64>, SceneError> {
            let text = self.parameter(element, key)?.unwrap_or_default();
            values::numbers(&text).map_err(fail)
        };
        let sampled = |wavelengths: Vec<f64>, values: Vec<f64>| {
            let grow = wavelengths.windows(2).all(|pair| pair[0] < pair[1]);
            let in_range = wavelengths.iter().all(|nm| (1.0..1e6).contains(nm));
            if values.len() < 2 || wavelengths.len() != values.len() || !grow || !in_range {
                let problem =
                    "a spectrum needs at least two values, and as many wavelengths that grow";
                return Err(fail(problem.to_owned()));
            }
            let pairs = wavelengths.into_iter().zip(values).map(|(nm, x)| [nm, x]);
            Ok(Spectrum::Sampled(Sampled::new(pairs.collect())))
        };
        match plugin.as_str() {
            "d65" => {
                let scale = number("scale", Some(1.0))?;
                match self.parameter(element, "color")? {
                    None => Ok(Spectrum::Grey(scale)),
                    Some(text) => {
                        let color = values::color(&text).map_err(fail)?;
                        Ok(Spectrum::Color(color * scale as f32))
                    }
                }
            }
            "blackbody" => {
                let kelvin = number("temperature", None)?;
                Ok(Spectrum::BlackBody([
                    checked_kelvin(element, kelvin)?,
                    number("scale", Some(1.0))?,
                ]))
            }
            "srgb" => {
                let text = self.parameter(element, "color")?.unwrap_or_default();
                values::color(&text).map(Spectrum::Color).map_err(fail)
            }
            "irregular" => sampled(list("wavelengths")?, list("values")?),
            "regular" => {
                let values = list("values")?;
                let ends = [
                    number("wavelength_min", None)?,
                    number("wavelength_max", None)?,
                ];
                let step = (ends[1] - ends[0]) / values.len().saturating_sub(1).max(1) as f64;
                let wavelengths = (0..values.len()).map(|i| ends[0] + i as f64 * step);
                sampled(wavelengths.collect(), values)
            }
            "uniform" => Ok(Spectrum::Grey(number("value", Some(1.0))?)),
            other => {
                let shown = values::truncated(other);
                Err(fail(format!(
                    "the spectrum `{shown}` is not supported; expected a `value`, a `filename`, \
                     `uniform`, `d65`, `blackbody`, `srgb`, `regular`, `irregular` or a texture"
                )))
            }
        }
    }

    /// Returns the `value` of the child of a spectrum with a name.
    fn parameter(&self, element: &Element, key: &str) -> Result<Option<String>, SceneError> {
        let mut children = element.node.children().filter(Node::is_element);
        let child = children.find(|child| child.attribute("name") == Some(key));
        child
            .map(|child| self.required(&element.with_node(child), "value"))
            .transpose()
    }

    /// Reads the `blackbody` of version 0.6: a `temperature` in kelvin, and a factor `scale`.
    fn black_body(&self, element: &Element) -> Result<Spectrum, SceneError> {
        let fail = |problem: String| element.error(problem);
        let text = self.required(element, "temperature")?;
        let kelvin = values::number(text.trim().trim_end_matches(['K', 'k'])).map_err(fail)?;
        let kelvin = checked_kelvin(element, kelvin)?;
        let scale = match self.attribute(element, "scale")? {
            Some(scale) => values::number(&scale).map_err(fail)?,
            None => 1.0,
        };
        Ok(Spectrum::BlackBody([kelvin, scale]))
    }

    /// Returns a rotation. By an angle of 0 it needs no axis.
    fn rotation(&mut self, element: &Element) -> Result<DAffine3, SceneError> {
        let fail = |problem: String| element.error(problem);
        let axis = self.vector(element, DVec3::ZERO)?;
        let degrees = values::number(&self.required(element, "angle")?).map_err(fail)?;
        if degrees == 0.0 {
            return Ok(DAffine3::IDENTITY);
        }
        if (axis.length() - 1.0).abs() > 1e-4 {
            self.notes.push(Note::new(
                element.file.to_path_buf(),
                format!("line {}", element.line()),
                "Mitsuba shears by an axis of rotation that is no unit vector, which is \
                          not supported; the axis is normalised",
            ));
        }
        let axis = axis
            .try_normalize()
            .ok_or_else(|| fail("a rotation needs an axis".to_owned()))?;
        Ok(DAffine3::from_axis_angle(axis, degrees.to_radians()))
    }

    /// Returns one step of a transform.
    fn transform_step(&mut self, element: &Element) -> Result<DAffine3, SceneError> {
        let fail = |problem: String| element.error(problem);
        // Version 0.6 accepts `lookAt` and `lookat`.
        Ok(
            match values::snake_case(element.node.tag_name().name()).as_str() {
                "translate" => DAffine3::from_translation(self.vector(element, DVec3::ZERO)?),
                "scale" => DAffine3::from_scale(self.vector(element, DVec3::ONE)?),
                "rotate" => self.rotation(element)?,
                "matrix" => values::matrix(&self.required(element, "value")?).map_err(fail)?,
                "lookat" | "look_at" => {
                    let read =
                        |name: &str| values::vector(&self.required(element, name)?).map_err(fail);
                    let up = if element.node.attribute("up").is_some() {
                        read("up")?
                    } else {
                        DVec3::Y
                    };
                    values::look_at(read("origin")?, read("target")?, up).map_err(fail)?
                }
                other => {
                    return Err(fail(format!(
                        "`{}` is not a step of a transform",
                        values::truncated(other)
                    )));
                }
            },
        )
    }

    /// Reads a vector from `value`, or from `x`, `y` and `z`.
    fn vector(&self, element: &Element, default: DVec3) -> Result<DVec3, SceneError> {
        let fail = |problem: String| element.error(problem);
        if let Some(all) = self.attribute(element, "value")? {
            return values::vector(&all).map_err(fail);
        }
        let mut v = default;
        for (i, axis) in ["x", "y", "z"].into_iter().enumerate() {
            if let Some(text) = self.attribute(element, axis)? {
                v[i] = values::number(&text).map_err(fail)?;
            }
        }
        Ok(v)
    }

    /// Checks that the files name all variables for which values are given.
    fn check_named(&self, path: &Path, given: &Variables) -> Result<(), SceneError> {
        let named = self.named.borrow();
        let Some(unknown) = given.keys().find(|name| !named.contains(*name)) else {
            return Ok(());
        };
        let known = named.iter().map(|name| values::truncated(name));
        let known: Vec<String> = known.take(MAX_LISTED).collect();
        let error = unknown_name(
            "scene_options",
            &values::truncated(unknown),
            "option",
            known.iter().map(String::as_str),
        );
        Err(SceneError::malformed(
            path,
            error.path,
            format!("{}: {}", error.problem, error.help.unwrap_or_default()),
        ))
    }

    /// Returns an attribute that must be present.
    fn required(&self, element: &Element, name: &str) -> Result<String, SceneError> {
        self.attribute(element, name)?
            .ok_or_else(|| element.error(format!("expected the attribute `{name}`")))
    }

    /// Returns an attribute with its `$variables` replaced; the longest matching name is used.
    fn attribute(&self, element: &Element, name: &str) -> Result<Option<String>, SceneError> {
        let Some(raw) = element.node.attribute(name) else {
            return Ok(None);
        };
        if !raw.contains('$') {
            return Ok(Some(raw.to_owned()));
        }
        let mut out = String::new();
        let mut rest = raw;
        while let Some(at) = rest.find('$') {
            out.push_str(&rest[..at]);
            rest = &rest[at + 1..];
            let mut prefixes = (0..=rest.len().min(self.longest_name))
                .rev()
                .filter_map(|n| rest.get(..n));
            let Some((name, value)) =
                prefixes.find_map(|name| Some((name, self.variables.get(name)?)))
            else {
                return Err(element.error(format!(
                    "no `default` defines `${}`: set the scene option of this name, or add \
                     `<default name=\"NAME\" value=\"..\"/>` before this line",
                    values::truncated(rest)
                )));
            };
            self.named.borrow_mut().insert(name.to_owned());
            out.push_str(value);
            if out.len() > raw.len() + MAX_GROWTH {
                return Err(element.error(format!(
                    "variables lengthen the attribute by more than {MAX_GROWTH} bytes"
                )));
            }
            rest = &rest[name.len()..];
        }
        out.push_str(rest);
        Ok(Some(out))
    }
}

/// Checks the temperature of a black body.
fn checked_kelvin(element: &Element, kelvin: f64) -> Result<f64, SceneError> {
    if KELVIN.contains(&kelvin) {
        return Ok(kelvin);
    }
    Err(element.error(format!(
        "a temperature is {} to {:e} kelvin, found {kelvin}",
        KELVIN.start(),
        KELVIN.end()
    )))
}

/// Replaces the hyphens inside of comments, two of which XML forbids and Mitsuba reads. Every byte
/// keeps its place.
fn with_plain_comments(text: &str) -> Cow<'_, str> {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, comment)) = rest.split_once("<!--") {
        let (inside, after) = comment.split_once("-->").unwrap_or((comment, ""));
        let ended = before.len() + 4 + inside.len();
        plain += &rest[..before.len() + 4];
        plain += &inside.replace('-', " ");
        let end = rest.len() - after.len();
        plain += &rest[ended..end];
        rest = after;
    }
    if plain.is_empty() {
        return Cow::Borrowed(text);
    }
    Cow::Owned(plain + rest)
}

/// Returns the offsets of the line ends in a text, in bytes.
fn line_ends(text: &str) -> Vec<usize> {
    let bytes = text.bytes().enumerate();
    bytes.filter(|(_, b)| *b == b'\n').map(|(i, _)| i).collect()
}

/// Returns the greatest nesting depth of elements, estimated from angle brackets.
fn nesting(text: &str) -> usize {
    let (mut depth, mut greatest) = (0usize, 0usize);
    for tag in text.split('<').skip(1) {
        if tag.starts_with('/') {
            depth = depth.saturating_sub(1);
        } else if !tag.starts_with(['!', '?'])
            && !tag.split('>').next().is_some_and(|t| t.ends_with('/'))
        {
            depth += 1;
            greatest = greatest.max(depth);
        }
    }
    greatest
}
