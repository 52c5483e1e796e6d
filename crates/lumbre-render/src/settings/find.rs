//! Search of the files that scripts and commands name.

use std::path::{Path, PathBuf};

use lumbre_light::value::schema::SchemaError;
use lumbre_light::value::suggest;
use lumbre_scene_io::load::FORMATS;

/// Key of render tables that names a scene.
const SCENE: &str = "scene";

/// Largest number of files that a message lists.
const MOST_LISTED: usize = 8;

/// Searches a folder that a script names, relative to the current folder and then to the script's
/// folder.
///
/// # Errors
/// Returns an error with the paths that were tried if there is no such folder; `path` and `key` are
/// those of the field.
pub fn find_folder(
    name: &str,
    folder: &Path,
    path: &str,
    key: &str,
) -> Result<PathBuf, SchemaError> {
    let places = places(name, folder);
    if !name.is_empty()
        && let Some(found) = places.iter().find(|place| place.is_dir())
    {
        return Ok(found.clone());
    }
    let tried: Vec<String> = places.iter().map(|p| p.display().to_string()).collect();
    Err(
        SchemaError::new(path, key, format!("there is no folder `{name}`"))
            .with_help(format!("tried {}", tried.join(" and "))),
    )
}

/// Returns the paths at which a name of a script is looked for.
fn places(name: &str, folder: &Path) -> Vec<PathBuf> {
    let written = PathBuf::from(name);
    let is_current = folder.as_os_str().is_empty() || folder == Path::new(".");
    let beside = (!written.is_absolute() && !is_current).then(|| folder.join(name));
    std::iter::once(written).chain(beside).collect()
}

/// Searches a file that a script names, relative to the current folder and then to the script's
/// folder.
///
/// # Errors
/// Returns an error with the most similar file name, the scenes of a folder, or both paths, if the
/// file is in neither folder; `path` and `key` are those of the field.
pub fn find_file(name: &str, folder: &Path, path: &str, key: &str) -> Result<PathBuf, SchemaError> {
    let places = places(name, folder);
    if !name.is_empty()
        && let Some(found) = places.iter().find(|place| place.is_file())
    {
        return Ok(found.clone());
    }
    let (problem, help) = match places.iter().find(|place| place.is_dir()) {
        Some(found) if !name.is_empty() => (
            format!("`{name}` is a folder"),
            content_of(found, key == SCENE),
        ),
        _ => (
            format!("there is no file `{name}`"),
            help_for_missing(&places),
        ),
    };
    Err(SchemaError::new(path, key, problem).with_help(help))
}

/// Describes the files in a folder, of scenes only if `scenes`.
fn content_of(folder: &Path, scenes: bool) -> String {
    let is_scene = |name: &String| {
        let extension = Path::new(name).extension().unwrap_or_default();
        let extension = extension.to_string_lossy().to_ascii_lowercase();
        let mut known = FORMATS.iter().flat_map(|row| row.extensions);
        extension == "lua" || known.any(|known| *known == extension)
    };
    let mut files = files_in(folder);
    let what = if scenes {
        files.retain(is_scene);
        "scenes"
    } else {
        "files"
    };
    if files.is_empty() {
        return format!("there are no {what} in it");
    }
    let shown = files.len().min(MOST_LISTED);
    let more = match files.len() - shown {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{what} in it: {}{more}", files[..shown].join(", "))
}

/// Returns the remedy for a file that is in none of the places.
fn help_for_missing(places: &[PathBuf]) -> String {
    let near = places.iter().find_map(|place| {
        let name = place.file_name()?.to_str()?;
        let files = files_in(folder_of(place));
        let near = suggest::nearest(name, files.iter().map(String::as_str))?;
        Some(place.with_file_name(near))
    });
    if let Some(near) = near {
        return format!("did you mean `{}`?", near.display());
    }
    if places.iter().all(|place| !folder_of(place).is_dir()) {
        return format!("there is no folder {}", folder_of(&places[0]).display());
    }
    let tried: Vec<String> = places.iter().map(|p| p.display().to_string()).collect();
    match tried.as_slice() {
        [_] => "give its path from the current folder".to_owned(),
        _ => format!("tried {}", tried.join(" and ")),
    }
}

/// Returns the folder of a file: `.` for a file name alone.
pub fn folder_of(file: &Path) -> &Path {
    let parent = file.parent().filter(|p| !p.as_os_str().is_empty());
    parent.unwrap_or(Path::new("."))
}

/// Returns the sorted names of the files in a folder that are valid Unicode.
fn files_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter(|entry| entry.path().is_file())
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    names.sort();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(name: &str, folder: &Path) -> String {
        let error = find_file(name, folder, "scene", SCENE).unwrap_err();
        error.to_string()
    }

    #[test]
    fn a_missing_file_is_named_with_a_similar_one_or_with_the_places() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        std::fs::create_dir(path.join("rooms")).unwrap();
        for file in ["rooms/box.glb", "rooms/notes.txt", "rooms/tea.lua"] {
            std::fs::write(path.join(file), "").unwrap();
        }
        assert!(find_file("rooms/box.glb", path, "scene", SCENE).is_ok());
        let near = path.join("rooms/box.glb");
        let near = format!(
            "there is no file `rooms/bx.glb` (did you mean `{}`?)",
            near.display()
        );
        assert!(message("rooms/bx.glb", path).contains(&near));
        let folder_given = message("rooms", path);
        assert!(
            folder_given.contains("`rooms` is a folder (scenes in it: box.glb, tea.lua)"),
            "{folder_given}"
        );
        assert!(message("romms/box.glb", path).contains("there is no folder romms"));
        let far = message("rooms/elephant.obj", path);
        assert!(far.contains("(tried rooms/elephant.obj and "), "{far}");
        let alone = message("no-such-file.obj", Path::new("."));
        assert!(alone.contains("from the current folder"), "{alone}");
    }
}
