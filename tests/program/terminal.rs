//! The dashboard in a real terminal: tmux provides the terminal, sends keys and captures the
//! screen. Skipped with a message if tmux is not installed.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test that cannot continue has failed")]
#![allow(clippy::print_stdout, reason = "skipped tests print a message")]

use std::process::Command;
use std::time::{Duration, Instant};

use crate::cli::workplace::{SLOW, Workplace};

/// Longest wait for a screen before the test fails; every expected wait is far shorter.
const MAX_WAIT: Duration = Duration::from_secs(60);

/// A tmux server with one terminal; killed on drop.
struct Terminal {
    server: String,
}

impl Terminal {
    /// Runs `lumbre` with these arguments in a terminal of this size, and then a shell line that
    /// prints its exit status.
    fn start(place: &Workplace, name: &str, size: (u16, u16), args: &str) -> Option<Terminal> {
        let program = env!("CARGO_BIN_EXE_lumbre");
        Terminal::start_line(place, name, size, &format!("'{program}' {args}"))
    }

    /// Runs a shell line as [`Terminal::start`] does.
    fn start_line(place: &Workplace, name: &str, size: (u16, u16), line: &str) -> Option<Terminal> {
        if Command::new("tmux").arg("-V").output().is_err() {
            crate::common::skipped("tmux is not installed");
            return None;
        }
        let terminal = Terminal {
            server: format!("lumbre-test-{name}-{}", std::process::id()),
        };
        let line = format!("{line}; echo ended with $?; sleep 600");
        let (width, height) = (size.0.to_string(), size.1.to_string());
        let folder = place.path(".");
        let started = Command::new("tmux")
            .args([
                "-L",
                &terminal.server,
                "-f",
                "/dev/null",
                "new-session",
                "-d",
                "-x",
                &width,
                "-y",
                &height,
                "-c",
            ])
            .arg(&folder)
            .args([
                "env",
                "LC_ALL=C.UTF-8",
                "COLORTERM=truecolor",
                "sh",
                "-c",
                &line,
            ])
            .status()
            .unwrap();
        assert!(started.success());
        Some(terminal)
    }

