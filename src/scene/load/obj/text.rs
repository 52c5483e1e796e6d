//! What must be known about an OBJ file before `tobj` reads it.
//!
//! `tobj` reports no lines, keeps a material's name only if it has read an `.mtl` with it, misaligns normals and
//! texture coordinates when only some faces have them, and computes with indices before it checks them. So one pass
//! over the text checks every statement, gives names to errors, and writes the same mesh again in the plain subset
//! in which none of that matters: absolute indices, and one `o N` for every run of faces of [`Group`] `N`.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use crate::scene::desc::MAX_COORDINATE;

/// A kind of faces: the same material, and either all corners or none with texture coordinates and normals.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Group {
    /// The name that `usemtl` gave, or `None` for the default material.
    pub material: Option<String>,
    /// Whether every corner has texture coordinates.
    pub uvs: bool,
    /// Whether every corner has a normal.
    pub normals: bool,
}

/// A checked mesh.
#[derive(Debug, Default)]
pub(super) struct Checked {
    /// The points, texture coordinates and normals in the plain subset.
    pub vertices: String,
    /// Its faces, which follow; the name of each object is an index into `groups`.
    pub faces: String,
    /// Every kind of face in the file, in order of appearance.
    pub groups: Vec<Group>,
    /// Names of material files, in order, each once.
    pub libraries: Vec<String>,
    /// What was left out or replaced: place and message.
    pub notes: Vec<(String, String)>,
}

/// What is wrong, and in which line.
#[derive(Debug)]
pub(super) struct Fault {
    /// Line number, counted from 1.
    pub line: usize,
    /// What was found and what was expected.
    pub problem: String,
}

/// Statements that say nothing about the surface or are handled elsewhere.
const SILENT: &[&str] = &["s", "vp", "mg"];

/// Checks a whole OBJ text.
pub(super) fn check(text: &str) -> Result<Checked, Fault> {
    let mut pass = Pass::default();
    for (_, line) in logical_lines(text) {
        match line.split_whitespace().next() {
            Some("v") => pass.totals[0] += 1,
            Some("vt") => pass.totals[1] += 1,
            Some("vn") => pass.totals[2] += 1,
            _ => {}
        }
    }
    for (number, line) in logical_lines(text) {
        pass.line = number;
        pass.statement(&line).map_err(|problem| Fault { line: number, problem })?;
    }
    Ok(pass.finish())
}

/// Lines with their numbers, after joining those that end in a backslash.
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
        let mut whole = Cow::from(first[..length].trim_start());
        while continues {
            let Some((_, next)) = lines.next() else { break };
            let (length, more) = body(next);
            whole.to_mut().push(' ');
            whole.to_mut().push_str(next[..length].trim_start());
            continues = more;
        }
        Some((i + 1, whole))
    })
}

/// One corner as written: position, texture coordinate, normal, as indices from 0.
type Corner = [Option<usize>; 3];

#[derive(Default)]
struct Pass {
    line: usize,
    /// How many `v`, `vt`, `vn` the whole file has.
    totals: [usize; 3],
    /// How many have been read so far: negative indices count back from here.
    seen: [usize; 3],
    vertices: String,
    faces: String,
    positions: Vec<[f32; 3]>,
    groups: Vec<Group>,
    group_of: BTreeMap<Group, usize>,
    material: Option<String>,
    faces_since_material: bool,
    current: Option<usize>,
    counts: Counts,
    ignored: Vec<String>,
    libraries: Vec<String>,
    /// The same, to be looked up.
    named: BTreeSet<String>,
    notes: Vec<(String, String)>,
}

/// Things left out or replaced, with the line of the first.
#[derive(Default)]
struct Counts {
    lines_and_points: (usize, usize),
    short_faces: (usize, usize),
    concave_faces: (usize, usize),
    bad_uvs: (usize, usize),
    bad_normals: (usize, usize),
    partial_faces: (usize, usize),
    nameless: (usize, usize),
}

fn count(counter: &mut (usize, usize), line: usize) {
    if counter.0 == 0 {
        counter.1 = line;
    }
    counter.0 += 1;
}

