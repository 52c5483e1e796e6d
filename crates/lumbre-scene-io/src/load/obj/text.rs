//! Checks an OBJ file and rewrites it for `tobj`.
//!
//! `tobj` reports no line numbers, stores a material's name only if it has read an `.mtl` with it,
//! misaligns normals and texture coordinates if only some faces have them, and computes with
//! indices before checking them. Therefore a pass over the text checks every statement, names the
//! line in errors, and rewrites the mesh in a plain subset that avoids these problems: absolute
//! indices, and one `o N` for every run of faces of [`FaceGroup`] `N`. Vertices have colours either
//! all or not at all, and faces of a smoothing group have normals.

mod smoothing;

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::str::FromStr;

use glam::{DVec3, Vec3};

use self::smoothing::SmoothingGroups;
use super::supported::NotedKeywords;
use crate::load::polygon::Triangulator;
use lumbre_light::scene::compile::srgb_to_linear;
use lumbre_light::scene::desc::MAX_COORDINATE;
use lumbre_light::scene::desc::place::mesh_origin;

/// Meaning of smoothing groups (`s`) for faces without normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::load) enum Smoothing {
    /// The faces of a group share normals; all others are flat.
    #[default]
    Groups,
    /// They are ignored: the caller computes normals for the whole mesh.
    Ignored,
}

/// Faces with the same material, where all vertices or none have texture coordinates, and the same
/// for normals.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct FaceGroup {
    /// Name of the material from `usemtl`, or `None` for the default material.
    pub material: Option<String>,
    /// Whether every vertex has texture coordinates.
    pub uvs: bool,
    /// Whether every vertex has a normal.
    pub normals: bool,
    /// Whether the normals are those of a smoothing group, on the side from which the vertices run
    /// counter-clockwise.
    pub smoothed: bool,
}

/// A checked mesh.
#[derive(Debug, Default)]
pub(super) struct CheckedObj {
    /// Positions with their colours, texture coordinates and normals in the plain subset.
    pub vertices: String,
    /// Faces in the plain subset; the name of each object is an index into `groups`.
    pub faces: String,
    /// Point from which the positions count.
    pub origin: DVec3,
    /// Every face group in the file, in order of appearance.
    pub groups: Vec<FaceGroup>,
    /// Arguments of `mtllib` in order, each once.
    pub libraries: Vec<String>,
    /// Notes: place and message.
    pub notes: Vec<(String, String)>,
}

/// A problem with its line.
#[derive(Debug)]
pub(super) struct ObjError {
    /// Line number, counted from 1.
    pub line: usize,
    /// Description of what was found and what was expected.
    pub problem: String,
}

/// Statements without a note: they do not describe the surface, or are handled elsewhere.
const IGNORED: &[&str] = &["vp", "mg"];

/// Checks and rewrites a complete OBJ text.
pub(super) fn check(text: &str, smoothing: Smoothing) -> Result<CheckedObj, ObjError> {
    let mut checker = Checker {
        smoothing,
        ..Checker::default()
    };
    for (_, line) in logical_lines(text) {
        match line.split_whitespace().next() {
            Some("v") => checker.totals[0] += 1,
            Some("vt") => checker.totals[1] += 1,
            Some("vn") => checker.totals[2] += 1,
            _ => {}
        }
    }
    for (number, line) in logical_lines(text) {
        checker.line = number;
        checker.statement(&line).map_err(|problem| ObjError {
            line: number,
            problem,
        })?;
    }
    Ok(checker.finish())
}

/// Returns the arguments of `mtllib` in an OBJ text, each once.
pub(super) fn libraries(text: &str) -> Vec<String> {
    let mut checker = Checker::default();
    for (_, line) in logical_lines(text) {
        if let Some(names) = line.strip_prefix("mtllib") {
            checker.library(names);
        }
    }
    checker.libraries
}

