//! Entities of the description that the primitives of a compiled scene belong to.

use serde::{Deserialize, Serialize};

use super::CompiledScene;

/// Indices of entities in [`SceneDesc::entities`](crate::scene::desc::SceneDesc::entities).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Entities {
    /// Id of the first triangle in world space of each mesh, in ascending order, with its entity.
    pub(super) meshes: Vec<[u32; 2]>,
    /// Entity of each instance.
    pub(super) instances: Vec<u32>,
    /// Entity of each sphere.
    pub(super) spheres: Vec<u32>,
}

impl CompiledScene {
    /// Returns the index of the entity that a primitive belongs to, and the index of the primitive
    /// among those of the entity that have an area. `instance` is the index of its instance, or
    /// [`NONE`](super::NONE). A scene that was not compiled from a description counts as one entity.
    pub fn entity_of(&self, primitive: u32, instance: u32) -> [u32; 2] {
        let entities = &self.entities;
        let found = if let Some(placement) = self.instances.placements.get(instance as usize) {
            let mesh = &self.instances.meshes[placement.mesh as usize];
            let entity = entities.instances.get(instance as usize);
            entity.map(|entity| [*entity, primitive - mesh.triangles.start])
        } else if let Some(i) = (primitive as usize).checked_sub(self.triangles.len()) {
            entities.spheres.get(i).map(|entity| [*entity, 0])
        } else {
            let after = (entities.meshes).partition_point(|[first, _]| *first <= primitive);
            let mesh = after.checked_sub(1).map(|i| entities.meshes[i]);
            mesh.map(|[first, entity]| [entity, primitive - first])
        };
        found.unwrap_or([0, primitive])
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};

    use super::super::{NONE, Sharing, compile_sharing};
    use crate::scene::desc::{MaterialDesc, ShapeDesc};
    use crate::scene::fixtures::{mesh, scene};

    #[test]
    fn primitives_belong_to_entities_in_the_order_of_the_scene() {
        let sphere = ShapeDesc::Sphere { radius: 1.0 };
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE];
        // The second triangle has no area.
        let pair = mesh(
            &corners,
            &[Vec2::ZERO; 4],
            &[[0, 1, 2], [0, 0, 1], [1, 3, 2]],
        );
        let single = mesh(&corners, &[Vec2::ZERO; 4], &[[0, 1, 3]]);
        let shapes = [&sphere, &pair, &single, &pair, &sphere];
        let shapes = shapes.map(|shape| (shape.clone(), Vec3::ZERO));
        let desc = scene(&shapes, MaterialDesc::new("m"));
        let plain = compile_sharing(&desc, Sharing::Never).unwrap().0;
        let found = |i| plain.entity_of(i, NONE);
        let expected = [[1, 0], [1, 1], [2, 0], [3, 0], [3, 1], [0, 0], [4, 0]];
        assert_eq!([0, 1, 2, 3, 4, 5, 6].map(found), expected);
        let shared = compile_sharing(&desc, Sharing::Always).unwrap().0;
        // One triangle in world space, then those of the shared mesh.
        let at = |(i, instance)| shared.entity_of(i, instance);
        let hits = [
            (0, NONE),
            (1, 0),
            (2, 0),
            (1, 1),
            (2, 1),
            (3, NONE),
            (4, NONE),
        ];
        let expected = [[2, 0], [1, 0], [1, 1], [3, 0], [3, 1], [0, 0], [4, 0]];
        assert_eq!(hits.map(at), expected);
        let flat = shared.flattened(100).unwrap();
        let found = |i| flat.entity_of(i, NONE);
        let expected = [[2, 0], [1, 0], [1, 1], [3, 0], [3, 1], [0, 0], [4, 0]];
        assert_eq!([0, 1, 2, 3, 4, 5, 6].map(found), expected);
    }
}
