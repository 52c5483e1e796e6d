//! Cameras of all kinds, with the perspective of pinholes and thin lenses.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3;

use super::FilterSpec;
use super::filter::FilmEdge;
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::{Lanes, active_lanes, map_array};
use crate::math::warp::concentric_disk_lanes;
use crate::scene::desc::{CameraDesc, CameraKind};
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;

/// A camera prepared for a resolution and a filter. Row 0 is at the top; +x of the picture is to
/// the right.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Map from film positions to rays.
    pub kind: CameraKind,
    /// Centre of the lens in world space; of an orthographic camera, of the film.
    pub position: Vec3,
    /// Unit vector to the right of the picture.
    pub right: Vec3,
    /// Unit vector to the top of the picture.
    pub up: Vec3,
    /// Unit vector of the viewing direction.
    pub forward: Vec3,
    /// Half extent of the picture, horizontal and vertical: at distance 1; of an orthographic
    /// camera in scene units; of a spherical one in radians.
    pub half: [f32; 2],
    /// Vector from the axis to the middle of the picture, to the right and downwards, in the unit of
    /// `half`.
    pub center: [f32; 2],
    /// Width and height in pixels.
    pub resolution: [f32; 2],
    /// Radius of the lens in units of the scene; 0 for a pinhole.
    pub lens_radius: f32,
    /// Distance of the plane in focus along the viewing direction, in units of the scene.
    pub focus_distance: f32,
    /// Pixel reconstruction filter.
    pub filter: FilterSpec,
}

/// A point of the scene connected to a point of the lens: the end of a light path.
///
/// One light path is traced for every sample of every pixel, so the number of pixels cancels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraConnection {
    /// Column and row of the pixel that receives the light.
    pub pixel: [u32; 2],
    /// Point of the lens in world space; the pinhole itself if there is no lens; of an orthographic
    /// camera, the point of the film.
    pub lens: Vec3,
    /// Unit direction from the lens to the scene point.
    pub dir: Vec3,
    /// Distance between the two, in scene units.
    pub distance: f32,
    /// Importance in 1 / (scene unit)^2: the light path adds `throughput * f * |cos at the point| *
    /// importance` to the sum of pixel `pixel`, where `throughput` is the emitted radiance times
    /// all cosines over all densities up to the point, and `f` the BSDF there (for a point that
    /// emits, `throughput` is one over the density of the point per area, and `f` the emitted
    /// radiance).
    ///
    /// This is the importance of [Veach 1997, 8.3.2], `1 / (A cos^4)` times the cosine at the lens
    /// over the squared distance, where `A` is the film's area at distance one and the density of
    /// the lens point has been divided out; times the sum of the filters of all pixels at this film
    /// position, which is one for a box of one pixel.
    pub importance: f32,
    /// Density per solid angle of a camera ray in direction `dir`: [`Camera::pdf_w_at`].
    pub pdf_w: f32,
}