/// Returns logical lines, joined at trailing backslashes, with the number of their first line.
fn logical_lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let body = |raw: &'_ str| -> (usize, bool) {
        let line = raw.trim_end();
        let continues = line.ends_with('\\') && !line.trim_start().starts_with('#');
        (line.len() - usize::from(continues), continues)
    };
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (i, first) = lines.next()?;
        let (length, mut continues) = body(first);
        let mut joined = Cow::from(first[..length].trim_start());
        while continues {
            let Some((_, next)) = lines.next() else { break };
            let (length, more) = body(next);
            joined.to_mut().push(' ');
            joined.to_mut().push_str(next[..length].trim_start());
            continues = more;
        }
        Some((i + 1, joined))
    })
}

/// A face vertex as written: position, texture coordinate and normal, as indices from 0.
type Corner = [Option<usize>; 3];

/// State of the pass over the text.
#[derive(Default)]
struct Checker {
    line: usize,
    /// Total numbers of `v`, `vt` and `vn` in the file.
    totals: [usize; 3],
    /// Numbers read so far, from which negative indices count back.
    read: [usize; 3],
    /// Texture coordinates and normals in the plain subset.
    vertices: String,
    faces: String,
    positions: Vec<DVec3>,
    /// Colours as written, one per position, or empty as long as no position has one.
    colors: Vec<Vec3>,
    groups: Vec<FaceGroup>,
    group_indices: BTreeMap<FaceGroup, usize>,
    material: Option<String>,
    smoothing: Smoothing,
    smooth: SmoothingGroups,
    triangulator: Triangulator,
    current: Option<usize>,
    /// Number of occurrences of each [`Problem`], with the line of the first.
    counts: [(usize, usize); PROBLEMS.len()],
    noted_keywords: NotedKeywords,
    libraries: Vec<String>,
    /// Set of the names in `libraries`.
    library_names: BTreeSet<String>,
    notes: Vec<(String, String)>,
}

/// Problems that are counted, in the order of [`PROBLEMS`].
enum Problem {
    LinesAndPoints,
    ShortFaces,
    ConcaveFaces,
    BadUvs,
    BadNormals,
    Nameless,
    PartialFaces,
    Painted,
    ByteColors,
    Weights,
}

/// Notes on the problems, in their order.
const PROBLEMS: [&str; 10] = [
    "line and point elements, which have no surface, are ignored",
    "faces with fewer than three vertices are left out",
    "concave polygons whose edges intersect, or too many to triangulate otherwise, are \
     fans from their first vertex, which cover too much",
    "texture coordinates that are not finite are replaced by (0, 0)",
    "normals without a direction are replaced by the normal of the face",
    "`usemtl` without a name selects the default material",
    "normals or texture coordinates of only some vertices of a face are ignored",
    "colours of vertices in comments `#MRGB` are not supported; ignored",
    "colours of vertices exceed 1; all are divided by 255",
    "weights of vertices belong to free-form surfaces; ignored",
];

impl Checker {
    /// Counts an occurrence of a problem in this line.
    fn record(&mut self, problem: Problem) {
        let (count, first) = &mut self.counts[problem as usize];
        if *count == 0 {
            *first = self.line;
        }
        *count += 1;
    }

