//! Instances of shared meshes.
//!
//! Triangles of a shared mesh are stored after those in world space, in the same arrays, in object
//! space. An [`Instance`] holds a transform and refers to its own materials and lights. Its
//! world-space attributes are computed as compilation without sharing would: vertices in double
//! precision and rounded once, normals by the inverse transpose and on the front side. The two
//! results differ only by the last digits of a normal.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DAffine3, Mat3, Vec3, Vec4};
use serde::{Deserialize, Serialize};

use super::mesh::on_front_side;
use super::{CompiledScene, Emitter, NONE, TriangleAttributes};

/// Greatest number of triangles and spheres to which a scene with instances is
/// [flattened](CompiledScene::flattened) for a backend without instancing: about four gigabytes on
/// a device.
pub const MAX_FLATTENED_PRIMITIVES: usize = 1 << 24;

/// Shared meshes and their instances. A triangle is identified by a primitive id, an index into
/// [`CompiledScene::triangles`], and an instance, an index into [`Instances::placements`], or
/// [`NONE`] for a primitive that is not shared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Instances {
    /// Shared meshes; their triangles follow one another after those in world space.
    pub meshes: Vec<SharedMesh>,
    /// Instances of the meshes.
    pub placements: Vec<Instance>,
    /// Indices into [`CompiledScene::materials`]: for each instance, one for each of its mesh's
    /// slots. The `material` of a shared triangle is its slot.
    pub materials: Vec<u32>,
}

/// A mesh that is stored once.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SharedMesh {
    /// Range of its triangles in [`CompiledScene::triangles`], [`CompiledScene::attributes`] and,
    /// if present, tangents and colours.
    pub triangles: Range<u32>,
    /// Ids of its emissive triangles, in order. The `emitter` of a shared triangle is its position
    /// in this list, or [`NONE`].
    pub emissive: Vec<u32>,
}

/// A placement of a shared mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Instance {
    /// Index into [`Instances::meshes`].
    pub mesh: u32,
    /// Map from object space to the world. It is invertible and does not change the front of the
    /// triangles: mirrored instances refer to a mesh of their own with the opposite vertex order.
    pub to_world: DAffine3,
    /// Map from object-space normals to world-space normals, except for their length.
    pub normal_to_world: Mat3,
    /// Index of its first entry in [`Instances::materials`].
    pub materials: u32,
    /// Index into [`CompiledScene::emitters`] of the first of its emissive triangles.
    pub emitters: u32,
    /// Id of its first triangle in the [flattened](CompiledScene::flattened) scene.
    pub flattened_start: u32,
}

impl Instance {
    /// Transforms a point of the mesh to the world.
    #[inline]
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.to_world.transform_point3(p.as_dvec3()).as_vec3()
    }
}

impl CompiledScene {
    /// Returns the number of triangles that are not shared; they come first.
    #[inline]
    pub fn world_triangles(&self) -> usize {
        self.instances
            .meshes
            .first()
            .map_or(self.triangles.len(), |m| m.triangles.start as usize)
    }

    /// Returns the number of triangles and spheres that a ray can hit; each instance counts.
    pub fn flattened_count(&self) -> usize {
        let meshes = &self.instances.meshes;
        let instanced = self
            .instances
            .placements
            .iter()
            .map(|instance| meshes[instance.mesh as usize].triangles.len());
        instanced.fold(
            self.world_triangles() + self.spheres.len(),
            usize::saturating_add,
        )
    }

    /// Returns the vertices of a triangle in world space.
    #[inline]
    pub fn corners(&self, primitive: u32, instance: u32) -> [Vec3; 3] {
        let corners = self.triangles[primitive as usize];
        if instance == NONE {
            corners
        } else {
            corners.map(|p| self.instance(instance).point(p))
        }
    }

    /// Returns the greatest absolute coordinate of the vector by which an instance was moved; zero
    /// for [`NONE`].
    #[inline]
    pub fn instance_extent(&self, instance: u32) -> f32 {
        if instance == NONE {
            return 0.0;
        }
        let moved = self.instance(instance).to_world.translation;
        moved.abs().max_element() as f32
    }

    /// Returns the vertices of a triangle and the unit shading normals there, in world space.
    #[inline]
    pub fn triangle(&self, primitive: u32, instance: u32) -> ([Vec3; 3], [Vec3; 3]) {
        if instance != NONE {
            return self.instanced_triangle(primitive, instance);
        }
        (
            self.triangles[primitive as usize],
            self.normals.at(primitive),
        )
    }

    /// Returns the same for a triangle of an instance; a separate function, so that other triangles
    /// do not pay for it.
    #[cold]
    #[inline(never)]
    fn instanced_triangle(&self, primitive: u32, instance: u32) -> ([Vec3; 3], [Vec3; 3]) {
        let corners = self.corners(primitive, instance);
        (
            corners,
            self.instance(instance)
                .normals(self.normals.at(primitive), corners),
        )
    }

    /// Returns the instance with this index.
    #[inline]
    fn instance(&self, instance: u32) -> &Instance {
        &self.instances.placements[instance as usize]
    }

