//! Traversal of compressed eight-wide trees on the CPU [Ylitie et al. 2017, section 4], for
//! comparison with the default tree. Boxes are tested eight at a time and primitives one at a time.
//! Instances are not supported; the scene must be flattened.

use lumbre_light::transport::ray::Ray;

use super::packed::{CwBvh, CwBvhNode, child_range};
use super::simd::{LANES, Simd8};
use super::slabs::nonzero_inverse;

/// Greatest number of levels of nodes that fit the traversal stack.
pub(crate) const MAX_LEVELS: usize = 64;

/// Bound on the rounding errors of a box test, relative to the distances to the begin and the size
/// of the grid. The errors are up to 3 times 2^-24 each, one of them in the grid itself, and one of
/// 2^-24 relative to their sum.
const GRID_SLACK: f32 = 4e-7;

/// Children of a node that are still to be visited.
#[derive(Clone, Copy, Default)]
struct Group {
    /// Index of the first inner child of the node.
    first_child: u32,
    /// Mask of the slots with an inner child.
    inner: u8,
    /// Mask of the slots that are still to be visited, permuted to the order of visits.
    visits: u8,
}

/// Calls `test` with the index of each primitive whose box the ray may hit before `limit`. `test`
/// returns `None` without a hit, and otherwise the new limit. With `ANY` the first hit ends the
/// search. The tree must have at most [`MAX_LEVELS`] levels.
#[inline(always)]
pub(crate) fn traverse<L: Simd8, const ANY: bool>(
    tree: &CwBvh,
    ray: &Ray,
    mut limit: f32,
    mut test: impl FnMut(u32) -> Option<f32>,
) {
    if tree.nodes.is_empty() {
        return;
    }
    let grid_ray = GridRay::new(ray);
    let mut stack = [Group::default(); MAX_LEVELS];
    let mut depth = 0;
    let mut current = 0;
    loop {
        let node = &tree.nodes[current];
        let hits = grid_ray.intersect::<L>(node, limit);
        let mut leaves = hits & !u32::from(node.imask);
        while leaves != 0 {
            let slot = leaves.trailing_zeros() as usize % LANES;
            leaves &= leaves - 1;
            for primitive in &tree.primitive_indices[child_range(node, slot)] {
                if let Some(t) = test(*primitive) {
                    limit = t;
                    if ANY {
                        return;
                    }
                }
            }
        }
        let mut group = Group {
            first_child: node.child_base_idx,
            inner: node.imask,
            visits: grid_ray.in_order(hits as u8 & node.imask),
        };
        if group.visits == 0 {
            if depth == 0 {
                return;
            }
            depth -= 1;
            group = stack[depth];
        }
        let slot = group.visits.trailing_zeros() as usize ^ grid_ray.flip;
        group.visits &= group.visits - 1;
        if group.visits != 0 {
            stack[depth] = group;
            depth += 1;
        }
        let before = group.inner & ((1 << (slot % LANES)) - 1);
        current = group.first_child as usize + before.count_ones() as usize;
    }
}

/// Ray with the precomputed values of the box test.
struct GridRay {
    origin: [f32; 3],
    inverse: [f32; 3],
    /// Side of a box that the ray meets first on each axis: 0 for the least, 1 for the greatest.
    first: [usize; 3],
    /// Bits of slots that are flipped in the order of visits.
    flip: usize,
}

impl GridRay {
    #[inline(always)]
    fn new(ray: &Ray) -> GridRay {
        let inverse = [
            nonzero_inverse(ray.dir.x),
            nonzero_inverse(ray.dir.y),
            nonzero_inverse(ray.dir.z),
        ];
        let first = [
            usize::from(inverse[0] < 0.0),
            usize::from(inverse[1] < 0.0),
            usize::from(inverse[2] < 0.0),
        ];
        GridRay {
            origin: ray.origin.to_array(),
            inverse,
            first,
            flip: first[0] << 2 | first[1] << 1 | first[2],
        }
    }

    /// Returns a mask of the slots whose boxes the ray may hit before `limit`.
    #[inline(always)]
    fn intersect<L: Simd8>(&self, node: &CwBvhNode, limit: f32) -> u32 {
        // No closures or maps here: code that is not inlined is not compiled for the caller's
        // instruction set.
        let (mut near, mut far) = (L::splat(0.0), L::splat(limit));
        // From the fifth on: the least and greatest cell borders of all children, by axis.
        let rows: &[[u8; LANES]; 10] = bytemuck::cast_ref(node);
        for axis in 0..3 {
            let cell_size = f32::from_bits(u32::from(node.e[axis]) << 23);
            let scale = cell_size * self.inverse[axis];
            let start = (node.p[axis] - self.origin[axis]) * self.inverse[axis];
            let slack = GRID_SLACK * (start.abs() + 255.0 * scale.abs());
            let first = self.first[axis];
            let enter = L::from_bytes(&rows[4 + 2 * axis + first]).mul(L::splat(scale));
            let leave = L::from_bytes(&rows[5 + 2 * axis - first]).mul(L::splat(scale));
            near = near.max(enter.add(L::splat(start - slack)));
            far = far.min(leave.add(L::splat(start + slack)));
        }
        near.le(far)
    }

