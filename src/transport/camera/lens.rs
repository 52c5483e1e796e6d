//! Pinhole and thin-lens projection.

use glam::Vec3;

use super::FilterSpec;
use crate::math::warp::concentric_disk;
use crate::scene::desc::CameraDesc;
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;

/// A camera made ready for a resolution and a filter. Row 0 is on top, +x of the picture is to the right.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    position: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Half extent of the picture at distance 1, horizontally and vertically.
    half: [f32; 2],
    resolution: [f32; 2],
    lens_radius: f32,
    focus_distance: f32,
    filter: FilterSpec,
}

impl Camera {
    /// A camera from its description. Degenerate ones (looking at itself, or along `up`) get some direction rather
    /// than NaN; loaders refuse them first.
    pub fn new(desc: &CameraDesc, resolution: [u32; 2], filter: FilterSpec) -> Camera {
        let axis = desc.target - desc.position;
        let forward = axis.normalize_or(-Vec3::Z);
        let right = forward.cross(desc.up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        let up = right.cross(forward);
        let resolution = resolution.map(|n| n as f32);
        let half_y = (0.5 * desc.fov_deg.to_radians()).tan();
        Camera {
            position: desc.position,
            right,
            up,
            forward,
            half: [half_y * resolution[0] / resolution[1], half_y],
            resolution,
            lens_radius: 0.5 * desc.aperture,
            focus_distance: desc.focus_distance.unwrap_or_else(|| axis.length()),
            filter,
        }
    }

    /// A ray through a pixel; its weight is one. Uses two dimensions for the filter and, with a lens, two more.
    #[inline]
    pub fn sample_ray(&self, pixel: [u32; 2], sampler: &mut Sampler) -> Ray {
        let offset = self.filter.sample(sampler.next_2d());
        let film = [0, 1].map(|i| 2.0 * (pixel[i] as f32 + 0.5 + offset[i]) / self.resolution[i] - 1.0);
        let through = self.forward + self.right * (film[0] * self.half[0]) - self.up * (film[1] * self.half[1]);
        if self.lens_radius <= 0.0 {
            return Ray { origin: self.position, dir: through.normalize_or(self.forward) };
        }
        let lens = concentric_disk(sampler.next_2d()) * self.lens_radius;
        let origin = self.position + self.right * lens.x + self.up * lens.y;
        let focus = self.position + through * self.focus_distance;
        Ray { origin, dir: (focus - origin).normalize_or(self.forward) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::camera::FilterKind;

    fn desc(aperture: f32) -> CameraDesc {
        CameraDesc {
            position: Vec3::new(0.0, 0.0, 5.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_deg: 90.0,
            aperture,
            focus_distance: None,
        }
    }

    #[test]
    fn field_of_view_is_vertical_and_row_zero_is_on_top() {
        let pin = FilterSpec { kind: FilterKind::Box, radius: 0.0 };
        let camera = Camera::new(&desc(0.0), [200, 100], pin);
        let mut s = Sampler::new(0, [0, 0], 0);
        let top_left = camera.sample_ray([0, 0], &mut s).dir;
        assert!(top_left.x < 0.0 && top_left.y > 0.0 && top_left.z < 0.0);
        // Centre of the top row: half a pixel below the edge at 45 degrees.
        let top = camera.sample_ray([99, 0], &mut s).dir;
        assert!((top.y / -top.z - 0.99).abs() < 1e-5, "{top}");
        let left = camera.sample_ray([0, 49], &mut s).dir;
        assert!((left.x / left.z - 1.99).abs() < 1e-5, "{left}");
    }

    #[test]
    fn rays_of_a_lens_meet_in_the_plane_of_focus_and_fill_the_aperture() {
        let pin = FilterSpec { kind: FilterKind::Box, radius: 0.0 };
        let camera = Camera::new(&desc(0.8), [64, 64], pin);
        let mut farthest = 0.0f32;
        for i in 0..1000 {
            let ray = camera.sample_ray([10, 20], &mut Sampler::new(3, [10, 20], i));
            farthest = farthest.max((ray.origin - Vec3::new(0.0, 0.0, 5.0)).length());
            let at_focus = ray.origin + ray.dir * (-5.0 / ray.dir.z);
            let sharp = Camera::new(&desc(0.0), [64, 64], pin).sample_ray([10, 20], &mut Sampler::new(3, [10, 20], i));
            let expected = sharp.origin + sharp.dir * (-5.0 / sharp.dir.z);
            assert!((at_focus - expected).length() < 1e-4);
        }
        assert!(farthest <= 0.4 + 1e-6 && farthest > 0.38, "{farthest}");
    }
}
