//! The XML of Mitsuba as objects with properties: defaults, includes, aliases and references are
//! resolved, and old spellings converted.

mod reader;
mod references;

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::{DAffine3, DVec3, Vec3};

pub(super) use self::reader::scene;

use crate::load::beside::{beside, written};
use crate::load::files;
use lumbre_light::scene::{Note, SceneError};

/// The value of a property.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum PropertyValue {
    /// A `float` or `integer` element.
    Number(f64),
    /// A `boolean` element.
    Flag(bool),
    /// A `string` element.
    Text(String),
    /// An `rgb` or `spectrum` element, in linear sRGB.
    Color(Vec3),
    /// A `point` or `vector` element.
    Vector(DVec3),
    /// A `transform` element.
    Map(DAffine3),
}

/// A property of an object: a value, or another object.
#[derive(Clone, Debug)]
pub(super) enum Property {
    Value(PropertyValue),
    Object(Rc<XmlObject>),
}

/// An element with a plugin.
#[derive(Debug)]
pub(super) struct XmlObject {
    /// Name of the element: `bsdf`, `shape` and so on.
    pub class: String,
    /// Name of the plugin: the attribute `type`.
    pub plugin: String,
    /// The attribute `id`.
    pub id: Option<String>,
    /// File that contains the element.
    pub file: Rc<Path>,
    /// Line in the file.
    pub line: u32,
    /// Whether the file is of version 0.6 or older.
    pub legacy: bool,
    /// Folders in which files are searched, in order.
    folders: Rc<[PathBuf]>,
    /// Properties by name, in the order of the file; objects without a name have an empty one.
    pub properties: Vec<(String, Property)>,
    /// Names of the properties that were read.
    used: RefCell<BTreeSet<String>>,
}

/// Returns the path of a file that another file names: in the first of the folders that has it, else
/// beside that file.
fn find_file(folders: &[PathBuf], named_in: &Path, file: &str) -> PathBuf {
    let mut found = folders.iter().map(|folder| written(folder, file));
    found
        .find(|path| files::exists(path))
        .unwrap_or_else(|| beside(named_in.parent().unwrap_or(Path::new("")), file))
}

impl XmlObject {
    /// Returns the path of a file that this object names.
    pub fn find_file(&self, file: &str) -> PathBuf {
        find_file(&self.folders, &self.file, file)
    }

    /// Returns the place for messages: `line N`.
    pub fn place(&self) -> String {
        format!("line {}", self.line)
    }

    /// Creates an error about this object.
    pub fn error(&self, problem: impl Into<String>) -> SceneError {
        SceneError::malformed(self.file.to_path_buf(), self.place(), problem)
    }

    /// Creates a note about this object.
    pub fn note(&self, message: impl Into<String>) -> Note {
        Note::new(self.file.to_path_buf(), self.place(), message)
    }

    /// Returns the property with this name and marks it as read.
    pub fn property(&self, name: &str) -> Option<&Property> {
        self.used.borrow_mut().insert(name.to_owned());
        self.properties
            .iter()
            .find(|(n, _)| n == name)
            .map(|(_, item)| item)
    }

    /// Marks properties as read that need no note.
    pub fn mark_read(&self, names: &[&str]) {
        self.used
            .borrow_mut()
            .extend(names.iter().map(|n| (*n).to_owned()));
    }

    /// Marks all properties as read.
    pub fn mark_all_read(&self) {
        let names: Vec<&str> = self
            .properties
            .iter()
            .map(|(name, _)| name.as_str())
            .collect();
        self.mark_read(&names);
    }

    /// Creates an error about a property of the wrong type.
    fn type_error(&self, name: &str, expected: &str) -> SceneError {
        self.error(format!(
            "`{name}` of the {} `{}`: expected {expected}",
            self.class, self.plugin
        ))
    }

    /// Returns a number, or the default.
    pub fn number(&self, name: &str, default: f64) -> Result<f64, SceneError> {
        match self.property(name) {
            None => Ok(default),
            Some(Property::Value(PropertyValue::Number(x))) if x.is_finite() => Ok(*x),
            Some(_) => Err(self.type_error(name, "a finite number")),
        }
    }

    /// Returns a boolean, or the default.
    pub fn flag(&self, name: &str, default: bool) -> Result<bool, SceneError> {
        match self.property(name) {
            None => Ok(default),
            Some(Property::Value(PropertyValue::Flag(x))) => Ok(*x),
            Some(_) => Err(self.type_error(name, "a boolean")),
        }
    }

