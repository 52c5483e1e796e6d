//! Laws of the code base: who may import whom, how large a file may be, what every table row owes its reader.

#[path = "laws/dependencies.rs"]
mod dependencies;
#[path = "laws/files.rs"]
mod files;
#[path = "laws/imports.rs"]
mod imports;
#[path = "laws/source.rs"]
mod source;
#[path = "laws/tables.rs"]
mod tables;
