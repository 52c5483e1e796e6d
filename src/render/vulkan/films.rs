//! The films of a run on the device, and their copies here: of all that goes on from wave to wave there is a copy in host memory
//! as it was at the end of a wave, so that the device may go on with the next one while this one is looked at, saved, or, where
//! the next is not wanted, put back.

use std::borrow::Cow;
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
    /// Splats of the waves so far, where the device starts every wave from zero; by slot.
    landed: Vec<Landed>,
    /// Sums, splats and refused samples, at the end of a wave.
    last: Readback,
    /// Sums of layers.
    readback: Readback,
    /// What two submissions have counted, the earlier of which is read while the later one runs.
    counted: [Readback; 2],
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
        let sums = Buffer::zeros(device, "sums of pixels", row * pixels)?;
        let invalid = Buffer::zeros(device, "refused samples", size_of::<Invalid>() as u64 * pixels)?;
        let splats = Buffer::zeros(device, "splats", mode.bytes() * slots)?;
        let counted = || Readback::new(device, size_of::<Counters>() as u64);
        let made = Films {
            last: Readback::new(device, sums.size + splats.size + invalid.size)?,
            sums,
            invalid,
            counters: Buffer::zeros(device, "counters", size_of::<Counters>() as u64)?,
            splats,
            layer_sums: Buffer::zeros(device, "sums of layers", row * pixels * films)?,
            layer_values: Buffer::zeros(device, "values of layers", 12 * pixels * films)?,
            steps: Buffer::zeros(device, "steps of samples", size_of::<PathStep>() as u64 * step_rows)?,
            landed: if mode == SplatMode::Float { vec![Landed::default(); slots as usize] } else { Vec::new() },
            readback: Readback::new(device, row * pixels * films)?,
            counted: [counted()?, counted()?],
            times,
            mode,
            layout,
            resolution,
        };
        made.last.fetch(&[&made.sums, &made.splats, &made.invalid])?;
        Ok(made)
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

    /// Whether the device may go on while the last wave is looked at. Not with layers or a time axis, which are as large as the
    /// device holds and are not copied: what asks for them asks the device.
    pub fn may_go_on(&self) -> bool {
        self.layout.films().is_empty() && self.times.is_empty()
    }

    /// Records that the counters start from zero, once what came before is done.
    pub fn start_counting(&self, device: &Device, commands: vk::CommandBuffer) {
        let copies = vk::PipelineStageFlags::TRANSFER;
        let both = vk::AccessFlags::TRANSFER_READ | vk::AccessFlags::TRANSFER_WRITE;
        device.barrier(commands, (copies, both), (copies, both));
        // SAFETY: the commands are being recorded.
        unsafe { device.raw.cmd_fill_buffer(commands, self.counters.raw, 0, vk::WHOLE_SIZE, 0) };
        device.barrier_to_shaders(commands);
    }

    /// Records that the counters are copied here, to one of two places.
    pub fn stop_counting(&self, device: &Device, commands: vk::CommandBuffer, place: usize) {
        device.barrier_to_copy(commands);
        self.counted[place % 2].record(commands, &[&self.counters]);
    }

    /// What was counted there, once the commands are done.
    pub fn counted(&self, place: usize) -> Counters {
        bytemuck::pod_read_unaligned(&self.counted[place % 2].bytes()[..size_of::<Counters>()])
    }

    /// The sample, row and column of the first refused sample, of all waves.
    pub fn first_invalid(&self) -> Option<[u64; 3]> {
        let width = self.resolution[0] as usize;
        let rows = self.last_invalid().chunks_exact(size_of::<Invalid>()).map(bytemuck::pod_read_unaligned);
        let place = |(i, row): (usize, Invalid)| {
            let sample = u64::from(row.first[1]) << 32 | u64::from(row.first[0]);
            (row.count > 0).then_some([sample, (i / width) as u64, (i % width) as u64])
        };
        rows.enumerate().filter_map(place).min()
    }

    /// Records the end of a wave: what goes on to the next is copied here, and splats that the device cannot keep start from
    /// zero.
    pub fn record_end(&self, device: &Device, commands: vk::CommandBuffer) {
        device.barrier_to_copy(commands);
        self.last.record(commands, &[&self.sums, &self.splats, &self.invalid]);
        if self.mode == SplatMode::Float {
            let copies = vk::PipelineStageFlags::TRANSFER;
            device.barrier(
                commands,
                (copies, vk::AccessFlags::TRANSFER_READ),
                (copies, vk::AccessFlags::TRANSFER_WRITE),
            );
            // SAFETY: the commands are being recorded, and the buffer may be filled.
            unsafe { device.raw.cmd_fill_buffer(commands, self.splats.raw, 0, vk::WHOLE_SIZE, 0) };
        }
    }

    /// Ends a wave, once its commands are done: adds what the device does not keep.
    pub fn end_wave(&mut self) {
        if self.mode == SplatMode::Float {
            let [_, splats, _] = Films::parts(&self.last, [&self.sums, &self.splats, &self.invalid]);
            let waves = splats.par_chunks_exact(size_of::<[f32; 6]>());
            self.landed.par_iter_mut().zip(waves).with_min_len(TOGETHER).for_each(|(landed, words)| {
                let wave: [f32; 6] = bytemuck::pod_read_unaligned(words);
                for c in 0..3 {
                    landed.0[c] += f64::from(wave[c]);
                    landed.1[c] += f64::from(wave[3 + c]);
                }
            });
        }
    }

    /// Makes the device's sums those of the end of the last wave again.
    ///
    /// # Errors
    /// When the device fails.
    pub fn take_back(&self) -> Result<(), VulkanError> {
        self.sums.write(self.last_sums())?;
        self.invalid.write(self.last_invalid())?;
        match self.mode {
            SplatMode::Fixed => self.splats.write(self.last_splats()),
            _ => self.splats.clear(),
        }
    }

    /// What was copied of each of some buffers.
    fn parts<'a>(from: &'a Readback, buffers: [&Buffer; 3]) -> [&'a [u8]; 3] {
        let mut rest = from.bytes();
        buffers.map(|buffer| {
            let (part, after) = rest.split_at(buffer.size as usize);
            rest = after;
            part
        })
    }

    fn last_parts(&self) -> [&[u8]; 3] {
        Films::parts(&self.last, [&self.sums, &self.splats, &self.invalid])
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
    /// When the device fails.
    pub fn picture(&self, film: &mut Film) -> Result<(), VulkanError> {
        let (pixels, samples) = (film.sum.len(), film.samples);
        // The device may wait meanwhile: all threads share the work.
        let both = film.sum.par_iter_mut().zip(&mut film.sum2).with_min_len(TOGETHER);
        let rows = self.last_sums().par_chunks_exact(size_of::<Sums>());
        both.zip(rows).for_each(|((sum, sum2), row)| (*sum, *sum2) = sums_of(row));
        if let Some(read) = self.read_times(pixels)? {
            read.make_picture(film);
        } else if self.mode != SplatMode::None {
            let landed = self.splats_of_last();
            let both = film.sum.par_iter_mut().zip(&mut film.sum2).with_min_len(TOGETHER);
            both.enumerate().for_each(|(i, (sum, sum2))| (*sum, *sum2) = join(landed(i), (*sum, *sum2), samples));
        }
        Ok(())
    }

    fn read_times(&self, pixels: usize) -> Result<Option<Read>, VulkanError> {
        let splats = self.mode != SplatMode::None && self.times.slots() > 1;
        let slots = 0..pixels * self.times.slots();
        self.times.read(pixels, splats.then(|| slots.map(self.splats_of_last()).collect()))
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
        self.readback.fetch(&[&self.layer_sums])?;
        let rows = self.readback.bytes().chunks_exact(size_of::<Sums>());
        for (i, row) in rows.skip(index).step_by(films).take(pixels).enumerate() {
            (film.sum[i], film.sum2[i]) = sums_of(row);
        }
        if self.mode != SplatMode::None && self.layout.films()[index].splats {
            let splat_films = self.layout.films().iter().filter(|film| film.splats).count();
            let slot = self.layout.films()[..index].iter().filter(|film| film.splats).count();
            let (landed, first) = (self.splats_of_last(), pixels * self.times.slots() + slot);
            for i in 0..pixels {
                let landed = landed(first + i * splat_films);
                (film.sum[i], film.sum2[i]) = join(landed, (film.sum[i], film.sum2[i]), samples);
            }
        }
        Ok(film)
    }

    /// Everything that is kept from wave to wave.
    fn kept(&self) -> [&Buffer; 5] {
        [&self.sums, &self.invalid, &self.layer_sums, &self.splats, &self.times.sums]
    }

    /// What of it further waves need at the end of the last one.
    fn state(&self) -> Result<[Cow<'_, [u8]>; 5], VulkanError> {
        // Where the device may have gone on these are nothing but something to bind.
        let live = |buffer: &Buffer| match self.may_go_on() {
            true => Ok(Cow::Owned(vec![0; buffer.size as usize])),
            false => buffer.read(buffer.size as usize).map(Cow::Owned),
        };
        let splats = match self.mode {
            SplatMode::Fixed => Cow::Borrowed(self.last_splats()),
            _ => Cow::Owned(vec![0; self.splats.size as usize]),
        };
        let [sums, invalid] = [self.last_sums(), self.last_invalid()].map(Cow::Borrowed);
        Ok([sums, invalid, live(&self.layer_sums)?, splats, live(&self.times.sums)?])
    }

    /// Writes everything that further waves need.
    ///
    /// # Errors
    /// When the device fails, or as `to`.
    pub fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        write_words(to, [self.mode as u64])?;
        for bytes in self.state().map_err(io::Error::other)? {
            write_words(to, [bytes.len() as u64])?;
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
        Ok(self.last.fetch(&[&self.sums, &self.splats, &self.invalid])?)
    }

    /// The sums of splats by slot, at the end of the last wave. Whoever asks knows that there are any.
    fn splats_of_last(&self) -> impl Fn(usize) -> Landed + Sync + '_ {
        let (bytes, landed, fixed) = (self.last_splats(), &self.landed[..], self.mode == SplatMode::Fixed);
        move |slot: usize| {
            if !fixed {
                return landed[slot];
            }
            let words: [[u32; 4]; 6] = bytemuck::pod_read_unaligned(&bytes[slot * 96..][..96]);
            let [a, b, c, d, e, f] = words;
            ([a, b, c].map(sum_of_words), [d, e, f].map(squares_of_words))
        }
    }
}

/// The sums in a row, and the sums of squares.
fn sums_of(row: &[u8]) -> ([f64; 3], [f64; 3]) {
    let s: Sums = bytemuck::pod_read_unaligned(row);
    let both = |sum: [f32; 3], rest: [f32; 3]| [0, 1, 2].map(|c| f64::from(sum[c]) + f64::from(rest[c]));
    (both(s.sum, s.sum_rest), both(s.sum2, s.sum2_rest))
}
