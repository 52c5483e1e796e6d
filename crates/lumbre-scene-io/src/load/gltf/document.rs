//! The JSON document of a glTF file with its buffers: access to objects by index, and to the
//! numbers of accessors.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{Engine, alphabet};
use serde_json::Value as Json;

use super::meshopt;
use crate::load::{beside, canonical, packed, read_file};
use crate::uri;
use lumbre_light::scene::SceneError;

/// Greatest size of the file, and of each external buffer, in bytes.
const MAX_FILE_BYTES: u64 = 1 << 30;
/// First four bytes of a .glb file.
pub(super) const GLB_MAGIC: &[u8; 4] = b"glTF";
/// Component types: code, size in bytes, and greatest value as an integer.
const COMPONENTS: &[(u64, usize, f64)] = &[
    (5120, 1, 127.0),
    (5121, 1, 255.0),
    (5122, 2, 32767.0),
    (5123, 2, 65535.0),
    (5125, 4, 1.0),
    (5126, 4, 1.0),
];
/// Number of components of each element type.
const TYPES: &[(&str, usize)] = &[
    ("SCALAR", 1),
    ("VEC2", 2),
    ("VEC3", 3),
    ("VEC4", 4),
    ("MAT4", 16),
];

/// Greatest count of numbers read per byte of the file and its buffers; accessors may overlap.
const MAX_NUMBERS_PER_BYTE: u64 = 32;
/// Count of numbers that may be read from a file of any size.
const MIN_NUMBER_BUDGET: u64 = 1 << 21;

/// A glTF document with the contents of its buffers.
pub(super) struct Document {
    /// Path of the file.
    pub path: PathBuf,
    /// JSON of the document.
    pub json: Json,
    buffers: Vec<Rc<Vec<u8>>>,
    /// Contents of compressed buffer views.
    unpacked: BTreeMap<usize, Vec<u8>>,
    /// Bytes of the file and of all buffers, each counted once.
    size: u64,
    /// Count of numbers read so far.
    numbers_read: Cell<u64>,
    /// Numbers of the accessors read so far.
    accessors: RefCell<BTreeMap<usize, Rc<Vec<f64>>>>,
}

impl Document {
    /// Reads a .gltf file with its buffers, or a .glb file.
    pub fn read(path: &Path) -> Result<Document, SceneError> {
        let bytes = read_file(path, MAX_FILE_BYTES)?;
        let malformed = |place: &str, problem: String| SceneError::malformed(path, place, problem);
        let (text, binary) = if bytes.starts_with(GLB_MAGIC) {
            chunks(&bytes).map_err(|problem| malformed("chunks", problem))?
        } else {
            (&bytes[..], None)
        };
        let json: Json = serde_json::from_slice(text).map_err(|e| {
            malformed(
                &format!("line {}, column {}", e.line(), e.column()),
                syntax_problem(text, &e),
            )
        })?;
        let size = bytes.len() as u64;
        let mut document = Document {
            path: path.to_owned(),
            json,
            buffers: Vec::new(),
            unpacked: BTreeMap::new(),
            size,
            numbers_read: Cell::new(0),
            accessors: RefCell::default(),
        };
        let mut files: BTreeMap<PathBuf, Rc<Vec<u8>>> = BTreeMap::new();
        for i in 0..document.count("buffers") {
            let (place, buffer) = (format!("buffers[{i}]"), document.at("buffers", i));
            // Several buffers may refer to one file.
            let file = buffer["uri"]
                .as_str()
                .filter(|uri| !uri.starts_with("data:"));
            let file = file.map(|uri| canonical(&document.relative_path(uri)));
            let known = file.as_ref().and_then(|file| files.get(file)).cloned();
            let bytes = match (known, binary) {
                (Some(bytes), _) => bytes,
                (None, _) if buffer["uri"].is_string() => {
                    let bytes = Rc::new(document.uri(&place, buffer)?.unwrap_or_default());
                    document.size += bytes.len() as u64;
                    bytes
                }
                (None, Some(chunk)) if i == 0 => Rc::new(chunk.to_vec()),
                // Where a compressed buffer view would lie in a file without compression.
                _ if meshopt::EXTENSIONS
                    .iter()
                    .any(|name| document.requires(name)) =>
                {
                    Rc::default()
                }
                _ => {
                    return Err(
                        document.error(&place, "the buffer has neither a `uri` nor a binary chunk")
                    );
                }
            };
            files.extend(file.map(|file| (file, bytes.clone())));
            document.buffers.push(bytes);
        }
        let mut left = packed::budget(document.size as usize);
        for i in 0..document.count("bufferViews") {
            if let Some(bytes) = document.unpacked_view(i, &mut left)? {
                document.unpacked.insert(i, bytes);
            }
        }
        Ok(document)
    }

