//! Composed and delayed materials, and the pulse of lights, as shaders read them.

use super::layout;
use crate::math::piecewise::Piecewise;
use crate::scene::CompiledScene;
use crate::scene::compile::{self, NONE};
use crate::transport::delay::Profile;
use crate::transport::flight::Timing;

/// The rows of `material_parts`, `delay_profiles` and `knots`.
#[derive(Debug, Default)]
pub struct DelayRows {
    /// The parts of all materials.
    pub parts: Vec<layout::MaterialPart>,
    /// The profiles of all parts, and behind them that of the lights.
    pub profiles: Vec<layout::DelayProfile>,
    /// The knots of tables.
    pub knots: Vec<layout::Knot>,
    /// Row of the profile of the lights, or [`NONE`].
    pub emission: u32,
}

/// Whether a path that meets a surface of the scene has to choose among parts, of which each may look otherwise.
pub fn is_composed(scene: &CompiledScene) -> bool {
    let alone = |row: u32| scene.delays.parts(row).iter().all(|part| part.material == row);
    !(0..scene.materials.len() as u32).all(alone)
}

impl DelayRows {
    /// Those of a scene, and of a film with a time axis.
    pub fn new(scene: &CompiledScene, timing: Option<&Timing>) -> DelayRows {
        let mut rows = DelayRows { emission: NONE, ..DelayRows::default() };
        let part =
            |p: &compile::Part| layout::MaterialPart { upto: p.upto, material: p.material, profiles: p.profiles };
        rows.parts = scene.delays.parts.iter().map(part).collect();
        for profile in &scene.delays.profiles {
            let knots = rows.table(profile.table.as_ref());
            rows.profiles.push(layout::DelayProfile {
                kind: profile.kind as u32,
                value: profile.params.map(|p| p.value),
                offset: profile.params.map(|p| p.offset),
                textures: profile.params.map(|p| p.texture),
                tiling_scale: profile.tiling.scale,
                tiling_offset: profile.tiling.offset.into(),
                knots,
            });
        }
        if let Some(profile) = timing.map(|t| &t.emission).filter(|p| **p != Profile::NONE) {
            rows.emission = rows.profiles.len() as u32;
            let (kind, value, table) = profile.to_parts();
            let knots = rows.table(table);
            rows.profiles.push(layout::DelayProfile {
                kind: kind as u32,
                value,
                offset: [0.0; 2],
                textures: [NONE; 2],
                tiling_scale: 1.0,
                tiling_offset: [0.0; 2],
                knots,
            });
        }
        rows
    }

    /// The knots of a table: the first, and how many.
    fn table(&mut self, table: Option<&Piecewise>) -> [u32; 2] {
        let first = self.knots.len();
        let knot =
            |[x, density, below]: [f64; 3]| layout::Knot { x: words(x), density: words(density), below: words(below) };
        self.knots.extend(table.into_iter().flat_map(Piecewise::knots).map(knot));
        [first as u32, (self.knots.len() - first) as u32]
    }
}

/// The words of a double, low one first.
pub fn words(x: f64) -> [u32; 2] {
    let bits = x.to_bits();
    [bits as u32, (bits >> 32) as u32]
}
