//! Which surfaces lanes know, and their parameters in rows.

use std::collections::BTreeMap;

use super::Tile;
use super::lamps::Lamps;
use super::shade;
use crate::math::lanes::Row;
use crate::scene::CompiledScene;
use crate::scene::compile::{Material, Model, NONE};
use crate::transport::bsdf::disney::Disney;
use crate::transport::integrator::Context;

/// In the place of a class.
const ALONE: u8 = u8::MAX;

/// Surfaces of the model `disney` without textures, which do not shine, and whose highlights are round. They are sorted into
/// classes: those of one have the same lobes, so that lanes seldom wait for each other.
pub(super) struct Table {
    /// Of every primitive, its class.
    class_of: Vec<u8>,
    /// Of every primitive, its row of `rows`.
    pub(super) row_of: Vec<u32>,
    /// The BSDF of every material, as [`shade::rows_of`] writes it.
    pub(super) rows: Vec<[Row; 3]>,
    /// Of every class, what its surfaces have in common.
    common: Vec<Common>,
    /// The lights to which vertices are joined.
    pub(super) lamps: Lamps,
}

/// What the surfaces of a class have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Common {
    /// Whether they are spheres.
    pub sphere: bool,
    /// Whether microfacets are Dirac lobes.
    pub smooth: bool,
    /// Whether there is a tinted reflectance.
    pub tinted: bool,
    /// Whether vertices are joined to lights.
    pub joined: bool,
    /// Whether the refractive lobe is a Dirac lobe.
    smooth_glass: bool,
    /// Which of the other lobes there are.
    lobes: [bool; 6],
}

impl Common {
    fn of(d: &Disney, sphere: bool, joined: bool) -> Common {
        let weights = [d.opaque, d.metallic, d.refractive, d.coat.strength, d.diffuse.subsurface];
        let [a, b, c, e, f] = weights.map(|w| w > 0.0);
        Common {
            sphere,
            smooth: d.smooth,
            tinted: d.tinted_f0.is_some(),
            joined: joined && d.has_density(),
            smooth_glass: d.smooth_glass(),
            lobes: [a, b, c, e, f, d.diffuse.sheen != glam::Vec3::ZERO],
        }
    }
}

/// The BSDF of a material wherever it is met, if lanes know it.
fn known(scene: &CompiledScene, m: &Material) -> Option<Disney> {
    let textures = [
        m.base_color_texture,
        m.roughness_texture,
        m.metallic_texture,
        m.opacity_texture,
        m.normal_texture,
        m.bump_texture,
    ];
    let plain = m.model == Model::Disney && textures == [NONE; 6] && m.anisotropic == 0.0 && scene.colors.is_empty();
    let dielectric = 1.0 - m.metallic;
    let mix = [dielectric * m.opacity, m.metallic, dielectric * (1.0 - m.opacity)];
    plain.then(|| Disney::new(m, m.base_color, m.roughness, mix))
}

/// Whether lanes know every surface, whoever's paths meet it, but for lamps that end them.
pub(super) fn knows_all(scene: &CompiledScene) -> bool {
    let known: Vec<bool> = scene.materials.iter().map(|m| known(scene, m).is_some()).collect();
    let meets = |primitive: u32| {
        let material = scene.material_of(primitive, NONE) as usize;
        known[material] || ends(scene, primitive, material)
    };
    scene.instances.places.is_empty() && (0..scene.primitive_count()).all(|i| meets(i as u32))
}

/// Whether a surface ends paths: it shines and reflects nothing.
fn ends(scene: &CompiledScene, primitive: u32, material: usize) -> bool {
    scene.emitter_of(primitive, NONE) != NONE && !scene.materials[material].emitter_reflects
}

impl Table {
    /// Of a scene, for paths whose vertices are joined to lights or not, without surfaces that shine or with those that
    /// reflect as well; `None` where lanes know none of its surfaces.
    pub fn of(scene: &CompiledScene, joined: bool, shining: bool) -> Option<Table> {
        let known: Vec<Option<Disney>> = scene.materials.iter().map(|m| known(scene, m)).collect();
        let mut classes: BTreeMap<Common, u8> = BTreeMap::new();
        let mut class_of = vec![ALONE; scene.primitive_count()];
        let mut row_of = vec![0; scene.primitive_count()];
        let world = (0..scene.world_triangles()).chain(scene.triangles.len()..scene.primitive_count());
        for i in world {
            let primitive = i as u32;
            let row = scene.material_of(primitive, NONE);
            let shines = scene.emitter_of(primitive, NONE) != NONE;
            let reflects = shining && scene.materials[row as usize].emitter_reflects;
            if let Some(disney) = known[row as usize].as_ref().filter(|_| !shines || reflects) {
                let next = classes.len() as u8;
                let common = Common::of(disney, i >= scene.triangles.len(), joined);
                if next < ALONE || classes.contains_key(&common) {
                    class_of[i] = *classes.entry(common).or_insert(next);
                    row_of[i] = row;
                }
            }
        }
        let rows = known.iter().map(|d| d.as_ref().map_or([Row::default(); 3], shade::rows_of)).collect();
        let mut common: Vec<(u8, Common)> = classes.into_iter().map(|(common, class)| (class, common)).collect();
        common.sort_unstable_by_key(|(class, _)| *class);
        let common: Vec<Common> = common.into_iter().map(|(_, common)| common).collect();
        let lamps = if joined { Lamps::of(scene) } else { Lamps::default() };
        (!common.is_empty()).then_some(Table { class_of, row_of, rows, common, lamps })
    }

    /// Whether lanes know every surface that a path can meet and go on: all but lamps that end it.
    pub fn is_whole(&self, scene: &CompiledScene) -> bool {
        let world = (0..scene.world_triangles()).chain(scene.triangles.len()..scene.primitive_count());
        let ends = |primitive: u32| ends(scene, primitive, scene.material_of(primitive, NONE) as usize);
        scene.instances.places.is_empty() && world.map(|i| i as u32).all(|i| self.class(i).is_some() || ends(i))
    }

    /// What the surfaces of a class have in common.
    #[inline]
    pub fn common(&self, class: usize) -> Common {
        self.common[class]
    }

    /// How many classes there are.
    pub fn classes(&self) -> usize {
        self.common.len()
    }

    /// The class of a primitive of the world, if lanes know it.
    #[inline]
    pub fn class(&self, primitive: u32) -> Option<usize> {
        let class = self.class_of[primitive as usize];
        (class != ALONE).then_some(usize::from(class))
    }

    /// The step of paths that have met surfaces of one class.
    pub fn shade(&self, class: usize, context: &Context, depth: u32, paths: &[u32], tile: &mut Tile) {
        if !paths.is_empty() {
            shade::step(self, self.common[class], context, depth, paths, tile);
        }
    }
}
