//! Remedies for names of integrators that do not exist, wherever one can be named.

use super::axes::help;
use lumbre_light::transport::integrator::external::EXTERNALS;
use lumbre_light::transport::integrator::integrators;

/// Names of algorithms in other programs and in the literature, with those of this program.
const ELSEWHERE: [(&[&str], &str); 3] = [
    (
        &[
            "path",
            "path_tracing",
            "pathtracer",
            "pathtracing",
            "volpath",
        ],
        "path tracing is `nee`, and `bpt` without light sampling",
    ),
    (
        &["bidir", "bidirectional", "bidirpath"],
        "bidirectional path tracing is `bdpt`",
    ),
    (
        &["photon", "photonmap", "photonmapper", "ppm"],
        "photon mapping is `sppm`",
    ),
];

/// Returns the remedy for an integrator that does not exist: its name here, the most similar name,
/// or all of them. `declared` are the names of the techniques that a script declares.
pub fn integrator_help<'a>(name: &str, declared: impl IntoIterator<Item = &'a str>) -> String {
    let folded = name.to_lowercase().replace('-', "_");
    let elsewhere = ELSEWHERE
        .iter()
        .find(|(names, _)| names.contains(&folded.as_str()));
    if let Some((_, here)) = elsewhere {
        return (*here).to_owned();
    }
    let rows = integrators().chain(EXTERNALS).map(|row| row.name);
    let help = help(name, rows.chain(declared));
    if help.starts_with("did you mean") {
        return help;
    }
    format!(
        "{help}; a technique of your own is known to the program that you built with it, by \
         lumbre::main_with, and to no other"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::transport::integrator::integrator;

    #[test]
    fn names_of_other_programs_and_misspelt_ones_are_explained() {
        assert!(integrator_help("Path", []).contains("`nee`"));
        assert_eq!(integrator_help("btp", []), "did you mean `bpt`?");
        assert_eq!(
            integrator_help("external:toi", ["external:toy"]),
            "did you mean `external:toy`?"
        );
        assert!(integrator_help("zzz", []).contains("external:mitsuba"));
        assert!(integrator_help("my_technique", []).contains("lumbre::main_with"));
        let mut names = ELSEWHERE.iter().flat_map(|(names, _)| *names);
        assert!(names.all(|name| integrator(name).is_none()));
    }
}
