//! Surfaces with delays: `Separable`, `Composed` and `TemporalProfile`, the extensions of Mitsuba
//! in thesis S2 (docs/inside/transport.md; its figure B.3).
//!
//! A `Composed` surface of two components has the `weight` of the first; one of several has
//! `weights`, a string of as many numbers. A profile is `ConstantTP` with `delay`, `ExponentialTP`
//! with `rate`, or `PosEpanTP` with `mean` and `sigma`; a parameter may be a texture, whose texels
//! are used as stored.

use std::rc::Rc;

use super::MitsubaLoader;
use super::tree::{Property, XmlObject};
use super::values::truncated;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{DelayKind, MaterialDesc, TextureSlot};

/// Returns whether a surface is `Separable` or `Composed`.
pub(super) fn is_delayed(o: &XmlObject) -> bool {
    matches!(
        o.plugin.as_str(),
        "Separable" | "separable" | "Composed" | "composed"
    )
}

/// Converts such a surface to a material with the given name, the last one returned. `two_sided`
/// is set inside of `twosided`.
pub(super) fn read(
    loader: &mut MitsubaLoader,
    o: &Rc<XmlObject>,
    name: &str,
    two_sided: bool,
) -> Result<Vec<MaterialDesc>, SceneError> {
    let inside = o.surfaces();
    if o.plugin.eq_ignore_ascii_case("composed") {
        return composed(loader, o, name, &inside, two_sided).map(|material| vec![material]);
    }
    let [inner] = &inside[..] else {
        return Err(o.error(format!(
            "a `{}` needs exactly one surface inside, found {}",
            o.plugin,
            inside.len()
        )));
    };
    let mut materials = if is_delayed(inner) {
        let part = loader.surface(inner, Some(name), two_sided)?;
        vec![MaterialDesc {
            parts: vec![part],
            weights: vec![1.0],
            ..MaterialDesc::new(name)
        }]
    } else {
        super::bsdf::read(inner, name, two_sided, loader)?
    };
    let profiles = o
        .children("TemporalProfile")
        .chain(o.children("temporal_profile"));
    let Some(profile) = profiles.last().cloned() else {
        return Err(o.error(format!("a `{}` needs a `TemporalProfile`", o.plugin)));
    };
    if let Some(material) = materials.last_mut() {
        read_profile(loader, &profile, material)?;
    }
    Ok(materials)
}

/// Converts a `Composed` surface.
fn composed(
    loader: &mut MitsubaLoader,
    o: &Rc<XmlObject>,
    name: &str,
    inside: &[Rc<XmlObject>],
    two_sided: bool,
) -> Result<MaterialDesc, SceneError> {
    if inside.is_empty() {
        return Err(o.error("a `Composed` needs surfaces inside"));
    }
    let mut material = MaterialDesc::new(name);
    for part in inside {
        material
            .parts
            .push(loader.surface(part, Some(name), two_sided)?);
    }
    material.weights = match o.numbers("weights")? {
        Some(weights) => weights,
        None if inside.len() == 2 => {
            let first = o.number("weight", 0.5)? as f32;
            vec![first, 1.0 - first]
        }
        None => {
            return Err(
                o.error("a `Composed` of more than two surfaces, or of one, needs `weights`")
            );
        }
    };
    Ok(material)
}

/// Reads a temporal profile into a material.
fn read_profile(
    loader: &mut MitsubaLoader,
    o: &XmlObject,
    m: &mut MaterialDesc,
) -> Result<(), SceneError> {
    let params: &[(&[&str], TextureSlot)] = match o.plugin.as_str() {
        "ConstantTP" | "constant" => {
            m.delay.kind = DelayKind::Constant;
            &[(&["delay", "c"], TextureSlot::DelayConstant)]
        }
        "ExponentialTP" | "exponential" => {
            m.delay.kind = DelayKind::Exponential;
            &[(&["rate", "lambda"], TextureSlot::DelayRate)]
        }
        "PosEpanTP" | "EpanechnikovTP" | "epanechnikov" => {
            m.delay.kind = DelayKind::Epanechnikov;
            &[
                (&["mean", "mu"], TextureSlot::DelayMean),
                (&["sigma", "width"], TextureSlot::DelayWidth),
            ]
        }
        other => {
            return Err(o.error(format!(
                "unknown profile `{}`; supported: ConstantTP, ExponentialTP, PosEpanTP",
                truncated(other)
            )));
        }
    };
    for (names, slot) in params {
        let Some(name) = names.iter().find(|name| o.property(name).is_some()) else {
            return Err(o.error(format!("a `{}` needs `{}`", o.plugin, names[0])));
        };
        let value = match o.property(name) {
            Some(Property::Object(t)) => {
                if let Some(read) = loader.textures.read(t, &mut loader.notes)?
                    && let Err(e) = read.apply_relative(m, *slot)
                {
                    loader.notes.push(t.note(e.to_string()));
                }
                1.0
            }
            _ => o.number(name, 0.0)? as f32,
        };
        let param = match slot {
            TextureSlot::DelayConstant => &mut m.delay.constant,
            TextureSlot::DelayRate => &mut m.delay.rate,
            TextureSlot::DelayMean => &mut m.delay.mean,
            _ => &mut m.delay.width,
        };
        *param = [value, 0.0];
    }
    Ok(())
}
