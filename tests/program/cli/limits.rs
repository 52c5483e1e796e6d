//! Runs that need more memory than there is.

use std::process::Command;

use super::workplace::Workplace;

/// A small cell, and one of 16,384 x 16,384 pixels, which needs 36 GB.
const NIGHT: &str = r#"
local x = experiment("sizes", { seed = 1 })
x:axis("side", { 16, 16384 })
x:render(function(p)
  return { scene = "ball.scn", integrator = "nee", resolution = { p.side, p.side }, max_depth = 2 }
end)
x:measure { every = "1s", display = tonemap.srgb() }
x:stop(stop.samples(1))
return x
"#;

fn workplace() -> Workplace {
    let place = Workplace::new();
    place.write("night.lua", NIGHT);
    place
}

#[test]
fn a_run_that_needs_more_memory_than_allowed_fails_and_the_others_are_rendered() {
    let place = workplace();
    let plan = place.succeed(&["plan", "night.lua", "--memory", "1GiB"]);
    for part in [
        "a run takes up to 34",
        "warning: the run needs 32.0 GiB of memory",
        "1.0 GiB are allowed by `--memory`",
    ] {
        assert!(plan.stdout.contains(part), "{part}: {}", plan.stdout);
    }
    let night = place.run(&["run", "night.lua", "--memory", "1GiB"]);
    assert_eq!(night.status, 3, "{}", night.stderr);
    assert!(
        night.stderr.contains("1.0 GiB are allowed by `--memory`"),
        "{}",
        night.stderr
    );
    assert_eq!(place.finished().len(), 1, "the small cell");
}

#[test]
fn the_limit_of_the_address_space_counts() {
    let place = workplace();
    let program = env!("CARGO_BIN_EXE_lumbre");
    let command = format!("ulimit -v 12000000; exec {program} run night.lua -q --threads 1");
    let mut shell = Command::new("bash");
    shell.args(["-c", &command]).current_dir(place.path("."));
    let ended = shell.output().unwrap();
    let error = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(3), "{error}");
    assert!(
        error.contains("the run needs 32.0 GiB of memory"),
        "{error}"
    );
    assert_eq!(place.finished().len(), 1, "the small cell");
}
