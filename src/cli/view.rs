//! `lumbre view`: the time axis of a finished run.

use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::args::{Global, ViewArgs};
use super::exit::{Exit, Failure, data};
use super::load::shown;
use crate::film::time::CUBE_FILE;
use crate::output::time::{self, Curve, Movie, TimeFile};
use crate::output::{exr, png};
use crate::store::{FILMS, read_run};
use crate::transport::flight::Timing;
use crate::value::Value;

/// Draws what is asked for into a folder.
pub fn main(args: &ViewArgs, global: &Global) -> Result<Exit, Failure> {
    let record = read_run(&global.out, &args.run).map_err(|e| Failure::usage(e.to_string()))?;
    let movie = movie(&record.folder, &record.config).map_err(Failure::usage)?;
    let inside = |[x, y]: [u32; 2]| x < movie.width && y < movie.height;
    if let Some([x, y]) = args.pixel.iter().copied().chain(args.through).find(|p| !inside(*p)) {
        let (width, height) = (movie.width, movie.height);
        return Err(Failure::usage(format!("the picture has {width} x {height} pixels and no pixel {x},{y}")));
    }
    let folder = args.to.clone().unwrap_or_else(|| PathBuf::from(format!("view-{:.8}", args_name(&record.folder))));
    std::fs::create_dir_all(&folder).map_err(|e| Failure::internal(format!("{}: {e}", folder.display())))?;
    let mut written = Vec::new();
    let mut write = |file: TimeFile| {
        let path = folder.join(&file.name);
        std::fs::write(&path, &file.bytes).map_err(|e| Failure::internal(format!("{}: {e}", path.display())))?;
        let name = shown(&path);
        if !written.contains(&name) {
            written.push(name);
        }
        Ok::<_, Failure>(())
    };
    let encoded = |e: crate::output::OutputError| Failure::internal(e.to_string());
    let meta = vec![("run".to_owned(), args_name(&record.folder))];
    let through = args.through.unwrap_or([movie.width / 2, movie.height / 2]);
    for file in time::pictures(&movie, through, &meta).map_err(encoded)? {
        write(file)?;
    }
    if !args.pixel.is_empty() || !args.region.is_empty() {
        let pixels = args.pixel.iter().map(|[x, y]| ([*x, *y, x + 1, y + 1], format!("pixel {x}, {y}")));
        let regions = args.region.iter().map(|r| (*r, format!("region {}, {} to {}, {}", r[0], r[1], r[2], r[3])));
        let curves: Vec<Curve> = pixels.chain(regions).map(|(r, name)| Curve::region(&movie, r, &name)).collect();
        let (svg, picture) = time::figure(&movie, &curves).map_err(encoded)?;
        write(TimeFile { name: "time-curve.csv".into(), bytes: time::csv(&movie, &curves).into_bytes() })?;
        write(TimeFile { name: "time-curve.svg".into(), bytes: svg.into_bytes() })?;
        write(TimeFile { name: "time-curve.png".into(), bytes: picture })?;
    }
    let groups = match &args.at[..] {
        [] if args.exr => movie.groups(time::MAX_FRAMES),
        lengths => {
            let bin = |length: &f64| {
                let (start, end) = (movie.axis.start, movie.axis.end());
                movie.bin(*length).map(|b| b..b + 1).ok_or_else(|| {
                    Failure::usage(format!("the bins of this run reach from {start} to {end}, and none holds {length}"))
                })
            };
            lengths.iter().map(bin).collect::<Result<_, _>>()?
        }
    };
    let display = movie.exposure(&groups);
    for (i, group) in groups.iter().enumerate() {
        let (frame, name) = (movie.frame(group.clone()), format!("at-{:04}-{:.4}", i + 1, movie.middle(group)));
        if args.exr {
            write(TimeFile { name: format!("{name}.exr"), bytes: exr::encode(&frame, &meta).map_err(encoded)? })?;
        }
        write(TimeFile { name: format!("{name}.png"), bytes: png::encode(&frame, display, &meta).map_err(encoded)? })?;
    }
    if args.layers {
        let bins = (0..movie.axis.bins).map(|b| (format!("bin-{:04}", b + 1), movie.frame(b..b + 1))).collect();
        write(TimeFile { name: "time-bins.exr".into(), bytes: exr::encode_layers(bins).map_err(encoded)? })?;
    }
    data(&written.iter().map(|name| format!("{name}\n")).collect::<String>())?;
    let film = folder.join("time-animation.png");
    let video = folder.join("time.mp4");
    data(&format!(
        "ffmpeg -i {} -vf scale=trunc(iw/2)*2:trunc(ih/2)*2:flags=neighbor -pix_fmt yuv420p {}\n",
        shown(&film),
        shown(&video)
    ))?;
    Ok(Exit::Done)
}

fn args_name(folder: &Path) -> String {
    folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The bins that a run has left.
fn movie(folder: &Path, config: &Json) -> Result<Movie, String> {
    let film = Value::from_json(&config["render"]["film"]);
    let timing = film.as_map().map_or(Ok(None), |film| Timing::from_film(film, "film")).map_err(|e| e.to_string())?;
    let timing = timing.ok_or_else(|| format!("{} has no time axis: `film = {{ time = .. }}`", folder.display()))?;
    let path = folder.join(FILMS).join(CUBE_FILE);
    let bytes = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let (shape, numbers) = time::read_array(&bytes).map_err(|e| format!("{}: {e}", path.display()))?;
    let [height, width, bins, 3] = shape[..] else { return Err(format!("{}: it has another shape", path.display())) };
    if bins != timing.axis.bins as usize || width == 0 || height == 0 {
        return Err(format!("{}: it has {bins} bins, and its run {}", path.display(), timing.axis.bins));
    }
    let (mean, _) = numbers.as_chunks::<3>();
    let (width, height) = (width as u32, height as u32);
    Ok(Movie { width, height, axis: timing.axis, seconds: timing.seconds(), mean: mean.to_vec() })
}