impl Pass {
    fn statement(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next() else { return Ok(()) };
        if keyword.starts_with('#') {
            return Ok(());
        }
        match keyword {
            "v" => self.position(words),
            "vt" => self.texture_coordinate(words),
            "vn" => self.normal(words),
            "f" | "fo" => self.face(words),
            "l" | "p" => {
                count(&mut self.counts.lines_and_points, self.line);
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
                    count(&mut self.counts.nameless, self.line);
                }
                self.material = (!name.is_empty()).then(|| name.to_owned());
                self.faces_since_material = false;
                Ok(())
            }
            "mtllib" => {
                let name = line["mtllib".len()..].trim().to_owned();
                if !name.is_empty() && self.named.insert(name.clone()) {
                    self.libraries.push(name);
                }
                Ok(())
            }
            _ if SILENT.contains(&keyword) => Ok(()),
            other => {
                if self.ignored.iter().all(|k| k != other) && self.ignored.len() < 16 {
                    let shown: String = other.chars().take(24).collect();
                    self.notes
                        .push((format!("line {}", self.line), format!("statements `{shown}` are not read: ignored")));
                    self.ignored.push(other.to_owned());
                }
                Ok(())
            }
        }
    }

    fn position<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), String> {
        let words: Vec<&str> = words.take(5).collect();
        if words.len() < 3 {
            return Err(format!("a vertex needs 3 coordinates, found {}", words.len()));
        }
        // A fourth number alone is the homogeneous weight; more are colours, which are not read.
        let weight = if words.len() == 4 { float(words[3])? } else { 1.0 };
        let mut p = [0.0; 3];
        for (x, word) in p.iter_mut().zip(&words) {
            *x = float(word)? / weight;
        }
        if !p.iter().all(|x| x.abs() <= MAX_COORDINATE) {
            return Err(format!(
                "the vertex ({}) is not finite or lies beyond {MAX_COORDINATE:e}",
                words[..words.len().min(4)].join(" ")
            ));
        }
        self.seen[0] += 1;
        self.positions.push(p);
        push_numbers(&mut self.vertices, "v", &p);
        Ok(())
    }

    fn texture_coordinate<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), String> {
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
            count(&mut self.counts.bad_uvs, self.line);
            uv = [0.0; 2];
        }
        self.seen[1] += 1;
        push_numbers(&mut self.vertices, "vt", &uv);
        Ok(())
    }

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
            count(&mut self.counts.bad_normals, self.line);
            n = [0.0; 3];
        } else {
            n = unit;
        }
        self.seen[2] += 1;
        push_numbers(&mut self.vertices, "vn", &n);
        Ok(())
    }

    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), String> {
        let corners: Vec<Corner> = words.map(|w| self.corner(w)).collect::<Result<_, _>>()?;
        self.faces_since_material = true;
        if corners.len() < 3 {
            count(&mut self.counts.short_faces, self.line);
            return Ok(());
        }
        let all = |k: usize| corners.iter().all(|c| c[k].is_some());
        let some = |k: usize| corners.iter().any(|c| c[k].is_some());
        let (uvs, normals) = (all(1), all(2));
        if (some(1) && !uvs) || (some(2) && !normals) {
            count(&mut self.counts.partial_faces, self.line);
        }
        if self.is_concave(&corners) {
            count(&mut self.counts.concave_faces, self.line);
        }
        let group = self.group(Group { material: self.material.clone(), uvs, normals });
        if self.current != Some(group) {
            self.current = Some(group);
            // Writing to a string cannot fail.
            let _ = writeln!(self.faces, "o {group}");
        }
        self.faces.push('f');
        for [v, vt, vn] in corners {
            let one = |i: Option<usize>, used: bool| match i {
                Some(i) if used => (i + 1).to_string(),
                _ => String::new(),
            };
            let _ = write!(self.faces, " {}/{}/{}", one(v, true), one(vt, uvs), one(vn, normals));
        }
        self.faces.push('\n');
        Ok(())
    }

    fn group(&mut self, group: Group) -> usize {
        // Faces of one kind come in runs, so the last group is nearly always the one.
        if let Some(current) = self.current
            && self.groups[current] == group
        {
            return current;
        }
        *self.group_of.entry(group.clone()).or_insert_with(|| {
            self.groups.push(group);
            self.groups.len() - 1
        })
    }

    fn corner(&self, word: &str) -> Result<Corner, String> {
        const NAMES: [&str; 3] = ["vertex", "texture coordinate", "normal"];
        let mut corner: Corner = [None; 3];
        for (k, part) in word.split('/').enumerate() {
            if k > 2 {
                return Err(format!("the corner `{word}` has more than three indices"));
            }
            if part.is_empty() {
                continue;
            }
            let i: i64 = part.parse().map_err(|_| format!("`{part}` in the corner `{word}` is no index"))?;
            let absolute = if i > 0 { i - 1 } else { self.seen[k] as i64 + i };
            if i == 0 || absolute < 0 || absolute >= self.totals[k] as i64 {
                return Err(format!(
                    "{} index {i} is out of range: the file has {} of them, counted from 1 (negative: back from here)",
                    NAMES[k], self.totals[k]
                ));
            }
            corner[k] = Some(absolute as usize);
        }
        if corner[0].is_none() {
            return Err(format!("the corner `{word}` names no vertex"));
        }
        Ok(corner)
    }

    /// Whether a fan from the first corner covers more than the polygon does.
    fn is_concave(&self, corners: &[Corner]) -> bool {
        if corners.len() < 4 {
            return false;
        }
        let at = |c: &Corner| c[0].and_then(|i| self.positions.get(i)).map(|p| glam::Vec3::from(*p).as_dvec3());
        let Some(points) = corners.iter().map(at).collect::<Option<Vec<_>>>() else { return false };
        let crosses: Vec<glam::DVec3> =
            points[1..].windows(2).map(|w| (w[0] - points[0]).cross(w[1] - points[0])).collect();
        let sum: glam::DVec3 = crosses.iter().sum();
        crosses.iter().any(|c| c.dot(sum) < -1e-6 * sum.length_squared())
    }

    fn finish(mut self) -> Checked {
        let c = &self.counts;
        let rows = [
            (c.lines_and_points, "line and point elements, which have no surface, are ignored"),
            (c.short_faces, "faces with fewer than three corners are left out"),
            (c.concave_faces, "concave polygons are cut as fans from their first corner, which covers too much"),
            (c.bad_uvs, "texture coordinates that are not finite are replaced by (0, 0)"),
            (c.bad_normals, "normals without a direction are replaced by the face's own"),
            (c.nameless, "`usemtl` without a name means the default material"),
            (c.partial_faces, "normals or texture coordinates of only some corners of a face are ignored"),
        ];
        for ((n, line), message) in rows {
            if n > 0 {
                self.notes.push((format!("line {line}"), format!("{message}: {n}")));
            }
        }
        if self.groups.is_empty() {
            self.notes.push(("whole file".to_owned(), "it has no faces".to_owned()));
        }
        let Pass { vertices, faces, groups, libraries, notes, .. } = self;
        Checked { vertices, faces, groups, libraries, notes }
    }
}

