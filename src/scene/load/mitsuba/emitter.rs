//! Lights: `area` on shapes, `constant`, `envmap`, `point`, `spot` and `directional`.

use std::rc::Rc;

use glam::{DAffine3, DVec3, Vec3};

use super::texture::Textures;
use super::texture_of;
use super::tree::Object;
use crate::scene::desc::{
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightKind, MaterialDesc, TextureSlot,
};
use crate::scene::{Note, SceneError};

/// A light without a shape.
pub(super) enum Light {
    /// What surrounds the scene.
    Around(EnvironmentDesc),
    /// A point or a direction.
    Unbound(LightKind),
}

/// Makes a material shine as an area light says.
pub(super) fn shine(
    material: &mut MaterialDesc,
    o: &Rc<Object>,
    textures: &mut Textures,
    notes: &mut Vec<Note>,
) -> Result<(), SceneError> {
    if let Some(t) = texture_of(o.item("radiance")) {
        if let Some(read) = textures.read(t, notes)? {
            if let Err(e) = read.lay(material, TextureSlot::Emission) {
                notes.push(t.note(e.to_string()));
            }
            material.emission = Vec3::ONE;
        }
        return Ok(());
    }
    material.emission = light(o, "radiance")?;
    if material.emission == Vec3::ZERO {
        notes.push(o.note("it is black: it does not shine"));
    }
    Ok(())
}

/// A colour of light: not negative.
fn light(o: &Object, key: &str) -> Result<Vec3, SceneError> {
    let color = o.color(key)?.unwrap_or(Vec3::ONE);
    if color.min_element() < 0.0 || color.max_element() > 1e9 {
        return Err(o.error(format!("`{key}` must lie between 0 and 1e9, found {color}")));
    }
    Ok(color)
}

/// Reads a light of the scene; `None`, with a note, where it is not known.
pub(super) fn read(
    o: &Rc<Object>,
    textures: &mut Textures,
    notes: &mut Vec<Note>,
) -> Result<Option<Light>, SceneError> {
    o.known(&["sampling_weight"]);
    match o.kind.as_str() {
        "constant" => {
            let source = EnvironmentSource::Color(light(o, "radiance")?);
            Ok(Some(Light::Around(EnvironmentDesc { source, rotation_deg: 0.0, scale: 1.0 })))
        }
        "envmap" => {
            let Some(file) = o.text("filename")? else { return Err(o.error("an `envmap` needs a `filename`")) };
            let scale = o.number("scale", 1.0)?;
            if !(0.0..=1e9).contains(&scale) {
                return Err(o.error(format!("`scale` must lie between 0 and 1e9, found {scale}")));
            }
            let rotation_deg = turn(o, &o.map("to_world")?, notes) as f32;
            let map = textures.image(o, file, false, notes)?;
            Ok(map.map(|map| {
                let source = EnvironmentSource::Map(map);
                Light::Around(EnvironmentDesc { source, rotation_deg, scale: scale as f32 })
            }))
        }
        "point" => {
            let at = match o.vector("position")? {
                Some(position) => position,
                None => o.map("to_world")?.translation.as_vec3(),
            };
            Ok(Some(Light::Unbound(LightKind::Point { position: at, intensity: light(o, "intensity")? })))
        }
        "spot" => {
            let map = o.map("to_world")?;
            let cutoff = o.number("cutoff_angle", 20.0)?;
            let beam = o.number("beam_width", 0.75 * cutoff)?;
            let cone = ConeDesc { beam_deg: beam as f32, cutoff_deg: cutoff as f32, edge: ConeEdge::Linear };
            let direction = map.transform_vector3(DVec3::Z).as_vec3();
            if !cone.is_possible() || direction.try_normalize().is_none() {
                return Err(o.error(format!("a beam of {beam} and a cutoff of {cutoff} degrees are no cone")));
            }
            if let Some(t) = texture_of(o.item("texture")) {
                notes.push(t.note("spots have no texture here: ignored"));
            }
            let (position, intensity) = (map.translation.as_vec3(), light(o, "intensity")?);
            Ok(Some(Light::Unbound(LightKind::Spot { position, direction, intensity, cone })))
        }
        "directional" => {
            let direction = match o.vector("direction")? {
                Some(direction) => direction,
                None => o.map("to_world")?.transform_vector3(DVec3::Z).as_vec3(),
            };
            if direction.try_normalize().is_none() {
                return Err(o.error("a `direction` must not be zero"));
            }
            Ok(Some(Light::Unbound(LightKind::Directional { direction, irradiance: light(o, "irradiance")? })))
        }
        other => {
            let shown = super::values::shorten(other);
            notes.push(o.note(format!("the light `{shown}` is not known: it is left out")));
            o.known(&o.items.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>());
            Ok(None)
        }
    }
}

/// The angle about +y of a rotation, in degrees; a note where it is another one.
fn turn(o: &Object, map: &DAffine3, notes: &mut Vec<Note>) -> f64 {
    let z = map.transform_vector3(DVec3::Z);
    let angle = z.x.atan2(z.z);
    let upright = DAffine3::from_rotation_y(angle);
    let straight = (0..3).all(|i| (upright.matrix3.col(i) - map.matrix3.col(i)).length() < 1e-4);
    if !straight {
        notes.push(o.note("an environment turns about the vertical axis only: the rest of `to_world` is ignored"));
    }
    angle.to_degrees()
}
