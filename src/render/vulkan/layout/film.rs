//! What shaders write, and which samples they are to add.

super::gpu_structs! {
    /// Sums of a pixel's own samples. Each sum is `sum + rest`, where `rest` gathers what rounding took.
    pub struct Sums {
        /// Sum.
        sum: [f32; 3],
        /// What rounding took from it.
        sum_rest: [f32; 3],
        /// Sum of squares.
        sum2: [f32; 3],
        /// What rounding took from it.
        sum2_rest: [f32; 3],
    }

    /// Sums of a pixel's own samples in one slot of its time axis.
    pub struct TimeSums {
        /// Sum.
        sum: [f32; 3],
        /// What rounding took from it.
        sum_rest: [f32; 3],
        /// Sum of squares.
        square: [f32; 3],
    }

    /// What else a pixel's samples leave.
    pub struct Invalid {
        /// How many of its samples and of their splats were refused.
        count: u32,
        /// Low and high word of the index of the first such sample.
        first: [u32; 2],
    }

    /// What the dispatches of one submission count.
    pub struct Counters {
        /// Low and high word of the number of rays.
        rays: [u32; 2],
        /// Samples and splats that were refused.
        invalid: u32,
    }

    /// A step of a sample, as `render::paths::Step`.
    pub struct PathStep {
        /// STEP_CLOSEST, STEP_SHADOW or STEP_LIGHT; 0 where there is none.
        kind: u32,
        /// The primitive that was met, or NONE; of a shadow ray 1 if it was blocked, else 0.
        met: u32,
        /// Where the ray starts.
        origin: [f32; 3],
        /// Where it goes.
        dir: [f32; 3],
        /// How far it is followed.
        t_max: f32,
        /// How far it came.
        t: f32,
        /// Barycentric weights of what it met.
        uv: [f32; 2],
        /// Column and row that light is for.
        pixel: [u32; 2],
        /// The light.
        value: [f32; 3],
        /// The same without its weight.
        unweighted: [f32; 3],
        /// Vertices found from the light.
        light_vertices: u32,
        /// Vertices found from the camera.
        camera_vertices: u32,
        /// When the light arrives, as an optical length; 0 without a time axis.
        optical_length: f32,
    }

    /// Which samples a dispatch adds, as push constants.
    pub struct Wave {
        /// Low and high word of the first sample's index.
        first_sample: [u32; 2],
        /// How many samples of every pixel.
        samples: u32,
        /// The first row of pixels.
        first_row: u32,
        /// The number of rows.
        rows: u32,
    }
}
