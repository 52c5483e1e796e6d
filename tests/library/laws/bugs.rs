//! The list of planted bugs in `xtask/bugs/` fits the code: `cargo xtask bugs` can plant each.

#[path = "../../../xtask/src/bugs/list.rs"]
mod list;
#[path = "../../../xtask/src/bugs/place.rs"]
mod place;

use std::collections::BTreeSet;

use super::source::{code_only, root};

/// Test targets that entries may name beside the libraries.
const TARGETS: [&str; 4] = ["device", "library", "light", "program"];

#[test]
fn each_planted_bug_is_one_place_in_the_code() {
    let bugs = list::read(&root().join("xtask/bugs")).unwrap_or_else(|e| panic!("{e}"));
    assert!(bugs.len() > 100, "{} bugs", bugs.len());
    let sources = place::sources(root()).unwrap_or_else(|e| panic!("{e}"));
    let edits = place::place(&bugs, &sources)
        .unwrap_or_else(|e| panic!("xtask/bugs does not fit the code:\n{e}"));
    for (path, text) in place::planted(&bugs, &sources, &edits) {
        let code = code_only(&text);
        for [open, close] in [['(', ')'], ['[', ']'], ['{', '}']] {
            let count = |bracket| code.matches(bracket).count();
            assert_eq!(
                count(open),
                count(close),
                "{path}: a bug in xtask/bugs has an unbalanced `{open}`"
            );
        }
    }
}

#[test]
fn planted_bugs_name_kinds_rooms_and_known_test_binaries() {
    let bugs = list::read(&root().join("xtask/bugs")).unwrap_or_else(|e| panic!("{e}"));
    let rooms: BTreeSet<&str> = bugs.iter().map(|bug| bug.room.as_str()).collect();
    assert!(rooms.len() > 10, "{rooms:?}");
    for bug in &bugs {
        let words = bug.kind.split_whitespace().count();
        assert!(words <= 4, "{}: `kind: {}` is no kind", bug.name, bug.kind);
        for call in &bug.caught {
            let binary = call.binary.as_str();
            assert!(
                TARGETS.contains(&binary) || binary.starts_with("lumbre"),
                "{}: `caught: {call}` names no test binary",
                bug.name
            );
        }
    }
}
