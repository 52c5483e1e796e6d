//! Transforms of rays into the space of a shared mesh; the same for all traversals.

use glam::{Mat3, Vec3};

use lumbre_light::scene::compile::Instance;
use lumbre_light::transport::ray::Ray;

/// Fraction of the greatest coordinate by which an instance's box is enlarged, since rays are
/// transformed with rounding.
const MARGIN: f32 = 4e-6;

/// Transform from world space into the space of an instance's mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceTransform {
    /// Maps directions of the world to those of the mesh.
    pub inverse: Mat3,
    /// Middle of the mesh's box in world space and in the mesh's space. Differences to it keep
    /// their precision wherever the instance is placed.
    pub pivot: [Vec3; 2],
}

impl InstanceTransform {
    /// Creates the transform of an instance of a mesh whose box has these corners.
    pub fn new(instance: &Instance, [low, high]: [Vec3; 2]) -> InstanceTransform {
        let middle = low + (high - low) * 0.5;
        InstanceTransform {
            inverse: instance.to_world.matrix3.inverse().as_mat3(),
            pivot: [instance.point(middle), middle],
        }
    }

    /// Transforms a ray into the mesh's space. Its direction is not normalised, so that distances
    /// equal those in world space.
    #[inline(always)]
    pub fn apply(&self, ray: &Ray) -> Ray {
        let [world, own] = self.pivot;
        Ray {
            origin: self.inverse * (ray.origin - world) + own,
            dir: self.inverse * ray.dir,
        }
    }
}

/// Returns the least and greatest corner of an instance's box in world space, around `boxes` that
/// enclose its mesh. The boxes of its tree's first nodes give a tighter result than a single box.
pub fn world_bounds(instance: &Instance, boxes: impl IntoIterator<Item = [Vec3; 2]>) -> [Vec3; 2] {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for [least, greatest] in boxes {
        for i in 0..8u32 {
            let pick = |axis: usize| {
                if i >> axis & 1 == 0 {
                    least[axis]
                } else {
                    greatest[axis]
                }
            };
            let p = instance.point(Vec3::new(pick(0), pick(1), pick(2)));
            (low, high) = (low.min(p), high.max(p));
        }
    }
    let margin = Vec3::splat(low.abs().max(high.abs()).max_element() * MARGIN);
    [low - margin, high + margin]
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DQuat, DVec3};

    use super::*;

    /// Returns an instance at a place.
    fn instance(to_world: DAffine3) -> Instance {
        Instance {
            mesh: 0,
            to_world,
            normal_to_world: Mat3::IDENTITY,
            materials: 0,
            emitters: 0,
            flattened_start: 0,
        }
    }

    /// Rays hit an instance with coordinates that are rounded to units of the greatest one: a flat
    /// mesh that is parallel to an axis has a box with room for them.
    #[test]
    fn boxes_of_instances_contain_their_points_however_they_are_rounded() {
        for (turn, translate) in [
            (DQuat::IDENTITY, DVec3::new(3.0, 700.0, -20.0)),
            (DQuat::from_rotation_y(0.7), DVec3::new(-5000.0, 3.0, 0.1)),
            (DQuat::from_rotation_z(2.1), DVec3::ZERO),
        ] {
            let to_world = DAffine3::from_rotation_translation(turn, translate);
            let instance = instance(to_world);
            let square = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 0.0, 1.0)];
            let [low, high] = world_bounds(&instance, [square]);
            let greatest = low.abs().max(high.abs()).max_element();
            // Two roundings: of the point, and of the ray's origin.
            let room = Vec3::splat(greatest * f32::EPSILON);
            for [x, z] in [
                [-1.0, -1.0],
                [-1.0, 1.0],
                [1.0, -1.0],
                [1.0, 1.0],
                [0.3, -0.4],
            ] {
                let p = to_world.transform_point3(DVec3::new(x, 0.0, z)).as_vec3();
                let inside = low.cmple(p - room).all() && high.cmpge(p + room).all();
                assert!(inside, "{p} is too near the bounds {low} and {high}");
            }
        }
    }
}
