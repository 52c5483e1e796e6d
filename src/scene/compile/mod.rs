//! From a description to the flat arrays that a backend renders.

mod bounds;
mod corners;
mod delays;
mod flatten;
mod instance;
mod lights;
mod materials;
mod share;
mod tangents;
mod texture;

use glam::{Vec2, Vec3, Vec4};

pub use delays::{DelayParam, DelayProfile, Delays, Part};
pub use flatten::{MAX_PRIMITIVES, compile, compile_sharing};
pub use instance::{Instance, Instances, MOST_UNFOLDED, SharedMesh};
pub use lights::{Cone, DirectionalLight, Environment, PointLight};
pub(in crate::scene) use texture::srgb_to_linear;
pub use texture::{Texture, Uv, UvMap};

use super::desc::CameraDesc;
pub use super::desc::{DelayKind, Distribution, Lookup, MaskMode, Model, Wrap};
pub use materials::diffuse_reflectance;
pub use share::{SHARED_FROM, Sharing};

/// Marks the absence of a texture or of a light in an index.
pub const NONE: u32 = u32::MAX;

/// A scene ready to be rendered. Primitive ids count triangles first, spheres after them; a triangle of a shared mesh is
/// named by its id and the [`Instance`] that is meant.
#[derive(Clone, Debug)]
pub struct CompiledScene {
    /// blake3 of the description: equal scenes have equal hashes, whatever file they came from.
    pub content_hash: [u8; 32],
    /// Positions of every triangle, counter-clockwise seen from its front: in world space, and behind those the triangles of
    /// shared meshes in spaces of their own.
    pub triangles: Vec<[Vec3; 3]>,
    /// Everything else about the same triangle.
    pub attributes: Vec<TriangleAttributes>,
    /// Tangents at the corners of every triangle in MikkTSpace: a unit vector along growing u, and in `w` the sign of
    /// the bitangent `w (n x t)` that points along growing v. Empty if no material needs any; zero where there is none.
    pub tangents: Vec<[Vec4; 3]>,
    /// Linear colours at the corners of every triangle that multiply base colours. Empty if no mesh has any.
    pub colors: Vec<[Vec3; 3]>,
    /// The second set of texture coordinates at the corners of every triangle, of those without the first again. Empty if no
    /// mesh has any.
    pub second_uvs: Vec<[Vec2; 3]>,
    /// Copies of meshes that are kept once.
    pub instances: Instances,
    /// Analytic spheres.
    pub spheres: Vec<Sphere>,
    /// Material rows; primitives index them.
    pub materials: Vec<Material>,
    /// What material rows are composed of, and when they give light back.
    pub delays: Delays,
    /// Textures; material rows index them.
    pub textures: Vec<Texture>,
    /// Emissive primitives: triangles in the world in order of their id, those of each copy in turn, then spheres.
    pub emitters: Vec<Emitter>,
    /// Lights that are points.
    pub points: Vec<PointLight>,
    /// Lights that are directions.
    pub directionals: Vec<DirectionalLight>,
    /// Light from outside the scene.
    pub environment: Option<Environment>,
    /// The camera.
    pub camera: CameraDesc,
    /// The corners of the box around everything; both zero for an empty scene.
    pub bounds: [Vec3; 2],
    /// Width and height in pixels that the description asks for.
    pub resolution: [u32; 2],
    /// Greatest number of path edges that the description asks for.
    pub max_depth: u32,
}

/// What shading needs of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleAttributes {
    /// Unit shading normals at the corners, on the front side.
    pub normals: [Vec3; 3],
    /// Texture coordinates at the corners.
    pub uvs: [Vec2; 3],
    /// Row of [`CompiledScene::materials`]; of a shared mesh its slot: see [`Instances::materials`].
    pub material: u32,
    /// Row of [`CompiledScene::emitters`], or [`NONE`]; of a shared mesh see [`SharedMesh::shining`].
    pub emitter: u32,
}

impl TriangleAttributes {
    /// Texture coordinates at a point with these weights of the second and third corner.
    #[inline]
    pub fn uv(&self, [v, w]: [f32; 2]) -> Vec2 {
        let [a, b, c] = self.uvs;
        a * (1.0 - v - w) + b * v + c * w
    }
}

/// An analytic sphere; its front is the outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre in world space.
    pub center: Vec3,
    /// Radius, positive.
    pub radius: f32,
    /// Row of [`CompiledScene::materials`].
    pub material: u32,
    /// Row of [`CompiledScene::emitters`], or [`NONE`].
    pub emitter: u32,
}

