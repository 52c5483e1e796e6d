//! Node of 80 bytes with eight compressed children [Ylitie et al. 2017, section 3.1], in the layout
//! that `shaders/trace/bvh.glsl` reads.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3A};

use super::aabb::Aabb;
use super::simd::LANES;

/// Meta data of an inner child less its slot.
const INNER: u8 = 0b0011_1000;

/// Bits of the meta data of a leaf that hold the offset of its first primitive.
const OFFSET: u8 = 0b0001_1111;

/// Number of cells of a node's grid along an axis.
const CELLS: f64 = 255.0;

/// Biased exponent of the cell size 1.
const UNIT_EXPONENT: i32 = 127;

/// Node with up to eight children.
///
/// The box of a child is stored in cells of a grid, which begins at the least corner of the node's
/// box and whose cell sizes are powers of two. It contains the child's true box. A slot without a
/// child has a box that no ray hits.
///
/// Bit 2 of a slot tells whether its child lies at greater x than others, bit 1 the same for y and
/// bit 0 for z. A ray visits inner children in the order of their slots, with the bits of those
/// axes flipped along which it travels in the negative direction. Inner children are adjacent, in
/// the order of their slots, and so are the primitives of all leaves of the node.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PackedNode {
    /// Least corner of the node's box.
    pub origin: [f32; 3],
    /// Exponents of the cell sizes, biased as in a number of single precision.
    pub exponents: [u8; 3],
    /// Mask of the slots with an inner child.
    pub inner: u8,
    /// Index of the first inner child.
    pub first_child: u32,
    /// Index of the first primitive in the tree's list.
    pub first_primitive: u32,
    /// Meta data by slot: 0 without a child; for inner children, 24 plus the slot and bit 5; for
    /// leaves the offset of the first primitive, and in the upper three bits as many ones as the
    /// leaf has primitives.
    pub meta: [u8; LANES],
    /// Cell borders of the children's boxes, by axis, side (least, greatest) and slot.
    pub cells: [[[u8; LANES]; 2]; 3],
}

/// Contents of a slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slot {
    /// The node has no such child.
    Empty,
    /// Node with this index.
    Inner(usize),
    /// Leaf: index of the first primitive in the tree's list, and number of primitives.
    Leaf(usize, usize),
}

impl PackedNode {
    /// Creates a node without children. `aabb` must contain the boxes of all children.
    pub(crate) fn new(aabb: &Aabb, first_child: usize, first_primitive: usize) -> PackedNode {
        PackedNode {
            origin: aabb.min.to_array(),
            exponents: [0, 1, 2].map(|axis| exponent(aabb.min[axis], aabb.max[axis])),
            inner: 0,
            first_child: first_child as u32,
            first_primitive: first_primitive as u32,
            meta: [0; LANES],
            cells: [[[u8::MAX; LANES], [0; LANES]]; 3],
        }
    }

    /// Adds an inner child.
    pub(crate) fn set_inner(&mut self, slot: usize, aabb: &Aabb) {
        self.set_box(slot, aabb);
        self.inner |= 1 << slot;
        self.meta[slot] = INNER + slot as u8;
    }

    /// Adds a leaf of one to three primitives. `offset` is the number of the node's primitives
    /// before it.
    pub(crate) fn set_leaf(&mut self, slot: usize, aabb: &Aabb, offset: usize, count: usize) {
        self.set_box(slot, aabb);
        self.meta[slot] = ((1 << count) - 1) << 5 | offset as u8;
    }

    fn set_box(&mut self, slot: usize, aabb: &Aabb) {
        for axis in 0..3 {
            let (origin, size) = (self.origin[axis], cell_size(self.exponents[axis]));
            let [low, high] = &mut self.cells[axis];
            low[slot] = border_below(aabb.min[axis], origin, size) as u8;
            high[slot] = border_above(aabb.max[axis], origin, size) as u8;
        }
    }

    /// Returns the contents of a slot.
    #[inline]
    pub fn slot(&self, slot: usize) -> Slot {
        let meta = self.meta[slot];
        if meta == 0 {
            Slot::Empty
        } else if self.inner & (1 << slot) != 0 {
            Slot::Inner(child_index(self.first_child, self.inner, slot))
        } else {
            let first = self.first_primitive as usize + usize::from(meta & OFFSET);
            Slot::Leaf(first, (meta >> 5).count_ones() as usize)
        }
    }

    /// Returns the box of the child in a slot, which must not be empty.
    pub fn child_aabb(&self, slot: usize) -> Aabb {
        let corner = |side: usize| {
            let coordinate = |axis: usize| {
                let cells = f64::from(self.cells[axis][side][slot]);
                f64::from(self.origin[axis]) + cells * cell_size(self.exponents[axis])
            };
            Vec3A::from(DVec3::from_array([0, 1, 2].map(coordinate)).as_vec3())
        };
        Aabb::new(corner(0), corner(1))
    }
}

/// Returns the index of the inner child in a slot of a node with the given first inner child and
/// mask of inner children.
#[inline(always)]
pub(crate) fn child_index(first_child: u32, inner: u8, slot: usize) -> usize {
    let before = inner & ((1 << slot) - 1);
    first_child as usize + before.count_ones() as usize
}

/// Returns the cell size of a biased exponent.
fn cell_size(exponent: u8) -> f64 {
    f64::from_bits((u64::from(exponent) + 1023 - UNIT_EXPONENT as u64) << 52)
}

