//! Damage to the files of a finished night. Whatever happens to a file, a report must show what it
//! showed before or say what is wrong, and the next `run` must bring all results back.

use std::path::Path;
use std::process::Command;

use super::night::{Room, Site, difference};
use super::{Random, Verdict};

/// Changes bytes of a file and keeps its size.
pub fn changed(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    attack(site, random, |room, file, bytes, random| {
        let mut bytes = bytes.to_vec();
        for _ in 0..=random.below(8) {
            let at = random.below(bytes.len());
            bytes[at] ^= 1 << random.below(8);
        }
        room.write(file, &bytes)
    })
}

/// Cuts a file.
pub fn cut(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    attack(site, random, |room, file, bytes, random| {
        room.write(file, &bytes[..random.below(bytes.len())])
    })
}

/// Removes a file.
pub fn removed(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    attack(site, random, |room, file, _, _| remove(&room.file(file)))
}

/// Exchanges two files that have the same name.
pub fn exchanged(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    attack(site, random, |room, file, bytes, random| {
        let name = |path: &str| path.rsplit('/').next().map(str::to_owned);
        let all = room.all();
        let twins: Vec<_> = all
            .iter()
            .filter(|(other, content)| {
                name(other) == name(file) && *other != file && *content != bytes
            })
            .collect();
        if twins.is_empty() {
            return Ok(());
        }
        let (other, content) = *random.pick(&twins);
        room.write(other, bytes)?;
        room.write(file, content)
    })
}

/// Puts a pipe, which would block a reader for ever, in place of a file.
pub fn pipe(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    attack(site, random, |room, file, _, _| {
        let path = room.file(file);
        remove(&path)?;
        let status = Command::new("mkfifo").arg(&path).status();
        match status {
            Ok(status) if status.success() => Ok(()),
            _ => Err("cannot make a pipe".to_owned()),
        }
    })
}

fn remove(path: &Path) -> Result<(), String> {
    std::fs::remove_file(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// Damages a random file of a copy of the finished night and judges what the program does.
fn attack(
    site: &Site,
    random: &mut Random,
    damage: impl Fn(&Room, &str, &[u8], &mut Random) -> Result<(), String>,
) -> Result<Verdict, String> {
    let room = site.finished_room()?;
    let all = room.all();
    // Reports are made again from the files of the night, and nothing reads them.
    let names: Vec<&String> = all
        .iter()
        .filter(|(name, bytes)| !bytes.is_empty() && !name.contains("/report/"))
        .map(|(name, _)| name)
        .collect();
    let file = (*random.pick(&names)).clone();
    damage(&room, &file, &all[&file], random)?;
    let verdict = judge(site, &room)?;
    Ok(match verdict {
        Verdict::Failed(problem) => Verdict::Failed(format!("{file}: {problem}")),
        other => other,
    })
}

/// Reads the damaged night with several verbs, then repairs it.
fn judge(site: &Site, room: &Room) -> Result<Verdict, String> {
    let mut is_noticed = false;
    for arguments in [
        &["ls"][..],
        &["status", "out/latest"],
        &["report", "out/latest", "-q"],
    ] {
        let ended = room.run(arguments)?;
        if let Some(crash) = ended.crash() {
            return Ok(Verdict::Failed(format!(
                "`{}`: {crash}",
                arguments.join(" ")
            )));
        }
        is_noticed |= matches!(ended.code, Some(2 | 3));
    }
    let report = room.report();
    if let (false, Some(other)) = (is_noticed, difference(&site.report, &report)) {
        return Ok(Verdict::Failed(format!(
            "{other} of the report differs in silence"
        )));
    }
    let ended = room.run(&["run", "night.lua"])?;
    if let Some(crash) = ended.crash() {
        return Ok(Verdict::Failed(format!("`run`: {crash}")));
    }
    if ended.code != Some(0) {
        return Ok(Verdict::Failed(format!(
            "`run` does not repair it: {}",
            ended.excerpt()
        )));
    }
    if let Some(other) = difference(&site.results, &room.results()) {
        return Ok(Verdict::Failed(format!("{other} differs after the repair")));
    }
    let words = ["damaged", "cut off", "incomplete", "not a regular file"];
    is_noticed |= words.iter().any(|word| ended.text.contains(word));
    Ok(if is_noticed {
        Verdict::Noticed
    } else {
        Verdict::Harmless
    })
}