fn float(word: &str) -> Result<f32, String> {
    word.parse().map_err(|_| {
        let shown: String = word.chars().take(24).collect();
        format!("`{shown}` is no number")
    })
}

fn push_numbers(text: &mut String, keyword: &str, numbers: &[f32]) {
    text.push_str(keyword);
    for x in numbers {
        // The shortest decimal that reads back as the same float; writing to a string cannot fail.
        let _ = write!(text, " {x}");
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_follow_usemtl_and_are_reset_by_objects_after_faces() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red paint\no first\nf 1 2 3\no second\nf 1 2 3\nusemtl a\ng g\nf 1 2 3\n";
        let names: Vec<Option<String>> = check(text).unwrap().groups.into_iter().map(|g| g.material).collect();
        assert_eq!(names, [Some("red paint".to_owned()), None, Some("a".to_owned())]);
    }

    #[test]
    fn faults_name_their_line() {
        let cases = [
            ("v 0 0\n", 1, "3 coordinates"),
            ("v 0 0 0\nv a 0 0\n", 2, "`a` is no number"),
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
            ("v 0 0 0\nf 1e3 1 1\n", 2, "no index"),
            ("vn 0 1\n", 1, "found 2"),
        ];
        for (text, line, part) in cases {
            let fault = check(text).unwrap_err();
            assert_eq!(fault.line, line, "{text:?}");
            assert!(fault.problem.contains(part), "{text:?}: {}", fault.problem);
        }
    }

    #[test]
    fn odd_but_legal_files_are_read() {
        let text = "v 0 0 0\nv 2 0 0 2\nv 0 1 0 1 0 0\nvt 0.5\nf 1/1 \\\n 2/1 3/1\nf -3 -2 -1\nf 4 1 2\nv 1 1 1\n";
        let c = check(text).unwrap();
        assert!(c.vertices.contains("v 1 0 0\n"), "the weight divides: {}", c.vertices);
        assert!(c.faces.contains("f 1/1/ 2/1/ 3/1/\n") && c.faces.contains("f 4// 1// 2//\n"), "{}", c.faces);
        assert_eq!(c.groups.len(), 2);
        assert!(c.notes.is_empty(), "{:?}", c.notes);
    }

    #[test]
    fn what_is_left_out_is_noted() {
        let text = "v 0 0 0\nv 2 0 0\nv 0.1 0.1 0\nv 0 2 0\nvn 0 0 0\nvt nan 0\nl 1 2\np 1\nf 1 2\nf 2 3 4 1\nf 1//1 2 3\ncurv 0 1\ncurv 0 1\n";
        let notes = check(text).unwrap().notes;
        let all: Vec<String> = notes.iter().map(|(p, m)| format!("{p}: {m}")).collect();
        for part in [
            "line 7: line and point elements, which have no surface, are ignored: 2",
            "line 9: faces with fewer than three corners are left out: 1",
            "line 12: statements `curv`",
            "line 11: normals or texture coordinates of only some",
        ] {
            assert!(all.iter().any(|n| n.contains(part)), "{part} in {all:?}");
        }
        for part in ["normals without a direction", "texture coordinates that are not finite"] {
            assert!(all.iter().any(|n| n.contains(part)), "{part} in {all:?}");
        }
        assert_eq!(all.iter().filter(|n| n.contains("curv")).count(), 1);
    }

    #[test]
    fn a_concave_polygon_is_noted_unless_its_fan_is_right() {
        let dart = "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 0.5 1 0\n";
        let noted =
            |faces: &str| check(&format!("{dart}{faces}")).unwrap().notes.iter().any(|(_, m)| m.contains("concave"));
        assert!(noted("f 1 2 3 4\n"));
        assert!(!noted("f 4 1 2 3\n"), "a fan from the inner corner covers exactly the dart");
    }
}
