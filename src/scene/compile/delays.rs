//! Composed and delayed materials, flattened: for each a weighted list of surfaces with the profiles that delay them.

use glam::Vec2;

use super::materials::Bank;
use super::{Material, NONE, Texture, UvMap};
use crate::math::piecewise::Piecewise;
use crate::scene::desc::delay::{mean_and_width, number};
use crate::scene::desc::{DelayKind, MaterialDesc, SceneDesc, delay};
use crate::scene::{Note, SceneError};

/// What the materials of a scene are composed of, and when they give light back. Empty where none is composed or delayed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Delays {
    /// By material row: where its parts begin, and how many there are; none for a plain material.
    pub rows: Vec<[u32; 2]>,
    /// The parts of all materials.
    pub parts: Vec<Part>,
    /// The profiles of all parts.
    pub profiles: Vec<DelayProfile>,
}

/// A part of a material: a plain surface, and what delays its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// The sum of the weights up to this part; exactly 1 for the last one.
    pub upto: f32,
    /// Row of [`CompiledScene::materials`](super::CompiledScene::materials).
    pub material: u32,
    /// Where its profiles begin, and how many there are; their delays add up.
    pub profiles: [u32; 2],
}

/// A profile in time whose parameters may come from textures.
#[derive(Clone, Debug, PartialEq)]
pub struct DelayProfile {
    /// Which.
    pub kind: DelayKind,
    /// Its one or two parameters, in the order of [`crate::scene::desc::DelayDesc::params`].
    pub params: [DelayParam; 2],
    /// From texture coordinates to places in the textures.
    pub tiling: UvMap,
    /// The density of a table.
    pub table: Option<Piecewise>,
}

/// A parameter of a profile: `offset + value * texture`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelayParam {
    /// What a texture multiplies; itself without one.
    pub value: f32,
    /// What is added.
    pub offset: f32,
    /// Index of the texture, or [`NONE`].
    pub texture: u32,
}

impl Delays {
    /// Whether no material is composed or delayed.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The parts of a material; none for a plain one.
    #[inline]
    pub fn parts(&self, material: u32) -> &[Part] {
        self.rows.get(material as usize).map_or(&[], |[first, count]| {
            let first = *first as usize;
            &self.parts[first..first + *count as usize]
        })
    }

    /// The profiles of a part.
    #[inline]
    pub fn profiles(&self, part: &Part) -> &[DelayProfile] {
        let [first, count] = part.profiles.map(|n| n as usize);
        &self.profiles[first..first + count]
    }
}

/// Flattens all materials. The row of a composed material becomes one that shows the mean of its parts' base colours, for
/// layers of the first surface; light is reflected by the parts alone.
pub(super) fn compile(
    desc: &SceneDesc,
    rows: &mut [Material],
    bank: &mut Bank,
    notes: &mut Vec<Note>,
) -> Result<Delays, SceneError> {
    delay::check(desc)?;
    let mut delays = Delays::default();
    let plain = |m: &MaterialDesc| m.parts.is_empty() && m.delay.kind == DelayKind::None;
    if desc.materials.iter().all(plain) {
        return Ok(delays);
    }
    let own: Vec<Option<DelayProfile>> =
        desc.materials.iter().map(|m| profile(m, bank, notes)).collect::<Result<_, _>>()?;
    for (row, m) in desc.materials.iter().enumerate() {
        let first = delays.parts.len();
        if !plain(m) {
            let mut flat = Flat { desc, own: &own, delays: &mut delays, sum: 0.0 };
            flat.add(row, 1.0, &mut Vec::new());
            let parts = &mut delays.parts[first..];
            if let Some(last) = parts.last_mut() {
                last.upto = 1.0;
            }
            if !m.parts.is_empty() {
                let mut before = 0.0;
                let mean = parts.iter().map(|part| {
                    let weight = part.upto - std::mem::replace(&mut before, part.upto);
                    rows[part.material as usize].base_color * weight
                });
                rows[row].base_color = mean.sum();
                rows[row].base_color_texture = NONE;
            }
        }
        delays.rows.push([first as u32, (delays.parts.len() - first) as u32]);
    }
    Ok(delays)
}

struct Flat<'a> {
    desc: &'a SceneDesc,
    own: &'a [Option<DelayProfile>],
    delays: &'a mut Delays,
    /// Of the weights so far.
    sum: f64,
}

