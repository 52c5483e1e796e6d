//! The films of a run on the device, and their copies here.

use std::io::{self, Write};
use std::sync::Arc;

use ash::vk;
use rayon::prelude::*;

use super::buffer::{Buffer, Readback};
use super::device::Device;
use super::error::VulkanError;
use super::layout::{Counters, Invalid, PathStep, Sums};
use super::pipeline::Bound;
use super::times::{Read, Times};
use crate::film::Film;
use crate::film::layer::{LayerFilm, Layout};
use crate::film::splat::{join, squares_of_words, sum_of_words};
use crate::film::state::{Misfit, Saved, write_sums, write_words};
use crate::film::time::{TimeAxis, TimeCube};
use crate::render::paths::MOST_STEPS;

/// Pixels that a thread takes at once.
const TOGETHER: usize = 4096;

/// Sums of splats of one film at one pixel: three sums, three sums of squares.
pub type Landed = ([f64; 3], [f64; 3]);

/// Why films cannot take what was saved.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RestoreError {
    /// It is of another kind of run.
    #[error(transparent)]
    Misfit(#[from] Misfit),
    /// The device failed.
    #[error(transparent)]
    Device(#[from] VulkanError),
}

/// How splats are summed on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SplatMode {
    /// No sample of this job brings light to other pixels.
    None,
    /// By atomic addition of floats: the last bits depend on chance. Each wave starts from zero, and is added here in double
    /// precision.
    Float,
    /// In 128-bit whole numbers, as on the CPU: the same bits every time.
    Fixed,
}

impl SplatMode {
    /// Bytes of a slot.
    fn bytes(self) -> u64 {
        match self {
            SplatMode::None => 0,
            SplatMode::Float => 6 * 4,
            SplatMode::Fixed => 6 * 16,
        }
    }
}

/// Buffers that a run adds to.
pub struct Films {
    sums: Buffer,
    invalid: Buffer,
    counters: Buffer,
    splats: Buffer,
    layer_sums: Buffer,
    layer_values: Buffer,
    /// Steps of the samples of one row; empty unless they are wanted.
    steps: Buffer,
    times: Times,
    mode: SplatMode,
    layout: Layout,
    resolution: [u32; 2],
    /// Splats of earlier waves, where the device starts every wave from zero; by slot.
    landed: Vec<Landed>,
    readback: Readback,
    counted: Readback,
}

impl Films {
    /// Films without samples, by time where there is an axis, with room for the `steps` of a row's samples or without.
    ///
    /// # Errors
    /// When they do not fit onto the device.
    pub fn new(
        device: &Arc<Device>,
        resolution: [u32; 2],
        layout: Layout,
        axis: Option<TimeAxis>,
        mode: SplatMode,
        steps: bool,
    ) -> Result<Films, VulkanError> {
        let pixels = u64::from(resolution[0]) * u64::from(resolution[1]);
        let films = layout.films().len() as u64;
        let splat_films = layout.films().iter().filter(|film| film.splats).count() as u64;
        let times = Times::new(device, axis, pixels, mode.bytes())?;
        let slots = if mode == SplatMode::None { 0 } else { pixels * (times.slots() as u64 + splat_films) };
        let step_rows = if steps { u64::from(resolution[0]) * MOST_STEPS as u64 } else { 0 };
        let row = size_of::<Sums>() as u64;
        let largest = (row * pixels).max(mode.bytes() * slots).max(row * pixels * films);
        Ok(Films {
            sums: Buffer::zeros(device, "sums of pixels", row * pixels)?,
            invalid: Buffer::zeros(device, "refused samples", size_of::<Invalid>() as u64 * pixels)?,
            counters: Buffer::zeros(device, "counters", size_of::<Counters>() as u64)?,
            splats: Buffer::zeros(device, "splats", mode.bytes() * slots)?,
            layer_sums: Buffer::zeros(device, "sums of layers", row * pixels * films)?,
            layer_values: Buffer::zeros(device, "values of layers", 12 * pixels * films)?,
            steps: Buffer::zeros(device, "steps of samples", size_of::<PathStep>() as u64 * step_rows)?,
            landed: if mode == SplatMode::Float { vec![Landed::default(); slots as usize] } else { Vec::new() },
            readback: Readback::new(device, largest)?,
            counted: Readback::new(device, size_of::<Counters>() as u64)?,
            times,
            mode,
            layout,
            resolution,
        })
    }

