//! Nights that meet limits of the system, and terminals of any size.

use std::process::Command;

use super::night::{Room, Site, difference};
use super::program;
use super::{Random, Verdict};

/// Rows and columns of hostile terminals.
const SIZES: [usize; 9] = [0, 1, 2, 3, 10, 80, 500, 5_000, 65_535];

/// Limits the size of files, as a full disk does.
pub fn file_size(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    let limit = format!("ulimit -f {}", random.below(40));
    limited(site, &limit)
}

/// Limits the number of open files.
pub fn open_files(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    // Fewer than the loader of shared libraries needs would not start any program.
    let limit = format!("ulimit -n {}", 4 + random.below(40));
    limited(site, &limit)
}

/// Runs a night under a limit, which it must survive or name, then without.
fn limited(site: &Site, limit: &str) -> Result<Verdict, String> {
    let room = site.empty_room()?;
    let ended = program::end(&mut room.command_after(limit, &["run", "night.lua", "-q"]))?;
    if let Some(crash) = ended.crash() {
        return Ok(Verdict::Failed(format!("`{limit}`: {crash}")));
    }
    let is_noticed = ended.code != Some(0);
    if is_noticed && !ended.text.contains("ulimit") {
        return Ok(Verdict::Failed(format!(
            "`{limit}` is not named: {}",
            ended.excerpt()
        )));
    }
    Ok(match finish(site, &room)? {
        Some(problem) => Verdict::Failed(format!("after `{limit}`: {problem}")),
        None if is_noticed => Verdict::Noticed,
        None => Verdict::Harmless,
    })
}

/// Runs a night with its dashboard in a terminal of any size.
pub fn terminal(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    let room = site.empty_room()?;
    let (rows, columns) = (*random.pick(&SIZES), *random.pick(&SIZES));
    let kind = *random.pick(&["xterm-256color", "dumb", "vt100", "xterm-kitty", ""]);
    let line = format!(
        "stty rows {rows} columns {columns}; exec '{}' run night.lua",
        site.program().display()
    );
    let mut command = Command::new("script");
    command
        .args(["-q", "-e", "-c", &line, "/dev/null"])
        .current_dir(room.path())
        .env("TERM", kind);
    let ended = match program::end(&mut command) {
        Ok(ended) => ended,
        Err(_) => return Ok(Verdict::Skipped("`script` of util-linux is not installed")),
    };
    let size = format!("{rows} rows, {columns} columns, TERM={kind}");
    if let Some(crash) = ended.crash() {
        return Ok(Verdict::Failed(format!("{size}: {crash}")));
    }
    Ok(match finish(site, &room)? {
        Some(problem) => Verdict::Failed(format!("{size}: {problem}")),
        None => Verdict::Harmless,
    })
}

/// Runs a night to its end and compares its results; returns what is wrong.
fn finish(site: &Site, room: &Room) -> Result<Option<String>, String> {
    let ended = room.run(&["run", "night.lua", "-q"])?;
    if ended.code != Some(0) {
        return Ok(Some(ended.excerpt()));
    }
    let other = difference(&site.results, &room.results());
    Ok(other.map(|name| format!("{name} differs")))
}
