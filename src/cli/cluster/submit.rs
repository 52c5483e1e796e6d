//! `lumbre submit` and `lumbre cancel`.

use std::path::{Path, PathBuf};

use super::frozen::freeze;
use super::job::{Jobs, Kind, Sheet, script_file};
use super::queue::ask;
use super::work::looks_local;
use crate::cli::args::{CancelArgs, Global, SubmitArgs, To};
use crate::cli::exit::{Exit, Failure, data, talk};
use crate::cli::load::{self, decode, shown};
use crate::cli::run::counted;
use crate::cli::watch::home_of;
use crate::experiment::Plan;
use crate::store::{Store, atomic};

/// Freezes a plan and submits a job of workers.
pub fn submit(args: &SubmitArgs, global: &Global) -> Result<Exit, Failure> {
    let kind = match args.to {
        To::Slurm(_) => Kind::Slurm,
        To::Hq(_) => Kind::Hq,
    };
    let job = args.to.job();
    let (_, plan) = load::plan_elsewhere(&job.script, global)?;
    let program = std::env::current_exe().map_err(Failure::internal)?;
    let gpus = job.gpus.unwrap_or(u32::from(plan.cells.iter().any(|cell| cell.config.backend.starts_with("vulkan"))));
    let sheet = |home: &Path| Sheet { name: &plan.name, home, program: &program, gpus, args: job }.text(kind);
    if job.dry_run {
        let out = std::path::absolute(&global.out).map_err(Failure::usage)?;
        data(&sheet(&out.join(format!("{}-{}", plan.name, &plan.hash[..4]))))?;
        return Ok(Exit::Done);
    }
    if !global.quiet {
        load::show_doubts(&plan);
        if global.backend.as_deref() == Some("auto") || says_auto(&plan) {
            talk("note: `auto` means what it means on this machine; name a backend if the nodes have other devices");
        }
    }
    let store = Store::open(&global.out, &plan, decode).map_err(Failure::usage)?;
    store.write_env().map_err(Failure::usage)?;
    freeze(&store, &plan, &job.script).map_err(Failure::usage)?;
    let home = store.folder().canonicalize().map_err(Failure::internal)?;
    let file = script_file(&home, kind);
    atomic(&file, sheet(&home).as_bytes()).map_err(Failure::usage)?;
    if let Some(doubt) = looks_local(&home).filter(|_| !global.quiet) {
        talk(&format!("warning: {doubt}"));
    }
    let id = hand_over(kind, &file, &job.extra, job.partition.as_deref()).map_err(|problem| {
        Failure::usage(format!(
            "the job was not submitted: {problem}. Nothing is lost: the plan is frozen, the script is {}, and a worker is \
             started by hand with `lumbre work {}`",
            shown(&file),
            shown(&home)
        ))
    })?;
    Jobs::add(&home, kind, &id, job.workers).map_err(Failure::internal)?;
    data(&format!("{id}\n"))?;
    if !global.quiet {
        let cells = counted(plan.cells.len(), "cell");
        talk(&format!("job {id}: {} for {cells}", counted(job.workers as usize, "worker")));
        talk(&format!("watch it with  lumbre watch {}", shown(&home)));
        talk(&format!("end it with    lumbre cancel {}", shown(&home)));
    }
    Ok(Exit::Done)
}

/// Whether the script leaves the backend to the machine: what is asked for is not in the plan, but in its text.
fn says_auto(plan: &Plan) -> bool {
    let text = &plan.script_text;
    !text.contains("backend") || text.contains("\"auto\"") || text.contains("'auto'")
}

/// Submits a script and returns the job's number.
fn hand_over(kind: Kind, file: &Path, extra: &[String], partition: Option<&str>) -> Result<String, String> {
    let file = file.display().to_string();
    let [program, _] = kind.programs();
    let mut args: Vec<&str> = match kind {
        Kind::Slurm => vec!["--parsable"],
        Kind::Hq => vec!["--output-mode=quiet", "submit"],
    };
    if let (Kind::Hq, Some(partition)) = (kind, partition) {
        return Err(format!("HyperQueue has no partitions (`{partition}`); its allocations name them"));
    }
    args.extend(extra.iter().map(String::as_str));
    args.push(&file);
    let said = ask(program, &args)?;
    // `1207`, or `1207;cluster`.
    let id: String = said.trim().chars().take_while(char::is_ascii_digit).collect();
    if id.is_empty() { Err(format!("`{program}` answered `{}` instead of a number", said.trim())) } else { Ok(id) }
}

/// Takes the jobs of a night back.
pub fn cancel(args: &CancelArgs, global: &Global) -> Result<Exit, Failure> {
    let home: PathBuf = home_of(args.folder.as_deref(), global)?;
    let Jobs(jobs) = Jobs::read(&home);
    if jobs.is_empty() {
        return Err(Failure::usage(format!(
            "no job was submitted for {} (a worker that was started by hand is ended by Ctrl-C or SIGTERM)",
            shown(&home)
        )));
    }
    let mut problems = Vec::new();
    for job in &jobs {
        let [_, program] = job.kind.programs();
        let args: &[&str] = match job.kind {
            Kind::Slurm => &[&job.id],
            Kind::Hq => &["job", "cancel", &job.id],
        };
        match ask(program, args) {
            Ok(_) => talk(&format!("job {} was taken back", job.id)),
            Err(problem) => problems.push(format!("job {}: {problem}", job.id)),
        }
    }
    if problems.len() == jobs.len() {
        return Err(Failure::usage(problems.join("\n")));
    }
    problems.iter().for_each(|problem| talk(problem));
    talk(&format!("what is finished stays; `lumbre submit` or `lumbre work {}` goes on", shown(&home)));
    Ok(Exit::Done)
}
