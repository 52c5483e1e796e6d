//! `lumbre submit` and `lumbre cancel`: cluster jobs of a night.

use std::path::{Path, PathBuf};

use super::job::{JobScript, SchedulerKind, record_job, script_file, submitted_jobs};
use super::plan_snapshot::save_plan_snapshot;
use super::queue::command_output;
use super::work::local_disk_warning;
use crate::cli::args::{CancelArgs, Global, JobArgs, Scheduler, ScriptArgs, SubmitArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path};
use crate::cli::night::load;
use crate::cli::night::load::decode_picture;
use crate::cli::night::permission::PlanUse;
use crate::cli::own_techniques;
use crate::cli::selector;
use lumbre_night::experiment::Plan;
use lumbre_night::store::{Store, write_atomically};

/// Runs `lumbre submit`: saves a snapshot of the plan and submits a job array of workers.
pub fn submit(args: &SubmitArgs, global: &Global) -> Result<Exit, Failure> {
    let kind = match args.scheduler {
        Scheduler::Slurm(_) => SchedulerKind::Slurm,
        Scheduler::Hq(_) => SchedulerKind::Hq,
    };
    let job = args.scheduler.job();
    let usage = if job.dry_run {
        PlanUse::Show
    } else {
        PlanUse::Render
    };
    let (_, plan) = load::load_plan_for_cluster(&job.script, usage, global)?;
    let program = std::env::current_exe().map_err(Failure::internal)?;
    let gpus = gpus_per_job(job, &plan);
    let libraries = own_techniques::files();
    let job_script = |home: &Path| {
        JobScript {
            name: &plan.name,
            home,
            program: &program,
            gpus,
            // Permission was given here; a job cannot ask.
            allow_commands: !plan.commands.is_empty() && plan.commands_allowed,
            libraries: &libraries,
            args: job,
        }
        .text(kind)
    };
    if job.dry_run {
        let out = std::path::absolute(&global.out).map_err(Failure::usage)?;
        print_result(&job_script(&out.join(format!(
            "{}-{}",
            plan.name,
            &plan.hash[..4]
        ))))?;
        return Ok(Exit::Done);
    }
    load::print_notes_and_warnings(&plan, global.quiet);
    let is_auto = global.backend.as_deref() == Some("auto") || uses_auto_backend(&plan);
    if is_auto && !global.quiet {
        print_status(
            "note: `auto` was resolved on this machine; set --backend if the nodes have other \
             devices",
        );
    }
    let home = create_night(&plan, &job.script, global)?;
    let file = script_file(&home, kind);
    write_atomically(&file, job_script(&home).as_bytes()).map_err(Failure::usage)?;
    if let Some(warning) = local_disk_warning(&home).filter(|_| !global.quiet) {
        print_status(&format!("warning: {warning}"));
    }
    let id =
        submit_script(kind, &file, &job.extra, job.partition.as_deref()).map_err(|problem| {
            Failure::usage(format!(
                "the job was not submitted: {problem}. The plan is saved and the job script is \
                 {}; to start a worker by hand, run `lumbre work {}`",
                display_path(&file),
                display_path(&home)
            ))
        })?;
    record_job(&home, kind, &id, job.workers).map_err(Failure::internal)?;
    print_result(&format!("{id}\n"))?;
    if !global.quiet {
        print_submitted(&id, job, &plan, &home);
    }
    Ok(Exit::Done)
}

/// Prints the size of a submitted job, and the commands to watch and cancel it.
fn print_submitted(id: &str, job: &JobArgs, plan: &Plan, home: &Path) {
    print_status(&format!(
        "job {id}: {} for {}",
        counted(job.workers as usize, "worker"),
        counted(plan.cells.len(), "cell")
    ));
    print_status(&format!("watch   lumbre watch {}", display_path(home)));
    print_status(&format!("cancel  lumbre cancel {}", display_path(home)));
}

/// Creates the folder of a night with its command and a snapshot of its plan. Returns the absolute
/// path of the folder.
fn create_night(plan: &Plan, script: &ScriptArgs, global: &Global) -> Result<PathBuf, Failure> {
    let store = Store::open(&global.out, plan, decode_picture).map_err(Failure::usage)?;
    store.write_env().map_err(Failure::usage)?;
    save_plan_snapshot(&store, plan, script).map_err(Failure::usage)?;
    store.folder().canonicalize().map_err(Failure::internal)
}

/// Returns the number of graphics devices per job: the given number, or 1 if the plan uses a
/// graphics backend.
fn gpus_per_job(job: &JobArgs, plan: &Plan) -> u32 {
    job.gpus.unwrap_or(u32::from(
        plan.cells
            .iter()
            .any(|cell| cell.config.backend.starts_with("vulkan")),
    ))
}

/// Returns whether the script seems to use the backend `auto`. The plan contains only resolved
/// names, so this searches the text of the script.
fn uses_auto_backend(plan: &Plan) -> bool {
    let text = &plan.script_text;
    !text.contains("backend") || text.contains("\"auto\"") || text.contains("'auto'")
}

/// Submits a job script and returns the number of the job.
///
/// # Errors
/// Returns a message if the submit command is missing or fails, or does not print a number.
fn submit_script(
    kind: SchedulerKind,
    file: &Path,
    extra: &[String],
    partition: Option<&str>,
) -> Result<String, String> {
    let file = file.display().to_string();
    let [program, _] = kind.programs();
    let mut args: Vec<&str> = match kind {
        SchedulerKind::Slurm => vec!["--parsable"],
        SchedulerKind::Hq => vec!["--output-mode=quiet", "submit"],
    };
    if let (SchedulerKind::Hq, Some(partition)) = (kind, partition) {
        return Err(format!(
            "HyperQueue has no partitions, but --partition is `{partition}`; set it in the \
             allocation"
        ));
    }
    args.extend(extra.iter().map(String::as_str));
    args.push(&file);
    let answer = command_output(program, &args)?;
    // The answer is `1207`, or `1207;cluster`.
    let id: String = answer
        .trim()
        .chars()
        .take_while(char::is_ascii_digit)
        .collect();
    if id.is_empty() {
        Err(format!(
            "`{program}` printed `{}` instead of a job number",
            answer.trim()
        ))
    } else {
        Ok(id)
    }
}

/// Runs `lumbre cancel`: cancels the cluster jobs of a night.
pub fn cancel(args: &CancelArgs, global: &Global) -> Result<Exit, Failure> {
    let home: PathBuf = selector::night(args.folder.as_deref(), &global.out)?;
    let jobs = submitted_jobs(&home);
    if jobs.is_empty() {
        return Err(Failure::usage(format!(
            "no job was submitted for {} (stop workers that were started by hand with Ctrl-C or \
             SIGTERM)",
            display_path(&home)
        )));
    }
    let mut problems = Vec::new();
    for job in &jobs {
        let [_, program] = job.kind.programs();
        let args: &[&str] = match job.kind {
            SchedulerKind::Slurm => &[&job.id],
            SchedulerKind::Hq => &["job", "cancel", &job.id],
        };
        match command_output(program, args) {
            Ok(_) => print_status(&format!("job {} was cancelled", job.id)),
            Err(problem) => problems.push(format!("job {}: {problem}", job.id)),
        }
    }
    if problems.len() == jobs.len() {
        return Err(Failure::usage(problems.join("\n")));
    }
    problems.iter().for_each(|problem| print_status(problem));
    print_status(&format!(
        "finished runs are kept; run `lumbre submit` or `lumbre work {}` to resume",
        display_path(&home)
    ));
    Ok(Exit::Done)
}
