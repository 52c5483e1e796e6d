//! Parameter lists: `"type name" value`, read from the text and asked for by name.

use std::cell::Cell;
use std::rc::Rc;

use glam::DVec3;

use super::token::{Lexer, Place, Token, truncated};
use lumbre_light::scene::{Note, SceneError};

/// Values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    /// Strings, and truth values as `true` and `false`.
    Texts(Vec<String>),
}

/// A parameter of a directive.
#[derive(Debug)]
pub(super) struct Param {
    /// Type: `float`, `rgb`, `spectrum`, `texture` and others.
    pub ty: String,
    /// Name of the parameter.
    pub name: String,
    /// Values in the order of the file.
    pub values: Values,
    /// Place of the parameter.
    pub place: Place,
    /// Whether the loader has asked for it.
    read: Cell<bool>,
}

impl Param {
    /// Returns the numbers, or an error for a parameter of strings.
    pub fn numbers(&self) -> Result<&[f64], SceneError> {
        match &self.values {
            Values::Numbers(x) => Ok(x),
            Values::Texts(_) => Err(self.error("expected numbers")),
        }
    }

    /// Returns the strings, or an error for a parameter of numbers.
    pub fn texts(&self) -> Result<&[String], SceneError> {
        match &self.values {
            Values::Texts(x) => Ok(x),
            Values::Numbers(_) => Err(self.error("expected a string")),
        }
    }

    /// Creates an error about the parameter.
    pub fn error(&self, problem: impl std::fmt::Display) -> SceneError {
        self.place
            .error(format!("`{}`: {problem}", truncated(&self.name)))
    }
}

/// A list of parameters with the directive that they belong to, and the defaults of the attributes
/// around it.
#[derive(Clone, Debug)]
pub(super) struct Params {
    /// Directive and its type, for messages: `Shape "sphere"`.
    pub what: String,
    /// Place of the directive.
    pub place: Place,
    own: Rc<Vec<Param>>,
    defaults: Rc<Vec<Rc<Param>>>,
}

impl Params {
    /// Reads a parameter list up to the next directive.
    pub fn read(lexer: &mut Lexer, what: String, place: Place) -> Result<Params, SceneError> {
        let mut own = Vec::new();
        while let Some(Token::Quoted(_)) = lexer.peek()? {
            let declaration = lexer.quoted("a parameter")?;
            let place = lexer.place();
            let mut words = declaration.split_whitespace();
            let (Some(ty), Some(name), None) = (words.next(), words.next(), words.next()) else {
                return Err(place.error(format!(
                    "expected a parameter `\"type name\"`, found `\"{}\"`",
                    truncated(&declaration)
                )));
            };
            own.push(Param {
                ty: ty.to_owned(),
                name: name.to_owned(),
                values: values(lexer)?,
                place,
                read: Cell::new(false),
            });
        }
        Ok(Params {
            what,
            place,
            own: Rc::new(own),
            defaults: Rc::default(),
        })
    }

    /// Adds the defaults of the attributes around the directive.
    pub fn with_defaults(mut self, defaults: &Rc<Vec<Rc<Param>>>) -> Params {
        self.defaults = defaults.clone();
        self
    }

    /// Returns the parameters of an `Attribute` directive, to be defaults.
    pub fn into_defaults(self) -> Vec<Rc<Param>> {
        Rc::try_unwrap(self.own)
            .unwrap_or_default()
            .into_iter()
            .map(Rc::new)
            .collect()
    }

    /// Returns a parameter.
    pub fn get(&self, name: &str) -> Option<&Param> {
        let own = self.own.iter().find(|p| p.name == name);
        let found = own.or_else(|| {
            let mut later = self.defaults.iter().rev();
            later.find(|p| p.name == name).map(|p| &**p)
        });
        found.inspect(|p| p.read.set(true))
    }

    /// Returns the names of all textures that the parameters refer to.
    pub fn texture_names(&self) -> impl Iterator<Item = &String> {
        let defaults = self.defaults.iter().map(|p| &**p);
        let textures = self
            .own
            .iter()
            .chain(defaults)
            .filter(|p| p.ty == "texture");
        textures.flat_map(|p| match &p.values {
            Values::Texts(names) => names.as_slice(),
            Values::Numbers(_) => &[],
        })
    }

