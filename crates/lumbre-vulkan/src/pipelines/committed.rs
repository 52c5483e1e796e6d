//! The committed SPIR-V, of which the program contains compressed copies (`build.rs`).

use std::io::Read;

use flate2::read::DeflateDecoder;

/// File name and raw deflate stream of every module of `spirv/`.
static MODULES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/modules.rs"));

/// Returns the file names of the modules.
#[cfg(test)]
pub(super) fn files() -> impl Iterator<Item = &'static str> {
    MODULES.iter().map(|(file, _)| *file)
}

/// Returns the bytes of a module, or `None` if the program has none of this name.
pub(super) fn module(name: &str) -> Option<Vec<u8>> {
    let (_, packed) = MODULES.iter().find(|(file, _)| *file == name)?;
    let mut bytes = Vec::new();
    DeflateDecoder::new(*packed).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_are_those_of_the_folder_to_the_byte() {
        assert!(files().count() > 20);
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv");
        for file in files() {
            assert_eq!(
                module(file),
                std::fs::read(folder.join(file)).ok(),
                "{file}"
            );
        }
        assert_eq!(module("absent.spv"), None);
    }
}
