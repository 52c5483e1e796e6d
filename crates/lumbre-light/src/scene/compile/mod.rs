//! Compilation of a scene description to the flat arrays that a backend renders: [`CompiledScene`].

mod bounds;
mod corners;
mod delays;
mod entities;
mod flatten;
mod instance;
mod instancing;
mod lights;
mod materials;
mod memory;
mod mesh;
mod normals;
mod resolver;
mod rough_interface;
mod shared_texels;
mod tangents;
mod texels;
mod texture;
mod texture_bank;

use glam::{DAffine3, DVec3, Vec2, Vec3, Vec4};
use serde::{Deserialize, Serialize};

pub use corners::cofactor;
pub use delays::{Blend, DelayParam, DelayProfile, Delays, MaterialComponent, Share};
pub use entities::Entities;
pub use flatten::{MAX_PRIMITIVES, compile, compile_camera, compile_sharing};
pub use instance::{Instance, Instances, MAX_FLATTENED_PRIMITIVES, SharedMesh};
pub use lights::{Cone, DirectionalLight, Environment, IntensityMap, MapSpace, PointLight};
pub use memory::SceneMemory;
pub use normals::Normals;
pub use texels::srgb_to_linear;
pub use texels::{Curve, LinearTexels};
pub use texture::{Footprint, Texture, Uv, UvMap};

use super::desc::{CameraDesc, EntityDesc};
pub use super::desc::{
    DelayKind, Distribution, Formulas, Lookup, MaskMode, Model, RoughnessTexels, Wrap,
};
use super::{Note, SceneError};
pub use instancing::{SHARED_FROM, Sharing};
pub use materials::diffuse_reflectance;
pub use rough_interface::{KNOTS, Transmittance, transmittance_at};

/// Index that marks the absence of a texture, a light or an instance.
pub const NONE: u32 = u32::MAX;

/// A scene that is ready to be rendered. Primitive ids count triangles first, then spheres; a
/// triangle of a shared mesh is identified by its id and its [`Instance`].
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct CompiledScene {
    /// blake3 hash of the description: equal scenes have equal hashes, whatever files they came
    /// from.
    pub content_hash: [u8; 32],
    /// Vertex positions of every triangle, counter-clockwise seen from its front: triangles in
    /// world space first, then the triangles of shared meshes in object space.
    pub triangles: Vec<[Vec3; 3]>,
    /// Shading attributes of the same triangles.
    pub attributes: Vec<TriangleAttributes>,
    /// Shading normals at the vertices of every triangle.
    pub normals: Normals,
    /// Texture coordinates at the vertices of every triangle, zero for meshes without. Empty if no
    /// mesh has any.
    pub uvs: Vec<[Vec2; 3]>,
    /// Tangents at the vertices of every triangle in MikkTSpace: a unit vector along increasing u,
    /// and in `w` the sign of the bitangent `w (n x t)`, which points along increasing v. Empty if
    /// no material needs tangents; zero for triangles without one.
    pub tangents: Vec<[Vec4; 3]>,
    /// Linear colours at the vertices of every triangle that multiply base colours. Empty if no
    /// mesh has any.
    pub colors: Vec<[Vec3; 3]>,
    /// Second set of texture coordinates at the vertices of every triangle; triangles without one
    /// repeat the first set. Empty if no mesh has any.
    pub second_uvs: Vec<[Vec2; 3]>,
    /// Shared meshes and their instances.
    pub instances: Instances,
    /// Analytic spheres in world space.
    pub spheres: Vec<Sphere>,
    /// Entities of the description that the primitives belong to.
    pub entities: Entities,
    /// Materials, indexed by primitives.
    pub materials: Vec<Material>,
    /// Components and temporal profiles of the materials.
    pub delays: Delays,
    /// Textures, indexed by materials and by the maps of point lights.
    #[serde(with = "shared_texels")]
    pub textures: Vec<Texture>,
    /// Emissive primitives: world-space triangles in order of id, then those of each instance in
    /// turn, then spheres.
    pub emitters: Vec<Emitter>,
    /// Point, spot and goniometric lights.
    pub points: Vec<PointLight>,
    /// Directional lights, infinitely far away.
    pub directionals: Vec<DirectionalLight>,
    /// Light from outside the scene.
    pub environment: Option<Environment>,
    /// Camera of the scene.
    pub camera: CameraDesc,
    /// Point of the description that is the origin here: zero, or the middle of a scene that lies
    /// far from the origin for its size, whose coordinates would be too coarse in single precision.
    pub origin: DVec3,
    /// Corners of the bounding box; both zero for an empty scene.
    pub bounds: [Vec3; 2],
    /// Width and height in pixels, as requested by the description.
    pub resolution: [u32; 2],
    /// Greatest number of path edges, as requested by the description.
    pub max_depth: u32,
}