    /// Checks a statement.
    fn statement(&mut self, line: &str) -> Result<(), String> {
        // A comment may follow numbers; names may contain a `#`.
        let numbers = line.split('#').next().unwrap_or_default();
        let mut words = numbers.split_whitespace();
        let Some(keyword) = words.next() else {
            if line.starts_with("#MRGB ") {
                self.record(Problem::Painted);
            }
            return Ok(());
        };
        match keyword {
            "v" => self.position(words),
            "vt" => self.texture_coordinate(words),
            "vn" => self.normal(words),
            "f" | "fo" => self.face(words),
            "l" | "p" => {
                self.record(Problem::LinesAndPoints);
                Ok(())
            }
            // Names of objects and groups leave the material and the smoothing group as they are.
            "o" | "g" => Ok(()),
            "s" => {
                if self.smoothing == Smoothing::Groups {
                    self.smooth.select(words.next());
                }
                Ok(())
            }
            "usemtl" => {
                let name = line["usemtl".len()..].trim();
                if name.is_empty() {
                    self.record(Problem::Nameless);
                }
                self.material = (!name.is_empty()).then(|| name.to_owned());
                Ok(())
            }
            "mtllib" => {
                self.library(&line["mtllib".len()..]);
                Ok(())
            }
            _ if IGNORED.contains(&keyword) => Ok(()),
            other => {
                if let Some(problem) = self.noted_keywords.note(other) {
                    self.notes.push((format!("line {}", self.line), problem));
                }
                Ok(())
            }
        }
    }

    /// Adds the argument of an `mtllib` statement.
    fn library(&mut self, names: &str) {
        let names = names.trim().to_owned();
        if !names.is_empty() && self.library_names.insert(names.clone()) {
            self.libraries.push(names);
        }
    }

