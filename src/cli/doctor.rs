//! `lumbre doctor`: what this machine offers.

use std::io::IsTerminal;
use std::path::Path;

use serde_json::{Value as Json, json};

use super::args::{DoctorArgs, Global};
use super::exit::{Exit, Failure, data};
use super::load::shown;
use super::text;
use crate::render::{self, BACKENDS};
use crate::store::{Host, probe};
use crate::tui;

/// Prints the facts.
pub fn main(args: &DoctorArgs, global: &Global) -> Result<Exit, Failure> {
    let facts = facts(global);
    if args.json {
        data(&format!("{facts:#}\n"))?;
    } else {
        data(&page(&facts))?;
    }
    Ok(Exit::Done)
}

fn facts(global: &Global) -> Json {
    let host = Host::here();
    let backend = |row: &render::BackendRow| {
        let (usable, answer) = match (row.probe)() {
            Ok(device) => (true, device),
            Err(reason) => (false, reason),
        };
        json!({ "name": row.name, "usable": usable, "answer": answer, "doc": row.doc })
    };
    let (auto, because) = render::automatic();
    let out = match writable(&global.out) {
        Ok(place) => json!({ "path": shown(&global.out), "writable": true, "answer": place }),
        Err(reason) => json!({ "path": shown(&global.out), "writable": false, "answer": reason }),
    };
    let env = |name: &str| std::env::var(name).ok();
    let terminal = std::io::stdout().is_terminal();
    let face = match tui::wanted(terminal, &env) {
        tui::Mode::Dashboard => "dashboard",
        tui::Mode::Lines => "lines",
    };
    let variables = ["TERM", "COLORTERM", "NO_COLOR", "CLICOLOR_FORCE", "LC_ALL", "LC_CTYPE", "LANG", "TMUX"];
    let set: serde_json::Map<String, Json> =
        variables.iter().filter_map(|name| Some(((*name).to_owned(), env(name)?.into()))).collect();
    json!({
        "program": concat!("lumbre ", env!("CARGO_PKG_VERSION")),
        "os": host.os,
        "cpu": host.cpu,
        "cores": host.cores,
        "features": cpu_features(),
        "backends": BACKENDS.iter().map(backend).collect::<Vec<_>>(),
        "auto": auto,
        "auto_because": because,
        "devices": devices(),
        "out": out,
        "terminal": {
            "stdout": terminal,
            "stderr": std::io::stderr().is_terminal(),
            "shows": face,
            "colors": tui::colored(terminal, &env),
            "environment": set,
        },
    })
}

/// Every graphics device with what it can do.
fn devices() -> Json {
    #[cfg(feature = "vulkan")]
    let listed = render::vulkan::devices();
    #[cfg(not(feature = "vulkan"))]
    let listed: Vec<(String, String)> = Vec::new();
    listed.into_iter().map(|(name, answer)| json!({ "name": name, "answer": answer })).collect()
}

/// Whether results can be written, without making the folder; the text is where that was tried, or the reason.
fn writable(out: &Path) -> Result<String, String> {
    let absolute = std::path::absolute(out).map_err(|e| e.to_string())?;
    let there = absolute.ancestors().find(|p| p.exists()).unwrap_or(Path::new("/"));
    probe(there).map_err(|e| e.to_string())?;
    Ok(if there == absolute { "writable".to_owned() } else { "not there yet; can be made".to_owned() })
}

/// Instruction sets that matter to tracing rays, as far as this processor has them.
pub(super) fn cpu_features() -> Vec<&'static str> {
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
        found.extend(known.iter().filter(|(_, there)| *there).map(|(name, _)| *name));
    }
    #[cfg(target_arch = "aarch64")]
    if std::arch::is_aarch64_feature_detected!("neon") {
        found.push("neon");
    }
    found
}

fn page(facts: &Json) -> String {
    let text_of = |json: &Json| json.as_str().map_or_else(|| json.to_string(), str::to_owned);
    let words = |json: &Json| {
        let list: Vec<String> = json.as_array().into_iter().flatten().map(text_of).collect();
        if list.is_empty() { "none known".to_owned() } else { list.join(" ") }
    };
    let mut lines = vec![
        vec!["program".to_owned(), text_of(&facts["program"])],
        vec!["system".to_owned(), text_of(&facts["os"])],
        vec!["processor".to_owned(), format!("{}, {} cores", text_of(&facts["cpu"]), facts["cores"])],
        vec!["features".to_owned(), words(&facts["features"])],
    ];
    for backend in facts["backends"].as_array().into_iter().flatten() {
        let state = if backend["usable"] == true { "usable" } else { "not usable" };
        let auto = if backend["name"] == facts["auto"] { " (what auto means here)" } else { "" };
        let name = format!("backend {}", text_of(&backend["name"]));
        lines.push(vec![name, format!("{state}{auto}: {}", text_of(&backend["answer"]))]);
    }
    lines.push(vec![
        "backend auto".to_owned(),
        format!("{}: {}", text_of(&facts["auto"]), text_of(&facts["auto_because"])),
    ]);
    for device in facts["devices"].as_array().into_iter().flatten() {
        lines.push(vec![text_of(&device["name"]), text_of(&device["answer"])]);
    }
    let out = &facts["out"];
    let state = if out["writable"] == true { "" } else { "problem: " };
    lines.push(vec![format!("results in {}", text_of(&out["path"])), format!("{state}{}", text_of(&out["answer"]))]);
    let terminal = &facts["terminal"];
    let color = if terminal["colors"] == true { "with colours" } else { "without colours" };
    let kind = if terminal["stdout"] == true { "a terminal" } else { "no terminal" };
    let shows = text_of(&terminal["shows"]);
    lines.push(vec!["standard output".to_owned(), format!("{kind}; a night is shown as {shows}, {color}")]);
    for (name, value) in terminal["environment"].as_object().into_iter().flatten() {
        lines.push(vec![format!("  {name}"), text_of(value)]);
    }
    text::aligned(&lines)
}
