//! The offset against the shadow terminator.

use glam::Vec3;

use super::{Surface, Triangles};
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::Lanes;
use crate::transport::light::DirectSample;
use crate::transport::ray::{RayHits, offset_origin};

/// An offset of shadow and path rays against the shadow terminator: the hard edge where light
/// arrives from below the triangle's plane but above the tangent plane of the shading normal. The
/// corner normals suggest a smooth surface above the triangle; rays towards such light start from
/// the lifted point on that surface.
///
/// The source lifts every point before it is shaded \[Vives\], so an edge has different ends when it
/// is traced from its other end, and techniques that trace light from both sides disagree. Here the
/// vertices of a path stay in place. Only an edge towards light whose far end lies below the
/// triangle's plane, which could carry nothing otherwise, starts at the lifted point. All
/// techniques agree on that, since
/// - every other edge is the same as without the offset, so far ends above the plane are reached
///   from the base only;
/// - an edge from the lifted point is allowed towards light, at the vertex nearer to the camera,
///   and not the other way;
/// - no technique can find it from its far end by chance, so that this density is zero in all
///   weights.
///
/// The remaining bias is intended: a surface is lit where its triangles would hide the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TerminatorOffset<R: Real = f32> {
    /// The lanes that have an offset. The other fields are undefined in other lanes.
    pub exists: R::Mask,
    /// The point of the triangle.
    pub base: R::Vec3,
    /// The lifted point, already moved off the surface.
    pub lifted_point: R::Vec3,
    /// Unit normal of the triangle on the side of the lifted point.
    pub up: R::Vec3,
    /// Whether this describes edges from the lifted point rather than from the base.
    pub lifted: bool,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> TerminatorOffset<R> {
    /// Returns whether an edge in this direction leaves from the lifted point, provided that its
    /// far end [is below the plane](Self::has_below).
    #[inline(always)]
    pub fn applies_to(&self, dir: V) -> R::Mask {
        self.exists & dir.dot(self.up).le(R::splat(0.0))
    }

    /// Returns whether a point lies below the triangle's plane.
    #[inline(always)]
    pub fn has_below(&self, point: V) -> R::Mask {
        self.exists & (point - self.base).dot(self.up).le(R::splat(0.0))
    }

    /// Returns whether a light sample belongs to the other one of base and lifted point.
    #[inline(always)]
    pub fn excludes<const N: usize>(&self, direct: &DirectSample<R, N>) -> R::Mask
    where
        R: Lanes<N>,
    {
        let distant = direct.is_infinite();
        let below = (distant & self.applies_to(direct.wi))
            | (!distant & self.has_below(direct.point.position));
        self.exists & if self.lifted { !below } else { below }
    }
}

impl<'a, R: Lanes<N>, const N: usize> Surface<'a, R, N> {
    /// Computes the terminator offset at these points of triangles: the points' projections onto
    /// the corners' tangent planes, interpolated \[Vives\], where they lie above the triangle on the
    /// side of the ray. `None` if no lane has one.
    #[inline(always)]
    pub(super) fn find_terminator_offset(
        &self,
        triangles: &Triangles<R>,
        hits: &RayHits<R, N>,
    ) -> Option<TerminatorOffset<R>> {
        let [v, w] = hits.uv;
        let weights = [R::splat(1.0) - v - w, v, w];
        let mut lift = R::Vec3::broadcast(Vec3::ZERO);
        for (k, weight) in weights.into_iter().enumerate() {
            let (corner, n) = (triangles.corners[k], triangles.normals[k]);
            lift = lift - n * ((self.position - corner).dot(n) * weight);
        }
        let (n, zero) = (self.n_geometric, R::splat(0.0));
        let up = R::Vec3::select(hits.dir.dot(n).lt(zero), n, -n);
        let exists = lift.dot(up).gt(zero);
        exists.any().then(|| TerminatorOffset {
            exists,
            base: self.position,
            lifted_point: offset_origin(self.position + lift, up, self.extent),
            up,
            lifted: false,
        })
    }

    /// Returns this surface as the start of edges from the lifted point, if it has one in any lane.
    /// Such edges cannot be found by chance from their other end; the zero normal makes every
    /// density of arriving here zero.
    #[inline(always)]
    pub fn lifted(&self) -> Option<Surface<'a, R, N>> {
        let terminator = TerminatorOffset {
            lifted: true,
            ..self.terminator?
        };
        let exists = terminator.exists;
        Some(Surface {
            position: R::Vec3::select(exists, terminator.lifted_point, self.position),
            n_geometric: R::Vec3::select(exists, R::Vec3::broadcast(Vec3::ZERO), self.n_geometric),
            terminator: Some(terminator),
            ..*self
        })
    }

    /// Returns [`Surface::lifted`] of a surface that is not lifted itself.
    #[inline(always)]
    pub fn lifted_once(&self) -> Option<Surface<'a, R, N>> {
        let offset = self.terminator?;
        if offset.lifted { None } else { self.lifted() }
    }

    /// Returns the lanes that have a terminator offset.
    #[inline(always)]
    pub fn lifted_lanes(&self) -> R::Mask {
        self.terminator
            .map_or(R::Mask::default(), |offset| offset.exists)
    }

    /// Returns the terminator offset of the lanes in which an edge in direction `dir` leaves from
    /// the lifted point; `None` if there is no such lane.
    #[inline(always)]
    pub fn terminator_into(&self, dir: R::Vec3) -> Option<TerminatorOffset<R>> {
        let terminator = self.terminator?;
        let exists = terminator.applies_to(dir);
        exists.any().then_some(TerminatorOffset {
            exists,
            ..terminator
        })
    }
}
