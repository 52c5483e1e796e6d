//! Circles of imports: files of a room that import each other, directly or through others, can only
//! be read together. There are at most [`MOST_CIRCLES`], and none has more than [`MOST_FILES`]
//! files.

use std::collections::{BTreeMap, BTreeSet};

use super::source::{SOURCES, code_only, rust_files, text};

/// Greatest number of circles in all crates.
const MOST_CIRCLES: usize = 5;

/// Greatest number of files of a circle.
const MOST_FILES: usize = 4;

/// Path of a module below the sources of its crate, without `mod`.
type Module = Vec<String>;

/// Imports of all modules, and what they re-export.
struct Imports {
    modules: BTreeSet<Module>,
    /// Paths that a module imports for its own use.
    imported: BTreeMap<Module, Vec<Module>>,
    /// Names that a module re-exports, and their paths.
    exported: BTreeMap<Module, BTreeMap<String, Module>>,
}

/// Returns the module of a file below the sources of a crate; `None` for tests, `lib.rs` and
/// `main.rs`.
fn module(file: &str, sources: &str) -> Option<Module> {
    let path = file.strip_prefix(sources)?.strip_prefix('/')?;
    let path = path.strip_suffix(".rs")?;
    let mut parts: Module = path.split('/').map(str::to_owned).collect();
    parts.pop_if(|last| last == "mod");
    let skipped = ["lib", "main"].contains(&path) || parts.iter().any(|p| p == "tests");
    (!skipped).then_some(parts)
}

/// Splits the tree of a `use` declaration into single paths, without new names.
fn paths(tree: &str) -> Vec<String> {
    let Some((prefix, rest)) = tree.split_once('{') else {
        let path = tree.split(" as ").next().unwrap_or_default();
        return vec![path.trim().to_owned()];
    };
    let inner = rest.trim_end().strip_suffix('}').unwrap_or(rest);
    let mut found = Vec::new();
    let (mut depth, mut start) = (0, 0);
    for (at, c) in inner.char_indices().chain([(inner.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let item = inner[start..at].trim();
                if !item.is_empty() {
                    let item = paths(item).into_iter();
                    found.extend(item.map(|path| format!("{}{path}", prefix.trim())));
                }
                start = at + 1;
            }
            _ => {}
        }
    }
    found
}

/// Returns the absolute path of an import in a module, or `None` if it is of another crate.
fn absolute(module: &Module, path: &str, modules: &BTreeSet<Module>) -> Option<Module> {
    let mut parts = path
        .split("::")
        .map(|part| part.trim().to_owned())
        .peekable();
    let mut base = module.clone();
    match parts.peek()?.as_str() {
        "crate" => {
            base.clear();
            parts.next();
        }
        "self" => {
            parts.next();
        }
        "super" => {
            while parts.next_if_eq("super").is_some() {
                base.pop();
            }
        }
        child => {
            let mut inner = base.clone();
            inner.push(child.to_owned());
            modules.contains(&inner).then_some(())?;
        }
    }
    base.extend(parts);
    Some(base)
}

impl Imports {
    fn read(sources: &str) -> Imports {
        let files: Vec<(Module, String)> = rust_files(sources)
            .into_iter()
            .filter_map(|file| Some((module(&file, sources)?, file)))
            .collect();
        let modules: BTreeSet<Module> = files.iter().map(|(module, _)| module.clone()).collect();
        let mut imports = Imports {
            modules,
            imported: BTreeMap::new(),
            exported: BTreeMap::new(),
        };
        for (module, file) in files {
            let code = code_only(&text(&file));
            let code = code.split("mod tests {").next().unwrap_or_default();
            imports.add(&module, code);
        }
        imports
    }

    /// Adds the `use` declarations of a module.
    fn add(&mut self, module: &Module, code: &str) {
        self.imported.entry(module.clone()).or_default();
        for statement in code.split(';') {
            let Some((before, tree)) = statement.rsplit_once("use ") else {
                continue;
            };
            let line = before.rsplit('\n').next().unwrap_or_default().trim();
            let exported = line.starts_with("pub");
            if !line.is_empty() && !exported {
                continue;
            }
            for path in paths(tree) {
                let Some(path) = absolute(module, &path, &self.modules) else {
                    continue;
                };
                if exported {
                    let name = path.last().cloned().unwrap_or_default();
                    let names = self.exported.entry(module.clone()).or_default();
                    names.insert(name, path);
                } else {
                    self.imported.entry(module.clone()).or_default().push(path);
                }
            }
        }
    }

