//! Reference page of the command line, generated from its definition.

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command, CommandFactory};

use crate::cli::args::Cli;
use crate::cli::exit::EXIT_CODES_HELP;
use lumbre_light::value::markdown::{row, sentence, table_head};

/// Verbs in groups, in the order of the page.
const GROUPS: &[(&str, &[&str])] = &[
    ("Without a script", &["render", "explore", "compare", "new"]),
    ("Experiments", &["run", "plan", "check"]),
    ("Progress", &["watch", "status", "ls", "note", "show"]),
    (
        "Results",
        &["report", "view", "metric", "diff", "reproduce"],
    ),
    ("Scenes", &["trace", "bsdf", "export"]),
    ("Clusters", &["submit", "work", "cancel"]),
    (
        "The program itself",
        &["doctor", "verify", "bench", "schema"],
    ),
];

/// Global options that have no effect on some verbs, with the verbs on which they have one.
const OPTIONS: &[(&str, &[&str])] = &[
    (
        "out",
        &[
            "compare",
            "run",
            "plan",
            "watch",
            "status",
            "ls",
            "note",
            "show",
            "report",
            "view",
            "diff",
            "reproduce",
            "trace",
            "submit",
            "work",
            "cancel",
            "doctor",
            "bench",
        ],
    ),
    (
        "backend",
        &[
            "render",
            "explore",
            "compare",
            "run",
            "plan",
            "check",
            "show",
            "submit",
            "work",
            "trace",
            "reproduce",
            "verify",
            "bench",
        ],
    ),
    (
        "threads",
        &[
            "render",
            "explore",
            "compare",
            "run",
            "work",
            "trace",
            "reproduce",
            "verify",
            "bench",
        ],
    ),
    (
        "memory",
        &[
            "render", "compare", "run", "plan", "check", "work", "submit",
        ],
    ),
    (
        "no_tui",
        &["render", "explore", "compare", "run", "watch", "work"],
    ),
    (
        "allow_commands",
        &[
            "compare",
            "run",
            "plan",
            "check",
            "show",
            "submit",
            "work",
            "reproduce",
        ],
    ),
    (
        "confine",
        &[
            "render",
            "explore",
            "compare",
            "new",
            "run",
            "plan",
            "check",
            "watch",
            "status",
            "ls",
            "note",
            "show",
            "report",
            "view",
            "metric",
            "diff",
            "reproduce",
            "trace",
            "bsdf",
            "export",
            "submit",
            "work",
            "cancel",
            "verify",
            "bench",
        ],
    ),
    (
        "lenient",
        &[
            "render",
            "explore",
            "compare",
            "new",
            "run",
            "plan",
            "check",
            "show",
            "submit",
            "work",
            "trace",
            "export",
            "bsdf",
            "reproduce",
            "verify",
            "bench",
        ],
    ),
];

/// Subcommands of verbs on which no option of [`OPTIONS`] has an effect. On other subcommands, those
/// of the verb have one.
const WITHOUT_OPTIONS: &[&str] = &["new technique"];

/// Heading of the options that every verb accepts.
const EVERY_VERB: &str = "Options of every verb";

/// First commands of a new user.
const START: &str = "\
Start with:
  lumbre render scenes/cornell.lua      one picture of a scene
  lumbre explore scenes/cornell.lua     the same while its settings change
  lumbre compare scenes/cornell.lua     which technique is better on it, and by how much
  lumbre run scripts/first_light.lua    an experiment";

