//! Scene description: plain data that loaders fill and that `set` edits, before anything is
//! computed from it.
//!
//! [`SceneDesc`] holds the camera, materials, entities (meshes and spheres), lights and the
//! environment. [`content_hash`] identifies the picture that a description produces.

mod camera;
mod cow_vec;
pub mod delay;
mod delay_profile;
mod hash;
pub mod light;
mod lookup;
pub mod material;
pub mod material_params;
mod model;
pub mod place;
mod slot;
mod view_window;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3, Vec4};

pub use camera::{
    CAMERA_KIND_NAMES, CAMERA_KINDS, CameraDesc, CameraKind, Optics, VIEW_HEIGHT_RANGE,
};
pub use cow_vec::CowVec;
pub use delay_profile::{DelayDesc, DelayKind};
pub use hash::{content_hash, hash_without_camera, mesh_hash, texture_hash};
pub use light::{
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSampling, EnvironmentSource, LightDesc,
    LightKind, SpotImage,
};
pub use lookup::{Lookup, NoInverse, TextureFilter, Wrap};
pub use material::MaterialDesc;
pub use material_params::MATERIAL_PARAMS;
pub use model::{
    Distribution, FilterChoice, Formulas, MaskMode, Model, RoughnessTexels, ShadingNormals,
};
pub use slot::TextureSlot;
pub use view_window::{MAX_WINDOW_EDGE, ViewWindow};

/// Name of the material of faces that name none; see [`SceneDesc::with_default_material`].
pub const DEFAULT_MATERIAL: &str = "default_material";

/// Greatest width or height of an image in pixels.
pub const MAX_SIDE: u32 = 32_768;

/// Greatest supported number of path edges.
pub const MAX_EDGES: u32 = 65_535;

/// Greatest absolute coordinate in scene units: products of larger coordinates overflow `f32`.
pub const MAX_COORDINATE: f32 = 1e12;

/// A complete scene. Lengths are in scene units, colours in linear sRGB, angles in the unit that
/// the field's name states.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneDesc {
    /// Width and height of the image in pixels, as requested by the file.
    pub resolution: [u32; 2],
    /// Greatest number of path edges from camera to light, as requested by the file; 1 is emission
    /// only.
    pub max_depth: u32,
    /// Camera that renders the scene.
    pub camera: CameraDesc,
    /// Other cameras by name. Setting `camera` to a name makes that view the camera.
    pub views: Vec<(String, CameraDesc)>,
    /// Materials. Faces that name none, or an unknown one, use the first.
    pub materials: CowVec<MaterialDesc>,
    /// Objects with a shape.
    pub entities: CowVec<EntityDesc>,
    /// Lights without a surface.
    pub lights: Vec<LightDesc>,
    /// Light from outside the scene; `None` is black.
    pub environment: Option<EnvironmentDesc>,
}

impl Default for SceneDesc {
    /// Returns an empty scene of 1280 x 720 pixels and 8 path edges.
    fn default() -> SceneDesc {
        SceneDesc {
            resolution: [1280, 720],
            max_depth: 8,
            camera: CameraDesc::default(),
            views: Vec::new(),
            materials: CowVec::default(),
            entities: CowVec::default(),
            lights: Vec::new(),
            environment: None,
        }
    }
}

impl SceneDesc {
    /// Returns the index of the first material with this name.
    pub fn material_index(&self, name: &str) -> Option<usize> {
        self.materials.iter().position(|m| m.name == name)
    }

    /// Returns the names of all materials, for looking up many.
    pub fn material_names(&self) -> MaterialNames<'_> {
        let mut indices = BTreeMap::new();
        for (index, m) in self.materials.iter().enumerate() {
            indices.entry(m.name.as_str()).or_insert(index);
        }
        MaterialNames(indices)
    }

    /// Appends a white, rough material named [`DEFAULT_MATERIAL`] if a face or sphere refers to
    /// that name and no material has it.
    #[must_use]
    pub fn with_default_material(mut self, emitter_reflects: bool) -> SceneDesc {
        let uses_default = |e: &EntityDesc| match (&e.material, &e.shape) {
            (Some(name), _) => name == DEFAULT_MATERIAL,
            (None, ShapeDesc::Mesh(mesh)) => mesh.slots.iter().any(|s| s == DEFAULT_MATERIAL),
            (None, ShapeDesc::Sphere { .. }) => false,
        };
        if self.material_index(DEFAULT_MATERIAL).is_none() && self.entities.iter().any(uses_default)
        {
            self.materials.push(MaterialDesc {
                emitter_reflects,
                ..MaterialDesc::new(DEFAULT_MATERIAL)
            });
        }
        self
    }
}

