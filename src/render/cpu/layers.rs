//! The sums behind a run's layers.
//!
//! They keep the promises of the main film: own samples are added in the order of their index by one thread, splats in
//! whole numbers. What is refused there is refused here, so that films go on adding up to the picture.

use std::io::{self, Write};
use std::sync::OnceLock;

use glam::Vec3;

use crate::film::Film;
use crate::film::layer::{Layer, LayerFilm, Layout};
use crate::film::splat::SplatSums;
use crate::film::state::{Misfit, Saved, write_words};
use crate::render::Job;
use crate::transport::contribution::Contribution;
use crate::transport::integrator::Context;
use crate::transport::light::luminance;
use crate::transport::sampler::Sampler;
use crate::transport::surface::Surface;

/// Sums and sums of squares of one film at one pixel.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    sum: [f64; 3],
    sum2: [f64; 3],
}

/// What is the same for every row.
pub(super) struct Spec {
    layout: Layout,
    max_depth: u32,
    pixels: usize,
    /// Whether any layer is of the first surface.
    surfaces: bool,
    /// Films made of contributions; they stand before the others.
    light: usize,
    /// Place of each film's splats within a pixel's.
    slots: Vec<Option<usize>>,
    splat_films: usize,
    /// `[y][x][film]`, from the first splat on.
    splats: OnceLock<SplatSums>,
}

/// All layers of a run.
pub(super) struct LayerSums {
    spec: Spec,
    /// `[y][x][film]`.
    own: Vec<Sums>,
}

impl LayerSums {
    /// Those that a job asks for, if any.
    ///
    /// # Errors
    /// When they are too large; in words.
    pub(super) fn of(job: &Job) -> Result<Option<LayerSums>, String> {
        if job.layers.is_empty() {
            return Ok(None);
        }
        let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
        let layout = Layout::new(&job.layers, job.max_depth, pixels)?;
        let mut splat_films = 0;
        let mut slot = |film: &LayerFilm| {
            film.splats.then(|| {
                splat_films += 1;
                splat_films - 1
            })
        };
        let slots = layout.films().iter().map(&mut slot).collect();
        let own = vec![Sums::default(); layout.films().len() * pixels as usize];
        let surfaces = [Layer::Albedo, Layer::Normal, Layer::Distance];
        let spec = Spec {
            max_depth: job.max_depth,
            pixels: pixels as usize,
            surfaces: surfaces.iter().any(|layer| layout.whole(*layer).is_some()),
            light: layout.films().iter().filter(|film| film.layer.row().splats).count(),
            slots,
            splat_films,
            splats: OnceLock::new(),
            layout,
        };
        Ok(Some(LayerSums { spec, own }))
    }

    /// The sums of every row of pixels, each to be taken by whoever renders it, and what they have in common. Without
    /// layers there is nothing to take.
    pub(super) fn rows(layers: &mut Option<LayerSums>, height: u32) -> (Vec<Option<&mut [Sums]>>, Option<&Spec>) {
        match layers {
            None => ((0..height).map(|_| None).collect(), None),
            Some(LayerSums { spec, own }) => {
                let row = own.len() / (height as usize).max(1);
                (own.chunks_mut(row.max(1)).map(Some).collect(), Some(spec))
            }
        }
    }

    /// The films.
    pub(super) fn films(&self) -> &[LayerFilm] {
        self.spec.layout.films()
    }

    /// Writes all sums.
    pub(super) fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        let numbers = self.own.iter().flat_map(|sums| [sums.sum, sums.sum2]).flatten();
        write_words(to, numbers.map(f64::to_bits))?;
        SplatSums::save(self.spec.splats.get(), to)
    }

    /// Takes sums of the same films.
    pub(super) fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Misfit> {
        for sums in &mut self.own {
            for number in sums.sum.iter_mut().chain(&mut sums.sum2) {
                *number = f64::from_bits(from.word()?);
            }
        }
        let splats = SplatSums::restore(self.spec.pixels * self.spec.splat_films, from)?;
        self.spec.splats = splats.map_or_else(OnceLock::new, OnceLock::from);
        Ok(())
    }

    /// The sums of one of them, splats included.
    pub(super) fn film(&self, index: usize, [width, height]: [u32; 2], samples: u64) -> Film {
        let spec = &self.spec;
        let mut film = Film { samples, ..Film::new(width, height) };
        let splats = spec.splats.get().zip(spec.slots[index]);
        let own = self.own.iter().skip(index).step_by(self.films().len());
        for (pixel, own) in own.enumerate() {
            (film.sum[pixel], film.sum2[pixel]) = match splats {
                None => (own.sum, own.sum2),
                Some((splats, slot)) => splats.join(pixel * spec.splat_films + slot, own.sum, own.sum2, samples),
            };
        }
        film
    }
}

