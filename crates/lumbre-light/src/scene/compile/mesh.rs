//! Triangles of mesh entities: checks, world-space triangles, and the rules that shared meshes
//! follow as well.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};

use super::corners::cofactor;
use super::resolver::MaterialResolver;
use super::{CompiledScene, Emitter, Material, NONE, TriangleAttributes, corners, tangents};
use crate::scene::desc::{EntityDesc, MAX_COORDINATE, MeshDesc, ShapeDesc};
use crate::scene::{Note, SceneError};

/// Least height of a triangle relative to its longest edge. Thinner triangles are left out: in
/// `f32` their normals are noise.
const MIN_RELATIVE_HEIGHT: f64 = 1e-7;

/// Cosine with the geometric normal to which vertex normals behind a triangle are tilted.
const GRAZING_COSINE: f32 = 1e-3;

/// An entity whose shape is a mesh.
pub(super) struct MeshEntity<'a> {
    /// Index of the entity in the description.
    pub index: u32,
    pub mesh: &'a MeshDesc,
    /// Index into the scene's materials for every slot of the mesh.
    pub materials: Vec<u32>,
    /// Location in the description, for notes and errors.
    pub place: String,
    pub to_world: DAffine3,
}

impl MeshEntity<'_> {
    /// Returns whether the transform mirrors the mesh.
    pub fn mirrors(&self) -> bool {
        self.to_world.matrix3.determinant() < 0.0
    }
}

/// Returns whether a point is finite and within the supported range of coordinates.
pub(super) fn in_range(p: Vec3) -> bool {
    p.is_finite() && p.abs().max_element() <= MAX_COORDINATE
}

/// Returns the entities that have a mesh, with their materials resolved and their meshes checked.
pub(super) fn mesh_entities<'a>(
    scene: &mut CompiledScene,
    resolver: &mut MaterialResolver<'a>,
) -> Result<Vec<MeshEntity<'a>>, SceneError> {
    let mut checked = BTreeSet::new();
    let mut entities = Vec::new();
    let desc = resolver.desc;
    for (index, entity) in desc.entities.iter().enumerate() {
        let ShapeDesc::Mesh(mesh) = &entity.shape else {
            continue;
        };
        let place = format!("entities.{}", entity.name);
        if checked.insert(Arc::as_ptr(mesh)) {
            check_arrays(mesh)
                .map_err(|problem| SceneError::malformed(&mesh.file, place.clone(), problem))?;
        }
        let materials: Vec<u32> = match &entity.material {
            Some(name) => vec![resolver.index(name, &mesh.file, &place); mesh.slots.len()],
            None => mesh
                .slots
                .iter()
                .map(|slot| resolver.index(slot, &mesh.file, &place))
                .collect(),
        };
        let materials = with_own_direction(scene, materials, entity);
        entities.push(MeshEntity {
            index: index as u32,
            mesh,
            materials,
            place,
            to_world: scene.placed_map(entity),
        });
    }
    Ok(entities)
}

/// Appends the triangles of an entity in world space, and their emitters.
///
/// # Errors
/// Fails if a vertex is beyond the range of coordinates.
pub(super) fn add_mesh(
    scene: &mut CompiledScene,
    entity: &MeshEntity,
    notes: &mut Vec<Note>,
) -> Result<(), SceneError> {
    let MeshEntity {
        mesh,
        materials,
        to_world,
        ..
    } = entity;
    let mirrors = entity.mirrors();
    let to_world_normal = cofactor(to_world.matrix3) * if mirrors { -1.0 } else { 1.0 };
    let world = world_positions(entity)?;
    let first = scene.triangles.len();
    scene.entities.meshes.push([first as u32, entity.index]);
    let mut dropped = [0usize; 2];
    let mut given = Vec::new();
    for (indices, slot) in mesh.triangles.iter().zip(&mesh.triangle_slot) {
        // A mirrored triangle keeps its front if its vertex order is reversed.
        let indices = if mirrors {
            [indices[0], indices[2], indices[1]]
        } else {
            *indices
        };
        let material = materials[*slot as usize];
        let emits = scene.materials[material as usize].emission != Vec3::ZERO;
        let points = indices.map(|i| world[i as usize]);
        let Some((area, front)) = area_and_front(&points) else {
            dropped[usize::from(emits)] += 1;
            continue;
        };
        let flat = scene.materials[material as usize].flat_normals;
        let normals = indices.map(|i| match mesh.normals.get(i as usize) {
            Some(n) if !flat => (to_world_normal * n.as_dvec3())
                .try_normalize()
                .map_or(front, DVec3::as_vec3),
            _ => front,
        });
        let emitter = if emits {
            push_emitter(scene, scene.triangles.len(), NONE, area)
        } else {
            NONE
        };
        let on_front = on_front_side(normals, front);
        let map = (&to_world.matrix3, mirrors);
        given.extend(tangents::given(mesh, indices, map, [normals, on_front]));
        scene
            .attributes
            .push(TriangleAttributes { material, emitter });
        scene.normals.push(on_front);
        scene.triangles.push(points);
        corners::push(scene, mesh, indices);
    }
    let needs_tangents = scene.attributes[first..]
        .iter()
        .any(|a| scene.uses_tangents(a.material));
    let needs = (needs_tangents, !mesh.uvs.is_empty());
    tangents::add(scene, first, needs, &given);
    note_dropped(dropped, entity, notes);
    Ok(())
}