    /// Returns whether the document requires an extension.
    fn requires(&self, name: &str) -> bool {
        let names = self.json["extensionsRequired"].as_array();
        names.is_some_and(|names| names.iter().any(|n| n.as_str() == Some(name)))
    }

    /// Returns the contents of a buffer view if it is compressed. `left` is the number of bytes to
    /// which views may still expand.
    fn unpacked_view(&self, i: usize, left: &mut u64) -> Result<Option<Vec<u8>>, SceneError> {
        let extensions = &self.at("bufferViews", i)["extensions"];
        let Some(name) = meshopt::EXTENSIONS
            .iter()
            .find(|name| extensions[name].is_object())
        else {
            return Ok(None);
        };
        let (view, place) = (&extensions[name], format!("bufferViews[{i}].{name}"));
        let [count, stride] = ["count", "byteStride"].map(|key| view[key].as_u64().unwrap_or(0));
        let after = count
            .checked_mul(stride)
            .and_then(|bytes| left.checked_sub(bytes));
        *left = after.ok_or_else(|| {
            let problem = "the views up to here expand to more than the size of the file justifies";
            self.error(&place, problem)
        })?;
        let [mode, filter] = ["mode", "filter"].map(|key| view[key].as_str());
        let layout = [count as usize, stride as usize];
        let data = self.slice(&place, view)?;
        meshopt::decode(
            data,
            mode.unwrap_or("none"),
            filter.unwrap_or("NONE"),
            layout,
        )
        .map(Some)
        .map_err(|problem| self.error(&place, problem))
    }

    /// Returns the number of bytes of the file and of its buffers, each counted once.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Creates an error about a key path.
    pub fn error(&self, place: &str, problem: impl Into<String>) -> SceneError {
        SceneError::malformed(self.path.clone(), place, problem)
    }

    /// Returns the number of objects in a list of the document.
    pub fn count(&self, list: &str) -> usize {
        self.json[list].as_array().map_or(0, Vec::len)
    }

    /// Returns an object of a list, or null if there is none.
    pub fn at(&self, list: &str, i: usize) -> &Json {
        &self.json[list][i]
    }

