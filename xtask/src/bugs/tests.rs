//! Tests of the list's format and of the planting.

use super::list::{Bug, TestCall, parse};
use super::place::{Source, place, planted};

/// Parses a list with one entry or more.
fn bugs(text: &str) -> Vec<Bug> {
    parse("room", text).unwrap_or_else(|e| panic!("{e}"))
}

/// Returns an entry with a block.
fn entry(name: &str, block: &str) -> String {
    format!("== {name}\nkind: sign\ncaught: nothing\n{block}\n")
}

/// Plants the bugs of a list in one source, and returns its text with whitespace collapsed.
fn plant(list: &str, source: &str) -> Result<String, String> {
    let (bugs, sources) = (
        bugs(list),
        [Source::new("a.rs".to_owned(), source.to_owned())],
    );
    let edits = place(&bugs, &sources)?;
    let texts = planted(&bugs, &sources, &edits);
    Ok(texts["a.rs"]
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" "))
}

#[test]
fn entries_have_a_name_a_kind_tests_and_a_block() {
    let text = "Bugs of a room.\n\n== one\nkind: off by one\ncaught: light a::b c\n\
                caught: program d\nlet x = ⟦1 → 2⟧;\n\n== two\nkind: sign\ncaught: nothing\n⟦a → -a⟧\n";
    let bugs = bugs(text);
    let [one, two] = bugs.as_slice() else {
        panic!("{} entries", bugs.len());
    };
    assert_eq!(
        (one.name.as_str(), one.kind.as_str()),
        ("one", "off by one")
    );
    let calls: Vec<String> = one.caught.iter().map(TestCall::to_string).collect();
    assert_eq!(calls, ["light a::b c", "program d"]);
    assert_eq!((two.name.as_str(), two.caught.len()), ("two", 0));
    // The FNV-1a hash of `one`.
    assert_eq!(one.number(), 0xba27_19ef);
}

#[test]
fn incomplete_entries_are_refused_with_their_name() {
    let cases = [
        ("== a\ncaught: nothing\n⟦b → c⟧", "`kind"),
        ("== a\nkind: sign\n⟦b → c⟧", "`caught"),
        ("== a\nkind: sign\ncaught: light\n⟦b → c⟧", "names no test"),
        ("== a\nkind: sign\ncaught: nothing\nb", "no mark"),
        ("== a\nkind: sign\ncaught: nothing\n⟦b c⟧", "no `→`"),
        (
            "== a\nkind: sign\ncaught: nothing\n⟦b → b⟧",
            "changes nothing",
        ),
        (
            "== a\nkind: sign\ncaught: nothing\nx.⟦b() → c()⟧",
            "no whole expression",
        ),
        ("== A b\nkind: sign\ncaught: nothing\n⟦b → c⟧", "lower-case"),
    ];
    for (text, expected) in cases {
        let problem = parse("room", text).err().unwrap_or_default();
        assert!(problem.contains(expected), "{text}: {problem}");
    }
}

#[test]
fn expressions_and_statements_become_conditions() {
    let source = "fn f() {\n    let x = g(a,\n        // why\n        b,\n    );\n    h();\n}\n";
    let cases = [
        (
            "let x = ⟦g(a, b) → g(b, a)⟧;",
            "let x = (if lumbre_planted::on(N) { g(b, a) } else { g(a, // why b, ) }) ;",
        ),
        ("⟦h(); →⟧", "if lumbre_planted::on(N) { } else { h(); } }"),
        (
            "h();⟦→ i();⟧ }",
            "h(); if lumbre_planted::on(N) { i(); } else { } }",
        ),
    ];
    for (block, expected) in cases {
        let list = entry("x", block);
        let expected = expected.replace('N', &bugs(&list)[0].number().to_string());
        let text = plant(&list, source).unwrap_or_else(|e| panic!("{e}"));
        assert!(text.contains(&expected), "{text}\n{expected}");
    }
}

#[test]
fn two_bugs_in_the_same_place_become_one_condition() {
    let list = entry("x", "⟦a → b⟧;") + &entry("y", "⟦a → c⟧;");
    let numbers = bugs(&list).iter().map(Bug::number).collect::<Vec<_>>();
    let [x, y] = numbers.as_slice() else {
        panic!("{numbers:?}");
    };
    let expected = format!(
        "(if lumbre_planted::on({x}) {{ b }} else if lumbre_planted::on({y}) {{ c }} else {{ a }}) ;"
    );
    assert_eq!(plant(&list, "a;"), Ok(expected));
}

#[test]
fn blocks_that_are_missing_ambiguous_or_overlapping_are_refused() {
    let cases = [
        (entry("x", "⟦b → c⟧;"), "x (room.txt): its block is nowhere"),
        (entry("x", "⟦f → g⟧("), "occurs 2 times"),
        (entry("x", "⟦f → g⟧oo"), "splits a word"),
        (
            entry("x", "⟦f(1) → 1⟧ + a") + &entry("y", "f(⟦1 → 2⟧) + a"),
            "x and y change overlapping code",
        ),
    ];
    for (list, expected) in cases {
        let problem = plant(&list, "foo; f(1) + a; f(2)")
            .err()
            .unwrap_or_default();
        assert!(problem.contains(expected), "{problem}");
    }
}

#[test]
fn formatting_and_comments_do_not_matter() {
    let source = "a(\n    b, // kept\n    // reworded\n    c,\n)";
    assert!(plant(&entry("x", "a(b, // kept\nc) ⟦→ ;⟧"), source).is_ok());
    // The comma before the bracket is not compared, so it may be the end of a block.
    assert!(plant(&entry("x", "⟦c → d⟧,"), source).is_ok());
}
