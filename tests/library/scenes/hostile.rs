//! Damaged and hostile files of every format: no panic, no endless loop, and no more memory than
//! the size of the files justifies.

use std::path::Path;

use lumbre_light::math::rng::pcg4d;
use lumbre_light::scene::{SceneError, compile};
use lumbre_lua::scene;
use lumbre_scene_io::load::{MissingTextures, load_with, texture};

use super::Folder;
use super::hostile_cases::{Case, documents, meshes, places, scenes_in_xml, textures};
use super::hostile_pbrt::scenes_of_pbrt;
use super::meter::peak;
use super::samples::{QUAD, Sample, samples};

/// Bytes that reading may allocate for files of any size. A texture may take 256 MiB.
const SMALL: usize = 384 << 20;
/// Further bytes that reading may allocate for each byte of the files.
const GROWTH: usize = 1024;
/// Further bytes for each byte of files whose textures have one colour.
const PICTURE_GROWTH: usize = 8192;

/// Reads a file of the folder by its extension and checks the memory limit. Returns the error, or
/// `None` on success.
fn read_within_limit(folder: &Folder, name: &str, growth: usize) -> Option<String> {
    let path = folder.path(name);
    let (result, most) = peak(|| read(&path));
    let all = folder_size(folder.0.path());
    let limit = SMALL + growth * all;
    assert!(
        most <= limit,
        "{name}: {most} bytes taken to read {all}: the limit is {limit}"
    );
    let problem = result.err()?.to_string();
    assert!(
        problem.len() < 4000,
        "{name}: an error of {} bytes: {problem:.500}",
        problem.len()
    );
    Some(problem)
}

/// Returns the size of all files below a folder in bytes.
fn folder_size(folder: &Path) -> usize {
    let size = |entry: std::fs::DirEntry| match entry.file_type().unwrap().is_dir() {
        true => folder_size(&entry.path()),
        false => entry.metadata().unwrap().len() as usize,
    };
    std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| size(entry.unwrap()))
        .sum()
}

/// Reads and compiles a scene, or reads a texture. Errors of compiling name materials and entities
/// but no file, so the path is added.
fn read(path: &Path) -> Result<(), SceneError> {
    let extension = path.extension().unwrap().to_str().unwrap();
    if ["png", "jpg", "bmp", "hdr", "tga", "webp", "exr"].contains(&extension) {
        return texture(path, &mut Vec::new()).map(drop);
    }
    let (desc, _) = scene::read(path, &Default::default(), MissingTextures::Note)?;
    compile(&desc)
        .map(drop)
        .map_err(|e| SceneError::Script(format!("{}: {e}", path.display())))
}

/// Replacements for numbers and words.
const REPLACEMENTS: &[&str] = &[
    "",
    "-1",
    "0",
    "1e300",
    "nan",
    "18446744073709551615",
    "4294967296",
    "[]",
    "{}",
    "\"x\"",
    "null",
    "../../etc/passwd",
];

/// Returns the byte ranges that are one number or one quoted word.
fn values(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let kind = |b: u8| {
        if b.is_ascii_digit() || b"+-.".contains(&b) {
            1
        } else {
            2 * i32::from(b.is_ascii_alphabetic())
        }
    };
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    for (i, b) in bytes.iter().enumerate() {
        match found.last_mut() {
            Some(last) if kind(*b) > 0 && last.end == i && kind(bytes[last.start]) == kind(*b) => {
                last.end += 1
            }
            _ if kind(*b) > 0 => found.push(i..i + 1),
            _ => {}
        }
    }
    found
}

/// Returns a random number.
fn random(k: usize, salt: usize) -> usize {
    pcg4d([k as u32, salt as u32, 7, 0])[0] as usize
}

