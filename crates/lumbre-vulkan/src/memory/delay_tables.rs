//! Tables of composed and delayed materials and of the emission profile, as shaders read them.

use crate::layout;
use lumbre_light::math::piecewise::Piecewise;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{self, NONE};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::time_settings::Timing;

/// Rows of `material_parts`, `delay_profiles` and `knots`.
#[derive(Debug, Default)]
pub struct DelayRows {
    /// Components of all materials.
    pub components: Vec<layout::MaterialPart>,
    /// Profiles of all components, followed by the emission profile of lights.
    pub profiles: Vec<layout::DelayProfile>,
    /// Knots of tabulated profiles.
    pub knots: Vec<layout::Knot>,
    /// Row of the emission profile, or [`NONE`].
    pub emission: u32,
}

/// Returns whether any material of the scene is composed of components that differ in appearance,
/// among which paths have to choose.
pub fn is_composed(scene: &CompiledScene) -> bool {
    let is_plain = |row: u32| {
        scene
            .delays
            .components(row)
            .iter()
            .all(|part| part.material == row)
    };
    !(0..scene.materials.len() as u32).all(is_plain)
}

impl DelayRows {
    /// Creates the rows of a scene and of a film's timing.
    pub fn new(scene: &CompiledScene, timing: Option<&Timing>) -> DelayRows {
        let mut rows = DelayRows {
            emission: NONE,
            ..DelayRows::default()
        };
        let part = |p: &compile::MaterialComponent| layout::MaterialPart {
            upto: p.cumulative_weight,
            material: p.material,
            profiles: p.profiles,
        };
        rows.components = scene.delays.components.iter().map(part).collect();
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

    /// Appends the knots of a table and returns the index of the first and their number.
    fn table(&mut self, table: Option<&Piecewise>) -> [u32; 2] {
        let first = self.knots.len();
        let knot = |[x, density, below]: [f64; 3]| layout::Knot {
            x: double_words(x),
            density: double_words(density),
            below: double_words(below),
        };
        self.knots
            .extend(table.into_iter().flat_map(Piecewise::knots).map(knot));
        [first as u32, (self.knots.len() - first) as u32]
    }
}

/// Returns the words of a double, low one first.
pub fn double_words(x: f64) -> [u32; 2] {
    let bits = x.to_bits();
    [bits as u32, (bits >> 32) as u32]
}
