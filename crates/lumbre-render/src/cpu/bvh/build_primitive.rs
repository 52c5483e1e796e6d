//! Primitives as builders of trees see them, and the leaves that refer to them.

use std::ops::Range;

use glam::{Vec3, Vec3A};
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::node::Bvh2Node;

/// Box and centroid of a primitive: the input of the builders.
#[derive(Clone, Copy, Debug)]
pub struct BuildPrimitive {
    /// Bounding box of the primitive.
    pub aabb: Aabb,
    /// Point that decides on which side of a split the primitive lies: the mean of a triangle's
    /// corners, or the centre of the box of any other primitive.
    pub centroid: Vec3A,
}

impl BuildPrimitive {
    /// Creates the box and centroid of a triangle.
    pub fn triangle(corners: &[Vec3; 3]) -> BuildPrimitive {
        let corners = corners.map(Vec3A::from);
        let centroid = (corners[0] + corners[1] + corners[2]) / 3.0;
        BuildPrimitive {
            aabb: Aabb::from_points(&corners),
            centroid,
        }
    }

    /// Creates the box and centroid of a primitive from the least and greatest corner of its box.
    pub fn from_box(low: Vec3A, high: Vec3A) -> BuildPrimitive {
        BuildPrimitive {
            aabb: Aabb::new(low, high),
            centroid: low + (high - low) * 0.5,
        }
    }
}

impl Boundable for BuildPrimitive {
    #[inline]
    fn aabb(&self) -> Aabb {
        self.aabb
    }
}

/// Returns the range of the indices of the primitives that a leaf refers to.
pub(crate) fn range(leaf: &Bvh2Node) -> Range<usize> {
    leaf.first_index as usize..(leaf.first_index + leaf.prim_count) as usize
}
