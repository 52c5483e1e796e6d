//! Selection of meshes that are stored once, and placement of their instances.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3, Mat3, Vec3};
use serde::{Deserialize, Serialize};

use super::corners::cofactor;
use super::instance::{Instance, SharedMesh};
use super::mesh::{
    MeshEntity, area_and_front, in_range, note_dropped, on_front_side, push_emitter,
};
use super::{CompiledScene, NONE, TriangleAttributes, corners, tangents};
use crate::math::distribution::AliasTable;
use crate::scene::desc::place::{box_corners, box_of};
use crate::scene::{Note, SceneError};

/// Policy for a mesh that several entities use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sharing {
    /// Stores a mesh once if it has at least [`MIN_SHARED_TRIANGLES`] triangles and the scene would
    /// otherwise have more than [`SHARED_FROM`] primitives. Smaller scenes use plain triangles,
    /// which rays find faster.
    #[default]
    Auto,
    /// Stores every such mesh once.
    Always,
    /// Stores triangles for every entity.
    Never,
}

/// Number of triangles and spheres of a scene above which [`Sharing::Auto`] shares meshes.
pub const SHARED_FROM: usize = 1 << 20;

/// Least number of triangles of a mesh that [`Sharing::Auto`] shares.
pub const MIN_SHARED_TRIANGLES: usize = 32;

/// Greatest distance of a shared mesh from its own origin, relative to its size. Meshes that are
/// farther away are not shared, because rays in object space would lose precision.
const MAX_OFFSET: f32 = 16.0;

/// Least and greatest factor by which an instance may scale in any direction, and the greatest
/// ratio of the two.
const SCALE_LIMITS: [f64; 3] = [1e-6, 1e6, 1e4];

/// Relative deviation up to which the scale of an instance counts as uniform.
const UNIFORM_TOLERANCE: f64 = 1e-5;

/// Properties that entities must have in common to be instances of one mesh.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct SharingKey {
    mesh: [u8; 32],
    mirrors: bool,
    /// Whether the material of each slot emits light.
    emits: Vec<bool>,
    /// Whether the material of each slot has flat normals.
    flat: Vec<bool>,
    tangents: bool,
}

impl SharingKey {
    fn new(entity: &MeshEntity, scene: &CompiledScene) -> SharingKey {
        let materials = || {
            let indices = entity.materials.iter();
            indices.map(|index| &scene.materials[*index as usize])
        };
        SharingKey {
            mesh: entity.mesh.content_hash,
            mirrors: entity.mirrors(),
            emits: materials().map(|m| m.emission != Vec3::ZERO).collect(),
            flat: materials().map(|m| m.flat_normals).collect(),
            tangents: entity
                .materials
                .iter()
                .any(|index| scene.uses_tangents(*index)),
        }
    }
}

/// Returns whether an entity can be an instance: its transform is invertible without loss of
/// precision, and the precomputed attributes of the mesh are valid under it.
fn can_share(entity: &MeshEntity, key: &SharingKey) -> bool {
    let linear = entity.to_world.matrix3;
    let lengths = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
    let [least, greatest] = [
        lengths.iter().copied().fold(f64::INFINITY, f64::min),
        lengths.into_iter().fold(0.0, f64::max),
    ];
    let [low, high, ratio] = SCALE_LIMITS;
    let orthogonal = |a: DVec3, b: DVec3| a.dot(b).abs() <= UNIFORM_TOLERANCE * greatest * greatest;
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let uniform = greatest - least <= UNIFORM_TOLERANCE * greatest
        && orthogonal(x, y)
        && orthogonal(y, z)
        && orthogonal(z, x);
    let invertible = linear.determinant().abs() * ratio >= greatest.powi(3);
    let [near, far] = box_of(&entity.mesh.positions);
    let size = (far - near).max_element();
    let near_origin = near.abs().max(far.abs()).max_element() <= MAX_OFFSET * size;
    let is_in_range = |corner: Vec3| {
        let world = entity.to_world.transform_point3(corner.as_dvec3());
        in_range(world.as_vec3())
    };
    least >= low
        && greatest <= high
        && invertible
        && near_origin
        && box_corners([near, far]).into_iter().all(is_in_range)
        // Tangents are averages, which a non-uniform scale would weight differently.
        && (uniform || !key.tangents)
        && (!key.emits.contains(&true) || emissive_areas(entity, key).all(|area| area > 0.0))
}

