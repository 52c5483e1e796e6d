//! The XML of Mitsuba as objects with properties: defaults, includes, aliases and references resolved, old spellings
//! made new.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::{DAffine3, Vec3};
use roxmltree::Node;

use super::values;
use crate::scene::load::{place, read};
use crate::scene::{Note, SceneError};

/// Greatest size of a scene file in bytes.
const MAX_XML_BYTES: u64 = 64 << 20;
/// How deep objects may lie in one another, and includes in includes.
const MAX_DEPTH: usize = 32;
/// By how many bytes the variables in an attribute may lengthen it.
const MAX_GROWTH: usize = 4096;
/// How often all files that are included may be read on average, beside [`SMALL_READ`] bytes.
const MAX_READ: usize = 16;
/// What may be read whatever the size of the files, in bytes.
const SMALL_READ: usize = 1 << 20;

/// The elements that are objects with a plugin of their own.
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

/// A plain value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Data {
    /// `float` and `integer`.
    Number(f64),
    /// `boolean`.
    Flag(bool),
    /// `string`.
    Text(String),
    /// `rgb` and `spectrum`.
    Color(Vec3),
    /// `point` and `vector`.
    Vector(Vec3),
    /// `transform`.
    Map(DAffine3),
}

/// A property with a value, or an object inside another.
#[derive(Clone, Debug)]
pub(super) enum Item {
    Data(Data),
    Object(Rc<Object>),
}

/// One element with a plugin.
#[derive(Debug)]
pub(super) struct Object {
    /// `bsdf`, `shape` and so on.
    pub class: String,
    /// Its plugin: the attribute `type`.
    pub kind: String,
    /// Its `id`.
    pub id: Option<String>,
    /// Where it is.
    pub file: Rc<Path>,
    /// Line in that file.
    pub line: u32,
    /// By name, in the order of the file; children without a name have an empty one.
    pub items: Vec<(String, Item)>,
    /// Names that were asked for.
    used: RefCell<BTreeSet<String>>,
}

impl Object {
    /// `line N`.
    pub fn place(&self) -> String {
        format!("line {}", self.line)
    }

    /// An error at this object.
    pub fn error(&self, problem: impl Into<String>) -> SceneError {
        SceneError::Malformed { file: self.file.to_path_buf(), place: self.place(), problem: problem.into() }
    }

    /// A note at this object.
    pub fn note(&self, message: impl Into<String>) -> Note {
        Note { file: self.file.to_path_buf(), place: self.place(), message: message.into() }
    }

    /// The item of this name, which counts as read.
    pub fn item(&self, name: &str) -> Option<&Item> {
        self.used.borrow_mut().insert(name.to_owned());
        self.items.iter().find(|(n, _)| n == name).map(|(_, item)| item)
    }

    /// Says that these names are read, or need not be.
    pub fn known(&self, names: &[&str]) {
        self.used.borrow_mut().extend(names.iter().map(|n| (*n).to_owned()));
    }

    fn wrong(&self, name: &str, expected: &str) -> SceneError {
        self.error(format!("`{name}` of the {} `{}`: expected {expected}", self.class, self.kind))
    }

    /// A number, or the default.
    pub fn number(&self, name: &str, default: f64) -> Result<f64, SceneError> {
        match self.item(name) {
            None => Ok(default),
            Some(Item::Data(Data::Number(x))) if x.is_finite() => Ok(*x),
            Some(_) => Err(self.wrong(name, "a finite number")),
        }
    }

    /// A flag, or the default.
    pub fn flag(&self, name: &str, default: bool) -> Result<bool, SceneError> {
        match self.item(name) {
            None => Ok(default),
            Some(Item::Data(Data::Flag(x))) => Ok(*x),
            Some(_) => Err(self.wrong(name, "a boolean")),
        }
    }

    /// A text.
    pub fn text(&self, name: &str) -> Result<Option<&str>, SceneError> {
        match self.item(name) {
            None => Ok(None),
            Some(Item::Data(Data::Text(x))) => Ok(Some(x)),
            Some(_) => Err(self.wrong(name, "a string")),
        }
    }

    /// A colour, or a number for all three channels.
    pub fn color(&self, name: &str) -> Result<Option<Vec3>, SceneError> {
        match self.item(name) {
            None => Ok(None),
            Some(Item::Data(Data::Color(c))) => Ok(Some(*c)),
            Some(Item::Data(Data::Number(x))) => Ok(Some(Vec3::splat(*x as f32))),
            Some(_) => Err(self.wrong(name, "a colour")),
        }
    }

