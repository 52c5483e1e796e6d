//! Strategies for choosing a light for a sample, and the collection of all lights.

use std::collections::BTreeMap;

use super::bounds::BoundingSphere;
use super::environment::EnvironmentLight;
use super::source::{LightFacts, PowerContext};
use super::table::{LISTS, first_indices};
use super::{LightId, LightTree, Lights, point};
use crate::math::distribution::AliasTable;
use crate::math::luminance::luminance_of;
use crate::scene::CompiledScene;
use crate::scene::compile::{Emitter, Texture};
use crate::transport::integrator::IntegratorRow;
use crate::transport::mis::Heuristic;
use crate::value::Value;
use crate::value::schema::{Field, Ty};

/// The parameter `select` of every integrator that chooses among lights.
pub const FIELD: Field = crate::field! {
    select = "power": Ty::Word(&["uniform", "area", "power", "tree"]),
        "how likely each light is chosen: all alike, in proportion to its area (as in S0, see \
         docs/inside/transport.md), or to the power that it sends into the scene, where lights at \
         infinity and others have at least a third each; or by a tree over the lights, in about \
         proportion to the light that each may send to the shaded point [Conty Estevez and Kulla \
         2018], on the CPU"
};

/// The probability with which each light is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSelection {
    /// Every light has the same probability.
    Uniform,
    /// Emissive primitives in proportion to their area, so that all their points are equally
    /// likely. A light without an area counts as the mean primitive.
    Area,
    /// In proportion to the luminance of the emitted power; for an infinitely distant light, of the
    /// power that enters the bounding sphere of the scene. Infinitely distant lights together, and
    /// all others together, have at least a third where a scene has both.
    #[default]
    Power,
    /// By a tree over the lights, for each point: see [`LightTree`](super::tree::LightTree). Paths
    /// that start at lights choose them by power.
    Tree,
}

impl LightSelection {
    /// Names in scripts with their strategies.
    pub const NAMES: [(&'static str, LightSelection); 4] = [
        ("uniform", LightSelection::Uniform),
        ("area", LightSelection::Area),
        ("power", LightSelection::Power),
        ("tree", LightSelection::Tree),
    ];

    /// Returns the strategy with this name.
    pub fn from_name(name: &str) -> Option<LightSelection> {
        LightSelection::NAMES
            .iter()
            .find(|(n, _)| *n == name)
            .map(|(_, s)| *s)
    }

    /// Returns the strategy that the parameter `select` of an integrator names, or the default.
    pub fn from_params(params: &BTreeMap<String, Value>) -> LightSelection {
        params
            .get(FIELD.key)
            .and_then(Value::as_str)
            .and_then(LightSelection::from_name)
            .unwrap_or_default()
    }
}

/// The parameter `compensate` of integrators whose light sampling serves only to connect the
/// vertices of camera paths.
pub const COMPENSATE: Field = crate::field! {
    compensate = "true": Ty::Bool,
        "whether light sampling leaves the dark part of an environment map to the directions of the \
         BSDF, against which it is weighted: the density of a direction is in proportion to what \
         its light exceeds the mean by [Karlik et al. 2019]; never with mis = \"none\""
};

/// The choice of lights, and of directions to an environment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightSampling {
    /// The probability with which each light is chosen.
    pub selection: LightSelection,
    /// Whether the density of an environment map is compensated.
    pub compensated: bool,
}

impl LightSampling {
    /// Returns the sampling of an integrator with these parameters.
    pub fn new(integrator: &IntegratorRow, params: &BTreeMap<String, Value>) -> LightSampling {
        let has = |field: &Field| integrator.params.fields.iter().any(|f| f.key == field.key);
        let off = params.get(COMPENSATE.key) == Some(&Value::Bool(false));
        LightSampling {
            selection: LightSelection::from_params(params),
            compensated: has(&COMPENSATE) && !off && Heuristic::from_params(params).is_some(),
        }
    }
}