    /// Returns the first of these parameters that is present.
    pub fn any(&self, names: &[&str]) -> Option<&Param> {
        names.iter().find_map(|name| self.get(name))
    }

    /// Returns the numbers of a parameter.
    pub fn numbers(&self, name: &str) -> Result<Option<&[f64]>, SceneError> {
        self.get(name).map(Param::numbers).transpose()
    }

    /// Returns a number.
    pub fn number(&self, name: &str, default: f64) -> Result<f64, SceneError> {
        match self.get(name) {
            None => Ok(default),
            Some(p) => match p.numbers()? {
                [x] => Ok(*x),
                other => Err(p.error(format!("expected one number, found {}", other.len()))),
            },
        }
    }

    /// Returns a whole number in a range.
    pub fn integer(&self, name: &str, default: u32, most: u32) -> Result<u32, SceneError> {
        let x = self.number(name, f64::from(default))?;
        if x.fract() != 0.0 || x < 0.0 || x > f64::from(most) {
            return Err(self.error(format!(
                "`{name}` must be a whole number from 0 to {most}, found {x}"
            )));
        }
        Ok(x as u32)
    }

    /// Returns a truth value.
    pub fn flag(&self, name: &str, default: bool) -> Result<bool, SceneError> {
        match self.get(name) {
            None => Ok(default),
            Some(p) => match p.texts()? {
                [x] if x == "true" => Ok(true),
                [x] if x == "false" => Ok(false),
                _ => Err(p.error("expected true or false")),
            },
        }
    }

    /// Returns a string.
    pub fn text(&self, name: &str) -> Result<Option<&str>, SceneError> {
        match self.get(name) {
            None => Ok(None),
            Some(p) => match p.texts()? {
                [x] => Ok(Some(x)),
                other => Err(p.error(format!("expected one string, found {}", other.len()))),
            },
        }
    }

    /// Returns a point or vector.
    pub fn point(&self, name: &str, default: DVec3) -> Result<DVec3, SceneError> {
        match self.get(name) {
            None => Ok(default),
            Some(p) => match p.numbers()? {
                [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
                other => Err(p.error(format!("expected 3 numbers, found {}", other.len()))),
            },
        }
    }

    /// Marks parameters as read that have no effect on the scene.
    pub fn mark_read(&self, names: &[&str]) {
        for p in self.own.iter().filter(|p| names.contains(&p.name.as_str())) {
            p.read.set(true);
        }
    }

    /// Creates an error about the directive.
    pub fn error(&self, problem: impl std::fmt::Display) -> SceneError {
        self.place.error(format!("{}: {problem}", self.what))
    }

    /// Creates a note about the directive.
    pub fn note(&self, message: impl std::fmt::Display) -> Note {
        self.place.note(format!("{}: {message}", self.what))
    }

    /// Notes the parameters that the loader did not ask for.
    pub fn note_unread(&self, notes: &mut Vec<Note>) {
        for p in self.own.iter().filter(|p| !p.read.replace(true)) {
            notes.push(p.place.note(format!(
                "{}: `{}` is not supported; ignored",
                self.what,
                truncated(&p.name)
            )));
        }
    }
}

/// Reads the values of a parameter: one, or several in brackets.
fn values(lexer: &mut Lexer) -> Result<Values, SceneError> {
    let expected = "numbers or strings";
    match lexer.required(expected)? {
        Token::Number(x) => return Ok(Values::Numbers(vec![x])),
        Token::Quoted(text) => return Ok(Values::Texts(vec![text])),
        Token::Word(word) if is_truth(&word) => return Ok(Values::Texts(vec![word])),
        Token::Open => {}
        other => return Err(lexer.unexpected(expected, &other)),
    }
    let (mut numbers, mut texts) = (Vec::new(), Vec::new());
    loop {
        match lexer.required("`]`")? {
            Token::Close => break,
            Token::Number(x) if texts.is_empty() => numbers.push(x),
            Token::Quoted(text) if numbers.is_empty() => texts.push(text),
            Token::Word(word) if numbers.is_empty() && is_truth(&word) => texts.push(word),
            other => return Err(lexer.unexpected("`]` or values of one type", &other)),
        }
    }
    Ok(if texts.is_empty() {
        Values::Numbers(numbers)
    } else {
        Values::Texts(texts)
    })
}

/// Returns whether a word is a truth value.
fn is_truth(word: &str) -> bool {
    word == "true" || word == "false"
}
