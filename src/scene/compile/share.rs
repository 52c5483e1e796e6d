//! Which meshes are kept once, and how their copies are placed.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3};

use super::flatten::{area_and_front, in_range, malformed, note_dropped, on_front_side, push_emitter};
use super::instance::{Instance, SharedMesh, cofactor};
use super::{CompiledScene, NONE, TriangleAttributes, corners, tangents};
use crate::math::distribution::Alias;
use crate::scene::desc::MeshDesc;
use crate::scene::{Note, SceneError};

/// What becomes of a mesh that several entities have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sharing {
    /// It is kept once where the scene would have more than [`SHARED_FROM`] triangles and it has no less than
    /// [`WORTHWHILE`] of them. Below that copies are triangles like all others, since rays find those faster.
    #[default]
    Auto,
    /// It is kept once.
    Always,
    /// Every copy has triangles of its own.
    Never,
}

/// Triangles and spheres of a scene above which [`Sharing::Auto`] keeps meshes once.
pub const SHARED_FROM: usize = 1 << 20;

/// Triangles of a mesh from which on [`Sharing::Auto`] keeps it once.
pub const WORTHWHILE: usize = 32;

/// Greatest ratio of how far a mesh lies from its own origin to its size. Farther ones are not shared, because rays in their
/// space would lose digits that they have in the world.
const FAR: f32 = 16.0;

/// Least and greatest factor by which a copy may stretch in any direction, and the greatest ratio of the two.
const STRETCH: [f64; 3] = [1e-6, 1e6, 1e4];

/// Up to this part a copy counts as evenly scaled.
const EVEN: f64 = 1e-5;

/// An entity that has a mesh.
pub(super) struct Part<'a> {
    pub mesh: &'a MeshDesc,
    /// For every slot of the mesh its row of the scene's materials.
    pub rows: Vec<u32>,
    /// Where the description has it.
    pub place: String,
    pub to_world: DAffine3,
}

impl Part<'_> {
    /// Whether it turns inside out.
    pub fn mirrors(&self) -> bool {
        self.to_world.matrix3.determinant() < 0.0
    }

    /// What copies of one mesh have in common.
    fn kind(&self, scene: &CompiledScene) -> Kind {
        Kind {
            mesh: self.mesh.content_hash,
            mirrors: self.mirrors(),
            shines: self.rows.iter().map(|row| scene.materials[*row as usize].emission != Vec3::ZERO).collect(),
            tangents: self.rows.iter().any(|row| scene.uses_tangents(*row)),
        }
    }

    /// Whether it can be a copy: its place can be undone without losing digits, and what is precomputed of the mesh
    /// holds there as well.
    fn can_share(&self, kind: &Kind) -> bool {
        let linear = self.to_world.matrix3;
        let lengths = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
        let [least, greatest] =
            [lengths.iter().copied().fold(f64::INFINITY, f64::min), lengths.into_iter().fold(0.0, f64::max)];
        let [low, high, ratio] = STRETCH;
        let even = |a: DVec3, b: DVec3| a.dot(b).abs() <= EVEN * greatest * greatest;
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
        let similar = greatest - least <= EVEN * greatest && even(x, y) && even(y, z) && even(z, x);
        let solid = linear.determinant().abs() * ratio >= greatest.powi(3);
        let [near, far] = extent(&self.mesh.positions);
        let size = (far - near).max_element();
        let about = near.abs().max(far.abs()).max_element() <= FAR * size;
        let corner =
            |i: usize| Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { near[axis] } else { far[axis] }));
        let reaches = |i| in_range(self.to_world.transform_point3(corner(i).as_dvec3()).as_vec3());
        least >= low
            && greatest <= high
            && solid
            && about
            && (0..8).all(reaches)
            // Tangents are averages that uneven scales would weigh otherwise.
            && (similar || !kind.tangents)
            && (!kind.shines.contains(&true) || self.areas(kind).all(|area| area > 0.0))
    }

    /// The areas in the world of the triangles that shine.
    fn areas(&self, kind: &Kind) -> impl Iterator<Item = f32> {
        let of = self.mesh.triangles.iter().zip(&self.mesh.triangle_slot);
        of.filter(|(_, slot)| kind.shines[**slot as usize]).filter_map(|(corners, _)| {
            let own = corners.map(|i| self.mesh.positions[i as usize]);
            area_and_front(&own)?;
            let world = own.map(|p| self.to_world.transform_point3(p.as_dvec3()).as_vec3());
            Some(area_and_front(&world).map_or(0.0, |(area, _)| area))
        })
    }
}

/// The corners of the box around points.
fn extent(points: &[Vec3]) -> [Vec3; 2] {
    points.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(*p), high.max(*p)])
}

/// Parts of one kind can be copies of one mesh.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Kind {
    mesh: [u8; 32],
    mirrors: bool,
    /// By slot.
    shines: Vec<bool>,
    tangents: bool,
}

/// Parts that are copies, each mesh with all of its own.
#[derive(Default)]
pub(super) struct Copies<'a>(Vec<(Kind, Vec<Part<'a>>)>);

