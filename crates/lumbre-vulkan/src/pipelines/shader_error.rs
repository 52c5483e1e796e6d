//! Errors of shaders that a folder replaces.

use std::path::PathBuf;

/// Environment variable that names the folder of shaders of runs whose render table has no
/// `shaders`.
pub const FOLDER_VARIABLE: &str = "LUMBRE_SHADERS";

/// Reason why a shader cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ShaderError {
    /// No compiler is installed.
    #[error(
        "a folder of shaders needs the compiler `glslangValidator`, `glslang` or `glslc`, and none \
         is on PATH; install it (on Debian or Ubuntu `apt-get install glslang-tools`), or leave out \
         `shaders` and unset {FOLDER_VARIABLE}"
    )]
    NoCompiler,
    /// The compiler failed for a reason that is not the text.
    #[error(
        "the compiler {} failed at the shader `{entry}`: {problem}; change the shader, or install \
         another compiler and put it first on PATH", .program.display()
    )]
    Compiler {
        /// Path of the compiler.
        program: PathBuf,
        /// File that was compiled.
        entry: String,
        /// Event, with the end of the compiler's output.
        problem: String,
    },
    /// The files of a folder are no longer those that the plan was made for.
    #[error(
        "the shaders in {} have changed since the plan was made; run the command again, which \
         plans with the files as they are", .0.display()
    )]
    Changed(PathBuf),
    /// The program has no module of this name.
    #[error("the program has no shader module `{0}`; make it with `cargo shaders`")]
    NoModule(String),
    /// The file does not exist.
    #[error("the shader `{0}` does not exist, neither in the folder of shaders nor in the program")]
    Missing(String),
    /// A file of the folder cannot be read.
    #[error("the shader {file} cannot be read: {problem}")]
    Unreadable {
        /// Path of the file.
        file: String,
        /// Message of the operating system.
        problem: String,
    },
    /// The text does not compile.
    #[error("the shader `{entry}` does not compile:\n{log}")]
    Invalid {
        /// File that was compiled; the log names included ones.
        entry: String,
        /// Compiler messages, `file:line: message` each.
        log: String,
    },
}