    /// What is bound after the scene, in the order of `shaders/film`.
    pub fn bound(&self) -> [Bound<'_>; 9] {
        let (sums, values) = (&self.times.sums, &self.times.values);
        let [layer_sums, layer_values] = [&self.layer_sums, &self.layer_values];
        [&self.sums, &self.invalid, &self.counters, &self.splats, layer_sums, layer_values, &self.steps, sums, values]
            .map(Bound::Storage)
    }

    /// Forgets the steps of the row before.
    ///
    /// # Errors
    /// When the device fails.
    pub fn clear_steps(&self) -> Result<(), VulkanError> {
        self.steps.clear()
    }

    /// The steps of a row's samples, [`MOST_STEPS`] for each column.
    ///
    /// # Errors
    /// When the device fails.
    pub fn steps(&self) -> Result<Vec<PathStep>, VulkanError> {
        self.steps.read(self.resolution[0] as usize * MOST_STEPS)
    }

    /// The films of layers.
    pub fn layers(&self) -> &[LayerFilm] {
        self.layout.films()
    }

    /// Records that the counters start from zero.
    pub fn start_counting(&self, device: &Device, commands: vk::CommandBuffer) {
        // SAFETY: the commands are being recorded.
        unsafe { device.raw.cmd_fill_buffer(commands, self.counters.raw, 0, vk::WHOLE_SIZE, 0) };
        device.barrier_to_shaders(commands);
    }

    /// Records that the counters are copied here.
    pub fn stop_counting(&self, device: &Device, commands: vk::CommandBuffer) {
        device.barrier_to_copy(commands);
        self.counted.record(commands, &[&self.counters]);
    }

    /// What was counted, once the commands are done.
    pub fn counted(&self) -> Counters {
        bytemuck::pod_read_unaligned(&self.counted.bytes()[..size_of::<Counters>()])
    }

    /// The sample, row and column of the first refused sample, of all waves.
    ///
    /// # Errors
    /// When the device fails.
    pub fn first_invalid(&self) -> Result<Option<[u64; 3]>, VulkanError> {
        let width = self.resolution[0] as usize;
        let rows: Vec<Invalid> = self.invalid.read(width * self.resolution[1] as usize)?;
        let place = |(i, row): (usize, &Invalid)| {
            let sample = u64::from(row.first[1]) << 32 | u64::from(row.first[0]);
            (row.count > 0).then_some([sample, (i / width) as u64, (i % width) as u64])
        };
        Ok(rows.iter().enumerate().filter_map(place).min())
    }

    /// Ends a wave: what the device cannot keep is fetched.
    ///
    /// # Errors
    /// When the device fails.
    pub fn end_wave(&mut self) -> Result<(), VulkanError> {
        if self.mode == SplatMode::Float {
            self.readback.fetch(&[&self.splats])?;
            let waves = self.readback.bytes().par_chunks_exact(size_of::<[f32; 6]>());
            self.landed.par_iter_mut().zip(waves).with_min_len(TOGETHER).for_each(|(landed, words)| {
                let wave: [f32; 6] = bytemuck::pod_read_unaligned(words);
                for c in 0..3 {
                    landed.0[c] += f64::from(wave[c]);
                    landed.1[c] += f64::from(wave[3 + c]);
                }
            });
            self.splats.clear()?;
        }
        Ok(())
    }

