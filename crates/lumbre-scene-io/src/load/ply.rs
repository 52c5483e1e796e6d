//! PLY meshes: ASCII, and binary with either byte order.
//!
//! Supported are the element `vertex` with `x y z`, normals `nx ny nz`, texture coordinates (`u v`,
//! `s t`, or `texture_u texture_v`) and colours `red green blue`, and the element `face` with its
//! list of vertex indices; polygons are triangulated, convex ones as fans from their first vertex.
//! All other elements and properties are skipped, with a note. The front of a face is the side to
//! which its normals point; without normals, the side from which its vertices run
//! counter-clockwise. Integer colours are decoded from sRGB, as programs that scan and paint meshes
//! display them; floats are linear.

mod source;
mod supported;

pub(super) use self::supported::SUPPORTED;

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use self::source::{NumberStream, NumberType};
use super::beside::beside;
use super::default_scene;
use super::images::ImageCache;
use super::polygon::Triangulator;
use super::{MissingTextures, read_file, with_lenient_hint};
use lumbre_light::scene::compile::srgb_to_linear;
use lumbre_light::scene::desc::{
    DEFAULT_MATERIAL, MaterialDesc, MeshDesc, SceneDesc, TextureSlot, mesh_hash,
};
use lumbre_light::scene::{Note, SceneError};

/// Greatest size of a PLY file in bytes.
const MAX_PLY_BYTES: u64 = 1 << 30;
/// Greatest number of elements and properties in a header; larger headers are not those of meshes.
const MAX_NAMES: usize = 256;
/// Names of the supported vertex properties, in the order of [`Vertex`].
const PROPERTIES: [&[&str]; 11] = [
    &["x"],
    &["y"],
    &["z"],
    &["nx"],
    &["ny"],
    &["nz"],
    &["u", "s", "texture_u"],
    &["v", "t", "texture_v"],
    &["red", "r", "diffuse_red", "color_0"],
    &["green", "g", "diffuse_green", "color_1"],
    &["blue", "b", "diffuse_blue", "color_2"],
];

/// Position, normal, texture coordinates and colour of a vertex.
type Vertex = [f32; 11];

/// Returns whether the first bytes of a file are those of a PLY.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.starts_with(b"ply\n") || head.starts_with(b"ply\r")
}

/// Loads a PLY file as a scene: a white mesh, or one with the texture that a comment names, viewed by
/// a camera that frames it.
pub(super) fn load(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let mut notes = Vec::new();
    let bytes = read_file(path, MAX_PLY_BYTES)?;
    let mesh = decode_mesh(path, &bytes, DEFAULT_MATERIAL, &mut notes)?;
    let mut material = MaterialDesc::new(DEFAULT_MATERIAL);
    let images = texture_files(&bytes);
    let mut note = |message: String| notes.push(Note::new(path, "header", message));
    match images.as_slice() {
        [] => {}
        [name, ..] if mesh.uvs.is_empty() => note(format!(
            "the texture `{}` needs texture coordinates of vertices; ignored",
            truncated(name)
        )),
        [name, others @ ..] => {
            if !others.is_empty() {
                note(format!(
                    "of {} textures only the first is used",
                    images.len()
                ));
            }
            let file = beside(path.parent().unwrap_or(Path::new("")), name);
            match ImageCache::default().load(&file, &mut notes) {
                Ok(image) => material.set_texture(TextureSlot::BaseColor, Some(image)),
                Err(e) if missing == MissingTextures::Fail => {
                    let problem = format!("texture: {e}");
                    return Err(with_lenient_hint(SceneError::malformed(
                        path, "header", problem,
                    )));
                }
                Err(e) => {
                    let message = format!("{e}; the material is white");
                    notes.push(Note::new(path, "header", message));
                }
            }
        }
    }
    Ok((default_scene::scene(path, mesh, vec![material]), notes))
}

/// Loads a mesh whose triangles all have the material `slot`.
pub(super) fn load_mesh(
    path: &Path,
    slot: &str,
    notes: &mut Vec<Note>,
) -> Result<MeshDesc, SceneError> {
    let bytes = read_file(path, MAX_PLY_BYTES)?;
    decode_mesh(path, &bytes, slot, notes)
}

