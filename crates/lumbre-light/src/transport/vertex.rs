//! Edges between two vertices of a path: conversion of densities between measures, and ends off
//! their surfaces.

use glam::Vec3;

use super::ray::{NEAR_ORIGIN, offset_origin};
use crate::math::real::{Real, Vector};
use crate::scene::CompiledScene;

/// Returns the factor from a density per solid angle at `from` to one per area at `to`, where the
/// unit normal is `n_to`: `|cos| / distance^2` [Veach 1997, 8.2.2.2]. Zero if the points coincide.
#[inline(always)]
pub fn area_factor<V: Vector>(from: V, to: V, n_to: V) -> V::Scalar {
    let zero = V::Scalar::splat(0.0);
    let edge = to - from;
    let d2 = edge.length_squared();
    V::Scalar::select(d2.gt(zero), edge.dot(n_to).abs() / (d2 * d2.sqrt()), zero)
}

/// Returns the [`area_factor`]s of both directions of an edge: from `from` at `to`, and from `to`
/// at `from`. Both are NaN if the points coincide.
#[inline(always)]
pub fn area_factors<V: Vector>([from, n_from]: [V; 2], [to, n_to]: [V; 2]) -> [V::Scalar; 2] {
    let edge = to - from;
    let d2 = edge.length_squared();
    let scale = V::Scalar::splat(1.0) / (d2 * d2.sqrt());
    [edge.dot(n_to).abs() * scale, edge.dot(n_from).abs() * scale]
}

/// A point at which an edge of a path starts or ends; scalar or vectorised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeEnd<R: Real = f32> {
    /// Position in world space.
    pub position: R::Vec3,
    /// Unit normal of the surface on either side; zero for a point without a surface.
    pub normal: R::Vec3,
    /// Greatest absolute coordinate of the primitive, in scene units, from which the rounding
    /// errors of its points follow, and at least [`least_extent`], as that of points of other
    /// lights; any number for a point without a normal.
    pub extent: R,
}

impl<R: Real> EdgeEnd<R> {
    /// Returns a point without a surface.
    #[inline(always)]
    pub fn free(position: R::Vec3) -> EdgeEnd<R> {
        EdgeEnd {
            position,
            normal: R::Vec3::broadcast(Vec3::ZERO),
            extent: R::splat(0.0),
        }
    }

    /// Returns the point moved off its surface to the side of `dir`, so that the surface does not
    /// hide what is there: see [`offset_origin`].
    #[inline(always)]
    pub fn off_surface(&self, dir: R::Vec3) -> R::Vec3 {
        offset_origin(self.position, towards(self.normal, dir), self.extent)
    }

    /// Returns `yes` where the mask is set, else `no`.
    #[inline(always)]
    pub fn select(mask: R::Mask, yes: Self, no: Self) -> Self {
        EdgeEnd {
            position: R::Vec3::select(mask, yes.position, no.position),
            normal: R::Vec3::select(mask, yes.normal, no.normal),
            extent: R::select(mask, yes.extent, no.extent),
        }
    }
}

/// Returns the greatest absolute coordinate of points: see [`EdgeEnd::extent`].
#[inline(always)]
pub fn greatest_coordinate<V: Vector>(points: &[V]) -> V::Scalar {
    let mut greatest = V::Scalar::splat(0.0);
    for p in points {
        greatest = greatest.max(p.x().abs()).max(p.y().abs()).max(p.z().abs());
    }
    greatest
}

/// Returns the least extent that points of lights and surfaces have for [`offset_origin`], in scene
/// units: the scene's greatest absolute coordinate, so that small primitives in a scene of usual size
/// keep the fixed step near the origin. A scene without bounds counts as one of usual size.
#[inline(always)]
pub fn least_extent(scene: &CompiledScene) -> f32 {
    let greatest = greatest_coordinate(&scene.bounds);
    if greatest > 0.0 {
        greatest.min(NEAR_ORIGIN)
    } else {
        NEAR_ORIGIN
    }
}

/// Returns the normal flipped to the side of `dir`.
#[inline(always)]
pub fn towards<V: Vector>(n: V, dir: V) -> V {
    V::select(n.dot(dir).lt(V::Scalar::splat(0.0)), -n, n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn area_of_a_cap_seen_from_its_centre_and_from_an_angle() {
        assert!((area_factor(Vec3::ZERO, Vec3::Z * 2.0, -Vec3::Z) - 0.25).abs() < 1e-7);
        assert!(
            (area_factor(Vec3::ZERO, Vec3::new(3.0, 0.0, 4.0), Vec3::Z) - 0.8 / 25.0).abs() < 1e-7
        );
        assert_eq!(area_factor(Vec3::X, Vec3::X, Vec3::Z), 0.0);
    }
}
