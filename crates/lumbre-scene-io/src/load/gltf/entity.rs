//! Entities: the meshes of nodes, deformed or not, and their instances.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use serde_json::Value as Json;

use super::{GltfLoader, shown, unit_quaternion};
use crate::load::SMALL_ENTITIES;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{EntityDesc, MeshDesc, ShapeDesc, Transform};

impl GltfLoader<'_> {
    /// Adds an entity for the mesh of a node, or one for each instance. Its transform has no effect on a mesh with a skin, whose
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
        let given = if node["name"].is_string() {
            &node["name"]
        } else {
            &mesh["name"]
        };
        let instances = self.instances(place, node)?;
        if deformation.skin.is_some() {
            if instances.is_some() {
                self.note(
                    place,
                    "instances of a mesh with a skin are not supported; it has one",
                );
            }
            self.push_entity(given, shape, DAffine3::IDENTITY);
            return Ok(());
        }
        for instance in instances.unwrap_or_else(|| vec![DAffine3::IDENTITY]) {
            self.push_entity(given, shape.clone(), world * instance);
        }
        Ok(())
    }

    /// Returns the transforms of the instances that `EXT_mesh_gpu_instancing` gives a node.
    fn instances(&mut self, place: &str, node: &Json) -> Result<Option<Vec<DAffine3>>, SceneError> {
        let document = self.document;
        let extension = &node["extensions"]["EXT_mesh_gpu_instancing"];
        if extension.is_null() {
            return Ok(None);
        }
        let attributes = &extension["attributes"];
        let place = format!("{place}.EXT_mesh_gpu_instancing");
        let known = [("TRANSLATION", 3), ("ROTATION", 4), ("SCALE", 3)];
        for (key, _) in attributes.as_object().into_iter().flatten() {
            // Names with an underscore are data of applications.
            if !key.starts_with('_') && !known.iter().any(|(name, _)| key == name) {
                self.note(
                    &place,
                    format!("the attribute `{}` is not supported", shown(key)),
                );
            }
        }
        let mut counts = Vec::new();
        let mut lists = [const { None }; 3];
        for ((key, width), list) in known.into_iter().zip(&mut lists) {
            if !attributes[key].is_null() {
                let numbers = document.numbers(&place, &attributes[key], width)?;
                counts.push(numbers.len() / width);
                *list = Some(numbers);
            }
        }
        let count = counts.first().copied().unwrap_or_default();
        if count == 0 || counts.iter().any(|n| *n != count) {
            let problem = format!("expected attributes of equal length, found {counts:?}");
            return Err(document.error(&place, problem));
        }
        let most = SMALL_ENTITIES as u64 + document.size();
        if (self.entities.len() + count) as u64 > most {
            let problem = format!("more than {most} entities, too many for the size of the file");
            return Err(document.error(&place, problem));
        }
        let transform = |i: usize| {
            let [translation, rotation, scale] = lists.each_ref().map(Option::as_ref);
            let vector = |v: &[f64]| DVec3::from_slice(&v[3 * i..]);
            DAffine3::from_scale_rotation_translation(
                scale.map_or(DVec3::ONE, |v| vector(v)),
                unit_quaternion(|c| rotation.map_or(f64::from(c == 3), |v| v[4 * i + c])),
                translation.map_or(DVec3::ZERO, |v| vector(v)),
            )
        };
        Ok(Some((0..count).map(transform).collect()))
    }

    /// Adds an entity with a name that the file gives, or `mesh`.
    fn push_entity(&mut self, name: &Json, shape: Arc<MeshDesc>, world: DAffine3) {
        let name = self.name(name, "mesh");
        self.entities.push(EntityDesc {
            transform: Transform::framed(world),
            ..EntityDesc::new(name, ShapeDesc::Mesh(shape))
        });
    }
}
