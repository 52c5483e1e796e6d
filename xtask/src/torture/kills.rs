//! Nights that are killed, stopped by signals, or run under clocks that are wrong.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

use lumbre_night::experiment::spec::Order;

use super::night::{Room, Site, difference};
use super::{Random, Verdict};

/// Signals that may end a night.
const SIGNALS: [&str; 7] = ["INT", "TERM", "HUP", "USR1", "QUIT", "ABRT", "KILL"];

/// Longest time before a signal, in milliseconds; an undisturbed night takes about half of it.
const PAUSE_MS: usize = 400;

/// Kills nights of one to four processes with the test of the program itself.
pub fn kill(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    let processes = (1 + random.below(4)).to_string();
    let seed = random.below(1 << 30).to_string();
    let order = *random.pick(Order::NAMES);
    let room = site.empty_room()?;
    let arguments = [
        "verify",
        "--kill",
        "20",
        "--processes",
        &processes,
        "--order",
        order,
        "--seed",
        &seed,
        "--threads",
        "1",
    ];
    let ended = room.run(&arguments)?;
    Ok(match ended.code {
        Some(0) => Verdict::Harmless,
        _ => {
            let problem = ended.crash().unwrap_or_else(|| ended.excerpt());
            Verdict::Failed(format!("`{}`: {problem}", arguments.join(" ")))
        }
    })
}

/// Sends a signal at a random instant.
pub fn signal(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    let room = site.empty_room()?;
    let signal = *random.pick(&SIGNALS);
    interrupt(
        &room,
        room.command(&["run", "night.lua", "-q"]),
        signal,
        random,
    )?;
    resume(site, &room, signal)
}

/// Kills a night under a clock that is days off, and resumes it with the right one.
pub fn clock(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    let Some(library) = faketime() else {
        return Ok(Verdict::Skipped("libfaketime is not installed"));
    };
    let room = site.empty_room()?;
    let days = random.below(20_000) as i64 - 10_000;
    let mut command = room.command(&["run", "night.lua", "-q"]);
    command
        .env("LD_PRELOAD", library)
        .env("FAKETIME", format!("{days:+}d"))
        .env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
    interrupt(&room, command, "KILL", random)?;
    resume(site, &room, &format!("a clock {days} days off"))
}

/// Returns the library that fakes the clock of a process, where it is installed.
fn faketime() -> Option<PathBuf> {
    let folders = std::fs::read_dir("/usr/lib").ok()?.flatten();
    let mut paths = folders.map(|f| f.path().join("faketime/libfaketimeMT.so.1"));
    paths.find(|path| path.is_file())
}

/// Starts a night and sends it a signal after a random time.
fn interrupt(
    room: &Room,
    mut command: Command,
    signal: &str,
    random: &mut Random,
) -> Result<(), String> {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let mut child = command
        .spawn()
        .map_err(|e| format!("cannot start the program in {}: {e}", room.path().display()))?;
    std::thread::sleep(Duration::from_micros(random.below(PAUSE_MS * 1000) as u64));
    let id = child.id().to_string();
    let mut kill = Command::new("kill");
    // The night may have ended before the signal.
    let _ = kill
        .args(["-s", signal, &id])
        .stderr(Stdio::null())
        .status();
    child.wait().map_err(|e| e.to_string())?;
    Ok(())
}

/// Runs an interrupted night to its end and compares its results.
fn resume(site: &Site, room: &Room, cause: &str) -> Result<Verdict, String> {
    let ended = room.run(&["run", "night.lua", "-q"])?;
    if ended.code != Some(0) {
        return Ok(Verdict::Failed(format!(
            "after {cause}: {}",
            ended.excerpt()
        )));
    }
    let left = |name: &&String| name.ends_with("/claim") || name.contains("/ckpt.");
    let all = room.all();
    if let Some(name) = all.keys().find(left) {
        return Ok(Verdict::Failed(format!(
            "after {cause}: {name} is left behind"
        )));
    }
    Ok(match difference(&site.results, &room.results()) {
        Some(other) => Verdict::Failed(format!("after {cause}: {other} differs")),
        None => Verdict::Harmless,
    })
}
