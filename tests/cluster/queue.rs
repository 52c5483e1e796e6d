//! Submitting to absent queues, and to one that a script simulates.

use std::os::unix::fs::PermissionsExt;

use super::night::{home, script};
use super::workplace::Workplace;

/// Creates programs that simulate a queue: they record their arguments and answer in its format.
fn with_queue(place: &Workplace) -> String {
    let bin = place.path("bin");
    std::fs::create_dir(&bin).unwrap();
    let play = |name: &str, body: &str| {
        let file = bin.join(name);
        let log = place.path("calls");
        let text = format!(
            "#!/bin/sh\necho {name} \"$@\" >> '{}'\n{body}\n",
            log.display()
        );
        std::fs::write(&file, text).unwrap();
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o755)).unwrap();
    };
    play("sbatch", "echo '1207;cluster'");
    play("scancel", "true");
    play(
        "sacct",
        "echo 'Slurm accounting storage is disabled' >&2; exit 1",
    );
    play(
        "squeue",
        "echo '1207_0|RUNNING|n1|None|0|'; echo '1207_1|PENDING||Resources|0|'",
    );
    play("hq", "echo 31");
    format!("{}:{}", bin.display(), std::env::var("PATH").unwrap())
}

#[test]
fn a_job_is_submitted_watched_and_taken_back() {
    let place = Workplace::new();
    place.write("crew.lua", &script(0));
    let path = with_queue(&place);
    let run = |args: &[&str]| {
        let output = place.command(args).env("PATH", &path).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(
            output.status.success(),
            "{args:?}: {}",
            text(&output.stderr)
        );
        (text(&output.stdout), text(&output.stderr))
    };
    let (dry, _) = run(&["submit", "slurm", "crew.lua", "--workers", "3", "--dry-run"]);
    assert!(
        dry.starts_with("#!/bin/bash\n#SBATCH --job-name=lumbre-crew\n#SBATCH --array=0-2\n"),
        "{dry}"
    );
    assert!(
        !place.path("out").exists() && !place.path("calls").exists(),
        "dry means dry"
    );
    let (id, said) = run(&[
        "submit",
        "slurm",
        "crew.lua",
        "depth=2",
        "--workers",
        "3",
        "--",
        "--account=light",
    ]);
    assert_eq!(id, "1207\n");
    assert!(
        said.contains("3 workers for 6 cells")
            && said.contains("lumbre watch")
            && said.contains("warning"),
        "{said}"
    );
    let home = home(&place, "out");
    assert!(
        place
            .read("calls")
            .contains("sbatch --parsable --account=light"),
        "{}",
        place.read("calls")
    );
    let script = place.read(&format!("{home}/job/slurm.sh"));
    assert!(
        script.contains(&format!("{home}'")) && !script.contains("--gres"),
        "{script}"
    );
    let (status, _) = run(&["status", &home]);
    let words = status.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        words.contains("1207_0 RUNNING n1") && words.contains("1207_1 PENDING Resources"),
        "{status}"
    );
    let json: serde_json::Value =
        serde_json::from_str(&run(&["status", &home, "--json"]).0).unwrap();
    assert_eq!(json["cluster"]["jobs"][1]["reason"], "Resources");
    run(&["submit", "hq", "crew.lua", "depth=2", "--workers", "2"]);
    assert!(
        place
            .read(&format!("{home}/job/hq.sh"))
            .contains("#HQ --array=0-1")
    );
    let (_, said) = run(&["cancel", &home]);
    assert!(
        said.contains("job 1207 was cancelled") && said.contains("job 31 was cancelled"),
        "{said}"
    );
    assert!(
        place.read("calls").contains("scancel 1207\n")
            && place.read("calls").contains("hq job cancel 31")
    );
}

#[test]
fn a_queue_that_is_not_there_is_said() {
    let place = Workplace::new();
    place.write("crew.lua", &script(0));
    let output = place
        .command(&["submit", "hq", "crew.lua"])
        .env("PATH", "/nowhere")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("`hq` is not installed on this machine")
            && said.contains("The plan is saved"),
        "{said}"
    );
    assert!(
        place
            .path(&format!("{}/frozen.json", home(&place, "out")))
            .is_file()
    );
}
