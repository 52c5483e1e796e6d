//! Options of the verbs that compare pictures and draw results: `metric`, `diff`, `report`,
//! `reproduce` and `view`.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;

use super::DEFAULT_OUT;

/// Options of `lumbre metric`.
#[derive(Args, Debug)]
pub struct MetricArgs {
    /// Picture to measure.
    pub image: PathBuf,
    /// Path of the reference picture.
    pub reference: PathBuf,
    /// Compute this metric (repeatable) [default: all metrics].
    ///
    /// Options follow after a colon: `ssim:window=gauss,on=srgb`
    #[arg(long, value_name = "NAME[:KEY=VALUE,..]")]
    pub metric: Vec<String>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Options of `lumbre diff`.
#[derive(Args, Debug)]
pub struct DiffArgs {
    /// Picture to compare.
    pub a: PathBuf,
    /// Picture to compare it with.
    pub b: PathBuf,
    /// Show the error of this metric, with options as for `lumbre metric`.
    #[arg(long, value_name = "NAME[:KEY=VALUE,..]", default_value = "flip")]
    pub metric: String,
    /// Write the error map to this file (.png for colours, .exr for values).
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Map this error to the upper end of the colour scale.
    ///
    /// Default: the largest value of the metric, or the 99th percentile of the error.
    #[arg(long, value_name = "ERROR", value_parser = positive::<f32>)]
    pub max: Option<f32>,
    /// End with exit code 5 if a metric is worse than a value, or if the pictures differ by more
    /// than their noise (repeatable).
    ///
    /// `relmse=0.01` limits a metric. `ztest=0.001` compares blocks of pixels with their noise at
    /// this false discovery rate, as the bias check of a reference does. `detects=0.01` fails where
    /// the noise may hide a bias of the total light of 1 %: use more samples.
    #[arg(long, value_name = "NAME=VALUE")]
    pub fail: Vec<String>,
    /// Read the standard error of every pixel from this picture, for `--fail ztest`; repeat it for
    /// the second picture.
    ///
    /// The standard error `noise.exr` beside a reference of Lumbre is found without this option. A
    /// picture without either counts as exact.
    #[arg(long, value_name = "FILE")]
    pub stderr: Vec<PathBuf>,
    /// Write the results of `--fail` to this file in the format of JUnit.
    #[arg(long, value_name = "FILE", requires = "fail")]
    pub junit: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

impl DiffArgs {
    /// Returns the file of the error map, or `None` if `--out` was not given. The global option
    /// `--out` passes its default on to this one; that default cannot be the name of a map.
    pub fn map_file(&self) -> Option<&Path> {
        self.out
            .as_deref()
            .filter(|out| *out != Path::new(DEFAULT_OUT))
    }
}

/// Options of `lumbre report`.
#[derive(Args, Debug)]
pub struct ReportArgs {
    /// Nights: folders, `latest`, or words of their names [default: the latest one].
    #[arg(value_name = "NIGHT")]
    pub nights: Vec<PathBuf>,
    /// Write the report to this folder [default: `report` in the folder of the first night].
    #[arg(short = 'o', long, value_name = "DIR")]
    pub to: Option<PathBuf>,
    /// Compare the values of these axes as curves and columns [default: the axis of the
    /// integrator].
    #[arg(long, value_name = "AXIS,..", value_delimiter = ',')]
    pub by: Vec<String>,
    /// Separate the values of these axes into panels and rows [default: all other axes that vary].
    #[arg(long, value_name = "AXIS,..", value_delimiter = ',')]
    pub facet: Option<Vec<String>>,
    /// Label a night with this name (repeat in the order of the folders).
    #[arg(long, value_name = "NAME")]
    pub name: Vec<String>,
    /// Show this crop: left, top, width and height in pixels (repeatable) [default: two automatic
    /// crops].
    #[arg(long, value_name = "X,Y,W,H", value_parser = window)]
    pub crop: Vec<[u32; 4]>,
    /// Add a table of the time until a metric reached a value for good, as in `rmse=0.01`
    /// (repeatable).
    #[arg(long, value_name = "COLUMN=VALUE", value_parser = threshold)]
    pub threshold: Vec<(String, f64)>,
    /// Compare at this render time in seconds [default: the longest time that all runs reached].
    #[arg(long, value_name = "SECONDS", value_parser = positive::<f64>)]
    pub at_time: Option<f64>,
    /// Draw heat maps over these two axes: horizontal, vertical.
    #[arg(long, value_name = "AXIS,AXIS", value_parser = two_axes)]
    pub heat: Option<[String; 2]>,
    /// Draw final errors, rates and acceleration structures over these axes.
    ///
    /// Default: all axes with at least three numeric values.
    #[arg(long, value_name = "AXIS,..", value_delimiter = ',')]
    pub sweep: Vec<String>,
    /// Print titles, captions and files of the report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Options of `lumbre reproduce`.
#[derive(Args, Debug)]
pub struct ReproduceArgs {
    /// Result files, or runs: their folders, first digits of their ids, `latest`, or words of their
    /// paths.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Write maps of differences to this folder [default: the current folder].
    #[arg(long, value_name = "DIR")]
    pub maps: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Parses `x,y,w,h` in pixels.
fn window(text: &str) -> Result<[u32; 4], String> {
    let numbers = numbers::<4>(text);
    let numbers = numbers.ok().filter(|[.., w, h]| *w > 0 && *h > 0);
    numbers.ok_or_else(|| {
        format!(
            "expected left, top, width and height in pixels, such as 20,40,64,48, found `{text}`"
        )
    })
}

/// Parses a value of the form `column=value`.
fn threshold(text: &str) -> Result<(String, f64), String> {
    let parts = text
        .split_once('=')
        .and_then(|(column, value)| Some((column.trim(), value.trim().parse().ok()?)));
    match parts {
        Some((column, value)) if !column.is_empty() && f64::is_finite(value) => {
            Ok((column.to_owned(), value))
        }
        _ => Err(format!(
            "expected COLUMN=VALUE such as rmse=0.01, found `{text}`"
        )),
    }
}

/// Parses a list of axes of the form `axis,axis`.
fn two_axes(text: &str) -> Result<[String; 2], String> {
    match text
        .split(',')
        .map(str::trim)
        .collect::<Vec<_>>()
        .as_slice()
    {
        [a, b] if !a.is_empty() && !b.is_empty() && a != b => {
            Ok([(*a).to_owned(), (*b).to_owned()])
        }
        _ => Err(format!(
            "expected two different axes such as depth,technique, found `{text}`"
        )),
    }
}

/// Parses a positive finite number of double precision.
fn positive<T: FromStr + Copy + Into<f64>>(text: &str) -> Result<T, String> {
    let is_positive = |x: f64| x.is_finite() && x > 0.0;
    let number = text.parse().ok().filter(|x: &T| is_positive((*x).into()));
    number.ok_or_else(|| format!("expected a number above 0, found `{text}`"))
}

/// Options of `lumbre view`.
#[derive(Args, Debug)]
pub struct ViewArgs {
    /// Run: its folder, first digits of its id, `latest`, or words of its path.
    pub run: String,
    /// Draw the time bins at these optical lengths, as in `4.6,6.4`.
    #[arg(
        long,
        value_name = "LENGTH,..",
        value_delimiter = ',',
        allow_negative_numbers = true
    )]
    pub at: Vec<f64>,
    /// Draw the curve of this pixel (repeatable).
    #[arg(long, value_name = "X,Y", value_parser = numbers::<2>)]
    pub pixel: Vec<[u32; 2]>,
    /// Draw the mean curve of a rectangle of pixels (repeatable).
    ///
    /// The first X,Y is its first pixel, the second X,Y is one past its last pixel.
    #[arg(long, value_name = "X,Y,X,Y", value_parser = numbers::<4>)]
    pub region: Vec<[u32; 4]>,
    /// Draw streak images through this column and row [default: the middle of the picture].
    #[arg(long, value_name = "X,Y", value_parser = numbers::<2>)]
    pub through: Option<[u32; 2]>,
    /// Also write frames as EXR. Without --at, write all frames.
    #[arg(long)]
    pub exr: bool,
    /// Write `time-bins.exr` with one layer per time bin, named `bin-0001` and so on.
    #[arg(long)]
    pub layers: bool,
    /// Write to this folder [default: view-ID, where ID is the id of the run].
    #[arg(short = 'o', long, value_name = "DIR")]
    pub to: Option<PathBuf>,
}

/// Parses `N` non-negative integers separated by commas.
fn numbers<const N: usize>(text: &str) -> Result<[u32; N], String> {
    let parts: Result<Vec<u32>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let error = || format!("expected {N} non-negative integers separated by commas");
    parts.map_err(|_| error())?.try_into().map_err(|_| error())
}
