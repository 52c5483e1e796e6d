//! A run of an external program: exports the scene, requests waves, and adds their pictures.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

use super::batch_film::BatchFilm;
use super::clock::{Clock, check_seconds};
use super::picture::{self, Pictures, add_layer, invalid_values, layer_channels};
use super::process::{Patience, Process, Talk};
use super::server::Server;
use super::technique::{SceneSource, Technique};
use super::{Access, failed, interrupted, with_output, words};
use crate::{Advance, Device, DeviceKind, Job, OpenStats, Peer, RenderError, Renderer, WaveStats};
use lumbre_light::film::Film;
use lumbre_light::film::layer::{LayerFilm, LayerLayout};
use lumbre_light::film::state::{StateReader, write_u64s};
use lumbre_light::math::rng::pcg4d;
use lumbre_light::scene::SceneDesc;
use lumbre_scene_io::export;

/// First word of the state of a checkpoint.
const STATE: u64 = u64::from_le_bytes(*b"external");

/// Way in which a run renders a wave.
enum Driver {
    /// Starts a process for each wave.
    OneShot,
    /// Sends a request to the process of the run.
    Server(Box<Server>),
}

/// Result of one wave.
struct Wave {
    pictures: Pictures,
    seconds: f64,
    samples: u64,
}

/// Run of an external program.
pub(super) struct ExternalRenderer {
    // Before `folder`, so that a server has exited when its files are removed.
    driver: Driver,
    technique: Technique,
    /// Values of the placeholders that are the same for all waves.
    values: BTreeMap<String, String>,
    /// Folder of the exported scene and of exchanged files; removed in the end.
    folder: tempfile::TempDir,
    seed: u64,
    /// Index of the first sample of the film.
    first_sample: u64,
    batches: BatchFilm,
    layout: LayerLayout,
    /// Sums of the layers, in the order of the layout.
    layers: Vec<Film>,
    /// Names of the EXR channels of the layers.
    channels: Vec<String>,
    /// Render time of all waves, in seconds.
    render_s: f64,
    open_stats: OpenStats,
}