/// Names of the materials of a scene: the same as [`SceneDesc::material_index`] for each name, in
/// logarithmic time.
#[derive(Debug)]
pub struct MaterialNames<'a>(BTreeMap<&'a str, usize>);

impl MaterialNames<'_> {
    /// Returns the index of the first material with this name.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.0.get(name).copied()
    }
}

/// An object: a shape with a transform and a material.
#[derive(Clone, Debug, PartialEq)]
pub struct EntityDesc {
    /// Name used by edits, unique in the scene.
    pub name: String,
    /// Transform from the shape's own space to the world.
    pub transform: Transform,
    /// Material that replaces all materials of the shape.
    pub material: Option<String>,
    /// Replaces the material's `anisotropic_direction` on this entity, in world space.
    pub anisotropic_direction: Option<Vec3>,
    /// Shape of the object, in its own space.
    pub shape: ShapeDesc,
}

impl EntityDesc {
    /// Returns the map from the stored positions of the shape to the world.
    pub fn to_world(&self) -> DAffine3 {
        self.after_origin(&self.transform)
    }

    /// Returns the map from the stored positions of the shape to the world of a scene near the
    /// origin, whose frames are in single precision.
    pub fn to_near_world(&self) -> DAffine3 {
        self.after_origin(&self.transform.rounded())
    }

    /// Returns a transform after the step from the stored positions to the shape's own space.
    fn after_origin(&self, transform: &Transform) -> DAffine3 {
        let map = transform.to_world();
        match &self.shape {
            ShapeDesc::Mesh(mesh) if mesh.origin != DVec3::ZERO => {
                map * DAffine3::from_translation(mesh.origin)
            }
            _ => map,
        }
    }

    /// Creates an entity that is not transformed and has the materials of its mesh.
    pub fn new(name: impl Into<String>, shape: ShapeDesc) -> EntityDesc {
        EntityDesc {
            name: name.into(),
            transform: Transform::default(),
            material: None,
            anisotropic_direction: None,
            shape,
        }
    }
}

/// An affine transform: `frame` * T * S * Rx * Ry * Rz. Translation, rotation and scale, in the
/// order of `.scn`, are what edits change; `frame` holds the product of the nodes, groups and
/// matrices that a format puts around them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Translation in scene units.
    pub translate: DVec3,
    /// Rotation about x, y and z in radians.
    pub rotate_rad: Vec3,
    /// Scale along x, y and z, applied after the rotation.
    pub scale: Vec3,
    /// Affine map applied last.
    pub frame: DAffine3,
}

impl Default for Transform {
    fn default() -> Transform {
        Transform {
            translate: DVec3::ZERO,
            rotate_rad: Vec3::ZERO,
            scale: Vec3::ONE,
            frame: DAffine3::IDENTITY,
        }
    }
}

impl Transform {
    /// Returns a transform that consists of an affine map alone.
    pub fn framed(frame: DAffine3) -> Transform {
        Transform {
            frame,
            ..Transform::default()
        }
    }

    /// Returns the map from the shape's own space to the world, in double precision so that full
    /// turns and mirrored instances stay exact in `f32`.
    pub fn to_world(&self) -> DAffine3 {
        let [x, y, z] = self.rotate_rad.as_dvec3().to_array();
        let rotation =
            DMat3::from_rotation_x(x) * DMat3::from_rotation_y(y) * DMat3::from_rotation_z(z);
        let linear = DMat3::from_diagonal(self.scale.as_dvec3()) * rotation;
        let own = DAffine3::from_mat3_translation(linear, self.translate);
        self.frame * own
    }

    /// Returns the transform with a frame and a translation that single precision holds: that of
    /// scenes near the origin.
    pub fn rounded(&self) -> Transform {
        Transform {
            translate: self.translate.as_vec3().as_dvec3(),
            frame: place::double(self.frame.as_affine3a()),
            ..*self
        }
    }