/// Decodes the bytes of a mesh like [`load_mesh`]; the path is for messages.
pub(super) fn decode_mesh(
    path: &Path,
    bytes: &[u8],
    slot: &str,
    notes: &mut Vec<Note>,
) -> Result<MeshDesc, SceneError> {
    let fail = |(place, problem)| SceneError::malformed(path, place, problem);
    let (elements, mut source) = header(bytes).map_err(fail)?;
    let mut mesh = MeshDesc {
        file: path.to_owned(),
        slots: vec![slot.to_owned()],
        ..MeshDesc::default()
    };
    let mut note = |message: &str| {
        let message = message.to_owned();
        notes.push(Note::new(path, "header", message));
    };
    for element in &elements {
        match element.name.as_str() {
            "vertex" => {
                if vertices(element, &mut source, &mut mesh).map_err(fail)? {
                    note(
                        "colours of vertices exceed 2; all are divided by 255 and decoded from sRGB",
                    );
                }
            }
            "face" => {
                let fans = faces(element, &mut source, &mut mesh).map_err(fail)?;
                if fans > 0 {
                    note(&format!(
                        "concave polygons whose edges intersect, or too many to triangulate \
                         otherwise, are fans, which cover too much: {fans}"
                    ));
                }
            }
            other => {
                element.skip(&mut source).map_err(fail)?;
                if element.count > 0 {
                    note(&format!(
                        "the element `{}` is not supported; ignored",
                        truncated(other)
                    ));
                }
            }
        }
        if let Some(names) = unsupported_properties(element) {
            note(&format!(
                "properties of `{}` that are not supported: {names}; ignored",
                element.name
            ));
        }
    }
    let count = mesh.positions.len();
    if let Some(i) = mesh
        .triangles
        .as_flattened()
        .iter()
        .find(|i| **i as usize >= count)
    {
        return Err(fail((
            "face".to_owned(),
            format!("a face refers to vertex {i}, counted from 0, but there are only {count}"),
        )));
    }
    if mesh.triangles.is_empty() {
        note("the mesh has no faces");
    }
    orient_by_normals(&mut mesh);
    mesh.triangle_slot = vec![0; mesh.triangles.len()];
    mesh.content_hash = mesh_hash(&mesh);
    Ok(mesh)
}

/// Orients every triangle to the side of its normals; normals without a direction become the
/// triangle's own.
pub(super) fn orient_by_normals(mesh: &mut MeshDesc) {
    if mesh.normals.is_empty() {
        return;
    }
    for t in &mut mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
        let winding = (b - a).cross(c - a);
        let mean: Vec3 = t.iter().map(|i| mesh.normals[*i as usize]).sum();
        let behind = winding.dot(mean.as_dvec3()) < 0.0;
        if behind {
            t.swap(1, 2);
        }
        let own = winding.try_normalize().map_or(Vec3::Y, |n| n.as_vec3())
            * if behind { -1.0 } else { 1.0 };
        for i in *t {
            let n = &mut mesh.normals[i as usize];
            *n = n.try_normalize().unwrap_or(own);
        }
    }
    // Vertices without a face.
    mesh.normals
        .iter_mut()
        .for_each(|n| *n = n.try_normalize().unwrap_or(Vec3::Y));
}

/// Location and description of a problem.
type PlyError = (String, String);

/// A property of an element.
struct Property {
    name: String,
    /// Type of the length, if the property is a list.
    length: Option<NumberType>,
    ty: NumberType,
}

/// An element of the header: the type of a sequence of records.
struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

impl Element {
    /// Skips one property of a record.
    fn skip_property(property: &Property, source: &mut NumberStream) -> Result<(), String> {
        let n = match property.length {
            Some(length) => source.length(length, property.ty)?,
            None => 1,
        };
        for _ in 0..n {
            source.number(property.ty)?;
        }
        Ok(())
    }

    /// Skips all records.
    fn skip(&self, source: &mut NumberStream) -> Result<(), PlyError> {
        self.check(source)?;
        for i in 0..self.count {
            for property in &self.properties {
                Element::skip_property(property, source).map_err(|e| self.error(i, source, e))?;
            }
        }
        Ok(())
    }

    /// Creates an error about record `i`.
    fn error(&self, i: usize, source: &NumberStream, problem: String) -> PlyError {
        (
            format!("{} {i} of {}, byte {}", self.name, self.count, source.at()),
            problem,
        )
    }

    /// Fails for a count that the rest of the file cannot hold.
    fn check(&self, source: &NumberStream) -> Result<(), PlyError> {
        let least: usize = self
            .properties
            .iter()
            .map(|p| source.min_size(p.length.unwrap_or(p.ty)))
            .sum();
        let capacity = source.remaining() / least.max(1) + 1;
        if self.count > capacity {
            let problem = format!(
                "the header announces {}, but the file holds at most {capacity}",
                self.count
            );
            return Err((format!("element {}", self.name), problem));
        }
        Ok(())
    }
}

/// Float above which colours are in the range of bytes; smaller ones above 1 are clamped.
const MOST_FLOAT: f32 = 2.0;