/// Returns the command line with its verbs in groups: the definition of [`Cli`] with a help text of
/// its own.
pub fn command() -> Command {
    let command = Cli::command();
    let mut verbs = String::new();
    for (title, group) in GROUPS {
        verbs += &format!("\n{title}:\n");
        for verb in *group {
            let about = command.find_subcommand(verb).and_then(Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            verbs += &format!("  {verb:<12} {about}\n");
        }
    }
    let mut command = command.help_template(format!(
        "{{about-with-newline}}\n{START}\n\n{{usage-heading}} {{usage}}\n{verbs}\n{EVERY_VERB}:\n\
         {{options}}{{after-help}}"
    ));
    // Building passes the global options on to the verbs.
    command.build();
    command.mut_subcommands(|verb| {
        let name = verb.get_name().to_owned();
        with_hidden_options(verb, &name)
    })
}

/// Returns a verb whose help leaves out options without effect, in its subcommands too. `name` is
/// its name after that of the verb to which it belongs, as in `new technique`.
fn with_hidden_options(verb: Command, name: &str) -> Command {
    let verb = verb.mut_args(|arg| {
        let arg = if arg.is_global_set() {
            arg.help_heading(EVERY_VERB)
        } else {
            arg
        };
        if has_effect(arg.get_id().as_str(), name) {
            arg
        } else {
            arg.hide(true)
        }
    });
    verb.mut_subcommands(|inner| {
        let name = format!("{name} {}", inner.get_name());
        with_hidden_options(inner, &name)
    })
}

/// Returns a warning for each global option that is given to a verb on which it has no effect.
pub fn options_without_effect(matches: &ArgMatches) -> Vec<String> {
    let Some((verb, mut given)) = matches.subcommand() else {
        return Vec::new();
    };
    let mut verb = verb.to_owned();
    while let Some((inner, matches)) = given.subcommand() {
        (verb, given) = (format!("{verb} {inner}"), matches);
    }
    let verb = verb.as_str();
    // Verbs that do not take an option at all have no such id.
    let is_given = |option: &&str| {
        given.try_contains_id(option).is_ok()
            && given.value_source(option) == Some(ValueSource::CommandLine)
    };
    OPTIONS
        .iter()
        .map(|(option, _)| *option)
        .filter(|option| !has_effect(option, verb))
        .filter(is_given)
        .map(|option| {
            let remedy = match (verb, option) {
                ("render", "out") => "; the file of the picture follows `-o`",
                _ => "",
            };
            let option = option.replace('_', "-");
            format!("note: `--{option}` has no effect on `lumbre {verb}`{remedy}")
        })
        .collect()
}

/// Returns whether an option has an effect on a verb or on a subcommand of one, as in `submit slurm`.
/// Options of single verbs do.
fn has_effect(option: &str, name: &str) -> bool {
    let verb = name.split(' ').next().unwrap_or_default();
    let mut rows = OPTIONS.iter();
    rows.find(|(known, _)| *known == option)
        .is_none_or(|(_, verbs)| verbs.contains(&verb) && !WITHOUT_OPTIONS.contains(&name))
}

/// Returns the generated part of docs/reference/command-line.md: verbs by group, the options of
/// every verb, and the exit codes.
pub fn reference() -> String {
    let mut command = Cli::command();
    command.build();
    let mut out = table_head(["verb", "purpose"]);
    for verb in GROUPS.iter().flat_map(|(_, verbs)| *verbs) {
        let about = command.find_subcommand(verb).and_then(Command::get_about);
        let about = about.map(ToString::to_string).unwrap_or_default();
        out += &row([&format!("[`{verb}`](#lumbre-{verb})"), &sentence(&about)]);
    }
    for (title, verbs) in GROUPS {
        out += &format!("\n## {title}\n");
        for verb in *verbs {
            if let Some(verb) = command.find_subcommand_mut(verb) {
                out += &verb_section(verb, "lumbre");
            }
        }
    }
    out += "\n## Options of every verb\n\n";
    let global: Vec<&Arg> = command
        .get_arguments()
        .filter(|arg| arg.is_global_set())
        .collect();
    out += &arguments(&global);
    out += &format!("\n## Exit codes\n\n```text\n{EXIT_CODES_HELP}\n```\n");
    out
}

/// Returns the section of a verb and of its subcommands; `parent` is the command before its name.
fn verb_section(command: &mut Command, parent: &str) -> String {
    let name = format!("{parent} {}", command.get_name());
    let about = command.get_long_about().or(command.get_about());
    let about = about.map(ToString::to_string).unwrap_or_default();
    let usage = command.render_usage().to_string();
    let usage = usage.trim_start_matches("Usage:").trim();
    let mut out = format!(
        "\n### `{name}`\n\n{}\n\n```text\n{usage}\n```\n",
        paragraphs(&about)
    );
    let own = |arg: &&Arg| !arg.is_global_set() && !arg.is_hide_set() && arg.get_id() != "help";
    let args: Vec<&Arg> = command.get_arguments().filter(own).collect();
    if !args.is_empty() {
        out += "\n";
        out += &arguments(&args);
    }
    for inner in command.get_subcommands_mut() {
        if inner.get_name() != "help" {
            out += &verb_section(inner, &name);
        }
    }
    out
}

/// Returns a help text as Markdown; indented lines become a code block.
fn paragraphs(help: &str) -> String {
    let mut blocks: Vec<String> = Vec::new();
    for block in help.split("\n\n") {
        let is_indented = block.lines().all(|line| line.starts_with("  "));
        if is_indented && !block.trim().is_empty() {
            let lines: Vec<&str> = block
                .lines()
                .map(|line| line.get(2..).unwrap_or(""))
                .collect();
            blocks.push(format!("```text\n{}\n```", lines.join("\n")));
        } else {
            blocks.push(sentence(block.trim()));
        }
    }
    blocks.join("\n\n")
}

/// Returns the table of arguments and options.
fn arguments(args: &[&Arg]) -> String {
    let mut out = table_head(["argument", "default", "meaning"]);
    for arg in args {
        let help = arg.get_long_help().or(arg.get_help());
        let help = help.map(ToString::to_string).unwrap_or_default();
        let (help, default) = help_and_default(arg, &help);
        out += &row([&format!("`{}`", spelling(arg)), &default, &help]);
    }
    out
}

/// Returns an argument as it is written on the command line.
fn spelling(arg: &Arg) -> String {
    let value = arg.get_value_names().map(|names| {
        names
            .iter()
            .map(|name| name.as_str())
            .collect::<Vec<_>>()
            .join(" ")
    });
    let takes_value = arg.get_action().takes_values();
    if arg.is_positional() {
        let name = value.unwrap_or_else(|| arg.get_id().as_str().to_uppercase());
        let many = arg.get_num_args().is_some_and(|n| n.max_values() > 1);
        let dots = if many { ".." } else { "" };
        return if arg.is_required_set() {
            format!("{name}{dots}")
        } else {
            format!("[{name}{dots}]")
        };
    }
    let short = arg.get_short().map(|c| format!("-{c}"));
    let long = arg.get_long().map(|name| format!("--{name}"));
    let names: Vec<String> = short.into_iter().chain(long).collect();
    match value {
        Some(value) if takes_value => format!("{} {value}", names.join(", ")),
        _ => names.join(", "),
    }
}

/// Splits the default off a help text, and adds the accepted values.
fn help_and_default(arg: &Arg, help: &str) -> (String, String) {
    let mut text = help
        .split("\n\n")
        .map(|paragraph| paragraph.replace('\n', " "))
        .collect::<Vec<_>>()
        .join("\n\n");
    let mut default = String::new();
    let given: Vec<String> = arg
        .get_default_values()
        .iter()
        .map(|value| format!("`{}`", value.to_string_lossy()))
        .collect();
    if !given.is_empty() && arg.get_action().takes_values() {
        default = given.join(", ");
    }
    if let Some((before, rest)) = text.clone().split_once(" [default: ")
        && let Some((value, after)) = rest.split_once(']')
    {
        default = value.to_owned();
        text = format!("{before}{after}");
    }
    let sentences: Vec<String> = text
        .split("\n\n")
        .filter(|paragraph| !paragraph.trim().is_empty())
        .map(|paragraph| sentence(paragraph.trim()))
        .collect();
    let mut help = sentences.join(" ");
    let values: Vec<String> = arg
        .get_possible_values()
        .iter()
        .filter(|value| !value.is_hide_set())
        .map(|value| format!("`{}`", value.get_name()))
        .collect();
    if !values.is_empty() && arg.get_action().takes_values() {
        help += &format!(" One of {}.", values.join(", "));
    }
    if default.is_empty() {
        default = "–".to_owned();
    }
    (help, default)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verb_is_in_one_group() {
        let command = Cli::command();
        let mut verbs: Vec<&str> = command
            .get_subcommands()
            .filter(|verb| !verb.is_hide_set())
            .map(Command::get_name)
            .collect();
        let mut grouped: Vec<&str> = GROUPS
            .iter()
            .flat_map(|(_, verbs)| *verbs)
            .copied()
            .collect();
        verbs.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(grouped, verbs);
    }

    #[test]
    fn every_subcommand_without_options_exists() {
        let command = Cli::command();
        for name in WITHOUT_OPTIONS {
            let mut words = name.split(' ');
            let found = words.try_fold(&command, |at, word| at.find_subcommand(word));
            assert!(found.is_some(), "{name}");
        }
    }

    #[test]
    fn options_without_effect_are_hidden_and_noted() {
        let mut command = command();
        let mut help = |words: &[&str]| {
            let found = words.iter().fold(&mut command, |at, word| {
                at.find_subcommand_mut(word).unwrap()
            });
            found.render_long_help().to_string()
        };
        let technique = help(&["new", "technique"]);
        for option in ["out", "backend", "threads", "memory", "confine", "lenient"] {
            assert!(!technique.contains(&format!("--{option}")), "{technique}");
        }
        assert!(technique.contains("--quiet"), "{technique}");
        assert!(!help(&["verify"]).contains("--out"));
        assert!(help(&["submit", "slurm"]).contains("--allow-commands"));

        let notes = |words: &str| {
            let matches = super::command().try_get_matches_from(words.split(' '));
            options_without_effect(&matches.unwrap())
        };
        let noted = notes("lumbre new technique some_links --out x");
        assert_eq!(
            noted,
            ["note: `--out` has no effect on `lumbre new technique`"]
        );
        assert!(notes("lumbre submit slurm a.lua --out x").is_empty());
    }

    #[test]
    fn every_option_is_on_the_page() {
        let page = reference();
        let mut command = Cli::command();
        command.build();
        for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set()) {
            let options = verb.get_arguments().filter(|arg| !arg.is_hide_set());
            for name in options
                .filter_map(Arg::get_long)
                .filter(|name| *name != "help")
            {
                assert!(
                    page.contains(&format!("--{name}")),
                    "{}: {name}",
                    verb.get_name()
                );
            }
        }
    }
}
