//! Evaluates the listed mergings of a tile, one pair of vertices per lane.

use super::connect::Connecting;
use super::pending::{OwnContributions, VertexPair};
use super::stored::{store_colors, stored_light};
use lumbre_light::math::real::{Double, Mask};
use lumbre_light::math::simd::{Lanes, SimdKernel, active_lanes, map_array, padded};
use lumbre_light::transport::integrator::bdpt::directions::SubpathDirections;
use lumbre_light::transport::integrator::bdpt::merge::{Merged, Merging};

/// Kernel that evaluates the pairs to merge, listed by class of the camera vertex, and empties the
/// lists.
pub(super) struct MergeKernel<'a, D> {
    pub connecting: &'a Connecting<'a, D>,
    pub merging: &'a Merging<'a>,
    pub lists: &'a mut [Vec<VertexPair>],
    pub own: &'a mut OwnContributions,
}

impl<D: SubpathDirections> SimdKernel for MergeKernel<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let MergeKernel {
            connecting,
            merging,
            lists,
            own,
        } = self;
        for (class, pairs) in lists.iter_mut().enumerate() {
            for group in pairs.chunks(N) {
                connecting.merge::<R, N>(merging, class, group, own);
            }
            pairs.clear();
        }
    }
}

impl<D: SubpathDirections> Connecting<'_, D> {
    /// Merges light vertices with camera vertices on surfaces of one class.
    #[inline(always)]
    fn merge<R: Lanes<N>, const N: usize>(
        &self,
        merging: &Merging,
        class: usize,
        group: &[VertexPair],
        own: &mut OwnContributions,
    ) {
        let pairs: [VertexPair; N] = padded(group);
        let context = self.tile.context;
        let camera = &self.vertices.camera.store;
        let z = camera.load::<R, N>(context, class, map_array(pairs, |pair| pair.z));
        let (y, partials) = merging.light_vertices::<R, N>(map_array(pairs, |pair| pair.y));
        let lanes = R::Mask::first(group.len());
        let Some(merged) = Merged::new::<N>(context, merging, (&y, partials), &z, lanes) else {
            return;
        };
        let unweighted = merged.unweighted;
        let rows = store_colors::<R, N>([unweighted * merged.weight.single(), unweighted]);
        let lengths = R::store_doubles(merged.length);
        for i in active_lanes(merged.lanes.bits()) {
            let [value, unweighted] = stored_light(&rows[i]);
            own.set(pairs[i].index, value, unweighted, lengths[i]);
        }
    }
}
