//! Meshes and materials of entities, and which entities share them, for all exported formats.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::{DMat3, DVec3};

use lumbre_light::scene::Note;
use lumbre_light::scene::desc::place::{origin, shift};
use lumbre_light::scene::desc::{
    EntityDesc, FilterChoice, Lookup, MaterialDesc, MaterialNames, MeshDesc, SceneDesc,
    ShadingNormals, ShapeDesc, TextureSlot,
};

/// Properties that instances share: hash of the mesh, and material index of each slot.
pub(super) type InstanceKey = ([u8; 32], Vec<usize>);

/// Materials of entities, and the number of entities that share a mesh with its materials.
pub(super) struct MeshUses<'a> {
    names: MaterialNames<'a>,
    counts: BTreeMap<InstanceKey, usize>,
}

impl<'a> MeshUses<'a> {
    /// Counts the uses of all meshes of a scene.
    pub(super) fn new(desc: &'a SceneDesc) -> MeshUses<'a> {
        let mut uses = MeshUses {
            names: desc.material_names(),
            counts: BTreeMap::new(),
        };
        for entity in &desc.entities {
            if let ShapeDesc::Mesh(mesh) = &entity.shape {
                *uses.counts.entry(uses.key(entity, mesh)).or_default() += 1;
            }
        }
        uses
    }

    /// Returns what an entity with a mesh shares with its instances. Unknown names of materials
    /// select the first one.
    pub(super) fn key(&self, entity: &EntityDesc, mesh: &MeshDesc) -> InstanceKey {
        let slots = mesh.slots.iter();
        let rows = slots.map(|slot| self.row(entity.material.as_ref().unwrap_or(slot)));
        (mesh.content_hash, rows.collect())
    }

    /// Returns whether several entities have this key.
    pub(super) fn is_shared(&self, key: &InstanceKey) -> bool {
        self.counts[key] > 1
    }

    /// Returns the material index of a sphere.
    pub(super) fn sphere_row(&self, entity: &EntityDesc) -> usize {
        entity.material.as_ref().map_or(0, |name| self.row(name))
    }

    fn row(&self, name: &str) -> usize {
        self.names.index(name).unwrap_or(0)
    }
}

/// Returns the rotation of a sphere whose material depends on its coordinates: in Mitsuba and pbrt
/// the poles are on z and longitude starts at x; here on y, and at -z.
pub(super) fn sphere_rotation(material: Option<&MaterialDesc>) -> Option<DMat3> {
    let is_oriented = |m: &MaterialDesc| !m.textures.is_empty() || m.anisotropic > 0.0;
    material
        .is_some_and(is_oriented)
        .then(|| DMat3::from_cols(DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y))
}

/// Returns the note about an entity's own anisotropic direction, if it has one.
pub(super) fn direction_note(entity: &EntityDesc, program: &str) -> Option<Note> {
    entity.anisotropic_direction.map(|_| {
        Note::new(
            "",
            format!("entities.{}", entity.name),
            format!("`anisotropic_direction` is not supported by {program}; increasing u is used"),
        )
    })
}

/// Returns the scene as it is written: in [resolved choices](with_resolved_choices), and near the
/// origin, since other programs compute in single precision; with a note if it was moved.
pub(super) fn prepared(desc: &SceneDesc) -> (Cow<'_, SceneDesc>, Option<Note>) {
    let origin = origin(desc);
    if origin == DVec3::ZERO {
        return (with_resolved_choices(desc), None);
    }
    let mut near = desc.clone();
    shift(&mut near, -origin);
    let text = format!(
        "the scene lies far from the origin for its size; it is moved by ({}, {}, {})",
        -origin.x, -origin.y, -origin.z
    );
    let near = with_resolved_choices(&near).into_owned();
    (Cow::Owned(near), Some(Note::new("", "entities", text)))
}

/// Returns the scene with the filter of each material's textures as their own, and without the
/// normal and bump maps and the terminator offset of materials with flat normals.
fn with_resolved_choices(desc: &SceneDesc) -> Cow<'_, SceneDesc> {
    let chooses = |m: &MaterialDesc| {
        m.texture_filter != FilterChoice::Given || m.shading_normals != ShadingNormals::Smooth
    };
    if !desc.materials.iter().any(chooses) {
        return Cow::Borrowed(desc);
    }
    let mut resolved = desc.clone();
    for m in &mut resolved.materials {
        let textured = |slot: &TextureSlot| m.texture(*slot).is_some();
        for slot in TextureSlot::ALL
            .into_iter()
            .filter(textured)
            .collect::<Vec<_>>()
        {
            let own = m.lookup(slot);
            let filter = m.texture_filter.apply(own.filter);
            m.set_lookup(slot, Lookup { filter, ..own });
        }
        if m.shading_normals == ShadingNormals::Flat {
            m.set_texture(TextureSlot::Normal, None);
            m.set_texture(TextureSlot::Bump, None);
            m.shadow_terminator = false;
        }
    }
    Cow::Owned(resolved)
}
