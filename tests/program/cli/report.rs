//! `lumbre report` and its page, on a small night of the mock backend.

use std::process::Command;

use super::workplace::{Workplace, copy_folder};
use lumbre_night::store::StoredFile;
use lumbre_night::store::schema::run::DoneFile;
use lumbre_render::Device;

/// Two techniques with two repeats, a reference, two metrics and snapshots, on the mock backend.
const NIGHT: &str = r#"
local x = experiment("study", { seed = 3, repeats = 2 })
x:axis("technique", { "bpt", "nee" })
x:render(function(p)
  return { scene = "ball.scn", integrator = p.technique, max_depth = 3, resolution = { 24, 16 }, backend = "mock" }
end)
x:reference { from = function(p) return { integrator = "bpt" } end, stop = stop.samples(4096) }
x:measure { every = "1s", rmse = metric.rmse(), ssim = metric.ssim { on = tonemap.srgb { exposure = 0 } }, keep = { exr = "pow2" } }
x:stop(function(p) return stop.samples(16) end)
return x
"#;

fn reported() -> Workplace {
    let place = Workplace::new();
    place.write("study.lua", NIGHT);
    place.succeed(&["run", "study.lua", "-q"]);
    place
}

#[test]
fn a_night_is_exported_for_viewers_and_scripts() {
    let place = reported();
    let export = |format: &str| {
        let printed = place.succeed(&["export", "out/latest", format]).stdout;
        place.read(printed.trim())
    };
    let data = export("--jeri");
    let tree: serde_json::Value = serde_json::from_str(
        data.trim_start_matches("const data = ")
            .trim_end_matches(";\n"),
    )
    .unwrap();
    let pictures = tree["children"][0]["children"].as_array().unwrap();
    let titles: Vec<&str> = pictures
        .iter()
        .map(|p| p["title"].as_str().unwrap())
        .collect();
    assert_eq!(titles, ["Reference", "bpt", "nee"]);
    let image = |value: &serde_json::Value| format!("study-jeri/{}", value.as_str().unwrap());
    for picture in pictures {
        assert!(place.path(&image(&picture["image"])).is_file(), "{picture}");
    }
    assert_eq!(pictures[1]["compareTo"]["reference"], pictures[0]["image"]);
    // The first repeat of each technique, as it is stored.
    let run = place
        .files("out")
        .into_iter()
        .find(|f| f.contains("technique=nee/rep=0/") && f.ends_with("/final.exr"));
    let bytes = |file: &str| std::fs::read(place.path(file)).unwrap();
    assert!(bytes(&run.unwrap()) == bytes(&image(&pictures[2]["image"])));

    assert!(export("--figuregen").contains("import figuregen"));
    let figure = place.json("study-figuregen/figure.json");
    let nee = &figure["rows"][0]["series"][1];
    assert_eq!(
        (&nee["title"], &nee["samples"]),
        (&"nee".into(), &16.into())
    );
    assert!(nee["errors"]["rmse"].as_f64().unwrap() > 0.0);
    assert!(
        place
            .path(&format!(
                "study-figuregen/{}",
                nee["image"].as_str().unwrap()
            ))
            .is_file()
    );

    assert_eq!(export("--csv").lines().count(), 1 + 4);
    assert!(place.read("study-csv/waves.csv").lines().count() > 5);
    let error = place.fail(2, &["export", "out/latest"]);
    assert!(error.contains("--jeri"), "{error}");
    place.fail(2, &["export", "ball.scn", "--jeri"]);
}

