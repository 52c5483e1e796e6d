//! Submitting to absent queues, and to one that a script simulates.

use std::os::unix::fs::PermissionsExt;

use super::night::{home, script};
use super::workplace::Workplace;
use lumbre_night::store::lock::filesystem_kind;

/// Creates programs that simulate a queue: they record their arguments and answer in its format.
fn with_queue(place: &Workplace) -> String {
    let bin = place.path("bin");
    std::fs::create_dir(&bin).unwrap();
    let install = |name: &str, body: &str| {
        let file = bin.join(name);
        let log = place.path("calls");
        let text = format!(
            "#!/bin/sh\necho {name} \"$@\" >> '{}'\n{body}\n",
            log.display()
        );
        std::fs::write(&file, text).unwrap();
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o755)).unwrap();
    };
    install("sbatch", "echo '1207;cluster'");
    install("scancel", "true");
    install(
        "sacct",
        "echo 'Slurm accounting storage is disabled' >&2; exit 1",
    );
    install(
        "squeue",
        "echo '1207_0|RUNNING|n1|None|0|'; echo '1207_1|PENDING||Resources|0|'",
    );
    install("hq", "echo 31");
    format!("{}:{}", bin.display(), std::env::var("PATH").unwrap())
}

#[test]
fn a_job_is_submitted_listed_and_cancelled() {
    let place = Workplace::new();
    place.write("grid.lua", &script(0));
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
    let (dry, _) = run(&["submit", "slurm", "grid.lua", "--workers", "3", "--dry-run"]);
    assert!(
        dry.starts_with("#!/bin/bash\n#SBATCH --job-name=lumbre-grid\n#SBATCH --array=0-2\n"),
        "{dry}"
    );
    assert!(
        !place.path("out").exists() && !place.path("calls").exists(),
        "a dry run must write and submit nothing"
    );
    let (id, stderr) = run(&[
        "submit",
        "slurm",
        "grid.lua",
        "depth=2",
        "--workers",
        "3",
        "--",
        "--account=light",
    ]);
    assert_eq!(id, "1207\n");
    assert!(
        stderr.contains("3 workers for 6 cells") && stderr.contains("lumbre watch"),
        "{stderr}"
    );
    // In a changed root the system does not tell on which file system a folder is.
    let kind = filesystem_kind::detect(&place.path("out"));
    let is_local = kind.is_some_and(|kind| !filesystem_kind::is_network(&kind));
    assert_eq!(stderr.contains("is on a local file system"), is_local);
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
    run(&["submit", "hq", "grid.lua", "depth=2", "--workers", "2"]);
    assert!(
        place
            .read(&format!("{home}/job/hq.sh"))
            .contains("#HQ --array=0-1")
    );
    let (_, stderr) = run(&["cancel", &home]);
    assert!(
        stderr.contains("job 1207 was cancelled") && stderr.contains("job 31 was cancelled"),
        "{stderr}"
    );
    assert!(
        place.read("calls").contains("scancel 1207\n")
            && place.read("calls").contains("hq job cancel 31")
    );
}

#[test]
fn a_missing_queue_program_is_reported_and_the_plan_is_saved() {
    let place = Workplace::new();
    place.write("grid.lua", &script(0));
    let output = place
        .command(&["submit", "hq", "grid.lua"])
        .env("PATH", "/nowhere")
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("`hq` is not installed on this machine")
            && stderr.contains("The plan is saved"),
        "{stderr}"
    );
    assert!(
        place
            .path(&format!("{}/snapshot.json", home(&place, "out")))
            .is_file()
    );
}
