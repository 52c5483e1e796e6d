//! Axis-aligned bounding boxes.

use glam::Vec3A;

/// Axis-aligned bounding box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least coordinates of the box.
    pub min: Vec3A,
    /// Greatest coordinates of the box.
    pub max: Vec3A,
}

impl Aabb {
    /// Creates a box from its least and greatest corner.
    #[inline]
    pub fn new(min: Vec3A, max: Vec3A) -> Aabb {
        Aabb { min, max }
    }

    /// Returns the box that contains nothing: the neutral element of [`Aabb::union`].
    #[inline]
    pub fn empty() -> Aabb {
        Aabb {
            min: Vec3A::INFINITY,
            max: Vec3A::NEG_INFINITY,
        }
    }

    /// Returns the bounding box of points.
    #[inline]
    pub fn from_points(points: &[Vec3A]) -> Aabb {
        points.iter().fold(Aabb::empty(), |all, p| Aabb {
            min: all.min.min(*p),
            max: all.max.max(*p),
        })
    }

    /// Returns the bounding box of both boxes.
    #[inline]
    pub fn union(&self, other: &Aabb) -> Aabb {
        Aabb {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Returns the centre. It does not overflow for finite corners.
    #[inline]
    pub fn center(&self) -> Vec3A {
        self.min * 0.5 + self.max * 0.5
    }

    /// Returns half of the surface area of a box that is not empty. Sides are limited to the
    /// largest finite number, so the area of a finite box may be infinite but is never NaN.
    #[inline]
    pub fn half_area(&self) -> f32 {
        let size = (self.max - self.min).min(Vec3A::splat(f32::MAX));
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// Returns whether this box contains another one.
    #[inline]
    pub fn contains(&self, other: &Aabb) -> bool {
        self.min.cmple(other.min).all() && other.max.cmple(self.max).all()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_never_nan() {
        let far = Vec3A::splat(f32::MAX);
        let flat = |axis: usize| {
            let mut high = far;
            high[axis] = -f32::MAX;
            Aabb::new(-far, high)
        };
        assert_eq!(Aabb::new(-far, far).half_area(), f32::INFINITY);
        for axis in 0..3 {
            assert_eq!(flat(axis).half_area(), f32::INFINITY);
        }
        let line = Aabb::new(-far, Vec3A::new(f32::MAX, -f32::MAX, -f32::MAX));
        assert_eq!(line.half_area(), 0.0);
        assert_eq!(Aabb::new(-far, far).center(), Vec3A::ZERO);
        let unit = Aabb::new(Vec3A::ZERO, Vec3A::new(1.0, 2.0, 3.0));
        assert_eq!(unit.half_area(), 11.0);
    }

    #[test]
    fn a_union_contains_both_boxes() {
        let [a, b] = [0.0, 5.0].map(|x| Aabb::new(Vec3A::splat(x), Vec3A::splat(x + 1.0)));
        let both = a.union(&b);
        assert!(both.contains(&a) && both.contains(&b) && !a.contains(&both));
        assert_eq!(a.union(&Aabb::empty()), a);
        assert_eq!(Aabb::from_points(&[a.min, b.max]), both);
    }
}