impl From<LightSelection> for LightSampling {
    fn from(selection: LightSelection) -> LightSampling {
        LightSampling {
            selection,
            compensated: false,
        }
    }
}

/// Least share of the infinitely distant lights together, and of all others together, where power
/// decides and a scene has both. The power of distant lights grows with the square of the scene:
/// beside a large floor they would leave nothing to a lamp that lights most of the picture.
const LEAST_SHARE: f64 = 1.0 / 3.0;

impl Lights {
    /// Collects the lights of a scene, chosen by their power.
    pub fn new(scene: &CompiledScene) -> Lights {
        Lights::with_select(scene, LightSelection::default())
    }

    /// Collects the lights of a scene.
    pub fn with_select(scene: &CompiledScene, sampling: impl Into<LightSampling>) -> Lights {
        let LightSampling {
            selection: select,
            compensated,
        } = sampling.into();
        let point_maps = scene
            .points
            .iter()
            .map(|light| point::PointMap::new(light, scene));
        let environment = scene.environment.as_ref();
        let environment_light = environment.and_then(|e| EnvironmentLight::new(e, compensated));
        let first = first_indices(scene);
        let count = first[LISTS - 1] + u32::from(environment_light.is_some());
        let ids: Vec<LightId> = (0..count).map(|index| LightId::new(first, index)).collect();
        let ball = BoundingSphere::for_scene(scene);
        let context = PowerContext {
            disk_area: f64::from(ball.disk_area()),
            brightness: scene.textures.iter().map(mean_luminance).collect(),
            environment: environment_light
                .as_ref()
                .map_or(0.0, EnvironmentLight::power),
        };
        let facts = ids.iter().filter_map(|id| id.facts(scene, &context));
        let facts: Vec<LightFacts> = facts.collect();
        let area = |e: &Emitter| f64::from(e.area);
        let total_area = scene.emitters.iter().map(area).sum();
        let weights = weights(scene, total_area, select, &ids, &facts);
        let tree = match select {
            LightSelection::Tree => {
                LightTree::new(facts.iter().map(|light| light.bounds), &weights)
            }
            _ => None,
        };
        Lights {
            choice: AliasTable::new(weights),
            tree,
            rows: facts.into_iter().map(|light| light.rows).collect(),
            first,
            environment_light,
            point_maps: point_maps.collect(),
            ball,
            total_area,
        }
    }
}

/// Returns the weights of all lights, by index; for a tree, their powers. Every light that emits has
/// a positive weight.
fn weights(
    scene: &CompiledScene,
    total_area: f64,
    select: LightSelection,
    ids: &[LightId],
    facts: &[LightFacts],
) -> Vec<f64> {
    let mean_area = total_area / scene.emitters.len().max(1) as f64;
    let without_area = if mean_area > 0.0 { mean_area } else { 1.0 };
    let area = |i: u32| f64::from(scene.emitters[i as usize].area);
    let weight = |(id, light): (&LightId, &LightFacts)| match select {
        LightSelection::Uniform => 1.0,
        LightSelection::Area => id.emitter().map_or(without_area, area),
        LightSelection::Power | LightSelection::Tree => light.power,
    };
    let mut weights: Vec<f64> = ids.iter().zip(facts).map(weight).collect();
    if matches!(select, LightSelection::Power | LightSelection::Tree) {
        let near = facts.iter().take_while(|light| light.bounds.is_some());
        share(weights.split_at_mut(near.count()));
    }
    weights
}

/// Raises the weights of distant lights, or those of all others, to [`LEAST_SHARE`] of the sum.
/// Weights are unchanged if both shares are above, or if one is zero.
fn share((near, distant): (&mut [f64], &mut [f64])) {
    let sums = [&*near, &*distant].map(|weights| weights.iter().sum::<f64>());
    let least = LEAST_SHARE * (sums[0] + sums[1]);
    for (weights, own, other) in [(near, sums[0], sums[1]), (distant, sums[1], sums[0])] {
        if 0.0 < own && own < least {
            let factor = LEAST_SHARE / (1.0 - LEAST_SHARE) * other / own;
            weights.iter_mut().for_each(|weight| *weight *= factor);
        }
    }
}

