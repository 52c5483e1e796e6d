//! Classes of materials with a vectorised BSDF, and the table of their parameters.
//!
//! All surfaces of a class have the same lobes and the same kind of primitive, so that the lanes of
//! a vector mostly take the same branches. Classes affect speed only, never results.

use lumbre_light::math::simd::Width;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Material, NONE};
use lumbre_light::transport::bsdf::{PackedBsdf, PackedClass};
use lumbre_light::transport::surface::SurfaceTraits;

/// Value for primitives without a class.
const NO_CLASS: u8 = u8::MAX;

/// Table of surfaces that are shaded in lanes: those of materials without textures and anisotropy,
/// in scenes without vertex colours.
pub struct MaterialTable {
    /// SIMD width of the kernels.
    pub(super) width: Width,
    /// Class of every primitive, or [`NO_CLASS`].
    class_of: Vec<u8>,
    /// Material of every primitive, as an index into `bsdfs`; valid only for those with a class.
    pub(super) material_of: Vec<u32>,
    /// BSDF of every material.
    pub(super) bsdfs: Vec<PackedBsdf>,
    /// Traits of every class.
    traits: Vec<ClassTraits>,
}

/// Traits that all surfaces of a class share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClassTraits {
    /// Properties of the surfaces.
    pub surface: SurfaceTraits,
    /// Whether vertices can be connected to lights and other vertices.
    pub connected: bool,
    /// Traits of the BSDFs.
    pub bsdf: PackedClass,
}

/// Returns whether surfaces of a material are shaded in lanes: it is the same everywhere and
/// isotropic.
fn is_vectorized(scene: &CompiledScene, m: &Material) -> bool {
    let textures = [
        m.base_color_texture,
        m.roughness_texture,
        m.metallic_texture,
        m.opacity_texture,
        m.normal_texture,
        m.bump_texture,
    ];
    textures == [NONE; 6] && m.anisotropic == 0.0 && scene.colors.is_empty()
}

/// Returns whether every surface of a scene has a vectorised BSDF or ends paths. False in scenes
/// with instances.
pub fn all_vectorized(scene: &CompiledScene) -> bool {
    let vectorized: Vec<bool> = scene
        .materials
        .iter()
        .map(|m| is_vectorized(scene, m))
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
        let bsdfs: Vec<PackedBsdf> = scene
            .materials
            .iter()
            .map(|m| PackedBsdf::new(m, false))
            .collect();
        let vectorized: Vec<bool> = scene
            .materials
            .iter()
            .map(|m| is_vectorized(scene, m))
            .collect();
        let mut traits: Vec<ClassTraits> = Vec::new();
        let mut class_of = vec![NO_CLASS; scene.primitive_count()];
        let mut material_of = vec![0; scene.primitive_count()];
        let world =
            (0..scene.world_triangles()).chain(scene.triangles.len()..scene.primitive_count());
        for i in world {
            let primitive = i as u32;
            let material = scene.material_of(primitive, NONE);
            let emits = scene.emitter_of(primitive, NONE) != NONE;
            let allowed = with_emitters && scene.materials[material as usize].emitter_reflects;
            if !vectorized[material as usize] || emits && !allowed {
                continue;
            }
            let bsdf = bsdfs[material as usize].class;
            let own = ClassTraits {
                surface: SurfaceTraits::new(scene, primitive, NONE, material),
                connected: connected && bsdf.has_density,
                bsdf,
            };
            let class = traits
                .iter()
                .position(|t| *t == own)
                .unwrap_or(traits.len());
            if class < usize::from(NO_CLASS) {
                if class == traits.len() {
                    traits.push(own);
                }
                class_of[i] = class as u8;
                material_of[i] = material;
            }
        }
        (!traits.is_empty()).then_some(MaterialTable {
            width,
            class_of,
            material_of,
            bsdfs,
            traits,
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
}
