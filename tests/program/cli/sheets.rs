//! Sheets of pictures and frames, from scripts to files.

use super::workplace::Workplace;

/// Returns a script with a body after its axes, and the render table of its runs.
fn script(render: &str, rest: &str) -> String {
    format!(
        r#"
local x = experiment("sheets", {{ seed = 3, repeats = 2 }})
x:axis("technique", {{ "bpt", "nee" }})
x:axis("depth", {{ 2, 3, 4 }})
x:render(function(p)
  return {{ scene = "ball.scn", integrator = p.technique, max_depth = p.depth,
    resolution = {{ 12 * p.depth, 16 }}, {render} }}
end)
x:stop(stop.samples(4))
{rest}
return x
"#
    )
}

#[test]
fn a_night_without_reference_draws_its_sheets_and_reports_them() {
    let place = Workplace::new();
    let sheet = r#"
x:measure { every = "1s", keep = { exr = "pow2" } }
x:sheet("grid", { rows = "technique", cols = "depth", at = 2, display = tonemap.srgb { exposure = 1 } })
x:sheet("row", { cols = { "technique", "depth" } })"#;
    place.write("sheets.lua", &script("backend = \"mock\"", sheet));
    let printed = place.succeed(&["run", "sheets.lua"]).stderr;
    assert!(printed.contains("sheets     "), "{printed}");
    let grid = place.read("out/latest/sheets/grid.svg");
    assert_eq!(grid.matches("<image").count(), 6);
    for text in [
        "2 samples per pixel",
        "srgb (exposure 1)",
        "different sizes",
        "the repeats",
    ] {
        assert!(grid.contains(text), "{text} is missing");
    }
    for file in ["grid.png", "grid.pdf", "row.svg"] {
        assert!(
            place.path(&format!("out/latest/sheets/{file}")).is_file(),
            "{file}"
        );
    }
    // Without one run, a report has a gap that names its state.
    let files = place.files("out");
    let of_run = |file: &&String| file.contains("technique=nee/depth=3/rep=");
    for file in files.iter().filter(of_run) {
        std::fs::remove_file(place.path(file)).unwrap();
    }
    let ended = place.run(&["report", "out/latest", "--json"]);
    assert!(ended.stdout.contains("sheets/grid.pdf"), "{}", ended.stdout);
    let grid = place.read("out/latest/report/sheets/grid.svg");
    assert_eq!(grid.matches("<image").count(), 5);
    assert!(grid.contains(">damaged</text>"), "{grid}");
    assert!(
        place
            .read("out/latest/report/index.html")
            .contains("id=\"sheets/grid\"")
    );
}

#[test]
fn frames_of_a_time_axis_are_drawn_beside_the_density_of_a_delay() {
    let place = Workplace::new();
    let film = "backend = \"cpu\", film = { time = { start = 4, bin = 0.5, bins = 8, metres = 1 } },
      set = { [\"materials.grey.delay\"] = \"exponential\", [\"materials.grey.delay_rate\"] = p.depth }";
    let frames =
        r#"x:frames("f", { rows = "depth", at = { 5, 6 }, density = "grey", static = true })"#;
    place.write("frames.lua", &script(film, frames));
    place.succeed(&["run", "frames.lua", "-q"]);
    let svg = place.read("out/latest/sheets/f.svg");
    assert_eq!(
        (
            svg.matches("<image").count(),
            svg.matches("<polyline").count()
        ),
        (9, 3)
    );
    assert!(svg.contains("technique = bpt, the first of 2"), "{svg}");
    place.succeed(&["report", "out/latest", "-q"]);
    let beside = place.read("out/latest/report/sheets/f.svg");
    assert_eq!(beside.matches("<image").count(), 9);
}

#[test]
fn sheets_that_cannot_be_drawn_are_refused_before_the_night() {
    let place = Workplace::new();
    let mock = "backend = \"mock\"";
    let timed = "backend = \"cpu\", film = { time = { start = 4, bin = 0.5, bins = 8 } }";
    let many = "x:axis(\"a\", linspace(0, 1, 80))\nx:sheet(\"s\", { cols = { \"a\", \"depth\", \"technique\" } })";
    let wide =
        "x:axis(\"a\", linspace(0, 1, 25))\nx:sheet(\"s\", { rows = \"depth\", cols = \"a\" })";
    for (render, sheet, expected) in [
        (
            mock,
            "x:sheet(\"s\", { cols = \"deph\" })",
            "did you mean `depth`?",
        ),
        (
            mock,
            "x:sheet(\"s\", { rows = \"depth\", cols = \"depth\" })",
            "`depth` is used twice",
        ),
        (
            mock,
            "x:sheet(\"s\", { cols = \"depth\", at = \"soon\" })",
            "a render time such as",
        ),
        (
            mock,
            "x:sheet(\"s\", { cols = \"depth\", at = 64 })",
            "only final pictures are kept",
        ),
        (
            mock,
            "x:sheet(\"s\", { cols = \"depth\", display = 3 })",
            "expected a tone map",
        ),
        (mock, many, "480 pictures are more than the limit of 400"),
        (mock, wide, "25 columns are more than the limit of 24"),
        (
            mock,
            "x:frames(\"s\", { at = 5 })",
            "no run has a time axis",
        ),
        (
            timed,
            "x:frames(\"s\", { at = { 5, 9 } })",
            "9 is outside of the time axis",
        ),
        (
            timed,
            "x:frames(\"s\", { at = 5, density = \"gray\" })",
            "did you mean `grey`?",
        ),
        (timed, "x:frames(\"s\", { rows = \"depth\" })", "at"),
    ] {
        place.write("wrong.lua", &script(render, sheet));
        let error = place.fail(2, &["plan", "wrong.lua"]);
        assert!(
            error.contains(expected) && error.contains("wrong.lua"),
            "{error}"
        );
    }
}
