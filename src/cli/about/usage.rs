//! Arguments of the process before they are parsed, and errors of parsing with a remedy that fits
//! this program.

use std::ffi::OsString;
use std::path::Path;

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Error};

use lumbre_night::paths::extension;
use lumbre_report::picture::EXTENSIONS;

/// Returns the arguments with `diff` in place of `compare` if two pictures follow: `compare` takes a
/// scene, and two pictures are compared by `diff`.
pub fn with_verb_of_pictures(mut arguments: Vec<OsString>) -> Vec<OsString> {
    let verb = arguments.iter().position(|argument| argument == "compare");
    if let Some(verb) = verb {
        let files = arguments[verb + 1..].iter();
        if files.filter(|file| is_picture(Path::new(file))).count() >= 2 {
            arguments[verb] = "diff".into();
        }
    }
    arguments
}

fn is_picture(path: &Path) -> bool {
    EXTENSIONS.contains(&extension(path).as_str())
}

/// Replaces the tips of an error of parsing `arguments` where others fit this program better.
pub fn with_remedy(mut error: Error, command: &Command, arguments: &[OsString]) -> Error {
    let verb = arguments.iter().skip(1).find_map(|argument| {
        let verb = command.find_subcommand(argument)?;
        Some(verb.get_name().to_owned())
    });
    match error.kind() {
        ErrorKind::UnknownArgument if error.get(ContextKind::SuggestedArg).is_none() => {
            let verb = verb.map_or_else(String::new, |verb| format!(" {verb}"));
            tip(
                &mut error,
                format!("`lumbre{verb} --help` lists the options"),
            );
        }
        ErrorKind::ArgumentConflict if verb.as_deref() == Some("render") => {
            let repeated = |value: &ContextValue| value.to_string().starts_with("--integrator");
            if error.get(ContextKind::InvalidArg).is_some_and(repeated) {
                let text = "`lumbre compare FILE --technique NAME,NAME` compares techniques";
                tip(&mut error, text.to_owned());
            }
        }
        ErrorKind::InvalidSubcommand => improve_unknown_verb(&mut error),
        _ => {}
    }
    error
}

/// Verbs of earlier versions, and what does the same.
const OLD_VERBS: [(&str, &str); 4] = [
    ("retry", "run --retry"),
    ("explain", "show RUN --why"),
    ("benchmark", "bench --suite"),
    ("benchmark compare", "bench --compare FILE.."),
];

/// Suggests the verb for a file that is given without one, the new name of an old verb, or only the
/// most similar verb.
fn improve_unknown_verb(error: &mut Error) {
    let Some(ContextValue::String(given)) = error.get(ContextKind::InvalidSubcommand) else {
        return;
    };
    let given = given.clone();
    let path = Path::new(&given);
    let is_old = |(old, _): &&(&str, &str)| old.split(' ').next() == Some(&given);
    let new: Vec<String> = OLD_VERBS
        .iter()
        .filter(is_old)
        .map(|(old, new)| format!("`lumbre {old}` is `lumbre {new}` now"))
        .collect();
    if !new.is_empty() {
        error.remove(ContextKind::SuggestedSubcommand);
        tip(error, new.join(", "));
    } else if is_picture(path) {
        error.remove(ContextKind::SuggestedSubcommand);
        tip(
            error,
            format!("`lumbre metric {given} REFERENCE` measures a picture"),
        );
    } else if path.extension().is_some() || path.is_file() {
        error.remove(ContextKind::SuggestedSubcommand);
        tip(
            error,
            format!(
                "`lumbre render {given}` renders a scene, `lumbre run {given}` runs the script of an \
                 experiment"
            ),
        );
    } else if let Some(ContextValue::Strings(similar)) = error.get(ContextKind::SuggestedSubcommand)
    {
        // They are in ascending order of similarity.
        let best: Vec<String> = similar.last().cloned().into_iter().collect();
        error.insert(
            ContextKind::SuggestedSubcommand,
            ContextValue::Strings(best),
        );
    }
}

/// Gives an error one tip in place of those that it has.
fn tip(error: &mut Error, text: String) {
    let tips = vec![StyledStr::from(text)];
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tips));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::about::reference::command;

    fn parsed(words: &str) -> String {
        let arguments: Vec<OsString> = words.split(' ').map(OsString::from).collect();
        let error = command().try_get_matches_from(&arguments).unwrap_err();
        with_remedy(error, &command(), &arguments)
            .render()
            .to_string()
    }

    #[test]
    fn errors_of_usage_name_what_to_do() {
        for (words, expected) in [
            (
                "lumbre compare a.glb --spp 4",
                "tip: `lumbre compare --help` lists the options",
            ),
            (
                "lumbre render a.glb -i nee -i bdpt",
                "tip: `lumbre compare FILE --technique",
            ),
            (
                "lumbre model.glb",
                "tip: `lumbre render model.glb` renders a scene",
            ),
            ("lumbre a.exr", "`lumbre metric a.exr REFERENCE`"),
            ("lumbre retry latest", "`lumbre run --retry` now"),
            ("lumbre explain ab12", "`lumbre show RUN --why` now"),
            (
                "lumbre benchmark compare a b",
                "is `lumbre bench --compare FILE..` now",
            ),
            ("lumbre rendr", "similar subcommand exists: 'render'"),
            (
                "lumbre render a.glb --depth -3",
                "whole number of at least 1, found `-3`",
            ),
            (
                "lumbre render a.glb --time -5s",
                "expected a duration such as 30s or 5min",
            ),
            (
                "lumbre render a.glb --spp 1e3",
                "whole number of at least 1, found `1e3`",
            ),
            ("lumbre render a.glb --size 99999x9", "each at most 32768"),
            (
                "lumbre render a.glb --threads -1",
                "at most 1024, 0 for all cores, found `-1`",
            ),
        ] {
            let shown = parsed(words);
            assert!(shown.contains(expected), "{words}: {shown}");
            assert!(!shown.contains("as a value, use"), "{words}: {shown}");
        }
    }

    #[test]
    fn two_pictures_are_compared_by_diff() {
        let verb = |words: &str| {
            let arguments = words.split(' ').map(OsString::from).collect();
            with_verb_of_pictures(arguments)[1].clone()
        };
        assert_eq!(verb("lumbre compare a.exr b.PNG --fail ztest=1e-3"), "diff");
        assert_eq!(verb("lumbre compare a.glb"), "compare");
        assert_eq!(verb("lumbre metric a.exr b.exr"), "metric");
    }
}
