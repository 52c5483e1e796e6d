//! References between objects: a file may refer to objects that follow, and to aliases.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::{Property, PropertyValue, XmlObject};
use lumbre_light::scene::SceneError;

/// Greatest depth of objects inside one another, references counted like what they refer to.
pub(super) const MAX_DEPTH: usize = 32;

/// An object as it was read, with references to others by id.
#[derive(Debug)]
pub(super) struct Draft {
    pub class: String,
    pub plugin: String,
    pub id: Option<String>,
    pub file: Rc<Path>,
    pub line: u32,
    pub legacy: bool,
    pub properties: Vec<(String, DraftProperty)>,
}

/// A property of a [`Draft`].
#[derive(Debug)]
pub(super) enum DraftProperty {
    Value(PropertyValue),
    /// Index of a draft.
    Object(usize),
    Reference(Reference),
}

/// A reference to an object.
#[derive(Clone, Debug)]
pub(super) struct Reference {
    pub id: String,
    pub file: Rc<Path>,
    pub line: u32,
}

impl Reference {
    /// Creates an error about the reference.
    fn error(&self, problem: String) -> SceneError {
        SceneError::malformed(
            self.file.to_path_buf(),
            format!("line {}", self.line),
            problem,
        )
    }
}

/// All objects that were read.
#[derive(Debug, Default)]
pub(super) struct Drafts {
    pub objects: Vec<Draft>,
    /// Index of the object with each id.
    pub ids: BTreeMap<String, usize>,
    /// The object that each further name stands for.
    pub aliases: BTreeMap<String, Reference>,
}

/// State of an object while references are followed.
#[derive(Clone, Debug)]
enum State {
    Unread,
    Started,
    Complete(Rc<XmlObject>),
}

impl Drafts {
    /// Returns an object with everything that it refers to. `folders` are searched for its files.
    pub fn object(self, root: usize, folders: Vec<PathBuf>) -> Result<Rc<XmlObject>, SceneError> {
        let resolver = Resolver {
            states: RefCell::new(vec![State::Unread; self.objects.len()]),
            drafts: self,
            folders: folders.into(),
        };
        resolver.object(root, 0)
    }
}

/// Follows the references between objects.
struct Resolver {
    drafts: Drafts,
    states: RefCell<Vec<State>>,
    folders: Rc<[PathBuf]>,
}

impl Resolver {
    /// Returns the complete object with an index.
    fn object(&self, index: usize, depth: usize) -> Result<Rc<XmlObject>, SceneError> {
        let state = std::mem::replace(&mut self.states.borrow_mut()[index], State::Started);
        let draft = &self.drafts.objects[index];
        let error = |problem: String| {
            SceneError::malformed(
                draft.file.to_path_buf(),
                format!("line {}", draft.line),
                problem,
            )
        };
        match state {
            State::Unread => {}
            State::Started => {
                return Err(error(format!("the {} refers to itself", draft.class)));
            }
            State::Complete(object) => {
                self.states.borrow_mut()[index] = State::Complete(object.clone());
                return Ok(object);
            }
        }
        if depth > MAX_DEPTH {
            return Err(error(format!(
                "objects are nested more than {MAX_DEPTH} levels deep"
            )));
        }
        let mut properties = Vec::with_capacity(draft.properties.len());
        for (name, item) in &draft.properties {
            let item = match item {
                DraftProperty::Value(value) => Property::Value(value.clone()),
                DraftProperty::Object(inner) => Property::Object(self.object(*inner, depth + 1)?),
                DraftProperty::Reference(to) => {
                    Property::Object(self.object(self.target(to)?, depth + 1)?)
                }
            };
            properties.push((name.clone(), item));
        }
        let object = Rc::new(XmlObject {
            class: draft.class.clone(),
            plugin: draft.plugin.clone(),
            id: draft.id.clone(),
            file: draft.file.clone(),
            line: draft.line,
            legacy: draft.legacy,
            folders: self.folders.clone(),
            properties,
            used: RefCell::default(),
        });
        self.states.borrow_mut()[index] = State::Complete(object.clone());
        Ok(object)
    }

    /// Returns the index of the object of a reference.
    fn target(&self, reference: &Reference) -> Result<usize, SceneError> {
        let mut id = &reference.id;
        for _ in 0..MAX_DEPTH {
            if let Some(index) = self.drafts.ids.get(id) {
                return Ok(*index);
            }
            match self.drafts.aliases.get(id) {
                Some(of) => id = &of.id,
                None => break,
            }
        }
        Err(reference.error(format!(
            "no object has the id `{}`",
            super::super::values::truncated(id)
        )))
    }
}
