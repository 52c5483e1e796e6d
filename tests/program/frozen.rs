//! What must not change while the code is rewritten: ids of runs, JSON of verbs, figures of a night
//! and bits of pictures, as they were when the files below `frozen/` were written.
//!
//! A change that is meant is written by `LUMBRE_FREEZE=1 cargo test --test program frozen::`, and its
//! commit says why nights of users get other ids or numbers.

use std::path::{Path, PathBuf};
use std::process::Command;

use lumbre_report::exr;
use serde_json::Value as Json;

use crate::cli::workplace::{Workplace, copy_folder};

/// Scripts with axes, references, films, stages, materials, time axes and options of many kinds, and
/// the arguments with which they are planned.
const SCRIPTS: [(&str, &[&str]); 14] = [
    ("first_light", &[]),
    ("overnight", &["quick=true"]),
    ("recipes/pixel_filters", &[]),
    ("techniques", &["quick=true"]),
    ("theses/s0_figure_4_7", &[]),
    ("theses/s0_figure_4_10", &[]),
    ("theses/s0_figure_4_12", &[]),
    ("theses/s0_figure_4_13", &[]),
    ("theses/s0_figure_5_7", &[]),
    ("theses/s1_figure_3_5", &[]),
    ("theses/s1_figure_4_1", &[]),
    ("theses/s1_figure_4_3", &[]),
    ("theses/s1_table_4_2", &[]),
    ("theses/s2_figure_6_4", &[]),
];

/// Keys of JSON whose values differ from run to run, or with the program.
const VOLATILE: [&str; 10] = [
    "program",
    "elapsed_s",
    "silent_s",
    "wall_s",
    "measure_s",
    "finished",
    "check",
    "bytes",
    "blake3",
    "host",
];

/// Compares a text with a frozen file.
fn assert_frozen(name: &str, text: &str) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/program/frozen")
        .join(name);
    if std::env::var_os("LUMBRE_FREEZE").is_some() {
        std::fs::write(&file, text).unwrap();
    }
    let frozen = std::fs::read_to_string(&file).unwrap_or_default();
    let line = frozen.lines().zip(text.lines()).position(|(a, b)| a != b);
    assert!(
        frozen == text,
        "{name} differs from its frozen version, first in line {}: see tests/program/frozen.rs",
        line.unwrap_or_else(|| frozen.lines().count().min(text.lines().count())) + 1
    );
}

/// Returns the ids of all runs of a plan, cells before references.
fn run_ids(value: &Json, ids: &mut Vec<String>) {
    match value {
        Json::Object(entries) => {
            for (key, value) in entries {
                match value.as_str() {
                    Some(id) if key == "run" => ids.push(id.to_owned()),
                    _ => run_ids(value, ids),
                }
            }
        }
        Json::Array(items) => items.iter().for_each(|item| run_ids(item, ids)),
        _ => {}
    }
}

#[test]
fn runs_of_shipped_scripts_keep_their_ids() {
    let lines = SCRIPTS.map(|(name, args)| {
        let output = Command::new(env!("CARGO_BIN_EXE_lumbre"))
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .args(["plan", &format!("scripts/{name}.lua"), "--json"])
            .args(["--backend", "cpu"])
            .args(args)
            .output()
            .unwrap();
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{name}: {error}");
        let plan: Json = serde_json::from_slice(&output.stdout).unwrap();
        let mut ids = Vec::new();
        run_ids(&plan, &mut ids);
        let digest = blake3::hash(ids.join("\n").as_bytes()).to_hex();
        format!("{name}: {} runs, {}\n", ids.len(), &digest[..32])
    });
    assert_frozen("ids.txt", &lines.concat());
}

/// Returns JSON as text, without the values that differ from run to run.
fn without_volatile(mut value: Json) -> String {
    fn blank(value: &mut Json) {
        match value {
            Json::Object(entries) => {
                for (key, value) in entries {
                    if VOLATILE.contains(&key.as_str()) && !value.is_null() {
                        *value = "*".into();
                    } else {
                        blank(value);
                    }
                }
            }
            Json::Array(items) => items.iter_mut().for_each(blank),
            _ => {}
        }
    }
    blank(&mut value);
    format!("{value:#}\n")
}

