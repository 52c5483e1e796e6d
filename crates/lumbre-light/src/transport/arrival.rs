//! Arrivals of rays at surfaces: the hits in all lanes, sorted by class of surface.

use std::ops::Index;

use super::bsdf::{Bsdf, Orientation, PackedBsdf, PackedClass};
use super::ray::{Hit, Ray, RayHits};
use super::surface::{
    self, PrimitiveKind, ShadingParameters, Surface, SurfaceTraits, has_fractional_mask, is_back,
    lookup, uv_at,
};
use crate::math::real::Real;
use crate::math::simd::{Lanes, map_array, store_vectors};
use crate::record;
use crate::scene::CompiledScene;
use crate::scene::compile::{Blend, NONE, Share};

record! {
    /// Hits of rays, with the materials of the surfaces.
    pub struct HitState => HitRecord {
        /// Distance along the ray, in scene units.
        t: Real,
        /// Barycentric weight of the second corner.
        v: Real,
        /// Barycentric weight of the third corner.
        w: Real,
        /// Primitive that was hit: see [`Hit::primitive`].
        primitive: Word,
        /// Instance that was hit: see [`Hit::instance`].
        instance: Word,
        /// Index of the material; of a composed material, that of one component.
        material: Word,
        /// Index of the component of a composed or delayed material, or [`NONE`].
        component: Word,
    }
}

/// Properties that the surfaces in all lanes of a vector share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceClass {
    /// Properties of the surface: what has to be loaded and looked up.
    pub surface: SurfaceTraits,
    /// Properties of the scattering model.
    pub bsdf: PackedClass,
}

impl SurfaceClass {
    /// Returns whether the BSDF of a surface depends on the point beyond its normals: on parameters
    /// of the material that vary, a direction of anisotropy, or an offset against the shadow
    /// terminator.
    #[inline(always)]
    pub fn has_shading(&self) -> bool {
        self.bsdf.varies || self.surface.tangents || self.surface.terminator
    }
}

/// The classes of all surfaces of a scene.
#[derive(Clone, Debug, Default)]
pub struct SurfaceClasses {
    classes: Vec<SurfaceClass>,
    /// Class of each material, for each kind of primitive: see [`kind_index`].
    of: Vec<[u16; KINDS]>,
    /// The BSDF of each material.
    packed: Vec<PackedBsdf>,
    /// Whether any surface may have a terminator offset.
    terminators: bool,
    /// Whether any mask accepts hits with a probability between 0 and 1.
    fractional_masks: bool,
}

/// Number of kinds of primitives: triangles, triangles of instances, and spheres, each with and
/// without emission.
const KINDS: usize = 6;

/// Returns the index of a kind of primitive, below [`KINDS`].
#[inline]
fn kind_index(kind: PrimitiveKind) -> usize {
    let PrimitiveKind {
        sphere,
        instanced,
        emits,
    } = kind;
    let [sphere, instanced, emits] = [sphere, instanced, emits].map(usize::from);
    2 * (instanced + 2 * sphere) + emits
}

/// Arrival of a path in each lane at surfaces of one class.
#[derive(Clone, Copy)]
pub struct Arrival<'a, R: Real, const N: usize> {
    /// Class of the surfaces.
    pub class: &'a SurfaceClass,
    /// The hits with their rays.
    pub hits: RayHits<R, N>,
    /// Indices of the materials.
    pub materials: [u32; N],
    /// Indices of the components of composed or delayed materials, or [`NONE`].
    pub components: [u32; N],
}

