//! Plans that are left for workers on other machines, and made again there.

use std::path::Path;
use std::sync::Arc;

use crate::cli::again::parse;
use crate::cli::args::{Global, ScriptArgs};
use crate::cli::exit::Failure;
use crate::cli::load::{self, shown};
use crate::experiment::Plan;
use crate::render::{automatic, choice};
use crate::script::{self, Limits, Script};
use crate::store::{Command, Frozen, Store, StoreError};

/// Leaves in a night's folder what workers need to make its plan again.
///
/// # Errors
/// When it cannot be written.
pub fn freeze(store: &Store, plan: &Plan, script: &ScriptArgs) -> Result<(), StoreError> {
    let folder = std::env::current_dir().unwrap_or_default();
    let command = Command {
        script: folder.join(&script.script),
        folder,
        arguments: std::env::args().skip(1).collect(),
        auto: automatic().0.to_owned(),
    };
    let out = store.folder().parent().unwrap_or(store.folder());
    store.freeze(&Frozen::new(out, store.folder(), plan, command))
}

/// A plan that was made again.
pub struct Thawed {
    /// The script, as it was when the plan was frozen.
    pub script: Script,
    /// The plan.
    pub plan: Arc<Plan>,
    /// What was frozen.
    pub frozen: Frozen,
}

/// Makes the plan of a night's folder again. The current folder becomes the one in which the plan was made, since
/// scripts name scenes from there.
///
/// # Errors
/// When nothing was frozen, another version of the program froze it, this machine does not see what the plan needs, or
/// the plan is no longer the same; the message says what changed.
pub fn thaw(home: &Path, global: &Global) -> Result<Thawed, Failure> {
    let frozen = Frozen::read(home).map_err(Failure::usage)?;
    let here = concat!("lumbre ", env!("CARGO_PKG_VERSION"));
    if frozen.program != here {
        return Err(Failure::usage(format!(
            "the plan in {} was frozen by {}, and this is {here}: pictures of different versions may differ (work with \
             that version, or freeze the plan with this one by `lumbre run` or `lumbre submit`)",
            shown(home),
            frozen.program
        )));
    }
    std::env::set_current_dir(&frozen.folder).map_err(|e| {
        Failure::usage(format!(
            "this machine does not see {}, from where the plan was made: {e} (is that folder shared?)",
            frozen.folder.display()
        ))
    })?;
    let damaged = |why: &str| Failure::usage(format!("frozen.json in {} is damaged: {why}", shown(home)));
    let (wanted, then) = parse(frozen.arguments.iter().map(String::as_str)).map_err(damaged)?;
    let wanted = ScriptArgs { script: frozen.script.clone(), ..wanted };
    choice::settle_auto(&frozen.auto);
    let file = home.join("experiment.lua");
    let text = std::fs::read_to_string(&file).map_err(|e| damaged(&format!("{}: {e}", shown(&file))))?;
    let global = Global { backend: then.backend, lenient: then.lenient, ..global.clone() };
    let made = script::load_text(&frozen.script, text, Limits::default())
        .map_err(Failure::diagnostic)
        .and_then(|script| load::planned(&script, &wanted, &global).map(|plan| (script, plan)));
    let changed = || {
        let files = frozen.changed_files();
        let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        if files.is_empty() { String::new() } else { format!("; changed or gone since: {}", files.join(", ")) }
    };
    let (script, plan) = match made {
        Ok(made) => made,
        Err(failure) if changed().is_empty() => return Err(failure),
        // What is wrong with it follows from the change.
        Err(failure) => return Err(Failure::usage(format!("{}{}", failure.report, changed()))),
    };
    if plan.hash != frozen.plan {
        let difference = Frozen::first_difference(home, &plan).unwrap_or_else(|| "its figures or tables".to_owned());
        return Err(Failure::usage(format!(
            "the plan in {} was edited after it was frozen: its hash was {} and is {}; first difference: {difference}{} \
             (put back what was changed, or submit the night again: what is finished and still the same is not \
             rendered again)",
            shown(home),
            frozen.plan,
            plan.hash,
            changed()
        )));
    }
    Ok(Thawed { script, plan, frozen })
}