#[test]
fn a_report_depends_only_on_the_night_folder_and_is_reproducible() {
    let place = reported();
    let output = place.succeed(&["report", "out/latest"]);
    let page = output.stdout.trim().to_owned();
    assert!(page.ends_with("/report/index.html"), "{page}");
    let folder = page.trim_end_matches("/index.html").to_owned();
    let files = place.files(&folder);
    for expected in [
        "figures/error-time-rmse.svg",
        "figures/error-samples-ssim.pdf",
        "figures/crops-equal-time.png",
        "tables/fps-absolute.tex",
        "tables/equal-error-rmse.md",
        "data/waves.csv",
        "methods.tex",
    ] {
        assert!(
            files.contains(&format!("{folder}/{expected}")),
            "{expected} is missing: {files:?}"
        );
    }
    let before: Vec<Vec<u8>> = files
        .iter()
        .map(|f| std::fs::read(place.path(f)).unwrap())
        .collect();
    // Without the script and the scene no run could be rendered.
    std::fs::remove_file(place.path("study.lua")).unwrap();
    std::fs::remove_file(place.path("ball.scn")).unwrap();
    place.succeed(&["report", "out/latest"]);
    let after: Vec<Vec<u8>> = files
        .iter()
        .map(|f| std::fs::read(place.path(f)).unwrap())
        .collect();
    assert!(before == after, "the same night must give the same bytes");
}

#[test]
fn every_file_of_a_report_names_its_runs_plan_and_program() {
    let place = reported();
    place.succeed(&["report", "out/latest", "--to", "r"]);
    let id = place.json(&place.finished()[0].0)["run"]
        .as_str()
        .unwrap()
        .to_owned();
    let plan = place.json("out/latest/plan.json")["hash"]
        .as_str()
        .unwrap()
        .to_owned();
    for file in [
        "figures/error-time-rmse.svg",
        "figures/error-time-rmse.tex",
        "tables/final-rmse.md",
        "tables/final-rmse.tex",
        "figures/error-time-rmse.dat",
        "data/runs.csv",
        "methods.md",
        "index.html",
    ] {
        let text = place.read(&format!("r/{file}"));
        assert!(
            text.contains(&id) && text.contains(&plan) && text.contains("lumbre 0."),
            "{file} lacks a run, the plan or the program"
        );
    }
    for file in ["figures/error-time-rmse.png", "figures/error-time-rmse.pdf"] {
        let bytes = std::fs::read(place.path(&format!("r/{file}"))).unwrap();
        assert!(
            bytes.windows(id.len()).any(|w| w == id.as_bytes()),
            "{file} lacks the run"
        );
    }
}

#[test]
fn invalid_folders_axes_crops_and_thresholds_are_refused() {
    let place = reported();
    let error = place.fail(2, &["report", "scenes"]);
    assert!(error.contains("no night `scenes`"), "{error}");
    let error = place.fail(2, &["report", "out/latest", "--by", "tecnique"]);
    assert!(
        error.contains("unknown axis `tecnique`; the axes are: technique"),
        "{error}"
    );
    let error = place.fail(2, &["report", "out/latest", "--crop", "1,2,3"]);
    assert!(error.contains("left, top, width and height"), "{error}");
    let error = place.fail(2, &["report", "out/latest", "--threshold", "mse=0.1"]);
    assert!(
        error.contains("unknown metric column `mse`; the columns are: rmse, ssim"),
        "{error}"
    );
}

#[test]
fn nights_of_two_machines_are_compared_only_if_both_devices_are_named() {
    let place = reported();
    let night = place.first_ending("out", "/plan.json");
    let night = night.trim_end_matches("/plan.json").to_owned();
    copy_folder(&place.path(&night), &place.path("other/night"));
    // Simulates another machine: its device has another name, and its references are absent.
    for done in &place.ending("other", "/done.json") {
        let mut facts = DoneFile::read_from(&place.path(done)).unwrap();
        let DoneFile::Rendered(results) = &mut facts else {
            panic!("{done}")
        };
        results.devices = vec![Device::from_line("Another GPU")];
        let files = facts.files().clone();
        place.write(done, &facts.sealed(files).text());
    }
    place.succeed(&["report", &night, "other/night", "--to", "both"]);
    let svg = place.read("both/figures/error-time-rmse.svg");
    assert!(
        svg.contains("nee, Another GPU") && svg.contains("bpt, "),
        "both devices must be named"
    );
    assert!(
        place
            .read("both/tables/fps-relative.md")
            .contains("Another GPU / ")
    );
    std::fs::remove_file(place.path("other/night/env.json")).unwrap();
    let error = place.fail(2, &["report", &night, "other/night", "--to", "again"]);
    assert!(
        error.contains("cannot be compared with those of another night"),
        "{error}"
    );
    let names = ["--name", "A", "--name", "B"];
    let named = [
        &["report", &night, "other/night", "--to", "again"],
        &names[..],
    ]
    .concat();
    let error = place.fail(3, &named);
    assert!(error.contains("env.json is missing"), "{error}");
    assert!(place.path("again/index.html").is_file());
}