    /// Resolves an index into a list of the document.
    pub fn resolve<'a>(
        &'a self,
        place: &str,
        list: &str,
        index: &Json,
    ) -> Result<(usize, &'a Json), SceneError> {
        let count = self.count(list);
        match index
            .as_u64()
            .and_then(|i| usize::try_from(i).ok())
            .filter(|i| *i < count)
        {
            Some(i) => Ok((i, self.at(list, i))),
            None => Err(self.error(
                place,
                format!("expected an index below {count} of `{list}`, found {index:.40}"),
            )),
        }
    }

    /// Returns the bytes that a `uri` refers to, embedded or in another file.
    pub fn uri(&self, place: &str, object: &Json) -> Result<Option<Vec<u8>>, SceneError> {
        let Some(uri) = object["uri"].as_str() else {
            return Ok(None);
        };
        if let Some(data) = uri.strip_prefix("data:") {
            let Some((_, coded)) = data.split_once(";base64,") else {
                return Err(self.error(place, "data in a `uri` must be encoded in base64"));
            };
            return BASE64
                .decode(coded)
                .ok()
                .map(Some)
                .ok_or_else(|| self.error(place, "the base64 data is damaged"));
        }
        read_file(&self.relative_path(uri), MAX_FILE_BYTES)
            .map(Some)
            .map_err(|e| self.error(place, e.to_string()))
    }

    /// Returns the path of a relative `uri`.
    pub fn relative_path(&self, uri: &str) -> PathBuf {
        beside(
            self.path.parent().unwrap_or(Path::new("")),
            &uri::decoded(uri),
        )
    }

    /// Returns the bytes of a buffer view, and its stride.
    pub fn view(&self, place: &str, index: &Json) -> Result<(&[u8], Option<usize>), SceneError> {
        let (i, view) = self.resolve(place, "bufferViews", index)?;
        let place = format!("bufferViews[{i}]");
        let stride = view["byteStride"].as_u64().map(|s| s as usize);
        match self.unpacked.get(&i) {
            Some(bytes) => Ok((bytes, stride)),
            None => Ok((self.slice(&place, view)?, stride)),
        }
    }

    /// Returns the part of a buffer that an object with its index, `byteOffset` and `byteLength`
    /// names.
    fn slice(&self, place: &str, view: &Json) -> Result<&[u8], SceneError> {
        let (b, _) = self.resolve(place, "buffers", &view["buffer"])?;
        let number = |key: &str| view[key].as_u64().unwrap_or(0) as usize;
        let (start, length) = (number("byteOffset"), number("byteLength"));
        let bytes = start
            .checked_add(length)
            .and_then(|end| self.buffers[b].get(start..end));
        bytes.ok_or_else(|| {
            let problem = format!(
                "bytes {start} to {start}+{length} exceed the buffer of {} bytes",
                self.buffers[b].len()
            );
            self.error(place, problem)
        })
    }

    /// Adds to the count of numbers read from the document.
    ///
    /// # Errors
    /// Fails if the count exceeds the budget for the document's size.
    pub fn charge(&self, place: &str, numbers: u64) -> Result<(), SceneError> {
        self.numbers_read
            .set(self.numbers_read.get().saturating_add(numbers));
        if self.numbers_read.get()
            <= self
                .size
                .saturating_mul(MAX_NUMBERS_PER_BYTE)
                .saturating_add(MIN_NUMBER_BUDGET)
        {
            return Ok(());
        }
        Err(self.error(
            place,
            "the accessors up to here contain more numbers than the size of the file justifies",
        ))
    }

    /// Returns the elements of an accessor as a flat list, `n` numbers each. Integers are converted
    /// unchanged unless they are normalised. Interleaved, quantised and sparse accessors are
    /// supported. An accessor that several primitives share is read once.
    pub fn numbers(&self, place: &str, index: &Json, n: usize) -> Result<Rc<Vec<f64>>, SceneError> {
        let (i, accessor) = self.resolve(place, "accessors", index)?;
        let place = format!("accessors[{i}]");
        if Document::width(accessor) != Some(n) {
            return Err(self.error(
                &place,
                format!(
                    "expected elements of {n} numbers, found `{:.20}`",
                    accessor["type"]
                ),
            ));
        }
        if let Some(known) = self.accessors.borrow().get(&i) {
            return Ok(known.clone());
        }
        let count = accessor["count"].as_u64().unwrap_or(0) as usize;
        let normalized = accessor["normalized"].as_bool().unwrap_or(false);
        let sparse = &accessor["sparse"];
        let mut out = if accessor["bufferView"].is_null() {
            // Only sparse accessors have no buffer view. Their size is bounded by the file's size.
            if count as u64 > self.size {
                return Err(self.error(
                    &place,
                    format!("{count} elements are more than the file has bytes"),
                ));
            }
            self.charge(&place, (count * n) as u64)?;
            vec![0.0; count * n]
        } else {
            self.packed_numbers(
                &place,
                accessor,
                &accessor["bufferView"],
                count,
                n,
                normalized,
            )?
        };
        if !sparse.is_null() {
            self.replace_sparse(&place, accessor, n, &mut out)?;
        }
        self.store(i, out)
    }

    /// Returns the count of numbers per element of an accessor.
    pub fn width(accessor: &Json) -> Option<usize> {
        let ty = accessor["type"].as_str();
        TYPES.iter().find(|t| Some(t.0) == ty).map(|t| t.1)
    }

    /// Stores the numbers of an accessor, which must be finite.
    pub fn store(&self, i: usize, numbers: Vec<f64>) -> Result<Rc<Vec<f64>>, SceneError> {
        if !numbers.iter().all(|x| x.is_finite()) {
            return Err(self.error(&format!("accessors[{i}]"), "the numbers must be finite"));
        }
        let numbers = Rc::new(numbers);
        self.accessors.borrow_mut().insert(i, numbers.clone());
        Ok(numbers)
    }

    /// Returns the greatest integer of a normalised accessor, which stands for 1.
    pub fn greatest(accessor: &Json) -> Option<f64> {
        let code = accessor["componentType"].as_u64();
        let component = COMPONENTS.iter().find(|c| Some(c.0) == code);
        component
            .map(|c| c.2)
            .filter(|_| accessor["normalized"].as_bool() == Some(true))
    }

    /// Replaces elements of `out` by the sparse elements of an accessor.
    fn replace_sparse(
        &self,
        place: &str,
        accessor: &Json,
        n: usize,
        out: &mut [f64],
    ) -> Result<(), SceneError> {
        let count = out.len() / n;
        let normalized = accessor["normalized"].as_bool().unwrap_or(false);
        let sparse = &accessor["sparse"];
        let changed = sparse["count"].as_u64().unwrap_or(0) as usize;
        let indices = self.packed_numbers(
            place,
            &sparse["indices"],
            &sparse["indices"]["bufferView"],
            changed,
            1,
            false,
        )?;
        let values = &sparse["values"];
        let values = serde_json::json!({
            "bufferView": values["bufferView"],
            "byteOffset": values["byteOffset"],
            "componentType": accessor["componentType"],
        });
        let values = self.packed_numbers(
            place,
            &values,
            &values["bufferView"],
            changed,
            n,
            normalized,
        )?;
        for (k, at) in indices.iter().enumerate() {
            let at = *at as usize;
            if at >= count {
                return Err(self.error(
                    place,
                    format!("a sparse index is {at}, but there are only {count} elements"),
                ));
            }
            out[at * n..(at + 1) * n].copy_from_slice(&values[k * n..(k + 1) * n]);
        }
        Ok(())
    }

    /// Reads `count` elements of `n` numbers from a buffer view. `layout` has their component type
    /// and byte offset.
    fn packed_numbers(
        &self,
        place: &str,
        layout: &Json,
        view: &Json,
        count: usize,
        n: usize,
        normalized: bool,
    ) -> Result<Vec<f64>, SceneError> {
        let (bytes, stride) = self.view(place, view)?;
        let code = layout["componentType"].as_u64().unwrap_or(0);
        let Some((_, size, greatest)) = COMPONENTS.iter().find(|c| c.0 == code) else {
            return Err(self.error(place, format!("{code} is not a component type")));
        };
        let stride = stride.filter(|s| *s > 0).unwrap_or(size * n);
        let start = layout["byteOffset"].as_u64().unwrap_or(0) as usize;
        let last = count
            .checked_sub(1)
            .and_then(|k| k.checked_mul(stride))
            .unwrap_or(if count == 0 { 0 } else { usize::MAX });
        let end = start
            .checked_add(last)
            .and_then(|at| at.checked_add(size * n));
        if count > 0 && end.is_none_or(|end| end > bytes.len()) {
            return Err(self.error(
                place,
                format!(
                    "{count} elements exceed the {} bytes of the view",
                    bytes.len()
                ),
            ));
        }
        self.charge(place, (count * n) as u64)?;
        let mut out = Vec::with_capacity(count * n);
        for k in 0..count {
            for c in 0..n {
                let at = start + k * stride + c * size;
                let x = component(code, &bytes[at..at + size]);
                out.push(if normalized {
                    (x / greatest).max(-1.0)
                } else {
                    x
                });
            }
        }
        Ok(out)
    }
}