/// Projection of scene points through lens points onto the film; scalar or vectorised.
#[derive(Clone, Copy, Debug)]
pub struct Projection<V: Vector> {
    /// Whether the point is in front of the camera; all other fields are meaningless if not.
    pub ahead: <V::Scalar as Real>::Mask,
    /// Film position: column and row in pixels from the edge, possibly outside the film.
    pub raster: [V::Scalar; 2],
    /// Point of the lens: see [`CameraConnection::lens`].
    pub lens: V,
    /// Unit direction to the point: see [`CameraConnection::dir`].
    pub dir: V,
    /// Distance to the point: see [`CameraConnection::distance`].
    pub distance: V::Scalar,
    /// Density of the direction: see [`CameraConnection::pdf_w`].
    pub pdf_w: V::Scalar,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Projection<V> {
    /// Returns `yes` where the mask is set, else `no`.
    #[inline(always)]
    pub fn select(mask: R::Mask, yes: Projection<V>, no: Projection<V>) -> Projection<V> {
        let [x, y] = yes.raster;
        Projection {
            ahead: (mask & yes.ahead) | (!mask & no.ahead),
            raster: [
                R::select(mask, x, no.raster[0]),
                R::select(mask, y, no.raster[1]),
            ],
            lens: V::select(mask, yes.lens, no.lens),
            dir: V::select(mask, yes.dir, no.dir),
            distance: R::select(mask, yes.distance, no.distance),
            pdf_w: R::select(mask, yes.pdf_w, no.pdf_w),
        }
    }
}

impl Camera {
    /// Builds a camera from its description. Degenerate descriptions (target at the position, or
    /// view along `up`) give an arbitrary direction rather than NaN; loaders reject them first.
    pub fn new(desc: &CameraDesc, resolution: [u32; 2], filter: FilterSpec) -> Camera {
        let axis = desc.target - desc.position;
        let forward = axis.normalize_or(-Vec3::Z);
        let right = forward
            .cross(desc.up)
            .try_normalize()
            .unwrap_or_else(|| forward.any_orthonormal_vector());
        let up = right.cross(forward);
        let right = if desc.window.mirrors() { -right } else { right };
        let resolution = resolution.map(|n| n as f32);
        let (shown, offset) = (desc.window.size()[1], desc.window.offset());
        let with_square_pixels = |half_y: f32| [half_y * resolution[0] / resolution[1], half_y];
        let half = match desc.kind {
            CameraKind::Perspective => {
                with_square_pixels((0.5 * desc.view_deg().to_radians()).tan() * shown)
            }
            CameraKind::Orthographic => with_square_pixels(0.5 * desc.view_height * shown),
            CameraKind::Spherical => [PI, FRAC_PI_2],
        };
        let lens_diameter = match desc.kind {
            CameraKind::Perspective => desc.lens_diameter(),
            CameraKind::Orthographic | CameraKind::Spherical => 0.0,
        };
        Camera {
            kind: desc.kind,
            position: desc.position,
            right,
            up,
            forward,
            half,
            center: [0, 1].map(|i| 2.0 * offset[i] * half[i]),
            resolution,
            lens_radius: 0.5 * lens_diameter,
            focus_distance: desc.focus_distance.unwrap_or_else(|| axis.length()),
            filter,
        }
    }

    /// Samples a ray through a pixel; its weight is one. Uses two dimensions for the filter and,
    /// with a lens, two more.
    ///
    /// The lens is a disk of uniform density, and the surface in focus is a plane perpendicular to
    /// the axis. S0 samples the radius itself uniformly (4.8), which crowds rays in the middle of
    /// the lens and makes blurred highlights bright in the middle; S0 and S1 focus on a sphere
    /// about the camera (4.6, listing 3.1), and S1 measures the focus from its sensor. A point at
    /// depth `z` is a disk of diameter `A |z - d| / z` in the plane of focus at depth `d`, for a
    /// lens of diameter `A`.
    #[inline]
    pub fn sample_ray(&self, pixel: [u32; 2], sampler: &mut Sampler) -> Ray {
        let filter_u = sampler.next_2d();
        let lens_u = if self.has_lens() {
            sampler.next_2d()
        } else {
            [0.0; 2]
        };
        let [origin, dir] = self.ray(pixel.map(|n| n as f32), filter_u, lens_u);
        Ray { origin, dir }
    }

    /// Returns the pixel filter.
    pub fn filter(&self) -> FilterSpec {
        self.filter
    }

    /// Returns whether rays start on a disk rather than at a point.
    #[inline]
    pub fn has_lens(&self) -> bool {
        self.lens_radius > 0.0
    }

    /// Returns whether all rays have the same direction, so that their density is one per area
    /// perpendicular to them and none per solid angle.
    #[inline]
    pub fn is_parallel(&self) -> bool {
        self.kind == CameraKind::Orthographic
    }

    /// Computes origins and unit directions of [`Camera::sample_ray`]; scalar or vectorised.
    /// `lens_u` is ignored without a lens.
    #[inline(always)]
    pub fn ray<V: Vector>(
        &self,
        pixel: [V::Scalar; 2],
        filter_u: [V::Scalar; 2],
        lens_u: [V::Scalar; 2],
    ) -> [V; 2] {
        let [dx, dy] = self.filter.sample(filter_u);
        let half = map_array(self.half, V::Scalar::splat);
        let center = map_array(self.center, V::Scalar::splat);
        let x = film_coordinate(pixel[0], dx, self.resolution[0]) * half[0] + center[0];
        let y = film_coordinate(pixel[1], dy, self.resolution[1]) * half[1] + center[1];
        match self.kind {
            CameraKind::Perspective => {}
            CameraKind::Orthographic => return self.parallel_ray([x, y]),
            CameraKind::Spherical => {
                return [V::broadcast(self.position), self.direction_at([x, y])];
            }
        }
        let [position, right, up] = [
            V::broadcast(self.position),
            V::broadcast(self.right),
            V::broadcast(self.up),
        ];
        let forward = V::broadcast(self.forward);
        let through = forward + right * x - up * y;
        if !self.has_lens() {
            return [position, through.normalize_or(forward)];
        }
        let radius = V::Scalar::splat(self.lens_radius);
        let [x, y] = concentric_disk_lanes(lens_u);
        let origin = position + right * (x * radius) + up * (y * radius);
        let focus = position + through * V::Scalar::splat(self.focus_distance);
        [origin, (focus - origin).normalize_or(forward)]
    }

