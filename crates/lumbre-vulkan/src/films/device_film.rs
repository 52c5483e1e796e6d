//! Films of a run in device memory and their copies on the host. The state at the end of a wave is
//! copied to host memory, so that the device can start the next wave while the host reads the film,
//! saves it, or rolls back a wave that is not needed.

use std::borrow::Cow;
use std::io::{self, Write};
use std::sync::Arc;

use ash::vk;
use rayon::prelude::*;

use super::time_film::{DeviceTimeFilm, SplatMoments, TimeReadback};
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::layout::{Counters, Invalid, PathStep, SampleSums, SampleValue};
use crate::memory::buffer::{Buffer, Readback};
use crate::pipelines::compute::BoundResource;
use crate::schedule::pixel_samples::PixelSamples;
use lumbre_light::film::Film;
use lumbre_light::film::fixed_point::{combine_sums, squares_from_words, sum_from_words};
use lumbre_light::film::layer::{LayerFilm, LayerLayout};
use lumbre_light::film::state::{CheckpointMismatch, StateReader, write_sums, write_u64s};
use lumbre_light::film::time::{TimeAxis, TimeCube};
use lumbre_render::path_trace::MAX_PATH_EVENTS;

/// Number of pixels that a thread processes at once.
const PIXELS_PER_TASK: usize = 4096;

/// Reason why films cannot be restored.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RestoreError {
    /// The state belongs to another kind of run.
    #[error(transparent)]
    CheckpointMismatch(#[from] CheckpointMismatch),
    /// The device failed.
    #[error(transparent)]
    Device(#[from] VulkanError),
}

/// Summation of splats on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SplatMode {
    /// The integrator makes no splats.
    None,
    /// Atomic addition of floats; the last bits depend on the order. Each wave starts from zero and
    /// is added on the host in double precision.
    Float,
    /// 128-bit fixed point as on the CPU; identical bits every time.
    Fixed,
}

impl SplatMode {
    /// Selects the mode by whether the integrator makes splats and the device adds floats
    /// atomically.
    pub fn select(has_splats: bool, float_atomics: bool) -> SplatMode {
        match (has_splats, float_atomics) {
            (false, _) => SplatMode::None,
            (true, true) => SplatMode::Float,
            (true, false) => SplatMode::Fixed,
        }
    }

    /// Returns the size of a slot in bytes.
    fn bytes(self) -> u64 {
        match self {
            SplatMode::None => 0,
            SplatMode::Float => 6 * 4,
            SplatMode::Fixed => 6 * 16,
        }
    }
}

/// Film buffers that a run accumulates into.
pub struct DeviceFilms {
    sums: Buffer,
    invalid: Buffer,
    counters: Buffer,
    splats: Buffer,
    layer_sums: Buffer,
    layer_values: Buffer,
    /// Path events of the samples of one row; empty unless recording.
    events: Buffer,
    /// Values of samples that are rendered at once, until they are added; else empty.
    values: Buffer,
    times: DeviceTimeFilm,
    mode: SplatMode,
    layout: LayerLayout,
    resolution: [u32; 2],
    /// Splat sums of the waves so far, by slot, if the device starts every wave from zero.
    splats_so_far: Vec<SplatMoments>,
    /// Pixel sums, splats and invalid samples at the end of the last wave.
    last: Readback,
    /// Copy of the layer sums.
    readback: Readback,
    /// Counters of the last two submissions, of which the earlier is read while the later one runs.
    counted: [Readback; 2],
}

