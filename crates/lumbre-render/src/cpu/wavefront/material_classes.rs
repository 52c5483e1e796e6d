//! Classes of materials with a vectorised BSDF, and the table of their parameters.
//!
//! All surfaces of a class have the same lobes and the same kind of primitive, so that the lanes of
//! a vector mostly take the same branches. Classes affect speed only, never results.

use std::collections::BTreeMap;

use glam::Vec3;

use super::PathTile;
use super::light_sampling::LightTable;
use super::shade;
use super::vertices;
use lumbre_light::math::simd::{F32x8, Width};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Material, Model, NONE};
use lumbre_light::transport::bsdf::disney::Disney;
use lumbre_light::transport::integrator::Context;

/// Value for primitives without a class.
const NO_CLASS: u8 = u8::MAX;

/// Table of surfaces with a vectorised BSDF: `disney` without anisotropy and purely diffuse
/// `lambert`, both without textures and in scenes without vertex colours.
pub(super) struct MaterialTable {
    /// SIMD width of the kernels.
    pub(super) width: Width,
    /// Class of every primitive, or [`NO_CLASS`].
    class_of: Vec<u8>,
    /// Material of every primitive, as an index into `rows`; valid only for those with a class.
    pub(super) material_of: Vec<u32>,
    /// BSDF of every material, in the format of [`vertices::disney_rows`] or
    /// [`vertices::lambert_rows`].
    pub(super) rows: Vec<[F32x8; 3]>,
    /// Traits of every class.
    traits: Vec<ClassTraits>,
    /// Lights with vectorised sampling; empty if the integrator does not connect vertices.
    pub(super) lights: LightTable,
}

/// Traits that all surfaces of a class share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ClassTraits {
    /// Whether the primitives are spheres.
    pub sphere: bool,
    /// Whether the surfaces are of the model `lambert`; the fields about lobes are then `false`.
    pub lambert: bool,
    /// Whether the microfacet lobes are Dirac lobes.
    pub smooth: bool,
    /// Whether the surfaces have a tinted reflectance.
    pub tinted: bool,
    /// Whether vertices can be connected to lights and other vertices.
    pub connected: bool,
    /// Whether the refractive lobe is a Dirac lobe.
    smooth_glass: bool,
    /// Presence of the opaque, metallic, refractive, clearcoat, subsurface and sheen lobes.
    lobes: [bool; 6],
}

/// BSDF of a material with vectorised shading.
enum VectorBsdf {
    Disney(Disney),
    /// Lambert BSDF with this albedo.
    Lambert(Vec3),
}

impl VectorBsdf {
    fn rows(&self) -> [F32x8; 3] {
        match self {
            VectorBsdf::Disney(d) => vertices::disney_rows(d),
            VectorBsdf::Lambert(albedo) => vertices::lambert_rows(*albedo),
        }
    }
}

impl ClassTraits {
    fn from_bsdf(bsdf: &VectorBsdf, sphere: bool, connected: bool) -> ClassTraits {
        match bsdf {
            VectorBsdf::Disney(d) => ClassTraits::from_disney(d, sphere, connected),
            VectorBsdf::Lambert(_) => ClassTraits {
                sphere,
                lambert: true,
                connected,
                ..ClassTraits::default()
            },
        }
    }

    fn from_disney(d: &Disney, sphere: bool, connected: bool) -> ClassTraits {
        let weights = [
            d.opaque,
            d.metallic,
            d.refractive,
            d.coat.strength,
            d.diffuse.subsurface,
        ];
        let [a, b, c, e, f] = weights.map(|w| w > 0.0);
        ClassTraits {
            sphere,
            lambert: false,
            smooth: d.smooth,
            tinted: d.tinted_f0.is_some(),
            connected: connected && d.has_density(),
            smooth_glass: d.smooth_glass(),
            lobes: [a, b, c, e, f, d.diffuse.sheen != Vec3::ZERO],
        }
    }
}

/// Returns the BSDF of a material if it is the same everywhere and has a vectorised implementation.
fn vector_bsdf(scene: &CompiledScene, m: &Material) -> Option<VectorBsdf> {
    let textures = [
        m.base_color_texture,
        m.roughness_texture,
        m.metallic_texture,
        m.opacity_texture,
        m.normal_texture,
        m.bump_texture,
    ];
    let uniform = textures == [NONE; 6] && m.anisotropic == 0.0 && scene.colors.is_empty();
    let dielectric = 1.0 - m.metallic;
    let mix = [
        dielectric * m.opacity,
        m.metallic,
        dielectric * (1.0 - m.opacity),
    ];
    match m.model {
        Model::Disney if uniform => Some(VectorBsdf::Disney(Disney::new(
            m,
            m.base_color,
            m.roughness,
            mix,
        ))),
        Model::Lambert if uniform && mix == [1.0, 0.0, 0.0] => {
            Some(VectorBsdf::Lambert(m.base_color))
        }
        _ => None,
    }
}

