//! `lumbre view`: pictures, curves and animations from the time axis of a finished run.

use std::path::{Path, PathBuf};

use crate::cli::args::{Global, ViewArgs};
use crate::cli::exit::{Exit, Failure, print_result};
use crate::cli::format::display_path;
use crate::cli::scene::trace::check_pixel;
use crate::cli::selector;
use lumbre_light::film::time::CUBE_FILE;
use lumbre_night::store::FILMS;
use lumbre_night::store::schema::run::ConfigFile;
use lumbre_report::time::{self, Movie, TimeCurve, TimeFile};
use lumbre_report::{exr, png};

/// Runs `lumbre view`: writes the requested files to a folder and prints their paths.
pub fn main(args: &ViewArgs, global: &Global) -> Result<Exit, Failure> {
    let record = selector::run(&args.run, &global.out)?;
    if let Some(problem) = record.problems.first() {
        return Err(Failure::damaged(format!(
            "{}: {problem}",
            display_path(&record.folder)
        )));
    }
    let movie = read_movie(&record.folder, &record.config).map_err(Failure::usage)?;
    for pixel in args.pixel.iter().copied().chain(args.through) {
        check_pixel(pixel, [movie.width, movie.height])?;
    }
    let name = folder_name(&record.folder);
    let folder = args
        .to
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("view-{name:.8}")));
    std::fs::create_dir_all(&folder)
        .map_err(|e| Failure::internal(format!("{}: {e}", folder.display())))?;
    let mut output = OutputFolder {
        folder,
        metadata: vec![("run".to_owned(), name)],
        written: Vec::new(),
    };
    let through = args.through.unwrap_or([movie.width / 2, movie.height / 2]);
    for file in time::pictures(&movie, through, &output.metadata).map_err(Failure::internal)? {
        output.write(&file)?;
    }
    if !args.pixel.is_empty() || !args.region.is_empty() {
        write_curves(args, &movie, &mut output)?;
    }
    write_frames(args, &movie, &mut output)?;
    if args.layers {
        write_layers(&movie, &mut output)?;
    }
    let paths: String = output
        .written
        .iter()
        .map(|name| format!("{name}\n"))
        .collect();
    print_result(&paths)?;
    print_result(&format!(
        "ffmpeg -i {} -vf scale=trunc(iw/2)*2:trunc(ih/2)*2:flags=neighbor -pix_fmt yuv420p {}\n",
        display_path(&output.folder.join("time-animation.png")),
        display_path(&output.folder.join("time.mp4"))
    ))?;
    Ok(Exit::Done)
}

/// Folder to which the files are written.
struct OutputFolder {
    folder: PathBuf,
    /// Metadata of all pictures.
    metadata: Vec<(String, String)>,
    /// Paths of the written files, without duplicates.
    written: Vec<String>,
}

impl OutputFolder {
    fn write(&mut self, file: &TimeFile) -> Result<(), Failure> {
        let path = self.folder.join(&file.name);
        std::fs::write(&path, &file.bytes)
            .map_err(|e| Failure::internal(format!("{}: {e}", path.display())))?;
        let name = display_path(&path);
        if !self.written.contains(&name) {
            self.written.push(name);
        }
        Ok(())
    }
}

/// Writes the curves of the requested pixels and regions as CSV, SVG and PNG.
fn write_curves(args: &ViewArgs, movie: &Movie, output: &mut OutputFolder) -> Result<(), Failure> {
    let pixels = args
        .pixel
        .iter()
        .map(|[x, y]| ([*x, *y, x + 1, y + 1], format!("pixel {x}, {y}")));
    let regions = args.region.iter().map(|r| {
        let name = format!("region {}, {} to {}, {}", r[0], r[1], r[2], r[3]);
        (*r, name)
    });
    let curves: Vec<TimeCurve> = pixels
        .chain(regions)
        .map(|(r, name)| TimeCurve::region(movie, r, &name))
        .collect();
    let (svg, picture) = time::curves_figure(movie, &curves).map_err(Failure::internal)?;
    let files = [
        ("csv", time::curves_csv(movie, &curves).into_bytes()),
        ("svg", svg.into_bytes()),
        ("png", picture),
    ];
    for (extension, bytes) in files {
        output.write(&TimeFile {
            name: format!("time-curve.{extension}"),
            bytes,
        })?;
    }
    Ok(())
}

/// Writes one frame per optical length of `--at`; without it all frames if `--exr` was given.
fn write_frames(args: &ViewArgs, movie: &Movie, output: &mut OutputFolder) -> Result<(), Failure> {
    let groups = match &args.at[..] {
        [] if args.exr => movie.groups(time::MAX_FRAMES),
        lengths => {
            let bin = |length: &f64| {
                let (start, end) = (movie.axis.start, movie.axis.end());
                movie.bin(*length).map(|b| b..b + 1).ok_or_else(|| {
                    Failure::usage(format!(
                        "--at {length}: the time bins of this run cover {start} to {end}"
                    ))
                })
            };
            lengths.iter().map(bin).collect::<Result<_, _>>()?
        }
    };
    let display = movie.exposure(&groups);
    for (i, group) in groups.iter().enumerate() {
        let frame = movie.frame(group.clone());
        let name = format!("at-{:04}-{:.4}", i + 1, movie.middle(group));
        if args.exr {
            output.write(&TimeFile {
                name: format!("{name}.exr"),
                bytes: exr::encode(&frame, &output.metadata).map_err(Failure::internal)?,
            })?;
        }
        output.write(&TimeFile {
            name: format!("{name}.png"),
            bytes: png::encode(&frame, display, &output.metadata).map_err(Failure::internal)?,
        })?;
    }
    Ok(())
}

/// Writes one EXR file with a layer for every time bin.
fn write_layers(movie: &Movie, output: &mut OutputFolder) -> Result<(), Failure> {
    let bins = (0..movie.axis.bins)
        .map(|b| (format!("bin-{:04}", b + 1), movie.frame(b..b + 1)))
        .collect();
    output.write(&TimeFile {
        name: "time-bins.exr".into(),
        bytes: exr::encode_layers(bins).map_err(Failure::internal)?,
    })
}

/// Returns the last component of a path.
fn folder_name(folder: &Path) -> String {
    folder
        .file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// Reads the time bins of a finished run.
///
/// # Errors
/// Returns a message if the run has no time axis, or the file of its bins cannot be read or does
/// not match the configuration of the run.
fn read_movie(folder: &Path, config: &ConfigFile) -> Result<Movie, String> {
    let timing = config
        .settings()
        .and_then(|settings| settings.timing.as_ref());
    let timing = timing.ok_or_else(|| {
        format!(
            "{} has no time axis, which is what `view` draws: its picture is final.png there, and \
             `film = {{ time = .. }}` in the script gives runs a time axis",
            folder.display()
        )
    })?;
    let path = folder.join(FILMS).join(CUBE_FILE);
    let bytes = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    Movie::from_array(&bytes, timing).map_err(|e| format!("{}: {e}", path.display()))
}
