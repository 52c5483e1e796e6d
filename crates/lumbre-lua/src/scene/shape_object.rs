//! The Lua object of a shape.

use std::path::PathBuf;
use std::sync::Arc;

use mlua::{UserData, UserDataFields, Value as LuaValue};

use crate::kind::KIND;
use lumbre_light::scene::desc::MeshDesc;
use lumbre_light::scene::shape::Shape;

/// Name of the material slot of shapes. It is never used, since every added shape is given a
/// material.
const SLOT: &str = "shape";

/// Lua object of a shape.
#[derive(Clone, Debug)]
pub enum ShapeObject {
    /// Triangle mesh, shared by all its instances.
    Mesh(Arc<MeshDesc>),
    /// Analytic sphere of this radius.
    Sphere(f32),
}

impl UserData for ShapeObject {
    fn add_fields<F: UserDataFields<Self>>(fields: &mut F) {
        fields.add_meta_field(KIND, "a shape");
    }
}

impl ShapeObject {
    /// Converts a shape to a mesh.
    pub fn new(shape: Shape) -> ShapeObject {
        ShapeObject::Mesh(Arc::new(shape.into_mesh(PathBuf::new(), SLOT)))
    }

    /// Returns the shape behind a Lua value; `None` if the value is not a shape.
    pub fn from_value(value: &LuaValue) -> Option<ShapeObject> {
        match value {
            LuaValue::UserData(data) => data.borrow::<ShapeObject>().ok().map(|s| s.clone()),
            _ => None,
        }
    }
}