    /// Returns the factor by which the frame scales a sphere, or `None` if it would make it an
    /// ellipsoid.
    pub fn sphere_scale(&self) -> Option<f32> {
        let linear = self.frame.as_affine3a().matrix3;
        let [x, y, z] = linear.to_cols_array_2d().map(Vec3::from);
        let scale = x.length();
        let same = |a: f32| (a - scale).abs() <= 1e-4 * scale;
        let square = |a: Vec3, b: Vec3| a.dot(b).abs() <= 1e-4 * scale * scale;
        (same(y.length()) && same(z.length()) && square(x, y) && square(y, z) && square(z, x))
            .then_some(scale)
    }
}

/// The geometry of an entity.
#[derive(Clone, Debug, PartialEq)]
pub enum ShapeDesc {
    /// A triangle mesh, shared between the scenes of a sweep.
    Mesh(Arc<MeshDesc>),
    /// A sphere about the entity's translation. Rotation and scale do not apply.
    Sphere {
        /// Radius in scene units, positive.
        radius: f32,
    },
}

/// An indexed triangle mesh. The front is the side from which the corners appear counter-clockwise;
/// loaders reorder corners so that it is the side that the file's convention makes the front.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshDesc {
    /// File from which the mesh was read.
    pub file: PathBuf,
    /// Vertex positions in the mesh's own space, relative to `origin`.
    pub positions: Vec<Vec3>,
    /// Point of the mesh's own space from which positions count: zero, or a point of a mesh whose
    /// file places it far from its own origin for its size.
    pub origin: DVec3,
    /// Unit vertex normals, one per position, or empty for flat shading.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one per position, or empty.
    pub uvs: Vec<Vec2>,
    /// Second set of texture coordinates, one per position, or empty. Textures whose [`Lookup`]
    /// selects the second set use the first one if this is empty.
    pub second_uvs: Vec<Vec2>,
    /// Tangents of normal maps and anisotropy, one per position, or empty: in `xyz` the unit
    /// direction of increasing u, in `w` the sign of the bitangent `w (n x t)`, which points along
    /// increasing v. Zero stands for a tangent in MikkTSpace, which compilation computes.
    pub tangents: Vec<Vec4>,
    /// Linear vertex colours that multiply base colours, one per position, each channel in 0..=1;
    /// or empty.
    pub colors: Vec<Vec3>,
    /// Vertex indices of the corners of every triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Names of the materials of the mesh.
    pub slots: Vec<String>,
    /// Index into `slots` for every triangle.
    pub triangle_slot: Vec<u32>,
    /// blake3 hash of every field but `file`, stored so that a sweep hashes a mesh once.
    pub content_hash: [u8; 32],
}

impl MeshDesc {
    /// Sets the positions to points in double precision. Those far from zero for their size count
    /// from a point among them.
    pub fn place(&mut self, points: &[DVec3]) {
        self.origin = place::mesh_origin(points.iter().copied());
        let relative = points.iter().map(|p| (*p - self.origin).as_vec3());
        self.positions = relative.collect();
    }
}

/// A decoded image file.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureDesc {
    /// File from which the image was read.
    pub file: PathBuf,
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Texels as stored in the file.
    pub texels: Texels,
    /// blake3 hash of size and texels.
    pub content_hash: [u8; 32],
}

impl TextureDesc {
    /// Creates a texture from texels in row-major order.
    pub fn new(file: impl Into<PathBuf>, width: u32, height: u32, texels: Texels) -> TextureDesc {
        let content_hash = texture_hash(width, height, &texels);
        TextureDesc {
            file: file.into(),
            width,
            height,
            texels,
            content_hash,
        }
    }

    /// Creates a texture of one grey texel, linear.
    pub fn grey(value: f32) -> TextureDesc {
        TextureDesc::new("", 1, 1, Texels::RgbaF32(vec![[value, value, value, 1.0]]))
    }
}

/// Texels, `[y][x][rgba]`, origin top-left, as stored in the file. Compilation decodes them to
/// linear values according to their slot.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// Eight bits per channel.
    Rgba8(Arc<[[u8; 4]]>),
    /// Linear values, 32-bit floats.
    RgbaF32(Vec<[f32; 4]>),
}