#[test]
fn a_damaged_run_does_not_count_as_finished() {
    let place = reported();
    let (done, _) = place.finished().swap_remove(0);
    let csv = done.replace("done.json", "metrics.csv");
    let text = place.read(&csv);
    place.write(&csv, &text[..text.len() - 20]);
    let error = place.fail(3, &["report", "out/latest", "--to", "r"]);
    assert!(error.contains("left out: "), "{error}");
    assert!(place.read("r/index.html").contains("3 of 4 runs finished"));
}

/// Script that presses keys and buttons of the page.
const KEYS: &str = include_str!("report_probe.js");

/// Script that measures the page on a narrow screen: whether winners are wrapped and figures scroll,
/// and the smallest distance of two labels below the curves, in pixels.
const NARROW: &str = r##"
const style = (selector) => getComputedStyle(document.querySelector(selector));
const labels = [...document.querySelectorAll("#chart svg text[text-anchor=middle]")];
const boxes = labels.map((label) => label.getBoundingClientRect());
const lowest = boxes.filter((box) => Math.abs(box.top - boxes[0].top) < 2).sort((a, b) => a.left - b.left);
document.documentElement.dataset.probe = JSON.stringify({
  wraps: style("#verdict td").whiteSpace === "normal", scrolls: style("figure").overflowX === "auto",
  apart: lowest.length > 2 && lowest.every((box, i) => !i || lowest[i - 1].right <= box.left),
  answer: document.querySelector("#verdict").getBoundingClientRect().right <= innerWidth,
});
"##;

/// Opens the page of `r/` in a browser of this width, and returns what a script found after those of
/// the page.
fn probed(place: &Workplace, browser: &str, width: u32, script: &str) -> serde_json::Value {
    let page = place.read("r/index.html");
    let probe = format!("<script>{script}</script></body>");
    place.write("r/probe.html", &page.replace("</body>", &probe));
    let address = format!("file://{}", place.path("r/probe.html").display());
    let profile = format!("--user-data-dir={}", place.path("profile").display());
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--virtual-time-budget=4000",
            "--dump-dom",
            &format!("--window-size={width},900"),
            &profile,
            &address,
        ])
        .output()
        .unwrap();
    let document = String::from_utf8_lossy(&output.stdout);
    let probed = document
        .split_once("data-probe=\"")
        .and_then(|(_, rest)| rest.split_once('"'))
        .map(|(probed, _)| probed.replace("&quot;", "\""));
    let probed = probed.unwrap_or_else(|| {
        panic!(
            "the scripts of the page did not finish: {}",
            String::from_utf8_lossy(&output.stderr)
        )
    });
    serde_json::from_str(&probed).unwrap()
}

/// Runs the page's scripts in a browser and inspects the document afterwards.
#[test]
fn the_page_works_in_a_browser_without_a_network() {
    let browsers = ["chromium", "chromium-browser", "google-chrome"];
    let Some(browser) = browsers.iter().find(|b| {
        Command::new(b)
            .arg("--version")
            .output()
            .is_ok_and(|o| o.status.success())
    }) else {
        crate::common::skipped(format_args!("none of {} is installed", browsers.join(", ")));
        return;
    };
    let place = reported();
    place.succeed(&["report", "out/latest", "--to", "r"]);
    let expected = serde_json::json!({
        "names": 3, "pressed": 2, "differs": 5, "zero": true, "sorted": true, "rows": 4, "narrowed": 2, "slider": true,
        "curves": 4,
    });
    assert_eq!(probed(&place, browser, 800, KEYS), expected);
    let expected =
        serde_json::json!({ "wraps": true, "scrolls": true, "apart": true, "answer": true });
    assert_eq!(probed(&place, browser, 500, NARROW), expected);
}