/// Takes from the parts those that are to be copies. What is left keeps its order.
pub(super) fn split<'a>(scene: &CompiledScene, parts: &mut Vec<Part<'a>>, sharing: Sharing) -> Copies<'a> {
    let total = parts.iter().map(|p| p.mesh.triangles.len()).fold(0usize, usize::saturating_add);
    let least = match sharing {
        Sharing::Never => return Copies::default(),
        Sharing::Auto if total <= SHARED_FROM => return Copies::default(),
        Sharing::Auto => WORTHWHILE,
        Sharing::Always => 1,
    };
    let mut groups: BTreeMap<Kind, usize> = BTreeMap::new();
    let kinds: Vec<Option<Kind>> = parts
        .iter()
        .map(|part| {
            let kind = part.kind(scene);
            (part.mesh.triangles.len() >= least && part.can_share(&kind)).then_some(kind)
        })
        .collect();
    for kind in kinds.iter().flatten() {
        *groups.entry(kind.clone()).or_default() += 1;
    }
    let mut rows: BTreeMap<Kind, usize> = BTreeMap::new();
    let mut copies: Copies = Copies::default();
    let mut rest = Vec::with_capacity(parts.len());
    for (part, kind) in parts.drain(..).zip(kinds) {
        match kind.filter(|kind| groups[kind] > 1) {
            Some(kind) => {
                let row = *rows.entry(kind.clone()).or_insert_with(|| {
                    copies.0.push((kind, Vec::new()));
                    copies.0.len() - 1
                });
                copies.0[row].1.push(part);
            }
            None => rest.push(part),
        }
    }
    *parts = rest;
    copies
}

impl Copies<'_> {
    /// Triangles of all meshes, each once.
    pub fn triangles(&self) -> usize {
        self.0.iter().filter_map(|(_, parts)| parts.first()).map(|part| part.mesh.triangles.len()).sum()
    }

    /// Adds the meshes behind what is in the world, and the copies.
    ///
    /// # Errors
    /// When more triangles shine than can be chosen among.
    pub fn place(&self, scene: &mut CompiledScene, notes: &mut Vec<Note>) -> Result<(), SceneError> {
        let mut first = scene.triangles.len() as u32;
        for (kind, parts) in &self.0 {
            let Some(part) = parts.first() else { continue };
            let mesh = add_shared(scene, part, kind, notes);
            let lights = mesh.shining.len().saturating_mul(parts.len());
            if lights.saturating_add(scene.emitters.len()) >= Alias::MAX_ITEMS {
                let problem = format!("copies of `{}` have {lights} triangles that shine", part.place);
                return Err(malformed(Path::new(""), "entities".to_owned(), problem));
            }
            let row = scene.instances.meshes.len() as u32;
            for part in parts {
                let instance = scene.instances.places.len() as u32;
                let emitters = scene.emitters.len() as u32;
                let sign = if kind.mirrors { -1.0 } else { 1.0 };
                // The length does not matter, so that it is kept near one.
                let normal = cofactor(part.to_world.matrix3) * sign;
                let longest =
                    [normal.x_axis, normal.y_axis, normal.z_axis].map(DVec3::length).into_iter().fold(0.0, f64::max);
                scene.instances.places.push(Instance {
                    mesh: row,
                    to_world: part.to_world,
                    normal_to_world: Mat3::from_cols(
                        (normal.x_axis / longest).as_vec3(),
                        (normal.y_axis / longest).as_vec3(),
                        (normal.z_axis / longest).as_vec3(),
                    ),
                    materials: scene.instances.materials.len() as u32,
                    emitters,
                    first,
                });
                scene.instances.materials.extend_from_slice(&part.rows);
                for primitive in &mesh.shining {
                    let area = area_and_front(&scene.corners(*primitive, instance)).map_or(0.0, |(area, _)| area);
                    push_emitter(scene, *primitive as usize, instance, area);
                }
                first = first.wrapping_add(mesh.triangles.len() as u32);
            }
            scene.instances.meshes.push(mesh);
        }
        Ok(())
    }
}

/// Adds a mesh in its own space.
fn add_shared(scene: &mut CompiledScene, part: &Part, kind: &Kind, notes: &mut Vec<Note>) -> SharedMesh {
    let mesh = part.mesh;
    let start = scene.triangles.len();
    let mut shining = Vec::new();
    let mut dropped = [0usize; 2];
    for (indices, slot) in mesh.triangles.iter().zip(&mesh.triangle_slot) {
        let indices = if kind.mirrors { [indices[0], indices[2], indices[1]] } else { *indices };
        let shines = kind.shines[*slot as usize];
        let points = indices.map(|i| mesh.positions[i as usize]);
        let Some((_, front)) = area_and_front(&points) else {
            dropped[usize::from(shines)] += 1;
            continue;
        };
        // Where the mesh has no normals, its front; mirrored corners show the other one, and so do mirrored normals.
        let front = if kind.mirrors { -front } else { front };
        let emitter = if shines { shining.len() as u32 } else { NONE };
        if shines {
            shining.push(scene.triangles.len() as u32);
        }
        let normals = indices.map(|i| mesh.normals.get(i as usize).map_or(front, |n| n.normalize_or(front)));
        scene.attributes.push(TriangleAttributes {
            // Tangents are made of normals on the front side, which even scales do not change.
            normals: if kind.tangents { on_front_side(normals, front) } else { normals },
            uvs: indices.map(|i| mesh.uvs.get(i as usize).copied().unwrap_or(Vec2::ZERO)),
            material: *slot,
            emitter,
        });
        scene.triangles.push(points);
        corners::push(scene, mesh, indices);
    }
    tangents::add(scene, start, kind.tangents, !mesh.uvs.is_empty());
    note_dropped(dropped, part, notes);
    SharedMesh { triangles: start as u32..scene.triangles.len() as u32, shining }
}
