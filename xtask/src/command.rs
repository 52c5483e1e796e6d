//! Commands and files of chores, which have to succeed.

use std::fs;
use std::path::Path;
use std::process::Command;

/// Returns the command `cargo`, that which runs the chore, in the root of the repository.
pub fn cargo() -> Command {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(crate::root());
    cargo
}

/// Runs a command.
///
/// # Errors
/// Returns a message if it cannot be started or fails.
pub fn execute(command: &mut Command) -> Result<(), String> {
    let status = command.status().map_err(|e| format!("{command:?}: {e}"))?;
    if status.success() {
        Ok(())
    } else {
        Err(format!("{command:?} failed: {status}"))
    }
}

/// Runs a command and returns its output.
///
/// # Errors
/// Returns a message if it cannot be started, or its messages if it fails.
pub fn output(command: &mut Command) -> Result<Vec<u8>, String> {
    let ended = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    if ended.status.success() {
        Ok(ended.stdout)
    } else {
        let reason = String::from_utf8_lossy(&ended.stderr).into_owned();
        Err(format!("{command:?} failed: {reason}"))
    }
}

/// Returns the command that packs files of a folder, whose names are to be added, into a compressed
/// archive: sorted, without dates and owners, so that the same files give the same bytes.
pub fn tar(archive: &Path, folder: &Path) -> Command {
    let mut tar = Command::new("tar");
    tar.args(["--sort=name", "--mtime=@0", "--owner=0", "--group=0"])
        .args(["--numeric-owner", "-C"])
        .arg(folder)
        .arg("-czf")
        .arg(archive);
    tar
}

/// Writes a file, whose folder need not exist.
///
/// # Errors
/// Returns a message that names the file.
pub fn write(to: &Path, bytes: &[u8]) -> Result<(), String> {
    let made = to.parent().map_or(Ok(()), fs::create_dir_all);
    made.and_then(|()| fs::write(to, bytes))
        .map_err(|e| format!("{}: {e}", to.display()))
}