    /// Connects a scene point to the camera; visibility is not tested. `lens_u` selects the point
    /// of the lens (unused for a pinhole), `filter_u` the pixel among those whose filter covers the
    /// film position.
    ///
    /// Returns `None` behind the camera, outside the film, and with a filter of radius zero, whose
    /// pixels are points that no light path hits with any density.
    #[inline]
    pub fn connect(
        &self,
        point: Vec3,
        lens_u: [f32; 2],
        filter_u: [f32; 2],
    ) -> Option<CameraConnection> {
        let c = self.connection_at(&self.project(point, lens_u), filter_u)?;
        Some(CameraConnection {
            importance: c.importance / (c.distance * c.distance),
            ..c
        })
    }

    /// Projects scene points through lens points onto the film.
    #[inline(always)]
    pub fn project<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
        &self,
        point: V,
        lens_u: [R; 2],
    ) -> Projection<V> {
        if self.is_parallel() {
            return self.project_parallel(point);
        }
        let disk = self.lens_offset(lens_u);
        let to = point - self.plane_point(disk);
        let distance = to.length();
        Projection {
            distance,
            ..self.project_direction(disk, to / distance)
        }
    }

    /// Connects a direction from outside the scene to the camera, as [`Camera::connect`] does a
    /// point: `dir` is the unit direction from the lens. The distance is infinite, and `importance`
    /// is per solid angle, without a unit: the light adds `throughput * importance`, where
    /// `throughput` is radiance over its density per solid angle.
    #[inline]
    pub fn connect_direction(
        &self,
        dir: Vec3,
        lens_u: [f32; 2],
        filter_u: [f32; 2],
    ) -> Option<CameraConnection> {
        self.connection_at(&self.project_distant(dir, lens_u), filter_u)
    }

