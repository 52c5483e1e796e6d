//! Checks an OBJ file and rewrites it for `tobj`.
//!
//! `tobj` reports no line numbers, stores a material's name only if it has read an `.mtl` with it,
//! misaligns normals and texture coordinates if only some faces have them, and computes with
//! indices before checking them. Therefore a pass over the text checks every statement, names the
//! line in errors, and rewrites the mesh in a plain subset that avoids these problems: absolute
//! indices, and one `o N` for every run of faces of [`FaceGroup`] `N`.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use super::supported::NotedKeywords;
use crate::scene::desc::MAX_COORDINATE;

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
}

/// A checked mesh.
#[derive(Debug, Default)]
pub(super) struct CheckedObj {
    /// Positions, texture coordinates and normals in the plain subset.
    pub vertices: String,
    /// Faces in the plain subset; the name of each object is an index into `groups`.
    pub faces: String,
    /// Every face group in the file, in order of appearance.
    pub groups: Vec<FaceGroup>,
    /// Names of material files in order, each once.
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
const IGNORED: &[&str] = &["s", "vp", "mg"];

/// Checks and rewrites a complete OBJ text.
pub(super) fn check(text: &str) -> Result<CheckedObj, ObjError> {
    let mut checker = Checker::default();
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
    vertices: String,
    faces: String,
    positions: Vec<[f32; 3]>,
    groups: Vec<FaceGroup>,
    group_indices: BTreeMap<FaceGroup, usize>,
    material: Option<String>,
    faces_since_material: bool,
    current: Option<usize>,
    counts: Occurrences,
    noted_keywords: NotedKeywords,
    libraries: Vec<String>,
    /// Set of the names in `libraries`.
    library_names: BTreeSet<String>,
    notes: Vec<(String, String)>,
}

/// Number of occurrences of each problem, with the line of the first.
#[derive(Default)]
struct Occurrences {
    lines_and_points: (usize, usize),
    short_faces: (usize, usize),
    concave_faces: (usize, usize),
    bad_uvs: (usize, usize),
    bad_normals: (usize, usize),
    partial_faces: (usize, usize),
    nameless: (usize, usize),
}

/// Counts an occurrence in a line.
fn record(counter: &mut (usize, usize), line: usize) {
    if counter.0 == 0 {
        counter.1 = line;
    }
    counter.0 += 1;
}

impl Checker {
    /// Checks a statement.
    fn statement(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next() else {
            return Ok(());
        };
        if keyword.starts_with('#') {
            return Ok(());
        }
        match keyword {
            "v" => self.position(words),
            "vt" => self.texture_coordinate(words),
            "vn" => self.normal(words),
            "f" | "fo" => self.face(words),
            "l" | "p" => {
                record(&mut self.counts.lines_and_points, self.line);
                Ok(())
            }
            "o" | "g" => {
                if self.faces_since_material {
                    self.material = None;
                    self.faces_since_material = false;
                }
                Ok(())
            }
            "usemtl" => {
                let name = line["usemtl".len()..].trim();
                if name.is_empty() {
                    record(&mut self.counts.nameless, self.line);
                }
                self.material = (!name.is_empty()).then(|| name.to_owned());
                self.faces_since_material = false;
                Ok(())
            }
            "mtllib" => {
                let name = line["mtllib".len()..].trim().to_owned();
                if !name.is_empty() && self.library_names.insert(name.clone()) {
                    self.libraries.push(name);
                }
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

    /// Reads a `v` statement.
    fn position<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), String> {
        let words: Vec<&str> = words.take(5).collect();
        if words.len() < 3 {
            return Err(format!(
                "a vertex needs 3 coordinates, found {}",
                words.len()
            ));
        }
        // A fourth number alone is the homogeneous weight; more numbers are colours, which are not
        // supported.
        let weight = if words.len() == 4 {
            float(words[3])?
        } else {
            1.0
        };
        let mut p = [0.0; 3];
        for (x, word) in p.iter_mut().zip(&words) {
            *x = float(word)? / weight;
        }
        if !p.iter().all(|x| x.abs() <= MAX_COORDINATE) {
            return Err(format!(
                "the vertex ({}) is not finite, or exceeds the greatest coordinate \
                 {MAX_COORDINATE:e}",
                words[..words.len().min(4)].join(" ")
            ));
        }
        self.read[0] += 1;
        self.positions.push(p);
        push_numbers(&mut self.vertices, "v", &p);
        Ok(())
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
            record(&mut self.counts.bad_uvs, self.line);
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
            record(&mut self.counts.bad_normals, self.line);
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
        let corners: Vec<Corner> = words.map(|w| self.corner(w)).collect::<Result<_, _>>()?;
        self.faces_since_material = true;
        if corners.len() < 3 {
            record(&mut self.counts.short_faces, self.line);
            return Ok(());
        }
        let all = |k: usize| corners.iter().all(|c| c[k].is_some());
        let some = |k: usize| corners.iter().any(|c| c[k].is_some());
        let (uvs, normals) = (all(1), all(2));
        if (some(1) && !uvs) || (some(2) && !normals) {
            record(&mut self.counts.partial_faces, self.line);
        }
        if self.is_concave(&corners) {
            record(&mut self.counts.concave_faces, self.line);
        }
        let group = self.group(FaceGroup {
            material: self.material.clone(),
            uvs,
            normals,
        });
        if self.current != Some(group) {
            self.current = Some(group);
            // Writing to a string cannot fail.
            let _ = writeln!(self.faces, "o {group}");
        }
        self.faces.push('f');
        for [v, vt, vn] in corners {
            let index = |i: Option<usize>, used: bool| match i {
                Some(i) if used => (i + 1).to_string(),
                _ => String::new(),
            };
            let _ = write!(
                self.faces,
                " {}/{}/{}",
                index(v, true),
                index(vt, uvs),
                index(vn, normals)
            );
        }
        self.faces.push('\n');
        Ok(())
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

    /// Returns whether a fan from the first vertex covers more than the polygon.
    fn is_concave(&self, corners: &[Corner]) -> bool {
        if corners.len() < 4 {
            return false;
        }
        let at = |c: &Corner| {
            c[0].and_then(|i| self.positions.get(i))
                .map(|p| glam::Vec3::from(*p).as_dvec3())
        };
        let Some(points) = corners.iter().map(at).collect::<Option<Vec<_>>>() else {
            return false;
        };
        let crosses: Vec<glam::DVec3> = points[1..]
            .windows(2)
            .map(|w| (w[0] - points[0]).cross(w[1] - points[0]))
            .collect();
        let sum: glam::DVec3 = crosses.iter().sum();
        crosses
            .iter()
            .any(|c| c.dot(sum) < -1e-6 * sum.length_squared())
    }

    /// Returns the result with all notes.
    fn finish(mut self) -> CheckedObj {
        let c = &self.counts;
        let notes = [
            (
                c.lines_and_points,
                "line and point elements, which have no surface, are ignored",
            ),
            (
                c.short_faces,
                "faces with fewer than three vertices are left out",
            ),
            (
                c.concave_faces,
                "concave polygons are triangulated as fans from their first vertex, which covers \
                 too much",
            ),
            (
                c.bad_uvs,
                "texture coordinates that are not finite are replaced by (0, 0)",
            ),
            (
                c.bad_normals,
                "normals without a direction are replaced by the normal of the face",
            ),
            (
                c.nameless,
                "`usemtl` without a name selects the default material",
            ),
            (
                c.partial_faces,
                "normals or texture coordinates of only some vertices of a face are ignored",
            ),
        ];
        for ((n, line), message) in notes {
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
            vertices,
            faces,
            groups,
            libraries,
            notes,
            ..
        } = self;
        CheckedObj {
            vertices,
            faces,
            groups,
            libraries,
            notes,
        }
    }
}

/// Parses a number.
fn float(word: &str) -> Result<f32, String> {
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
mod tests {
    use super::*;

    #[test]
    fn materials_follow_usemtl_and_are_reset_by_objects_after_faces() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red paint\no first\nf 1 2 3\no second\nf 1 2 \
                    3\nusemtl a\ng g\nf 1 2 3\n";
        let names: Vec<Option<String>> = check(text)
            .unwrap()
            .groups
            .into_iter()
            .map(|g| g.material)
            .collect();
        assert_eq!(
            names,
            [Some("red paint".to_owned()), None, Some("a".to_owned())]
        );
    }

    #[test]
    fn errors_name_their_line() {
        let cases = [
            ("v 0 0\n", 1, "3 coordinates"),
            ("v 0 0 0\nv a 0 0\n", 2, "`a` is not a number"),
            ("v 0 nan 0\n", 1, "not finite"),
            ("v 0 0 0 0\n", 1, "not finite"),
            ("v 0 0 0\r\nf 1 2 3\r\n", 2, "index 2 is out of range"),
            ("v 0 0 0\nf 0 1 1\n", 2, "index 0"),
            ("v 0 0 0\nf -2 1 1\n", 2, "index -2"),
            ("v 0 0 0\nf 1/1 1/1 1/1\n", 2, "texture coordinate index 1"),
            ("v 0 0 0\nf 1//9 1//9 1//9\n", 2, "normal index 9"),
            ("v 0 0 0\nf 1//// 1 1\n", 2, "more than three"),
            ("v 0 0 0\nf 9223372036854775807 1 1\n", 2, "out of range"),
            ("v 0 0 0\nf -9223372036854775808 1 1\n", 2, "out of range"),
            ("v 0 0 0\nf 1e3 1 1\n", 2, "not an index"),
            ("vn 0 1\n", 1, "found 2"),
        ];
        for (text, line, part) in cases {
            let error = check(text).unwrap_err();
            assert_eq!(error.line, line, "{text:?}");
            assert!(error.problem.contains(part), "{text:?}: {}", error.problem);
        }
    }

    #[test]
    fn unusual_but_valid_files_are_read() {
        let text = "v 0 0 0\nv 2 0 0 2\nv 0 1 0 1 0 0\nvt 0.5\nf 1/1 \\\n 2/1 3/1\nf -3 -2 -1\nf 4 \
                    1 2\nv 1 1 1\n";
        let c = check(text).unwrap();
        assert!(
            c.vertices.contains("v 1 0 0\n"),
            "the weight divides: {}",
            c.vertices
        );
        assert!(
            c.faces.contains("f 1/1/ 2/1/ 3/1/\n") && c.faces.contains("f 4// 1// 2//\n"),
            "{}",
            c.faces
        );
        assert_eq!(c.groups.len(), 2);
        assert!(c.notes.is_empty(), "{:?}", c.notes);
    }

    #[test]
    fn ignored_statements_are_noted() {
        let text = "v 0 0 0\nv 2 0 0\nv 0.1 0.1 0\nv 0 2 0\nvn 0 0 0\nvt nan 0\nl 1 2\np 1\nf 1 \
                    2\nf 2 3 4 1\nf 1//1 2 3\ncurv 0 1\ncurv 0 1\n";
        let notes = check(text).unwrap().notes;
        let all: Vec<String> = notes.iter().map(|(p, m)| format!("{p}: {m}")).collect();
        for part in [
            "line 7: line and point elements, which have no surface, are ignored: 2",
            "line 9: faces with fewer than three vertices are left out: 1",
            "line 12: statements `curv`",
            "line 11: normals or texture coordinates of only some",
        ] {
            assert!(all.iter().any(|n| n.contains(part)), "{part} in {all:?}");
        }
        for part in [
            "normals without a direction",
            "texture coordinates that are not finite",
        ] {
            assert!(all.iter().any(|n| n.contains(part)), "{part} in {all:?}");
        }
        assert_eq!(all.iter().filter(|n| n.contains("curv")).count(), 1);
    }

    #[test]
    fn a_concave_polygon_is_noted_unless_its_fan_covers_it_exactly() {
        let dart = "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 0.5 1 0\n";
        let noted = |faces: &str| {
            check(&format!("{dart}{faces}"))
                .unwrap()
                .notes
                .iter()
                .any(|(_, m)| m.contains("concave"))
        };
        assert!(noted("f 1 2 3 4\n"));
        assert!(
            !noted("f 4 1 2 3\n"),
            "a fan from the inner corner covers exactly the dart"
        );
    }
}