    /// Returns the numbers of a text, between commas or white space.
    ///
    /// # Errors
    /// Fails if the property is no text, or a word of it no number.
    pub fn numbers(&self, name: &str) -> Result<Option<Vec<f32>>, SceneError> {
        let Some(text) = self.text(name)? else {
            return Ok(None);
        };
        let words = text.split(|c: char| c == ',' || c.is_whitespace());
        let words = words.filter(|word| !word.is_empty());
        let numbers: Result<Vec<f32>, _> = words.map(str::parse).collect();
        let shown = super::values::truncated(text);
        let expected = || self.error(format!("expected numbers in `{name}`, found `{shown}`"));
        numbers.map(Some).map_err(|_| expected())
    }

    /// Returns a string, if the property is present.
    pub fn text(&self, name: &str) -> Result<Option<&str>, SceneError> {
        match self.property(name) {
            None => Ok(None),
            Some(Property::Value(PropertyValue::Text(x))) => Ok(Some(x)),
            Some(_) => Err(self.type_error(name, "a string")),
        }
    }

    /// Returns a colour, or a number for all three channels, if the property is present.
    pub fn color(&self, name: &str) -> Result<Option<Vec3>, SceneError> {
        match self.property(name) {
            None => Ok(None),
            Some(Property::Value(PropertyValue::Color(c))) => Ok(Some(*c)),
            Some(Property::Value(PropertyValue::Number(x))) => Ok(Some(Vec3::splat(*x as f32))),
            Some(_) => Err(self.type_error(name, "a colour")),
        }
    }

    /// Returns a point or vector, if the property is present.
    pub fn vector(&self, name: &str) -> Result<Option<DVec3>, SceneError> {
        match self.property(name) {
            None => Ok(None),
            Some(Property::Value(PropertyValue::Vector(v))) => Ok(Some(*v)),
            Some(_) => Err(self.type_error(name, "a point or vector")),
        }
    }

    /// Returns a transform, or the identity.
    pub fn transform(&self, name: &str) -> Result<DAffine3, SceneError> {
        match self.property(name) {
            None => Ok(DAffine3::IDENTITY),
            Some(Property::Value(PropertyValue::Map(m))) => Ok(*m),
            Some(_) => Err(self.type_error(name, "a transform")),
        }
    }

    /// Returns the objects of a class inside this one with their names.
    pub fn inside<'a>(
        &'a self,
        class: &'a str,
    ) -> impl Iterator<Item = (&'a str, &'a Rc<XmlObject>)> + 'a {
        self.properties
            .iter()
            .filter_map(move |(name, item)| match item {
                Property::Object(o) if o.class == class => Some((name.as_str(), o)),
                _ => None,
            })
    }

    /// Returns the objects of a class inside this one, and marks them as read.
    pub fn children<'a>(&'a self, class: &'a str) -> impl Iterator<Item = &'a Rc<XmlObject>> + 'a {
        self.inside(class).map(|(name, o)| {
            self.mark_read(&[name]);
            o
        })
    }

    /// Returns whether surfaces belong to faces of a shape by their names, as in version 0.6.
    pub fn names_faces(&self) -> bool {
        self.legacy && self.plugin == "obj" && self.inside("emitter").next().is_none()
    }

    /// Returns the surfaces inside this object, and marks them as read.
    pub fn surfaces(&self) -> Vec<Rc<XmlObject>> {
        self.children("bsdf").cloned().collect()
    }

    /// Notes every property that was not read, here and in the objects inside.
    pub fn note_unused(&self, notes: &mut Vec<Note>, visited: &mut BTreeSet<*const XmlObject>) {
        for (name, item) in &self.properties {
            match item {
                Property::Object(o) if self.used.borrow().contains(name) => {
                    if visited.insert(Rc::as_ptr(o)) {
                        o.note_unused(notes, visited);
                    }
                }
                Property::Object(o) => notes.push(o.note(format!(
                    "the {} `{}` is not supported here; ignored",
                    o.class, o.plugin
                ))),
                Property::Value(_) if !self.used.borrow().contains(name) => {
                    notes.push(self.note(format!(
                        "`{name}` of the {} `{}` is not supported; ignored",
                        self.class, self.plugin
                    )));
                }
                Property::Value(_) => {}
            }
        }
    }
}
