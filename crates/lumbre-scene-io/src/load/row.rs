//! The row of a scene format.

use std::collections::BTreeMap;
use std::path::Path;

use lumbre_light::scene::{Note, SceneDesc, SceneError};

/// A row of [`FORMATS`](super::FORMATS): one scene format.
#[derive(Debug)]
pub struct FormatRow {
    /// Short name of the format.
    pub name: &'static str,
    /// File extensions in lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Description of the format, in a sentence.
    pub doc: &'static str,
    /// Returns whether the first bytes of a file without a known extension look like this format.
    pub sniff: fn(&[u8]) -> bool,
    /// Reads a file of this format.
    pub load: Loader,
    /// Reads a file with values for variables that it names, where the format has any.
    pub load_with_variables: Option<VariablesLoader>,
    /// Whether files are usually models without lights. Those get a [studio](crate::stage).
    pub is_model: bool,
    /// Supported elements or keys.
    pub supported: &'static [SupportedElement],
}

/// A row of a format's table of supported elements or keys.
#[derive(Clone, Copy, Debug)]
pub struct SupportedElement {
    /// Names in the format, each between backticks, or a description of the remaining elements.
    pub name: &'static str,
    /// Result of loading the element; empty if it is not supported.
    pub support: &'static str,
    /// Parts that become a note or an error instead.
    pub limits: &'static str,
}

/// Loader of a scene file.
pub type Loader = fn(&Path, MissingTextures) -> Result<(SceneDesc, Vec<Note>), SceneError>;

/// Values of variables of a scene file, by name.
pub type Variables = BTreeMap<String, String>;

/// Loader of a scene file with values for its variables. A variable that the file does not name is an
/// error.
pub type VariablesLoader =
    fn(&Path, MissingTextures, &Variables) -> Result<(SceneDesc, Vec<Note>), SceneError>;

/// Policy for a material whose texture cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MissingTextures {
    /// Loading fails with an error that names the material and the file.
    #[default]
    Fail,
    /// The parameter keeps its constant value, with a [`Note`] that names the material and the
    /// file.
    Note,
}
