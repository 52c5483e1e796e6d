//! The recipes: every page has a script, shows it verbatim, and lists the files that it writes.

use std::collections::BTreeSet;
use std::path::Path;

use super::workplace::{ProgramOutput, Workplace};

/// Values that replace those of the axes of the same names, so that every script runs quickly.
const TINY: [(&str, &str); 4] = [
    ("size", "16"),
    ("samples", "2"),
    ("seconds", "0.05"),
    ("reference", "16"),
];

/// Root of the repository, from which the pages start their commands.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Names of the files with this extension in a folder of the repository, without the extension.
fn names(folder: &str, extension: &str) -> BTreeSet<String> {
    let entries = std::fs::read_dir(root().join(folder)).unwrap();
    entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect()
}

/// Text of a file of the repository.
fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Text of a recipe's page.
fn page(name: &str) -> String {
    read(&format!("docs/recipes/{name}.md"))
}

/// Names of all recipes, after their pages.
fn recipes() -> BTreeSet<String> {
    let mut pages = names("docs/recipes", "md");
    assert!(pages.remove("README"), "docs/recipes/README.md is missing");
    pages
}

/// The Lua blocks of a page that start with a comment naming a file, as pairs of path and text.
fn shown_files(page: &str) -> Vec<(String, String)> {
    let blocks = page.split("\n```lua\n").skip(1);
    let texts = blocks.filter_map(|rest| rest.split_once("\n```"));
    texts
        .filter_map(|(text, _)| {
            let (path, _) = text.strip_prefix("-- ")?.split_once(": ")?;
            path.starts_with("scripts/")
                .then(|| (path.to_owned(), format!("{text}\n")))
        })
        .collect()
}

/// Paths that a page lists as written by its script: list items that start with `out/`.
fn promised_files(page: &str) -> Vec<String> {
    page.lines()
        .filter_map(|line| line.strip_prefix("- `out/"))
        .map(|rest| format!("out/{}", rest.split_once('`').unwrap().0))
        .collect()
}

/// Returns whether some file matches a pattern, in which `**` means any number of folders.
fn is_there(place: &Workplace, pattern: &str) -> bool {
    match pattern.split_once("/**/") {
        None => place.path(pattern).is_file(),
        Some((below, tail)) => {
            let tail = format!("/{tail}");
            crate::common::files_below(&place.path(below))
                .iter()
                .any(|file| file.to_string_lossy().replace('\\', "/").ends_with(&tail))
        }
    }
}

/// The overrides of axes that make a recipe tiny: those of `TINY` that its script declares.
fn overrides(script: &str) -> Vec<String> {
    let declared = |name: &str| script.contains(&format!("x:axis(\"{name}\""));
    let axes = TINY.iter().filter(|(name, _)| declared(name));
    axes.map(|(name, value)| format!("{name}={value}"))
        .collect()
}

/// Runs the program from the root of the repository, with results in the workplace.
fn run(place: &Workplace, words: &[&str], recipe: &str, more: &[String]) -> ProgramOutput {
    let script = format!("scripts/recipes/{recipe}.lua");
    let out = place.path("out");
    let mut command = place.command(words);
    command.current_dir(root()).arg(script).args(more);
    command.arg("--out").arg(out);
    ProgramOutput::run(command.args(["--backend", "cpu", "-q"]))
}

/// Runs a recipe at tiny size and checks that it writes the files that its page lists.
fn check_run(name: &str, more: &[String]) {
    let place = Workplace::new();
    let mut axes = overrides(&read(&format!("scripts/recipes/{name}.lua")));
    assert!(axes.iter().any(|a| a == "size=16"), "{name} has no size");
    axes.extend_from_slice(more);
    let ended = run(&place, &["run"], name, &axes);
    assert_eq!(
        ended.status, 0,
        "{name}\n{}\n{}",
        ended.stdout, ended.stderr
    );
    let promised = promised_files(&page(name));
    assert!(!promised.is_empty(), "{name} lists no files");
    for pattern in promised {
        assert!(
            is_there(&place, &pattern),
            "{name} does not write {pattern}: {:?}",
            place.files("out")
        );
    }
}

#[test]
fn every_recipe_has_a_page_and_a_script() {
    assert_eq!(recipes(), names("scripts/recipes", "lua"));
    let index = read("docs/recipes/README.md");
    for name in recipes() {
        assert!(
            index.contains(&format!("]({name}.md)")),
            "the index lacks {name}"
        );
        let title = page(&name).lines().next().unwrap().to_owned();
        assert!(
            title.starts_with("# ") && title.ends_with('?'),
            "{name}: {title}"
        );
    }
}