/// Returns the world-space areas of the emissive triangles of an entity.
fn emissive_areas(entity: &MeshEntity, key: &SharingKey) -> impl Iterator<Item = f32> {
    let triangles = entity.mesh.triangles.iter().zip(&entity.mesh.triangle_slot);
    triangles
        .filter(|(_, slot)| key.emits[**slot as usize])
        .filter_map(|(corners, _)| {
            let object = corners.map(|i| entity.mesh.positions[i as usize]);
            area_and_front(&object)?;
            let world = object.map(|p| entity.to_world.transform_point3(p.as_dvec3()).as_vec3());
            Some(area_and_front(&world).map_or(0.0, |(area, _)| area))
        })
}

/// Entities that become instances, grouped by shared mesh.
#[derive(Default)]
pub(super) struct InstanceGroups<'a>(Vec<(SharingKey, Vec<MeshEntity<'a>>)>);

/// Moves the entities that become instances out of `entities`. The others keep their order.
pub(super) fn extract_instances<'a>(
    scene: &CompiledScene,
    entities: &mut Vec<MeshEntity<'a>>,
    sharing: Sharing,
) -> InstanceGroups<'a> {
    let total = entities
        .iter()
        .map(|entity| entity.mesh.triangles.len())
        .fold(0usize, usize::saturating_add);
    let least = match sharing {
        Sharing::Never => return InstanceGroups::default(),
        Sharing::Auto if total <= SHARED_FROM => return InstanceGroups::default(),
        Sharing::Auto => MIN_SHARED_TRIANGLES,
        Sharing::Always => 1,
    };
    let mut counts: BTreeMap<SharingKey, usize> = BTreeMap::new();
    let keys: Vec<Option<SharingKey>> = entities
        .iter()
        .map(|entity| {
            let key = SharingKey::new(entity, scene);
            (entity.mesh.triangles.len() >= least && can_share(entity, &key)).then_some(key)
        })
        .collect();
    for key in keys.iter().flatten() {
        *counts.entry(key.clone()).or_default() += 1;
    }
    let mut indices: BTreeMap<SharingKey, usize> = BTreeMap::new();
    let mut groups: InstanceGroups = InstanceGroups::default();
    let mut rest = Vec::with_capacity(entities.len());
    for (entity, key) in entities.drain(..).zip(keys) {
        match key.filter(|key| counts[key] > 1) {
            Some(key) => {
                let index = *indices.entry(key.clone()).or_insert_with(|| {
                    groups.0.push((key, Vec::new()));
                    groups.0.len() - 1
                });
                groups.0[index].1.push(entity);
            }
            None => rest.push(entity),
        }
    }
    *entities = rest;
    groups
}

impl InstanceGroups<'_> {
    /// Returns the number of triangles of all shared meshes, each counted once.
    pub fn triangles(&self) -> usize {
        self.0
            .iter()
            .filter_map(|(_, entities)| entities.first())
            .map(|entity| entity.mesh.triangles.len())
            .sum()
    }

    /// Appends the shared meshes and their instances to the scene.
    ///
    /// # Errors
    /// Fails if the scene would have more emissive triangles than light sampling supports.
    pub fn add_to(
        &self,
        scene: &mut CompiledScene,
        notes: &mut Vec<Note>,
    ) -> Result<(), SceneError> {
        let mut flattened_start = scene.triangles.len() as u32;
        for (key, entities) in &self.0 {
            let Some(first) = entities.first() else {
                continue;
            };
            let mesh = add_shared_mesh(scene, first, key, notes);
            let lights = mesh.emissive.len().saturating_mul(entities.len());
            if lights.saturating_add(scene.emitters.len()) >= AliasTable::MAX_ITEMS {
                let problem = format!(
                    "the instances of `{}` have {lights} emissive triangles; at most {} are \
                     supported",
                    first.place,
                    AliasTable::MAX_ITEMS - 1
                );
                return Err(SceneError::malformed("", "entities", problem));
            }
            for entity in entities {
                add_instance(scene, entity, &mesh, key.mirrors, flattened_start);
                flattened_start = flattened_start.wrapping_add(mesh.triangles.len() as u32);
            }
            scene.instances.meshes.push(mesh);
        }
        Ok(())
    }
}