/// Returns the vertices of an entity in world space.
///
/// # Errors
/// Fails if a vertex is beyond the range of coordinates.
fn world_positions(entity: &MeshEntity) -> Result<Vec<Vec3>, SceneError> {
    let world: Vec<Vec3> = entity
        .mesh
        .positions
        .iter()
        .map(|p| entity.to_world.transform_point3(p.as_dvec3()).as_vec3())
        .collect();
    match world.iter().position(|p| !in_range(*p)) {
        None => Ok(world),
        Some(i) => {
            let problem = format!(
                "vertex {i} is at {}; coordinates must be within {MAX_COORDINATE:e} of the origin",
                world[i]
            );
            Err(SceneError::malformed(
                &entity.mesh.file,
                entity.place.clone(),
                problem,
            ))
        }
    }
}

/// Notes how many triangles without area were left out: `dropped` counts those without and those
/// with emission.
pub(super) fn note_dropped(dropped: [usize; 2], entity: &MeshEntity, notes: &mut Vec<Note>) {
    for (n, what) in dropped.into_iter().zip(["", " of a light"]) {
        if n > 0 {
            notes.push(Note::new(
                entity.mesh.file.clone(),
                entity.place.clone(),
                format!("triangles{what} without area: {n} left out"),
            ));
        }
    }
}

/// Checks that the arrays of a mesh have consistent lengths and that all indices are in range.
fn check_arrays(mesh: &MeshDesc) -> Result<(), String> {
    let n = mesh.positions.len();
    let attributes = [
        ("normals", mesh.normals.len()),
        ("texture coordinates", mesh.uvs.len()),
        ("second texture coordinates", mesh.second_uvs.len()),
        ("tangents", mesh.tangents.len()),
        ("colours", mesh.colors.len()),
    ];
    for (what, len) in attributes {
        if len != 0 && len != n {
            return Err(format!("the mesh has {n} positions but {len} {what}"));
        }
    }
    if mesh.triangle_slot.len() != mesh.triangles.len() {
        let (t, s) = (mesh.triangles.len(), mesh.triangle_slot.len());
        return Err(format!(
            "the mesh has {t} triangles but {s} material slots for them"
        ));
    }
    if let Some(i) = mesh
        .triangles
        .as_flattened()
        .iter()
        .find(|i| **i as usize >= n)
    {
        return Err(format!(
            "a triangle refers to vertex {i}, but there are only {n}"
        ));
    }
    match mesh
        .triangle_slot
        .iter()
        .find(|s| **s as usize >= mesh.slots.len())
    {
        Some(s) => Err(format!(
            "a triangle refers to material slot {s}, but there are only {}",
            mesh.slots.len()
        )),
        None => Ok(()),
    }
}

/// Returns area and unit geometric normal of a triangle, or `None` if it is too thin to have them.
pub(super) fn area_and_front(points: &[Vec3; 3]) -> Option<(f32, Vec3)> {
    let [a, b, c] = points.map(Vec3::as_dvec3);
    let cross = (b - a).cross(c - a);
    let longest = (b - a)
        .length_squared()
        .max((c - a).length_squared())
        .max((c - b).length_squared());
    let area = (cross.length() / 2.0) as f32;
    let thin = cross.length() <= MIN_RELATIVE_HEIGHT * longest;
    let front = cross.try_normalize()?.as_vec3();
    (!thin && area > 0.0).then_some((area, front))
}

/// Returns vertex normals on the side of `front`: all are reversed if their mean points behind it,
/// and single ones are tilted.
pub(super) fn on_front_side(normals: [Vec3; 3], front: Vec3) -> [Vec3; 3] {
    let mean: Vec3 = normals.iter().sum();
    normals
        .map(|n| if mean.dot(front) < 0.0 { -n } else { n })
        .map(|n| {
            let cosine = n.dot(front);
            if cosine >= 0.0 {
                n
            } else {
                (n - (cosine - GRAZING_COSINE) * front)
                    .try_normalize()
                    .unwrap_or(front)
            }
        })
}

/// Returns material indices that use the entity's own direction of anisotropy: if it has one, a
/// modified copy of each material is appended to the scene.
pub(super) fn with_own_direction(
    scene: &mut CompiledScene,
    materials: Vec<u32>,
    entity: &EntityDesc,
) -> Vec<u32> {
    let Some(direction) = entity.anisotropic_direction else {
        return materials;
    };
    let mut copies = BTreeMap::new();
    let copy = |index: u32| {
        *copies.entry(index).or_insert_with(|| {
            let original = scene.materials[index as usize];
            scene.materials.push(Material {
                anisotropic_direction: direction,
                anisotropic_texture: NONE,
                ..original
            });
            scene.materials.len() as u32 - 1
        })
    };
    materials.into_iter().map(copy).collect()
}

/// Appends an emitter and returns its index.
pub(super) fn push_emitter(
    scene: &mut CompiledScene,
    primitive: usize,
    instance: u32,
    area: f32,
) -> u32 {
    scene.emitters.push(Emitter {
        primitive: primitive as u32,
        instance,
        area,
    });
    scene.emitters.len() as u32 - 1
}