    /// Writes the sums of the picture into `film`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn picture(&self, film: &mut Film) -> Result<(), VulkanError> {
        let (pixels, samples) = (film.sum.len(), film.samples);
        // The device waits meanwhile: all threads share the work.
        let both = film.sum.par_iter_mut().zip(&mut film.sum2).with_min_len(TOGETHER);
        let rows = self.fetch_sums(&self.sums)?.par_chunks_exact(size_of::<Sums>());
        both.zip(rows).for_each(|((sum, sum2), row)| (*sum, *sum2) = sums_of(row));
        if let Some(read) = self.read_times(pixels)? {
            read.make_picture(film);
        } else if self.mode != SplatMode::None {
            let landed = self.fetch_splats()?;
            let both = film.sum.par_iter_mut().zip(&mut film.sum2).with_min_len(TOGETHER);
            both.enumerate().for_each(|(i, (sum, sum2))| (*sum, *sum2) = join(landed(i), (*sum, *sum2), samples));
        }
        Ok(())
    }

    fn read_times(&self, pixels: usize) -> Result<Option<Read>, VulkanError> {
        let splats = self.mode != SplatMode::None && self.times.slots() > 1;
        let slots = 0..pixels * self.times.slots();
        let landed = splats.then(|| Ok::<_, VulkanError>(slots.map(self.fetch_splats()?).collect())).transpose()?;
        self.times.read(pixels, landed)
    }

    /// The light of every pixel by its time; none without a time axis.
    ///
    /// # Errors
    /// When the device fails.
    pub fn times(&self, samples: u64) -> Result<Option<TimeCube>, VulkanError> {
        let pixels = self.resolution[0] as usize * self.resolution[1] as usize;
        Ok(self.read_times(pixels)?.map(|read| read.cube(self.resolution, samples)))
    }

    /// The sums of film `index` of the layers.
    ///
    /// # Errors
    /// When the device fails.
    pub fn layer(&self, index: usize, samples: u64) -> Result<Film, VulkanError> {
        let mut film = Film { samples, ..Film::new(self.resolution[0], self.resolution[1]) };
        let (pixels, films) = (film.sum.len(), self.layout.films().len());
        let rows = self.fetch_sums(&self.layer_sums)?.chunks_exact(size_of::<Sums>());
        for (i, row) in rows.skip(index).step_by(films).take(pixels).enumerate() {
            (film.sum[i], film.sum2[i]) = sums_of(row);
        }
        if self.mode != SplatMode::None && self.layout.films()[index].splats {
            let splat_films = self.layout.films().iter().filter(|film| film.splats).count();
            let slot = self.layout.films()[..index].iter().filter(|film| film.splats).count();
            let (landed, first) = (self.fetch_splats()?, pixels * self.times.slots() + slot);
            for i in 0..pixels {
                let landed = landed(first + i * splat_films);
                (film.sum[i], film.sum2[i]) = join(landed, (film.sum[i], film.sum2[i]), samples);
            }
        }
        Ok(film)
    }

    /// Everything that is kept from wave to wave, between waves.
    fn kept(&self) -> [&Buffer; 5] {
        [&self.sums, &self.invalid, &self.layer_sums, &self.splats, &self.times.sums]
    }

    /// Writes everything that further waves need.
    ///
    /// # Errors
    /// When the device fails, or as `to`.
    pub fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        write_words(to, [self.mode as u64])?;
        for buffer in self.kept() {
            let bytes: Vec<u8> = buffer.read(buffer.size as usize).map_err(io::Error::other)?;
            write_words(to, [buffer.size])?;
            to.write_all(&bytes)?;
        }
        self.landed.iter().try_for_each(|(sum, squares)| write_sums(to, &[*sum, *squares]))
    }

    /// Takes what films of the same kind have written; after an error these are worthless.
    ///
    /// # Errors
    /// When it does not fit, or the device fails.
    pub fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), RestoreError> {
        if from.word()? != self.mode as u64 {
            return Err(RestoreError::Misfit(Misfit));
        }
        for buffer in self.kept() {
            if from.word()? != buffer.size {
                return Err(RestoreError::Misfit(Misfit));
            }
            buffer.write(from.bytes(buffer.size)?)?;
        }
        for (sum, squares) in &mut self.landed {
            let mut both = [[0.0; 3]; 2];
            from.sums(&mut both)?;
            [*sum, *squares] = both;
        }
        Ok(())
    }

    /// The rows of sums of a buffer.
    fn fetch_sums(&self, buffer: &Buffer) -> Result<&[u8], VulkanError> {
        self.readback.fetch(&[buffer])?;
        Ok(self.readback.bytes())
    }

    /// The sums of splats by slot. Whoever asks knows that there are any.
    fn fetch_splats(&self) -> Result<impl Fn(usize) -> Landed + Sync + '_, VulkanError> {
        if self.mode == SplatMode::Fixed {
            self.readback.fetch(&[&self.splats])?;
        }
        let (bytes, landed, fixed) = (self.readback.bytes(), &self.landed[..], self.mode == SplatMode::Fixed);
        Ok(move |slot: usize| {
            if !fixed {
                return landed[slot];
            }
            let words: [[u32; 4]; 6] = bytemuck::pod_read_unaligned(&bytes[slot * 96..][..96]);
            let [a, b, c, d, e, f] = words;
            ([a, b, c].map(sum_of_words), [d, e, f].map(squares_of_words))
        })
    }
}

/// The sums in a row, and the sums of squares.
fn sums_of(row: &[u8]) -> ([f64; 3], [f64; 3]) {
    let s: Sums = bytemuck::pod_read_unaligned(row);
    let both = |sum: [f32; 3], rest: [f32; 3]| [0, 1, 2].map(|c| f64::from(sum[c]) + f64::from(rest[c]));
    (both(s.sum, s.sum_rest), both(s.sum2, s.sum2_rest))
}