impl SurfaceClasses {
    /// Determines the classes of a scene's surfaces.
    pub fn new(scene: &CompiledScene) -> SurfaceClasses {
        let mut all = SurfaceClasses::default();
        for material in &scene.materials {
            let packed = PackedBsdf::new(material, !scene.colors.is_empty());
            let mut of = [0; KINDS];
            for (sphere, instanced) in [(false, false), (false, true), (true, false)] {
                for emits in [false, true] {
                    let kind = PrimitiveKind {
                        sphere,
                        instanced,
                        emits,
                    };
                    let mut surface = SurfaceTraits::of_kind(scene, kind, material);
                    if !scene.delays.is_empty() {
                        // Delays may have textures.
                        surface.uv = true;
                        surface.second_uv = !sphere && !scene.second_uvs.is_empty();
                    }
                    let bsdf = packed.class;
                    of[kind_index(kind)] = all.insert(SurfaceClass { surface, bsdf });
                }
            }
            all.of.push(of);
            all.packed.push(packed);
        }
        all.fractional_masks = scene.materials.iter().any(has_fractional_mask);
        all.terminators = all.classes.iter().any(|class| class.surface.terminator);
        all
    }

    /// Returns the index of a class, which is added if it is new.
    fn insert(&mut self, class: SurfaceClass) -> u16 {
        let known = self.classes.iter().position(|other| *other == class);
        known.unwrap_or_else(|| {
            self.classes.push(class);
            self.classes.len() - 1
        }) as u16
    }

    /// Returns whether any surface may have a terminator offset.
    #[inline]
    pub fn have_terminators(&self) -> bool {
        self.terminators
    }

    /// Returns whether any surface [has shading](SurfaceClass::has_shading).
    pub fn have_shading(&self) -> bool {
        self.classes.iter().any(SurfaceClass::has_shading)
    }

    /// Builds the BSDFs of materials of one class. `parameters` are those of the points, for
    /// classes whose parameters vary.
    #[inline(always)]
    pub fn bsdf<R: Lanes<N>, const N: usize>(
        &self,
        class: &SurfaceClass,
        materials: [u32; N],
        at: &Orientation<R>,
        parameters: Option<&ShadingParameters<R>>,
    ) -> Bsdf<R> {
        let packed = map_array(materials, |m| &self.packed[m as usize]);
        Bsdf::unpack(at, &class.bsdf, packed, parameters)
    }

    /// Returns the number of classes.
    pub fn count(&self) -> usize {
        self.classes.len()
    }

    /// Returns the index of the class of a surface.
    #[inline]
    pub fn index_of(&self, scene: &CompiledScene, hit: &HitState<f32>) -> usize {
        let kind = PrimitiveKind {
            sphere: hit.primitive as usize >= scene.triangles.len(),
            instanced: hit.instance != NONE,
            emits: scene.emitter_of(hit.primitive, hit.instance) != NONE,
        };
        usize::from(self.of[hit.material as usize][kind_index(kind)])
    }
}

impl Index<usize> for SurfaceClasses {
    type Output = SurfaceClass;

    fn index(&self, index: usize) -> &SurfaceClass {
        &self.classes[index]
    }
}

/// Returns the weight of the second part of a blend at the hit of a ray.
#[inline]
fn blend_weight(scene: &CompiledScene, ray: &Ray, hit: &Hit, blend: &Blend) -> f32 {
    if blend.by_side {
        return if is_back(scene, ray, hit) { 1.0 } else { 0.0 };
    }
    let uv = uv_at(scene, ray, hit);
    lookup(&scene.textures, blend.texture, uv, blend.tiling).x
}

/// Returns the plain materials that the surface at the hit of a ray is, with their probabilities.
pub fn shares_at(scene: &CompiledScene, ray: &Ray, hit: &Hit) -> Vec<Share> {
    let material = scene.material_of(hit.primitive, hit.instance);
    let weight = |blend: &Blend| blend_weight(scene, ray, hit, blend);
    scene.delays.shares(material, weight)
}

impl HitState<f32> {
    /// Returns the state of a hit whose material, even a composed one, is used as a whole.
    #[inline]
    pub fn whole(scene: &CompiledScene, hit: &Hit) -> HitState<f32> {
        let row = scene.material_of(hit.primitive, hit.instance);
        HitState::of_part(hit, row, NONE)
    }

