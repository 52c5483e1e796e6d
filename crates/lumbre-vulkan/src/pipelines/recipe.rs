//! The recipe of a shader module.

/// Everything that a module is made of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recipe {
    /// Name of its file.
    pub file: String,
    /// Path of the text of its entry below the root of the shaders; the extension is its stage.
    pub entry: String,
    /// Text to compile instead of the file `entry`.
    pub text: Option<String>,
    /// Preprocessor symbols that are defined.
    pub defines: Vec<&'static str>,
    /// Texts that may be included as if they were files: path, text.
    pub generated: Vec<(String, String)>,
}