/// Reads all vertices. Returns whether colours are floats as large as bytes.
fn vertices(
    element: &Element,
    source: &mut NumberStream,
    mesh: &mut MeshDesc,
) -> Result<bool, PlyError> {
    element.check(source)?;
    let slot_of = |p: &Property| {
        PROPERTIES
            .iter()
            .position(|names| names.contains(&p.name.as_str()))
    };
    let slots: Vec<Option<usize>> = element.properties.iter().map(slot_of).collect();
    let has = |range: std::ops::Range<usize>| range.into_iter().all(|i| slots.contains(&Some(i)));
    if !has(0..3) {
        return Err((
            "element vertex".to_owned(),
            "expected the properties x, y and z".to_owned(),
        ));
    }
    let is_precise = |(p, slot): (&Property, &Option<usize>)| {
        slot.is_some_and(|slot| slot < 3) && source.is_precise(p.ty)
    };
    let precise = element.properties.iter().zip(&slots).any(is_precise);
    let (has_normals, has_uvs, has_colors) = (has(3..6), has(6..8), has(8..11));
    let red = element
        .properties
        .iter()
        .zip(&slots)
        .find(|(_, slot)| **slot == Some(8));
    let color_max = red.and_then(|(p, _)| p.ty.color_max());
    let mut points: Vec<DVec3> = Vec::new();
    for i in 0..element.count {
        let mut vertex: Vertex = [0.0; 11];
        let mut point = DVec3::ZERO;
        for (property, slot) in element.properties.iter().zip(&slots) {
            let done = match (slot, property.length) {
                (Some(slot), None) => source.number(property.ty).map(|x| {
                    vertex[*slot] = x as f32;
                    if *slot < 3 {
                        point[*slot] = x;
                    }
                }),
                _ => Element::skip_property(property, source),
            };
            done.map_err(|e| element.error(i, source, e))?;
        }
        let [x, y, z, nx, ny, nz, u, v, color @ ..] = vertex;
        if !vertex.iter().all(|x| x.is_finite()) {
            return Err(element.error(i, source, "the numbers must be finite".to_owned()));
        }
        mesh.positions.push(Vec3::new(x, y, z));
        if precise {
            points.push(point);
        }
        if has_normals {
            mesh.normals.push(Vec3::new(nx, ny, nz));
        }
        if has_uvs {
            mesh.uvs.push(Vec2::new(u, v));
        }
        if has_colors {
            mesh.colors.push(Vec3::from_array(color));
        }
    }
    if precise {
        mesh.place(&points);
    }
    let like_byte = |c: &Vec3| c.max_element() > MOST_FLOAT;
    let like_bytes = color_max.is_none() && mesh.colors.iter().any(like_byte);
    let max = if like_bytes { Some(255.0) } else { color_max };
    for color in &mut mesh.colors {
        let linear = |c: f32| max.map_or(c, |max| srgb_to_linear(c / max)).clamp(0.0, 1.0);
        *color = color.map(linear);
    }
    Ok(like_bytes)
}

/// Properties that say nothing about the surface.
const MEASUREMENTS: [&str; 5] = [
    "confidence",
    "intensity",
    "quality",
    "flags",
    "face_indices",
];

/// Returns the names of the properties of vertices or faces that are not supported; `None` if there
/// are none.
fn unsupported_properties(element: &Element) -> Option<String> {
    let supported = |name: &str| match element.name.as_str() {
        "vertex" => PROPERTIES.iter().any(|names| names.contains(&name)),
        "face" => CORNERS.contains(&name),
        _ => true,
    };
    let mut names: Vec<String> = element
        .properties
        .iter()
        .map(|p| p.name.as_str())
        .filter(|name| !supported(name) && !MEASUREMENTS.contains(name))
        .map(|name| format!("`{}`", truncated(name)))
        .collect();
    names.truncate(MAX_LISTED);
    (!names.is_empty()).then(|| names.join(", "))
}

/// Returns the beginning of a name, for messages.
fn truncated(name: &str) -> String {
    name.chars().take(24).collect()
}

/// Names of the list of vertex indices of a face.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Greatest number of properties that a note lists.
const MAX_LISTED: usize = 8;