#[test]
fn pages_show_their_scripts_verbatim() {
    for name in recipes() {
        let shown = shown_files(&page(&name));
        let script = format!("scripts/recipes/{name}.lua");
        assert!(
            shown.iter().any(|(path, _)| *path == script),
            "{name} does not show {script}"
        );
        for (path, text) in shown {
            assert_eq!(
                text,
                read(&path),
                "docs/recipes/{name}.md differs from {path}"
            );
        }
    }
}

#[test]
fn every_recipe_runs_and_writes_the_files_that_its_page_lists() {
    for name in recipes() {
        // Needs another program: see the next test.
        if name != "mitsuba_beside" {
            // Needed by scripts with `external`; without an effect for others.
            check_run(&name, &["--allow-commands".to_owned()]);
        }
    }
}

#[test]
fn the_recipe_with_mitsuba_runs_if_it_is_installed() {
    let name = "mitsuba_beside";
    let Some(python) = super::external::interpreter() else {
        let planned = run(&Workplace::new(), &["plan"], name, &[]);
        assert_eq!(planned.status, 0, "{}", planned.stderr);
        crate::common::skipped(format_args!(
            "no interpreter with the package mitsuba; {name} was planned only"
        ));
        return;
    };
    check_run(name, &[format!("python={python}")]);
}

#[test]
fn mitsuba_luxcore_and_cycles_render_the_picture_of_this_program_if_they_are_installed() {
    let name = "other_renderers";
    let python = std::env::var("LUMBRE_RENDERERS_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let mitsuba = super::external::interpreter().unwrap_or_else(|| "python3".to_owned());
    let place = Workplace::new();
    let more = [
        format!("python={python}"),
        format!("mitsuba={mitsuba}"),
        "size=32".to_owned(),
        "seconds=0.25".to_owned(),
        "--allow-commands".to_owned(),
    ];
    let ended = run(&place, &["run"], name, &more);
    assert_eq!(ended.status, 0, "{}\n{}", ended.stdout, ended.stderr);
    let table = place.read("out/latest/tables/bias.md");
    for technique in ["mitsuba", "luxcore-path", "luxcore-bidir", "cycles"] {
        let row = format!("| external:{technique} ");
        let Some(line) = table.lines().find(|line| line.starts_with(&row)) else {
            crate::common::skipped(format_args!(
                "{technique}; LUMBRE_RENDERERS_PYTHON and LUMBRE_MITSUBA_PYTHON name \
                 interpreters with it"
            ));
            continue;
        };
        // The mean over repeats stands before its interval.
        let number = line.split('|').nth(2).unwrap();
        let number = number.split_whitespace().next().unwrap();
        let bias: f64 = number.parse().unwrap_or_else(|_| panic!("{line}"));
        // Most of the picture is a sky of about 1.1 without noise.
        assert!(bias.abs() < 0.005, "{line}");
    }
}

#[test]
fn the_recipe_for_clusters_prints_its_job_without_slurm() {
    let more: Vec<String> = ["--workers", "4", "--time", "01:00:00", "--dry-run"]
        .map(str::to_owned)
        .into();
    let ended = run(
        &Workplace::new(),
        &["submit", "slurm"],
        "use_a_cluster",
        &more,
    );
    assert_eq!(ended.status, 0, "{}", ended.stderr);
    let shown = page("use_a_cluster");
    let options: Vec<&str> = shown
        .lines()
        .filter(|l| l.starts_with("#SBATCH "))
        .collect();
    assert!(options.len() > 3, "the page shows no job");
    for option in options {
        assert!(
            ended.stdout.lines().any(|line| line == option),
            "the job has no `{option}`:\n{}",
            ended.stdout
        );
    }
}

#[test]
fn the_recipe_for_bias_finds_a_biased_integrator() {
    let more = ["omit=true", "size=32", "samples=32"]
        .map(str::to_owned)
        .to_vec();
    let ended = run(&Workplace::new(), &["run"], "check_bias", &more);
    assert_eq!(ended.status, 6, "{}\n{}", ended.stdout, ended.stderr);
    assert!(ended.stderr.contains("DISAGREES"), "{}", ended.stderr);
}
