//! Structs that shaders write, and the parameters of a dispatch.

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

    /// Parameters of a dispatch, as push constants.
    pub struct WaveParams {
        /// Low and high word of the first sample's index.
        first_sample: [u32; 2],
        /// Number of samples of every pixel.
        samples: u32,
        /// First row of pixels.
        first_row: u32,
        /// Number of rows of pixels.
        rows: u32,
    }
}
