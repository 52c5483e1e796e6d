//! Files that were truncated or changed after the program wrote them.

use std::collections::BTreeMap;

use super::workplace::Workplace;

/// Returns the files that must be the same after every repair: results without times, and their
/// descriptions.
fn results(place: &Workplace) -> BTreeMap<String, Vec<u8>> {
    let wanted = |file: &String| {
        let name = file.rsplit('/').next().unwrap();
        [".exr", ".png", ".md", ".svg", ".lua"]
            .iter()
            .any(|end| name.ends_with(end))
            || ["plan.json", "config.json"].contains(&name)
    };
    let read = |file: String| (file.clone(), std::fs::read(place.path(&file)).unwrap());
    place
        .files("out")
        .into_iter()
        .filter(wanted)
        .map(read)
        .collect()
}

/// Returns one file of every kind that a night writes.
fn kinds(place: &Workplace) -> Vec<String> {
    let mut seen = BTreeMap::new();
    // `out/latest` is a link to a folder.
    for file in place
        .files("out")
        .into_iter()
        .filter(|file| place.path(file).is_file())
    {
        let name = file.rsplit('/').next().unwrap();
        let kind = (
            name.trim_end_matches(|c: char| c.is_ascii_digit())
                .to_owned(),
            file.contains("/refs/"),
        );
        seen.entry(kind).or_insert_with(|| file.clone());
    }
    seen.into_values().collect()
}

#[test]
fn a_truncated_or_changed_file_of_any_kind_is_repaired_and_intact_runs_are_kept() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q"]);
    let before = results(&place);
    let all = kinds(&place);
    assert!(all.len() >= 18, "{all:?}");
    for file in &all {
        for truncated in [true, false] {
            let finished = place.finished();
            let whole = std::fs::read(place.path(file)).unwrap();
            let mut bytes = whole.clone();
            if bytes.is_empty() {
                continue;
            }
            let middle = bytes.len() / 2;
            if truncated {
                bytes.truncate(middle)
            } else {
                bytes[middle] ^= 4
            }
            std::fs::write(place.path(file), bytes).unwrap();
            let how = if truncated { "truncated" } else { "changed" };
            let night = place.run(&["run", "night.lua"]);
            assert_eq!(night.status, 0, "{file} {how}: {}", night.stderr);
            let after = results(&place);
            let names = |map: &BTreeMap<String, Vec<u8>>| map.keys().cloned().collect::<Vec<_>>();
            assert_eq!(names(&after), names(&before), "{file} {how}");
            for (name, bytes) in &after {
                assert!(
                    *bytes == before[name],
                    "{name} differs after {file} was {how}: {}",
                    night.stderr
                );
            }
            let rendered = place
                .finished()
                .iter()
                .filter(|run| !finished.contains(run))
                .count();
            let folder = file.rsplit_once('/').unwrap().0;
            let is_checksummed = file.contains("/runs/")
                && !file.ends_with("config.json")
                && !file.ends_with("log.txt");
            assert_eq!(
                rendered,
                usize::from(is_checksummed),
                "{file} {how}: {}",
                night.stderr
            );
            let reported = night
                .stderr
                .lines()
                .filter(|l| {
                    ["damaged", "cut off", "incomplete"]
                        .iter()
                        .any(|w| l.contains(w))
                })
                .count();
            // A damaged file that identifies a run is reported in one line; other damage is
            // reported at most once. Sums are read only when a longer reference continues from
            // them.
            let refs =
                file.contains("/refs/") && !file.contains("/sums/") && !file.ends_with("log.txt");
            let must_report = is_checksummed || file.ends_with("/config.json") || refs;
            assert!(
                reported == 1 || (reported == 0 && !must_report),
                "{file} {how} in {folder}: {}",
                night.stderr
            );
            if file.contains("/sums/") || file.contains("/affinity/") {
                // Restore the file: no command repairs a file that none reads, and its damage would
                // be reported together with that of the next file.
                std::fs::write(place.path(file), whole).unwrap();
            }
        }
    }
    assert!(
        place
            .succeed(&["run", "night.lua"])
            .stderr
            .contains("nothing to do")
    );
}

#[test]
fn files_of_a_killed_process_do_not_affect_the_next_night() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q"]);
    let before = results(&place);
    let done = place.finished().remove(0).0;
    let folder = done.trim_end_matches("/done.json");
    std::fs::remove_file(place.path(&done)).unwrap();
    for name in [
        "claim",
        "ckpt.a",
        "ckpt.b",
        "failed.json",
        ".lumbre-abc.tmp",
    ] {
        place.write(
            &format!("{folder}/{name}"),
            "written by a process that was killed",
        );
    }
    place.write("out/latest/lock", "12345");
    let night = place.succeed(&["run", "night.lua"]);
    assert!(
        night.stderr.contains("ckpt.a is damaged"),
        "{}",
        night.stderr
    );
    assert_eq!(results(&place), before);
    let remaining = place.files(folder);
    assert!(
        !remaining
            .iter()
            .any(|f| f.contains("ckpt") || f.ends_with("claim") || f.ends_with("failed.json")),
        "{remaining:?}"
    );
}
