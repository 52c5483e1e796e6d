//! How the paths of a tile begin: camera rays in lanes.

use super::{Record, SPECULAR, stored};
use crate::math::lanes::{LANES, Reals, Row, Vectors, transposed};
use crate::math::real::{Real, Vector, Word};
use crate::render::Job;
use crate::transport::camera::Camera;
use crate::transport::sampler::Independent;

/// Appends a record of each sample, named by its column and index, of row `y`: what its sampler and the camera make of it.
pub(super) fn begin(job: &Job, camera: &Camera, y: u32, named: &[(u32, u64)], records: &mut Vec<Record>) {
    #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
    // SAFETY: streams are made only where the processor has AVX2.
    unsafe {
        begin_avx2(job, camera, y, named, records);
    }
}

#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn begin_avx2(job: &Job, camera: &Camera, y: u32, named: &[(u32, u64)], records: &mut Vec<Record>) {
    for group in named.chunks(LANES) {
        let mut places = [Row::default(); LANES];
        for (row, (x, sample)) in places.iter_mut().zip(group) {
            let [a, b, c, d] = Independent::place(job.seed, [*x, y], *sample).map(f32::from_bits);
            row.0 = [a, b, c, d, *x as f32, 0.0, 0.0, 0.0];
        }
        begin_eight(camera, y, &places, group.len(), records);
    }
}

#[inline(always)]
fn begin_eight(camera: &Camera, y: u32, places: &[Row; LANES], count: usize, records: &mut Vec<Record>) {
    let (zero, one) = (Reals::of(0.0), Reals::of(1.0));
    let [a, b, c, d, x, ..] = transposed(places.each_ref());
    let (key, [u, v, s, t]) = Independent::first_four([a.bits(), b.bits(), c.bits(), d.bits()]);
    let [o, dir]: [Vectors; 2] = camera.ray([x, Reals::of(y as f32)], [u, v], [s, t]);
    let way = stored([o.x(), o.y(), o.z(), dir.x(), dir.y(), dir.z(), one, one]);
    let [a, b, c, d] = [key[0].as_bits(), key[1].as_bits(), key[2].as_bits(), key[3].as_bits()];
    let keys = stored([zero, zero, zero, zero, a, b, c, d]);
    let taken = f32::from_bits(if camera.has_lens() { 4 } else { 2 });
    let state = Row([1.0, 0.0, 0.0, 0.0, SPECULAR, 1.0, taken, 0.0]);
    for i in 0..count {
        records.push(Record { rows: [way[i], state, keys[i]] });
    }
}