/// A material as compiled from its parameters; ranges as in [`super::desc::MATERIAL_PARAMS`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Base colour, linear.
    pub base_color: Vec3,
    /// Emitted radiance of the front side.
    pub emission: Vec3,
    /// Which BSDF the parameters describe.
    pub model: Model,
    /// Perceptual roughness.
    pub roughness: f32,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// 1 opaque to 0 refractive.
    pub opacity: f32,
    /// Index of refraction relative to the outside.
    pub ior: f32,
    /// Part of the flatter diffuse lobe.
    pub subsurface: f32,
    /// Hue in the dielectric's reflectance at normal incidence.
    pub specular_tint: f32,
    /// Stretch of highlights.
    pub anisotropic: f32,
    /// World-space direction of the stretch; zero is the direction of growing u.
    pub anisotropic_direction: Vec3,
    /// Sheen.
    pub sheen: f32,
    /// Hue of the sheen.
    pub sheen_tint: f32,
    /// Clear coat.
    pub clearcoat: f32,
    /// Gloss of the clear coat.
    pub clearcoat_gloss: f32,
    /// Roughness below which specular lobes are Dirac lobes.
    pub smooth_below: f32,
    /// Factor on the slope of the normal map.
    pub normal_strength: f32,
    /// How far 1 in the bump map stands out, in scene units.
    pub bump_height: f32,
    /// Mask values below this are holes.
    pub mask_threshold: f32,
    /// How a mask decides.
    pub mask_mode: MaskMode,
    /// Whether paths leave opaque triangles from the surface that their normals suggest.
    pub shadow_terminator: bool,
    /// Texture that multiplies `base_color`, or [`NONE`].
    pub base_color_texture: u32,
    /// Texture that multiplies `emission`, or [`NONE`].
    pub emission_texture: u32,
    /// Texture whose red channel below the mask threshold makes a hit a miss, or [`NONE`].
    pub mask_texture: u32,
    /// Texture whose red channel replaces `roughness`, or [`NONE`].
    pub roughness_texture: u32,
    /// Texture whose red channel replaces `metallic`, or [`NONE`].
    pub metallic_texture: u32,
    /// Texture whose red channel replaces `opacity`, or [`NONE`].
    pub opacity_texture: u32,
    /// Texture of directions in the tangent frame that replaces `anisotropic_direction`, or [`NONE`].
    pub anisotropic_texture: u32,
    /// Normal map, or [`NONE`].
    pub normal_texture: u32,
    /// Texture whose red channel is a height, or [`NONE`].
    pub bump_texture: u32,
    /// From texture coordinates to places in the textures.
    pub tiling: UvMap,
    /// Whether the surface of a light also reflects; where not, a path that hits it ends.
    pub emitter_reflects: bool,
    /// What the models `conductor`, `plastic` and `dielectric` need beside the rest.
    pub interface: Interface,
}

/// What only the models `conductor`, `plastic` and `dielectric` need of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interface {
    /// Factor on what is reflected at the interface.
    pub specular: Vec3,
    /// Real part of a metal's index by channel, relative to the outside.
    pub eta: Vec3,
    /// Imaginary part of a metal's index by channel, relative to the outside.
    pub k: Vec3,
    /// How the normals of microfacets are distributed.
    pub distribution: Distribution,
    /// Whether a dielectric is a thin pane.
    pub thin: bool,
    /// Whether light that plastic reflects back inside takes on its colour each time.
    pub nonlinear: bool,
    /// Part of diffuse light that is reflected back at the inside of plastic.
    pub internal_reflectance: f32,
}

impl Interface {
    /// White, of GGX microfacets: what materials have that ask for nothing else.
    pub const PLAIN: Interface = Interface {
        specular: Vec3::ONE,
        eta: Vec3::ZERO,
        k: Vec3::ONE,
        distribution: Distribution::Ggx,
        thin: false,
        nonlinear: false,
        internal_reflectance: 0.0,
    };
}

/// One emissive primitive and its part of the total emitting area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter {
    /// Primitive id.
    pub primitive: u32,
    /// The copy of a shared mesh that is meant, or [`NONE`].
    pub instance: u32,
    /// Area in world space, in square scene units, positive.
    pub area: f32,
}

impl Material {
    /// Whether shading needs tangents.
    pub fn uses_tangents(&self) -> bool {
        self.normal_texture != NONE || (self.model != Model::Lambert && self.anisotropic > 0.0)
    }
}

impl CompiledScene {
    /// Whether shading a material row, or a part of it, needs tangents.
    pub fn uses_tangents(&self, material: u32) -> bool {
        let uses = |row: u32| self.materials[row as usize].uses_tangents();
        uses(material) || self.delays.parts(material).iter().any(|part| uses(part.material))
    }

    /// Number of primitives that are kept, those of a shared mesh once: see [`CompiledScene::flattened_count`].
    pub fn primitive_count(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// The corners of the box around everything, and the greatest distance of a surface from its middle; all zero for
    /// nothing.
    pub fn around(&self) -> ([Vec3; 2], f32) {
        let [low, high] = bounds::bounds(self);
        ([low, high], bounds::radius(self, low + (high - low) * 0.5))
    }
}