fn mean_luminance(texture: &Texture) -> f64 {
    let sum: f64 = texture
        .texels
        .iter()
        .map(|t| luminance_of(glam::Vec3::from_array(t)))
        .sum();
    sum / texture.texels.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};

    use super::*;
    use crate::scene::compile;
    use crate::scene::desc::{MaterialDesc, Texels, TextureDesc, TextureSlot};
    use crate::scene::fixtures::{mesh, scene};
    use crate::transport::integrator::integrator;

    #[test]
    fn densities_are_compensated_only_where_directions_of_the_bsdf_are_weighted_against_them() {
        let of = |name: &str, params: &[(&str, Value)]| {
            let params = params
                .iter()
                .map(|(key, value)| ((*key).to_owned(), value.clone()));
            LightSampling::new(integrator(name).unwrap(), &params.collect()).compensated
        };
        assert!(of("nee", &[]) && of("guided", &[]));
        assert!(of("nee", &[("mis", Value::from("balance"))]));
        assert!(!of("nee", &[("mis", Value::from("none"))]));
        assert!(!of("nee", &[("compensate", Value::Bool(false))]));
        for name in ["bpt", "bdpt", "vcm", "lvc", "sppm"] {
            assert!(!of(name, &[]), "{name}");
        }
    }

    #[test]
    fn neither_distant_lights_nor_others_fall_below_a_third() {
        for (mut weights, expected) in [
            ([1.0, 3.0, 100.0, 300.0], [50.0, 150.0, 100.0, 300.0]),
            ([100.0, 300.0, 3.0, 1.0], [100.0, 300.0, 150.0, 50.0]),
            ([1.0, 3.0, 4.0, 2.0], [1.0, 3.0, 4.0, 2.0]),
            ([0.0, 0.0, 4.0, 2.0], [0.0, 0.0, 4.0, 2.0]),
            ([2.0, 1.0, 0.0, 0.0], [2.0, 1.0, 0.0, 0.0]),
        ] {
            share(weights.split_at_mut(2));
            for (weight, expected) in weights.into_iter().zip(expected) {
                assert!((weight - expected).abs() < 1e-9, "{weights:?}");
            }
        }
    }
    /// Returns a square that emits by a texture of `side` x `side` texels, one of which is white.
    fn glowing_texel(side: u32, texel: u32) -> CompiledScene {
        let mut texels = vec![[0.0, 0.0, 0.0, 1.0]; (side * side) as usize];
        texels[texel as usize] = [1.0; 4];
        let mut material = MaterialDesc {
            emission: Vec3::ONE,
            ..MaterialDesc::new("m")
        };
        let texture = TextureDesc::new("t", side, side, Texels::RgbaF32(texels));
        material.set_texture(TextureSlot::Emission, Some(texture.into()));
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let corners = uvs.map(|uv| uv.extend(0.0));
        let square = mesh(&corners, &uvs, &[[0, 1, 2], [0, 2, 3]]);
        compile(&scene(&[(square, Vec3::ZERO)], material))
            .unwrap()
            .0
    }

    #[test]
    fn lights_whose_only_bright_texel_no_probe_finds_are_chosen() {
        for texel in [0, 63, 64 * 31 + 17, 64 * 64 - 1] {
            let scene = glowing_texel(64, texel);
            for select in [LightSelection::Power, LightSelection::Tree] {
                let lights = Lights::with_select(&scene, select);
                for light in [LightId::Emitter(0), LightId::Emitter(1)] {
                    assert!(lights.pdf_choice(light) > 0.0, "{select:?}, {texel}");
                }
            }
        }
    }
}