impl ExternalRenderer {
    /// Starts a run. A server has loaded its scene when this returns.
    pub(super) fn start(
        technique: Technique,
        scene: &SceneDesc,
        job: &Job,
        access: &Access<'_>,
    ) -> Result<ExternalRenderer, RenderError> {
        let folder = tempfile::Builder::new()
            .prefix("lumbre-external-")
            .tempdir()
            .map_err(failed)?;
        let [width, height] = job.resolution;
        let scene_file = scene_file(&technique, scene, &folder)?;
        let threads = match job.threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            threads => threads,
        };
        let values = run_values(&technique, job, &scene_file, threads, &folder);
        let layout = LayerLayout::new(
            &job.settings.films,
            job.max_depth,
            u64::from(width) * u64::from(height),
        )
        .map_err(failed)?;
        let channels = layer_channels(&job.settings.films, &technique.layers).map_err(failed)?;
        let channels = channels.into_iter().map(str::to_owned).collect();
        let mut device = Device {
            peer: Some(Peer {
                program: program(&technique),
                wall_clock: !technique.serve && technique.clock == Clock::Wall,
            }),
            ..Device::processor(u32::try_from(threads).unwrap_or(u32::MAX))
        };
        let driver = if technique.serve {
            let words = words::fill(&technique.command, &values);
            let (server, line) = Server::start(&words, technique.timeout, access)?;
            if !line.is_empty() {
                device = stated_device(&super::printable(&line), &program(&technique));
            }
            Driver::Server(Box::new(server))
        } else {
            Driver::OneShot
        };
        device.features.lanes = technique.lanes;
        Ok(ExternalRenderer {
            driver,
            technique,
            values,
            folder,
            seed: job.seed,
            first_sample: job.first_sample,
            batches: BatchFilm::new(width, height),
            layers: layout
                .films()
                .iter()
                .map(|_| Film::new(width, height))
                .collect(),
            layout,
            channels,
            render_s: 0.0,
            open_stats: OpenStats {
                devices: vec![device],
                ..OpenStats::default()
            },
        })
    }

    /// Renders a wave.
    fn run(&mut self, samples: u64, cancelled: &dyn Fn() -> bool) -> Result<Wave, RenderError> {
        let file = self
            .folder
            .path()
            .join(format!("wave.{}", self.technique.picture.name()));
        let _ = fs::remove_file(&file);
        let seed = wave_seed(self.seed, self.first_sample + self.batches.film.samples);
        let timeout = self.technique.timeout;
        let (seconds, samples) = match &mut self.driver {
            Driver::Server(server) => (server.render(samples, seed, &file, cancelled)?, samples),
            Driver::OneShot => {
                let words = self.wave_words(samples, seed, &file);
                let mut process = Process::start(&words, Talk::None).map_err(failed)?;
                let patience = Patience {
                    until: Instant::now() + timeout,
                    cancelled,
                };
                let (status, wall_s) = match process.wait(&patience) {
                    Ok(ended) => ended,
                    Err(why) => return Err(interrupted(why, timeout, &process)),
                };
                let fail = |problem: String| failed(with_output(problem, &process));
                if !status.success() {
                    return Err(fail(format!("it failed ({status})")));
                }
                let report = self.technique.clock.read(&process.stdout()).map_err(fail)?;
                let seconds = report
                    .seconds
                    .map_or(Ok(wall_s), |s| check_seconds(s, wall_s));
                let seconds = seconds.map_err(fail)?;
                // Read here, so that an error has the output of the process.
                self.read_picture(&file).map_err(fail)?;
                (seconds, report.samples.unwrap_or(samples))
            }
        };
        let pictures = self.read_picture(&file).map_err(failed)?;
        Ok(Wave {
            pictures,
            seconds,
            samples,
        })
    }

    /// Returns the command of a wave.
    fn wave_words(&self, samples: u64, seed: u32, file: &std::path::Path) -> Vec<String> {
        let rendered = self.batches.film.samples;
        // One second for the first wave, whose samples may take any time.
        let seconds = if rendered == 0 || self.render_s == 0.0 {
            1.0
        } else {
            samples as f64 * self.render_s / rendered as f64
        };
        let of_wave = [
            ("spp", samples.to_string()),
            ("seed", seed.to_string()),
            ("seconds", format!("{seconds:.3}")),
            ("out", file.display().to_string()),
        ];
        let mut values = self.values.clone();
        values.extend(of_wave.map(|(name, value)| (name.to_owned(), value)));
        words::fill(&self.technique.command, &values)
    }

    /// Reads the picture of a wave and checks its values.
    fn read_picture(&self, file: &std::path::Path) -> Result<Pictures, String> {
        let film = &self.batches.film;
        let channels: Vec<&str> = self.channels.iter().map(String::as_str).collect();
        let size = [film.width, film.height];
        let pictures = picture::read(file, self.technique.picture, size, &channels)?;
        let invalid = invalid_values(&pictures.radiance);
        if invalid > 0 && !self.technique.non_finite_is_black {
            return Err(format!(
                "its picture has {invalid} values that are NaN or infinite; `non_finite = \
                 \"black\"` would count them as black"
            ));
        }
        Ok(pictures)
    }

    /// Reads the state that [`Renderer::save`] wrote.
    fn restore_state(
        &mut self,
        state: &[u8],
    ) -> Result<(), lumbre_light::film::state::CheckpointMismatch> {
        let mut from = StateReader::new(state);
        if from.read_u64()? != STATE {
            return Err(lumbre_light::film::state::CheckpointMismatch);
        }
        self.render_s = f64::from_bits(from.read_u64()?);
        self.batches.restore(&mut from)?;
        for layer in &mut self.layers {
            layer.restore(&mut from)?;
        }
        from.finish()
    }
}

