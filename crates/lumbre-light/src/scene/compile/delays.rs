//! Composed and delayed materials, flattened to weighted lists of plain materials with temporal
//! profiles.

use glam::Vec2;
use serde::{Deserialize, Serialize};

use super::texture_bank::TextureBank;
use super::{Material, NONE, Texture, UvMap};
use crate::math::piecewise::Piecewise;
use crate::scene::desc::delay::{check_mean_and_width, check_value};
use crate::scene::desc::{
    DelayKind, MaterialDesc, MaterialNames, SceneDesc, TextureFilter, TextureSlot, delay,
};
use crate::scene::{Note, SceneError};

/// Components and temporal profiles of the materials of a scene. Empty if no material is composed
/// or delayed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Delays {
    /// For each material, the index and the number of its components; zero components for a plain
    /// material.
    pub rows: Vec<[u32; 2]>,
    /// Components of all materials.
    pub components: Vec<MaterialComponent>,
    /// Temporal profiles of all components.
    pub profiles: Vec<DelayProfile>,
    /// Materials of two parts, of which one is chosen at each hit. They have no components.
    pub blends: Vec<Blend>,
}

/// A material of two parts, of which one is chosen at each hit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Blend {
    /// Index into [`CompiledScene::materials`](super::CompiledScene::materials).
    pub material: u32,
    /// Indices of the parts, which may be composed or blends themselves.
    pub parts: [u32; 2],
    /// Whether the first part is the front and the second the back.
    pub by_side: bool,
    /// Otherwise the texture whose red channel is the weight of the second part.
    pub texture: u32,
    /// Map from surface texture coordinates to those of the texture.
    pub tiling: UvMap,
}

/// A component of a composed or delayed material: a plain material and the profiles that delay its
/// light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaterialComponent {
    /// Sum of the weights up to and including this component; exactly 1 for the last one.
    pub cumulative_weight: f32,
    /// Index into [`CompiledScene::materials`](super::CompiledScene::materials).
    pub material: u32,
    /// Index and number of its profiles, whose delays add up.
    pub profiles: [u32; 2],
}

/// A plain material that a composed one is with some probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// Probability in `(0, 1]`.
    pub probability: f32,
    /// Index into [`CompiledScene::materials`](super::CompiledScene::materials).
    pub material: u32,
    /// Index into [`Delays::components`], or [`NONE`].
    pub component: u32,
}

/// A temporal profile whose parameters may come from textures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DelayProfile {
    /// Type of the profile.
    pub kind: DelayKind,
    /// One or two parameters, in the order of [`crate::scene::desc::DelayDesc::params`].
    pub params: [DelayParam; 2],
    /// Map from surface texture coordinates to those of the textures.
    pub tiling: UvMap,
    /// Density of a table profile.
    pub table: Option<Piecewise>,
}

/// A parameter of a profile: `offset + value * texture`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DelayParam {
    /// Factor on the texture, or the value itself without a texture.
    pub value: f32,
    /// Offset, added last.
    pub offset: f32,
    /// Index of the texture, or [`NONE`].
    pub texture: u32,
}

impl Delays {
    /// Returns whether no material is composed or delayed.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns the components of a material; none for a plain one.
    #[inline]
    pub fn components(&self, material: u32) -> &[MaterialComponent] {
        self.rows
            .get(material as usize)
            .map_or(&[], |[first, count]| {
                let first = *first as usize;
                &self.components[first..first + *count as usize]
            })
    }

    /// Returns the blend that a material is, if it is one.
    #[inline]
    fn blend(&self, material: u32) -> Option<&Blend> {
        self.blends.iter().find(|blend| blend.material == material)
    }

    /// Returns the plain materials of which a material is composed: itself if it is plain.
    pub fn leaves(&self, material: u32) -> Vec<u32> {
        if let Some(blend) = self.blend(material) {
            return blend.parts.map(|part| self.leaves(part)).concat();
        }
        match self.components(material) {
            [] => vec![material],
            [component] if component.material == material => vec![material],
            components => components
                .iter()
                .flat_map(|component| self.leaves(component.material))
                .collect(),
        }
    }