/// Reads all faces, triangulated. Returns the number of concave ones that became fans.
fn faces(
    element: &Element,
    source: &mut NumberStream,
    mesh: &mut MeshDesc,
) -> Result<usize, PlyError> {
    element.check(source)?;
    let is_corners = |p: &Property| p.length.is_some() && CORNERS.contains(&p.name.as_str());
    let Some(corners) = element.properties.iter().position(is_corners) else {
        return Err((
            "element face".to_owned(),
            "expected a list named vertex_indices".to_owned(),
        ));
    };
    let mut polygon: Vec<u32> = Vec::new();
    let mut triangulator = Triangulator::default();
    for i in 0..element.count {
        for (k, property) in element.properties.iter().enumerate() {
            let done = match property.length {
                Some(length) if k == corners => source.length(length, property.ty).and_then(|n| {
                    polygon.clear();
                    (0..n).try_for_each(|_| {
                        source.index(property.ty).map(|index| polygon.push(index))
                    })
                }),
                _ => Element::skip_property(property, source),
            };
            done.map_err(|e| element.error(i, source, e))?;
        }
        // Vertices may follow the faces, which are fans then.
        let at = |i: &u32| Some(mesh.positions.get(*i as usize)?.as_dvec3());
        let points: Option<Vec<DVec3>> = match polygon.len() {
            0..=3 => None,
            _ => polygon.iter().map(at).collect(),
        };
        if let Some(ears) = points.and_then(|points| triangulator.ears(&points)) {
            let corners = ears.iter().map(|ear| ear.map(|k| polygon[k]));
            mesh.triangles.extend(corners);
            continue;
        }
        let fan = polygon
            .windows(2)
            .skip(1)
            .map(|pair| [polygon[0], pair[0], pair[1]]);
        mesh.triangles.extend(fan);
    }
    Ok(triangulator.fans)
}

/// Returns the byte that ends the lines of a header: a carriage return where no line feed follows
/// the first one.
fn line_end(bytes: &[u8]) -> u8 {
    match bytes {
        [b'p', b'l', b'y', b'\r', next, ..] if *next != b'\n' => b'\r',
        _ => b'\n',
    }
}

/// Returns the images that comments of a header name, by the convention of MeshLab.
fn texture_files(bytes: &[u8]) -> Vec<String> {
    let lines = bytes.split(|b| *b == line_end(bytes)).take(MAX_NAMES);
    let lines = lines.map(|line| String::from_utf8_lossy(line).trim().to_owned());
    lines
        .take_while(|line| line != "end_header")
        .filter_map(|line| {
            let comment = line.strip_prefix("comment ")?.trim_start();
            Some(comment.strip_prefix("TextureFile")?.trim().to_owned())
        })
        .filter(|name| !name.is_empty())
        .collect()
}

/// Reads the header; returns its elements and the stream of numbers that follows.
fn header(bytes: &[u8]) -> Result<(Vec<Element>, NumberStream<'_>), PlyError> {
    let mut at = 0;
    let mut number = 0;
    let end = line_end(bytes);
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        number += 1;
        let fail = |problem: &str| Err((format!("line {number}"), problem.to_owned()));
        let Some(length) = bytes[at..].iter().take(4096).position(|b| *b == end) else {
            return fail("the header has no end: expected `end_header`");
        };
        let Ok(line) = std::str::from_utf8(&bytes[at..at + length]) else {
            return fail("the header is not valid UTF-8");
        };
        at += length + 1;
        let words: Vec<&str> = line.split_whitespace().collect();
        let many = elements.len() + elements.last().map_or(0, |e| e.properties.len());
        match words.as_slice() {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return fail("expected `ply`"),
            ["comment" | "obj_info", ..] | [] => {}
            ["format", name, _] => format = Some((*name).to_owned()),
            ["element" | "property", ..] if many >= MAX_NAMES => {
                return fail("the header has too many elements or properties");
            }
            ["element", name, count] => match count.parse() {
                Ok(count) => elements.push(Element {
                    name: (*name).to_owned(),
                    count,
                    properties: Vec::new(),
                }),
                Err(_) => return fail("expected a number of elements"),
            },
            ["property", definition @ ..] => {
                let Some(element) = elements.last_mut() else {
                    return fail("a property precedes all elements");
                };
                match property(definition) {
                    Ok(property) => element.properties.push(property),
                    Err(problem) => return fail(problem),
                }
            }
            ["end_header"] => break,
            _ => return fail("expected format, element, property, comment or end_header"),
        }
    }
    match format
        .as_deref()
        .and_then(|name| NumberStream::new(name, bytes, at))
    {
        Some(source) => Ok((elements, source)),
        None => Err((
            "header".to_owned(),
            "expected the format ascii, binary_little_endian or binary_big_endian".to_owned(),
        )),
    }
}

/// Parses the definition of a property: `TYPE NAME`, or `list TYPE TYPE NAME`.
fn property(definition: &[&str]) -> Result<Property, &'static str> {
    let (length, ty, name) = match definition {
        ["list", length, ty, name] => (
            Some(NumberType::from_name(length)),
            NumberType::from_name(ty),
            name,
        ),
        [ty, name] => (None, NumberType::from_name(ty), name),
        _ => return Err("expected `property TYPE NAME` or `property list TYPE TYPE NAME`"),
    };
    match (length, ty) {
        (Some(None), _) | (_, None) => Err("an unknown type"),
        (length, Some(ty)) => Ok(Property {
            name: (*name).to_owned(),
            length: length.flatten(),
            ty,
        }),
    }
}

#[cfg(test)]
mod tests;
