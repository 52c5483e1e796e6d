//! Denoising of pictures while they are rendered, as a technique that is compared with others.
//!
//! [`open`] wraps the renderer of any backend in [`Denoised`], which renders the films that guide the
//! filter and denoises a picture whenever it is measured. The film keeps its samples. A denoised
//! picture is biased: part of its error does not vanish with more samples.

pub mod atrous;
pub mod oidn;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;
use std::time::Instant;

use self::atrous::{AtrousSettings, Guided};
use self::oidn::OidnFilter;
use super::{Advance, Job, OpenStats, Picture, RenderError, Renderer, WaveStats};
use lumbre_light::film::layer::{Layer, LayerFilm};
use lumbre_light::film::state::{CheckpointMismatch, write_u64s};
use lumbre_light::film::time::TimeCube;
use lumbre_light::film::{Film, SharedImage};
use lumbre_light::value::Value;

/// Names of the denoisers in scripts; the first is none.
pub const NAMES: [&str; 3] = ["none", "atrous", "oidn"];

/// Layers that guide the denoisers.
pub const GUIDES: [Layer; 2] = [Layer::Albedo, Layer::Normal];

/// Explanation of the bias, as a sentence of captions.
pub const BIAS: &str = "Denoised pictures are biased: part of their error does not vanish with more \
                        samples.";

/// A denoiser and its settings.
#[derive(Clone, Debug, PartialEq)]
pub enum Denoise {
    /// The built-in wavelet filter.
    Atrous(AtrousSettings),
    /// Open Image Denoise.
    Oidn {
        /// Version of the library that denoises; empty if it is not known yet.
        version: String,
    },
}

impl Denoise {
    /// Returns the denoiser of this name, with the parameters of the built-in one that its table in
    /// scripts has. `None` for `none` and names that are not in [`NAMES`].
    pub fn from_name(name: &str, atrous: &BTreeMap<String, Value>) -> Option<Denoise> {
        match name {
            "atrous" => Some(Denoise::Atrous(AtrousSettings::from_map(atrous))),
            "oidn" => Some(Denoise::Oidn {
                version: String::new(),
            }),
            _ => None,
        }
    }

    /// Returns the name in scripts.
    pub fn name(&self) -> &'static str {
        match self {
            Denoise::Atrous(_) => NAMES[1],
            Denoise::Oidn { .. } => NAMES[2],
        }
    }

    /// Returns the description for people, with the version of a library.
    pub fn describe(&self) -> String {
        match self {
            Denoise::Atrous(_) => "à-trous wavelet filter".to_owned(),
            Denoise::Oidn { version } => format!("Open Image Denoise {version}"),
        }
    }

    /// Returns the bytes per pixel that it takes besides the film and the guides, at most. Measured
    /// at 1920 x 1080: 96 for the built-in filter, 656 for Open Image Denoise 2.5.1 on the processor.
    pub fn bytes_per_pixel(&self) -> u64 {
        match self {
            Denoise::Atrous(_) => 160,
            Denoise::Oidn { .. } => 1024,
        }
    }

    /// Returns everything that decides the result, as it is stored and identifies a run.
    pub fn to_value(&self) -> Value {
        let mut fields: BTreeMap<String, Value> = match self {
            Denoise::Atrous(settings) => settings.to_map(),
            Denoise::Oidn { version } => {
                BTreeMap::from([("version".to_owned(), version.as_str().into())])
            }
        };
        if let Denoise::Atrous(_) = self {
            fields.insert("revision".to_owned(), Value::Int(atrous::REVISION));
        }
        fields.insert("filter".to_owned(), self.name().into());
        Value::Map(fields)
    }

    /// Returns the denoiser that [`Denoise::to_value`] described.
    pub fn from_value(value: &Value) -> Option<Denoise> {
        let map = value.as_map()?;
        let mut denoise = Denoise::from_name(map.get("filter")?.as_str()?, map)?;
        if let Denoise::Oidn { version } = &mut denoise {
            map.get("version")?.as_str()?.clone_into(version);
        }
        Some(denoise)
    }
}

/// Opens the renderer of a job by `start`, with the denoiser of its settings if there is one.
///
/// # Errors
/// Returns the error of `start`, or one of the denoiser.
pub fn open<E: From<RenderError>>(
    mut job: Job,
    start: impl FnOnce(Job) -> Result<Box<dyn Renderer>, E>,
) -> Result<Box<dyn Renderer>, E> {
    let layers = job.settings.rendered_layers();
    let Some(denoise) = job.settings.denoise.take() else {
        return start(job);
    };
    let filter = Filter::new(&denoise, job.resolution, job.threads)?;
    let stored = std::mem::replace(&mut job.settings.films, layers);
    let inner = start(job)?;
    Ok(Box::new(Denoised::new(inner, filter, &stored)?))
}

fn failed(reason: impl ToString) -> RenderError {
    RenderError::failed("denoise", reason)
}

