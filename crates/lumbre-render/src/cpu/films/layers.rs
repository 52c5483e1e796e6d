//! Films of a run's layers. [`LayerFilms`] holds the sums, [`LayerRowFilm`] accumulates the samples
//! of one row of pixels.
//!
//! Invariants: one thread adds the samples of a pixel in the order of their index, splats are added
//! in fixed point, and a sample that the main film rejects is rejected here too, so that the films
//! of a layer still add up to the picture.

use std::io::{self, Write};
use std::sync::OnceLock;

use glam::Vec3;

use super::first_hits::first_hit;
use crate::Job;
use lumbre_light::film::Film;
use lumbre_light::film::layer::{FirstHit, Layer, LayerFilm, LayerLayout, LayerSource};
use lumbre_light::film::splat::SplatSums;
use lumbre_light::film::state::{CheckpointMismatch, StateReader, write_u64s};
use lumbre_light::math::luminance::luminance_of;
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::sampler::Sampler;

/// Sum and sum of squares of one film at one pixel.
#[derive(Clone, Copy, Default)]
pub(crate) struct Moments {
    sum: [f64; 3],
    sum2: [f64; 3],
}

/// Facts about each sample that layers need.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LayerNeeds {
    /// Each contribution, with its strategy and its light without weight.
    pub contributions: bool,
    /// The number of rays.
    pub rays: bool,
    /// The surface that the camera ray hits.
    pub surfaces: bool,
}

impl LayerNeeds {
    /// Everything about the light of a sample.
    pub const LIGHT: LayerNeeds = LayerNeeds {
        contributions: true,
        rays: true,
        surfaces: false,
    };

    /// Returns the facts that some layers need; none without layers.
    pub fn of(layers: Option<&LayerRowFilm>) -> LayerNeeds {
        layers.map_or_else(LayerNeeds::default, |layers| layers.spec.needs)
    }
}

/// Layout of the films, and the splat sums; shared by all rows.
pub(crate) struct LayerSpec {
    layout: LayerLayout,
    max_depth: u32,
    /// Index of the first sample of every pixel.
    first_sample: u64,
    pixels: usize,
    needs: LayerNeeds,
    /// Number of films to which contributions are added; their indices precede all others.
    contribution_films: usize,
    /// Index of each film's splat sums among those of a pixel; `None` for films without splats.
    splat_index: Vec<Option<usize>>,
    splat_films: usize,
    /// Splat sums, `[y][x][film]`, allocated for the first splat.
    splats: OnceLock<SplatSums>,
}

/// Films of all layers of a run.
pub(crate) struct LayerFilms {
    spec: LayerSpec,
    /// Sums of samples, `[y][x][film]`.
    own: Vec<Moments>,
}

impl LayerFilms {
    /// Creates the films of the layers that a job requests, or returns `None` if it requests none.
    ///
    /// # Errors
    /// Returns a message if they exceed the limits of [`LayerLayout::new`].
    pub(crate) fn for_job(job: &Job) -> Result<Option<LayerFilms>, String> {
        if job.settings.films.is_empty() {
            return Ok(None);
        }
        let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
        let layout = LayerLayout::new(&job.settings.films, job.max_depth, pixels)?;
        let mut splat_films = 0;
        let mut next_splat_index = |film: &LayerFilm| {
            film.splats.then(|| {
                splat_films += 1;
                splat_films - 1
            })
        };
        let splat_index = layout.films().iter().map(&mut next_splat_index).collect();
        let own = vec![Moments::default(); layout.summed().len() * pixels as usize];
        let contribution_films = layout.contribution_films();
        let mut needs = LayerNeeds {
            contributions: contribution_films > 0,
            ..LayerNeeds::default()
        };
        for film in layout.films() {
            match film.layer.row().source {
                LayerSource::Rays => needs.rays = true,
                LayerSource::FirstHit(_) | LayerSource::FirstIndex(_) => needs.surfaces = true,
                LayerSource::Contributions | LayerSource::Variance => (),
            }
        }
        let spec = LayerSpec {
            max_depth: job.max_depth,
            first_sample: job.first_sample,
            pixels: pixels as usize,
            needs,
            contribution_films,
            splat_index,
            splat_films,
            splats: OnceLock::new(),
            layout,
        };
        Ok(Some(LayerFilms { spec, own }))
    }