/// Attributes that every triangle has.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriangleAttributes {
    /// Index into [`CompiledScene::materials`]; for a shared mesh the slot, see
    /// [`Instances::materials`].
    pub material: u32,
    /// Index into [`CompiledScene::emitters`], or [`NONE`]; for a shared mesh see
    /// [`SharedMesh::emissive`].
    pub emitter: u32,
}

/// An analytic sphere; its front is the outside.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// Centre in world space.
    pub center: Vec3,
    /// Radius in scene units, positive.
    pub radius: f32,
    /// Index into [`CompiledScene::materials`].
    pub material: u32,
    /// Index into [`CompiledScene::emitters`], or [`NONE`].
    pub emitter: u32,
}

/// A compiled material; ranges as in [`super::desc::MATERIAL_PARAMS`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Base colour, linear.
    pub base_color: Vec3,
    /// Radiance emitted by the front side.
    pub emission: Vec3,
    /// Scattering model that the parameters describe.
    pub model: Model,
    /// Renderer whose formulas hold where renderers differ.
    pub formulas: Formulas,
    /// Meaning of the texels of the roughness texture.
    pub roughness_texels: RoughnessTexels,
    /// Perceptual roughness in 0..=1.
    pub roughness: f32,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// 1 opaque to 0 refractive.
    pub opacity: f32,
    /// Share of the light that the model `translucent` transmits, by channel.
    pub transmittance: Vec3,
    /// Index of refraction relative to the outside.
    pub ior: f32,
    /// Share of the flatter, subsurface-like diffuse lobe.
    pub subsurface: f32,
    /// Share of the base colour's hue in the dielectric's reflectance at normal incidence.
    pub specular_tint: f32,
    /// Anisotropy of highlights.
    pub anisotropic: f32,
    /// World-space direction of the anisotropy; zero is the direction of increasing u.
    pub anisotropic_direction: Vec3,
    /// Strength of the sheen.
    pub sheen: f32,
    /// Share of the base colour's hue in the sheen.
    pub sheen_tint: f32,
    /// Strength of the clear coat.
    pub clearcoat: f32,
    /// Gloss of the clear coat.
    pub clearcoat_gloss: f32,
    /// Roughness below which specular lobes are Dirac lobes.
    pub smooth_below: f32,
    /// Whether opaque lobes reflect on the front side only, and the back is black.
    pub one_sided: bool,
    /// Factor on the slope of the normal map.
    pub normal_strength: f32,
    /// Height of the value 1 of the bump map, in scene units.
    pub bump_height: f32,
    /// Mask value below which a hit is discarded.
    pub mask_threshold: f32,
    /// Effect of a mask value on a hit.
    pub mask_mode: MaskMode,
    /// Whether paths leave opaque triangles from the smooth surface that their normals suggest.
    pub shadow_terminator: bool,
    /// Whether triangles are shaded with their geometric normals: the shading normals at their
    /// vertices are these.
    pub flat_normals: bool,
    /// Texture that multiplies `base_color`, or [`NONE`].
    pub base_color_texture: u32,
    /// Texture that multiplies `emission`, or [`NONE`].
    pub emission_texture: u32,
    /// Texture whose red channel below the mask threshold discards a hit, or [`NONE`].
    pub mask_texture: u32,
    /// Texture whose red channel replaces `roughness`, or [`NONE`].
    pub roughness_texture: u32,
    /// Texture whose red channel replaces `metallic`, or [`NONE`].
    pub metallic_texture: u32,
    /// Texture whose red channel replaces `opacity`, or [`NONE`].
    pub opacity_texture: u32,
    /// Texture that multiplies `transmittance`, or [`NONE`].
    pub transmittance_texture: u32,
    /// Texture of directions in the tangent frame that replaces `anisotropic_direction`, or
    /// [`NONE`].
    pub anisotropic_texture: u32,
    /// Normal map texture, or [`NONE`].
    pub normal_texture: u32,
    /// Texture whose red channel is a height, or [`NONE`].
    pub bump_texture: u32,
    /// Map from surface texture coordinates to those of the textures.
    pub tiling: UvMap,
    /// Whether the surface of a light also reflects; otherwise a path that hits it ends.
    pub emitter_reflects: bool,
    /// Parameters of the models `conductor`, `plastic` and `dielectric`.
    pub interface: Interface,
}