/// A denoiser that is ready for pictures of one size.
enum Filter {
    Atrous(AtrousSettings, Box<rayon::ThreadPool>),
    Oidn(Box<OidnFilter>),
}

impl Filter {
    fn new(denoise: &Denoise, size: [u32; 2], threads: usize) -> Result<Filter, RenderError> {
        match denoise {
            Denoise::Atrous(settings) => {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                Ok(Filter::Atrous(*settings, Box::new(pool.map_err(failed)?)))
            }
            Denoise::Oidn { .. } => {
                let filter = OidnFilter::new(size, threads).map_err(failed)?;
                Ok(Filter::Oidn(Box::new(filter)))
            }
        }
    }
}

/// A run whose picture is denoised.
///
/// The render time of a picture is that of its samples and of its own denoising: earlier pictures
/// were denoised only to be measured. It never lies before that of an earlier picture.
struct Denoised {
    inner: Box<dyn Renderer>,
    filter: Filter,
    /// Films of the layers that are stored, with their indices in `inner`.
    stored: Vec<LayerFilm>,
    indices: Vec<usize>,
    /// Indices of the guides in `inner`.
    guides: [usize; 2],
    /// Number of samples of the picture that was denoised last, and the picture.
    picture: Option<(u64, SharedImage)>,
    /// Seconds of denoising that the render time so far contains.
    charged_s: f64,
    /// Seconds of rendering since the last picture was denoised.
    since_s: f64,
}

/// Bytes of the two clocks at the end of a saved state.
const CLOCK_BYTES: usize = 16;

impl Denoised {
    fn new(
        inner: Box<dyn Renderer>,
        filter: Filter,
        stored: &[Layer],
    ) -> Result<Denoised, RenderError> {
        let films = inner.layers();
        let position = |layer: Layer| films.iter().position(|film| film.layer == layer);
        let [Some(albedo), Some(normal)] = GUIDES.map(position) else {
            return Err(failed("the renderer has no films of albedo and normals"));
        };
        let (indices, stored) = films
            .iter()
            .enumerate()
            .filter(|(_, film)| stored.contains(&film.layer))
            .map(|(index, film)| (index, *film))
            .unzip();
        Ok(Denoised {
            inner,
            filter,
            stored,
            indices,
            guides: [albedo, normal],
            picture: None,
            charged_s: 0.0,
            since_s: 0.0,
        })
    }

    /// Counts the time of a wave.
    fn counted(&mut self, wave: Result<WaveStats, RenderError>) -> Result<WaveStats, RenderError> {
        if let Ok(stats) = &wave {
            self.since_s += stats.render_s;
        }
        wave
    }

    /// Denoises the picture of all samples so far. Returns it and the seconds that it took.
    fn denoise(&mut self) -> Result<(SharedImage, f64), RenderError> {
        let film = self.inner.film();
        let (mean, samples) = (film.mean(), film.samples);
        let variance = film.variance_of_mean();
        let [albedo, normal] = self.guides.map(|index| {
            let image = self.inner.layers()[index].image(&self.inner.layer(index)?);
            Ok::<_, RenderError>(image)
        });
        let (albedo, normal) = (&albedo?, &normal?);
        let start = Instant::now();
        let image = match &mut self.filter {
            Filter::Atrous(settings, pool) => pool.install(|| {
                let input = Guided {
                    mean: &mean,
                    variance: &variance,
                    samples,
                    albedo,
                    normal,
                };
                atrous::filter(settings, input)
            }),
            Filter::Oidn(filter) => filter.run(&mean, albedo, normal).map_err(failed)?,
        };
        Ok((Arc::new(image), start.elapsed().as_secs_f64()))
    }
}

impl Renderer for Denoised {
    fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError> {
        let wave = self.inner.render(request);
        self.counted(wave)
    }

    fn whole_waves(&self) -> bool {
        self.inner.whole_waves()
    }

    fn film(&self) -> &Film {
        self.inner.film()
    }

    fn picture(&mut self) -> Result<Picture, RenderError> {
        let samples = self.film().samples;
        if let Some((_, image)) = self.picture.as_ref().filter(|(at, _)| *at == samples) {
            return Ok(Picture {
                image: Arc::clone(image),
                extra_s: 0.0,
                denoised: true,
            });
        }
        let (image, seconds) = self.denoise()?;
        let extra_s = (seconds - self.charged_s).max(-self.since_s);
        self.charged_s += extra_s;
        self.since_s = 0.0;
        self.picture = Some((samples, Arc::clone(&image)));
        Ok(Picture {
            image,
            extra_s,
            denoised: true,
        })
    }

    fn halves(&self) -> Option<[Arc<Film>; 2]> {
        self.inner.halves()
    }

