//! A small night, finished once without disturbance, and copies of it to attack.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::program::{self, Ended};
use lumbre_night::paths::files_below;

/// A grey ball under an area light.
const SCENE: &str = include_str!("../../../tests/common/ball.scn");

/// Two depths, two repeats, references, figures and a table. Results do not depend on clocks.
const SCRIPT: &str = include_str!("../../../tests/common/night.lua");

/// Name of the folder of a night.
const NIGHT: &str = "night";

/// Files by path below a folder.
pub type Files = BTreeMap<String, Vec<u8>>;

/// The program, and the undisturbed night.
pub struct Site {
    program: PathBuf,
    folder: tempfile::TempDir,
    /// Results of the undisturbed night.
    pub results: Files,
    /// Report of the undisturbed night.
    pub report: Files,
}

/// A folder with the scene and the script, in which the program is run.
pub struct Room {
    program: PathBuf,
    folder: tempfile::TempDir,
}

impl Site {
    /// Renders the undisturbed night and its report.
    ///
    /// # Errors
    /// Returns a message if that fails.
    pub fn new(program: &Path) -> Result<Site, String> {
        let mut site = Site {
            program: program.to_owned(),
            folder: tempfile::tempdir().map_err(|e| e.to_string())?,
            results: Files::new(),
            report: Files::new(),
        };
        let room = site.empty_room()?;
        for arguments in [
            &["run", "night.lua", "-q"][..],
            &["report", "out/latest", "-q"],
        ] {
            let ended = room.run(arguments)?;
            if ended.code != Some(0) {
                return Err(format!("{arguments:?} failed: {}", ended.excerpt()));
            }
        }
        (site.results, site.report) = (room.results(), room.report());
        copy(&room.path(), &site.folder.path().join(NIGHT))?;
        Ok(site)
    }

    /// Returns the program.
    pub fn program(&self) -> &Path {
        &self.program
    }

    /// Returns a folder without results.
    ///
    /// # Errors
    /// Returns a message if it cannot be made.
    pub fn empty_room(&self) -> Result<Room, String> {
        let room = self.room()?;
        std::fs::create_dir(room.path()).map_err(|e| e.to_string())?;
        room.write("ball.scn", SCENE.as_bytes())?;
        room.write("night.lua", SCRIPT.as_bytes())?;
        Ok(room)
    }

    /// Returns a copy of the finished night.
    ///
    /// # Errors
    /// Returns a message if it cannot be copied.
    pub fn finished_room(&self) -> Result<Room, String> {
        let room = self.room()?;
        copy(&self.folder.path().join(NIGHT), &room.path())?;
        Ok(room)
    }

    fn room(&self) -> Result<Room, String> {
        Ok(Room {
            program: self.program.clone(),
            folder: tempfile::tempdir().map_err(|e| e.to_string())?,
        })
    }
}

impl Room {
    /// Returns the folder in which the program runs.
    pub fn path(&self) -> PathBuf {
        self.folder.path().join(NIGHT)
    }

    /// Writes a file, and creates its folder.
    ///
    /// # Errors
    /// Returns a message if that fails.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), String> {
        let path = self.path().join(name);
        let folder = path.parent().unwrap_or(&path);
        std::fs::create_dir_all(folder)
            .and_then(|()| std::fs::write(&path, bytes))
            .map_err(|e| format!("{}: {e}", path.display()))
    }

    /// Returns the program as a command in this folder.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.program);
        command.args(arguments);
        self.at_home(&mut command);
        command
    }

    /// Returns the program as a command that a shell starts after `before`.
    pub fn command_after(&self, before: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new("sh");
        let line = format!("{before}; exec \"$0\" \"$@\"");
        command
            .args(["-c", &line])
            .arg(&self.program)
            .args(arguments);
        self.at_home(&mut command);
        command
    }

    /// Makes a command run in this folder without the user's settings.
    fn at_home(&self, command: &mut Command) {
        command.current_dir(self.path()).env("NO_COLOR", "1");
        for name in ["LUMBRE_LOG", "RUST_BACKTRACE", "CLICOLOR_FORCE"] {
            command.env_remove(name);
        }
    }

    /// Runs the program to its end.
    ///
    /// # Errors
    /// Returns a message if it cannot be started.
    pub fn run(&self, arguments: &[&str]) -> Result<Ended, String> {
        program::end(&mut self.command(arguments))
    }

    /// Returns the path of a file of the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    /// Returns all files of the night's folders.
    pub fn all(&self) -> Files {
        read(&self.path(), "out", &|_| true)
    }

    /// Returns the results that no clock changes, without those of reports.
    pub fn results(&self) -> Files {
        let is_result = |path: &str| {
            let name = path.rsplit('/').next().unwrap_or_default();
            let kinds = [".exr", ".png", ".md", ".svg", ".lua"];
            !path.contains("/report/")
                && (kinds.iter().any(|kind| name.ends_with(kind))
                    || ["plan.json", "config.json"].contains(&name))
        };
        read(&self.path(), "out", &is_result)
    }

    /// Returns the files of the report.
    pub fn report(&self) -> Files {
        read(&self.path(), "out", &|path| path.contains("/report/"))
    }
}

/// Reads the files below a folder whose path satisfies a condition. Links are not followed.
fn read(root: &Path, below: &str, wanted: &dyn Fn(&str) -> bool) -> Files {
    let named = files_below(&root.join(below)).into_iter().map(|path| {
        let name = path.strip_prefix(root).unwrap_or(&path);
        (name.to_string_lossy().replace('\\', "/"), path)
    });
    let wanted = named.filter(|(name, _)| wanted(name));
    wanted
        .map(|(name, path)| (name, std::fs::read(path).unwrap_or_default()))
        .collect()
}

/// Returns the name of the first file that differs.
pub fn difference(expected: &Files, actual: &Files) -> Option<String> {
    let names = expected.keys().chain(actual.keys());
    names
        .into_iter()
        .find(|name| expected.get(*name) != actual.get(*name))
        .cloned()
}

/// Copies a folder with its links.
fn copy(from: &Path, to: &Path) -> Result<(), String> {
    let status = Command::new("cp").arg("-a").arg(from).arg(to).status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("cp ended with {status}")),
        Err(e) => Err(format!("cannot start cp: {e}")),
    }
}
