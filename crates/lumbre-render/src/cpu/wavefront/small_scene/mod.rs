//! Vectorised ray tracing in scenes of few primitives, which have no hierarchy. Each primitive is
//! tested against one ray per lane, whereas [`Accel`] tests one ray against eight primitives. The
//! per-ray setup is computed for all lanes at once, and a corner that triangles share is sheared
//! once.
//!
//! Invariant: hits have the same bits as those of [`Accel`]. The tests are those of
//! [`intersect`](crate::cpu::bvh::intersect), operation by operation, and of hits at the
//! same distance the one with the lesser primitive index counts.
//!
//! Masks are evaluated ray by ray, and only if no other primitive is nearer. Primitives with masks
//! are therefore tested last.

mod mask;
mod nearest;
mod sphere;
#[cfg(test)]
mod tests;
mod triangle;

use std::sync::Arc;

use glam::Vec3;

use crate::cpu::bvh::accel::Accel;
use crate::cpu::bvh::intersect_lanes::{intersect_sheared, load_rays};
use lumbre_light::math::real::{Mask, Vector};
use lumbre_light::math::simd::{Lanes, SimdKernel, Width, active_lanes, dispatch};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::ray::{Hit, Ray};
use nearest::NearestHits;
use sphere::{intersect_sphere, intersect_sphere_twice};
use triangle::{CornerBuffer, ShearedRays, corners_of};

/// Primitives of a small scene, prepared for vectorised tests: at most
/// [`Isa::one_leaf`](crate::cpu::bvh::simd::Isa::one_leaf).
pub struct SmallScene {
    width: Width,
    scene: Arc<CompiledScene>,
    /// Distinct corners of all triangles; corners with the same bits are stored once.
    corners: Vec<Vec3>,
    /// Primitives without masks.
    unmasked: PrimitiveList,
    /// Primitives with masks.
    masked: PrimitiveList,
}

/// List of primitives, each with its index in the scene.
#[derive(Default)]
struct PrimitiveList {
    /// Indices of the corners of every triangle, and its primitive index.
    triangles: Vec<([u8; 3], u32)>,
    /// Centre, radius and primitive index of every sphere.
    spheres: Vec<(Vec3, f32, u32)>,
}

impl SmallScene {
    /// Prepares the scene of a hierarchy that is one leaf; returns `None` for larger scenes and for
    /// those with instances.
    pub fn new_if_small(accel: &Accel, width: Width) -> Option<SmallScene> {
        let scene = &accel.scene;
        let is_small = accel.is_one_leaf()
            && scene.primitive_count() <= accel.isa().one_leaf()
            && scene.instances.placements.is_empty();
        is_small.then(|| SmallScene::new(width, Arc::clone(scene)))
    }

    fn new(width: Width, scene: Arc<CompiledScene>) -> SmallScene {
        let bits = |v: Vec3| v.to_array().map(f32::to_bits);
        let mut corners: Vec<Vec3> = Vec::new();
        let mut index = |corner: Vec3| {
            let known = corners.iter().position(|c| bits(*c) == bits(corner));
            known.unwrap_or_else(|| {
                corners.push(corner);
                corners.len() - 1
            }) as u8
        };
        let (mut unmasked, mut masked) = (PrimitiveList::default(), PrimitiveList::default());
        for id in 0..scene.primitive_count() as u32 {
            let has_mask =
                scene.materials[scene.material_of(id, NONE) as usize].mask_texture != NONE;
            let list = if has_mask { &mut masked } else { &mut unmasked };
            match scene.triangles.get(id as usize) {
                Some(corners) => list.triangles.push((corners.map(&mut index), id)),
                None => {
                    let sphere = &scene.spheres[id as usize - scene.triangles.len()];
                    list.spheres.push((sphere.center, sphere.radius, id));
                }
            }
        }
        SmallScene {
            width,
            scene,
            corners,
            unmasked,
            masked,
        }
    }

    /// Appends the nearest hit of each ray with `0 < t < t_max`, masks applied, to `hits`.
    pub fn closest(&self, rays: &[(Ray, f32)], hits: &mut Vec<Option<Hit>>) {
        dispatch(
            self.width,
            Closest {
                small: self,
                rays,
                hits,
            },
        );
    }