    /// A point or vector.
    pub fn vector(&self, name: &str) -> Result<Option<Vec3>, SceneError> {
        match self.item(name) {
            None => Ok(None),
            Some(Item::Data(Data::Vector(v))) => Ok(Some(*v)),
            Some(_) => Err(self.wrong(name, "a point or vector")),
        }
    }

    /// A transform, or the identity.
    pub fn map(&self, name: &str) -> Result<DAffine3, SceneError> {
        match self.item(name) {
            None => Ok(DAffine3::IDENTITY),
            Some(Item::Data(Data::Map(m))) => Ok(*m),
            Some(_) => Err(self.wrong(name, "a transform")),
        }
    }

    /// The objects of a class inside this one, which count as read.
    pub fn children<'a>(&'a self, class: &'a str) -> impl Iterator<Item = &'a Rc<Object>> + 'a {
        self.items.iter().filter_map(move |(name, item)| match item {
            Item::Object(o) if o.class == class => {
                self.used.borrow_mut().insert(name.clone());
                Some(o)
            }
            _ => None,
        })
    }

    /// Notes for what nobody asked for, here and below.
    pub fn note_unread(&self, notes: &mut Vec<Note>, seen: &mut BTreeSet<*const Object>) {
        for (name, item) in &self.items {
            match item {
                Item::Object(o) if self.used.borrow().contains(name) => {
                    if seen.insert(Rc::as_ptr(o)) {
                        o.note_unread(notes, seen);
                    }
                }
                Item::Object(o) => {
                    notes.push(o.note(format!("the {} `{}` has no meaning here: ignored", o.class, o.kind)))
                }
                Item::Data(_) if !self.used.borrow().contains(name) => {
                    notes.push(
                        self.note(format!("`{name}` of the {} `{}` is not read: ignored", self.class, self.kind)),
                    );
                }
                Item::Data(_) => {}
            }
        }
    }
}

/// Reads a file and everything that it includes; with the bytes of these files.
pub(super) fn scene(path: &Path, notes: &mut Vec<Note>) -> Result<(Rc<Object>, usize), SceneError> {
    let mut reader = Reader {
        ids: BTreeMap::new(),
        defaults: BTreeMap::new(),
        longest: 0,
        files: Vec::new(),
        sizes: BTreeMap::new(),
        read: 0,
        notes,
    };
    let root = reader.file(path)?;
    Ok((root, reader.sizes.values().sum()))
}

struct Reader<'n> {
    ids: BTreeMap<String, Rc<Object>>,
    defaults: BTreeMap<String, String>,
    /// Length of the longest name of a default.
    longest: usize,
    /// Files that are being read, by which a cycle of includes is known.
    files: Vec<PathBuf>,
    /// Bytes of every file that was read.
    sizes: BTreeMap<PathBuf, usize>,
    /// Bytes that were read in all.
    read: usize,
    notes: &'n mut Vec<Note>,
}

/// An element with what is needed to say where it is.
struct Here<'a, 'i> {
    node: Node<'a, 'i>,
    file: Rc<Path>,
    /// Where the lines of the file end, in bytes.
    ends: &'a [usize],
}

impl Here<'_, '_> {
    fn line(&self) -> u32 {
        self.ends.partition_point(|end| *end < self.node.range().start) as u32 + 1
    }

    /// The same for an element of the same file.
    fn of<'b>(&self, node: Node<'b, 'b>) -> Here<'b, 'b>
    where
        Self: 'b,
    {
        Here { node, file: self.file.clone(), ends: self.ends }
    }

    fn error(&self, problem: impl Into<String>) -> SceneError {
        let place = format!("line {}, <{}>", self.line(), self.node.tag_name().name());
        SceneError::Malformed { file: self.file.to_path_buf(), place, problem: problem.into() }
    }
}