/// Returns the least biased exponent with which the grid from `low` on reaches `high`.
fn exponent(low: f32, high: f32) -> u8 {
    // 256 cells of 2^(e - 8) are longer than a side below 2^e.
    let above = (((f64::from(high) - f64::from(low)).to_bits() >> 52) as i32) - 1022;
    let least = (above - 8 + UNIT_EXPONENT).clamp(1, 253) as u8;
    let reaches = |exponent: u8| border_above(high, low, cell_size(exponent)) <= CELLS;
    if reaches(least) { least } else { least + 1 }
}

/// Returns the number of the last cell border that is not above `x`. The result is exact: where the
/// rounded difference is a border, its rounding error decides.
fn border_below(x: f32, origin: f32, cell_size: f64) -> f64 {
    let (difference, error) = exact_difference(x, origin);
    let cells = difference / cell_size;
    if cells == cells.floor() && error < 0.0 {
        cells - 1.0
    } else {
        cells.floor()
    }
}

/// Returns the number of the first cell border that is not below `x`, as [`border_below`] does.
fn border_above(x: f32, origin: f32, cell_size: f64) -> f64 {
    let (difference, error) = exact_difference(x, origin);
    let cells = difference / cell_size;
    if cells == cells.ceil() && error > 0.0 {
        cells + 1.0
    } else {
        cells.ceil()
    }
}

/// Returns `a - b` rounded to double precision, and what it lacks to the exact difference [Knuth,
/// The Art of Computer Programming, volume 2, section 4.2.2].
fn exact_difference(a: f32, b: f32) -> (f64, f64) {
    let (a, b) = (f64::from(a), f64::from(b));
    let difference = a - b;
    let subtrahend = a - difference;
    let error = (a - (difference + subtrahend)) + (subtrahend - b);
    (difference, error)
}

#[cfg(test)]
mod tests {
    use lumbre_light::math::rng::pcg4d;

    use super::*;

    /// Asserts that the grid over a box contains a child, and wastes less than two cells.
    fn check(node: Aabb, child: Aabb) {
        let mut packed = PackedNode::new(&node, 0, 0);
        packed.set_inner(3, &child);
        let stored = packed.child_aabb(3);
        assert!(stored.contains(&child), "{stored:?} {child:?} in {node:?}");
        for axis in 0..3 {
            // Rounding to single precision may add a unit in the last place.
            let cell = cell_size(packed.exponents[axis])
                + f64::from(node.min[axis].abs().max(node.max[axis].abs())) * 2.4e-7;
            let excess = [
                f64::from(child.min[axis]) - f64::from(stored.min[axis]),
                f64::from(stored.max[axis]) - f64::from(child.max[axis]),
            ];
            assert!(
                excess.iter().all(|e| *e <= cell),
                "{excess:?} {cell} {node:?}"
            );
            let side = f64::from(node.max[axis]) - f64::from(node.min[axis]);
            let cells = side / cell_size(packed.exponents[axis]);
            assert!(
                cells <= CELLS && (cells > 127.0 || packed.exponents[axis] == 1),
                "{node:?}"
            );
        }
    }

    #[test]
    fn boxes_contain_children_of_all_sizes() {
        for i in 0..20_000 {
            let words = [
                pcg4d([i, 0, 1, 2]),
                pcg4d([i, 1, 1, 2]),
                pcg4d([i, 2, 1, 2]),
            ];
            // Finite numbers of random exponents, within the range of coordinates.
            let number = |word: u32| {
                let x = f32::from_bits(word & 0xc7ff_ffff);
                if i % 2 == 0 { x } else { x * 1e-5 + 1e7 }
            };
            let point = |a: usize| Vec3A::from_array([0, 1, 2].map(|axis| number(words[axis][a])));
            let [a, b, c, d] = [point(0), point(1), point(2), point(3)];
            let child = Aabb::from_points(&[a, b]);
            check(Aabb::from_points(&[a, b, c, d]), child);
            check(child, child);
        }
    }

    #[test]
    fn extreme_boxes_are_contained() {
        let cube = |low: f32, high: f32| Aabb::new(Vec3A::splat(low), Vec3A::splat(high));
        let tiny = f32::from_bits(1);
        for whole in [
            cube(0.0, 0.0),
            cube(1.0, 1.0),
            cube(0.0, tiny),
            cube(-1e12, 1e12),
            cube(-1e38, 1e38),
            cube(0.0, 255.0),
            cube(0.0, 255.5),
            cube(-1e10, 1.0 + f32::EPSILON),
        ] {
            check(whole, whole);
            check(whole, Aabb::new(whole.min, whole.min));
            check(whole, Aabb::new(whole.max, whole.max));
        }
        // The difference to the origin is no number of double precision.
        let node = cube(-67_108_864.0 * 128.0, 1.0 + f32::EPSILON);
        check(node, cube(1.0 + f32::EPSILON, 1.0 + f32::EPSILON));
        check(node, cube(-f32::MIN_POSITIVE, f32::MIN_POSITIVE));
    }

    #[test]
    fn slots_keep_their_contents() {
        let cube = Aabb::new(Vec3A::ZERO, Vec3A::ONE);
        let mut node = PackedNode::new(&cube, 100, 200);
        node.set_inner(1, &cube);
        node.set_leaf(2, &cube, 0, 3);
        node.set_inner(6, &cube);
        node.set_leaf(7, &cube, 20, 1);
        let slots: Vec<Slot> = (0..LANES).map(|slot| node.slot(slot)).collect();
        let empty = Slot::Empty;
        let expected = [
            empty,
            Slot::Inner(100),
            Slot::Leaf(200, 3),
            empty,
            empty,
            empty,
            Slot::Inner(101),
            Slot::Leaf(220, 1),
        ];
        assert_eq!(slots, expected);
        assert_eq!((node.meta[1], node.meta[6]), (0b0011_1001, 0b0011_1110));
        assert_eq!(size_of::<PackedNode>(), 80);
    }
}
