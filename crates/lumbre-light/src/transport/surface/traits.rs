//! Properties of surfaces that are known when a scene is compiled.

#[cfg(doc)]
use super::Surface;
use crate::scene::CompiledScene;
use crate::scene::compile::{Material, Model, NONE, RoughnessTexels};

/// Properties that the surfaces in all lanes of a vector share. They depend only on the primitive
/// and its material, so that code may branch on them, and they state exactly which work
/// [`Surface::at_hits`] and [`ShadingParameters::new`](super::ShadingParameters::new) do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct SurfaceTraits {
    /// Whether the primitives are spheres; otherwise they are triangles.
    pub sphere: bool,
    /// Whether the primitives belong to instances of shared meshes.
    pub instanced: bool,
    /// Whether the triangles have vertex colours.
    pub colors: bool,
    /// Whether the primitives emit light.
    pub emits: bool,
    /// Whether texture coordinates are read.
    pub uv: bool,
    /// Whether the second set of texture coordinates is read.
    pub second_uv: bool,
    /// Whether the material offsets rays against the shadow terminator.
    pub terminator: bool,
    /// Whether [`Surface::tangent`] is determined.
    pub tangents: bool,
    /// Whether the material has a normal map.
    pub normal_map: bool,
    /// Whether the material has a map of the anisotropic direction.
    pub direction_map: bool,
    /// Whether the material has a bump map.
    pub bump_map: bool,
    /// The shading parameters that have textures.
    pub textured: TexturedParameters,
}

/// Flags of the [`ShadingParameters`](super::ShadingParameters) of a material: which of them there are,
/// and which have textures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct TexturedParameters {
    /// Whether the base colour has one.
    pub base_color: bool,
    /// Whether the roughness has one.
    pub roughness: bool,
    /// Whether its texels are alpha, the square of roughness.
    pub alpha: bool,
    /// Whether the weight of the metallic lobes has one.
    pub metallic: bool,
    /// Whether the opacity has one.
    pub opacity: bool,
    /// Whether the transmittance has one.
    pub transmittance: bool,
    /// Whether the transmittance takes the place of roughness, metallic and opacity: the model is
    /// `translucent`.
    pub translucent: bool,
}

impl TexturedParameters {
    /// Returns which parameters of a material have textures.
    #[inline]
    pub fn new(m: &Material) -> TexturedParameters {
        TexturedParameters {
            base_color: m.base_color_texture != NONE,
            roughness: m.roughness_texture != NONE,
            alpha: m.roughness_texture != NONE && m.roughness_texels == RoughnessTexels::Alpha,
            metallic: m.metallic_texture != NONE,
            opacity: m.opacity_texture != NONE,
            transmittance: m.transmittance_texture != NONE,
            translucent: m.model == Model::Translucent,
        }
    }

    /// Returns whether any parameter has a texture.
    #[inline]
    pub fn any(&self) -> bool {
        let plain = TexturedParameters {
            translucent: self.translucent,
            ..TexturedParameters::default()
        };
        *self != plain
    }
}

impl SurfaceTraits {
    /// Returns the properties of a primitive with a material row. `primitive` and `instance` are
    /// those of [`Hit`](crate::transport::ray::Hit).
    #[inline]
    pub fn new(
        scene: &CompiledScene,
        primitive: u32,
        instance: u32,
        material: u32,
    ) -> SurfaceTraits {
        let kind = PrimitiveKind {
            sphere: primitive as usize >= scene.triangles.len(),
            instanced: instance != NONE,
            emits: scene.emitter_of(primitive, instance) != NONE,
        };
        SurfaceTraits::of_kind(scene, kind, &scene.materials[material as usize])
    }

    /// Returns the properties of all primitives of a kind with a material.
    #[inline]
    pub fn of_kind(scene: &CompiledScene, kind: PrimitiveKind, m: &Material) -> SurfaceTraits {
        let PrimitiveKind {
            sphere,
            instanced,
            emits,
        } = kind;
        let has = |texture: u32| texture != NONE;
        let textured = TexturedParameters::new(m);
        let (normal_map, bump_map) = (has(m.normal_texture), has(m.bump_texture));
        let tangents = m.uses_tangents();
        let direction_map = tangents && has(m.anisotropic_texture);
        let uv = textured.any()
            || normal_map
            || bump_map
            || direction_map
            || emits && (has(m.emission_texture) || has(m.mask_texture));
        SurfaceTraits {
            sphere,
            instanced,
            colors: !sphere && !scene.colors.is_empty(),
            emits,
            uv,
            second_uv: uv && !sphere && !scene.second_uvs.is_empty(),
            terminator: !sphere && may_be_lifted(m),
            tangents,
            normal_map,
            direction_map,
            bump_map,
            textured,
        }
    }
}

/// Facts about a primitive on which the properties of its surface depend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrimitiveKind {
    /// Whether the primitive is a sphere; otherwise it is a triangle.
    pub sphere: bool,
    /// Whether it belongs to an instance of a shared mesh.
    pub instanced: bool,
    /// Whether it emits light.
    pub emits: bool,
}

/// Returns whether points of triangles with this material may have a terminator offset. Refractive
/// materials have none, since a path that continues inside would hit the surface again.
#[inline]
fn may_be_lifted(m: &Material) -> bool {
    let opaque = m.opacity >= 1.0 && m.opacity_texture == NONE;
    let metal = m.metallic >= 1.0 && m.metallic_texture == NONE;
    m.shadow_terminator && (opaque || metal)
}
