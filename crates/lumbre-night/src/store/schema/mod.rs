//! Every file of the output folder that holds records: one structure for each, with its name, its
//! version, and the meaning and unit of every field; and the [`columns`] of every CSV file. All readers and writers use these structures.
//!
//! A file begins with `version`, the version of its own format, and `program`, the program that
//! wrote it. A file of another version is refused with the program that wrote it
//! ([`Problem::OtherVersion`]), and so is a file with an unknown, missing or mistyped field
//! ([`Problem::Damaged`]); nothing is guessed. A change of a structure changes its version.
//!
//! Pictures, tables and figures are described by their writers in [`lumbre_report`].

mod device;
pub mod journal;
pub mod plan;
pub mod process;
mod reference;
pub mod run;
pub mod status;
pub mod values;

pub use crate::columns;
pub use reference::reference;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::de::{DeserializeOwned, Deserializer, Error as _};
use serde::{Deserialize, Serialize, Serializer};

use super::write::atomic;
use super::{StoreError, regular_file};
use crate::text::program;

/// Name of a program, its version and its commit. The default is this program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Program(pub String);

impl Program {
    /// Returns whether this program has the same name and version, whatever its commit.
    pub fn is_same_version(&self) -> bool {
        let version = |program: &str| program.split(" (").next().map(str::to_owned);
        version(&self.0) == version(program())
    }
}

impl Default for Program {
    fn default() -> Program {
        Program(program().to_owned())
    }
}

/// Version `N` of the format of a file. Reading fails if a file has another one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Version<const N: u32>;

impl<const N: u32> Serialize for Version<N> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u32(N)
    }
}

impl<'de, const N: u32> Deserialize<'de> for Version<N> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Version<N>, D::Error> {
        match u32::deserialize(from)? {
            found if found == N => Ok(Version),
            found => Err(D::Error::custom(format!("version {found} instead of {N}"))),
        }
    }
}

/// A structure that is a whole file.
pub trait StoredFile: Serialize + DeserializeOwned {
    /// Name of the file in its folder; for files of which a folder has several, their description.
    const NAME: &'static str;
    /// Version of the format.
    const VERSION: u32;

    /// Reads the file of this name in a folder.
    ///
    /// # Errors
    /// When the file cannot be read, is damaged, or has another version.
    fn read(folder: &Path) -> Result<Self, ReadError> {
        Self::read_from(&folder.join(Self::NAME))
    }

    /// Reads the file with this path.
    ///
    /// # Errors
    /// When the file cannot be read, is damaged, or has another version.
    fn read_from(path: &Path) -> Result<Self, ReadError> {
        let error = |problem| ReadError {
            path: path.to_owned(),
            problem,
        };
        match regular_file::read(path) {
            Ok(bytes) => Self::parse(&bytes).map_err(error),
            Err(e) if e.kind() == ErrorKind::NotFound => Err(error(Problem::Missing)),
            Err(e) => Err(error(Problem::Unreadable(e.to_string()))),
        }
    }

    /// Parses the content of the file.
    ///
    /// # Errors
    /// When it is damaged or has another version.
    fn parse(bytes: &[u8]) -> Result<Self, Problem> {
        parse_fields(bytes)
    }

    /// Content of the file: indented, with a newline at the end.
    fn text(&self) -> String {
        pretty(self)
    }

    /// Writes the file of this name in a folder atomically, if its content would change.
    ///
    /// # Errors
    /// When it cannot be written; an existing file is then unchanged.
    fn write(&self, folder: &Path) -> Result<(), StoreError> {
        atomic::write_if_changed(&folder.join(Self::NAME), self.text().as_bytes())
    }
}

/// Parses the fields of a file, without a checksum that the file may have of itself.
fn parse_fields<F: StoredFile>(bytes: &[u8]) -> Result<F, Problem> {
    serde_json::from_slice(bytes).map_err(|error| {
        match serde_json::from_slice::<Head>(bytes) {
            // This program writes no other version, so such a file of its own is damaged.
            Ok(head) if head.is_foreign(F::VERSION) => Problem::OtherVersion {
                version: head.version,
                program: head.program,
            },
            _ => Problem::Damaged(error.to_string()),
        }
    })
}

/// The fields that all files have, in any version.
#[derive(Default, Deserialize)]
struct Head {
    version: Option<u32>,
    program: Option<String>,
}

impl Head {
    /// Whether another program wrote the file, in another version.
    fn is_foreign(&self, version: u32) -> bool {
        self.version != Some(version) && self.program.as_deref() != Some(program())
    }
}

/// Name and version of the program that wrote a file of any version, if the file states it.
pub(crate) fn writer_of(path: &Path) -> Option<String> {
    serde_json::from_slice::<Head>(&regular_file::read(path).ok()?)
        .ok()?
        .program
}

/// Why a file could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{problem}", path.display())]
pub struct ReadError {
    /// Path of the file.
    pub path: PathBuf,
    /// Problem of the file.
    pub problem: Problem,
}

impl ReadError {
    /// Whether the file does not exist.
    pub fn is_missing(&self) -> bool {
        self.problem == Problem::Missing
    }
}

/// Problem of a file; as text, the continuation of a sentence that begins with its name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// There is no such file.
    #[error(" is missing")]
    Missing,
    /// The operating system could not read it, for this reason.
    #[error(" cannot be read: {0}")]
    Unreadable(String),
    /// It is not what this version writes, for this reason.
    #[error(" is damaged: {0}")]
    Damaged(String),
    /// Another version of the program wrote it.
    #[error(
        " was written by {} in another format (version {}), which {} does not read; read it \
         with that program, or remove it",
        program.as_deref().unwrap_or("an older lumbre"),
        version.map_or_else(|| "unknown".to_owned(), |version| version.to_string()),
        crate::text::program()
    )]
    OtherVersion {
        /// Version of the file's format, if it has one.
        version: Option<u32>,
        /// Program that wrote it, if the file states it.
        program: Option<String>,
    },
}

