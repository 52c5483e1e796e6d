//! A folder with a small scene and scripts, in which the program is run.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value as Json;

/// A folder for one test.
pub struct Workplace {
    dir: tempfile::TempDir,
}

/// Exit status and output of the program.
pub struct ProgramOutput {
    pub status: i32,
    pub stdout: String,
    pub stderr: String,
}

impl ProgramOutput {
    /// Runs a command to its end.
    pub fn run(command: &mut Command) -> ProgramOutput {
        let output = command.output().unwrap();
        ProgramOutput {
            status: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Expects this status of a program that was run with these arguments.
    pub fn expect(self, status: i32, args: &[&str]) -> ProgramOutput {
        let (out, err) = (&self.stdout, &self.stderr);
        assert_eq!(self.status, status, "{args:?}\n{out}\n{err}");
        self
    }
}

/// A grey ball under an area light.
const SCENE: &str = include_str!("../../common/ball.scn");

/// Two depths, two seeds, a reference for each depth, metrics, a figure and a table.
const SCRIPT: &str = include_str!("../../common/night.lua");

/// Many cells that each take real time, independent of the fake clock: the predicate keeps the
/// processor busy.
pub const SLOW: &str = r#"
local x = experiment("slow", { seed = 1, repeats = 24 })
local function busy_loop(row)
  local n = 0
  for i = 1, 3000000 do n = n + i % 7 end
  return row.wave >= 3
end
x:render(function(p) return { scene = "ball.scn", integrator = "bpt", resolution = { 24, 16 }, backend = "mock" } end)
x:stop(function(p) return stop.any { stop.predicate(busy_loop), stop.samples(4096) } end)
return x
"#;

/// A small file system that a test can fill. It is unmounted on drop.
pub struct Disk {
    folder: PathBuf,
}

impl Disk {
    /// Mounts `megabytes` of memory as this folder, which is created. Returns `None`, and prints
    /// `SKIPPED`, if it cannot be mounted.
    pub fn mount(folder: PathBuf, megabytes: u32) -> Option<Disk> {
        std::fs::create_dir(&folder).unwrap();
        let size = format!("size={megabytes}m");
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &size, "none"])
            .arg(&folder)
            .output();
        if mount.is_ok_and(|ended| ended.status.success()) {
            return Some(Disk { folder });
        }
        crate::common::skipped("this process cannot mount a file system");
        None
    }

    /// Fills the disk with one file, up to `left` free bytes.
    pub fn fill(&self, left: usize) {
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(self.folder.join("filler"))
            .unwrap();
        let mut filled = file.metadata().unwrap().len() as usize;
        while let Ok(some @ 1..) = file.write(&[7; 4096]) {
            filled += some;
        }
        file.set_len(filled.saturating_sub(left) as u64).unwrap();
    }

    /// Removes the file that fills the disk.
    pub fn clear(&self) {
        std::fs::remove_file(self.folder.join("filler")).unwrap();
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        // Unmounts lazily: after a failed test a process may still have files open there.
        let _ = Command::new("umount").arg("-l").arg(&self.folder).status();
    }
}

impl Workplace {
    /// Creates a folder with `ball.scn` and the script `night.lua`.
    pub fn new() -> Workplace {
        let place = Workplace {
            dir: tempfile::tempdir().unwrap(),
        };
        place.write("ball.scn", SCENE);
        place.write("night.lua", SCRIPT);
        place
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn json(&self, name: &str) -> Json {
        serde_json::from_str(&self.read(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Returns the program as a command in this folder, without the user's environment settings.
    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lumbre"));
        command
            .current_dir(self.dir.path())
            .args(args)
            .env("NO_COLOR", "1");
        for name in ["LUMBRE_LOG", "RUST_BACKTRACE", "CLICOLOR_FORCE"] {
            command.env_remove(name);
        }
        command
    }

    /// Runs the program to its end.
    pub fn run(&self, args: &[&str]) -> ProgramOutput {
        ProgramOutput::run(&mut self.command(args))
    }

    /// Runs the program and expects success.
    pub fn succeed(&self, args: &[&str]) -> ProgramOutput {
        self.run(args).expect(0, args)
    }

    /// Runs the program, expects this status, and returns its stderr with line breaks replaced by
    /// spaces, since they depend on the width of the terminal.
    pub fn fail(&self, status: i32, args: &[&str]) -> String {
        let ended = self.run(args).expect(status, args);
        let words: Vec<&str> = ended
            .stderr
            .split_whitespace()
            .filter(|word| word.chars().any(|c| c.is_ascii_graphic()))
            .collect();
        words.join(" ")
    }

    /// Returns the files below a folder as sorted relative paths.
    pub fn files(&self, below: &str) -> Vec<String> {
        let mut found = Vec::new();
        let mut open = vec![self.path(below)];
        while let Some(next) = open.pop() {
            for entry in std::fs::read_dir(&next).into_iter().flatten().flatten() {
                if entry.file_type().unwrap().is_dir() {
                    open.push(entry.path());
                } else {
                    found.push(self.relative(&entry.path()));
                }
            }
        }
        found.sort();
        found
    }

    /// Returns those of [`Workplace::files`] whose paths end with `end`.
    pub fn ending(&self, below: &str, end: &str) -> Vec<String> {
        let mut files = self.files(below);
        files.retain(|file| file.ends_with(end));
        files
    }

    /// Returns the first file of [`Workplace::ending`]. Panics if there is none.
    pub fn first_ending(&self, below: &str, end: &str) -> String {
        let first = self.ending(below, end).into_iter().next();
        first.unwrap_or_else(|| panic!("no {end} in {:?}", self.files(below)))
    }

    fn relative(&self, path: &Path) -> String {
        path.strip_prefix(self.dir.path())
            .unwrap()
            .to_string_lossy()
            .replace('\\', "/")
    }

    /// Returns every `done.json` of the experiments in `out` with the time it was written.
    pub fn finished(&self) -> Vec<(String, std::time::SystemTime)> {
        let done = self.ending("out", "/done.json").into_iter();
        done.map(|f| {
            (
                f.clone(),
                std::fs::metadata(self.path(&f))
                    .unwrap()
                    .modified()
                    .unwrap(),
            )
        })
        .collect()
    }
}

/// Copies a folder with everything in it.
pub fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}