    /// Splits the films into rows, one for each thread that renders a row, and returns the
    /// properties that all rows share. Without sums of layers every row is `None`.
    pub(crate) fn rows(
        layers: &mut Option<LayerFilms>,
        height: u32,
    ) -> (Vec<Option<&mut [Moments]>>, Option<&LayerSpec>) {
        match layers {
            Some(LayerFilms { spec, own }) if !own.is_empty() => {
                let row = own.len() / (height as usize).max(1);
                (own.chunks_mut(row.max(1)).map(Some).collect(), Some(spec))
            }
            _ => ((0..height).map(|_| None).collect(), None),
        }
    }

    /// Returns the films.
    pub(crate) fn films(&self) -> &[LayerFilm] {
        self.spec.layout.films()
    }

    /// Writes all sums.
    pub(crate) fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        let numbers = self
            .own
            .iter()
            .flat_map(|sums| [sums.sum, sums.sum2])
            .flatten();
        write_u64s(to, numbers.map(f64::to_bits))?;
        SplatSums::save(self.spec.splats.get(), to)
    }

    /// Reads the sums of the same films.
    pub(crate) fn restore(&mut self, from: &mut StateReader<'_>) -> Result<(), CheckpointMismatch> {
        for sums in &mut self.own {
            for number in sums.sum.iter_mut().chain(&mut sums.sum2) {
                *number = f64::from_bits(from.read_u64()?);
            }
        }
        let splats = SplatSums::restore(self.spec.pixels * self.spec.splat_films, from)?;
        self.spec.splats = splats.map_or_else(OnceLock::new, OnceLock::from);
        Ok(())
    }

    /// Returns the sums of one film that has some of its own, splats included.
    pub(crate) fn film(&self, index: usize, [width, height]: [u32; 2], samples: u64) -> Film {
        let spec = &self.spec;
        let mut film = Film {
            samples,
            ..Film::new(width, height)
        };
        let splats = spec.splats.get().zip(spec.splat_index[index]);
        let own = self
            .own
            .iter()
            .skip(index)
            .step_by(spec.layout.summed().len());
        for (pixel, own) in own.enumerate() {
            (film.sum[pixel], film.sum2[pixel]) = match splats {
                None => (own.sum, own.sum2),
                Some((splats, splat_index)) => splats.combined(
                    pixel * spec.splat_films + splat_index,
                    own.sum,
                    own.sum2,
                    samples,
                ),
            };
        }
        film
    }
}

/// Accumulates the samples of one row of pixels in the films of all layers.
pub(crate) struct LayerRowFilm<'a> {
    spec: &'a LayerSpec,
    row: &'a mut [Moments],
    /// Contribution of the current sample to each film of its own pixel.
    values: Vec<Vec3>,
    /// Films that the current sample contributes to.
    touched: Vec<u32>,
}