    /// Appends to `occluded` whether each ray hits anything with `0 < t < t_max`, masks applied.
    pub fn occluded(&self, rays: &[(Ray, f32)], occluded: &mut Vec<bool>) {
        dispatch(
            self.width,
            Occluded {
                small: self,
                rays,
                occluded,
            },
        );
    }

    /// Intersects up to one ray per lane. With `ANY` it returns when each has a hit. `sheared` is a
    /// scratch buffer with space for all corners.
    #[inline(always)]
    fn intersect<R: Lanes<N>, const N: usize, const ANY: bool>(
        &self,
        group: &[(Ray, f32)],
        sheared: &mut [[R; 3]],
    ) -> NearestHits<R> {
        let ([x, y, z], [u, v, w], t_max) = load_rays::<R, N>(group);
        let (origin, dir) = (R::Vec3::new(x, y, z), R::Vec3::new(u, v, w));
        // A ray with a non-finite component hits nothing.
        let usable = (origin + dir).element_sum().is_finite() & t_max.gt(R::splat(0.0));
        let mut best = NearestHits::new(R::select(
            R::Mask::first(group.len()) & usable,
            t_max,
            R::splat(-1.0),
        ));
        let rays = ShearedRays::new(origin, dir);
        for (sheared, corner) in sheared.iter_mut().zip(&self.corners) {
            *sheared = rays.corner(R::Vec3::broadcast(*corner));
        }
        for (corners, id) in &self.unmasked.triangles {
            best.update_nearer(
                intersect_sheared::<R, N, false>(corners_of(sheared, *corners)),
                *id,
            );
            if ANY && !best.without_hit().any() {
                return best;
            }
        }
        for (center, radius, id) in &self.unmasked.spheres {
            best.update_nearer(
                intersect_sphere([origin, dir], R::Vec3::broadcast(*center), *radius),
                *id,
            );
        }
        for (corners, id) in &self.masked.triangles {
            self.update_masked::<R, N, ANY>(
                group,
                intersect_sheared::<R, N, false>(corners_of(sheared, *corners)),
                *id,
                &mut best,
            );
            if ANY && !best.without_hit().any() {
                return best;
            }
        }
        for (center, radius, id) in &self.masked.spheres {
            let center = R::Vec3::broadcast(*center);
            for candidate in intersect_sphere_twice([origin, dir], center, *radius) {
                self.update_masked::<R, N, ANY>(group, candidate, *id, &mut best);
            }
        }
        best
    }
}

/// Kernel of [`SmallScene::closest`].
struct Closest<'a> {
    small: &'a SmallScene,
    rays: &'a [(Ray, f32)],
    hits: &'a mut Vec<Option<Hit>>,
}

impl SimdKernel for Closest<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let mut buffer = CornerBuffer::new();
        let sheared = buffer.for_corners(self.small.corners.len());
        for group in self.rays.chunks(N) {
            let best = self.small.intersect::<R, N, false>(group, sheared);
            let (hit_lanes, t, primitives) = (
                best.hit_lanes().bits(),
                best.t.store(),
                best.primitive.store(),
            );
            let (v, w) = (
                (best.v / best.divisor).store(),
                (best.w / best.divisor).store(),
            );
            let mut hits = [None; N];
            for i in active_lanes(hit_lanes) {
                hits[i] = Some(Hit {
                    t: t[i],
                    primitive: primitives[i].to_bits(),
                    instance: NONE,
                    uv: [v[i], w[i]],
                });
            }
            self.hits.extend_from_slice(&hits[..group.len()]);
        }
    }
}

/// Kernel of [`SmallScene::occluded`].
struct Occluded<'a> {
    small: &'a SmallScene,
    rays: &'a [(Ray, f32)],
    occluded: &'a mut Vec<bool>,
}

impl SimdKernel for Occluded<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let mut buffer = CornerBuffer::new();
        let sheared = buffer.for_corners(self.small.corners.len());
        for group in self.rays.chunks(N) {
            let hit_lanes = self
                .small
                .intersect::<R, N, true>(group, sheared)
                .hit_lanes()
                .bits();
            self.occluded
                .extend((0..group.len()).map(|i| hit_lanes & 1 << i != 0));
        }
    }
}