impl Renderer for ExternalRenderer {
    fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError> {
        let samples = request.samples;
        if samples == 0 {
            return Ok(WaveStats::default());
        }
        let wave = self.run(samples, &|| request.until.is_now())?;
        let samples = wave.samples;
        let invalid = self.batches.add(&wave.pictures.radiance, samples);
        let films = self.layers.iter_mut().zip(self.layout.films());
        for ((sums, film), image) in films.zip(&wave.pictures.layers) {
            sums.samples += samples;
            add_layer(&mut sums.sum, film.layer, image, samples);
        }
        self.render_s += wave.seconds;
        Ok(WaveStats {
            samples,
            render_s: wave.seconds,
            paths: samples * wave.pictures.radiance.data.len() as u64,
            invalid,
            ..WaveStats::default()
        })
    }

    fn whole_waves(&self) -> bool {
        matches!(self.driver, Driver::OneShot)
    }

    fn film(&self) -> &Film {
        &self.batches.film
    }

    fn layers(&self) -> &[LayerFilm] {
        self.layout.films()
    }

    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        let film = self.layers.get(index).cloned();
        film.ok_or_else(|| failed(format!("layer film {index} does not exist")))
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
        write_u64s(to, [STATE, self.render_s.to_bits()])?;
        self.batches.save(to)?;
        for layer in &self.layers {
            layer.save(to)?;
        }
        Ok(true)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
        self.restore_state(state).map_err(failed)
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}

/// Parses what the first line of a server states after the version of the protocol: `cpu, 8 threads`
/// or another device, then name and version of the program, or nothing for `program`.
fn stated_device(stated: &str, program: &str) -> Device {
    let processor = stated.strip_prefix("cpu, ").and_then(|rest| {
        let (threads, rest) = rest.split_once(" threads")?;
        let program = match rest {
            "" => None,
            rest => Some(rest.strip_prefix(", ")?),
        };
        Some((Device::processor(threads.parse().ok()?), program))
    });
    let (device, stated_program) = processor.unwrap_or_else(|| {
        let (name, program) = match stated.rsplit_once(", ") {
            Some((name, program)) => (name, Some(program)),
            None => (stated, None),
        };
        let device = Device {
            name: name.to_owned(),
            kind: DeviceKind::External,
            ..Device::default()
        };
        (device, program)
    });
    Device {
        peer: Some(Peer {
            program: stated_program.unwrap_or(program).to_owned(),
            wall_clock: false,
        }),
        ..device
    }
}

/// Returns the name and version of a technique's program, without commas, which separate the parts of
/// a device line.
fn program(technique: &Technique) -> String {
    let (name, version) = (&technique.name, technique.found_version.replace(',', ";"));
    if version.is_empty() {
        name.clone()
    } else if version.to_lowercase().starts_with(&name.to_lowercase()) {
        version
    } else {
        format!("{name} {version}")
    }
}

/// Returns the scene file of a run, which is exported unless it is of the program's own format, and
/// writes the script of a bridge.
fn scene_file(
    technique: &Technique,
    scene: &SceneDesc,
    folder: &tempfile::TempDir,
) -> Result<PathBuf, RenderError> {
    if let Some((name, text)) = technique.bridge {
        fs::write(folder.path().join(name), text).map_err(failed)?;
    }
    match &technique.scene {
        SceneSource::Mitsuba => {
            let exported = export::mitsuba(scene, &folder.path().join("scene"));
            exported.map(|exported| exported.scene).map_err(failed)
        }
        // Absolute, so that it cannot begin with a dash.
        SceneSource::Raw(file) => std::path::absolute(file).map_err(failed),
    }
}

/// Returns the values of the placeholders that are the same for all waves of a run.
fn run_values(
    technique: &Technique,
    job: &Job,
    scene: &std::path::Path,
    threads: usize,
    folder: &tempfile::TempDir,
) -> BTreeMap<String, String> {
    let [width, height] = job.resolution;
    let filter = job.settings.filter.kind.name();
    let of_run = [
        ("scene", scene.display().to_string()),
        ("width", width.to_string()),
        ("height", height.to_string()),
        ("depth", job.max_depth.to_string()),
        ("threads", threads.to_string()),
        ("work", folder.path().display().to_string()),
        ("radius", job.settings.filter.radius.to_string()),
        (
            "filter",
            technique.filters.get(filter).cloned().unwrap_or_default(),
        ),
    ];
    let mut values = technique.values.clone();
    values.extend(of_run.map(|(name, value)| (name.to_owned(), value)));
    values
}