/// Where one row's samples gather before they are added to the sums.
pub(super) struct Tally<'a> {
    spec: &'a Spec,
    row: &'a mut [Sums],
    /// What the sample in progress has brought to each film of its own pixel.
    values: Vec<Vec3>,
}

impl<'a> Tally<'a> {
    /// For one row.
    pub(super) fn new(spec: &'a Spec, row: &'a mut [Sums]) -> Tally<'a> {
        Tally { spec, row, values: vec![Vec3::ZERO; spec.layout.films().len()] }
    }

    /// Takes a contribution to the sample's own pixel. Returns how many films refused it: one if its path is longer
    /// than paths may be.
    pub(super) fn own(&mut self, c: &Contribution) -> u64 {
        let values = &mut self.values;
        self.spec.share(c, |film, value| {
            values[film] += value;
            true
        })
    }

    /// Takes a contribution to any pixel. Returns how many films refused it.
    pub(super) fn splat(&self, pixel: usize, c: &Contribution) -> u64 {
        let spec = self.spec;
        spec.share(c, |film, value| {
            let Some(slot) = spec.slots[film] else { return false };
            let sums = spec.splats.get_or_init(|| SplatSums::new(spec.pixels * spec.splat_films));
            sums.add(pixel * spec.splat_films + slot, value.to_array())
        })
    }

    /// Ends a sample of `pixel`, which is in this row: `counts` is whether the picture took it, `rays` what it cost, and `again` makes its
    /// sampler once more. Returns how many films could not take theirs.
    pub(super) fn close(
        &mut self,
        context: &Context,
        pixel: [u32; 2],
        counts: bool,
        rays: u64,
        again: impl FnOnce() -> Sampler,
    ) -> u64 {
        if !counts {
            self.values[..self.spec.light].fill(Vec3::ZERO);
        }
        let layout = &self.spec.layout;
        if let Some(film) = layout.whole(Layer::Rays) {
            self.values[film] = Vec3::splat(rays as f32);
        }
        if self.spec.surfaces {
            self.first_surface(context, pixel, &mut again());
        }
        let start = pixel[0] as usize * self.values.len();
        let mut refused = 0;
        for (sums, value) in self.row[start..].iter_mut().zip(&mut self.values) {
            let v = std::mem::take(value);
            if !v.is_finite() {
                refused += 1;
            } else if v != Vec3::ZERO {
                for c in 0..3 {
                    let v = f64::from(v[c]);
                    sums.sum[c] += v;
                    sums.sum2[c] += v * v;
                }
            }
        }
        refused
    }

    /// What the camera ray of a sample, which its integrator traced first, meets first.
    fn first_surface(&mut self, context: &Context, pixel: [u32; 2], sampler: &mut Sampler) {
        let ray = context.camera.sample_ray(pixel, sampler);
        let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else { return };
        let surface = Surface::at(context.scene, &ray, &hit);
        let layout = &self.spec.layout;
        let mut put = |layer: Layer, value: Vec3| {
            if let Some(film) = layout.whole(layer) {
                self.values[film] = value;
            }
        };
        put(Layer::Albedo, surface.base_color(&context.scene.textures));
        let behind = surface.n_geometric.dot(ray.dir) > 0.0;
        put(Layer::Normal, if behind { -surface.n_shading } else { surface.n_shading });
        put(Layer::Distance, Vec3::new(ray.origin.distance(surface.position), 1.0, 0.0));
    }
}

impl Spec {
    /// Hands a contribution's share of every film to `give`, which says whether it was taken; returns how often not.
    fn share(&self, c: &Contribution, mut give: impl FnMut(usize, Vec3) -> bool) -> u64 {
        let k = c.depth();
        if !(1..=self.max_depth).contains(&k) {
            return 1;
        }
        let mut refused = 0;
        let mut give = |film: Option<usize>, value: Vec3| {
            if let Some(film) = film
                && value != Vec3::ZERO
            {
                refused += u64::from(!give(film, value));
            }
        };
        give(self.layout.depth(k), c.value);
        let strategy = self.layout.strategy(c.s, c.t);
        give(strategy, c.value);
        give(strategy.map(|weighted| weighted + 1), c.unweighted);
        let luminance = luminance(c.value) as f32;
        give(self.layout.whole(Layer::Bounces), Vec3::new((k - 1) as f32 * luminance, luminance, 0.0));
        refused
    }
}
