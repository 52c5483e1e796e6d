//! Makes the SPIR-V that is committed, or compares it with what would be made.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use lumbre_vulkan::pipelines::glsl::Compiler;
use lumbre_vulkan::pipelines::modules::{manifest, recipes};
use lumbre_vulkan::pipelines::recipe::Recipe;
use lumbre_vulkan::pipelines::sources::Sources;
use lumbre_vulkan::pipelines::test_kernel;
use rayon::prelude::*;

use crate::{root, spirv};

/// Compiler that makes the SPIR-V to commit, by what it states of its version: that of the package
/// `glslang-tools` of Debian 12. Others make other SPIR-V of the same shaders.
const MADE_BY: &str = "Glslang Version: 11:12.0.0";

/// Folder of the program's modules.
const PROGRAM: &str = "crates/lumbre-vulkan/spirv";

/// Folder of the texts of test modules; the modules are in its folder `spirv`.
const TESTS: &str = "tests/device/parity";

/// Options of the chore.
#[derive(clap::Args)]
pub struct Args {
    /// Write nothing; fail if a committed file differs from what the shaders compile to. With
    /// another version of the compiler than that of Debian 12, only hashes are compared
    #[arg(long)]
    check: bool,
    /// Write nothing; print the static counts of the modules in a folder, by default the committed
    /// ones
    #[arg(long, value_name = "FOLDER", num_args = 0..=1, default_missing_value = PROGRAM)]
    stats: Option<PathBuf>,
}

/// Makes all modules and their manifests.
///
/// # Errors
/// Returns a message if a shader does not compile, a file cannot be read or written or, with
/// `--check`, differs.
pub fn run(args: &Args) -> Result<(), String> {
    if let Some(folder) = &args.stats {
        print!("{}", spirv::table(&root().join(folder))?);
        return Ok(());
    }
    let compiler = chosen(args.check)?;
    let program = recipes();
    let tests = test_kernel::recipes(&root().join(TESTS)).map_err(|e| format!("{TESTS}: {e}"))?;
    let mut outdated = Vec::new();
    let mut put = |path: &str, bytes: &[u8]| {
        let is_outdated = update(&root().join(path), bytes, args.check)?;
        outdated.extend(is_outdated.then(|| path.to_owned()));
        Ok::<(), String>(())
    };
    for (folder, recipes) in [(PROGRAM, &program), (&format!("{TESTS}/spirv"), &tests)] {
        let modules = match &compiler {
            Some(compiler) => make(compiler, recipes)?,
            None => read(folder, recipes),
        };
        for (file, bytes) in &modules {
            put(&format!("{folder}/{file}"), bytes)?;
        }
        put(
            &format!("{folder}/manifest.txt"),
            manifest(recipes, &modules).as_bytes(),
        )?;
        let bytes: usize = modules.iter().map(|(_, bytes)| bytes.len()).sum();
        println!(
            "{folder}: {} modules, {} KiB",
            modules.len(),
            bytes.div_ceil(1024)
        );
    }
    for (folder, recipes) in [(PROGRAM, &program), (&format!("{TESTS}/spirv"), &tests)] {
        outdated.extend(remove_others(folder, recipes, args.check)?);
    }
    match (args.check, outdated.as_slice()) {
        (_, []) => println!("the committed SPIR-V is up to date"),
        (false, changed) => println!("written or removed:\n  {}", changed.join("\n  ")),
        (true, changed) => {
            return Err(format!(
                "outdated, to be made by `cargo shaders`:\n  {}",
                changed.join("\n  ")
            ));
        }
    }
    Ok(())
}

/// Returns the compiler to use: none if committed modules are only to be compared with their hashes,
/// since the compiler is missing or makes others.
fn chosen(check: bool) -> Result<Option<Compiler>, String> {
    let found = Compiler::find().map_err(|e| e.to_string());
    let version = found.as_ref().map_err(String::clone);
    let version = version.and_then(Compiler::version);
    if version.as_deref() == Ok(MADE_BY) {
        return found.map(Some);
    }
    let version = version.unwrap_or_else(|problem| problem);
    if check {
        println!("only hashes are compared, for want of a compiler with `{MADE_BY}`: {version}");
        return Ok(None);
    }
    println!("before you commit, make the modules with `{MADE_BY}`, not with `{version}`");
    found.map(Some)
}

/// Files by name, with their bytes.
type Modules = Vec<(String, Vec<u8>)>;

/// Compiles modules.
fn make(compiler: &Compiler, recipes: &[Recipe]) -> Result<Modules, String> {
    let make = |recipe: &Recipe| {
        let made = compiler.make(&Sources::Embedded, recipe);
        let words = made.map_err(|e| e.to_string())?;
        let bytes = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        Ok((recipe.file.clone(), bytes))
    };
    recipes.par_iter().map(make).collect()
}

/// Reads the committed modules; a missing one is empty.
fn read(folder: &str, recipes: &[Recipe]) -> Modules {
    let read = |recipe: &Recipe| {
        let bytes = std::fs::read(root().join(folder).join(&recipe.file)).unwrap_or_default();
        (recipe.file.clone(), bytes)
    };
    recipes.iter().map(read).collect()
}

/// Writes a file unless it has these bytes already, or `check`; returns whether it had others.
fn update(path: &Path, bytes: &[u8], check: bool) -> Result<bool, String> {
    let differs = std::fs::read(path).ok().as_deref() != Some(bytes);
    if differs && !check {
        let folder = path.parent().unwrap_or(path);
        std::fs::create_dir_all(folder)
            .and_then(|()| std::fs::write(path, bytes))
            .map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(differs)
}

/// Removes modules without a recipe from a folder, unless `check`; returns their paths.
fn remove_others(folder: &str, recipes: &[Recipe], check: bool) -> Result<Vec<String>, String> {
    let known: BTreeSet<&str> = recipes.iter().map(|recipe| recipe.file.as_str()).collect();
    let path = root().join(folder);
    let entries = std::fs::read_dir(&path).map_err(|e| format!("{folder}: {e}"))?;
    let mut others = Vec::new();
    for entry in entries {
        let name = entry.map_err(|e| format!("{folder}: {e}"))?.file_name();
        let name = name.to_string_lossy();
        if name.ends_with(".spv") && !known.contains(&*name) {
            if !check {
                std::fs::remove_file(path.join(&*name)).map_err(|e| format!("{name}: {e}"))?;
            }
            others.push(format!("{folder}/{name}"));
        }
    }
    Ok(others)
}