/// Decodes one component of a type.
fn component(code: u64, b: &[u8]) -> f64 {
    match (code, b) {
        (5120, [a]) => f64::from(*a as i8),
        (5121, [a]) => f64::from(*a),
        (5122, [a, b]) => f64::from(i16::from_le_bytes([*a, *b])),
        (5123, [a, b]) => f64::from(u16::from_le_bytes([*a, *b])),
        (5125, [a, b, c, d]) => f64::from(u32::from_le_bytes([*a, *b, *c, *d])),
        (5126, [a, b, c, d]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
        _ => f64::NAN,
    }
}

/// Returns the elements at `indices` of a flat list with `N` numbers per element.
pub(super) fn select<const N: usize>(numbers: &[f64], indices: &[u32]) -> Vec<[f64; N]> {
    let element = |i: &u32| {
        numbers
            .get(N * *i as usize..)
            .and_then(|rest| rest.first_chunk())
            .copied()
    };
    indices.iter().filter_map(element).collect()
}

/// Returns the JSON and the binary chunk of a .glb file.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let word = |at: usize| {
        let raw = bytes
            .get(at..at + 4)
            .and_then(|b| <[u8; 4]>::try_from(b).ok());
        raw.map(|b| u32::from_le_bytes(b) as usize)
            .ok_or_else(|| format!("the file ends early, after {} bytes", bytes.len()))
    };
    if word(4)? != 2 {
        return Err(format!("expected version 2, found {}", word(4)?));
    }
    let (mut at, mut found): (usize, [Option<&[u8]>; 2]) = (12, [None, None]);
    while at + 8 <= bytes.len() {
        let (length, kind) = (word(at)?, word(at + 4)?);
        let chunk = bytes
            .get(at + 8..at + 8 + length)
            .ok_or_else(|| format!("the chunk at byte {at} is truncated"))?;
        match kind {
            0x4E4F_534A => found[0] = found[0].or(Some(chunk)),
            0x004E_4942 => found[1] = found[1].or(Some(chunk)),
            _ => {}
        }
        at += 8 + length;
    }
    found[0]
        .map(|json| (json, found[1]))
        .ok_or_else(|| "the file has no JSON chunk".to_owned())
}

/// Decoder of base64 [RFC 4648] that takes padding or none, as writers of glTF differ in it.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Returns what is wrong with a document that is not JSON, or not even the beginning of it.
fn syntax_problem(text: &[u8], error: &serde_json::Error) -> String {
    match text.trim_ascii_start().first() {
        Some(b'{') => format!("invalid JSON: {error}"),
        _ => "neither JSON nor a binary glTF file, which starts with the letters `glTF`".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percent_encoding_are_decoded() {
        assert_eq!(BASE64.decode("Zm9vYmFy").unwrap(), b"foobar");
        assert_eq!(BASE64.decode("Zm9vYg==").unwrap(), b"foob");
        assert_eq!(BASE64.decode("Zm9vYmE").unwrap(), b"fooba");
        assert!(BASE64.decode("Zm9*").is_err() && BASE64.decode("Z").is_err());
        assert_eq!(uri::decoded("a%20b%2"), "a b%2");
    }
}