    /// Projects light from outside the scene onto the film: `dir` is the unit direction from the
    /// lens. The distance is infinite. No direction is ahead of an orthographic camera: light of its
    /// own direction would reach the whole film.
    #[inline(always)]
    pub fn project_distant<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
        &self,
        dir: V,
        lens_u: [R; 2],
    ) -> Projection<V> {
        self.project_direction(self.lens_offset(lens_u), dir)
    }

    /// Returns the lens coordinates of a sample, in scene units; the centre for a pinhole.
    #[inline(always)]
    fn lens_offset<R: Real>(&self, lens_u: [R; 2]) -> [R; 2] {
        if !self.has_lens() {
            return [R::splat(0.0); 2];
        }
        let [x, y] = concentric_disk_lanes(lens_u);
        [
            x * R::splat(self.lens_radius),
            y * R::splat(self.lens_radius),
        ]
    }

    /// Returns the point of the lens, or of the film of an orthographic camera, in world space, at
    /// coordinates in scene units, to the right and upwards.
    #[inline(always)]
    pub(super) fn plane_point<V: Vector>(&self, [x, y]: [V::Scalar; 2]) -> V {
        V::broadcast(self.position) + V::broadcast(self.right) * x + V::broadcast(self.up) * y
    }

    /// Projects light that arrives along `-dir` through a point of the lens onto the film.
    #[inline(always)]
    fn project_direction<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
        &self,
        disk: [R; 2],
        dir: V,
    ) -> Projection<V> {
        let lens = self.plane_point(disk);
        let distance = R::splat(f32::INFINITY);
        if self.kind == CameraKind::Spherical {
            return Projection {
                ahead: self.off_poles(dir),
                raster: self.raster(self.angles_of(dir)),
                lens,
                dir,
                distance,
                pdf_w: self.pdf_w(dir),
            };
        }
        let depth = dir.dot(V::broadcast(self.forward));
        // Intersect the plane of focus, relative to the camera and scaled back to distance one. For
        // a pinhole that plane is arbitrary.
        let (x, y) = (
            dir.dot(V::broadcast(self.right)) / depth,
            dir.dot(V::broadcast(self.up)) / depth,
        );
        let focus = R::splat(self.focus_distance);
        let shift = if self.has_lens() {
            [disk[0] / focus, disk[1] / focus]
        } else {
            [R::splat(0.0); 2]
        };
        let ahead = depth.gt(R::splat(0.0)) & dir.is_finite();
        Projection {
            ahead: if self.is_parallel() {
                R::Mask::default()
            } else {
                ahead
            },
            raster: self.raster([x + shift[0], -(y + shift[1])]),
            lens,
            dir,
            distance,
            pdf_w: self.pdf_w(dir),
        }
    }

    /// Returns the film position in pixels from the upper left corner, of coordinates from the
    /// axis in the unit of [`Camera::half`], to the right and downwards.
    #[inline(always)]
    pub(super) fn raster<R: Real>(&self, [x, y]: [R; 2]) -> [R; 2] {
        let [half_x, half_y] = map_array(self.half, R::splat);
        let [center_x, center_y] = map_array(self.center, R::splat);
        let [width, height] = map_array(self.resolution, R::splat);
        let (half, one) = (R::splat(0.5), R::splat(1.0));
        [
            half * ((x - center_x) / half_x + one) * width,
            half * ((y - center_y) / half_y + one) * height,
        ]
    }

    /// Chooses the pixel at a projection and computes the importance at the lens.
    #[inline]
    fn connection_at(&self, at: &Projection<Vec3>, filter_u: [f32; 2]) -> Option<CameraConnection> {
        let (inside, [pixel], weight) = self.choose_pixels(at, filter_u, true);
        inside.then_some(CameraConnection {
            pixel,
            lens: at.lens,
            dir: at.dir,
            distance: at.distance,
            importance: weight * at.pdf_w,
            pdf_w: at.pdf_w,
        })
    }

    /// Chooses the pixels that receive light at projections, in the lanes of `wanted`. Returns the
    /// lanes whose projection is in front of the camera and on the film, the pixels, and the weights
    /// of the choice.
    #[inline(always)]
    pub fn choose_pixels<R: Lanes<N>, const N: usize>(
        &self,
        at: &Projection<R::Vec3>,
        [c, d]: [R; 2],
        wanted: R::Mask,
    ) -> (R::Mask, [[u32; 2]; N], R) {
        let zero = R::splat(0.0);
        let ahead = wanted & at.ahead;
        let [x, y] = at.raster;
        let (mut pixels, mut weights) = ([[0; 2]; N], [0.0; N]);
        if self.filter == FilterSpec::PIXEL {
            // The pixel that contains the position, as `FilterSpec::choose_pixel` returns it.
            let [width, height] = map_array(self.resolution, R::splat);
            let inside = ahead & x.ge(zero) & x.lt(width) & y.ge(zero) & y.lt(height);
            let [x, y] = [R::store_words(x.truncated()), R::store_words(y.truncated())];
            for i in active_lanes(inside.bits()) {
                (pixels[i], weights[i]) = ([x[i], y[i]], 1.0);
            }
        } else {
            let inputs = R::transpose_store([x, y, c, d, zero, zero, zero, zero]);
            for i in active_lanes(ahead.bits()) {
                let [x, y, u, v, ..] = inputs[i].0;
                if let Some((pixel, weight)) = self.choose_pixel([x, y], [u, v]) {
                    (pixels[i], weights[i]) = (pixel, weight);
                }
            }
        }
        let weight = R::load(&weights);
        (ahead & weight.gt(zero), pixels, weight)
    }

    /// Chooses the pixel that receives light at a film position ([`Projection::raster`]) by
    /// `filter_u`, and returns it with the weight of the choice; `None` if no pixel's filter covers
    /// the position.
    #[inline]
    pub fn choose_pixel(&self, raster: [f32; 2], filter_u: [f32; 2]) -> Option<([u32; 2], f32)> {
        let edges = match self.kind {
            CameraKind::Perspective | CameraKind::Orthographic => [FilmEdge::Open; 2],
            CameraKind::Spherical => [FilmEdge::Wraps, FilmEdge::Reflects],
        };
        let choose = |axis: usize| {
            let count = self.resolution[axis] as u32;
            self.filter
                .choose_pixel(raster[axis], (count, edges[axis]), filter_u[axis])
        };
        let (column, weight_x) = choose(0)?;
        let (row, weight_y) = choose(1)?;
        Some(([column, row], weight_x * weight_y))
    }

    /// Returns width and height of the picture in pixels.
    pub fn resolution(&self) -> [u32; 2] {
        self.resolution.map(|n| n as u32)
    }

    /// Returns the density per solid angle of a camera ray in the unit direction `dir` over all
    /// pixels. It does not depend on the point of the lens. `A` is the film's area in the unit of
    /// [`Camera::half`].
    ///
    /// - `1 / (A cos^3)` for a perspective camera, with the cosine to the optical axis;
    /// - `1 / (A sin)` for a spherical camera, with the sine of the angle to the up direction;
    /// - `1 / A` for an orthographic camera, per area perpendicular to its rays instead; see
    ///   [`Camera::pdf_w_at`].
    ///
    /// With a box of one pixel this is exact for directions that meet the film. With other filters
    /// the density of film positions ripples about it from pixel to pixel and falls off softly at
    /// the border; since every technique uses the same number, weights of multiple importance
    /// sampling still sum to one. Returns zero behind the camera, and for a filter without density,
    /// so that no weight counts on a technique that cannot work.
    #[inline(always)]
    pub fn pdf_w<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(&self, dir: V) -> R {
        let zero = R::splat(0.0);
        if self.filter.reach() <= 0.0 {
            return zero;
        }
        let area = R::splat(4.0 * self.half[0] * self.half[1]);
        if self.kind == CameraKind::Spherical {
            let density = R::splat(1.0) / (area * self.sin_theta(dir));
            return R::select(self.off_poles(dir), density, zero);
        }
        let cos = dir.dot(V::broadcast(self.forward));
        let density = if self.is_parallel() {
            R::splat(1.0) / area
        } else {
            R::splat(1.0) / (area * cos * cos * cos)
        };
        R::select(cos.le(zero), zero, density)
    }

    /// Returns the density per solid angle of a camera ray in the unit direction `dir` that is
    /// worth its density per area at this distance: [`Camera::pdf_w`], of parallel rays times the
    /// squared distance.
    #[inline(always)]
    pub fn pdf_w_at<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(&self, dir: V, distance: R) -> R {
        let density = self.pdf_w(dir);
        if self.is_parallel() {
            density * (distance * distance)
        } else {
            density
        }
    }
}

