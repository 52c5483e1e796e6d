//! Tests of `denoise`: what a night stores and measures, that it reproduces, and what is refused.

use lumbre_light::film::Image;
use lumbre_report::exr;

use super::workplace::Workplace;

/// Night that renders a ball as it is and denoised. Axes are in the order of the paths of its runs.
const NIGHT: &str = concat!(
    r#"
local x = experiment("clean", { seed = 5 })
local scene = ""#,
    env!("CARGO_MANIFEST_DIR"),
    r#"/scenes/cornell.lua"
x:axis("denoise", { "none", "atrous" })
x:render(function(p)
  return { scene = scene, integrator = "nee", resolution = { 48, 36 }, backend = "cpu",
    denoise = p.denoise, atrous = { levels = 3 } }
end)
x:reference { stop = stop.samples(512) }
x:measure { every = "1s", mape = metric.mape(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.samples(4) end)
x:figure("convergence", { x = "samples", y = "mape", by = "denoise" })
x:table("mape", { value = "mape", rows = "denoise" })
return x
"#
);

/// Runs the night. Returns the folders of its runs by the value of `denoise`.
fn night(text: &str) -> (Workplace, impl Fn(&str) -> String) {
    let place = Workplace::new();
    place.write("clean.lua", text);
    place.succeed(&["run", "clean.lua", "-q"]);
    let finished: Vec<String> = place.finished().into_iter().map(|(file, _)| file).collect();
    let folder = move |denoise: &str| {
        let part = format!("denoise={denoise}/");
        let run = finished.iter().find(|file| file.contains(&part));
        let run = run.unwrap_or_else(|| panic!("no run of {denoise}: {finished:?}"));
        run.trim_end_matches("/done.json").to_owned()
    };
    (place, folder)
}

fn picture(place: &Workplace, file: &str) -> Image {
    let bytes = std::fs::read(place.path(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
    exr::decode(&bytes).unwrap().0
}

fn mape(place: &Workplace, run: &str) -> f64 {
    let done = place.json(&format!("{run}/done.json"));
    done["metrics"]["mape"].as_f64().unwrap()
}

#[test]
fn the_denoised_picture_is_measured_and_the_raw_one_is_kept() {
    let (place, folder) = night(NIGHT);
    let (plain, denoised) = (folder("none"), folder("atrous"));
    let raw = picture(&place, &format!("{denoised}/raw.exr"));
    let last = picture(&place, &format!("{denoised}/final.exr"));
    assert_eq!(
        raw,
        picture(&place, &format!("{plain}/final.exr")),
        "the same samples"
    );
    assert_ne!(raw, last);
    assert!(!place.path(&format!("{plain}/raw.exr")).exists());
    // The guides are rendered but not stored.
    assert!(!place.path(&format!("{denoised}/films")).exists());
    let [before, after] = [&plain, &denoised].map(|run| mape(&place, run));
    assert!(after < 0.8 * before, "{before} {after}");
}

#[test]
fn runs_of_denoised_pictures_reproduce_with_their_snapshots() {
    let (place, folder) = night(NIGHT);
    for file in ["final.exr", "final.png", "snap-2.exr", "raw.exr"] {
        let file = format!("{}/{file}", folder("atrous"));
        let output = place.succeed(&["reproduce", &file]);
        assert!(
            output.stdout.ends_with("  identical\n"),
            "{file}: {}",
            output.stdout
        );
    }
}

#[test]
fn denoised_series_are_marked_as_biased_everywhere() {
    let (place, folder) = night(NIGHT);
    let planned = place.succeed(&["plan", "clean.lua"]).stdout;
    assert!(planned.contains("1 of 2 cells are denoised"), "{planned}");
    let table = place.read("out/latest/tables/mape.md").replace('\n', " ");
    assert!(table.contains("Denoised pictures are biased"), "{table}");
    let figure = place.read("out/latest/figures/convergence.svg");
    assert!(figure.contains("denoise = atrous (biased)"), "{figure}");
    assert!(!figure.contains("none (biased)"));
    place.succeed(&["report", "out/latest", "-q"]);
    let report = |file: &str| place.read(&format!("out/latest/report/{file}"));
    for file in [
        "tables/final-mape.md",
        "tables/final-mape.tex",
        "index.html",
    ] {
        let text = report(file);
        assert!(
            text.contains("(biased)") && text.contains("are biased"),
            "{file}"
        );
    }
    assert!(report("methods.md").contains("[Dammertz et al. 2010; Schied et al. 2017]"));
    assert!(report("references.bib").contains("{dammertz2010,"));
    let metadata = exr::decode(
        &std::fs::read(place.path(&format!("{}/final.exr", folder("atrous")))).unwrap(),
    );
    let metadata = metadata.unwrap().1;
    assert!(
        metadata
            .iter()
            .any(|(key, value)| key == "denoised by" && value.contains("wavelet"))
    );
}

#[test]
fn references_and_bias_checks_refuse_denoised_pictures() {
    let place = Workplace::new();
    for options in [
        "from = function(p) return { denoise = \"atrous\" } end, stop = stop.samples(8)",
        "stop = stop.samples(8), agree = { with = { integrator = \"bdpt\", denoise = \"atrous\" } }",
    ] {
        let text = NIGHT.replace("stop = stop.samples(512)", options);
        place.write("clean.lua", &text);
        let error = place.fail(2, &["plan", "clean.lua"]);
        assert!(error.contains("denoised pictures are biased"), "{error}");
    }
    // The cell's denoiser is not inherited.
    let agree = NIGHT.replace(
        "stop = stop.samples(512)",
        "stop = stop.samples(8), agree = { with = \"bdpt\" }",
    );
    place.write("clean.lua", &agree);
    place.succeed(&["plan", "clean.lua"]);
}

#[test]
fn none_leaves_run_ids_alone_and_parameters_change_them() {
    let place = Workplace::new();
    let id = |keys: &str| {
        let text = NIGHT
            .replace("{ \"none\", \"atrous\" }", "{ \"x\" }")
            .replace("denoise = p.denoise, atrous = { levels = 3 }", keys);
        place.write("clean.lua", &text);
        let planned = place.succeed(&["plan", "clean.lua", "--json"]).stdout;
        let json: serde_json::Value = serde_json::from_str(&planned).unwrap();
        json["cells"][0]["run"].as_str().unwrap().to_owned()
    };
    let plain = id("");
    assert_eq!(id("denoise = \"none\", atrous = { levels = 3 }"), plain);
    let three = id("denoise = \"atrous\", atrous = { levels = 3 }");
    assert_ne!(three, plain);
    assert_ne!(id("denoise = \"atrous\""), three);
    assert_eq!(
        id("denoise = \"atrous\", atrous = { levels = 4 }"),
        id("denoise = \"atrous\"")
    );
}

#[test]
fn wrong_settings_and_backends_without_films_are_refused() {
    let place = Workplace::new();
    for (from, to, words) in [
        ("\"atrous\" }", "\"blur\" }", "unknown value `blur`"),
        ("levels = 3", "levels = 11", "out of range"),
        ("levels = 3", "radius = 3", "unknown key `radius`"),
        (
            "backend = \"cpu\"",
            "backend = \"mock\"",
            "does not support the layer `albedo`",
        ),
    ] {
        place.write("clean.lua", &NIGHT.replace(from, to));
        let error = place.fail(2, &["plan", "clean.lua"]);
        assert!(error.contains(words), "{words}: {error}");
    }
}

#[test]
fn a_picture_without_a_script_is_denoised() {
    let place = Workplace::new();
    let render = |name: &str, more: &[&str]| {
        let mut words = vec![
            "render", "ball.scn", "--spp", "8", "--size", "32x24", "-o", name,
        ];
        words.extend(more);
        place.succeed(&words).stderr
    };
    render("a.exr", &[]);
    let said = render("b.exr", &["--denoise"]);
    assert!(
        said.contains("denoised by") && said.contains("biased"),
        "{said}"
    );
    render("c.exr", &["denoise=atrous", "--threads", "3"]);
    let [a, b, c] = ["a.exr", "b.exr", "c.exr"].map(|file| picture(&place, file));
    assert_ne!(a, b);
    assert_eq!(b, c, "any number of threads");
}

#[test]
fn open_image_denoise_is_loaded_where_it_is_named_and_left_out_elsewhere() {
    let text = NIGHT.replace("\"none\", \"atrous\"", "\"none\", \"oidn\"");
    let place = Workplace::new();
    place.write("clean.lua", &text);
    place.write("no.so", "no library");
    let mut without = place.command(&["plan", "clean.lua"]);
    let output = without
        .env("LUMBRE_OIDN", place.path("no.so"))
        .output()
        .unwrap();
    let planned = String::from_utf8(output.stdout).unwrap();
    assert!(planned.contains("LUMBRE_OIDN"), "{planned}");
    if std::env::var_os("LUMBRE_OIDN").is_none() {
        crate::common::skipped("no Open Image Denoise; name its library with LUMBRE_OIDN");
        return;
    }
    let (place, folder) = night(&text);
    let denoised = folder("oidn");
    let [before, after] = [&folder("none"), &denoised].map(|run| mape(&place, run));
    assert!(after < 0.8 * before, "{before} {after}");
    let config = place.json(&format!("{denoised}/config.json"));
    let version = config["render"]["denoise"]["version"].as_str().unwrap();
    assert!(version.starts_with("2."), "{version}");
    let output = place.succeed(&["reproduce", &format!("{denoised}/final.exr")]);
    assert!(
        output.stdout.ends_with("  identical\n"),
        "{}",
        output.stdout
    );
}
