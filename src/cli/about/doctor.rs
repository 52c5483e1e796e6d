//! `lumbre doctor`: backends, devices, processor, terminal and results folder of this machine.

use std::io::IsTerminal;
use std::path::Path;

use serde::Serialize;

use crate::cli::args::{DoctorArgs, Global};
use crate::cli::exit::{Exit, Failure, print_result};
use crate::cli::format::{self, display_path};
use crate::cli::json;
use lumbre_night::backends::BACKENDS;
use lumbre_night::store::schema::values::Named;
use lumbre_night::store::{Host, probe};
use lumbre_night::text::program;
use lumbre_tui::tui;

/// Capabilities of this machine.
#[derive(Serialize)]
struct MachineFacts {
    program: &'static str,
    os: String,
    cpu: String,
    cores: usize,
    /// Instruction sets that are relevant to ray tracing.
    features: Vec<&'static str>,
    backends: Vec<BackendFacts>,
    /// Backend that `auto` selects.
    auto: &'static str,
    auto_because: String,
    devices: Vec<DeviceFacts>,
    out: FolderFacts,
    terminal: TerminalFacts,
}

/// A backend, and whether this machine can use it.
#[derive(Serialize)]
struct BackendFacts {
    name: &'static str,
    usable: bool,
    /// Device, or the reason why it cannot be used.
    answer: String,
    doc: &'static str,
}

/// A graphics device with its capabilities.
#[derive(Serialize)]
struct DeviceFacts {
    name: String,
    answer: String,
}

/// The results folder.
#[derive(Serialize)]
struct FolderFacts {
    path: String,
    writable: bool,
    answer: String,
}

/// The terminal and the environment variables that affect it.
#[derive(Serialize)]
struct TerminalFacts {
    stdout: bool,
    stderr: bool,
    shows: &'static str,
    colors: bool,
    environment: Named<String>,
}

/// Runs `lumbre doctor`: prints what this machine supports.
pub fn main(args: &DoctorArgs, global: &Global) -> Result<Exit, Failure> {
    let facts = MachineFacts::collect(global);
    if args.json {
        json::print(serde_json::json!(facts))?;
    } else {
        print_result(&facts.page())?;
    }
    Ok(Exit::Done)
}

impl MachineFacts {
    /// Examines this machine.
    fn collect(global: &Global) -> MachineFacts {
        let host = Host::detect();
        let backends = BACKENDS.iter().map(|row| {
            let probed = (row.probe)();
            BackendFacts {
                name: row.name,
                usable: probed.is_ok(),
                answer: probed.unwrap_or_else(|reason| reason),
                doc: row.doc,
            }
        });
        let (auto, auto_reason) = lumbre_night::backends::auto_backend();
        let writable = check_writable(&global.out);
        MachineFacts {
            program: program(),
            os: host.os,
            cpu: host.cpu,
            cores: host.cores,
            features: cpu_features(),
            backends: backends.collect(),
            auto,
            auto_because: auto_reason.to_string(),
            devices: devices(),
            out: FolderFacts {
                path: display_path(&global.out),
                writable: writable.is_ok(),
                answer: writable.unwrap_or_else(|reason| reason),
            },
            terminal: TerminalFacts::collect(),
        }
    }
}

impl TerminalFacts {
    fn collect() -> TerminalFacts {
        let env = |name: &str| std::env::var(name).ok();
        let stdout = std::io::stdout().is_terminal();
        let variables = [
            "TERM",
            "COLORTERM",
            "NO_COLOR",
            "CLICOLOR_FORCE",
            "LC_ALL",
            "LC_CTYPE",
            "LANG",
            "TMUX",
        ];
        TerminalFacts {
            stdout,
            stderr: std::io::stderr().is_terminal(),
            shows: match tui::output_mode(stdout, &env) {
                tui::OutputMode::Dashboard => "dashboard",
                tui::OutputMode::Lines => "lines",
            },
            colors: tui::use_colors(stdout, &env),
            environment: variables
                .iter()
                .filter_map(|name| Some(((*name).to_owned(), env(name)?)))
                .collect(),
        }
    }
}

