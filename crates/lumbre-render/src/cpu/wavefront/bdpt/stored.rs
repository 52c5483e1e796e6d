//! Light of paths in memory, in rows of vectors.

use glam::Vec3;

use lumbre_light::math::real::{Double, Vector};
use lumbre_light::math::simd::{F32x8, Lanes};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::connect::Connection;

/// Stores the weighted and the unweighted light of connections in rows, which [`stored_light`]
/// reads. Each is one of `count` samples of its strategy.
#[inline(always)]
pub(super) fn store_light<R: Lanes<N>, const N: usize>(
    context: &Context,
    c: &Connection<R, N>,
    count: f64,
) -> [F32x8; N] {
    let black = R::Vec3::broadcast(Vec3::ZERO);
    let unweighted = c.share(count);
    let value = unweighted * c.weight(context.settings, count).single();
    let v = R::Vec3::select(c.found, value, black);
    let u = R::Vec3::select(c.found, unweighted, black);
    store_colors::<R, N>([v, u])
}

/// Stores two colours of each lane in rows, which [`stored_light`] reads.
#[inline(always)]
pub(super) fn store_colors<R: Lanes<N>, const N: usize>([v, u]: [R::Vec3; 2]) -> [F32x8; N] {
    let zero = R::splat(0.0);
    R::transpose_store([v.x(), v.y(), v.z(), u.x(), u.y(), u.z(), zero, zero])
}

/// Returns the weighted and the unweighted light from a row of [`store_light`].
#[inline]
pub(super) fn stored_light(row: &F32x8) -> [Vec3; 2] {
    let [r, g, b, x, y, z, ..] = row.0;
    [Vec3::new(r, g, b), Vec3::new(x, y, z)]
}
