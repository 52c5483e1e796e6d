//! From a description to the flat arrays that a backend renders.

mod flatten;
mod materials;
mod texture;

use glam::{Vec2, Vec3};

pub use flatten::{MAX_PRIMITIVES, compile};
pub use texture::Texture;

use super::desc::CameraDesc;

/// Marks the absence of a texture or of a light in an index.
pub const NONE: u32 = u32::MAX;

/// A scene ready to be rendered. Primitive ids count triangles first, spheres after them.
#[derive(Clone, Debug)]
pub struct CompiledScene {
    /// blake3 of the description: equal scenes have equal hashes, whatever file they came from.
    pub content_hash: [u8; 32],
    /// Positions of every triangle in world space; counter-clockwise seen from its front.
    pub triangles: Vec<[Vec3; 3]>,
    /// Everything else about the same triangle.
    pub attributes: Vec<TriangleAttributes>,
    /// Analytic spheres.
    pub spheres: Vec<Sphere>,
    /// Material rows; primitives index them.
    pub materials: Vec<Material>,
    /// Textures; material rows index them.
    pub textures: Vec<Texture>,
    /// Emissive primitives, in order of primitive id.
    pub emitters: Vec<Emitter>,
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
    /// Row of [`CompiledScene::materials`].
    pub material: u32,
    /// Row of [`CompiledScene::emitters`], or [`NONE`].
    pub emitter: u32,
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
    /// Perceptual roughness.
    pub roughness: f32,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// 1 opaque to 0 refractive.
    pub opacity: f32,
    /// Index of refraction relative to the outside.
    pub ior: f32,
    /// Texture that multiplies `base_color`, or [`NONE`].
    pub base_color_texture: u32,
    /// Texture that multiplies `emission`, or [`NONE`].
    pub emission_texture: u32,
    /// Texture whose red channel below the mask threshold makes a hit a miss, or [`NONE`].
    pub mask_texture: u32,
    /// Factor on texture coordinates.
    pub tiling: f32,
    /// Whether the surface of a light also reflects; where not, a path that hits it ends.
    pub emitter_reflects: bool,
}

/// One emissive primitive and its part of the total emitting area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter {
    /// Primitive id.
    pub primitive: u32,
    /// Area in square scene units, positive.
    pub area: f32,
}

impl CompiledScene {
    /// The material row of a primitive.
    pub fn material_of(&self, primitive: u32) -> u32 {
        let i = primitive as usize;
        match self.attributes.get(i) {
            Some(a) => a.material,
            None => self.spheres[i - self.attributes.len()].material,
        }
    }

    /// Number of primitives.
    pub fn primitive_count(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }
}