impl Flat<'_> {
    /// Adds a material of a weight behind the profiles of those that contain it.
    fn add(&mut self, row: usize, weight: f64, outer: &mut Vec<usize>) {
        let m = &self.desc.materials[row];
        let delayed = self.own[row].is_some();
        if delayed {
            outer.push(row);
        }
        if m.parts.is_empty() && weight > 0.0 {
            self.sum += weight;
            let first = self.delays.profiles.len() as u32;
            self.delays.profiles.extend(outer.iter().filter_map(|row| self.own[*row].clone()));
            let profiles = [first, outer.len() as u32];
            self.delays.parts.push(Part { upto: self.sum as f32, material: row as u32, profiles });
        }
        for (name, part) in m.parts.iter().zip(&m.weights) {
            // The check has found every name.
            if let Some(row) = self.desc.material_row(name) {
                self.add(row, weight * f64::from(*part), outer);
            }
        }
        if delayed {
            outer.pop();
        }
    }
}

fn profile(m: &MaterialDesc, bank: &mut Bank, notes: &mut Vec<Note>) -> Result<Option<DelayProfile>, SceneError> {
    if m.delay.kind == DelayKind::None {
        return Ok(None);
    }
    let tiling = UvMap { scale: m.tiling, offset: m.uv_offset };
    let mut params = [DelayParam { value: 0.0, offset: 0.0, texture: NONE }; 2];
    for (param, (_, get, slot)) in params.iter_mut().zip(m.delay.params()) {
        let [value, offset] = get(&m.delay);
        let texture = bank.index(m, *slot, notes);
        *param = DelayParam { value, offset, texture };
    }
    check_texels(m, &params, &bank.textures)?;
    let table = (m.delay.kind == DelayKind::Table).then(|| Piecewise::new(&m.delay.pairs()));
    Ok(Some(DelayProfile { kind: m.delay.kind, params, tiling, table }))
}

/// Whether parameters from textures are in range everywhere. Between the centres of texels a parameter is bilinear, so it
/// is enough to look at the corners of the grid that the centres of all its textures make.
fn check_texels(m: &MaterialDesc, params: &[DelayParam; 2], textures: &[Texture]) -> Result<(), SceneError> {
    let named = m.delay.params();
    let used: Vec<&Texture> =
        params[..named.len()].iter().filter(|p| p.texture != NONE).map(|p| &textures[p.texture as usize]).collect();
    if used.is_empty() {
        return Ok(());
    }
    if let [mean, width] = used[..]
        && mean.lookup != width.lookup
    {
        // Any two texels may meet.
        for value in extremes(&params[0], mean) {
            for other in extremes(&params[1], width) {
                number(m, named[0].0, value)?;
                number(m, named[1].0, other)?;
                mean_and_width(m, value, other)?;
            }
        }
        return Ok(());
    }
    let centres = |size: fn(&Texture) -> u32| {
        let mut all: Vec<f32> =
            used.iter().flat_map(|t| (0..size(t)).map(move |i| (i as f32 + 0.5) / size(t) as f32)).collect();
        all.sort_by(f32::total_cmp);
        all.dedup();
        all
    };
    let columns = centres(|t| t.width);
    for v in centres(|t| t.height) {
        for u in &columns {
            let at = |p: &DelayParam| match p.texture {
                NONE => p.offset + p.value,
                t => p.offset + p.value * textures[t as usize].bilinear(Vec2::new(*u, v)).x,
            };
            let values = [at(&params[0]), at(&params[1])];
            for ((name, ..), value) in named.iter().zip(values) {
                number(m, name, value)?;
            }
            if named.len() == 2 {
                mean_and_width(m, values[0], values[1])?;
            }
        }
    }
    Ok(())
}

/// The least and the greatest value of a parameter with a texture.
fn extremes(p: &DelayParam, texture: &Texture) -> [f32; 2] {
    let values = texture.texels.iter().map(|[red, ..]| p.offset + p.value * red);
    values.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

impl DelayProfile {
    /// The profile of a description that has no textures and obeys [`delay::check`].
    pub fn plain(desc: &crate::scene::desc::DelayDesc) -> DelayProfile {
        let mut params = [DelayParam { value: 0.0, offset: 0.0, texture: NONE }; 2];
        for (param, (_, get, _)) in params.iter_mut().zip(desc.params()) {
            let [value, offset] = get(desc);
            *param = DelayParam { value, offset, texture: NONE };
        }
        let table = (desc.kind == DelayKind::Table).then(|| Piecewise::new(&desc.pairs()));
        DelayProfile { kind: desc.kind, params, tiling: UvMap::IDENTITY, table }
    }
}
