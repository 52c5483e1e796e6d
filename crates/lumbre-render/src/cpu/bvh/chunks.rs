//! Adds the tree of any number of primitives, which are divided by place into chunks of a bounded
//! number first: each gets a tree of its own, and a tree above joins these. So construction needs
//! memory for one chunk beside the finished nodes, however many primitives there are.

use glam::{DVec3, Vec3, Vec3A};
use obvhs::aabb::Aabb;

use super::build::{build_binary, build_scene, partition, split_at_median};
use super::build_primitive::BuildPrimitive;
use super::bvh8::{BuildItem, Bvh8, LEAF, TreeRoot};
use crate::hierarchy::{AccelSpec, Builder};

/// Greatest number of primitives of a chunk: smaller ones cost rays more nodes above them.
const CHUNK: usize = 1 << 20;

/// Share of the area of the scene's box from which on a primitive is in a chunk of large ones: among
/// small ones it would enlarge the box of their chunk.
const LARGE: f32 = 1e-3;

/// Primitives of a tree by their index: triangles first, then all others.
pub(crate) struct TreeItems<'a> {
    pub triangles: &'a [[Vec3; 3]],
    /// Boxes of the others.
    pub others: &'a [BuildPrimitive],
    /// Returns what an index refers to.
    pub item: &'a dyn Fn(u32) -> BuildItem,
}

impl TreeItems<'_> {
    /// Returns the number of primitives.
    pub fn len(&self) -> usize {
        self.triangles.len() + self.others.len()
    }

    fn primitive(&self, i: u32) -> BuildPrimitive {
        match (i as usize).checked_sub(self.triangles.len()) {
            None => BuildPrimitive::triangle(&self.triangles[i as usize]),
            Some(other) => self.others[other],
        }
    }

    /// Adds the tree of all primitives, of which there must be some.
    pub fn add_to(&self, bvh8: &mut Bvh8, spec: &AccelSpec) -> TreeRoot {
        // The other builders are there to be studied.
        let most = if spec.builder == Builder::Ploc {
            CHUNK
        } else {
            usize::MAX
        };
        self.add_in_chunks(bvh8, spec, most)
    }

    /// Adds the tree of all primitives in chunks of at most `most`.
    fn add_in_chunks(&self, bvh8: &mut Bvh8, spec: &AccelSpec, most: usize) -> TreeRoot {
        let mut members: Vec<u32> = (0..self.len() as u32).collect();
        let mut chunks = Vec::new();
        let mut work = if self.len() > most {
            self.split_off_large(&mut members).into()
        } else {
            vec![members.as_mut_slice()]
        };
        while let Some(members) = work.pop() {
            if members.is_empty() {
                continue;
            }
            if members.len() <= most {
                members.sort_unstable();
                chunks.push(&*members);
            } else {
                let centroid = |i| self.primitive(i).centroid;
                let axis = widest(members.iter().map(|i| centroid(*i)));
                let middle = split_at_median(axis, centroid, members);
                let (first, second) = members.split_at_mut(middle);
                work.extend([second, first]);
            }
        }
        let (mut roots, mut left) = (Vec::new(), self.len());
        for chunk in chunks {
            let before = [bvh8.nodes.len(), bvh8.blocks.len()];
            roots.push(self.add_chunk(bvh8, spec, chunk));
            left -= chunk.len();
            // Growth would copy all nodes and blocks, so a typical chunk makes room for the rest.
            if 2 * chunk.len() > most {
                let share = left as f32 / chunk.len() as f32 * 1.1;
                let room = |now: usize, before: usize| (share * (now - before) as f32) as usize;
                bvh8.nodes.reserve(room(bvh8.nodes.len(), before[0]));
                bvh8.blocks.reserve(room(bvh8.blocks.len(), before[1]));
            }
        }
        if let [root] = roots[..] {
            return root;
        }
        // The children of the roots are joined instead of the roots: a large primitive would
        // enlarge the box of its whole chunk.
        let trees: Vec<_> = roots.iter().flat_map(|root| opened(bvh8, root)).collect();
        let boxes = trees.iter().map(|(aabb, _)| aabb);
        let boxes: Vec<_> = boxes
            .map(|aabb| BuildPrimitive::from_box(aabb.min, aabb.max))
            .collect();
        let above = bvh8.add_tree(&build_binary(spec, &boxes, 1), &boxes, &|i| {
            trees[i as usize].1
        });
        let below = roots.iter().map(|root| root.levels.saturating_sub(1)).max();
        TreeRoot {
            levels: above.levels + below.unwrap_or(0),
            ..above
        }
    }

    /// Moves the primitives to the front whose box has more than [`LARGE`] of the area of the scene's.
    /// Returns the others and them.
    fn split_off_large<'m>(&self, members: &'m mut [u32]) -> [&'m mut [u32]; 2] {
        let aabb = |i: u32| self.primitive(i).aabb;
        let whole = members
            .iter()
            .fold(Aabb::empty(), |all, i| all.union(&aabb(*i)));
        let least = LARGE * whole.half_area();
        let count = partition(members, |i| aabb(i).half_area() > least);
        let (large, others) = members.split_at_mut(count);
        [others, large]
    }

    /// Adds the tree of some primitives, given their indices in ascending order.
    fn add_chunk(&self, bvh8: &mut Bvh8, spec: &AccelSpec, members: &[u32]) -> TreeRoot {
        let triangles = members.iter().map(|i| *i as usize);
        let triangles = triangles.map_while(|i| self.triangles.get(i).copied());
        let triangles: Vec<[Vec3; 3]> = triangles.collect();
        let primitives: Vec<_> = members.iter().map(|i| self.primitive(*i)).collect();
        let tree = build_scene(spec, &triangles, &primitives, spec.max_leaf);
        bvh8.add_tree(&tree, &primitives, &|i| (self.item)(members[i as usize]))
    }
}