/// Returns the seed of a wave: 31 bits, which every program accepts.
fn wave_seed(seed: u64, samples: u64) -> u32 {
    let halves = |x: u64| [x as u32, (x >> 32) as u32];
    let ([a, b], [c, d]) = (halves(seed), halves(samples));
    pcg4d([a, b, c, d])[0] >> 1
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use lumbre_light::transport::integrator::external::DECLARED;
    use lumbre_light::value::Value;

    use super::*;
    use crate::external::technique::SCENE_FILE;

    #[test]
    fn every_wave_has_its_own_seed() {
        let seeds = BTreeSet::from(
            [(1, 0), (1, 1), (1, 2), (2, 0), (1 << 40, 0)].map(|(a, b)| wave_seed(a, b)),
        );
        assert_eq!(seeds.len(), 5);
        assert!(seeds.iter().all(|seed| i32::try_from(*seed).is_ok()));
    }

    #[test]
    fn a_servers_line_states_device_and_program() {
        let stated = |line| {
            let device = stated_device(line, "fake 1");
            let line = device.to_string();
            (
                device.name,
                device.threads,
                device.peer.unwrap().program,
                line,
            )
        };
        for (line, name, threads, program) in [
            ("cpu, 8 threads, Ray 2.1", "cpu", Some(8), "Ray 2.1"),
            ("NVIDIA H100, Ray 2.1", "NVIDIA H100", None, "Ray 2.1"),
            (
                "cpu, many threads, Ray 2.1",
                "cpu, many threads",
                None,
                "Ray 2.1",
            ),
        ] {
            let expected = (
                name.to_owned(),
                threads,
                program.to_owned(),
                line.to_owned(),
            );
            assert_eq!(stated(line), expected);
        }
        // Without a program, the technique's is known.
        for (line, name, threads) in [
            ("cpu, 8 threads", "cpu", Some(8)),
            ("some machine", "some machine", None),
        ] {
            let whole = format!("{line}, fake 1");
            let expected = (name.to_owned(), threads, "fake 1".to_owned(), whole);
            assert_eq!(stated(line), expected);
        }
    }
    /// Returns the seeds with which a program renders waves of these numbers of samples, for a part
    /// of a picture that begins with a sample.
    #[cfg(unix)]
    fn seeds(first_sample: u64, waves: &[u64]) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name).display().to_string();
        let (log, picture) = (file("log"), file("black.pfm"));
        fs::write(&picture, [b"PF\n1 1\n-1.0\n".as_slice(), &[0; 12]].concat()).unwrap();
        let script = format!("echo $1 >> '{log}'; cp '{picture}' \"$3\"");
        let words = ["sh", "-c", &script, "sh", "{seed}", "{spp}", "{out}"];
        let words = words.map(Value::from);
        let params = BTreeMap::from([
            ("command".to_owned(), Value::List(words.to_vec())),
            ("scene".to_owned(), "raw:none".into()),
            (SCENE_FILE.to_owned(), "none".into()),
            ("picture".to_owned(), "pfm".into()),
        ]);
        let technique = Technique::declared("external:toy", &params).unwrap();
        let desc = SceneDesc {
            resolution: [1, 1],
            max_depth: 1,
            ..SceneDesc::default()
        };
        let job = Job {
            first_sample,
            ..Job::plain(&DECLARED, [1, 1], 1, 7)
        };
        let access = Access {
            commands: true,
            cancelled: &|| false,
        };
        let mut run = ExternalRenderer::start(technique, &desc, &job, &access).unwrap();
        for samples in waves {
            run.advance(*samples).unwrap();
        }
        let log = fs::read_to_string(log).unwrap();
        log.lines().map(str::to_owned).collect()
    }

    #[test]
    #[cfg(unix)]
    fn waves_of_parts_have_the_seeds_of_the_whole_picture() {
        let whole = seeds(0, &[4, 4, 4]);
        assert_eq!(BTreeSet::from_iter(&whole).len(), 3);
        assert_eq!(seeds(4, &[4, 4]), whole[1..]);
        assert_eq!(seeds(8, &[4]), whole[2..]);
    }
}
