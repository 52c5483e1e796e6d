//! `lumbre explore`: a picture that renders while its settings change.

use std::collections::BTreeMap;
use std::io::{self, IsTerminal};
use std::path::Path;
use std::sync::Arc;

use crate::cli::args::{ExploreArgs, Global};
use crate::cli::exit::{Exit, Failure};
use crate::cli::night::signals;
use crate::cli::scene::builtin::{BuiltIn, scene_name};
use lumbre_night::experiment::NightControls;
use lumbre_night::paths::folder_of;
use lumbre_render::cpu;
use lumbre_scene_io::load::is_folder;
use lumbre_tui::explore::explorer::ExploreOptions;
use lumbre_tui::explore::picker::SceneList;
use lumbre_tui::explore::session::SessionOptions;
use lumbre_tui::explore::settings::SceneFile;
use lumbre_tui::explore::terminal;
use lumbre_tui::tui::{OutputMode, output_mode};

/// Runs `lumbre explore`.
pub fn main(args: &ExploreArgs, global: &Global) -> Result<Exit, Failure> {
    let backend = global.backend.as_deref().unwrap_or(cpu::ROW.name);
    let backend = match backend {
        "auto" => lumbre_night::backends::auto_backend().0,
        name => name,
    };
    let row = lumbre_night::backends::backend(backend)
        .ok_or_else(|| Failure::usage(format!("there is no backend `{backend}`")))?;
    (row.probe)().map_err(|e| Failure::usage(format!("backend `{backend}`: {e}")))?;
    // Keeps the files of the built-in scenes until the program ends.
    let built_in = match args.scene {
        Some(_) => None,
        None => Some(BuiltIn::unpack().map_err(Failure::internal)?),
    };
    let (scene, mut scenes) = choose(args, built_in.as_ref())?;
    check_settings(args, scene.as_ref(), &mut scenes)?;
    expect_terminal(global)?;
    let controls = Arc::new(NightControls::default());
    let stop_signal = signals::install(Arc::clone(&controls))?;
    let options = ExploreOptions {
        scene,
        scenes,
        settings: args.settings(),
        session: SessionOptions {
            backend: backend.to_owned(),
            threads: global.threads,
            missing: global.missing(),
        },
        folder: ".".into(),
    };
    terminal::run(options, &|| controls.stop_requested())
        .map_err(|e| Failure::internal(format!("cannot use the terminal: {e}")))?;
    Ok(if controls.stop_requested() {
        stop_signal.exit()
    } else {
        Exit::Done
    })
}

/// Returns an error if there is no terminal to draw on.
fn expect_terminal(global: &Global) -> Result<(), Failure> {
    let env = |name: &str| std::env::var(name).ok();
    let both = io::stdout().is_terminal() && io::stdin().is_terminal();
    if global.no_tui || output_mode(both, &env) != OutputMode::Dashboard {
        return Err(Failure::usage(
            "`lumbre explore` needs a terminal for input and output; without one, `lumbre render` \
             renders a picture with the same settings",
        ));
    }
    Ok(())
}

/// Returns the scene to show first, if one was named, and the scenes of the list.
fn choose(
    args: &ExploreArgs,
    built_in: Option<&BuiltIn>,
) -> Result<(Option<SceneFile>, SceneList), Failure> {
    let paths = built_in.map(BuiltIn::scenes).unwrap_or_default();
    let built_in: Vec<SceneFile> = paths.into_iter().map(built_in_scene).collect();
    let Some(given) = &args.scene else {
        return Ok((None, SceneList::new(built_in, ".".into())));
    };
    let path = &given.file;
    if path.is_dir() && !is_folder(path) {
        let mut scenes = SceneList::new(built_in, path.clone());
        if scenes.scenes().is_empty() {
            let text = format!("there are no scenes in {}", path.display());
            return Err(Failure::usage(text));
        }
        return Ok((None, scenes));
    }
    if !path.exists() {
        return Err(Failure::usage(format!(
            "there is no file {}",
            path.display()
        )));
    }
    let scene = SceneFile {
        name: given.text.clone(),
        path: path.clone(),
        options: given.settings.iter().cloned().collect(),
        built_in: false,
    };
    let folder = folder_of(path).to_owned();
    Ok((Some(scene), SceneList::new(built_in, folder)))
}

fn built_in_scene(path: std::path::PathBuf) -> SceneFile {
    SceneFile {
        name: scene_name(&path),
        path,
        options: BTreeMap::new(),
        built_in: true,
    }
}

/// Checks the settings of the command line before the terminal is used.
fn check_settings(
    args: &ExploreArgs,
    scene: Option<&SceneFile>,
    scenes: &mut SceneList,
) -> Result<(), Failure> {
    let first = match scene {
        Some(_) => None,
        None => scenes.scenes().into_iter().next(),
    };
    let Some(scene) = scene.or(first.as_ref()) else {
        return Ok(());
    };
    let settings = lumbre_tui::explore::settings::Settings::new(&args.settings());
    let table = settings.request_table(scene, [1, 1]);
    lumbre_lua::render_settings(&table, Path::new(".")).map_err(Failure::usage)?;
    Ok(())
}