impl DeviceFilms {
    /// Creates films without samples, with a time axis if there is one, and with the buffers that
    /// `samples` need.
    ///
    /// # Errors
    /// Returns an error if they do not fit onto the device.
    pub fn new(
        device: &Arc<Device>,
        resolution: [u32; 2],
        layout: LayerLayout,
        axis: Option<TimeAxis>,
        mode: SplatMode,
        samples: PixelSamples,
    ) -> Result<DeviceFilms, VulkanError> {
        let pixels = u64::from(resolution[0]) * u64::from(resolution[1]);
        let films = layout.summed().len() as u64;
        let splat_films = layout.films().iter().filter(|film| film.splats).count() as u64;
        let times = DeviceTimeFilm::new(device, axis, pixels, mode.bytes())?;
        let slots = if mode == SplatMode::None {
            0
        } else {
            pixels * (times.slots() as u64 + splat_films)
        };
        let event_count = u64::from(samples == PixelSamples::Recorded)
            * u64::from(resolution[0])
            * MAX_PATH_EVENTS as u64;
        let value_count = pixels * u64::from(samples.at_once().unwrap_or(0));
        let row = size_of::<SampleSums>() as u64;
        let sums = Buffer::zeros(device, "pixel sums", row * pixels)?;
        let invalid = Buffer::zeros(
            device,
            "invalid samples",
            size_of::<Invalid>() as u64 * pixels,
        )?;
        let splats = Buffer::zeros(device, "splats", mode.bytes() * slots)?;
        let counted = || Readback::new(device, size_of::<Counters>() as u64);
        let films = DeviceFilms {
            last: Readback::new(device, sums.size + splats.size + invalid.size)?,
            sums,
            invalid,
            counters: Buffer::zeros(device, "counters", size_of::<Counters>() as u64)?,
            splats,
            layer_sums: Buffer::zeros(device, "layer sums", row * pixels * films)?,
            layer_values: Buffer::zeros(device, "layer values", 12 * pixels * films)?,
            events: Buffer::zeros(
                device,
                "path events",
                size_of::<PathStep>() as u64 * event_count,
            )?,
            splats_so_far: if mode == SplatMode::Float {
                vec![SplatMoments::default(); slots as usize]
            } else {
                Vec::new()
            },
            readback: Readback::new(device, row * pixels * films)?,
            counted: [counted()?, counted()?],
            values: Buffer::zeros(
                device,
                "sample values",
                size_of::<SampleValue>() as u64 * value_count,
            )?,
            times,
            mode,
            layout,
            resolution,
        };
        films
            .last
            .fetch(&[&films.sums, &films.splats, &films.invalid])?;
        Ok(films)
    }

    /// Returns the bindings after those of the scene, in the order of `shaders/film`.
    pub fn bindings(&self) -> [BoundResource<'_>; 10] {
        let (sums, values) = (&self.times.sums, &self.times.values);
        let [layer_sums, layer_values] = [&self.layer_sums, &self.layer_values];
        [
            &self.sums,
            &self.invalid,
            &self.counters,
            &self.splats,
            layer_sums,
            layer_values,
            &self.events,
            sums,
            values,
            &self.values,
        ]
        .map(BoundResource::Storage)
    }

