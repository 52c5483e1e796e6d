//! What can be typed of pictures, reports and their reproduction.

use std::path::{Path, PathBuf};

use clap::Args;

use super::DEFAULT_OUT;

/// `lumbre metric`.
#[derive(Args, Debug)]
pub struct MetricArgs {
    /// The picture
    pub image: PathBuf,
    /// What it is measured against
    pub reference: PathBuf,
    /// A metric, with options after a colon: `ssim:window=gauss,on=srgb`; give it again for more. All of them without it
    #[arg(long, value_name = "NAME[:KEY=VALUE,..]")]
    pub metric: Vec<String>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `lumbre diff`.
#[derive(Args, Debug)]
pub struct DiffArgs {
    /// The picture
    pub a: PathBuf,
    /// What it is compared with
    pub b: PathBuf,
    /// The metric whose error is shown, with options as for `lumbre metric`
    #[arg(long, value_name = "NAME[:KEY=VALUE,..]", default_value = "flip")]
    pub metric: String,
    /// Write the map: .png in colours, .exr as values
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The error at the upper end of the colours, instead of the metric's largest or the 99th percentile
    #[arg(long, value_name = "ERROR", value_parser = positive)]
    pub max: Option<f32>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

impl DiffArgs {
    /// The file of the map, if one is wanted. The global option of the same name hands its default down, which is no
    /// name that a map could have.
    pub fn map_file(&self) -> Option<&Path> {
        self.out.as_deref().filter(|out| *out != Path::new(DEFAULT_OUT))
    }
}

/// `lumbre report`.
#[derive(Args, Debug)]
pub struct ReportArgs {
    /// Folders of nights, such as out/latest
    #[arg(required = true, value_name = "DIR")]
    pub nights: Vec<PathBuf>,
    /// Where the report goes [default: `report` in the night's folder; of several nights, `report` in the first]
    #[arg(long, value_name = "DIR")]
    pub to: Option<PathBuf>,
    /// Axes whose values are compared: curves and columns [default: the one that chooses the integrator]
    #[arg(long, value_name = "AXIS,..", value_delimiter = ',')]
    pub by: Vec<String>,
    /// Axes whose values stand apart: panels and rows [default: all others that vary]
    #[arg(long, value_name = "AXIS,..", value_delimiter = ',')]
    pub facet: Option<Vec<String>>,
    /// Name of a night, in the order of the folders; give it again for the next
    #[arg(long, value_name = "NAME")]
    pub name: Vec<String>,
    /// A window of the crops: left, top, width, height in pixels; give it again for more [default: two are chosen]
    #[arg(long, value_name = "X,Y,W,H", value_parser = window)]
    pub crop: Vec<[u32; 4]>,
    /// A table of the time until a metric first reached a value: `rmse=0.01`; give it again for more
    #[arg(long, value_name = "COLUMN=VALUE", value_parser = threshold)]
    pub threshold: Vec<(String, f64)>,
    /// The render time in seconds of equal-time comparisons [default: the longest that all runs reached]
    #[arg(long, value_name = "SECONDS", value_parser = positive_f64)]
    pub at_time: Option<f64>,
    /// The two axes of heat maps: across and down
    #[arg(long, value_name = "AXIS,AXIS", value_parser = two_axes)]
    pub heat: Option<[String; 2]>,
    /// Axes over whose values final errors, rates and hierarchies are drawn [default: all of three or more numbers]
    #[arg(long, value_name = "AXIS,..", value_delimiter = ',')]
    pub sweep: Vec<String>,
}

/// `lumbre trace`.
#[derive(Args, Debug)]
pub struct TraceArgs {
    /// The scene, or a run's folder
    pub file: PathBuf,
    /// Column and row, from the top left
    #[arg(long, value_name = "X,Y", value_parser = crate::cli::trace::pixel)]
    pub pixel: [u32; 2],
    /// Index of the sample, from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub sample: u64,
    /// The technique, for a scene
    #[arg(long, value_name = "NAME", default_value = "nee")]
    pub integrator: String,
    /// The sampler, for a scene
    #[arg(long, value_name = "NAME", default_value = "independent")]
    pub sampler: String,
    /// The seed, for a scene
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Greatest number of path edges, for a scene [default: the scene's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub depth: Option<u32>,
    /// Width and height, for a scene [default: the scene's]
    #[arg(long, value_name = "WxH", value_parser = crate::cli::trace::size)]
    pub size: Option<[u32; 2]>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `lumbre reproduce`.
#[derive(Args, Debug)]
pub struct ReproduceArgs {
    /// The file, or a run's folder
    pub file: PathBuf,
    /// Where maps of differences go [default: the current folder]
    #[arg(long, value_name = "DIR")]
    pub maps: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Reads `x,y,w,h`.
fn window(text: &str) -> Result<[u32; 4], String> {
    let numbers: Vec<u32> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    match numbers.as_slice() {
        &[x, y, w, h] if w > 0 && h > 0 && text.split(',').count() == 4 => Ok([x, y, w, h]),
        _ => Err(format!("expected left, top, width and height in pixels, such as 20,40,64,48, found `{text}`")),
    }
}

/// Reads `column=value`.
fn threshold(text: &str) -> Result<(String, f64), String> {
    let parts = text.split_once('=').and_then(|(column, value)| Some((column.trim(), value.trim().parse().ok()?)));
    match parts {
        Some((column, value)) if !column.is_empty() && f64::is_finite(value) => Ok((column.to_owned(), value)),
        _ => Err(format!("expected COLUMN=VALUE such as rmse=0.01, found `{text}`")),
    }
}

/// Reads `axis,axis`.
fn two_axes(text: &str) -> Result<[String; 2], String> {
    match text.split(',').map(str::trim).collect::<Vec<_>>().as_slice() {
        [a, b] if !a.is_empty() && !b.is_empty() && a != b => Ok([(*a).to_owned(), (*b).to_owned()]),
        _ => Err(format!("expected two different axes such as depth,technique, found `{text}`")),
    }
}

/// Reads a positive number of double precision.
fn positive_f64(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|x: &f64| x.is_finite() && *x > 0.0);
    number.ok_or_else(|| format!("expected a number above 0, found `{text}`"))
}

/// Reads a positive number.
fn positive(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|x: &f32| x.is_finite() && *x > 0.0);
    number.ok_or_else(|| format!("expected a number above 0, found `{text}`"))
}

/// `lumbre view`.
#[derive(Args, Debug)]
pub struct ViewArgs {
    /// The run: its folder, or the first digits of its id
    pub run: String,
    /// Show the bins that hold these optical lengths: `4.6,6.4`
    #[arg(long, value_name = "LENGTH,..", value_delimiter = ',', allow_negative_numbers = true)]
    pub at: Vec<f64>,
    /// Draw the curve of this pixel; give it again for more
    #[arg(long, value_name = "X,Y", value_parser = numbers::<2>)]
    pub pixel: Vec<[u32; 2]>,
    /// Draw the curve of the pixels from X,Y up to before X,Y; give it again for more
    #[arg(long, value_name = "X,Y,X,Y", value_parser = numbers::<4>)]
    pub region: Vec<[u32; 4]>,
    /// Draw the streaks through this column and row instead of those in the middle
    #[arg(long, value_name = "X,Y", value_parser = numbers::<2>)]
    pub through: Option<[u32; 2]>,
    /// Write frames as EXR too, and without --at all of them
    #[arg(long)]
    pub exr: bool,
    /// Write one EXR with a layer for every bin, named `bin-0001` and so on: `time-bins.exr`
    #[arg(long)]
    pub layers: bool,
    /// Where the files go; `view-` and the run's id without it
    #[arg(long, value_name = "DIR")]
    pub to: Option<PathBuf>,
}

/// So many whole numbers with commas between them.
fn numbers<const N: usize>(text: &str) -> Result<[u32; N], String> {
    let parts: Result<Vec<u32>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let wrong = || format!("expected {N} whole numbers with commas between them");
    parts.map_err(|_| wrong())?.try_into().map_err(|_| wrong())
}