    /// Returns the components from which [`Delays::choose_component`] chooses, with their
    /// probabilities, which sum to 1; those of probability 0 are left out.
    pub fn shares(&self, material: u32, weight: impl Fn(&Blend) -> f32 + Copy) -> Vec<Share> {
        if let Some(blend) = self.blend(material) {
            let second = weight(blend).clamp(0.0, 1.0);
            let parts = blend.parts.into_iter().zip([1.0 - second, second]);
            return self.scaled_shares(parts, weight);
        }
        let components = self.components(material);
        let [first, _] = self.rows.get(material as usize).copied().unwrap_or([0; 2]);
        if components.is_empty() {
            return vec![Share {
                probability: 1.0,
                material,
                component: NONE,
            }];
        }
        let mut before = 0.0;
        let mut shares = Vec::new();
        for (component, row) in (first..).zip(components) {
            let probability = row.cumulative_weight - before;
            before = row.cumulative_weight;
            if self.blend(row.material).is_some() {
                shares.extend(self.scaled_shares([(row.material, probability)], weight));
            } else if probability > 0.0 {
                shares.push(Share {
                    probability,
                    material: row.material,
                    component,
                });
            }
        }
        shares
    }

    /// Returns the shares of materials that are chosen with these probabilities.
    fn scaled_shares(
        &self,
        parts: impl IntoIterator<Item = (u32, f32)>,
        weight: impl Fn(&Blend) -> f32 + Copy,
    ) -> Vec<Share> {
        let of_part = |(part, probability): (u32, f32)| {
            let mut shares = self.shares(part, weight);
            shares.iter_mut().for_each(|s| s.probability *= probability);
            shares
        };
        let shares = parts.into_iter().flat_map(of_part);
        shares.filter(|share| share.probability > 0.0).collect()
    }

    /// Chooses a component of a material. `choose` returns a number in `[0, 1)`, and is called once,
    /// if there are several; `weight` returns the weight of a blend's second part. Returns the index
    /// of the component's material and its index in [`Delays::components`], which is [`NONE`] for a
    /// plain material.
    #[inline]
    pub fn choose_component(
        &self,
        material: u32,
        choose: impl FnOnce() -> f32,
        weight: impl Fn(&Blend) -> f32,
    ) -> (u32, u32) {
        let components = self.components(material);
        let is_blend = |m: u32| self.blend(m).is_some();
        match components {
            [] if !is_blend(material) => return (material, NONE),
            [only] if !is_blend(only.material) => {
                return (only.material, self.rows[material as usize][0]);
            }
            _ => {}
        }
        let u = choose();
        if !components.is_empty() {
            let chosen = self.choose_constant(material, u);
            let material = self.components[chosen].material;
            if !is_blend(material) {
                return (material, chosen as u32);
            }
        }
        self.choose_nested(material, u, weight)
    }

    /// Returns the index of the component that `u` selects among those of a composed material.
    #[inline]
    fn choose_constant(&self, material: u32, u: f32) -> usize {
        let [first, count] = self.rows[material as usize].map(|n| n as usize);
        let below = self
            .components(material)
            .partition_point(|c| c.cumulative_weight <= u);
        first + below.min(count - 1)
    }

