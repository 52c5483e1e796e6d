//! Structs that shaders write, and the parameters of a dispatch.

use lumbre_render::WaveStats;

super::gpu_structs! {
    /// Sums of a pixel's own samples. Each sum is `sum + rest`, where `rest` collects rounding
    /// errors.
    pub struct SampleSums {
        /// Sum of the samples.
        sum: [f32; 3],
        /// Its rounding error.
        sum_rest: [f32; 3],
        /// Sum of the squared samples.
        sum2: [f32; 3],
        /// Its rounding error.
        sum2_rest: [f32; 3],
    }

    /// Sums of a pixel's own samples in one slot of its time axis.
    pub struct SlotSums {
        /// Sum of the samples.
        sum: [f32; 3],
        /// Its rounding error.
        sum_rest: [f32; 3],
        /// Sum of the squared samples.
        square: [f32; 3],
    }

    /// Invalid samples of a pixel.
    pub struct Invalid {
        /// Number of its samples and of their splats that were refused.
        count: u32,
        /// Low and high word of the index of the first such sample.
        first: [u32; 2],
    }

    /// Result of a sample that is an invocation of its own, until it is added to its pixel.
    pub struct SampleValue {
        /// Light for its own pixel.
        value: [f32; 3],
        /// Number of its contributions that were refused.
        refused: u32,
        /// Number of its rays.
        rays: u32,
    }

    /// Counters of the dispatches of one submission.
    pub struct Counters {
        /// Low and high word of the number of rays.
        rays: [u32; 2],
        /// Number of samples and splats that were refused.
        invalid: u32,
    }

    /// Event of a sample, as `render::path_trace::PathEvent`.
    pub struct PathStep {
        /// STEP_CLOSEST, STEP_SHADOW or STEP_LIGHT; 0 if there is none.
        kind: u32,
        /// Primitive that was hit, or NONE; for a shadow ray 1 if it was occluded, else 0.
        met: u32,
        /// Origin of the ray.
        origin: [f32; 3],
        /// Direction of the ray.
        dir: [f32; 3],
        /// Distance up to which it is traced.
        t_max: f32,
        /// Distance of the hit.
        t: f32,
        /// Barycentric weights of the hit.
        uv: [f32; 2],
        /// Column and row of the pixel that receives light.
        pixel: [u32; 2],
        /// Contribution with its weight.
        value: [f32; 3],
        /// Contribution without its weight.
        unweighted: [f32; 3],
        /// Number of vertices of the light subpath.
        light_vertices: u32,
        /// Number of vertices of the camera subpath.
        camera_vertices: u32,
        /// Optical length of the path; 0 without a time axis.
        optical_length: f32,
    }

    /// Parameters of a dispatch, as push constants. Of light subpaths it traces `samples` in all, whose
    /// random numbers are those of the pixel in column and row `first_row`.
    pub struct WaveParams {
        /// Low and high word of the first sample's index.
        first_sample: [u32; 2],
        /// Number of samples of every pixel.
        samples: u32,
        /// First row of pixels.
        first_row: u32,
        /// Number of rows of pixels.
        rows: u32,
        /// Step of `light_list.comp`.
        step: u32,
    }
}

impl WaveParams {
    /// Returns the parameters of `samples` samples of every pixel of `rows` rows, from the sample with
    /// index `first` and the row `first_row` on.
    pub fn new(first: u64, samples: u32, first_row: u32, rows: u32) -> WaveParams {
        WaveParams {
            first_sample: [first as u32, (first >> 32) as u32],
            samples,
            first_row,
            rows,
            step: 0,
        }
    }

    /// Splits the samples into parts of at most `max`, in order; at least one part.
    pub fn parts(self, max: u32) -> impl Iterator<Item = WaveParams> {
        let [low, high] = self.first_sample.map(u64::from);
        let starts = (0..self.samples.max(1)).step_by(max.max(1) as usize);
        starts.map(move |start| {
            let first = (high << 32 | low) + u64::from(start);
            let samples = (self.samples - start).min(max);
            WaveParams::new(first, samples, self.first_row, self.rows)
        })
    }
}

/// Adds the counters of a submission to the statistics of its wave.
pub fn add_counters(counted: &Counters, stats: &mut WaveStats) {
    stats.rays += u64::from(counted.rays[1]) << 32 | u64::from(counted.rays[0]);
    stats.invalid += u64::from(counted.invalid);
}

#[cfg(test)]
mod tests {
    use lumbre_render::WaveStats;

    use super::{Counters, WaveParams, add_counters};

    #[test]
    fn counts_of_rays_have_64_bits() {
        let mut stats = WaveStats {
            rays: 5,
            invalid: 1,
            ..WaveStats::default()
        };
        let counted = Counters {
            rays: [7, 3],
            invalid: 2,
        };
        add_counters(&counted, &mut stats);
        assert_eq!((stats.rays, stats.invalid), ((3 << 32) + 12, 3));
    }

    #[test]
    fn parts_of_a_dispatch_have_its_samples_in_order() {
        let wave = |first_sample, samples| WaveParams {
            first_sample,
            samples,
            first_row: 3,
            rows: 2,
            step: 0,
        };
        let found: Vec<WaveParams> = wave([u32::MAX, 6], 5).parts(2).collect();
        assert_eq!(
            found,
            [wave([u32::MAX, 6], 2), wave([1, 7], 2), wave([3, 7], 1)]
        );
        let found: Vec<WaveParams> = wave([0; 2], 0).parts(2).collect();
        assert_eq!(found, [wave([0; 2], 0)], "an empty dispatch is a part");
    }
}
