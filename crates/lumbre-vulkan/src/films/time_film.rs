//! Films with a time axis in device memory.

use std::sync::Arc;

use crate::context::device::Device;
use crate::error::{VulkanError, mib};
use crate::layout::SlotSums;
use crate::memory::buffer::Buffer;
use lumbre_light::film::Film;
use lumbre_light::film::fixed_point::combine_sums;
use lumbre_light::film::time::{TimeAxis, TimeCube, sum_slots};

/// Splat sums of one film at one pixel: three sums, three sums of squares.
pub type SplatMoments = ([f64; 3], [f64; 3]);

/// Device memory per pixel and slot in bytes: its sums, and the contribution of the current sample.
/// Splats add 24 bytes, or 96 in fixed point.
pub const BYTES_PER_SLOT: u64 = size_of::<SlotSums>() as u64 + 12;

/// Sums of a film with a time axis. Without one the buffers are placeholders for the bindings.
pub struct DeviceTimeFilm {
    axis: Option<TimeAxis>,
    /// Sums of samples, `[pixel][slot]`.
    pub sums: Buffer,
    /// Contributions of the current samples, `[pixel][slot]`.
    pub values: Buffer,
}

impl DeviceTimeFilm {
    /// Creates a film without samples.
    ///
    /// # Errors
    /// Returns an error if the slots do not fit into one storage buffer or the device's memory.
    pub fn new(
        device: &Arc<Device>,
        axis: Option<TimeAxis>,
        pixels: u64,
        splat_bytes: u64,
    ) -> Result<DeviceTimeFilm, VulkanError> {
        let slots = axis.map_or(0, |axis| pixels.saturating_mul(axis.slots() as u64));
        let row = size_of::<SlotSums>() as u64;
        let (storage_range, free) = (device.info.limits.storage_range, device.info.memory_left());
        let all = slots.saturating_mul(BYTES_PER_SLOT + splat_bytes);
        let largest = slots.saturating_mul(row.max(splat_bytes));
        for (needed, found, remedy) in [
            (
                largest,
                storage_range,
                "one storage buffer must hold the sums of all pixels and bins: use fewer or wider \
                 bins, or a lower resolution",
            ),
            (
                all,
                free,
                "the device must hold the sums of all pixels and bins: use fewer or wider bins, \
                 or a lower resolution",
            ),
        ] {
            if axis.is_some() && needed > found {
                let (device, what) = (
                    device.info.line(),
                    format!("the time axis of {slots} slots"),
                );
                return Err(VulkanError::TooLarge {
                    device,
                    what,
                    needed_mib: mib(needed),
                    found_mib: mib(found),
                    remedy,
                });
            }
        }
        Ok(DeviceTimeFilm {
            axis,
            sums: Buffer::zeros(device, "time bin sums", row * slots)?,
            values: Buffer::zeros(device, "time bin values", 12 * slots)?,
        })
    }

    /// Returns whether there is no time axis.
    pub fn is_empty(&self) -> bool {
        self.axis.is_none()
    }

    /// Returns the number of splat slots of a pixel; 1 without a time axis.
    pub fn slots(&self) -> usize {
        self.axis.map_or(1, |axis| axis.slots())
    }

    /// Reads all sums from the device, combined with the splats of every slot; `None` without a
    /// time axis.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn read(
        &self,
        pixels: usize,
        splats: Option<Vec<SplatMoments>>,
    ) -> Result<Option<TimeReadback>, VulkanError> {
        let Some(axis) = self.axis else {
            return Ok(None);
        };
        Ok(Some(TimeReadback {
            axis,
            own: self.sums.read(pixels * axis.slots())?,
            splats,
        }))
    }
}

/// Sums read from a device: own samples and splats, `[pixel][slot]`.
pub struct TimeReadback {
    axis: TimeAxis,
    own: Vec<SlotSums>,
    splats: Option<Vec<SplatMoments>>,
}

impl TimeReadback {
    /// Returns the sum and sum of squares of a slot.
    fn slot(&self, i: usize, samples: u64) -> ([f64; 3], [f32; 3]) {
        let SlotSums {
            sum,
            sum_rest,
            square,
        } = self.own[i];
        let sum = [0, 1, 2].map(|c| f64::from(sum[c]) + f64::from(sum_rest[c]));
        match &self.splats {
            Some(splats) => {
                let (sum, squares) = combine_sums(splats[i], (sum, square.map(f64::from)), samples);
                (sum, squares.map(|q| q as f32))
            }
            None => (sum, square),
        }
    }

    /// Returns the time-resolved film.
    pub fn cube(&self, [width, height]: [u32; 2], samples: u64) -> TimeCube {
        let (sum, square) = (0..self.own.len()).map(|i| self.slot(i, samples)).unzip();
        TimeCube {
            axis: self.axis,
            width,
            height,
            samples,
            sum,
            square,
        }
    }

    /// Replaces the sums of `film`, which are those of own samples, by the sums over the slots in
    /// their order, splats included.
    pub fn make_picture(&self, film: &mut Film) {
        let n = self.axis.slots();
        for i in 0..film.sum.len() {
            if let Some(splats) = &self.splats {
                let mut pixel_splats = SplatMoments::default();
                for (sum, squares) in &splats[i * n..(i + 1) * n] {
                    (0..3).for_each(|c| {
                        pixel_splats.0[c] += sum[c];
                        pixel_splats.1[c] += squares[c];
                    });
                }
                film.sum2[i] =
                    combine_sums(pixel_splats, (film.sum[i], film.sum2[i]), film.samples).1;
            }
            film.sum[i] =
                sum_slots((i * n..(i + 1) * n).map(|slot| self.slot(slot, film.samples).0));
        }
    }
}
