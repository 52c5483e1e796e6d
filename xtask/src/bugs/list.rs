//! The list of planted bugs: files `xtask/bugs/*.txt`, one for each room of the code.
//!
//! Only the standard library is used, since a test in `tests/library/laws/` includes this file.

use std::collections::BTreeSet;
use std::path::Path;

/// Value of `caught` of a bug that no test of the default command catches.
const NOTHING: &str = "nothing";

/// A bug to plant.
pub struct Bug {
    /// Unique name.
    pub name: String,
    /// Name of the room: that of the file of the list.
    pub room: String,
    /// The kind of mistake, such as `sign` or `unit`.
    pub kind: String,
    /// Tests that catch it; empty if no default test does.
    pub caught: Vec<TestCall>,
    /// Source code as it is in the tree, with marks.
    pub block: Vec<Piece>,
}

/// A test binary, and filters of which a test's path has to contain one.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct TestCall {
    /// Name of the binary as cargo has it: of a test target, or of a library for its unit tests.
    pub binary: String,
    /// Parts of paths of tests.
    pub filters: Vec<String>,
}

/// A piece of a block of source code.
pub enum Piece {
    /// Code that stays.
    Kept(String),
    /// Code to replace: `⟦right → wrong⟧`. Either may be empty.
    Mark {
        /// The code of the tree.
        right: String,
        /// The code with the bug.
        wrong: String,
    },
}

impl Bug {
    /// Returns the number by which the running program knows the bug: the FNV-1a hash of its name,
    /// so that a new bug does not change the numbers, and thereby the code, of others.
    pub fn number(&self) -> u32 {
        let step = |hash: u32, byte: u8| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193);
        self.name.bytes().fold(0x811c_9dc5, step)
    }
}

impl std::fmt::Display for TestCall {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{} {}", self.binary, self.filters.join(" "))
    }
}

/// Reads all files of the list in a folder.
///
/// # Errors
/// Returns a message that names the file and the entry if an entry is incomplete, or if two bugs
/// have the same name or number.
pub fn read(folder: &Path) -> Result<Vec<Bug>, String> {
    let at_folder = |e: std::io::Error| format!("{}: {e}", folder.display());
    let entries = std::fs::read_dir(folder).map_err(at_folder)?;
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "txt"));
    files.sort();
    let mut bugs = Vec::new();
    for path in files {
        let room = path.file_stem().unwrap_or_default().to_string_lossy();
        let text = std::fs::read_to_string(&path).map_err(at_folder)?;
        bugs.extend(parse(&room, &text).map_err(|e| format!("xtask/bugs/{room}.txt: {e}"))?);
    }
    let (mut names, mut numbers) = (BTreeSet::new(), BTreeSet::new());
    for bug in &bugs {
        if !names.insert(&bug.name) || !numbers.insert(bug.number()) {
            return Err(format!(
                "xtask/bugs: two bugs are called `{}`, or have the same hash; rename one",
                bug.name
            ));
        }
    }
    Ok(bugs)
}

/// Parses a file of the list. Text before the first entry is a comment.
///
/// # Errors
/// Returns a message with the name of the first entry that is incomplete.
pub fn parse(room: &str, text: &str) -> Result<Vec<Bug>, String> {
    let text = format!("\n{text}");
    let entries = text.split("\n== ").skip(1);
    entries
        .map(|entry| {
            let (name, rest) = entry.split_once('\n').unwrap_or((entry, ""));
            let name = name.trim();
            parse_entry(room, name, rest).map_err(|e| format!("{name}: {e}"))
        })
        .collect()
}

/// Parses the lines of an entry after its name.
fn parse_entry(room: &str, name: &str, text: &str) -> Result<Bug, String> {
    let (mut kind, mut caught, mut named, mut rest) = (None, Vec::new(), false, text);
    loop {
        let (line, after) = rest.split_once('\n').unwrap_or((rest, ""));
        if let Some(value) = line.strip_prefix("kind:") {
            kind = Some(value.trim().to_owned());
        } else if let Some(value) = line.strip_prefix("caught:") {
            named = true;
            caught.extend(parse_call(value)?);
        } else {
            break;
        }
        rest = after;
    }
    let kind = kind.filter(|kind| !kind.is_empty());
    let block = parse_block(rest)?;
    if !block
        .iter()
        .any(|piece| matches!(piece, Piece::Mark { .. }))
    {
        return Err("the block has no mark `⟦right → wrong⟧`".to_owned());
    }
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if name.is_empty() || !name.chars().all(plain) {
        return Err("a name has lower-case letters, digits and hyphens only".to_owned());
    }
    if !named {
        return Err(format!(
            "there is no line `caught: BINARY FILTER...`, or `caught: {NOTHING}`"
        ));
    }
    Ok(Bug {
        name: name.to_owned(),
        room: room.to_owned(),
        kind: kind.ok_or("there is no line `kind: ...`")?,
        caught,
        block,
    })
}

/// Parses the value of a line `caught`.
fn parse_call(value: &str) -> Result<Option<TestCall>, String> {
    let mut words = value.split_whitespace().map(str::to_owned);
    match words.next() {
        Some(word) if word == NOTHING => Ok(None),
        Some(binary) => {
            let filters: Vec<String> = words.collect();
            match filters.is_empty() {
                true => Err(format!("`caught: {binary}` names no test of the binary")),
                false => Ok(Some(TestCall { binary, filters })),
            }
        }
        None => Err("a line `caught:` is empty".to_owned()),
    }
}

/// Parses source code with marks.
fn parse_block(text: &str) -> Result<Vec<Piece>, String> {
    let mut parts = text.split('⟦');
    let mut block = vec![Piece::Kept(parts.next().unwrap_or_default().to_owned())];
    for part in parts {
        let (mark, after) = part.split_once('⟧').ok_or("a mark has no `⟧`")?;
        let (right, wrong) = mark.split_once('→').ok_or("a mark has no `→`")?;
        let [right, wrong] = [right, wrong].map(|code| code.trim().to_owned());
        if right == wrong {
            return Err(format!("a mark changes nothing: `{right}`"));
        }
        let before = match block.last() {
            Some(Piece::Kept(code)) => code.trim_end(),
            _ => "",
        };
        if before.ends_with('.') || [&right, &wrong].iter().any(|code| code.starts_with('.')) {
            return Err(format!("a mark is no whole expression: `{right}`"));
        }
        block.extend([Piece::Mark { right, wrong }, Piece::Kept(after.to_owned())]);
    }
    Ok(block)
}
