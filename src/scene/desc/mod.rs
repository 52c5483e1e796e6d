//! What a scene says, before anything is computed from it: plain data that loaders fill and sweeps edit.

mod camera;
pub mod delay;
mod hash;
pub mod light;
mod lookup;
pub mod material;
mod model;
mod slot;

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine3A, DAffine3, DMat3, Vec2, Vec3};

pub use camera::{CameraDesc, Optics};
pub use delay::{DelayDesc, DelayKind};
pub use hash::{content_hash, mesh_hash, texture_hash};
pub use light::{ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind};
pub use lookup::{Lookup, NoInverse, Wrap};
pub use material::{MATERIAL_PARAMS, MaterialDesc};
pub use model::{Distribution, MaskMode, Model};
pub use slot::TextureSlot;

/// The name of the material for faces that say none; see [`SceneDesc::with_default_material`].
pub const DEFAULT_MATERIAL: &str = "default_material";

/// The greatest width or height of a picture in pixels.
pub const MAX_SIDE: u32 = 32_768;

/// The greatest number of path edges that can be asked for.
pub const MAX_EDGES: u32 = 65_535;

/// The greatest absolute coordinate, in scene units: beyond it products of coordinates leave the range of `f32`.
pub const MAX_COORDINATE: f32 = 1e12;

/// A whole scene. Lengths are in scene units, colours linear sRGB, angles as their names say.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneDesc {
    /// Width and height of the picture in pixels that the file asks for.
    pub resolution: [u32; 2],
    /// Greatest number of path edges from camera to light that the file asks for: 1 = emission only.
    pub max_depth: u32,
    /// The camera.
    pub camera: CameraDesc,
    /// Other cameras by name; setting `camera` to a name puts one in its place.
    pub views: Vec<(String, CameraDesc)>,
    /// The materials; faces that name none, or an unknown one, take the first.
    pub materials: Vec<MaterialDesc>,
    /// Everything that has a shape.
    pub entities: Vec<EntityDesc>,
    /// Lights without a surface.
    pub lights: Vec<LightDesc>,
    /// Light from outside the scene; `None` is black.
    pub environment: Option<EnvironmentDesc>,
}

impl SceneDesc {
    /// The row of the first material with this name.
    pub fn material_row(&self, name: &str) -> Option<usize> {
        self.materials.iter().position(|m| m.name == name)
    }

    /// Appends a white, rough material named [`DEFAULT_MATERIAL`] if some face or sphere asks for that name and no
    /// material has it.
    #[must_use]
    pub fn with_default_material(mut self, emitter_reflects: bool) -> SceneDesc {
        let asks = |e: &EntityDesc| match (&e.material, &e.shape) {
            (Some(name), _) => name == DEFAULT_MATERIAL,
            (None, ShapeDesc::Mesh(mesh)) => mesh.slots.iter().any(|s| s == DEFAULT_MATERIAL),
            (None, ShapeDesc::Sphere { .. }) => false,
        };
        if self.material_row(DEFAULT_MATERIAL).is_none() && self.entities.iter().any(asks) {
            self.materials.push(MaterialDesc { emitter_reflects, ..MaterialDesc::new(DEFAULT_MATERIAL) });
        }
        self
    }
}

/// One object: a shape with a place and a material.
#[derive(Clone, Debug, PartialEq)]
pub struct EntityDesc {
    /// The name by which edits reach it, unique in the scene.
    pub name: String,
    /// Where it stands.
    pub transform: Transform,
    /// A material that replaces all the shape's own.
    pub material: Option<String>,
    /// Replaces the material's `anisotropic_direction` on this entity, in world space.
    pub anisotropic_direction: Option<Vec3>,
    /// What it is.
    pub shape: ShapeDesc,
}

/// A place: `frame` * T * S * Rx * Ry * Rz. Translation, rotation and scale, in the order of `.scn`, are what edits change;
/// the frame is whatever a format's nodes, groups and matrices put around them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Translation in scene units.
    pub translate: Vec3,
    /// Rotation about x, y and z in radians.
    pub rotate_rad: Vec3,
    /// Scale along x, y and z, applied after the rotation.
    pub scale: Vec3,
    /// Applied after all of these.
    pub frame: Affine3A,
}