    fn layers(&self) -> &[LayerFilm] {
        &self.stored
    }

    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        let inner = self.indices.get(index);
        let inner = inner.ok_or_else(|| failed(format!("layer film {index} does not exist")))?;
        self.inner.layer(*inner)
    }

    fn times(&self) -> Option<TimeCube> {
        self.inner.times()
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
        if !self.inner.save(to)? {
            return Ok(false);
        }
        write_u64s(to, [self.charged_s.to_bits(), self.since_s.to_bits()])?;
        Ok(true)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
        let mismatch = || failed(CheckpointMismatch);
        let split = state.len().checked_sub(CLOCK_BYTES).ok_or_else(mismatch)?;
        let (state, clocks) = state.split_at(split);
        self.inner.restore(state)?;
        let clock = |at: usize| {
            let bytes = clocks[at..].first_chunk().ok_or_else(mismatch)?;
            Ok::<f64, RenderError>(f64::from_bits(u64::from_ne_bytes(*bytes)))
        };
        (self.charged_s, self.since_s) = (clock(0)?, clock(8)?);
        Ok(())
    }

    fn open_stats(&self) -> &OpenStats {
        self.inner.open_stats()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn denoisers_read_back_from_their_values() {
        let none = BTreeMap::new();
        let oidn = Denoise::Oidn {
            version: "2.3.1".to_owned(),
        };
        let atrous = Denoise::from_name("atrous", &none).unwrap();
        for denoise in [oidn, atrous] {
            assert_eq!(Denoise::from_value(&denoise.to_value()), Some(denoise));
        }
        assert_eq!(Denoise::from_name("none", &none), None);
    }

    /// Run without noise whose waves take a second, on a backend of its own.
    struct Second {
        film: Film,
        layers: Vec<LayerFilm>,
        open_stats: OpenStats,
    }

    impl Renderer for Second {
        fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError> {
            let samples = request.samples;
            self.film.samples += samples;
            Ok(WaveStats {
                samples,
                render_s: 1.0,
                ..WaveStats::default()
            })
        }

        fn film(&self) -> &Film {
            &self.film
        }

        fn layers(&self) -> &[LayerFilm] {
            &self.layers
        }

        fn layer(&self, _: usize) -> Result<Film, RenderError> {
            Ok(self.film.clone())
        }

        fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
            self.film.save(to).map(|()| true)
        }

        fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
            let mut from = lumbre_light::film::state::StateReader::new(state);
            let restored = self.film.restore(&mut from).and_then(|()| from.finish());
            restored.map_err(failed)
        }

        fn open_stats(&self) -> &OpenStats {
            &self.open_stats
        }
    }

    fn denoised(size: u32) -> Denoised {
        let layers = lumbre_light::film::layer::LayerLayout::new(&GUIDES, 1, 1).unwrap();
        let inner = Second {
            film: Film::new(size, size),
            layers: layers.films().to_vec(),
            open_stats: OpenStats::default(),
        };
        let atrous = Denoise::from_name("atrous", &BTreeMap::new()).unwrap();
        let filter = Filter::new(&atrous, [size; 2], 1).unwrap();
        Denoised::new(Box::new(inner), filter, &[Layer::Normal]).unwrap()
    }

    #[test]
    fn one_denoising_is_on_the_clock_however_often_a_run_is_measured() {
        let mut run = denoised(64);
        let (mut clock, mut before) = (0.0, 0.0);
        for _ in 0..4 {
            clock += run.advance(1).unwrap().render_s;
            let picture = run.picture().unwrap();
            assert!(picture.denoised);
            clock += picture.extra_s;
            assert!(clock > before, "the clock does not go back");
            before = clock;
            assert_eq!(run.picture().unwrap().extra_s, 0.0, "the same picture");
        }
        assert!(run.charged_s > 0.0);
        assert!((clock - 4.0 - run.charged_s).abs() < 1e-9, "{clock}");
        // A picture that took longer than this wave and the next cannot make time go back.
        run.charged_s = 100.0;
        run.advance(1).unwrap();
        assert_eq!(run.picture().unwrap().extra_s, -1.0);
    }

    #[test]
    fn a_checkpoint_keeps_the_clock_and_only_stored_layers_are_shown() {
        let mut run = denoised(4);
        run.advance(2).unwrap();
        run.picture().unwrap();
        run.advance(1).unwrap();
        let mut state = Vec::new();
        assert!(run.save(&mut state).unwrap());
        let mut again = denoised(4);
        again.restore(&state).unwrap();
        assert_eq!(
            (again.charged_s, again.since_s, again.film().samples),
            (run.charged_s, 1.0, 3)
        );
        assert!(again.restore(&state[..8]).is_err());
        let names: Vec<String> = run.layers().iter().map(LayerFilm::name).collect();
        assert_eq!(names, ["normal"]);
        assert!(run.layer(0).is_ok() && run.layer(1).is_err());
    }

    #[test]
    fn a_renderer_without_guides_is_refused() {
        let inner = Second {
            film: Film::new(2, 2),
            layers: Vec::new(),
            open_stats: OpenStats::default(),
        };
        let atrous = Denoise::from_name("atrous", &BTreeMap::new()).unwrap();
        let filter = Filter::new(&atrous, [2; 2], 1).unwrap();
        assert!(Denoised::new(Box::new(inner), filter, &[]).is_err());
    }
}