    /// Chooses a component below blends; `u` is spread again after each choice.
    fn choose_nested(
        &self,
        mut material: u32,
        mut u: f32,
        weight: impl Fn(&Blend) -> f32,
    ) -> (u32, u32) {
        // The greatest number below 1 in single precision.
        let below_one = 1.0 - f32::EPSILON / 2.0;
        loop {
            let mut component = NONE;
            let share;
            if let Some(blend) = self.blend(material) {
                let second = weight(blend).clamp(0.0, 1.0);
                let first = 1.0 - second;
                let to_second = u >= first;
                share = if to_second {
                    [first, second]
                } else {
                    [0.0, first]
                };
                material = blend.parts[usize::from(to_second)];
            } else if self.components(material).is_empty() {
                return (material, NONE);
            } else {
                let chosen = self.choose_constant(material, u);
                let start = match chosen.checked_sub(1) {
                    Some(before) if chosen as u32 > self.rows[material as usize][0] => {
                        self.components[before].cumulative_weight
                    }
                    _ => 0.0,
                };
                share = [start, self.components[chosen].cumulative_weight - start];
                component = chosen as u32;
                material = self.components[chosen].material;
            }
            u = ((u - share[0]) / share[1].max(f32::MIN_POSITIVE)).clamp(0.0, below_one);
            if component != NONE && self.blend(material).is_none() {
                return (material, component);
            }
        }
    }

    /// Returns the profiles of a component.
    #[inline]
    pub fn profiles(&self, component: &MaterialComponent) -> &[DelayProfile] {
        let [first, count] = component.profiles.map(|n| n as usize);
        &self.profiles[first..first + count]
    }
}

/// Flattens all materials. The base colour of a composed material becomes the mean of its
/// components' base colours, which is used by layers of the first surface; only the components
/// reflect light.
pub(super) fn compile(
    desc: &SceneDesc,
    materials: &mut [Material],
    bank: &mut TextureBank,
    notes: &mut Vec<Note>,
) -> Result<Delays, SceneError> {
    delay::check(desc)?;
    let mut delays = Delays::default();
    let plain = |m: &MaterialDesc| m.parts.is_empty() && m.delay.kind == DelayKind::None;
    if desc.materials.iter().all(plain) {
        return Ok(delays);
    }
    let profiles: Vec<Option<DelayProfile>> = desc
        .materials
        .iter()
        .map(|m| compile_profile(m, bank, notes))
        .collect::<Result<_, _>>()?;
    let names = desc.material_names();
    for (index, m) in desc.materials.iter().enumerate() {
        let first = delays.components.len();
        if m.is_blend() {
            delays
                .blends
                .push(compile_blend(desc, &names, index, bank, notes));
            let parts = delays.blends[delays.blends.len() - 1].parts;
            let [a, b] = parts.map(|part| materials[part as usize].base_color);
            materials[index].base_color = (a + b) / 2.0;
            materials[index].base_color_texture = NONE;
        } else if !plain(m) {
            let mut flattener = Flattener {
                desc,
                names: &names,
                profiles: &profiles,
                delays: &mut delays,
                weight_sum: 0.0,
            };
            flattener.add(index, 1.0, &mut Vec::new());
            let components = &mut delays.components[first..];
            if let Some(last) = components.last_mut() {
                last.cumulative_weight = 1.0;
            }
            if !m.parts.is_empty() {
                let mut before = 0.0;
                let mean = components.iter().map(|component| {
                    let weight = component.cumulative_weight
                        - std::mem::replace(&mut before, component.cumulative_weight);
                    materials[component.material as usize].base_color * weight
                });
                materials[index].base_color = mean.sum();
                materials[index].base_color_texture = NONE;
            }
        }
        delays
            .rows
            .push([first as u32, (delays.components.len() - first) as u32]);
    }
    Ok(delays)
}

/// Compiles a material of two parts, of which one is chosen at each hit.
fn compile_blend(
    desc: &SceneDesc,
    names: &MaterialNames,
    index: usize,
    bank: &mut TextureBank,
    notes: &mut Vec<Note>,
) -> Blend {
    let m = &desc.materials[index];
    // `delay::check` has found every name.
    let part = |i: usize| names.index(&m.parts[i]).unwrap_or(index) as u32;
    Blend {
        material: index as u32,
        parts: [part(0), part(1)],
        by_side: m.by_side,
        texture: bank.index(m, TextureSlot::Weights, notes),
        tiling: UvMap {
            scale: m.tiling,
            offset: m.uv_offset,
        },
    }
}