/// Returns all graphics devices with their capabilities.
fn devices() -> Vec<DeviceFacts> {
    #[cfg(feature = "vulkan")]
    let listed = lumbre_vulkan::devices();
    #[cfg(not(feature = "vulkan"))]
    let listed: Vec<(String, String)> = Vec::new();
    listed
        .into_iter()
        .map(|(name, answer)| DeviceFacts { name, answer })
        .collect()
}

/// Checks whether results can be written to a folder, without creating it. Returns a short
/// description, or the reason if they cannot.
fn check_writable(out: &Path) -> Result<String, String> {
    let absolute = std::path::absolute(out).map_err(|e| e.to_string())?;
    let existing = absolute
        .ancestors()
        .find(|p| p.exists())
        .unwrap_or(Path::new("/"));
    probe(existing).map_err(|e| e.to_string())?;
    Ok(if existing == absolute {
        "writable".to_owned()
    } else {
        "does not exist yet, but can be created".to_owned()
    })
}

/// Returns the instruction sets of this processor that are relevant to ray tracing.
pub(in crate::cli) fn cpu_features() -> Vec<&'static str> {
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        let known = [
            ("sse4.2", std::arch::is_x86_feature_detected!("sse4.2")),
            ("avx", std::arch::is_x86_feature_detected!("avx")),
            ("avx2", std::arch::is_x86_feature_detected!("avx2")),
            ("fma", std::arch::is_x86_feature_detected!("fma")),
            ("avx512f", std::arch::is_x86_feature_detected!("avx512f")),
        ];
        found.extend(
            known
                .iter()
                .filter(|(_, there)| *there)
                .map(|(name, _)| *name),
        );
    }
    #[cfg(target_arch = "aarch64")]
    if std::arch::is_aarch64_feature_detected!("neon") {
        found.push("neon");
    }
    found
}

impl MachineFacts {
    /// Formats the facts as an aligned table.
    fn page(&self) -> String {
        let line = |name: &str, value: String| vec![name.to_owned(), value];
        let features = if self.features.is_empty() {
            "none detected".to_owned()
        } else {
            self.features.join(" ")
        };
        let mut lines = vec![
            line("program", self.program.to_owned()),
            line("system", self.os.clone()),
            line("processor", format!("{}, {} cores", self.cpu, self.cores)),
            line("features", features),
        ];
        lines.extend(self.backend_lines());
        let FolderFacts {
            path,
            writable,
            answer,
        } = &self.out;
        let state = if *writable { "" } else { "problem: " };
        lines.push(line(
            &format!("results in {path}"),
            format!("{state}{answer}"),
        ));
        lines.extend(self.terminal.lines());
        format::aligned(&lines)
    }

    /// Returns the lines about backends and graphics devices.
    fn backend_lines(&self) -> Vec<Vec<String>> {
        let mut lines = Vec::new();
        for backend in &self.backends {
            let state = if backend.usable {
                "usable"
            } else {
                "not usable"
            };
            let auto = if backend.name == self.auto {
                " (selected by auto)"
            } else {
                ""
            };
            lines.push(vec![
                format!("backend {}", backend.name),
                format!("{state}{auto}: {}", backend.answer),
            ]);
        }
        lines.push(vec![
            "backend auto".to_owned(),
            format!("{}: {}", self.auto, self.auto_because),
        ]);
        for device in &self.devices {
            lines.push(vec![device.name.clone(), device.answer.clone()]);
        }
        lines
    }
}

impl TerminalFacts {
    /// Returns the lines about the terminal and its environment variables.
    fn lines(&self) -> Vec<Vec<String>> {
        let color = if self.colors {
            "with colours"
        } else {
            "without colours"
        };
        let kind = if self.stdout {
            "a terminal"
        } else {
            "not a terminal"
        };
        let mut lines = vec![vec![
            "standard output".to_owned(),
            format!("{kind}; progress is shown as {}, {color}", self.shows),
        ]];
        let truecolor = |name: &str, value: &str| {
            name == "COLORTERM" && (value == "truecolor" || value == "24bit")
        };
        let mut environment = self.environment.0.iter();
        if self.colors && !environment.any(|(name, value)| truecolor(name, value)) {
            let hint = "pictures in 256 colours; if the terminal has more, set COLORTERM=truecolor";
            lines.push(vec![String::new(), hint.to_owned()]);
        }
        for (name, value) in &self.environment.0 {
            lines.push(vec![format!("  {name}"), value.clone()]);
        }
        lines
    }
}