    /// Returns the module in which the item with this path is defined, following re-exports.
    fn home(&self, path: &Module) -> Option<Module> {
        let mut path = path.clone();
        for _ in 0..8 {
            let mut at = path.clone();
            while !at.is_empty() && !self.modules.contains(&at) {
                at.pop();
            }
            let name = path.get(at.len());
            match name.and_then(|name| self.exported.get(&at)?.get(name)) {
                Some(next) if *next != path => path = next.clone(),
                _ => return (!at.is_empty()).then_some(at),
            }
        }
        None
    }

    /// Modules that each module can reach by imports, itself only through others.
    fn reachable(&self) -> BTreeMap<&Module, BTreeSet<Module>> {
        let direct: BTreeMap<&Module, BTreeSet<Module>> = self
            .imported
            .iter()
            .map(|(module, paths)| {
                let homes = paths.iter().filter_map(|path| self.home(path));
                (module, homes.filter(|home| home != module).collect())
            })
            .collect();
        let all = direct.keys().map(|module| {
            let mut found = BTreeSet::new();
            let mut open: Vec<Module> = direct[module].iter().cloned().collect();
            while let Some(next) = open.pop() {
                if found.insert(next.clone()) {
                    open.extend(direct.get(&next).into_iter().flatten().cloned());
                }
            }
            (*module, found)
        });
        all.collect()
    }
}

#[test]
fn there_are_few_circles_of_imports_and_all_are_small() {
    let (mut circles, mut count) = (BTreeSet::new(), 0);
    for sources in SOURCES {
        let imports = Imports::read(sources);
        let reachable = imports.reachable();
        count += reachable.len();
        for (module, found) in &reachable {
            let back =
                |other: &&Module| reachable.get(*other).is_some_and(|of| of.contains(*module));
            let circle: BTreeSet<&Module> = found.iter().filter(back).collect();
            if circle.len() > 1 {
                let names: Vec<String> = circle.iter().map(|module| module.join("/")).collect();
                circles.insert((names.len(), format!("{sources}: {}", names.join(", "))));
            }
        }
    }
    assert!(count > 300, "too few files: {count}");
    let is_large = circles.iter().any(|(files, _)| *files > MOST_FILES);
    let names: Vec<String> = circles.into_iter().map(|(_, names)| names).collect();
    assert!(
        names.len() <= MOST_CIRCLES && !is_large,
        "circles of imports:\n{}",
        names.join("\n")
    );
}

#[test]
fn an_experiment_does_not_know_how_it_is_stored() {
    let files = rust_files("crates/lumbre-night/src/experiment");
    let names_store = |file: &String| code_only(&text(file)).contains("crate::store");
    let found: Vec<String> = files.into_iter().filter(names_store).collect();
    assert!(found.is_empty(), "{found:?} name the store");
}

#[test]
fn imports_are_found_in_groups_and_followed_through_exports() {
    assert_eq!(
        paths("crate::a::{b, c::{D, E as F}}"),
        ["crate::a::b", "crate::a::c::D", "crate::a::c::E"]
    );
    let path = |text: &str| -> Module { text.split("::").map(str::to_owned).collect() };
    let mut imports = Imports {
        modules: ["a", "a::b", "c"].map(path).into(),
        imported: BTreeMap::new(),
        exported: BTreeMap::new(),
    };
    imports.add(&path("a"), "pub use b::Thing;\nmod b;\n");
    imports.add(&path("a::b"), "use crate::c::other;\nuse std::fs;\n");
    imports.add(&path("c"), "use crate::a::Thing;\n");
    assert_eq!(imports.home(&path("a::Thing")), Some(path("a::b")));
    let reachable = imports.reachable();
    assert!(reachable[&path("c")].contains(&path("c")), "c, a::b, c");
    assert!(reachable[&path("a")].is_empty(), "exports are no imports");
}
