//! The sums behind a film with a time axis, on the device.

use std::sync::Arc;

use super::buffer::Buffer;
use super::device::Device;
use super::error::{VulkanError, mib};
use super::films::Landed;
use super::layout::TimeSums;
use crate::film::Film;
use crate::film::splat::join;
use crate::film::time::{TimeAxis, TimeCube, total};

/// Bytes on the device for each pixel and slot: its sums, and what the sample in progress brings. Where splats land it is
/// 24 more, or 96 in whole numbers.
pub const BYTES_PER_SLOT: u64 = size_of::<TimeSums>() as u64 + 12;

/// Sums by time; without a time axis nothing but something to bind.
pub struct Times {
    axis: Option<TimeAxis>,
    /// [pixel][slot]
    pub sums: Buffer,
    /// The same places.
    pub values: Buffer,
}

impl Times {
    /// Sums without samples.
    ///
    /// # Errors
    /// When all slots do not fit into one buffer that shaders see, or not onto the device.
    pub fn new(
        device: &Arc<Device>,
        axis: Option<TimeAxis>,
        pixels: u64,
        splat_bytes: u64,
    ) -> Result<Times, VulkanError> {
        let slots = axis.map_or(0, |axis| pixels.saturating_mul(axis.slots() as u64));
        let row = size_of::<TimeSums>() as u64;
        let [most, heap] = [device.info.limits.storage_range, device.info.limits.heap];
        let all = slots.saturating_mul(BYTES_PER_SLOT + splat_bytes);
        let largest = slots.saturating_mul(row.max(splat_bytes));
        for (needed, found, remedy) in [
            (
                largest,
                most,
                "one storage buffer must hold the sums of all pixels and bins: take fewer or wider bins, or a smaller picture",
            ),
            (
                all,
                heap,
                "the device must hold the sums of all pixels and bins: take fewer or wider bins, or a smaller picture",
            ),
        ] {
            if axis.is_some() && needed > found {
                let (device, what) = (device.info.line(), format!("the time axis of {slots} slots"));
                return Err(VulkanError::TooLarge {
                    device,
                    what,
                    needed_mib: mib(needed),
                    found_mib: mib(found),
                    remedy,
                });
            }
        }
        Ok(Times {
            axis,
            sums: Buffer::zeros(device, "sums by time", row * slots)?,
            values: Buffer::zeros(device, "values by time", 12 * slots)?,
        })
    }

    /// Whether there is no time axis.
    pub fn is_empty(&self) -> bool {
        self.axis.is_none()
    }

    /// How many slots a pixel of the picture has where splats are summed.
    pub fn slots(&self) -> usize {
        self.axis.map_or(1, |axis| axis.slots())
    }

    /// All that the device has summed, with the splats of every slot; none without a time axis.
    ///
    /// # Errors
    /// When the device fails.
    pub fn read(&self, pixels: usize, landed: Option<Vec<Landed>>) -> Result<Option<Read>, VulkanError> {
        let Some(axis) = self.axis else { return Ok(None) };
        Ok(Some(Read { axis, own: self.sums.read(pixels * axis.slots())?, landed }))
    }
}

/// What was read from a device: sums of own samples and of splats, `[pixel][slot]`.
pub struct Read {
    axis: TimeAxis,
    own: Vec<TimeSums>,
    landed: Option<Vec<Landed>>,
}

impl Read {
    /// The sums of a slot, and its sums of squares.
    fn slot(&self, i: usize, samples: u64) -> ([f64; 3], [f32; 3]) {
        let TimeSums { sum, sum_rest, square } = self.own[i];
        let sum = [0, 1, 2].map(|c| f64::from(sum[c]) + f64::from(sum_rest[c]));
        match &self.landed {
            Some(landed) => {
                let (sum, squares) = join(landed[i], (sum, square.map(f64::from)), samples);
                (sum, squares.map(|q| q as f32))
            }
            None => (sum, square),
        }
    }

    /// The light of every pixel by its time.
    pub fn cube(&self, [width, height]: [u32; 2], samples: u64) -> TimeCube {
        let (sum, square) = (0..self.own.len()).map(|i| self.slot(i, samples)).unzip();
        TimeCube { axis: self.axis, width, height, samples, sum, square }
    }

    /// Makes the sums of `film`, which are those of own samples, the sums over the slots in their order, splats included.
    pub fn make_picture(&self, film: &mut Film) {
        let n = self.axis.slots();
        for i in 0..film.sum.len() {
            if let Some(landed) = &self.landed {
                let mut here = Landed::default();
                for (sum, squares) in &landed[i * n..(i + 1) * n] {
                    (0..3).for_each(|c| {
                        here.0[c] += sum[c];
                        here.1[c] += squares[c];
                    });
                }
                film.sum2[i] = join(here, (film.sum[i], film.sum2[i]), film.samples).1;
            }
            film.sum[i] = total((i * n..(i + 1) * n).map(|slot| self.slot(slot, film.samples).0));
        }
    }
}