/// Returns damaged versions of a file, a few hundred at most.
fn damaged(bytes: &[u8]) -> Vec<Vec<u8>> {
    let n = bytes.len();
    let step = |most: usize| n.div_ceil(most).max(1);
    let mut all: Vec<Vec<u8>> = (0..n)
        .step_by(step(25))
        .map(|cut| bytes[..cut].to_vec())
        .collect();
    for i in (0..n).step_by(step(50)) {
        let mut flipped = bytes.to_vec();
        flipped[i] ^= 1 << (i % 8);
        all.push(flipped);
    }
    // Replaces four bytes, to reach lengths and counts of binary formats.
    for i in (0..n.saturating_sub(4)).step_by(step(24)) {
        for word in [u32::MAX, 0x0100_0000] {
            let mut huge = bytes.to_vec();
            huge[i..i + 4].copy_from_slice(&word.to_le_bytes());
            all.push(huge);
        }
    }
    let places = values(bytes);
    for (k, range) in places
        .iter()
        .enumerate()
        .step_by(places.len().div_ceil(60).max(1))
    {
        let other = REPLACEMENTS[random(k, n) % REPLACEMENTS.len()];
        all.push([&bytes[..range.start], other.as_bytes(), &bytes[range.end..]].concat());
    }
    // Duplicated and misplaced parts.
    for k in 0..10 {
        let at = |salt: usize| random(k, salt) % n;
        let (from, to) = (at(1).min(at(2)), at(1).max(at(2)));
        all.push([&bytes[..at(3)], &bytes[from..to], &bytes[at(3)..]].concat());
    }
    all
}

#[test]
fn every_sample_is_read_within_the_limit() {
    for Sample { name, files } in samples() {
        let folder = Folder::new(&files);
        assert_eq!(
            read_within_limit(&folder, files[0].0, GROWTH),
            None,
            "{name}"
        );
    }
}

#[test]
fn damaged_files_of_every_format_are_read_or_refused() {
    let (mut read, mut refused) = (0, 0);
    for Sample { name, files } in samples() {
        let folder = Folder::new(&files);
        for (file, bytes) in &files {
            for bad in damaged(bytes) {
                folder.write(file, &bad);
                match read_within_limit(&folder, files[0].0, PICTURE_GROWTH) {
                    None => read += 1,
                    Some(problem) => {
                        let named = problem.contains(&folder.0.path().display().to_string());
                        assert!(named, "{name}, {file}: no file is named: {problem}");
                        refused += 1;
                    }
                }
            }
            folder.write(file, bytes);
        }
    }
    assert!(
        read > 300 && refused > 600,
        "too few damaged files were read ({read}) or refused ({refused})"
    );
}

#[test]
fn hostile_files_are_refused_or_read_within_their_limits() {
    let groups: [fn() -> Vec<Case>; 6] = [
        meshes,
        documents,
        scenes_in_xml,
        scenes_of_pbrt,
        places,
        textures,
    ];
    let mut wrong = Vec::new();
    for (what, files, expected) in groups.iter().flat_map(|group| group()) {
        let folder = Folder::new(&files);
        let found = read_within_limit(
            &folder,
            files[0].0,
            if what.contains("picture") {
                PICTURE_GROWTH
            } else {
                GROWTH
            },
        );
        let fits = match &found {
            None => expected.is_empty(),
            Some(problem) => !expected.is_empty() && problem.contains(expected),
        };
        if !fits && expected != "*" {
            wrong.push(format!(
                "{what}: {}",
                found.unwrap_or("it was read".to_owned())
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn unreadable_textures_are_noted() {
    let folder = Folder::new(&[
        ("a.mtl", b"newmtl a\nmap_Kd none.png\n".to_vec()),
        ("a.obj", format!("mtllib a.mtl\n{QUAD}").into_bytes()),
    ]);
    let (_, notes) = load_with(&folder.path("a.obj"), MissingTextures::Note).unwrap();
    assert!(
        notes.iter().any(|n| n.message.contains("none.png")),
        "{notes:?}"
    );
}

/// A picture of 4096x4096 grey pixels in 18 bytes: the decoded picture takes 16 MiB, its texels 64.
#[test]
fn decoding_a_picture_takes_its_pixels_and_its_texels() {
    let size = 4096u16.to_le_bytes();
    let header = [
        &[0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0][..],
        &size,
        &size,
        &[8, 0],
    ];
    let folder = Folder::new(&[("a.tga", header.concat())]);
    let (_, most) = peak(|| read(&folder.path("a.tga")));
    assert!((80 << 20..88 << 20).contains(&most), "{most} bytes taken");
}
