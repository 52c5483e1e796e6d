//! Which light a sample goes to.

use std::collections::BTreeMap;

use super::bounds::Ball;
use super::environment::Surroundings;
use super::{LightId, area, luminance};
use crate::scene::CompiledScene;
use crate::scene::compile::{NONE, Texture};
use crate::transport::surface::lookup;
use crate::value::Value;
use crate::value::schema::{Field, Ty};

/// The key `select` of every integrator that chooses among lights.
pub const FIELD: Field = Field {
    key: "select",
    ty: Ty::Word(&["uniform", "area", "power"]),
    required: false,
    default: "power",
    doc: "how likely each light is chosen: all alike, in proportion to its area (the first source's way), or to the \
          power that it sends into the scene",
};

/// How one light is chosen among all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Select {
    /// Every light with the same probability.
    Uniform,
    /// Emissive primitives in proportion to their area, so that all points of all of them are equally likely. A light
    /// without an area counts as much as the mean primitive.
    Area,
    /// In proportion to the luminance of what each sends out; for a light from outside, of what enters the ball around
    /// the scene.
    #[default]
    Power,
}

impl Select {
    /// Names in scripts with what they mean.
    pub const NAMES: [(&'static str, Select); 3] =
        [("uniform", Select::Uniform), ("area", Select::Area), ("power", Select::Power)];

    /// The choice with this name.
    pub fn named(name: &str) -> Option<Select> {
        Select::NAMES.iter().find(|(n, _)| *n == name).map(|(_, s)| *s)
    }

    /// The choice that the parameter `select` of an integrator asks for; the default where it has none.
    pub fn of(params: &BTreeMap<String, Value>) -> Select {
        params.get(FIELD.key).and_then(Value::as_str).and_then(Select::named).unwrap_or_default()
    }
}

/// Points of a triangle's texture that are looked at to guess how brightly it shines.
const PROBES: u32 = 16;

/// Part of the whole texture's brightness in the guess, so that a light whose bright spot no probe met is still chosen.
const WHOLE: f64 = 0.1;

/// The weights of all lights, by index. Every light that shines has one above zero.
pub(super) fn weights(
    scene: &CompiledScene,
    select: Select,
    ids: impl Iterator<Item = LightId>,
    ball: &Ball,
    surroundings: Option<&Surroundings>,
) -> Vec<f64> {
    let emitters = scene.emitters.len().max(1) as f64;
    let mean_area = scene.emitters.iter().map(|e| f64::from(e.area)).sum::<f64>() / emitters;
    let without_area = if mean_area > 0.0 { mean_area } else { 1.0 };
    let brightness: Vec<f64> = scene.textures.iter().map(mean_luminance).collect();
    let disk = f64::from(ball.disk_area());
    ids.map(|id| match (select, id) {
        (Select::Uniform, _) => 1.0,
        (Select::Area, LightId::Emitter(i)) => f64::from(scene.emitters[i as usize].area),
        (Select::Area, _) => without_area,
        (Select::Power, LightId::Emitter(i)) => emitter_power(scene, i, &brightness),
        (Select::Power, LightId::Point(i)) => {
            let light = &scene.points[i as usize];
            4.0 * std::f64::consts::PI * light.cone.share() * luminance(light.intensity)
        }
        (Select::Power, LightId::Directional(i)) => disk * luminance(scene.directionals[i as usize].irradiance),
        (Select::Power, LightId::Environment) => disk * surroundings.map_or(0.0, Surroundings::power),
    })
    .collect()
}

/// Luminance that an emissive primitive sends out on its front.
fn emitter_power(scene: &CompiledScene, i: u32, brightness: &[f64]) -> f64 {
    let m = area::material(scene, i);
    let plain = std::f64::consts::PI * f64::from(scene.emitters[i as usize].area) * luminance(m.emission);
    if m.emission_texture == NONE {
        return plain;
    }
    let side = PROBES.isqrt();
    let probe = |k: u32| {
        let u = [(k % side) as f32 + 0.5, (k / side) as f32 + 0.5].map(|x| x / side as f32);
        let uv = area::sample(scene, i, u).uv;
        luminance(lookup(&scene.textures, m.emission_texture, uv, m.tiling))
    };
    let seen = (0..PROBES).map(probe).sum::<f64>() / f64::from(PROBES);
    plain * (seen + WHOLE * brightness[m.emission_texture as usize])
}

fn mean_luminance(texture: &Texture) -> f64 {
    let sum: f64 = texture.texels.iter().map(|t| luminance(glam::Vec3::from_array(*t))).sum();
    sum / texture.texels.len().max(1) as f64
}
