//! `s:import`: adds another scene file to a scene.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Affine3A;
use mlua::Value as LuaValue;

use super::schema::IMPORT;
use super::{SceneBuilder, part};
use crate::api::Args;
use crate::error::ScriptError;
use crate::kind::kind;
use crate::state::Purpose;
use crate::strict::Fields;
use lumbre_light::scene::desc::place::double;
use lumbre_light::scene::desc::{
    CowVec, EntityDesc, LightDesc, MaterialDesc, MeshDesc, SceneDesc, ShapeDesc, mesh_hash,
};
use lumbre_light::scene::shape;
use lumbre_scene_io::load;

/// Implements `s:import`: adds the entities and materials of another scene file.
///
/// # Errors
/// Returns an error for invalid options or an unreadable file.
pub fn import(args: &Args) -> Result<LuaValue, ScriptError> {
    let name = args.text(0, "file")?;
    let fields = args.options(1, &IMPORT, "import", "{ prefix = \"sponza/\" }")?;
    let frame = match fields.objects.get("place") {
        None => Affine3A::IDENTITY,
        Some(LuaValue::Table(t)) => part::frame(args, t, "import.place")?,
        Some(other) => {
            return Err(args.error(
                format!("place: expected a table, found {}", kind(other)),
                None,
            ));
        }
    };
    let Purpose::Scene { missing, .. } = args.shared.purpose else {
        return Ok(LuaValue::Nil);
    };
    let path = args.shared.folder.join(&name);
    let watchdog = &args.shared.watchdog;
    let read = watchdog.pause_for(|| load::load_with(&path, missing));
    let (other, mut notes) = read.map_err(|e| args.error(e.to_string(), None))?;
    let mut builder = args.shared.scene.borrow_mut();
    builder.notes.append(&mut notes);
    if let Some(material) = fields.text("material") {
        builder
            .requested_materials
            .entry(material.to_owned())
            .or_insert_with(|| args.place.clone());
    }
    adopt_scene(&mut builder, other, &fields, frame);
    Ok(LuaValue::Nil)
}

/// Adds the materials, entities and lights of another scene under the options of `s:import`.
fn adopt_scene(builder: &mut SceneBuilder, other: SceneDesc, fields: &Fields, frame: Affine3A) {
    let prefix = fields.text("prefix").unwrap_or_default();
    let material = fields.text("material");
    let renamed = adopt_materials(builder, other.materials, prefix, material);
    for mut entity in other.entities {
        entity.transform.frame = double(frame) * entity.transform.frame;
        if let (Some("plane"), ShapeDesc::Mesh(mesh)) = (fields.text("project"), &entity.shape)
            && mesh.uvs.is_empty()
        {
            entity.shape = ShapeDesc::Mesh(Arc::new(shape::projected(mesh)));
        }
        rename_materials(&mut entity, &renamed, material);
        entity.name = builder.names.allocate(&format!("{prefix}{}", entity.name));
        builder.desc.entities.push(entity);
    }
    if fields.is_true("lights") {
        builder
            .desc
            .lights
            .extend(other.lights.into_iter().map(|l| LightDesc {
                name: format!("{prefix}{}", l.name),
                ..l
            }));
        builder.desc.environment = other.environment.or(builder.desc.environment.take());
    }
}

/// Gives an imported entity the new names of its materials, or `material` if that is given.
fn rename_materials(
    entity: &mut EntityDesc,
    renamed: &BTreeMap<String, String>,
    material: Option<&str>,
) {
    let first = renamed.values().next().cloned();
    entity.material = match (material, &entity.material, &entity.shape) {
        (Some(material), _, _) => Some(material.to_owned()),
        (None, Some(own), _) => renamed.get(own).cloned().or_else(|| first.clone()),
        (None, None, ShapeDesc::Sphere { .. }) => first.clone(),
        (None, None, ShapeDesc::Mesh(mesh)) => {
            let slot = |s: &String| renamed.get(s).or(first.as_ref()).unwrap_or(s).clone();
            let slots: Vec<String> = mesh.slots.iter().map(slot).collect();
            if slots != mesh.slots {
                let mut named = MeshDesc {
                    slots,
                    ..(**mesh).clone()
                };
                named.content_hash = mesh_hash(&named);
                entity.shape = ShapeDesc::Mesh(Arc::new(named));
            }
            None
        }
    };
}

/// Adds the materials of another scene and returns their new names by their old ones. A material of
/// this scene with the same name replaces the file's; `replacement` replaces all of them.
fn adopt_materials(
    builder: &mut SceneBuilder,
    materials: CowVec<MaterialDesc>,
    prefix: &str,
    replacement: Option<&str>,
) -> BTreeMap<String, String> {
    let mut renamed = BTreeMap::new();
    for material in materials {
        if replacement.is_some() {
            break;
        }
        let name = format!("{prefix}{}", material.name);
        renamed.insert(material.name.clone(), name.clone());
        if builder.desc.material_index(&name).is_none() {
            builder
                .desc
                .materials
                .push(MaterialDesc { name, ..material });
        }
    }
    renamed
}