/// Parameters used only by the models `conductor`, `plastic` and `dielectric`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interface {
    /// Factor on the reflection at the interface.
    pub specular: Vec3,
    /// Real part of a metal's index by channel, relative to the outside.
    pub eta: Vec3,
    /// Imaginary part of a metal's index by channel, relative to the outside.
    pub k: Vec3,
    /// Microfacet distribution of the interface.
    pub distribution: Distribution,
    /// Whether a dielectric is a thin pane.
    pub thin: bool,
    /// Whether light that plastic reflects internally is coloured at each reflection.
    pub nonlinear: bool,
    /// Fraction of diffuse light that the inside of plastic's interface reflects back.
    pub internal_reflectance: f32,
    /// Transmittance of plastic's interface by its microfacets; `None` if it is that of a smooth
    /// one.
    pub transmittance: Option<Transmittance>,
}

impl Interface {
    /// White interface with GGX microfacets: the default.
    pub const PLAIN: Interface = Interface {
        specular: Vec3::ONE,
        eta: Vec3::ZERO,
        k: Vec3::ONE,
        distribution: Distribution::Ggx,
        thin: false,
        nonlinear: false,
        internal_reflectance: 0.0,
        transmittance: None,
    };
}

/// An emissive primitive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Emitter {
    /// Id of the primitive.
    pub primitive: u32,
    /// Instance of a shared mesh, or [`NONE`].
    pub instance: u32,
    /// Area in world space, in square scene units, positive.
    pub area: f32,
}

impl Material {
    /// Returns whether shading needs tangents.
    pub fn uses_tangents(&self) -> bool {
        self.normal_texture != NONE || (self.model.has_microfacets() && self.anisotropic > 0.0)
    }
}

/// Identifies a compiled scene: the hash of its description, and the numbers of stored triangles and
/// of placements, by which scenes differ whose meshes are shared or copied.
pub type CompiledKey = ([u8; 32], usize, usize);

impl CompiledScene {
    /// Returns what identifies the scene, or `None` for scenes built in code, which have no hash.
    pub fn key(&self) -> Option<CompiledKey> {
        let counts = (self.triangles.len(), self.instances.placements.len());
        (self.content_hash != [0; 32]).then_some((self.content_hash, counts.0, counts.1))
    }

    /// Returns whether shading a material, or one of its components, needs tangents.
    pub fn uses_tangents(&self, material: u32) -> bool {
        let uses = |row: u32| self.materials[row as usize].uses_tangents();
        uses(material) || self.delays.leaves(material).into_iter().any(uses)
    }

    /// Returns the number of stored primitives; a shared mesh counts once. See also
    /// [`CompiledScene::flattened_count`].
    pub fn primitive_count(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// Returns a point of this scene in the space of its description.
    #[inline]
    pub fn described(&self, point: Vec3) -> Vec3 {
        (point.as_dvec3() + self.origin).as_vec3()
    }

    /// Returns a point of the description in the space of this scene. `rest` is what single
    /// precision leaves of it.
    fn placed(&self, point: Vec3, rest: Vec3) -> Vec3 {
        if self.origin == DVec3::ZERO {
            return point;
        }
        (point.as_dvec3() + rest.as_dvec3() - self.origin).as_vec3()
    }

    /// Returns the map from the stored positions of an entity to the space of this scene.
    fn placed_map(&self, entity: &EntityDesc) -> DAffine3 {
        if self.origin == DVec3::ZERO {
            return entity.to_near_world();
        }
        let mut map = entity.to_world();
        map.translation -= self.origin;
        map
    }

    /// Returns a camera of the description as one of this scene: see [`compile_camera`].
    ///
    /// # Errors
    /// Fails like [`compile_camera`].
    pub fn placed_camera(
        &self,
        camera: &CameraDesc,
        notes: &mut Vec<Note>,
    ) -> Result<CameraDesc, SceneError> {
        let [position, target] = camera.rest;
        let placed = CameraDesc {
            position: self.placed(camera.position, position),
            target: self.placed(camera.target, target),
            rest: [Vec3::ZERO; 2],
            ..camera.clone()
        };
        compile_camera(&placed, notes)
    }

    /// Returns the corners of the scene's bounding box, and the greatest distance of a surface from
    /// its centre; all zero for an empty scene.
    pub fn bounds_and_radius(&self) -> ([Vec3; 2], f32) {
        let [low, high] = bounds::bounds(self);
        ([low, high], bounds::radius(self, low + (high - low) * 0.5))
    }
}
