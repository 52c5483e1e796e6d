//! Sorts primitives along the Morton curve.

use glam::DVec3;

use super::build::BuildPrimitive;

/// Number of bits of a Morton code per axis.
const AXIS_BITS: u32 = 21;

/// Number of bits of a digit of the radix sort.
const DIGIT_BITS: u32 = 8;

/// Number of digits of a code.
const DIGITS: usize = (3 * AXIS_BITS).div_ceil(DIGIT_BITS) as usize;

/// Number of values of a digit.
const VALUES: usize = 1 << DIGIT_BITS;

/// Returns the indices of the primitives in the order of the Morton codes of their boxes' centres.
/// Primitives with the same code stay in the order of their indices.
pub(crate) fn morton_order(primitives: &[BuildPrimitive]) -> Vec<u32> {
    let mut items = morton_codes(primitives);
    sort_by_code(&mut items);
    items.into_iter().map(|item| item.index).collect()
}

/// Primitive to be sorted, in 12 bytes.
#[derive(Clone, Copy, Debug, Default)]
struct Item {
    /// Lower and upper half of the Morton code.
    code: [u32; 2],
    index: u32,
}

impl Item {
    fn new(code: u64, index: u32) -> Item {
        Item {
            code: [code as u32, (code >> 32) as u32],
            index,
        }
    }

    fn code(&self) -> u64 {
        u64::from(self.code[1]) << 32 | u64::from(self.code[0])
    }

    fn digit(&self, digit: usize) -> usize {
        (self.code() >> (digit as u32 * DIGIT_BITS)) as usize % VALUES
    }
}

/// Computes the Morton code of each primitive: the cell of its box's centre in a grid of cubes. The
/// grid covers the bounding box of all centres and is computed in double precision, so that it does
/// not overflow. Cubes give trees of less cost than cells with the proportions of the scene.
fn morton_codes(primitives: &[BuildPrimitive]) -> Vec<Item> {
    let center = |p: &BuildPrimitive| p.aabb.center().as_dvec3();
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = primitives
        .iter()
        .map(center)
        .fold(start, |(low, high), c| (low.min(c), high.max(c)));
    let size = (high - low).max_element();
    let cells = f64::from(1u32 << AXIS_BITS) - 1.0;
    let scale = if size > 0.0 { cells / size } else { 0.0 };
    let item = |(p, index): (&BuildPrimitive, u32)| {
        let cell = (center(p) - low) * scale;
        let [x, y, z] = cell.to_array().map(|c| spread(c as u64));
        Item::new(x << 2 | y << 1 | z, index)
    };
    primitives.iter().zip(0..).map(item).collect()
}

/// Inserts two zero bits after each of the lower 21 bits.
fn spread(x: u64) -> u64 {
    let mut x = x & ((1 << AXIS_BITS) - 1);
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Sorts by code with a stable radix sort, least significant digit first. Digits that all codes
/// share are skipped.
fn sort_by_code(items: &mut Vec<Item>) {
    let mut counts = [[0u32; VALUES]; DIGITS];
    for item in items.iter() {
        for (digit, counts) in counts.iter_mut().enumerate() {
            counts[item.digit(digit)] += 1;
        }
    }
    let mut sorted = vec![Item::default(); items.len()];
    for (digit, places) in counts.iter_mut().enumerate() {
        if places.contains(&(items.len() as u32)) {
            continue;
        }
        let mut start = 0;
        for place in places.iter_mut() {
            start += std::mem::replace(place, start);
        }
        for item in items.iter() {
            let place = &mut places[item.digit(digit)];
            sorted[*place as usize] = *item;
            *place += 1;
        }
        std::mem::swap(items, &mut sorted);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::*;
    use crate::cpu::bvh::test_primitives::random_boxes;

    #[test]
    fn bits_are_spread_and_codes_are_interleaved() {
        let naive = |x: u64| (0..21).fold(0, |all, bit| all | (x >> bit & 1) << (3 * bit));
        for x in [0, 1, 2, 0x15_5555, 0x1f_ffff, 0x0c_0ffe] {
            assert_eq!(spread(x), naive(x), "{x:x}");
        }
        let corner = |x: f32, y: f32, z: f32| {
            let p = Vec3A::new(x, y, z);
            BuildPrimitive::from_box(p, p)
        };
        let corners = [
            corner(1.0, 1.0, 1.0),
            corner(0.0, 0.0, 1.0),
            corner(0.0, 0.0, 0.0),
        ];
        let codes: Vec<u64> = morton_codes(&corners).iter().map(Item::code).collect();
        assert_eq!(codes, [(1 << 63) - 1, spread(0x1f_ffff), 0]);
    }

    #[test]
    fn the_sort_is_stable_and_agrees_with_the_standard_library() {
        for count in [1, 2, 77, 5000] {
            let mut primitives = random_boxes(count, 7);
            primitives.extend_from_within(..count / 2);
            let items = morton_codes(&primitives);
            let mut expected: Vec<u32> = (0..primitives.len() as u32).collect();
            expected.sort_by_key(|i| items[*i as usize].code());
            assert_eq!(morton_order(&primitives), expected);
        }
    }

    #[test]
    fn primitives_at_one_point_or_far_apart_keep_their_order() {
        let point = |x: f32| BuildPrimitive::from_box(Vec3A::splat(x), Vec3A::splat(x));
        assert_eq!(morton_order(&[point(3.0); 4]), [0, 1, 2, 3]);
        let far = [point(f32::MAX), point(0.0), point(-f32::MAX)];
        assert_eq!(morton_order(&far), [2, 1, 0]);
    }
}
