//! Surfaces that give light back later: `Separable`, `Composed` and `TemporalProfile`, as the third source adds them to
//! Mitsuba (its figure B.3).
//!
//! A `Composed` surface of two parts has the `weight` of the first; one of several has `weights`, a text of as many numbers. A
//! profile is `ConstantTP` with `delay`, `ExponentialTP` with `rate`, or `PosEpanTP` with `mean` and `sigma`; a parameter may be a
//! texture, whose values are taken as they are stored.

use std::rc::Rc;

use super::Builder;
use super::tree::{Item, Object};
use super::values::shorten;
use crate::scene::SceneError;
use crate::scene::desc::{DelayKind, MaterialDesc, TextureSlot};

/// Whether a surface is one of those of this module.
pub(super) fn is_delayed(o: &Object) -> bool {
    matches!(o.kind.as_str(), "Separable" | "separable" | "Composed" | "composed")
}

/// Reads one of them as a material of a name.
pub(super) fn read(builder: &mut Builder, o: &Rc<Object>, name: &str) -> Result<MaterialDesc, SceneError> {
    let inside: Vec<Rc<Object>> = o.children("bsdf").cloned().collect();
    if o.kind.eq_ignore_ascii_case("composed") {
        return composed(builder, o, name, &inside);
    }
    let [inner] = &inside[..] else {
        return Err(o.error(format!("a `{}` needs one surface inside, found {}", o.kind, inside.len())));
    };
    let mut material = if is_delayed(inner) {
        let part = builder.surface(inner, Some(name))?;
        MaterialDesc { parts: vec![part], weights: vec![1.0], ..MaterialDesc::new(name) }
    } else {
        super::bsdf::read(inner, name, &mut builder.textures, &mut builder.notes)?
    };
    let profiles = o.children("TemporalProfile").chain(o.children("temporal_profile"));
    let Some(profile) = profiles.last().cloned() else {
        return Err(o.error(format!("a `{}` needs a `TemporalProfile`", o.kind)));
    };
    fill(builder, &profile, &mut material)?;
    Ok(material)
}

fn composed(
    builder: &mut Builder,
    o: &Rc<Object>,
    name: &str,
    inside: &[Rc<Object>],
) -> Result<MaterialDesc, SceneError> {
    if inside.is_empty() {
        return Err(o.error("a `Composed` needs surfaces inside"));
    }
    let mut material = MaterialDesc::new(name);
    for part in inside {
        material.parts.push(builder.surface(part, Some(name))?);
    }
    material.weights = match o.text("weights")? {
        Some(text) => {
            let words = text.split([',', ' ']).filter(|w| !w.is_empty());
            let numbers: Result<Vec<f32>, _> = words.map(str::parse).collect();
            numbers.map_err(|_| o.error(format!("`weights` are numbers, found `{}`", shorten(text))))?
        }
        None if inside.len() == 2 => {
            let first = o.number("weight", 0.5)? as f32;
            vec![first, 1.0 - first]
        }
        None => return Err(o.error("a `Composed` of other than two surfaces needs `weights`")),
    };
    Ok(material)
}

/// Fills in the profile of a material.
fn fill(builder: &mut Builder, o: &Object, m: &mut MaterialDesc) -> Result<(), SceneError> {
    let params: &[(&[&str], TextureSlot)] = match o.kind.as_str() {
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
            &[(&["mean", "mu"], TextureSlot::DelayMean), (&["sigma", "width"], TextureSlot::DelayWidth)]
        }
        other => {
            let known = "known: ConstantTP, ExponentialTP, PosEpanTP";
            return Err(o.error(format!("the profile `{}` is not known ({known})", shorten(other))));
        }
    };
    for (names, slot) in params {
        let Some(name) = names.iter().find(|name| o.item(name).is_some()) else {
            return Err(o.error(format!("a `{}` needs `{}`", o.kind, names[0])));
        };
        let value = match o.item(name) {
            Some(Item::Object(t)) => {
                if let Some(read) = builder.textures.read(t, &mut builder.notes)?
                    && let Err(e) = read.lay(m, *slot)
                {
                    builder.notes.push(t.note(e.to_string()));
                }
                1.0
            }
            _ => o.number(name, 0.0)? as f32,
        };
        let at = match slot {
            TextureSlot::DelayConstant => &mut m.delay.constant,
            TextureSlot::DelayRate => &mut m.delay.rate,
            TextureSlot::DelayMean => &mut m.delay.mean,
            _ => &mut m.delay.width,
        };
        *at = [value, 0.0];
    }
    Ok(())
}
