//! Edges between two vertices of a path: conversion of densities between measures, and shadow rays
//! between surfaces.

use glam::Vec3;

use super::ray::{Ray, Trace, offset_origin};
use crate::math::real::{Real, Vector};

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

/// Returns whether nothing lies between two surface points.
///
/// Both ends are moved off their surfaces towards each other, so that neither surface hides the
/// other point. A point without a surface has the normal zero.
#[inline]
pub fn visible(trace: &dyn Trace, from: Vec3, n_from: Vec3, to: Vec3, n_to: Vec3) -> bool {
    let edge = to - from;
    let origin = offset_origin(from, towards(n_from, edge));
    let target = offset_origin(to, towards(n_to, -edge));
    let edge = target - origin;
    let distance = edge.length();
    if distance <= 0.0 {
        return true;
    }
    !trace.occluded(
        &Ray {
            origin,
            dir: edge / distance,
        },
        distance,
    )
}

/// Returns a ray from a surface point in the unit direction `dir`, started off the surface on the
/// side of `dir`.
#[inline]
pub fn spawn_ray(from: Vec3, n: Vec3, dir: Vec3) -> Ray {
    Ray {
        origin: offset_origin(from, towards(n, dir)),
        dir,
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
    use crate::scene::compile::NONE;
    use crate::transport::ray::Hit;

    /// The plane z = 0.
    struct Plane;

    impl Trace for Plane {
        fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
            let t = -ray.origin.z / ray.dir.z;
            (t > 0.0 && t < t_max).then_some(Hit {
                t,
                primitive: 0,
                instance: NONE,
                uv: [0.0; 2],
            })
        }

        fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
            self.closest(ray, t_max).is_some()
        }
    }

    #[test]
    fn a_surface_does_not_hide_its_own_points_but_what_is_behind_it() {
        let above = Vec3::new(3.0, -2.0, 5.0);
        let on = Vec3::new(100.0, 50.0, 0.0);
        assert!(visible(&Plane, above, Vec3::X, on, Vec3::Z));
        assert!(visible(&Plane, on, -Vec3::Z, above, Vec3::ZERO));
        assert!(!visible(&Plane, above, Vec3::X, -above, Vec3::X));
    }

    #[test]
    fn area_of_a_cap_seen_from_its_centre_and_from_an_angle() {
        assert!((area_factor(Vec3::ZERO, Vec3::Z * 2.0, -Vec3::Z) - 0.25).abs() < 1e-7);
        assert!(
            (area_factor(Vec3::ZERO, Vec3::new(3.0, 0.0, 4.0), Vec3::Z) - 0.8 / 25.0).abs() < 1e-7
        );
        assert_eq!(area_factor(Vec3::X, Vec3::X, Vec3::Z), 0.0);
    }
}
