//! Options of the verbs that take a scene instead of a script: `render`, `new` and `compare`.

use std::path::PathBuf;

use clap::{ArgMatches, Args, Command, FromArgMatches};

use super::SceneArg;
use super::typed::{count, integrator_name, scene_arg, seconds, setting};
use lumbre_light::value::Value;

/// Picture of a scene.
#[derive(Args, Clone, Debug)]
pub struct PictureArgs {
    /// Scene file of any known format.
    ///
    /// Options of a Lua scene follow a question mark: `room.lua?light=lamps,size=3`.
    #[arg(value_name = "FILE", value_parser = scene_arg)]
    pub scene: SceneArg,
    /// Keys of a script's render table, and paths of values in the scene.
    ///
    /// Example: `sampler=sobol materials.egg.ior=1.3`. A key with a dot is a path in the scene.
    #[arg(value_name = "KEY=VALUE", value_parser = setting)]
    pub settings: Vec<(String, Value)>,
    /// Width and height in pixels [default: the scene's].
    #[arg(long, value_name = "WxH", value_parser = crate::cli::scene::trace::size)]
    pub size: Option<[u32; 2]>,
    /// Maximum number of path edges [default: the scene's].
    #[arg(long, value_name = "N", value_parser = count::<u32>, allow_hyphen_values = true)]
    pub depth: Option<u32>,
    /// View of the scene.
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    /// Light the scene by this HDRI, a map of all directions (.exr, .hdr), as
    /// `environment.map=FILE`.
    ///
    /// A model without lights stands in it alone, without the studio.
    #[arg(long, value_name = "FILE", alias = "hdri")]
    pub environment: Option<PathBuf>,
}

/// Options of `lumbre render`.
#[derive(Args, Debug)]
pub struct RenderArgs {
    /// Picture to render.
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Technique, as `integrator` in scripts: nee, bdpt, ... [default: nee].
    #[arg(short, long, value_name = "NAME")]
    pub integrator: Option<String>,
    /// Stop after this many samples per pixel [default: 64, without a limit of time].
    #[arg(long, value_name = "N", value_parser = count::<u64>, allow_hyphen_values = true)]
    pub spp: Option<u64>,
    /// Stop after this much render time: 30s, 5min.
    #[arg(long, value_name = "TIME", value_parser = seconds, allow_hyphen_values = true)]
    pub time: Option<f64>,
    /// Write the picture to this file: .exr, .hdr, .png or .bmp (repeatable) [default: NAME.exr, NAME.png].
    #[arg(short, long = "output", value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Send pictures to the image viewer tev, which listens at 127.0.0.1:14158 by default.
    #[arg(long, value_name = "HOST:PORT")]
    pub tev: Option<String>,
    /// Denoise the picture, which biases it: atrous, or oidn (Open Image Denoise) [default: none,
    /// and atrous if no name follows].
    #[arg(
        long,
        value_name = "NAME",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "atrous"
    )]
    pub denoise: Option<String>,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Print size, samples, times, noise and files as JSON.
    #[arg(long)]
    pub json: bool,
    /// Make the preview and PNG files this many stops brighter.
    #[arg(
        long,
        value_name = "STOPS",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub exposure: f32,
}

/// Options of `lumbre explore`.
#[derive(Args, Debug)]
pub struct ExploreArgs {
    /// Scene file, or a folder of scenes [default: the built-in scenes and the current folder].
    ///
    /// Options of a Lua scene follow a question mark: `room.lua?light=lamps,size=3`.
    #[arg(value_name = "FILE|DIR", value_parser = scene_arg)]
    pub scene: Option<SceneArg>,
    /// Keys of a script's render table, and paths of values in the scene.
    ///
    /// Example: `max_depth=5 materials.egg.ior=1.3`.
    #[arg(value_name = "KEY=VALUE", value_parser = setting)]
    settings: Vec<(String, Value)>,
    /// Technique to start with, as the key `integrator` [default: nee].
    #[arg(short, long, value_name = "NAME", value_parser = integrator_name)]
    integrator: Option<String>,
}