impl From<ReadError> for StoreError {
    fn from(error: ReadError) -> StoreError {
        StoreError::Read(error)
    }
}

/// Problem of a file whose checksum of itself is not that of its content.
fn wrong_checksum() -> Problem {
    Problem::Damaged("its content does not match its checksum".to_owned())
}

/// Formats a structure as JSON with indentation and a newline at the end.
pub fn pretty(value: &impl Serialize) -> String {
    // Serialisation of these structures cannot fail: all keys are strings.
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// Formats a structure as JSON on one line, with a newline at the end.
pub fn one_line(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default() + "\n"
}

/// Field of a structure, for the reference page of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name in the file.
    pub name: &'static str,
    /// Meaning, unit and range.
    pub doc: &'static str,
}

/// A structure of the schema, for the reference page of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordRow {
    /// Name of the structure.
    pub name: &'static str,
    /// Description of the structure.
    pub doc: &'static str,
    /// Fields in the order of the file.
    pub fields: &'static [Field],
}

/// Declares structures that are parts of files: unknown and missing fields are errors, and
/// `ROW` describes the structure for the reference page.
macro_rules! records {
    ($(
        $(#[doc = $doc:literal])+
        pub struct $name:ident {
            $(
                $(#[doc = $field_doc:literal])+
                $(#[serde($($attribute:tt)+)])*
                pub $field:ident: $ty:ty,
            )+
        }
    )+) => { $(
        $(#[doc = $doc])+
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $(
                $(#[doc = $field_doc])+
                $(#[serde($($attribute)+)])*
                pub $field: $ty,
            )+
        }

        impl $name {
            /// Row of the reference page of files.
            pub const ROW: $crate::store::schema::RecordRow = $crate::store::schema::RecordRow {
                name: stringify!($name),
                doc: concat!($($doc),+),
                fields: &[$($crate::store::schema::Field {
                    name: stringify!($field),
                    doc: concat!($($field_doc),+),
                }),+],
            };
        }
    )+ };
}

/// Declares structures that are whole files, like `records!`, with the name of the file and the
/// version of its format. The fields `version` and `program` are added.
macro_rules! files {
    ($(
        $(#[doc = $doc:literal])+
        pub file $name:ident = $path:expr, $version:literal {
            $(
                $(#[doc = $field_doc:literal])+
                $(#[serde($($attribute:tt)+)])*
                pub $field:ident: $ty:ty,
            )+
        }
    )+) => { $(
        $crate::store::schema::records! {
            $(#[doc = $doc])+
            pub struct $name {
                /// Version of the format.
                pub version: $crate::store::schema::Version<$version>,
                /// Program that wrote the file, with its version.
                pub program: $crate::store::schema::Program,
                $(
                    $(#[doc = $field_doc])+
                    $(#[serde($($attribute)+)])*
                    pub $field: $ty,
                )+
            }
        }

        impl $crate::store::schema::StoredFile for $name {
            const NAME: &'static str = $path;
            const VERSION: u32 = $version;
        }
    )+ };
}

/// Declares the fields of a record that is serialised by hand, by one row each: `NAME: "DOC";`.
macro_rules! field_rows {
    ($($name:ident: $doc:literal;)+) => {
        &[$($crate::store::schema::Field {
            name: stringify!($name),
            doc: $doc,
        }),+]
    };
}

pub(crate) use {field_rows, files, records};

#[cfg(test)]
mod tests {
    use super::run::FailedFile;
    use super::*;

    fn failed() -> FailedFile {
        FailedFile {
            run: "ab".to_owned(),
            reason: "lens fell off".to_owned(),
            ..FailedFile::default()
        }
    }

    #[test]
    fn a_file_reads_back_and_states_its_version_and_program_first() {
        let text = failed().text();
        assert!(text.starts_with(&format!(
            "{{\n  \"version\": 1,\n  \"program\": \"{}\"",
            program()
        )));
        assert_eq!(FailedFile::parse(text.as_bytes()), Ok(failed()));
    }

    #[test]
    fn files_of_other_versions_are_refused_with_their_writer() {
        let problem = |text: &str| FailedFile::parse(text.as_bytes()).unwrap_err();
        let foreign = failed().text().replace(program(), "lumbre 0.0.9");
        assert!(FailedFile::parse(foreign.as_bytes()).is_ok(), "same format");
        let newer = foreign.replace("\"version\": 1", "\"version\": 2");
        assert_eq!(
            problem(&newer),
            Problem::OtherVersion {
                version: Some(2),
                program: Some("lumbre 0.0.9".to_owned()),
            }
        );
        assert!(problem(&newer).to_string().contains("by lumbre 0.0.9 in"));
        assert_eq!(
            problem("{\"run\":\"ab\"}"),
            Problem::OtherVersion {
                version: None,
                program: None,
            }
        );
    }

    #[test]
    fn unknown_missing_and_mistyped_fields_are_damage() {
        let text = failed().text();
        for damage in [
            text.replace("\"reason\"", "\"rebson\""),
            text.replace("\"ab\"", "12"),
            text.replace("\"version\": 1", "\"version\": 3"),
            text.replace("\"version\"", "\"versioo\""),
            text[..text.len() / 2].to_owned(),
        ] {
            assert_ne!(damage, text);
            let problem = FailedFile::parse(damage.as_bytes()).unwrap_err();
            assert!(
                matches!(problem, Problem::Damaged(_)),
                "{damage}: {problem}"
            );
        }
    }
}
