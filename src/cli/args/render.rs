//! Options of `lumbre render`.

use std::path::PathBuf;

use clap::Args;

use super::SceneArg;
use super::typed::{scene_arg, seconds, setting};
use lumbre_light::value::Value;

/// Options of `lumbre render`.
#[derive(Args, Debug)]
pub struct RenderArgs {
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
    /// Technique: bpt, nee, bdpt.
    #[arg(short, long, value_name = "NAME", default_value = "nee")]
    pub integrator: String,
    /// Stop after this many samples per pixel [default: 64, without a limit of time].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub spp: Option<u64>,
    /// Stop after this much render time: 30s, 5min.
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    pub time: Option<f64>,
    /// Write the picture to this file: .exr, .hdr or .png (repeatable) [default: NAME.exr, NAME.png].
    #[arg(short, long = "output", value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Width and height in pixels [default: the scene's].
    #[arg(long, value_name = "WxH", value_parser = crate::cli::scene::trace::size)]
    pub size: Option<[u32; 2]>,
    /// Maximum number of path edges [default: the scene's].
    #[arg(long, value_name = "N")]
    pub depth: Option<u32>,
    /// Render this view of the scene.
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Make the preview and PNG files this many stops brighter.
    #[arg(
        long,
        value_name = "STOPS",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub exposure: f32,
}