/// Returns whether every surface of a scene has a vectorised BSDF or ends paths. False in scenes
/// with instances.
pub(super) fn all_vectorized(scene: &CompiledScene) -> bool {
    let vectorized: Vec<bool> = scene
        .materials
        .iter()
        .map(|m| vector_bsdf(scene, m).is_some())
        .collect();
    let covered = |primitive: u32| {
        let material = scene.material_of(primitive, NONE) as usize;
        vectorized[material] || ends_paths(scene, primitive, material)
    };
    scene.instances.placements.is_empty() && (0..scene.primitive_count()).all(|i| covered(i as u32))
}

/// Returns whether a surface ends paths: it emits light and reflects none.
fn ends_paths(scene: &CompiledScene, primitive: u32, material: usize) -> bool {
    scene.emitter_of(primitive, NONE) != NONE && !scene.materials[material].emitter_reflects
}

impl MaterialTable {
    /// Builds the table of a scene, or returns `None` if no surface has a vectorised BSDF.
    ///
    /// `connected`: whether the integrator connects vertices to lights. `with_emitters`: whether
    /// emitters that also reflect get a class.
    pub fn new(
        scene: &CompiledScene,
        width: Width,
        connected: bool,
        with_emitters: bool,
    ) -> Option<MaterialTable> {
        let bsdfs: Vec<Option<VectorBsdf>> = scene
            .materials
            .iter()
            .map(|m| vector_bsdf(scene, m))
            .collect();
        let mut classes: BTreeMap<ClassTraits, u8> = BTreeMap::new();
        let mut class_of = vec![NO_CLASS; scene.primitive_count()];
        let mut material_of = vec![0; scene.primitive_count()];
        let world =
            (0..scene.world_triangles()).chain(scene.triangles.len()..scene.primitive_count());
        for i in world {
            let primitive = i as u32;
            let material = scene.material_of(primitive, NONE);
            let emits = scene.emitter_of(primitive, NONE) != NONE;
            let allowed = with_emitters && scene.materials[material as usize].emitter_reflects;
            if let Some(bsdf) = bsdfs[material as usize]
                .as_ref()
                .filter(|_| !emits || allowed)
            {
                let next = classes.len() as u8;
                let traits = ClassTraits::from_bsdf(bsdf, i >= scene.triangles.len(), connected);
                if next < NO_CLASS || classes.contains_key(&traits) {
                    class_of[i] = *classes.entry(traits).or_insert(next);
                    material_of[i] = material;
                }
            }
        }
        let rows = bsdfs
            .iter()
            .map(|bsdf| {
                bsdf.as_ref()
                    .map_or([F32x8::default(); 3], VectorBsdf::rows)
            })
            .collect();
        let mut traits: Vec<(u8, ClassTraits)> = classes
            .into_iter()
            .map(|(traits, class)| (class, traits))
            .collect();
        traits.sort_unstable_by_key(|(class, _)| *class);
        let traits: Vec<ClassTraits> = traits.into_iter().map(|(_, traits)| traits).collect();
        let lights = if connected {
            LightTable::new(scene)
        } else {
            LightTable::default()
        };
        (!traits.is_empty()).then_some(MaterialTable {
            width,
            class_of,
            material_of,
            rows,
            traits,
            lights,
        })
    }

    /// Returns whether every surface at which a path can continue has a class. False in scenes with
    /// instances.
    pub fn covers(&self, scene: &CompiledScene) -> bool {
        let world =
            (0..scene.world_triangles()).chain(scene.triangles.len()..scene.primitive_count());
        let is_path_end = |primitive: u32| {
            ends_paths(
                scene,
                primitive,
                scene.material_of(primitive, NONE) as usize,
            )
        };
        scene.instances.placements.is_empty()
            && world
                .map(|i| i as u32)
                .all(|i| self.class(i).is_some() || is_path_end(i))
    }

    /// Returns the traits of a class.
    #[inline]
    pub fn traits(&self, class: usize) -> ClassTraits {
        self.traits[class]
    }

    /// Returns the number of classes.
    pub fn classes(&self) -> usize {
        self.traits.len()
    }

    /// Returns the class of a primitive outside instances, or `None` if it has no vectorised BSDF.
    #[inline]
    pub fn class(&self, primitive: u32) -> Option<usize> {
        let class = self.class_of[primitive as usize];
        (class != NO_CLASS).then_some(usize::from(class))
    }

    /// Runs one step of paths that hit surfaces of one class.
    pub fn shade<const TIMED: bool>(
        &self,
        class: usize,
        context: &Context,
        depth: u32,
        paths: &[u32],
        tile: &mut PathTile,
    ) {
        if !paths.is_empty() {
            shade::shade_class::<TIMED>(self, self.traits[class], context, depth, paths, tile);
        }
    }
}