/// Returns one coordinate of a point of a pixel, from -1 to 1 over the whole film.
#[inline(always)]
fn film_coordinate<R: Real>(pixel: R, offset: R, resolution: f32) -> R {
    R::splat(2.0) * (pixel + R::splat(0.5) + offset) / R::splat(resolution) - R::splat(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::Optics;
    use crate::transport::camera::FilterKind;

    fn desc(aperture: f32) -> CameraDesc {
        CameraDesc {
            position: Vec3::new(0.0, 0.0, 5.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            optics: Optics::pinhole(90.0).with_aperture(aperture),
            ..CameraDesc::default()
        }
    }

    #[test]
    fn field_of_view_is_vertical_and_row_zero_is_on_top() {
        let pin = FilterSpec {
            kind: FilterKind::Box,
            radius: 0.0,
        };
        let camera = Camera::new(&desc(0.0), [200, 100], pin);
        let mut s = Sampler::new(0, [0, 0], 0);
        let top_left = camera.sample_ray([0, 0], &mut s).dir;
        assert!(top_left.x < 0.0 && top_left.y > 0.0 && top_left.z < 0.0);
        // The centre of the top row is half a pixel below the edge at 45 degrees.
        let top = camera.sample_ray([99, 0], &mut s).dir;
        assert!((top.y / -top.z - 0.99).abs() < 1e-5, "{top}");
        let left = camera.sample_ray([0, 49], &mut s).dir;
        assert!((left.x / left.z - 1.99).abs() < 1e-5, "{left}");
    }

    #[test]
    fn rays_of_a_lens_meet_in_the_plane_of_focus_and_fill_the_aperture() {
        let pin = FilterSpec {
            kind: FilterKind::Box,
            radius: 0.0,
        };
        let camera = Camera::new(&desc(0.8), [64, 64], pin);
        let mut farthest = 0.0f32;
        for i in 0..1000 {
            let ray = camera.sample_ray([10, 20], &mut Sampler::new(3, [10, 20], i));
            farthest = farthest.max((ray.origin - Vec3::new(0.0, 0.0, 5.0)).length());
            let at_focus = ray.origin + ray.dir * (-5.0 / ray.dir.z);
            let sharp = Camera::new(&desc(0.0), [64, 64], pin)
                .sample_ray([10, 20], &mut Sampler::new(3, [10, 20], i));
            let expected = sharp.origin + sharp.dir * (-5.0 / sharp.dir.z);
            assert!((at_focus - expected).length() < 1e-4);
        }
        assert!(farthest <= 0.4 + 1e-6 && farthest > 0.38, "{farthest}");
    }
}