/// Appends an instance of `mesh`, which will be the next shared mesh, and its emitters.
fn add_instance(
    scene: &mut CompiledScene,
    entity: &MeshEntity,
    mesh: &SharedMesh,
    mirrors: bool,
    flattened_start: u32,
) {
    let instance = scene.instances.placements.len() as u32;
    let emitters = scene.emitters.len() as u32;
    let sign = if mirrors { -1.0 } else { 1.0 };
    let normal = cofactor(entity.to_world.matrix3) * sign;
    // Only the direction of a transformed normal matters; its length is kept near one.
    let longest = [normal.x_axis, normal.y_axis, normal.z_axis]
        .map(DVec3::length)
        .into_iter()
        .fold(0.0, f64::max);
    scene.instances.placements.push(Instance {
        mesh: scene.instances.meshes.len() as u32,
        to_world: entity.to_world,
        normal_to_world: Mat3::from_cols(
            (normal.x_axis / longest).as_vec3(),
            (normal.y_axis / longest).as_vec3(),
            (normal.z_axis / longest).as_vec3(),
        ),
        materials: scene.instances.materials.len() as u32,
        emitters,
        flattened_start,
    });
    scene.entities.instances.push(entity.index);
    scene
        .instances
        .materials
        .extend_from_slice(&entity.materials);
    for primitive in &mesh.emissive {
        let area =
            area_and_front(&scene.corners(*primitive, instance)).map_or(0.0, |(area, _)| area);
        push_emitter(scene, *primitive as usize, instance, area);
    }
}

/// Appends the triangles of a shared mesh in object space.
fn add_shared_mesh(
    scene: &mut CompiledScene,
    entity: &MeshEntity,
    key: &SharingKey,
    notes: &mut Vec<Note>,
) -> SharedMesh {
    let mesh = entity.mesh;
    let start = scene.triangles.len();
    let mut emissive = Vec::new();
    let mut given = Vec::new();
    let mut dropped = [0usize; 2];
    for (indices, slot) in mesh.triangles.iter().zip(&mesh.triangle_slot) {
        let indices = if key.mirrors {
            [indices[0], indices[2], indices[1]]
        } else {
            *indices
        };
        let emits = key.emits[*slot as usize];
        let points = indices.map(|i| mesh.positions[i as usize]);
        let Some((_, front)) = area_and_front(&points) else {
            dropped[usize::from(emits)] += 1;
            continue;
        };
        // Normal of vertices without one. The reversed vertices of a mirrored mesh have the
        // opposite front in object space, and so do its normals.
        let front = if key.mirrors { -front } else { front };
        let emitter = if emits { emissive.len() as u32 } else { NONE };
        if emits {
            emissive.push(scene.triangles.len() as u32);
        }
        let flat = key.flat[*slot as usize];
        let normals = indices.map(|i| {
            mesh.normals
                .get(i as usize)
                .filter(|_| !flat)
                .map_or(front, |n| n.normalize_or(front))
        });
        // Tangents are computed from normals on the front side, which uniform scales preserve.
        let placed = if key.tangents {
            on_front_side(normals, front)
        } else {
            normals
        };
        let map = (&DMat3::IDENTITY, key.mirrors);
        given.extend(tangents::given(mesh, indices, map, [normals, placed]));
        scene.attributes.push(TriangleAttributes {
            material: *slot,
            emitter,
        });
        scene.normals.push(placed);
        scene.triangles.push(points);
        corners::push(scene, mesh, indices);
    }
    let needs = (key.tangents, !mesh.uvs.is_empty());
    tangents::add(scene, start, needs, &given);
    note_dropped(dropped, entity, notes);
    SharedMesh {
        triangles: start as u32..scene.triangles.len() as u32,
        emissive,
    }
}
