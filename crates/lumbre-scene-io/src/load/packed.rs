//! Expansion of compressed meshes within limits.

use std::io::Read;

/// Bytes to which the meshes of a file of any size may expand.
const SMALL_MESHES: u64 = 16 << 20;
/// Greatest ratio of further bytes to the size of the file.
const MAX_EXPANSION: u64 = 64;

/// Returns the number of bytes to which the meshes of a file of `packed` bytes may expand.
pub(super) fn budget(packed: usize) -> u64 {
    SMALL_MESHES + MAX_EXPANSION * packed as u64
}

/// Returns all bytes of a decoder; `None` if they are more than `most`.
pub(super) fn expand(decoder: impl Read, most: u64) -> std::io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    decoder.take(most + 1).read_to_end(&mut bytes)?;
    Ok((bytes.len() as u64 <= most).then_some(bytes))
}