impl<'a> LayerRowFilm<'a> {
    /// Creates the accumulator of one row.
    pub(crate) fn new(spec: &'a LayerSpec, row: &'a mut [Moments]) -> LayerRowFilm<'a> {
        LayerRowFilm {
            spec,
            row,
            values: vec![Vec3::ZERO; spec.layout.summed().len()],
            touched: Vec::new(),
        }
    }

    /// Returns the surface that the camera ray of a sample hits, if a layer needs it; `sampler`
    /// creates its sampler anew.
    pub(crate) fn first_hit(
        &self,
        context: &Context,
        pixel: [u32; 2],
        sampler: impl FnOnce() -> Sampler,
    ) -> Option<FirstHit> {
        let wanted = self.spec.needs.surfaces;
        wanted.then(|| first_hit(context, pixel, &mut sampler()))?
    }

    /// Adds a contribution to the sample's own pixel. Returns the number of rejections: 1 if its
    /// depth exceeds the limit, else 0.
    pub(crate) fn add(&mut self, c: &Contribution) -> u64 {
        let LayerRowFilm {
            values, touched, ..
        } = self;
        self.spec.for_each_film(c, |film, value| {
            if values[film] == Vec3::ZERO {
                touched.push(film as u32);
            }
            values[film] += value;
            true
        })
    }

    /// Adds a splat to a pixel. Returns the number of films that rejected it.
    pub(crate) fn splat(&self, pixel: usize, c: &Contribution) -> u64 {
        let spec = self.spec;
        spec.for_each_film(c, |film, value| {
            let Some(splat_index) = spec.splat_index[film] else {
                return false;
            };
            let sums = spec
                .splats
                .get_or_init(|| SplatSums::new(spec.pixels * spec.splat_films));
            sums.add(pixel * spec.splat_films + splat_index, value.to_array())
        })
    }

    /// Ends a sample of the pixel in column `x`. `accepted` is whether the main film accepted it,
    /// `rays` the number of rays that it traced, and `hit` the surface that its camera ray hits,
    /// where layers [need](LayerNeeds) these. Returns the number of films whose value was not
    /// finite and was dropped.
    pub(crate) fn finish_sample(
        &mut self,
        (x, sample): (u32, u64),
        accepted: bool,
        rays: u64,
        hit: Option<FirstHit>,
    ) -> u64 {
        let (spec, values) = (self.spec, &mut self.values);
        if !accepted {
            values[..spec.contribution_films].fill(Vec3::ZERO);
        }
        let films = spec.layout.summed().iter().enumerate();
        for (i, film) in films.skip(spec.contribution_films) {
            self.touched.push(i as u32);
            values[i] = match (film.layer.row().source, &hit) {
                (LayerSource::Rays, _) => Vec3::splat(rays as f32),
                (LayerSource::FirstHit(value), Some(hit)) => value(hit),
                (LayerSource::FirstIndex(index), Some(hit)) if sample == spec.first_sample => {
                    Vec3::X * (index(hit) + 1) as f32
                }
                _ => Vec3::ZERO,
            };
        }
        let sums = &mut self.row[x as usize * values.len()..];
        let mut rejected = 0;
        for film in self.touched.drain(..) {
            let v = std::mem::take(&mut values[film as usize]);
            let sums = &mut sums[film as usize];
            if !v.is_finite() {
                rejected += 1;
            } else if v != Vec3::ZERO {
                for c in 0..3 {
                    let v = f64::from(v[c]);
                    sums.sum[c] += v;
                    sums.sum2[c] += v * v;
                }
            }
        }
        rejected
    }
}

impl LayerSpec {
    /// Calls `add` with each film that a contribution belongs to and the value to add; `add`
    /// returns whether the film accepted it. Returns the number of rejections.
    fn for_each_film(&self, c: &Contribution, mut add: impl FnMut(usize, Vec3) -> bool) -> u64 {
        let k = c.depth();
        if !(1..=self.max_depth).contains(&k) {
            return 1;
        }
        let mut rejected = 0;
        let mut add_to = |film: Option<usize>, value: Vec3| {
            if let Some(film) = film
                && value != Vec3::ZERO
            {
                rejected += u64::from(!add(film, value));
            }
        };
        add_to(self.layout.depth(k), c.value);
        let strategy = self.layout.strategy(c.s, c.t);
        add_to(strategy, c.value);
        add_to(strategy.map(|weighted| weighted + 1), c.unweighted);
        let luminance = luminance_of(c.value) as f32;
        add_to(
            self.layout.single(Layer::Bounces),
            Vec3::new((k - 1) as f32 * luminance, luminance, 0.0),
        );
        rejected
    }
}