/// Compiles everything that a report writes for LaTeX in one document.
#[test]
fn tables_figures_and_methods_compile_in_latex() {
    if !Command::new("pdflatex")
        .arg("--version")
        .output()
        .is_ok_and(|o| o.status.success())
    {
        crate::common::skipped("pdflatex is not installed");
        return;
    }
    let place = reported();
    place.succeed(&["report", "out/latest", "--to", "r"]);
    let inputs: String = place
        .ending("r", ".tex")
        .iter()
        .map(|f| f.trim_start_matches("r/"))
        .map(|f| match f.starts_with("figures/") {
            true => format!("\\begin{{figure*}}\\centering\\input{{{f}}}\\end{{figure*}}\n\n"),
            false => format!("\\input{{{f}}}\n\n"),
        })
        .collect();
    assert!(
        inputs.contains("figures/error-time-rmse")
            && inputs.contains("tables/")
            && inputs.contains("methods")
    );
    let document = format!(
        "\\documentclass[twocolumn]{{article}}\n\\usepackage{{booktabs,pgfplots}}\n\
         \\usepgfplotslibrary{{groupplots,fillbetween}}\n\\pgfplotsset{{compat=1.18, table/search path={{figures}}}}\n\
         \\begin{{document}}\n{inputs}\\bibliographystyle{{plain}}\\bibliography{{references}}\n\\end{{document}}\n"
    );
    place.write("r/paper.tex", &document);
    let run = |program: &str, arguments: &[&str]| {
        let mut command = Command::new(program);
        let output = command
            .args(arguments)
            .current_dir(place.path("r"))
            .output()
            .unwrap_or_else(|e| panic!("{program}: {e}"));
        let log = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{program}: {log}");
        log
    };
    let latex = ["-interaction=nonstopmode", "-halt-on-error", "paper.tex"];
    run("pdflatex", &latex);
    let log = run("bibtex", &["paper"]);
    assert!(!log.contains("Warning"), "{log}");
    run("pdflatex", &latex);
    let log = run("pdflatex", &latex);
    for fault in ["Missing character", "undefined citations", "Citation `"] {
        assert!(!log.contains(fault), "{log}");
    }
    assert!(place.path("r/paper.pdf").is_file());
}

#[test]
fn a_report_removes_the_figures_that_it_no_longer_makes() {
    let place = Workplace::new();
    let night = NIGHT.replace("max_depth = 3", "max_depth = p.depth");
    let axis = "x:axis(\"depth\", { 2, 3 })\nx:render";
    place.write("study.lua", &night.replacen("x:render", axis, 1));
    place.succeed(&["run", "study.lua", "-q"]);
    place.succeed(&["report"]);
    let figures = |place: &Workplace| -> Vec<String> { place.ending("out/latest/report", ".svg") };
    let before = figures(&place);
    place.write("out/latest/report/figures/mine.svg", "<svg/>");
    place.succeed(&["report", "--by", "depth"]);
    let after = figures(&place);
    let page = place.read("out/latest/report/files.txt");
    for file in after.iter().filter(|file| !file.ends_with("mine.svg")) {
        let name = file.split("/report/").nth(1).unwrap();
        assert!(
            page.lines().any(|line| line == name),
            "{file} is of the last report"
        );
    }
    assert!(
        after.iter().any(|file| file.ends_with("mine.svg")),
        "{after:?}"
    );
    assert!(
        before.iter().any(|file| !after.contains(file)),
        "{before:?} {after:?}"
    );
}