impl ExploreArgs {
    /// Returns the settings, with the technique that `--integrator` names.
    pub fn settings(&self) -> Vec<(String, Value)> {
        let technique = self.integrator.as_deref();
        let technique = technique.map(|name| ("integrator".to_owned(), Value::from(name)));
        self.settings.iter().cloned().chain(technique).collect()
    }
}

/// Comparison of techniques.
#[derive(Args, Clone, Debug)]
pub struct ComparisonArgs {
    /// Picture that every technique renders.
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Techniques to compare.
    #[arg(
        short, long = "technique", value_name = "NAME,NAME", value_delimiter = ',',
        default_value = "nee,bdpt", value_parser = integrator_name
    )]
    pub techniques: Vec<String>,
    /// Render time of each repeat of each technique.
    #[arg(
        long, value_name = "TIME", value_parser = seconds, default_value = "10s",
        allow_hyphen_values = true
    )]
    pub time: f64,
    /// Number of repeats, each with other random numbers.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(2..))]
    pub repeats: u32,
    /// Technique of the reference [default: the last unbiased one].
    #[arg(long, value_name = "NAME", value_parser = integrator_name)]
    pub reference: Option<String>,
}

/// Options of `lumbre compare`.
#[derive(Args, Debug)]
pub struct CompareArgs {
    /// Techniques and picture.
    #[command(flatten)]
    pub comparison: ComparisonArgs,
    /// Print the verdict as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Options of `lumbre new`: those of a script, or of a project with a technique.
#[derive(Debug)]
pub enum NewArgs {
    /// A script for a scene.
    Experiment(Box<NewExperimentArgs>),
    /// A project, by the subcommand `technique`.
    Technique(NewTechniqueArgs),
}

/// Name of the subcommand of `lumbre new`.
const TECHNIQUE: &str = "technique";

impl FromArgMatches for NewArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<NewArgs, clap::Error> {
        Ok(match matches.subcommand() {
            Some((TECHNIQUE, inner)) => {
                NewArgs::Technique(NewTechniqueArgs::from_arg_matches(inner)?)
            }
            _ => NewArgs::Experiment(Box::new(NewExperimentArgs::from_arg_matches(matches)?)),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = NewArgs::from_arg_matches(matches)?;
        Ok(())
    }
}

// Written by hand, since the derived subcommands would make the arguments of a script optional.
impl Args for NewArgs {
    fn augment_args(command: Command) -> Command {
        let technique = NewTechniqueArgs::augment_args(Command::new(TECHNIQUE))
            .about("Write a project with a technique of your own, and tests of it.")
            .long_about(
                "Write a project with a technique of your own, and tests of it.\n\n\
                 The project is a folder NAME: a program that does all that this one does, and \
                 knows the technique. It is built by cargo from the sources of Lumbre.",
            );
        NewExperimentArgs::augment_args(command)
            .args_conflicts_with_subcommands(true)
            .subcommand_negates_reqs(true)
            .subcommand(technique)
    }

    fn augment_args_for_update(command: Command) -> Command {
        NewArgs::augment_args(command)
    }
}

/// Options of `lumbre new technique`.
#[derive(Args, Debug)]
pub struct NewTechniqueArgs {
    /// Name of the technique and of the folder: lower-case letters, digits and `_`.
    #[arg(value_name = "NAME")]
    pub name: String,
    /// Folder with the sources of Lumbre, such as a clone [default: the one that this program was
    /// built from].
    ///
    /// A program that was built elsewhere, such as a downloaded one, needs this option.
    #[arg(long, value_name = "CLONE")]
    pub lumbre: Option<PathBuf>,
}

/// Options of `lumbre new` for a script.
#[derive(Args, Debug)]
pub struct NewExperimentArgs {
    /// Techniques and picture.
    #[command(flatten)]
    pub comparison: ComparisonArgs,
    /// Write the script to this file [default: NAME.lua, named after the scene].
    #[arg(short, long = "output", value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Take the defaults without asking.
    #[arg(short, long)]
    pub yes: bool,
}