impl Reader<'_> {
    fn file(&mut self, path: &Path) -> Result<Rc<Object>, SceneError> {
        let malformed =
            |place: String, problem: String| SceneError::Malformed { file: path.to_owned(), place, problem };
        let place = place(path);
        if self.files.len() >= MAX_DEPTH || self.files.contains(&place) {
            return Err(malformed(
                "include".to_owned(),
                "files include one another in a circle, or too deep".to_owned(),
            ));
        }
        let bytes = read(path, MAX_XML_BYTES)?;
        self.sizes.insert(place.clone(), bytes.len());
        self.read += bytes.len();
        if self.read > SMALL_READ + MAX_READ * self.sizes.values().sum::<usize>() {
            let problem = "files include one another too often: what they say grows far beyond their size";
            return Err(malformed("include".to_owned(), problem.to_owned()));
        }
        let text = std::str::from_utf8(&bytes)
            .map_err(|e| malformed(format!("byte {}", e.valid_up_to()), "it is no UTF-8 text".to_owned()))?;
        if nesting(text) > MAX_DEPTH * 4 {
            return Err(malformed("whole file".to_owned(), "elements lie too deep in one another".to_owned()));
        }
        // Document types, and with them entities that grow, are refused by this parser.
        let options =
            roxmltree::ParsingOptions { nodes_limit: (bytes.len() as u32).saturating_add(16), ..Default::default() };
        let document = roxmltree::Document::parse_with_options(text, options).map_err(|e| {
            malformed(format!("line {}, column {}", e.pos().row, e.pos().col), format!("no valid XML: {e}"))
        })?;
        self.files.push(place);
        let ends: Vec<usize> = text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i).collect();
        let here = Here { node: document.root_element(), file: Rc::from(path), ends: &ends };
        let root = self.object(&here, 0);
        self.files.pop();
        root
    }

    fn object(&mut self, here: &Here, depth: usize) -> Result<Rc<Object>, SceneError> {
        if depth > MAX_DEPTH {
            return Err(here.error(format!("objects lie more than {MAX_DEPTH} deep in one another")));
        }
        let node = here.node;
        let id = self.attribute(here, "id")?;
        let mut object = Object {
            class: node.tag_name().name().to_owned(),
            kind: self.attribute(here, "type")?.unwrap_or_default(),
            id: id.clone(),
            file: here.file.clone(),
            line: here.line(),
            items: Vec::new(),
            used: RefCell::default(),
        };
        for child in node.children().filter(Node::is_element) {
            let child = here.of(child);
            let tag = child.node.tag_name().name();
            let name = values::snake_case(&self.attribute(&child, "name")?.unwrap_or_default());
            match tag {
                "default" => {
                    let (name, value) = (self.required(&child, "name")?, self.required(&child, "value")?);
                    self.longest = self.longest.max(name.len());
                    self.defaults.entry(name).or_insert(value);
                }
                "include" => {
                    let file = self.required(&child, "filename")?;
                    let included =
                        self.file(&here.file.parent().unwrap_or(Path::new("")).join(file.replace('\\', "/")))?;
                    object.items.extend(included.items.iter().cloned());
                }
                "alias" => {
                    let (id, new) = (self.required(&child, "id")?, self.required(&child, "as")?);
                    let Some(target) = self.ids.get(&id).cloned() else {
                        return Err(child.error(format!("nothing before it has the id `{id}`")));
                    };
                    self.ids.insert(new, target);
                }
                "ref" => {
                    let id = self.required(&child, "id")?;
                    let Some(target) = self.ids.get(&id).cloned() else {
                        return Err(child.error(format!("nothing before it has the id `{id}`")));
                    };
                    object.items.push((name, Item::Object(target)));
                }
                "path" => self.notes.push(Note {
                    file: here.file.to_path_buf(),
                    place: format!("line {}", child.line()),
                    message: "files are looked for beside the scene only: `path` is ignored".to_owned(),
                }),
                class if CLASSES.contains(&class) => {
                    let inner = self.object(&child, depth + 1)?;
                    object.items.push((name, Item::Object(inner)));
                }
                _ => {
                    let data = self.data(&child)?;
                    object.items.push((name, Item::Data(data)));
                }
            }
        }
        let object = Rc::new(object);
        if let Some(id) = id
            && self.ids.insert(id.clone(), object.clone()).is_some()
        {
            return Err(here.error(format!("two objects have the id `{id}`")));
        }
        Ok(object)
    }

    fn data(&mut self, here: &Here) -> Result<Data, SceneError> {
        let fail = |problem: String| here.error(problem);
        let value = |reader: &Self| reader.required(here, "value");
        Ok(match here.node.tag_name().name() {
            "float" | "integer" => Data::Number(values::number(&value(self)?).map_err(fail)?),
            "boolean" => match value(self)?.trim() {
                "true" => Data::Flag(true),
                "false" => Data::Flag(false),
                other => return Err(fail(format!("expected true or false, found `{}`", values::shorten(other)))),
            },
            "string" => Data::Text(value(self)?),
            "rgb" | "srgb" | "spectrum" => {
                let (color, note) = values::color(&value(self)?).map_err(fail)?;
                if let Some(message) = note {
                    let place = format!("line {}", here.line());
                    self.notes.push(Note { file: here.file.to_path_buf(), place, message: message.to_owned() });
                }
                Data::Color(color)
            }
            "point" | "vector" => Data::Vector(self.vector(here, Vec3::ZERO)?),
            "transform" => {
                let mut map = DAffine3::IDENTITY;
                for child in here.node.children().filter(Node::is_element) {
                    map = self.step(&here.of(child))? * map;
                }
                if !map.is_finite() {
                    return Err(fail("its numbers must be finite".to_owned()));
                }
                Data::Map(map)
            }
            other => return Err(fail(format!("`{}` is no element that Mitsuba scenes have", values::shorten(other)))),
        })
    }

    /// One step of a transform.
    fn step(&self, here: &Here) -> Result<DAffine3, SceneError> {
        let fail = |problem: String| here.error(problem);
        Ok(match here.node.tag_name().name() {
            "translate" => DAffine3::from_translation(self.vector(here, Vec3::ZERO)?.as_dvec3()),
            "scale" => DAffine3::from_scale(self.vector(here, Vec3::ONE)?.as_dvec3()),
            "rotate" => {
                let axis = self.vector(here, Vec3::ZERO)?.as_dvec3().try_normalize();
                let axis = axis.ok_or_else(|| fail("a rotation needs an axis".to_owned()))?;
                let degrees = values::number(&self.required(here, "angle")?).map_err(fail)?;
                DAffine3::from_axis_angle(axis, degrees.to_radians())
            }
            "matrix" => values::matrix(&self.required(here, "value")?).map_err(fail)?,
            "lookat" | "look_at" => {
                let read = |name: &str| values::triple(&self.required(here, name)?).map_err(fail);
                let up = if here.node.attribute("up").is_some() { read("up")? } else { Vec3::Y };
                values::look_at(read("origin")?, read("target")?, up).map_err(fail)?
            }
            other => return Err(fail(format!("`{}` is no step of a transform", values::shorten(other)))),
        })
    }

    /// From `value`, or from `x`, `y` and `z`.
    fn vector(&self, here: &Here, default: Vec3) -> Result<Vec3, SceneError> {
        let fail = |problem: String| here.error(problem);
        if let Some(all) = self.attribute(here, "value")? {
            return values::triple(&all).map_err(fail);
        }
        let mut v = default;
        for (i, axis) in ["x", "y", "z"].into_iter().enumerate() {
            if let Some(text) = self.attribute(here, axis)? {
                v[i] = values::number(&text).map_err(fail)? as f32;
            }
        }
        Ok(v)
    }

    fn required(&self, here: &Here, name: &str) -> Result<String, SceneError> {
        self.attribute(here, name)?.ok_or_else(|| here.error(format!("expected the attribute `{name}`")))
    }

    /// An attribute with its `$variables` replaced, the longest name first.
    fn attribute(&self, here: &Here, name: &str) -> Result<Option<String>, SceneError> {
        let Some(raw) = here.node.attribute(name) else { return Ok(None) };
        if !raw.contains('$') {
            return Ok(Some(raw.to_owned()));
        }
        let mut out = String::new();
        let mut rest = raw;
        while let Some(at) = rest.find('$') {
            out.push_str(&rest[..at]);
            rest = &rest[at + 1..];
            let mut fits = (0..=rest.len().min(self.longest)).rev().filter_map(|n| rest.get(..n));
            let Some((name, value)) = fits.find_map(|name| Some((name, self.defaults.get(name)?))) else {
                return Err(here.error(format!("no `default` says what `${}` is", values::shorten(rest))));
            };
            out.push_str(value);
            if out.len() > raw.len() + MAX_GROWTH {
                return Err(here.error(format!("its variables make it more than {MAX_GROWTH} bytes longer")));
            }
            rest = &rest[name.len()..];
        }
        out.push_str(rest);
        Ok(Some(out))
    }
}

/// How deep the elements of a text lie in one another at most, told from its angle brackets.
fn nesting(text: &str) -> usize {
    let (mut depth, mut most) = (0usize, 0usize);
    for tag in text.split('<').skip(1) {
        if tag.starts_with('/') {
            depth = depth.saturating_sub(1);
        } else if !tag.starts_with(['!', '?']) && !tag.split('>').next().is_some_and(|t| t.ends_with('/')) {
            depth += 1;
            most = most.max(depth);
        }
    }
    most
}