/// Recursive flattening of one composed material.
struct Flattener<'a> {
    desc: &'a SceneDesc,
    names: &'a MaterialNames<'a>,
    /// The material's own profile, for every material of the scene.
    profiles: &'a [Option<DelayProfile>],
    delays: &'a mut Delays,
    /// Sum of the weights of the components added so far.
    weight_sum: f64,
}

impl Flattener<'_> {
    /// Adds the components of a material. `outer` lists the delayed materials that contain it.
    fn add(&mut self, index: usize, weight: f64, outer: &mut Vec<usize>) {
        let m = &self.desc.materials[index];
        let delayed = self.profiles[index].is_some();
        if delayed {
            outer.push(index);
        }
        let is_blend = m.is_blend();
        if (m.parts.is_empty() || is_blend) && weight > 0.0 {
            self.weight_sum += weight;
            let first = self.delays.profiles.len() as u32;
            self.delays
                .profiles
                .extend(outer.iter().filter_map(|i| self.profiles[*i].clone()));
            let profiles = [first, outer.len() as u32];
            self.delays.components.push(MaterialComponent {
                cumulative_weight: self.weight_sum as f32,
                material: index as u32,
                profiles,
            });
        }
        let parts = if is_blend { &[][..] } else { &m.parts };
        for (name, share) in parts.iter().zip(&m.weights) {
            // `delay::check` has found every name.
            if let Some(component) = self.names.index(name) {
                self.add(component, weight * f64::from(*share), outer);
            }
        }
        if delayed {
            outer.pop();
        }
    }
}

/// Returns the compiled profile of a material, or `None` if it has no delay.
fn compile_profile(
    m: &MaterialDesc,
    bank: &mut TextureBank,
    notes: &mut Vec<Note>,
) -> Result<Option<DelayProfile>, SceneError> {
    if m.delay.kind == DelayKind::None {
        return Ok(None);
    }
    let tiling = UvMap {
        scale: m.tiling,
        offset: m.uv_offset,
    };
    let mut params = [DelayParam {
        value: 0.0,
        offset: 0.0,
        texture: NONE,
    }; 2];
    for (param, (_, get, slot)) in params.iter_mut().zip(m.delay.params()) {
        let [value, offset] = get(&m.delay);
        let texture = bank.index(m, *slot, notes);
        *param = DelayParam {
            value,
            offset,
            texture,
        };
    }
    check_texels(m, &params, &bank.textures)?;
    let table = (m.delay.kind == DelayKind::Table).then(|| Piecewise::new(&m.delay.pairs()));
    Ok(Some(DelayProfile {
        kind: m.delay.kind,
        params,
        tiling,
        table,
    }))
}

/// Checks that parameters from textures are in range everywhere. Between texel centres a parameter
/// is bilinear, so it is sufficient to check the grid of the texel centres of all its textures.
fn check_texels(
    m: &MaterialDesc,
    params: &[DelayParam; 2],
    textures: &[Texture],
) -> Result<(), SceneError> {
    let named = m.delay.params();
    let used: Vec<&Texture> = params[..named.len()]
        .iter()
        .filter(|p| p.texture != NONE)
        .map(|p| &textures[p.texture as usize])
        .collect();
    if used.is_empty() {
        return Ok(());
    }
    if let [mean, width] = used[..]
        && (mean.lookup != width.lookup || mean.lookup.filter == TextureFilter::Nearest)
    {
        // The mappings differ, or nothing is interpolated, so any two texels may coincide.
        for value in extremes(&params[0], mean) {
            for other in extremes(&params[1], width) {
                check_value(m, named[0].0, value)?;
                check_value(m, named[1].0, other)?;
                check_mean_and_width(m, value, other)?;
            }
        }
        return Ok(());
    }
    let texel_centres = |size: fn(&Texture) -> u32| {
        let mut all: Vec<f32> = used
            .iter()
            .flat_map(|t| (0..size(t)).map(move |i| (i as f32 + 0.5) / size(t) as f32))
            .collect();
        all.sort_by(f32::total_cmp);
        all.dedup();
        all
    };
    let columns = texel_centres(|t| t.width);
    for v in texel_centres(|t| t.height) {
        for u in &columns {
            let at = |p: &DelayParam| match p.texture {
                NONE => p.offset + p.value,
                t => p.offset + p.value * textures[t as usize].filtered(Vec2::new(*u, v)).x,
            };
            let values = [at(&params[0]), at(&params[1])];
            for ((name, ..), value) in named.iter().zip(values) {
                check_value(m, name, value)?;
            }
            if named.len() == 2 {
                check_mean_and_width(m, values[0], values[1])?;
            }
        }
    }
    Ok(())
}

