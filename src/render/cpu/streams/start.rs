//! How the paths of a tile begin: camera rays in lanes.

use super::{Record, SPECULAR};
use crate::math::lanes::{AnyWidth, Lanes, Row, Width};
use crate::math::real::{Vector, Word};
use crate::render::Job;
use crate::render::cpu::brought::Named;
use crate::transport::camera::Camera;
use crate::transport::sampler::Independent;

/// Appends a record of each sample, named by its column and index, of row `y`: what its sampler and the camera make of it.
pub(super) fn begin(width: Width, job: &Job, camera: &Camera, y: u32, named: &[Named], records: &mut Vec<Record>) {
    width.run(Begin { job, camera, y, named, records });
}

struct Begin<'a> {
    job: &'a Job,
    camera: &'a Camera,
    y: u32,
    named: &'a [Named],
    records: &'a mut Vec<Record>,
}

impl AnyWidth for Begin<'_> {
    type Out = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.named.chunks(N) {
            let mut places = [Row::default(); N];
            for (row, (x, sample)) in places.iter_mut().zip(group) {
                let [a, b, c, d] = Independent::place(self.job.seed, [*x, self.y], *sample).map(f32::from_bits);
                row.0 = [a, b, c, d, *x as f32, 0.0, 0.0, 0.0];
            }
            begin_lanes::<R, N>(self.camera, self.y, &places, group.len(), self.records);
        }
    }
}

#[inline(always)]
fn begin_lanes<R: Lanes<N>, const N: usize>(
    camera: &Camera,
    y: u32,
    places: &[Row; N],
    count: usize,
    records: &mut Vec<Record>,
) {
    let (zero, one) = (R::of(0.0), R::of(1.0));
    let [a, b, c, d, x, ..] = R::transposed(places.each_ref());
    let (key, [u, v, s, t]) = Independent::first_four([a.bits(), b.bits(), c.bits(), d.bits()]);
    let [o, dir]: [R::Vec3; 2] = camera.ray([x, R::of(y as f32)], [u, v], [s, t]);
    let way = R::stored([o.x(), o.y(), o.z(), dir.x(), dir.y(), dir.z(), one, one]);
    let [a, b, c, d] = [key[0].as_bits(), key[1].as_bits(), key[2].as_bits(), key[3].as_bits()];
    let keys = R::stored([zero, zero, zero, zero, a, b, c, d]);
    let taken = f32::from_bits(if camera.has_lens() { 4 } else { 2 });
    let state = Row([1.0, 0.0, 0.0, 0.0, SPECULAR, 1.0, taken, 0.0]);
    for i in 0..count {
        records.push(Record { rows: [way[i], state, keys[i]] });
    }
}