impl Default for Transform {
    fn default() -> Transform {
        Transform { translate: Vec3::ZERO, rotate_rad: Vec3::ZERO, scale: Vec3::ONE, frame: Affine3A::IDENTITY }
    }
}

impl Transform {
    /// A place that an affine map says.
    pub fn framed(frame: Affine3A) -> Transform {
        Transform { frame, ..Transform::default() }
    }

    /// From the shape's own space to the world, in double precision so that whole turns and mirrored copies stay exact in
    /// `f32`.
    pub fn to_world(&self) -> DAffine3 {
        let [x, y, z] = self.rotate_rad.as_dvec3().to_array();
        let rotation = DMat3::from_rotation_x(x) * DMat3::from_rotation_y(y) * DMat3::from_rotation_z(z);
        let linear = DMat3::from_diagonal(self.scale.as_dvec3()) * rotation;
        let own = DAffine3::from_mat3_translation(linear, self.translate.as_dvec3());
        DAffine3::from_mat3_translation(self.frame.matrix3.as_dmat3(), self.frame.translation.as_dvec3()) * own
    }

    /// By how much the frame scales a sphere, which must stay one; `None` if it would be an ellipsoid.
    pub fn sphere_scale(&self) -> Option<f32> {
        let [x, y, z] = self.frame.matrix3.to_cols_array_2d().map(Vec3::from);
        let scale = x.length();
        let same = |a: f32| (a - scale).abs() <= 1e-4 * scale;
        let square = |a: Vec3, b: Vec3| a.dot(b).abs() <= 1e-4 * scale * scale;
        (same(y.length()) && same(z.length()) && square(x, y) && square(y, z) && square(z, x)).then_some(scale)
    }
}

/// A shape.
#[derive(Clone, Debug, PartialEq)]
pub enum ShapeDesc {
    /// A triangle mesh, shared between the scenes of a sweep.
    Mesh(Arc<MeshDesc>),
    /// A sphere about the entity's translation; rotation and scale do not apply.
    Sphere {
        /// Radius in scene units, positive.
        radius: f32,
    },
}

/// An indexed triangle mesh. The geometric normal follows the order of the corners (counter-clockwise seen from the
/// front); loaders reorder corners so that this is the side which the file's convention makes the front.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshDesc {
    /// The file it came from.
    pub file: PathBuf,
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals, one per position, or empty for flat shading.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one per position, or empty.
    pub uvs: Vec<Vec2>,
    /// A second set of texture coordinates for textures whose [`Lookup`] asks for it, one per position, or empty: such
    /// textures take the first set then.
    pub second_uvs: Vec<Vec2>,
    /// Linear colours, one per position, each channel in 0..=1, that multiply base colours; or empty.
    pub colors: Vec<Vec3>,
    /// Corners of every triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Names of the materials the mesh uses.
    pub slots: Vec<String>,
    /// Index into `slots` of every triangle.
    pub triangle_slot: Vec<u32>,
    /// blake3 of all the above but `file`, so that a sweep hashes a mesh once.
    pub content_hash: [u8; 32],
}

/// A decoded image file.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureDesc {
    /// The file it came from.
    pub file: PathBuf,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Texels as stored in the file.
    pub texels: Texels,
    /// blake3 of size and texels.
    pub content_hash: [u8; 32],
}

impl TextureDesc {
    /// A picture with these texels, one for each column of each row.
    pub fn new(file: impl Into<PathBuf>, width: u32, height: u32, texels: Texels) -> TextureDesc {
        let content_hash = texture_hash(width, height, &texels);
        TextureDesc { file: file.into(), width, height, texels, content_hash }
    }

    /// A picture of one grey texel, linear.
    pub fn grey(value: f32) -> TextureDesc {
        TextureDesc::new("", 1, 1, Texels::RgbaF32(vec![[value, value, value, 1.0]]))
    }
}

/// Texels, `[y][x][rgba]`, origin top-left, as stored in the file (decoded to linear by role when compiled).
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// Eight bits per channel.
    Rgba8(Vec<[u8; 4]>),
    /// Linear floats.
    RgbaF32(Vec<[f32; 4]>),
}