/// Returns the least and the greatest value of a parameter with a texture.
fn extremes(p: &DelayParam, texture: &Texture) -> [f32; 2] {
    let values = texture
        .texels
        .iter()
        .map(|[red, ..]| p.offset + p.value * red);
    values.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

impl DelayProfile {
    /// Creates the profile of a description without textures that passes [`delay::check`].
    pub fn plain(desc: &crate::scene::desc::DelayDesc) -> DelayProfile {
        let mut params = [DelayParam {
            value: 0.0,
            offset: 0.0,
            texture: NONE,
        }; 2];
        for (param, (_, get, _)) in params.iter_mut().zip(desc.params()) {
            let [value, offset] = get(desc);
            *param = DelayParam {
                value,
                offset,
                texture: NONE,
            };
        }
        let table = (desc.kind == DelayKind::Table).then(|| Piecewise::new(&desc.pairs()));
        DelayProfile {
            kind: desc.kind,
            params,
            tiling: UvMap::IDENTITY,
            table,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a blend of two parts.
    fn blend(material: u32, parts: [u32; 2]) -> Blend {
        Blend {
            material,
            parts,
            by_side: false,
            texture: NONE,
            tiling: UvMap::IDENTITY,
        }
    }

    #[test]
    fn parts_of_nested_blends_are_chosen_with_the_products_of_their_weights() {
        // Material 5 blends 0 with 4, which is composed of 1 and of 3, a blend of 1 and 2.
        let component = |cumulative_weight, material| MaterialComponent {
            cumulative_weight,
            material,
            profiles: [0; 2],
        };
        let delays = Delays {
            rows: vec![[0; 2], [0; 2], [0; 2], [0; 2], [0, 2], [0; 2]],
            components: vec![component(0.25, 1), component(1.0, 3)],
            profiles: Vec::new(),
            blends: vec![blend(3, [1, 2]), blend(5, [0, 4])],
        };
        // The weight of the second part.
        let weight = |blend: &Blend| if blend.material == 3 { 0.125 } else { 0.5 };
        let n = 1 << 12;
        let mut counts = [0; 4];
        for i in 0..n {
            let u = (f64::from(i) + 0.5) / f64::from(n);
            match delays.choose_component(5, || u as f32, weight) {
                (0, NONE) => counts[0] += 1,
                (1, 0) => counts[1] += 1,
                (1, _) => counts[2] += 1,
                (2, _) => counts[3] += 1,
                other => panic!("{other:?} is no part"),
            }
        }
        let shares = [0.5, 0.5 * 0.25, 0.5 * 0.75 * 0.875, 0.5 * 0.75 * 0.125];
        for (count, share) in counts.into_iter().zip(shares) {
            let found = f64::from(count) / f64::from(n);
            assert!(
                (found - share).abs() < 1e-3,
                "{counts:?} of {n}, expected {shares:?}"
            );
        }
        let stated = delays.shares(5, weight);
        let parts: Vec<(u32, u32)> = stated.iter().map(|s| (s.material, s.component)).collect();
        assert_eq!(parts, [(0, NONE), (1, 0), (1, NONE), (2, NONE)]);
        for (stated, share) in stated.iter().zip(shares) {
            assert!(
                (f64::from(stated.probability) - share).abs() < 1e-6,
                "{stated:?}"
            );
        }
        // A blend shows one part alone where the other has no weight.
        assert_eq!(delays.shares(5, |_| 0.0).len(), 1);
    }
}
