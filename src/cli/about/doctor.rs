//! `lumbre doctor`: backends, devices, processor, terminal and results folder of this machine.

use std::io::IsTerminal;
use std::path::Path;

use serde_json::{Value as Json, json};

use crate::backends::BACKENDS;
use crate::cli::args::{DoctorArgs, Global};
use crate::cli::exit::{Exit, Failure, print_result};
use crate::cli::format::{self, display_path};
use crate::store::{Host, probe};
use crate::tui;

/// Runs `lumbre doctor`: prints what this machine supports.
pub fn main(args: &DoctorArgs, global: &Global) -> Result<Exit, Failure> {
    let facts = machine_facts(global);
    if args.json {
        print_result(&format!("{facts:#}\n"))?;
    } else {
        print_result(&page(&facts))?;
    }
    Ok(Exit::Done)
}

/// Examines this machine and returns the result as JSON.
fn machine_facts(global: &Global) -> Json {
    let host = Host::detect();
    let backend = |row: &lumbre_render::BackendRow| {
        let (usable, answer) = match (row.probe)() {
            Ok(device) => (true, device),
            Err(reason) => (false, reason),
        };
        json!({ "name": row.name, "usable": usable, "answer": answer, "doc": row.doc })
    };
    let (auto, auto_reason) = crate::backends::auto_backend();
    let out = match check_writable(&global.out) {
        Ok(state) => json!({ "path": display_path(&global.out), "writable": true,
            "answer": state }),
        Err(reason) => json!({ "path": display_path(&global.out), "writable": false,
            "answer": reason }),
    };
    json!({
        "program": concat!("lumbre ", env!("CARGO_PKG_VERSION")),
        "os": host.os,
        "cpu": host.cpu,
        "cores": host.cores,
        "features": cpu_features(),
        "backends": BACKENDS.iter().map(backend).collect::<Vec<_>>(),
        "auto": auto,
        "auto_because": auto_reason,
        "devices": devices(),
        "out": out,
        "terminal": terminal_facts(),
    })
}

/// Returns the properties of the terminal and the environment variables that affect it.
fn terminal_facts() -> Json {
    let env = |name: &str| std::env::var(name).ok();
    let terminal = std::io::stdout().is_terminal();
    let mode = match tui::output_mode(terminal, &env) {
        tui::OutputMode::Dashboard => "dashboard",
        tui::OutputMode::Lines => "lines",
    };
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
    let environment: serde_json::Map<String, Json> = variables
        .iter()
        .filter_map(|name| Some(((*name).to_owned(), env(name)?.into())))
        .collect();
    json!({
        "stdout": terminal,
        "stderr": std::io::stderr().is_terminal(),
        "shows": mode,
        "colors": tui::use_colors(terminal, &env),
        "environment": environment,
    })
}

/// Returns all graphics devices with their capabilities.
fn devices() -> Json {
    #[cfg(feature = "vulkan")]
    let listed = lumbre_vulkan::devices();
    #[cfg(not(feature = "vulkan"))]
    let listed: Vec<(String, String)> = Vec::new();
    listed
        .into_iter()
        .map(|(name, answer)| json!({ "name": name, "answer": answer }))
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

/// Returns a JSON value as text, a string without its quotes.
fn json_text(json: &Json) -> String {
    json.as_str()
        .map_or_else(|| json.to_string(), str::to_owned)
}

/// Formats the facts as an aligned table.
fn page(facts: &Json) -> String {
    let features: Vec<String> = facts["features"]
        .as_array()
        .into_iter()
        .flatten()
        .map(json_text)
        .collect();
    let features = if features.is_empty() {
        "none detected".to_owned()
    } else {
        features.join(" ")
    };
    let mut lines = vec![
        vec!["program".to_owned(), json_text(&facts["program"])],
        vec!["system".to_owned(), json_text(&facts["os"])],
        vec![
            "processor".to_owned(),
            format!("{}, {} cores", json_text(&facts["cpu"]), facts["cores"]),
        ],
        vec!["features".to_owned(), features],
    ];
    lines.extend(backend_lines(facts));
    let out = &facts["out"];
    let state = if out["writable"] == true {
        ""
    } else {
        "problem: "
    };
    lines.push(vec![
        format!("results in {}", json_text(&out["path"])),
        format!("{state}{}", json_text(&out["answer"])),
    ]);
    lines.extend(terminal_lines(&facts["terminal"]));
    format::aligned(&lines)
}

/// Returns the lines about backends and graphics devices.
fn backend_lines(facts: &Json) -> Vec<Vec<String>> {
    let mut lines = Vec::new();
    for backend in facts["backends"].as_array().into_iter().flatten() {
        let state = if backend["usable"] == true {
            "usable"
        } else {
            "not usable"
        };
        let auto = if backend["name"] == facts["auto"] {
            " (selected by auto)"
        } else {
            ""
        };
        let name = format!("backend {}", json_text(&backend["name"]));
        lines.push(vec![
            name,
            format!("{state}{auto}: {}", json_text(&backend["answer"])),
        ]);
    }
    lines.push(vec![
        "backend auto".to_owned(),
        format!(
            "{}: {}",
            json_text(&facts["auto"]),
            json_text(&facts["auto_because"])
        ),
    ]);
    for device in facts["devices"].as_array().into_iter().flatten() {
        lines.push(vec![
            json_text(&device["name"]),
            json_text(&device["answer"]),
        ]);
    }
    lines
}

/// Returns the lines about the terminal and its environment variables.
fn terminal_lines(terminal: &Json) -> Vec<Vec<String>> {
    let color = if terminal["colors"] == true {
        "with colours"
    } else {
        "without colours"
    };
    let kind = if terminal["stdout"] == true {
        "a terminal"
    } else {
        "not a terminal"
    };
    let mode = json_text(&terminal["shows"]);
    let mut lines = vec![vec![
        "standard output".to_owned(),
        format!("{kind}; progress is shown as {mode}, {color}"),
    ]];
    for (name, value) in terminal["environment"].as_object().into_iter().flatten() {
        lines.push(vec![format!("  {name}"), json_text(value)]);
    }
    lines
}