#[test]
fn verbs_and_figures_show_a_night_as_before() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q"]);
    for (name, args) in [
        ("status.json", &["status", "--json"][..]),
        ("ls.json", &["ls", "--json"]),
        ("show.json", &["show", "latest", "--json"]),
    ] {
        let printed = place.succeed(args).stdout;
        assert_frozen(
            name,
            &without_volatile(serde_json::from_str(&printed).unwrap()),
        );
    }
    for file in [
        "figures/convergence_depth=4.csv",
        "figures/convergence_depth=4.svg",
        "tables/errors.csv",
        "tables/errors.md",
    ] {
        let name = file.rsplit('/').next().unwrap();
        let text = place.read(&format!("out/latest/{file}"));
        // A figure and a table name the program that made them.
        let names_program = |line: &str| line.starts_with("<desc>") || line.starts_with("lumbre ");
        let lines = text.lines().filter(|line| !names_program(line));
        assert_frozen(
            name,
            &lines.map(|line| format!("{line}\n")).collect::<String>(),
        );
    }
}

/// Returns the hash of the picture of a technique after few samples of the first experiment's scene.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn picture(technique: &str, place: &Workplace) -> String {
    let scene: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/still_life.lua");
    let scene = scene.to_string_lossy().into_owned();
    let name = format!("{technique}.exr");
    let args = ["render", &scene, "-i", technique, "--spp", "2"];
    let more = ["--size", "24x16", "--backend", "cpu", "-o", &name, "-q"];
    place.succeed(&[&args[..], &more[..]].concat());
    let file = std::fs::read(place.path(&name)).unwrap();
    let (image, _) = exr::decode(&file).unwrap();
    let bytes = image.data.iter().flatten().flat_map(|v| v.to_le_bytes());
    blake3::hash(&bytes.collect::<Vec<u8>>()).to_hex()[..32].to_owned()
}

// Other systems have other libraries of elementary functions.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
#[test]
fn pictures_of_every_technique_keep_their_bits() {
    let place = Workplace::new();
    let names = [
        "bpt",
        "nee",
        "bdpt",
        "lvc",
        "guided",
        "guided_bdpt",
        "sppm",
        "vcm",
    ];
    let lines = names.map(|name| format!("{name}: {}\n", picture(name, &place)));
    assert_frozen("pictures.txt", &lines.concat());
}

#[test]
fn a_night_of_an_earlier_version_is_opened_reported_and_resumed() {
    // Commit bbf0032f rendered it, and was interrupted in the second of four cells.
    let old = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/frozen/old");
    let place = Workplace::new();
    copy_folder(&old, &place.path("out"));
    place.write("night.lua", &place.read("out/old-9169/experiment.lua"));
    let counts = |name: &str| {
        let status = place.succeed(&["status", name, "--json"]).stdout;
        let status: Json = serde_json::from_str(&status).unwrap();
        let cells = status["cells"].clone();
        let count = |key: &str| cells[key].as_u64().unwrap_or_else(|| panic!("{cells}"));
        [count("total"), count("done"), count("interrupted")]
    };
    assert_eq!(counts("old-9169"), [4, 1, 1]);
    place.succeed(&["report", "out/old-9169", "--to", "page"]);
    let page = place.read("page/index.html");
    assert!(page.contains("relMSE") && page.contains("path tracing"));
    let finished = place.finished();
    assert_eq!(finished.len(), 1);
    place.succeed(&["run", "night.lua", "--no-tui", "--threads", "1"]);
    assert_eq!(counts("latest"), [4, 4, 0]);
    let now = place.finished();
    assert_eq!(now.len(), 4, "in the same folder");
    assert!(
        now.contains(&finished[0]),
        "what was done is not rendered again"
    );
    let resumed = now
        .iter()
        .find(|(file, _)| file.contains("technique=bpt/depth=4"));
    let log = resumed.unwrap().0.replace("done.json", "log.txt");
    let log = place.read(&log);
    assert!(
        log.contains("resumes from its checkpoint after 3840"),
        "{log}"
    );
    place.succeed(&["reproduce", &now[0].0.replace("/done.json", "/final.exr")]);
}
