//! Generates the camera rays of a tile, one sample per lane. Sampler keys, random numbers and rays
//! have the bits of the scalar path.

use super::sampler_from_row;
use crate::Job;
use crate::cpu::films::contributions::SampleId;
use lumbre_light::math::real::{Vector, Word};
use lumbre_light::math::simd::{F32x8, Lanes, SimdKernel, Width, dispatch};
use lumbre_light::transport::camera::Camera;
use lumbre_light::transport::sampler::{Sampler, independent};

/// Start of a camera path, in three rows of eight numbers.
///
/// Row 0: origin and direction of the ray, and 1 twice. Row 1: number of random numbers drawn, in
/// column 6. Row 2: key of the sampler, in columns 4 to 7.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub(super) struct CameraRecord {
    pub rows: [F32x8; 3],
}

impl CameraRecord {
    /// Returns the sampler after the numbers of the camera ray.
    pub fn sampler(&self) -> Sampler {
        sampler_from_row(&self.rows[2], self.rows[1].0[6].to_bits())
    }
}

/// Appends the initial record of each given sample of row `y`: its camera ray, the key of its
/// sampler, and a throughput of 1.
pub(super) fn generate(
    width: Width,
    job: &Job,
    camera: &Camera,
    y: u32,
    ids: &[SampleId],
    records: &mut Vec<CameraRecord>,
) {
    dispatch(
        width,
        CameraRays {
            job,
            camera,
            y,
            ids,
            records,
        },
    );
}

/// Kernel of [`generate`].
struct CameraRays<'a> {
    job: &'a Job,
    camera: &'a Camera,
    y: u32,
    ids: &'a [SampleId],
    records: &'a mut Vec<CameraRecord>,
}

impl SimdKernel for CameraRays<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.ids.chunks(N) {
            let mut inputs = [F32x8::default(); N];
            for (row, (x, sample)) in inputs.iter_mut().zip(group) {
                let [a, b, c, d] = independent::key_input(
                    self.job.seed,
                    [*x, self.y],
                    [*sample as u32, (*sample >> 32) as u32],
                )
                .map(f32::from_bits);
                row.0 = [a, b, c, d, *x as f32, 0.0, 0.0, 0.0];
            }
            generate_lanes::<R, N>(self.camera, self.y, &inputs, group.len(), self.records);
        }
    }
}

/// Appends the records of the first `count` lanes. `inputs` holds the input of the sampler key and
/// the column of each sample.
#[inline(always)]
fn generate_lanes<R: Lanes<N>, const N: usize>(
    camera: &Camera,
    y: u32,
    inputs: &[F32x8; N],
    count: usize,
    records: &mut Vec<CameraRecord>,
) {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let [a, b, c, d, x, ..] = R::transpose_load(inputs.each_ref());
    let (key, [u, v, s, t]) = independent::first_four([a.bits(), b.bits(), c.bits(), d.bits()]);
    let [o, dir]: [R::Vec3; 2] = camera.ray([x, R::splat(y as f32)], [u, v], [s, t]);
    let rays = R::transpose_store([o.x(), o.y(), o.z(), dir.x(), dir.y(), dir.z(), one, one]);
    let [a, b, c, d] = [
        key[0].bits_to_float(),
        key[1].bits_to_float(),
        key[2].bits_to_float(),
        key[3].bits_to_float(),
    ];
    let keys = R::transpose_store([zero, zero, zero, zero, a, b, c, d]);
    let taken = f32::from_bits(if camera.has_lens() { 4 } else { 2 });
    let initial = F32x8([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, taken, 0.0]);
    for i in 0..count {
        records.push(CameraRecord {
            rows: [rays[i], initial, keys[i]],
        });
    }
}