    /// Clears the path events of the previous row.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn clear_events(&self) -> Result<(), VulkanError> {
        self.events.clear()
    }

    /// Returns the path events of a row's samples, [`MAX_PATH_EVENTS`] for each column.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn events(&self) -> Result<Vec<PathStep>, VulkanError> {
        self.events
            .read(self.resolution[0] as usize * MAX_PATH_EVENTS)
    }

    /// Returns the films of the layers.
    pub fn layers(&self) -> &[LayerFilm] {
        self.layout.films()
    }

    /// Returns whether the device may start the next wave while the last film is read. Not with
    /// layers or a time axis: those films may fill the device's memory, are not copied, and are
    /// read from the device on demand.
    pub fn allows_speculation(&self) -> bool {
        self.layout.films().is_empty() && self.times.is_empty()
    }

    /// Records that the counters start from zero after all previous work.
    pub fn start_counting(&self, device: &Device, commands: vk::CommandBuffer) {
        let copies = vk::PipelineStageFlags::TRANSFER;
        let both = vk::AccessFlags::TRANSFER_READ | vk::AccessFlags::TRANSFER_WRITE;
        device.barrier(commands, (copies, both), (copies, both));
        // SAFETY: the commands are being recorded.
        unsafe {
            device
                .raw
                .cmd_fill_buffer(commands, self.counters.raw, 0, vk::WHOLE_SIZE, 0)
        };
        device.barrier_to_shaders(commands);
    }

    /// Records a copy of the counters to one of two host buffers.
    pub fn stop_counting(&self, device: &Device, commands: vk::CommandBuffer, slot: usize) {
        device.barrier_to_copy(commands);
        self.counted[slot % 2].record(commands, &[&self.counters]);
    }

    /// Returns the counters of a submission, once its commands are done.
    pub fn counted(&self, slot: usize) -> Counters {
        bytemuck::pod_read_unaligned(&self.counted[slot % 2].bytes()[..size_of::<Counters>()])
    }

    /// Returns sample index, row and column of the first invalid sample of all waves.
    pub fn first_invalid(&self) -> Option<[u64; 3]> {
        let width = self.resolution[0] as usize;
        let rows = self
            .last_invalid()
            .chunks_exact(size_of::<Invalid>())
            .map(bytemuck::pod_read_unaligned);
        let slot = |(i, row): (usize, Invalid)| {
            let sample = u64::from(row.first[1]) << 32 | u64::from(row.first[0]);
            (row.count > 0).then_some([sample, (i / width) as u64, (i % width) as u64])
        };
        rows.enumerate().filter_map(slot).min()
    }

    /// Records the end of a wave: copies the state to the host, and clears float splats.
    pub fn record_end(&self, device: &Device, commands: vk::CommandBuffer) {
        device.barrier_to_copy(commands);
        self.last
            .record(commands, &[&self.sums, &self.splats, &self.invalid]);
        if self.mode == SplatMode::Float {
            let copies = vk::PipelineStageFlags::TRANSFER;
            device.barrier(
                commands,
                (copies, vk::AccessFlags::TRANSFER_READ),
                (copies, vk::AccessFlags::TRANSFER_WRITE),
            );
            // SAFETY: the commands are being recorded, and the buffer may be filled.
            unsafe {
                device
                    .raw
                    .cmd_fill_buffer(commands, self.splats.raw, 0, vk::WHOLE_SIZE, 0)
            };
        }
    }

    /// Finishes a wave, once its commands are done: adds its float splats to the sums on the host.
    pub fn end_wave(&mut self) {
        if self.mode == SplatMode::Float {
            let [_, splats, _] =
                DeviceFilms::split_readback(&self.last, [&self.sums, &self.splats, &self.invalid]);
            let waves = splats.par_chunks_exact(size_of::<[f32; 6]>());
            self.splats_so_far
                .par_iter_mut()
                .zip(waves)
                .with_min_len(PIXELS_PER_TASK)
                .for_each(|(splats, words)| {
                    let wave: [f32; 6] = bytemuck::pod_read_unaligned(words);
                    for c in 0..3 {
                        splats.0[c] += f64::from(wave[c]);
                        splats.1[c] += f64::from(wave[3 + c]);
                    }
                });
        }
    }

    /// Restores the device's sums of the end of the last wave.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn roll_back(&self) -> Result<(), VulkanError> {
        self.sums.write(self.last_sums())?;
        self.invalid.write(self.last_invalid())?;
        match self.mode {
            SplatMode::Fixed => self.splats.write(self.last_splats()),
            _ => self.splats.clear(),
        }
    }

    /// Returns the parts of a readback that belong to each of three buffers.
    fn split_readback<'a>(from: &'a Readback, buffers: [&Buffer; 3]) -> [&'a [u8]; 3] {
        let mut rest = from.bytes();
        buffers.map(|buffer| {
            let (part, after) = rest.split_at(buffer.size as usize);
            rest = after;
            part
        })
    }

    fn last_parts(&self) -> [&[u8]; 3] {
        DeviceFilms::split_readback(&self.last, [&self.sums, &self.splats, &self.invalid])
    }

    fn last_sums(&self) -> &[u8] {
        self.last_parts()[0]
    }

    fn last_splats(&self) -> &[u8] {
        self.last_parts()[1]
    }

    fn last_invalid(&self) -> &[u8] {
        self.last_parts()[2]
    }

    /// Writes the sums of the picture into `film`.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn picture(&self, film: &mut Film) -> Result<(), VulkanError> {
        let (pixels, samples) = (film.sum.len(), film.samples);
        // Uses all threads, since the device may be waiting.
        let both = film
            .sum
            .par_iter_mut()
            .zip(&mut film.sum2)
            .with_min_len(PIXELS_PER_TASK);
        let rows = self.last_sums().par_chunks_exact(size_of::<SampleSums>());
        both.zip(rows)
            .for_each(|((sum, sum2), row)| (*sum, *sum2) = sums_of(row));
        if let Some(read) = self.read_times(pixels)? {
            read.make_picture(film);
        } else if self.mode != SplatMode::None {
            let splats_at = self.splats_of_last();
            let both = film
                .sum
                .par_iter_mut()
                .zip(&mut film.sum2)
                .with_min_len(PIXELS_PER_TASK);
            both.enumerate().for_each(|(i, (sum, sum2))| {
                (*sum, *sum2) = combine_sums(splats_at(i), (*sum, *sum2), samples)
            });
        }
        Ok(())
    }

    fn read_times(&self, pixels: usize) -> Result<Option<TimeReadback>, VulkanError> {
        let splats = self.mode != SplatMode::None && self.times.slots() > 1;
        let slots = 0..pixels * self.times.slots();
        self.times.read(
            pixels,
            splats.then(|| slots.map(self.splats_of_last()).collect()),
        )
    }

    /// Returns the time-resolved film, or `None` without a time axis.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn times(&self, samples: u64) -> Result<Option<TimeCube>, VulkanError> {
        let pixels = self.resolution[0] as usize * self.resolution[1] as usize;
        Ok(self
            .read_times(pixels)?
            .map(|read| read.cube(self.resolution, samples)))
    }

    /// Returns the sums of film `index` of the layers, which has some of its own.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn layer(&self, index: usize, samples: u64) -> Result<Film, VulkanError> {
        let mut film = Film {
            samples,
            ..Film::new(self.resolution[0], self.resolution[1])
        };
        let (pixels, films) = (film.sum.len(), self.layout.summed().len());
        self.readback.fetch(&[&self.layer_sums])?;
        let rows = self.readback.bytes().chunks_exact(size_of::<SampleSums>());
        for (i, row) in rows.skip(index).step_by(films).take(pixels).enumerate() {
            (film.sum[i], film.sum2[i]) = sums_of(row);
        }
        if self.mode != SplatMode::None && self.layout.films()[index].splats {
            let splat_films = self
                .layout
                .films()
                .iter()
                .filter(|film| film.splats)
                .count();
            let slot = self.layout.films()[..index]
                .iter()
                .filter(|film| film.splats)
                .count();
            let (splats_at, first) = (self.splats_of_last(), pixels * self.times.slots() + slot);
            for i in 0..pixels {
                let splats = splats_at(first + i * splat_films);
                let own = (film.sum[i], film.sum2[i]);
                (film.sum[i], film.sum2[i]) = combine_sums(splats, own, samples);
            }
        }
        Ok(film)
    }

    /// Returns all buffers whose contents persist from wave to wave.
    fn persistent(&self) -> [&Buffer; 5] {
        [
            &self.sums,
            &self.invalid,
            &self.layer_sums,
            &self.splats,
            &self.times.sums,
        ]
    }

    /// Returns their contents at the end of the last wave.
    fn state(&self) -> Result<[Cow<'_, [u8]>; 5], VulkanError> {
        // If speculation is allowed, these two are placeholders.
        let live = |buffer: &Buffer| match self.allows_speculation() {
            true => Ok(Cow::Owned(vec![0; buffer.size as usize])),
            false => buffer.read(buffer.size as usize).map(Cow::Owned),
        };
        let splats = match self.mode {
            SplatMode::Fixed => Cow::Borrowed(self.last_splats()),
            _ => Cow::Owned(vec![0; self.splats.size as usize]),
        };
        let [sums, invalid] = [self.last_sums(), self.last_invalid()].map(Cow::Borrowed);
        Ok([
            sums,
            invalid,
            live(&self.layer_sums)?,
            splats,
            live(&self.times.sums)?,
        ])
    }

    /// Writes the state that further waves need.
    ///
    /// # Errors
    /// Returns an error if the device fails, or any error of the writer.
    pub fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        write_u64s(to, [self.mode as u64])?;
        for bytes in self.state().map_err(io::Error::other)? {
            write_u64s(to, [bytes.len() as u64])?;
            to.write_all(&bytes)?;
        }
        self.splats_so_far
            .iter()
            .try_for_each(|(sum, squares)| write_sums(to, &[*sum, *squares]))
    }

    /// Restores the state that films of the same kind wrote; after an error these films must not be
    /// used.
    ///
    /// # Errors
    /// Returns an error if the state does not match or the device fails.
    pub fn restore(&mut self, from: &mut StateReader<'_>) -> Result<(), RestoreError> {
        if from.read_u64()? != self.mode as u64 {
            return Err(RestoreError::CheckpointMismatch(CheckpointMismatch));
        }
        for buffer in self.persistent() {
            if from.read_u64()? != buffer.size {
                return Err(RestoreError::CheckpointMismatch(CheckpointMismatch));
            }
            buffer.write(from.read_bytes(buffer.size)?)?;
        }
        for (sum, squares) in &mut self.splats_so_far {
            let mut both = [[0.0; 3]; 2];
            from.read_sums(&mut both)?;
            [*sum, *squares] = both;
        }
        Ok(self
            .last
            .fetch(&[&self.sums, &self.splats, &self.invalid])?)
    }

    /// Returns a function from slots to splat sums at the end of the last wave. There must be
    /// splats.
    fn splats_of_last(&self) -> impl Fn(usize) -> SplatMoments + Sync + '_ {
        let (bytes, splats_so_far, fixed) = (
            self.last_splats(),
            &self.splats_so_far[..],
            self.mode == SplatMode::Fixed,
        );
        move |slot: usize| {
            if !fixed {
                return splats_so_far[slot];
            }
            let words: [[u32; 4]; 6] = bytemuck::pod_read_unaligned(&bytes[slot * 96..][..96]);
            let [a, b, c, d, e, f] = words;
            (
                [a, b, c].map(sum_from_words),
                [d, e, f].map(squares_from_words),
            )
        }
    }
}

/// Returns the sums and the sums of squares in a row.
fn sums_of(row: &[u8]) -> ([f64; 3], [f64; 3]) {
    let s: SampleSums = bytemuck::pod_read_unaligned(row);
    let both =
        |sum: [f32; 3], rest: [f32; 3]| [0, 1, 2].map(|c| f64::from(sum[c]) + f64::from(rest[c]));
    (both(s.sum, s.sum_rest), both(s.sum2, s.sum2_rest))
}