    /// Returns the state of a hit of `ray`. If the material is composed, `choose` draws a component:
    /// it returns a number in `[0, 1)`.
    #[inline]
    pub fn new(
        scene: &CompiledScene,
        ray: &Ray,
        hit: &Hit,
        choose: impl FnOnce() -> f32,
    ) -> HitState<f32> {
        let row = scene.material_of(hit.primitive, hit.instance);
        let (material, component) = if scene.delays.is_empty() {
            (row, NONE)
        } else {
            let weight = |blend: &Blend| blend_weight(scene, ray, hit, blend);
            scene.delays.choose_component(row, choose, weight)
        };
        HitState::of_part(hit, material, component)
    }

    /// Returns the state of a hit of a component of a material.
    #[inline]
    fn of_part(hit: &Hit, material: u32, component: u32) -> HitState<f32> {
        HitState {
            t: hit.t,
            v: hit.uv[0],
            w: hit.uv[1],
            primitive: hit.primitive,
            instance: hit.instance,
            material,
            component,
        }
    }
}

impl<'a, R: Lanes<N>, const N: usize> Arrival<'a, R, N> {
    /// Returns the arrivals of rays at hits on surfaces of a class.
    #[inline(always)]
    pub fn new(
        class: &'a SurfaceClass,
        Ray { origin, dir }: Ray<R::Vec3>,
        hits: &HitState<R>,
    ) -> Arrival<'a, R, N> {
        Arrival {
            class,
            hits: RayHits {
                origin,
                dir,
                t: hits.t,
                uv: [hits.v, hits.w],
                primitives: R::store_words(hits.primitive),
                instances: R::store_words(hits.instance),
            },
            materials: R::store_words(hits.material),
            components: R::store_words(hits.component),
        }
    }

    /// Returns the probability with which the mask of each surface accepted its hit; 1 without a
    /// mask.
    #[inline(always)]
    pub fn acceptance(&self, classes: &SurfaceClasses, scene: &CompiledScene) -> [f32; N] {
        let mut acceptance = [1.0; N];
        if classes.fractional_masks {
            let hits = &self.hits;
            let origins = store_vectors::<R, N>(hits.origin);
            let directions = store_vectors::<R, N>(hits.dir);
            let [v, w] = hits.uv;
            let (t, v, w) = (hits.t.store(), v.store(), w.store());
            for (i, share) in acceptance.iter_mut().enumerate() {
                let ray = Ray {
                    origin: origins[i],
                    dir: directions[i],
                };
                let hit = Hit {
                    t: t[i],
                    primitive: hits.primitives[i],
                    instance: hits.instances[i],
                    uv: [v[i], w[i]],
                };
                *share = surface::acceptance(scene, &ray, &hit);
            }
        }
        acceptance
    }

    /// Builds the surfaces.
    #[inline(always)]
    pub fn surface<'s>(&self, scene: &'s CompiledScene) -> Surface<'s, R, N> {
        Surface::at_hits(scene, &self.class.surface, &self.hits, self.materials)
    }

    /// Returns the parameters of the materials at the surfaces that [`Arrival::surface`] returned;
    /// `None` if they are the same everywhere.
    #[inline(always)]
    pub fn parameters(
        &self,
        scene: &CompiledScene,
        surface: &Surface<R, N>,
    ) -> Option<ShadingParameters<R>> {
        let SurfaceClass {
            surface: traits,
            bsdf,
        } = self.class;
        bsdf.varies
            .then(|| ShadingParameters::new(surface, &scene.textures, traits.textured))
    }

    /// Builds the BSDFs of these surfaces with these parameters.
    #[inline(always)]
    pub fn bsdf(
        &self,
        classes: &SurfaceClasses,
        surface: &Surface<R, N>,
        parameters: Option<&ShadingParameters<R>>,
    ) -> Bsdf<R> {
        let at = Orientation {
            n_geometric: surface.n_geometric,
            n_shading: surface.n_shading,
            tangent: self.class.surface.tangents.then_some(surface.tangent),
            terminator: surface
                .terminator
                .map_or(R::Mask::default(), |offset| offset.exists),
        };
        classes.bsdf(self.class, self.materials, &at, parameters)
    }
}