    /// Returns the tangents at the vertices of a triangle in world space; zero if there are none.
    #[inline]
    pub fn tangents_at(&self, primitive: u32, instance: u32) -> [Vec4; 3] {
        let tangents = self
            .tangents
            .get(primitive as usize)
            .map_or([Vec4::ZERO; 3], |t| *t);
        if instance == NONE {
            return tangents;
        }
        let matrix = self.instance(instance).to_world.matrix3;
        tangents.map(|t| {
            (matrix * t.truncate().as_dvec3())
                .as_vec3()
                .normalize_or_zero()
                .extend(t.w)
        })
    }

    /// Returns the material index of a primitive.
    #[inline]
    pub fn material_of(&self, primitive: u32, instance: u32) -> u32 {
        let i = primitive as usize;
        let own = match self.attributes.get(i) {
            Some(a) => a.material,
            None => self.spheres[i - self.attributes.len()].material,
        };
        if instance == NONE {
            own
        } else {
            self.instances.materials[(self.instance(instance).materials + own) as usize]
        }
    }

    /// Returns the name of a primitive: its kind, number and the model of its material, as in
    /// `triangle 12 (disney)`. `instance` is the index of its instance, or [`NONE`].
    pub fn primitive_name(&self, primitive: u32, instance: u32) -> String {
        let material = &self.materials[self.material_of(primitive, instance) as usize];
        let i = primitive as usize;
        let (kind, i) = if i < self.triangles.len() {
            ("triangle", i)
        } else {
            ("sphere", i - self.triangles.len())
        };
        format!("{kind} {i} ({})", material.model.name())
    }

    /// Returns the emitter index of a primitive, or [`NONE`].
    #[inline]
    pub fn emitter_of(&self, primitive: u32, instance: u32) -> u32 {
        let i = primitive as usize;
        let own = match self.attributes.get(i) {
            Some(a) => a.emitter,
            None => self.spheres[i - self.attributes.len()].emitter,
        };
        if instance == NONE || own == NONE {
            own
        } else {
            self.instance(instance).emitters + own
        }
    }

    /// Returns a number that is unique for every primitive of every instance: its id in the
    /// [flattened](Self::flattened) scene, except that spheres keep their id.
    #[inline]
    pub fn unique_id(&self, primitive: u32, instance: u32) -> u32 {
        if instance == NONE {
            return primitive;
        }
        let instance = self.instance(instance);
        instance.flattened_start.wrapping_add(
            primitive
                - self.instances.meshes[instance.mesh as usize]
                    .triangles
                    .start,
        )
    }

    /// Returns the same scene with the triangles of every instance in world space, for backends
    /// without instancing. They follow the other world-space triangles in the order of the
    /// instances.
    ///
    /// # Errors
    /// Returns the number of triangles and spheres if it exceeds `limit`.
    pub fn flattened(&self, limit: usize) -> Result<CompiledScene, usize> {
        let total = self.flattened_count();
        if total > limit {
            return Err(total);
        }
        let world = self.world_triangles();
        let mut flat = CompiledScene {
            instances: Instances::default(),
            ..self.clone()
        };
        flat.triangles.truncate(world);
        flat.attributes.truncate(world);
        flat.normals.truncate(world);
        flat.uvs.truncate(world);
        flat.tangents.truncate(world);
        flat.colors.truncate(world);
        flat.second_uvs.truncate(world);
        let mut emitter_primitives = BTreeMap::new();
        let placed = std::mem::take(&mut flat.entities.instances);
        for (index, instance) in self.instances.placements.iter().enumerate() {
            let entity = placed.get(index);
            let first = flat.triangles.len() as u32;
            flat.entities
                .meshes
                .extend(entity.map(|entity| [first, *entity]));
            let index = index as u32;
            for primitive in self.instances.meshes[instance.mesh as usize]
                .triangles
                .clone()
            {
                let emitter = self.emitter_of(primitive, index);
                if emitter != NONE {
                    emitter_primitives.insert(emitter, flat.triangles.len() as u32);
                }
                let (corners, normals) = self.triangle(primitive, index);
                flat.attributes.push(TriangleAttributes {
                    material: self.material_of(primitive, index),
                    emitter,
                });
                flat.normals.push(normals);
                flat.uvs.extend(self.uvs.get(primitive as usize));
                if !self.tangents.is_empty() {
                    flat.tangents.push(self.tangents_at(primitive, index));
                }
                flat.colors.extend(self.colors.get(primitive as usize));
                flat.second_uvs
                    .extend(self.second_uvs.get(primitive as usize));
                flat.triangles.push(corners);
            }
        }
        let shift = flat.triangles.len() as i64 - self.triangles.len() as i64;
        for (index, emitter) in flat.emitters.iter_mut().enumerate() {
            let primitive = match emitter_primitives.get(&(index as u32)) {
                Some(flattened) => *flattened,
                None if emitter.primitive as usize >= self.triangles.len() => {
                    (i64::from(emitter.primitive) + shift) as u32
                }
                None => emitter.primitive,
            };
            *emitter = Emitter {
                primitive,
                instance: NONE,
                ..*emitter
            };
        }
        Ok(flat)
    }
}

impl Instance {
    /// Transforms the mesh's vertex normals to the world, on the front side of the transformed
    /// vertices.
    #[inline]
    fn normals(&self, normals: [Vec3; 3], [a, b, c]: [Vec3; 3]) -> [Vec3; 3] {
        let front = (b - a).cross(c - a).normalize_or_zero();
        on_front_side(
            normals.map(|n| (self.normal_to_world * n).normalize_or(front)),
            front,
        )
    }
}
