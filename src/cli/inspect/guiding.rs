//! `lumbre show --tree`: the tree that guides the paths of a run.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::args::{Global, ShowArgs};
use crate::cli::exit::{Failure, print_result};
use crate::cli::format::{counted, display_path, rounded};
use crate::cli::reproduce::stored_run;
use crate::cli::scene::trace::check_pixel;
use crate::cli::{figure_files, json};
use lumbre_night::store::RunRecord;
use lumbre_render::cpu::guiding_tree::{COLUMNS, GuidingTree, ROWS};
use lumbre_report::guiding::{TreeFigure, draw};

/// Trains the tree of a run, and draws it where the camera sees `pixel`.
pub fn show(
    args: &ShowArgs,
    global: &Global,
    run: &RunRecord,
    pixel: [u32; 2],
) -> Result<(), Failure> {
    let (scene, job, _) = stored_run::load_job(&run.folder, global).map_err(Failure::usage)?;
    check_pixel(pixel, job.resolution)?;
    let [x, y] = pixel;
    let tree = GuidingTree::train(&scene, &job).map_err(Failure::usage)?;
    let tree = tree.ok_or_else(|| {
        Failure::usage(format!(
            "a run of `{}` has no tree of directions; `--tree` is for runs of `guided`",
            job.integrator.name
        ))
    })?;
    let region = tree.region_at(pixel);
    let density = region.and_then(|region| tree.density(region));
    let id = &run.config.run;
    let stem = args.to.clone();
    let stem = stem.unwrap_or_else(|| PathBuf::from(format!("tree-{id:.8}")));
    let svg = draw(&TreeFigure {
        heading: &format!("Guiding tree of {id:.8}, pixel {x}, {y}"),
        description: &format!(
            "{}\nrun {id}\npixel {x}, {y}",
            lumbre_night::text::program()
        ),
        tree: &tree,
        pixel,
        density: density.as_deref(),
    })
    .map_err(Failure::internal)?;
    let files = figure_files::write(&stem, &svg)?;
    let size = tree.size();
    if args.json {
        json::print(json!({
            "run": id, "pixel": pixel, "rays": tree.rays,
            "regions": size.regions, "guiding_regions": size.guiding, "squares": size.squares,
            "region": region, "files": files,
            "density": density.map(|values| json!({
                "rows": ROWS, "columns": COLUMNS, "per_steradian": values,
            })),
        }))?;
    } else {
        print_result(&page(
            &display_path(&run.folder),
            &tree,
            (pixel, density.as_deref()),
        ))?;
    }
    if !global.quiet {
        figure_files::print(&files);
    }
    Ok(())
}

/// Formats a tree for people.
fn page(run: &str, tree: &GuidingTree, ([x, y], density): ([u32; 2], Option<&[f64]>)) -> String {
    let size = tree.size();
    let of_pixel = match density {
        Some(density) => {
            let most = density.iter().copied().fold(0.0, f64::max);
            format!("directions have densities of up to {} /sr", rounded(most))
        }
        None if tree.region_at([x, y]).is_none() => "there is no surface".to_owned(),
        None => "paths are not guided".to_owned(),
    };
    format!(
        "{run}\n{} of space, {} of them guiding; {} of directions; trained by {} rays\n\
         pixel {x}, {y}: {of_pixel}\n",
        counted(size.regions, "region"),
        size.guiding,
        counted(size.squares, "square"),
        tree.rays,
    )
}