    /// Permutes a mask of slots to the order of visits: bit 0 is the slot that is visited first.
    #[inline(always)]
    fn in_order(&self, slots: u8) -> u8 {
        VISITS[self.flip][usize::from(slots)]
    }
}

/// Masks of slots in the order of visits, by the bits of slots that are flipped.
const VISITS: [[u8; 1 << LANES]; LANES] = {
    let mut visits = [[0; 1 << LANES]; LANES];
    let mut flip = 0;
    while flip < LANES {
        let mut mask = 0;
        while mask < 1 << LANES {
            let mut slot = 0;
            while slot < LANES {
                visits[flip][mask] |= ((mask >> slot & 1) << (slot ^ flip)) as u8;
                slot += 1;
            }
            mask += 1;
        }
        flip += 1;
    }
    visits
};

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use lumbre_light::math::rng::{pcg4d, unit};

    use super::*;
    use crate::cpu::bvh::build_primitive::BuildPrimitive;
    use crate::cpu::bvh::intersect;
    use crate::cpu::bvh::intersect::ShearedRay;
    use crate::cpu::bvh::packed::build_packed;
    use crate::cpu::bvh::simd::Portable;
    use crate::cpu::bvh::test_primitives::random_triangles;
    use crate::hierarchy::AccelSpec;

    /// Returns a ray through the unit cube. Every fourth one is parallel to an axis.
    fn random_ray(i: u32) -> Ray {
        let [a, b, c, d] = pcg4d([i, 1, 2, 3]).map(unit::<u32>);
        let [e, f, ..] = pcg4d([i, 4, 5, 6]).map(unit::<u32>);
        let origin = Vec3::new(a, b, c) * 3.0 - 1.0;
        let axes = [Vec3::X, Vec3::NEG_Y, Vec3::Z];
        let dir = if i.is_multiple_of(4) {
            axes[i as usize / 4 % 3]
        } else {
            (Vec3::new(d, e, f) - origin).normalize_or(Vec3::Z)
        };
        Ray { origin, dir }
    }

    #[test]
    fn the_nearest_hit_is_that_of_brute_force() {
        let mut hits = 0;
        for (count, seed) in [(1, 1), (2, 1), (9, 2), (100, 3), (3000, 4)] {
            let triangles = random_triangles(count, seed);
            let boxes: Vec<_> = triangles.iter().map(BuildPrimitive::triangle).collect();
            let tree = build_packed(&AccelSpec::default(), &[], &boxes, 8);
            for i in 0..2000 {
                let ray = random_ray(i);
                let sheared = ShearedRay::new(&ray);
                let distance = |p: u32| {
                    let hit = intersect::triangle(&triangles[p as usize], &sheared, f32::INFINITY);
                    hit.map(|(t, _)| t)
                };
                let all = (0..count as u32).filter_map(&distance);
                let expected = all.fold(f32::INFINITY, f32::min);
                let mut found = f32::INFINITY;
                traverse::<Portable, false>(&tree, &ray, f32::INFINITY, |p| {
                    found = found.min(distance(p)?);
                    Some(found)
                });
                assert_eq!(found, expected, "{count} {ray:?}");
                let mut tested = 0;
                traverse::<Portable, true>(&tree, &ray, f32::INFINITY, |p| {
                    tested += 1;
                    distance(p)
                });
                assert!(tested > 0 || expected == f32::INFINITY, "{count} {ray:?}");
                hits += usize::from(expected < f32::INFINITY);
            }
        }
        assert!(hits > 1000, "{hits}");
    }

    #[test]
    fn children_are_visited_along_the_ray() {
        // Eight cubes, one in each octant.
        let boxes: Vec<_> = (0..8u8)
            .map(|i| {
                let bit = |axis: u8| f32::from(i >> axis & 1) * 2.0;
                let low = Vec3::new(bit(2), bit(1), bit(0)).into();
                BuildPrimitive::from_box(low, low + 1.0)
            })
            .collect();
        let tree = build_packed(&AccelSpec::default(), &[], &boxes, 1);
        assert_eq!(tree.nodes.len(), 1);
        for slot in 0..LANES {
            let primitives = child_range(&tree.nodes[0], slot);
            assert_eq!(tree.primitive_indices[primitives], [slot as u32]);
        }
        for flip in 0..LANES {
            let sign = |bit: usize| if flip >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let ray = GridRay::new(&Ray {
                origin: Vec3::ZERO,
                dir: Vec3::new(sign(2), sign(1), sign(0)),
            });
            // The first child along the ray lies at the lesser side of each axis, as seen by it.
            assert_eq!(ray.in_order(1 << flip), 1);
            assert_eq!(ray.in_order(1 << (7 - flip)), 1 << 7);
            assert_eq!(ray.in_order(0xff), 0xff);
        }
    }

    #[test]
    fn an_empty_tree_has_no_hits() {
        let tree = build_packed(&AccelSpec::default(), &[], &[], 8);
        traverse::<Portable, false>(&tree, &random_ray(1), 1.0, |_| panic!("no primitives"));
    }
}