    fn tmux(&self, args: &[&str]) -> String {
        let output = Command::new("tmux")
            .args(["-L", &self.server])
            .args(args)
            .output()
            .unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    fn screen(&self) -> String {
        self.tmux(&["capture-pane", "-p"])
    }

    fn press(&self, keys: &[&str]) {
        self.tmux(&[&["send-keys"], keys].concat());
    }

    /// Presses keys until the screen holds a text: a key that comes between two cells is dropped.
    fn press_until(&self, keys: &[&str], text: &str) {
        let since = Instant::now();
        while !self.screen().contains(text) {
            assert!(since.elapsed() < MAX_WAIT, "{}", self.screen());
            self.press(keys);
            std::thread::sleep(Duration::from_secs(2));
        }
    }

    /// Waits until the screen holds all of these texts, and returns the screen.
    fn wait_for(&self, texts: &[&str]) -> String {
        self.wait_until(texts, |_| true)
    }

    /// Waits until the screen has this number of lines and contains the texts: what a program draws
    /// arrives in parts.
    fn wait_for_lines(&self, lines: usize, texts: &[&str]) {
        self.wait_until(texts, |screen| {
            screen.trim_end_matches('\n').lines().count() == lines
        });
    }

    fn wait_until(&self, texts: &[&str], holds: impl Fn(&str) -> bool) -> String {
        let since = Instant::now();
        loop {
            let screen = self.screen();
            if texts.iter().all(|text| screen.contains(text)) && holds(&screen) {
                return screen;
            }
            assert!(
                since.elapsed() < MAX_WAIT,
                "waited for {texts:?}, the screen is\n{screen}"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Returns whether the program uses the alternate screen.
    fn uses_alternate_screen(&self) -> bool {
        self.tmux(&["display-message", "-p", "#{alternate_on}"])
            .trim()
            == "1"
    }

    /// Waits until the program has ended, and checks that it restored the terminal.
    fn wait_for_end(&self, status: i32) {
        self.wait_for(&[&format!("ended with {status}")]);
        assert!(
            !self.uses_alternate_screen(),
            "the alternate screen is still in use"
        );
        assert_eq!(
            self.tmux(&["display-message", "-p", "#{cursor_flag}"])
                .trim(),
            "1",
            "the cursor is still hidden"
        );
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.tmux(&["kill-server"]);
    }
}

/// Returns the id of the process that a terminal's shell started.
fn program_of(terminal: &Terminal) -> String {
    let shell = terminal.tmux(&["display-message", "-p", "#{pane_pid}"]);
    let output = Command::new("pgrep")
        .args(["-P", shell.trim(), "lumbre"])
        .output()
        .unwrap();
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

#[test]
fn the_dashboard_handles_keys_commands_and_resizes_while_another_terminal_watches() {
    let place = Workplace::new();
    place.write("slow.lua", &SLOW.replace("repeats = 24", "repeats = 900"));
    let Some(night) = Terminal::start(&place, "run", (80, 24), "run slow.lua") else {
        return;
    };
    night.wait_for_lines(24, &["Lumbre", "slow-", "running", "Cell", "? all keys"]);
    assert!(night.uses_alternate_screen());

    night.press(&["p"]);
    night.wait_for(&["paused", "resume"]);
    night.press_until(&["R"], "restarted on");
    night.press(&["?"]);
    night.wait_for(&["Keys and symbols"]);
    night.press(&["Escape"]);
    night.press(&["p"]);
    night.wait_for(&["running"]);
    night.press(&[":", "pause 2spp", "Enter"]);
    night.wait_for(&["paused as requested"]);
    night.tmux(&["resize-window", "-x", "200", "-y", "60"]);
    night.wait_for_lines(60, &["Device", "Plan 900 cells", "paused", "? all keys"]);
    night.tmux(&["resize-window", "-x", "30", "-y", "8"]);
    night.wait_for(&["Lumbre"]);
    night.tmux(&["resize-window", "-x", "100", "-y", "30"]);
    night.wait_for(&["Picture", "Log"]);

    let watcher = Terminal::start(&place, "watch", (100, 30), "watch").unwrap();
    watcher.wait_for(&["slow-", "watching", "q quit", "mock"]);
    watcher.press(&["p"]);
    watcher.wait_for(&["can only be watched here"]);
    watcher.press(&["q"]);
    watcher.wait_for_end(0);

    night.press(&["q"]);
    night.wait_for_end(130);
    let finished = Terminal::start(&place, "again", (80, 24), "watch out").unwrap();
    finished.wait_for(&["slow-", "ended"]);
    finished.press(&["C-c"]);
    finished.wait_for_end(0);
}

#[test]
fn the_terminal_is_restored_when_sigterm_ends_the_program() {
    let place = Workplace::new();
    place.write("slow.lua", &SLOW.replace("repeats = 24", "repeats = 900"));
    let Some(night) = Terminal::start(&place, "term", (80, 24), "run slow.lua") else {
        return;
    };
    night.wait_for(&["running", "Cell"]);
    let program = program_of(&night);
    assert!(!program.is_empty());
    let watcher = Terminal::start(&place, "watcher", (80, 24), "watch").unwrap();
    watcher.wait_for(&["watching"]);
    let stop = |program: &str| {
        assert!(
            crate::common::kill()
                .args(["-TERM", program])
                .status()
                .unwrap()
                .success()
        )
    };
    stop(&program_of(&watcher));
    watcher.wait_for_end(0);
    stop(&program);
    night.wait_for_end(75);
}

#[test]
fn a_program_whose_terminal_hangs_up_while_it_waits_for_keys_ends() {
    let place = Workplace::new();
    let Some(terminal) = Terminal::start(&place, "hangup", (80, 24), "explore ball.scn") else {
        return;
    };
    terminal.wait_for(&["rendering"]);
    terminal.press(&["Space"]);
    terminal.wait_for(&["paused"]);
    let program = program_of(&terminal);
    assert!(!program.is_empty());
    drop(terminal);
    let since = Instant::now();
    while crate::common::kill()
        .args(["-0", &program])
        .output()
        .is_ok_and(|o| o.status.success())
    {
        assert!(
            since.elapsed() < MAX_WAIT,
            "process {program} goes on without its terminal"
        );
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// An experiment whose film has a time axis, with an area light beside a ball.
const LIGHT: &str = r#"
local x = experiment("light", { seed = 1 })
x:render(function(p)
  return { scene = "ball.scn", integrator = "nee", resolution = { 24, 16 }, max_depth = 3, backend = "cpu",
    film = { time = { start = 0, bin = 0.25, bins = 64, metres = 1 } } }
end)
x:stop(stop.samples(8))
return x
"#;

#[test]
fn the_time_bins_of_a_finished_night_can_be_played() {
    let place = Workplace::new();
    place.write("light.lua", LIGHT);
    place.succeed(&["run", "light.lua", "-q", "--no-tui"]);
    let Some(watcher) = Terminal::start(&place, "light", (120, 40), "watch") else {
        return;
    };
    watcher.wait_for(&["light-", "finished", "Picture"]);
    watcher.press(&["t"]);
    watcher.wait_for(&["Time playing"]);
    watcher.press(&["t"]);
    watcher.press(&[":", "time 5.6", "Enter"]);
    // Light reflected by the upper half of the ball arrives at optical lengths of 5.3 to 6.3.
    let still = watcher.wait_for(&["5.50 to 5.75 at 18.3 ns"]);
    assert!(
        still.contains("Time") && !still.contains("playing"),
        "{still}"
    );
    watcher.press(&["Right"]);
    watcher.wait_for(&["5.75 to 6.00"]);
    watcher.press(&["?"]);
    watcher.wait_for(&["play time bins"]);
    watcher.press(&["q"]);
    watcher.wait_for_end(0);
}

/// A technique whose command always fails, so that it is known to have run.
const ASKS: &str = r#"
local x = experiment("asks", { seed = 1 })
local failing = external { name = "failing", command = "sh -c 'exit 5' {scene} {spp} {seed} {out}" }
x:render(function() return { scene = "ball.scn", integrator = failing, resolution = { 24, 16 } } end)
x:stop(stop.samples(2))
return x
"#;

#[test]
fn the_question_about_commands_is_asked_once_for_a_script() {
    let place = Workplace::new();
    place.write("asks.lua", ASKS);
    let program = env!("CARGO_BIN_EXE_lumbre");
    let line = format!("XDG_CONFIG_HOME=config '{program}' run asks.lua --no-tui -q");
    let size = (120, 40);
    let Some(refused) = Terminal::start_line(&place, "ask-no", size, &line) else {
        return;
    };
    let question = refused.wait_for(&["Allow them for this script?"]);
    assert!(
        question.contains("external:failing  sh -c \"exit 5\" {scene}"),
        "{question}"
    );
    refused.press(&["n", "Enter"]);
    refused.wait_for(&["ended with 2"]);
    assert!(!place.path("out").exists() && !place.path("config").exists());
    if let Some(allowed) = Terminal::start_line(&place, "ask-yes", size, &line) {
        allowed.wait_for(&["Allow them for this script?"]);
        allowed.press(&["y", "Enter"]);
        allowed.wait_for(&["ended with 3"]);
    }
    let remembered = place.read("config/lumbre/allowed-commands");
    assert_eq!(remembered.lines().count(), 1, "{remembered}");
    let without_terminal = || {
        let mut command = place.command(&["run", "asks.lua", "-q"]);
        let status = command
            .env("XDG_CONFIG_HOME", place.path("config"))
            .output();
        status.unwrap().status.code()
    };
    assert_eq!(without_terminal(), Some(3), "the answer was forgotten");
    place.write("asks.lua", &format!("{ASKS}-- edited"));
    assert_eq!(
        without_terminal(),
        Some(2),
        "the answer was for another script"
    );
}

#[test]
fn a_scene_is_explored_by_keys_and_the_mouse() {
    let place = Workplace::new();
    std::fs::create_dir(place.path("rooms")).unwrap();
    std::fs::copy(place.path("ball.scn"), place.path("rooms/ball.scn")).unwrap();
    let Some(terminal) =
        Terminal::start(&place, "explore", (100, 30), "explore rooms integrator=bpt")
    else {
        return;
    };
    terminal.wait_for(&["Scenes", "ball.scn"]);
    terminal.press(&["ball", "Enter"]);
    let texts = ["Lumbre explore", "rendering", "Settings", "bpt", "Progress"];
    terminal.wait_for_lines(30, &texts);
    assert!(terminal.uses_alternate_screen());
    terminal.press(&["t"]);
    terminal.wait_for(&["nee", "select"]);
    terminal.press(&["d", "w"]);
    // A wheel step up in the middle of the picture, as terminals report it.
    terminal.press(&["-l", "\u{1b}[<64;30;12M"]);
    terminal.press(&["Space"]);
    terminal.wait_for(&["paused"]);
    terminal.press(&["?"]);
    terminal.wait_for(&["Keys", "write the settings as a script"]);
    terminal.press(&["?"]);
    terminal.press(&["x"]);
    terminal.wait_for(&["wrote ball-1.lua"]);
    terminal.press(&["p"]);
    terminal.wait_for(&["wrote ball-1.exr"]);
    terminal.tmux(&["resize-window", "-x", "200", "-y", "60"]);
    terminal.wait_for_lines(60, &["Display", "Limits", "paused"]);
    terminal.press(&["q"]);
    terminal.wait_for_end(0);
    let text = place.read("ball-1.lua");
    assert!(
        text.contains("integrator = \"nee\"") && text.contains("camera = "),
        "{text}"
    );
    place.succeed(&["check", "ball-1.lua"]);
    place.succeed(&["plan", "ball-1.lua"]);
}

#[test]
fn without_a_terminal_the_commands_of_the_page_name_another_one() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/start/explore.md")).unwrap();
    let commands: Vec<&str> = page
        .lines()
        .filter_map(|line| line.strip_prefix("lumbre explore"))
        .collect();
    assert!(commands.len() >= 3, "{commands:?}");
    let place = Workplace::new();
    let refused = |arguments: &str, expected: &str| {
        let mut command = place.command(&["explore"]);
        let command = command.args(arguments.split_whitespace());
        let output = command.current_dir(root).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {text}");
        assert!(text.contains(expected), "{arguments}: {text}");
    };
    // Files and settings are checked before the terminal.
    for arguments in commands {
        refused(arguments, "`lumbre render`");
    }
    refused("scenes/none.scn", "there is no file scenes/none.scn");
    refused("scenes integrator=none", "unknown integrator `none`");
    refused("scenes max_depth=0", "max_depth");
}