/// Returns the axis along which points scatter most: that of the greatest variance. Outliers, as a
/// lamp above a mesh, hardly change it.
fn widest(points: impl Iterator<Item = Vec3A>) -> usize {
    let (mut count, mut sum, mut squares) = (0.0, DVec3::ZERO, DVec3::ZERO);
    for point in points {
        let point = point.as_dvec3();
        count += 1.0;
        sum += point;
        squares += point * point;
    }
    let variance = squares - sum * sum / count;
    let axis = (0..3).max_by(|a, b| variance[*a].total_cmp(&variance[*b]));
    axis.unwrap_or(2)
}

/// Returns the trees below the root of a tree, or the tree itself if its root is a leaf.
fn opened(bvh8: &Bvh8, root: &TreeRoot) -> Vec<(Aabb, BuildItem)> {
    if root.index & LEAF != 0 {
        return vec![(root.aabb, BuildItem::Tree(root.index, root.cost))];
    }
    let node = &bvh8.nodes[root.index as usize];
    let boxes = node
        .boxes()
        .map(|[low, high]| Aabb::new(low.into(), high.into()));
    let boxes: Vec<Aabb> = boxes.collect();
    let area = |aabb: &Aabb| f64::from(aabb.half_area());
    // All children together cost what the root costs without its own test.
    let cost = (root.cost - 1.0) * area(&root.aabb) / boxes.iter().map(area).sum::<f64>();
    let cost = if cost.is_finite() { cost } else { root.cost };
    let trees = boxes.into_iter().zip(node.child);
    trees
        .map(|(aabb, child)| (aabb, BuildItem::Tree(child, cost)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::bvh::bvh8::Block;
    use lumbre_light::math::rng::{pcg4d, unit};
    use lumbre_light::scene::compile::NONE;

    fn triangles(count: u32) -> Vec<[Vec3; 3]> {
        let point = |i: u32, k: u32| Vec3::from_slice(&pcg4d([i, k, 5, 6]).map(unit));
        let triangle = |i: u32| [0, 1, 2].map(|k| 10.0 * point(i, 9) + point(i, k));
        (0..count).map(triangle).collect()
    }

    /// Passes each block below a child of a node to `visit`, with the boxes of all nodes above it.
    fn visit(
        bvh8: &Bvh8,
        (child, boxes): (u32, &mut Vec<[Vec3; 2]>),
        visit_block: &mut dyn FnMut(&Block, &[[Vec3; 2]]),
    ) {
        if child & LEAF == 0 {
            let node = &bvh8.nodes[child as usize];
            for (corners, child) in node.boxes().zip(node.child) {
                boxes.push(corners);
                visit(bvh8, (child, boxes), visit_block);
                boxes.pop();
            }
            return;
        }
        for block in &bvh8.blocks[(child & !LEAF) as usize..] {
            visit_block(block, boxes);
            if block.last {
                return;
            }
        }
    }

    #[test]
    fn every_primitive_is_in_one_chunk_and_in_the_boxes_above_it() {
        let triangles = triangles(1000);
        let others: Vec<_> = (0..9)
            .map(|i| BuildPrimitive::triangle(&triangles[i]))
            .collect();
        let item = |i: u32| match triangles.get(i as usize) {
            Some(corners) => BuildItem::Triangle(i, *corners),
            None => BuildItem::Sphere(i),
        };
        let items = TreeItems {
            triangles: &triangles,
            others: &others,
            item: &item,
        };
        for most in [1, 7, 64, 400, 2000] {
            let mut bvh8 = Bvh8::default();
            let root = items.add_in_chunks(&mut bvh8, &AccelSpec::default(), most);
            let mut found = vec![0; items.len()];
            visit(&bvh8, (root.index, &mut Vec::new()), &mut |block, boxes| {
                for i in block.primitives.into_iter().filter(|i| *i != NONE) {
                    found[i as usize] += 1;
                    let aabb = items.primitive(i).aabb;
                    let [low, high] = [Vec3::from(aabb.min), Vec3::from(aabb.max)];
                    assert!(
                        boxes
                            .iter()
                            .all(|[l, h]| low.cmpge(*l).all() && high.cmple(*h).all())
                    );
                }
            });
            assert!(found.iter().all(|times| *times == 1), "{most}: {found:?}");
            assert!(root.cost > 1.0 && root.levels < 12, "{most}: {root:?}");
        }
    }
}