    /// Reads a `v` statement.
    fn position<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), String> {
        let words: Vec<&str> = words.take(6).collect();
        if words.len() < 3 {
            return Err(format!(
                "a vertex needs 3 coordinates, found {}",
                words.len()
            ));
        }
        // A fourth number alone is the weight of a point of free-form surfaces, which polygons do not
        // use; three more numbers are a colour.
        if words.len() == 4 && float(words[3])? != 1.0 {
            self.record(Problem::Weights);
        }
        let mut p = [0.0; 3];
        for (x, word) in p.iter_mut().zip(&words) {
            *x = double(word)?;
        }
        if !p.iter().all(|x| x.abs() <= f64::from(MAX_COORDINATE)) {
            return Err(format!(
                "the vertex ({}) is not finite, or exceeds the greatest coordinate \
                 {MAX_COORDINATE:e}",
                words[..words.len().min(4)].join(" ")
            ));
        }
        if let [_, _, _, r, g, b] = words[..] {
            self.color([r, g, b])?;
        } else if !self.colors.is_empty() {
            self.colors.push(Vec3::ONE);
        }
        self.read[0] += 1;
        self.positions.push(DVec3::from_array(p));
        Ok(())
    }

    /// Reads the colour of the next position.
    fn color(&mut self, words: [&str; 3]) -> Result<(), String> {
        let mut color = [0.0; 3];
        for (x, word) in color.iter_mut().zip(words) {
            *x = float(word)?;
        }
        if !color.iter().all(|x| x.is_finite()) {
            return Err(format!("the colour ({}) is not finite", words.join(" ")));
        }
        if color.iter().any(|x| *x > 1.0) {
            self.record(Problem::ByteColors);
        }
        // Positions without a colour are white.
        self.colors.resize(self.positions.len(), Vec3::ONE);
        self.colors.push(Vec3::from_array(color));
        Ok(())
    }

    /// Appends positions, in linear colours if any has one. Colours are in sRGB, as programs
    /// that paint and scan meshes write them.
    fn write_positions(&self, positions: &[Vec3], text: &mut String) {
        let most = if self.counts[Problem::ByteColors as usize].0 > 0 {
            255.0
        } else {
            1.0
        };
        for (i, p) in positions.iter().enumerate() {
            match self.colors.get(i) {
                Some(color) => {
                    let linear = (*color / most)
                        .clamp(Vec3::ZERO, Vec3::ONE)
                        .map(srgb_to_linear);
                    let [x, y, z] = p.to_array();
                    let [r, g, b] = linear.to_array();
                    push_numbers(text, "v", &[x, y, z, r, g, b]);
                }
                None => push_numbers(text, "v", &p.to_array()),
            }
        }
    }

    /// Reads a `vt` statement.
    fn texture_coordinate<'a>(
        &mut self,
        words: impl Iterator<Item = &'a str>,
    ) -> Result<(), String> {
        let mut uv = [0.0; 2];
        let mut found = 0;
        for (x, word) in uv.iter_mut().zip(words) {
            *x = float(word)?;
            found += 1;
        }
        if found == 0 {
            return Err("a texture coordinate needs at least 1 number, found 0".to_owned());
        }
        if !uv.iter().all(|x| x.is_finite()) {
            self.record(Problem::BadUvs);
            uv = [0.0; 2];
        }
        self.read[1] += 1;
        push_numbers(&mut self.vertices, "vt", &uv);
        Ok(())
    }

    /// Reads a `vn` statement.
    fn normal<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), String> {
        let mut n = [0.0f32; 3];
        let mut found = 0;
        for (x, word) in n.iter_mut().zip(words) {
            *x = float(word)?;
            found += 1;
        }
        if found < 3 {
            return Err(format!("a normal needs 3 numbers, found {found}"));
        }
        let length = n.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        let unit = n.map(|x| (f64::from(x) / length) as f32);
        if !unit.iter().all(|x| x.is_finite()) {
            self.record(Problem::BadNormals);
            n = [0.0; 3];
        } else {
            n = unit;
        }
        self.read[2] += 1;
        push_numbers(&mut self.vertices, "vn", &n);
        Ok(())
    }

    /// Reads an `f` statement.
    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), String> {
        let mut corners: Vec<Corner> = words.map(|w| self.corner(w)).collect::<Result<_, _>>()?;
        if corners.len() < 3 {
            self.record(Problem::ShortFaces);
            return Ok(());
        }
        let all = |k: usize| corners.iter().all(|c| c[k].is_some());
        let some = |k: usize| corners.iter().any(|c| c[k].is_some());
        let (uvs, mut normals) = (all(1), all(2));
        if (some(1) && !uvs) || (some(2) && !normals) {
            self.record(Problem::PartialFaces);
        }
        let polygon: Vec<usize> = corners.iter().filter_map(|c| c[0]).collect();
        let ears = self.ears(&polygon);
        let mut smoothed = false;
        if !normals && let Some(smooth) = self.smooth.add(&polygon, ears.as_deref()) {
            // They follow the normals of the file.
            for (corner, n) in corners.iter_mut().zip(smooth) {
                corner[2] = Some(self.totals[2] + n as usize);
            }
            (normals, smoothed) = (true, true);
        }
        let group = self.group(FaceGroup {
            material: self.material.clone(),
            uvs,
            normals,
            smoothed,
        });
        if self.current != Some(group) {
            self.current = Some(group);
            // Writing to a string cannot fail.
            let _ = writeln!(self.faces, "o {group}");
        }
        match ears {
            None => self.write_face(corners.iter(), [uvs, normals]),
            Some(ears) => ears
                .iter()
                .for_each(|ear| self.write_face(ear.iter().map(|i| &corners[*i]), [uvs, normals])),
        }
        Ok(())
    }

    /// Appends a face with the indices of its texture coordinates and normals, if they are used.
    fn write_face<'a>(
        &mut self,
        corners: impl Iterator<Item = &'a Corner>,
        [uvs, normals]: [bool; 2],
    ) {
        self.faces.push('f');
        for [v, vt, vn] in corners {
            let index = |i: Option<usize>, used: bool| match i {
                Some(i) if used => (i + 1).to_string(),
                _ => String::new(),
            };
            let _ = write!(
                self.faces,
                " {}/{}/{}",
                index(*v, true),
                index(*vt, uvs),
                index(*vn, normals)
            );
        }
        self.faces.push('\n');
    }

    /// Returns the index of a face group, which is added if it is new.
    fn group(&mut self, group: FaceGroup) -> usize {
        // Faces of one group come in runs, so the current group matches nearly always.
        if let Some(current) = self.current
            && self.groups[current] == group
        {
            return current;
        }
        *self.group_indices.entry(group.clone()).or_insert_with(|| {
            self.groups.push(group);
            self.groups.len() - 1
        })
    }

    /// Parses a face vertex: one to three indices, separated by slashes.
    fn corner(&self, word: &str) -> Result<Corner, String> {
        const NAMES: [&str; 3] = ["vertex", "texture coordinate", "normal"];
        let mut corner: Corner = [None; 3];
        for (k, part) in word.split('/').enumerate() {
            if k > 2 {
                return Err(format!(
                    "the face vertex `{word}` has more than three indices"
                ));
            }
            if part.is_empty() {
                continue;
            }
            let i: i64 = part
                .parse()
                .map_err(|_| format!("`{part}` in the face vertex `{word}` is not an index"))?;
            let absolute = if i > 0 {
                i - 1
            } else {
                self.read[k] as i64 + i
            };
            if i == 0 || absolute < 0 || absolute >= self.totals[k] as i64 {
                return Err(format!(
                    "{} index {i} is out of range: the file has {}; indices count from 1, negative \
                     ones back from the current line",
                    NAMES[k], self.totals[k]
                ));
            }
            corner[k] = Some(absolute as usize);
        }
        if corner[0].is_none() {
            return Err(format!("the face vertex `{word}` has no position index"));
        }
        Ok(corner)
    }

    /// Returns the triangles of a concave polygon; `None` for others, which `tobj` triangulates.
    fn ears(&mut self, polygon: &[usize]) -> Option<Vec<[usize; 3]>> {
        let at = |i: &usize| self.positions.get(*i).copied();
        let points: Vec<DVec3> = polygon.iter().map(at).collect::<Option<_>>()?;
        let fans = self.triangulator.fans;
        let ears = self.triangulator.ears(&points);
        if self.triangulator.fans > fans {
            self.record(Problem::ConcaveFaces);
        }
        ears
    }

    /// Returns the result with all notes.
    fn finish(mut self) -> CheckedObj {
        let mut vertices = String::new();
        let origin = mesh_origin(self.positions.iter().copied());
        let relative = self.positions.iter().map(|p| (*p - origin).as_vec3());
        let positions: Vec<Vec3> = relative.collect();
        self.write_positions(&positions, &mut vertices);
        vertices.push_str(&std::mem::take(&mut self.vertices));
        for n in self.smooth.normals(&positions) {
            push_numbers(&mut vertices, "vn", &n.to_array());
        }
        for ((n, line), message) in self.counts.into_iter().zip(PROBLEMS) {
            if n > 0 {
                self.notes
                    .push((format!("line {line}"), format!("{message}: {n}")));
            }
        }
        if self.groups.is_empty() {
            self.notes
                .push(("whole file".to_owned(), "the mesh has no faces".to_owned()));
        }
        let Checker {
            faces,
            groups,
            libraries,
            notes,
            ..
        } = self;
        CheckedObj {
            vertices,
            faces,
            origin,
            groups,
            libraries,
            notes,
        }
    }
}

/// Parses a number in single precision.
fn float(word: &str) -> Result<f32, String> {
    parsed(word)
}

/// Parses a number in double precision.
fn double(word: &str) -> Result<f64, String> {
    parsed(word)
}

/// Parses a number.
fn parsed<T: FromStr>(word: &str) -> Result<T, String> {
    word.parse().map_err(|_| {
        let shown: String = word.chars().take(24).collect();
        format!("`{shown}` is not a number")
    })
}

/// Appends a statement of numbers.
fn push_numbers(text: &mut String, keyword: &str, numbers: &[f32]) {
    text.push_str(keyword);
    for x in numbers {
        // `{x}` is the shortest decimal that parses to the same float. Writing to a string cannot
        // fail.
        let _ = write!(text, " {x}");
    }
    text.push('\n');
}

#[cfg(test)]
mod tests;
