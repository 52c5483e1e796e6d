//! Options of the verbs about scenes: `check`, `export`, `trace` and `bsdf`.

use std::path::PathBuf;

use clap::Args;

use super::typed::{SceneArg, count, scene_arg, setting};
use lumbre_light::value::Value;

/// Options of `lumbre check`.
#[derive(Args, Debug)]
pub struct CheckArgs {
    /// Scripts (.lua) and scene files.
    ///
    /// Options of a scene follow a question mark: `room.lua?light=lamps,size=3`.
    #[arg(required = true, value_name = "FILE", value_parser = scene_arg)]
    pub files: Vec<SceneArg>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Options of `lumbre export`.
#[derive(Args, Debug)]
#[command(group(clap::ArgGroup::new("format").required(true)))]
pub struct ExportArgs {
    /// Scene file of any known format, or a Lua file that returns a scene; or the folder of a night.
    pub file: PathBuf,
    /// Write an XML scene for Mitsuba 3.
    #[arg(long, group = "format")]
    pub mitsuba: bool,
    /// Write a scene for pbrt-v4.
    #[arg(long, group = "format")]
    pub pbrt: bool,
    /// Write the pictures of a night for the viewer JERI.
    #[arg(long, group = "format")]
    pub jeri: bool,
    /// Write the pictures and errors of a night, and a script that draws them with figuregen.
    #[arg(long, group = "format")]
    pub figuregen: bool,
    /// Write the runs and measurements of a night as CSV files.
    #[arg(long, group = "format")]
    pub csv: bool,
    /// Write to this folder [default: NAME-FORMAT].
    ///
    /// For a scene, the folder must be new, empty, or contain an earlier export.
    #[arg(short = 'o', long = "folder", value_name = "DIR")]
    pub folder: Option<PathBuf>,
    /// Set an option of a Lua scene (repeatable).
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting)]
    pub option: Vec<(String, Value)>,
    /// Change a value in the scene (repeatable): `materials.egg.ior=1.3`, `camera=table`.
    #[arg(long, value_name = "PATH=VALUE", value_parser = setting)]
    pub set: Vec<(String, Value)>,
}

/// Options of `lumbre trace`.
#[derive(Args, Debug)]
pub struct TraceArgs {
    /// Scene file, or a run: its folder, first digits of its id, `latest`, or words of its path.
    ///
    /// Options of a Lua scene follow a question mark: `room.lua?light=lamps,size=3`.
    #[arg(value_name = "FILE", value_parser = scene_arg)]
    pub file: SceneArg,
    /// Parameters of the technique, if FILE is a scene.
    #[arg(value_name = "KEY=VALUE", value_parser = setting)]
    pub params: Vec<(String, Value)>,
    /// Column and row of the pixel, from the top left.
    #[arg(long, value_name = "X,Y", value_parser = crate::cli::scene::trace::pixel)]
    pub pixel: [u32; 2],
    /// Index of the sample, from 0.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub sample: u64,
    /// Technique, if FILE is a scene.
    #[arg(short, long, value_name = "NAME", default_value = "nee")]
    pub integrator: String,
    /// Sampler, if FILE is a scene.
    #[arg(long, value_name = "NAME", default_value = "independent")]
    pub sampler: String,
    /// Seed of the sampler, if FILE is a scene.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Maximum number of path edges, if FILE is a scene [default: the scene's].
    #[arg(long, value_name = "N", value_parser = count::<u32>, allow_hyphen_values = true)]
    pub depth: Option<u32>,
    /// Width and height in pixels, if FILE is a scene [default: the scene's].
    #[arg(long, value_name = "WxH", value_parser = crate::cli::scene::trace::size)]
    pub size: Option<[u32; 2]>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Options of `lumbre bsdf`.
#[derive(Args, Debug)]
pub struct BsdfArgs {
    /// Scene file of any known format, or a Lua file that returns a scene.
    ///
    /// Options of a Lua scene follow a question mark: `room.lua?light=lamps,size=3`.
    #[arg(value_name = "FILE", value_parser = scene_arg)]
    pub file: SceneArg,
    /// Name of the material.
    pub material: String,
    /// Direction to the viewer: angle from the normal and azimuth, in degrees.
    ///
    /// Angles above 90 are inside of the surface. The azimuth is counted from the direction of
    /// increasing u.
    #[arg(
        long,
        value_name = "ANGLE[,AZIMUTH]",
        default_value = "45",
        value_parser = crate::cli::scene::bsdf::direction
    )]
    pub at: [f32; 2],
    /// Texture coordinates at which textures are looked up.
    #[arg(
        long,
        value_name = "U,V",
        default_value = "0.5,0.5",
        value_parser = crate::cli::scene::bsdf::texture_coordinates
    )]
    pub uv: [f32; 2],
    /// Write TO.svg and TO.png [default: bsdf-MATERIAL].
    #[arg(short = 'o', long = "to", value_name = "TO")]
    pub to: Option<PathBuf>,
    /// Set an option of a Lua scene (repeatable).
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting)]
    pub option: Vec<(String, Value)>,
    /// Change a value in the scene (repeatable): `materials.egg.ior=1.3`.
    #[arg(long, value_name = "PATH=VALUE", value_parser = setting)]
    pub set: Vec<(String, Value)>,
    /// Print as JSON, with all densities.
    #[arg(long)]
    pub json: bool,
}
