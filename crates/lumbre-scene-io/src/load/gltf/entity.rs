//! Entities: the meshes of nodes, deformed or not.

use std::sync::Arc;

use glam::DAffine3;
use serde_json::Value as Json;

use super::GltfLoader;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{EntityDesc, MeshDesc, ShapeDesc, Transform};

impl GltfLoader<'_> {
    /// Adds an entity for the mesh of a node. Its transform has no effect on a mesh with a skin, whose
    /// joints move the vertices to their places in the world.
    pub(super) fn entity(
        &mut self,
        place: &str,
        node: &Json,
        world: DAffine3,
    ) -> Result<(), SceneError> {
        let (i, mesh) = self.document.resolve(place, "meshes", &node["mesh"])?;
        let deformation = self.deformation(place, node, mesh)?;
        let key = (i, deformation.key());
        let shape = match self.meshes.get(&key) {
            Some(known) => known.clone(),
            None => {
                let read = self.mesh(i, mesh, &deformation)?.map(Arc::new);
                self.meshes.insert(key, read.clone());
                read
            }
        };
        let Some(shape) = shape else { return Ok(()) };
        let world = if deformation.skin.is_some() {
            DAffine3::IDENTITY
        } else {
            world
        };
        let given = if node["name"].is_string() {
            &node["name"]
        } else {
            &mesh["name"]
        };
        self.push_entity(given, shape, world);
        Ok(())
    }

    /// Adds an entity with a name that the file gives, or `mesh`.
    fn push_entity(&mut self, name: &Json, shape: Arc<MeshDesc>, world: DAffine3) {
        let name = self.name(name, "mesh");
        self.entities.push(EntityDesc {
            transform: Transform::framed(world.as_affine3a()),
            ..EntityDesc::new(name, ShapeDesc::Mesh(shape))
        });
    }
}
