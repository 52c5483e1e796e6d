//! Parts of scenes: a shape or a group with a placement and a material. `group` combines several
//! parts.

use std::rc::Rc;

use glam::{Affine3A, DVec3, EulerRot, Quat, Vec3};
use mlua::{UserData, UserDataFields, Value as LuaValue};

use super::shape_object::ShapeObject;
use crate::api::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::kind::{KIND, kind};
use crate::strict::{self, Fields, numbers};
use lumbre_light::field;
use lumbre_light::scene::desc::Transform;
use lumbre_light::scene::desc::place::double;
use lumbre_light::value::schema::{Field, SchemaError, Table, Ty};
use lumbre_scene_io::names::UniqueNames;

/// Largest number of shapes in nested groups.
const MAX_LEAVES: usize = 1 << 22;

const NUMBERS_3: Ty = Ty::nums(3, -1e9, 1e9);

const AT: Field = field!(at = "{ 0, 0, 0 }": NUMBERS_3, "position of its origin, in scene units");
const ROTATE: Field = field! {
    rotate = "0": Ty::Any("number|number[]"),
        "rotation in degrees: about +y, or { x, y, z } about the three axes"
};
const SCALE: Field = field! {
    scale = "1": Ty::Any("number|number[]"),
        "scale factor, or one for each of x, y and z; a negative factor mirrors"
};

/// Placement without a shape.
pub const PLACE: Table = Table {
    name: "Place",
    doc: "Placement: scaled first, then rotated about z, y and x, then moved.",
    fields: &[AT, ROTATE, SCALE],
};

/// Argument of `s:add`, and items of groups.
pub const PART: Table = Table {
    name: "Part",
    doc: "Shape or group with a placement: scaled first, then rotated about z, y and x, then \
          moved.",
    fields: &[
        field!(shape: Ty::Object("Shape|Group"), "shape or group"),
        field! {
            name = "the material's, with a number": Ty::Str,
                "name for changes with `set`: entities.NAME.position, or \
                 entities.GROUP/NAME.position for a part of a group"
        },
        field! {
            material = "the group's": Ty::Str,
                "name of its material; the material of a group applies to its parts without one"
        },
        AT,
        ROTATE,
        SCALE,
        field! {
            anisotropic_direction = "the material's": NUMBERS_3,
                "world-space direction along which highlights are stretched"
        },
    ],
};

functions! {
    /// Constructor of groups.
    pub const GLOBALS;
    "group" -> "Group" = group,
        "Combines parts to a group that can be added any number of times; its meshes are stored \
         once." {
        "parts": "Part[]", "List of shapes and groups, each with its placement.";
    }
}

/// Shape or group with a placement.
#[derive(Clone, Debug)]
pub struct ScenePart {
    name: Option<String>,
    material: Option<String>,
    place: Placement,
    anisotropic_direction: Option<Vec3>,
    content: PartContent,
}

/// Content of a part.
#[derive(Clone, Debug)]
enum PartContent {
    Shape(ShapeObject),
    Group(GroupObject),
}

/// Placement of a part: scale, then rotation, then translation.
#[derive(Clone, Copy, Debug)]
struct Placement {
    at: DVec3,
    rotate_rad: Vec3,
    scale: Vec3,
}

impl Placement {
    /// Returns the transformation from the part's space to that of its parent.
    fn matrix(&self) -> Affine3A {
        let [x, y, z] = self.rotate_rad.to_array();
        Affine3A::from_scale_rotation_translation(
            self.scale,
            Quat::from_euler(EulerRot::XYZ, x, y, z),
            self.at.as_vec3(),
        )
    }
}

/// Lua object of a group: its parts and their number of shapes.
#[derive(Clone, Debug)]
pub struct GroupObject {
    parts: Rc<Vec<ScenePart>>,
    leaves: usize,
}

impl UserData for GroupObject {
    fn add_fields<F: UserDataFields<Self>>(fields: &mut F) {
        fields.add_meta_field(KIND, "a group");
    }
}

/// Shape of a part, with the properties that it inherits from groups.
#[derive(Clone, Debug)]
pub struct Leaf {
    /// Names of the enclosing groups and of the part, outermost first.
    pub names: Vec<String>,
    /// Shape of the leaf.
    pub shape: ShapeObject,
    /// Transformation from the shape's space to that of the scene.
    pub frame: Affine3A,
    /// The same transformation in the form that `set` can edit.
    pub transform: Transform,
    /// Material of the part, or of the innermost group that has one.
    pub material: Option<String>,
    /// World-space direction along which highlights are stretched.
    pub anisotropic_direction: Option<Vec3>,
}

impl ScenePart {
    /// Returns the number of shapes.
    fn leaf_count(&self) -> usize {
        match &self.content {
            PartContent::Shape(_) => 1,
            PartContent::Group(group) => group.leaves,
        }
    }

    /// Returns all shapes in the order of the lists of groups.
    pub fn leaves(&self) -> Vec<Leaf> {
        let mut leaves = Vec::with_capacity(self.leaf_count());
        self.collect(&mut leaves, &[], Affine3A::IDENTITY, None, None);
        leaves
    }

    /// Appends all shapes; `around`, `material` and `direction` are inherited from the enclosing
    /// groups.
    fn collect(
        &self,
        leaves: &mut Vec<Leaf>,
        names: &[String],
        around: Affine3A,
        material: Option<&str>,
        direction: Option<Vec3>,
    ) {
        let names: Vec<String> = names.iter().chain(&self.name).cloned().collect();
        let material = self.material.as_deref().or(material);
        let direction = self.anisotropic_direction.or(direction);
        let frame = around * self.place.matrix();
        match &self.content {
            PartContent::Group(group) => {
                group
                    .parts
                    .iter()
                    .for_each(|part| part.collect(leaves, &names, frame, material, direction));
            }
            PartContent::Shape(shape) => leaves.push(Leaf {
                names,
                shape: shape.clone(),
                frame,
                transform: self.place.transform(around),
                material: material.map(str::to_owned),
                anisotropic_direction: direction,
            }),
        }
    }
}

impl Placement {
    /// Returns the placement inside `around` as a transform of a scene description. A description
    /// scales after the rotation, so scale and rotation can be separate only if the scale is
    /// uniform or the rotation is zero.
    fn transform(&self, around: Affine3A) -> Transform {
        let even = self.scale.min_element() == self.scale.max_element();
        if even || self.rotate_rad == Vec3::ZERO {
            let (translate, rotate_rad, scale) = (self.at, self.rotate_rad, self.scale);
            Transform {
                translate,
                rotate_rad,
                scale,
                frame: double(around),
            }
        } else {
            let turned = Placement {
                at: DVec3::ZERO,
                ..*self
            }
            .matrix();
            let moved = around * Affine3A::from_translation(self.at.as_vec3());
            Transform::framed(double(moved * turned))
        }
    }
}

/// Returns a unique name for a leaf: its given names, or its material with a number.
pub fn name(names: &mut UniqueNames, leaf: &Leaf) -> String {
    match leaf.names.as_slice() {
        [] => names.allocate_numbered(leaf.material.as_deref().unwrap_or("part"), 1),
        given => names.allocate(&given.join("/")),
    }
}

/// Converts the only argument of a function, a list of parts.
///
/// # Errors
/// Returns an error for an empty list or an invalid part.
pub fn list(args: &Args) -> Result<Vec<ScenePart>, ScriptError> {
    let table = args.table(0, "parts")?;
    let items: Vec<LuaValue> = table
        .sequence_values::<LuaValue>()
        .collect::<Result<_, _>>()
        .map_err(|e| args.shared.convert(&e))?;
    if items.is_empty() {
        let help = "write the parts as a list: { { shape = .. }, { shape = .. } }".to_owned();
        return Err(args.error("expected a list of parts, found none", Some(help)));
    }
    let read_item = |(i, item): (usize, &LuaValue)| match item {
        LuaValue::Table(t) => read(args, t, &format!("part[{}]", i + 1)),
        other => Err(args.error(
            format!("part[{}]: expected a table, found {}", i + 1, kind(other)),
            None,
        )),
    };
    items.iter().enumerate().map(read_item).collect()
}

/// Converts one part; error paths begin with `path`.
///
/// # Errors
/// Returns an error for an invalid field, or for a non-uniform scale of an analytic sphere.
pub fn read(args: &Args, table: &mlua::Table, path: &str) -> Result<ScenePart, ScriptError> {
    let fields = strict::fields(table, &PART, path, false).map_err(|e| args.locate_error(e))?;
    let fail = |key: &str, problem: String| {
        let path = format!("{path}.{key}");
        Err(args.locate_error(SchemaError::new(path, key, problem)))
    };
    let shape = fields
        .objects
        .get("shape")
        .cloned()
        .unwrap_or(LuaValue::Nil);
    let content = match (ShapeObject::from_value(&shape), &shape) {
        (Some(shape), _) => PartContent::Shape(shape),
        (None, LuaValue::UserData(data)) if data.is::<GroupObject>() => PartContent::Group(
            data.borrow::<GroupObject>()
                .map_err(|e| args.shared.convert(&e))?
                .clone(),
        ),
        _ => {
            return fail(
                "shape",
                format!("expected a shape or a group, found {}", kind(&shape)),
            );
        }
    };
    let text = |key: &str| fields.text(key).map(str::to_owned);
    let place = placement(&fields, path).map_err(|e| args.locate_error(e))?;
    let even = place.scale.abs().min_element() == place.scale.abs().max_element();
    if matches!(&content, PartContent::Shape(ShapeObject::Sphere(_))) && !even {
        return fail(
            "scale",
            "an analytic sphere needs a uniform scale; use shape.ball instead".to_owned(),
        );
    }
    Ok(ScenePart {
        name: text("name"),
        material: text("material"),
        place,
        anisotropic_direction: vector(&fields, "anisotropic_direction"),
        content,
    })
}

/// Converts a table that is only a placement.
///
/// # Errors
/// Returns an error for an invalid field.
pub fn frame(args: &Args, table: &mlua::Table, path: &str) -> Result<Affine3A, ScriptError> {
    let read = || placement(&strict::fields(table, &PLACE, path, false)?, path);
    read()
        .map(|place| place.matrix())
        .map_err(|e| args.locate_error(e))
}

fn vector(fields: &Fields, key: &str) -> Option<Vec3> {
    fields.numbers(key).map(Vec3::from_array)
}

/// Returns the point of a field in double precision.
pub fn place(fields: &Fields, key: &str) -> Option<DVec3> {
    let list = fields.values.get(key)?.as_list()?;
    let [x, y, z] = list else { return None };
    Some(DVec3::new(x.as_f64()?, y.as_f64()?, z.as_f64()?))
}

/// Converts the placement of a part.
fn placement(fields: &Fields, path: &str) -> Result<Placement, SchemaError> {
    let wrong =
        |key: &str, problem: String| SchemaError::new(format!("{path}.{key}"), key, problem);
    let three = |key: &str, one: fn(f32) -> Vec3, otherwise: Vec3| match fields.values.get(key) {
        None => Ok(otherwise),
        Some(value) => match (value.as_f64(), value) {
            (Some(x), _) if x.is_finite() => Ok(one(x as f32)),
            (None, list) if NUMBERS_3.check("", key, list).is_ok() => {
                Ok(Vec3::from(numbers::<3>(list)))
            }
            _ => Err(wrong(
                key,
                format!("expected one number or a list of three, found {value}"),
            )),
        },
    };
    let rotate_deg = three("rotate", |y| Vec3::new(0.0, y, 0.0), Vec3::ZERO)?;
    let scale = three("scale", Vec3::splat, Vec3::ONE)?;
    if scale.abs().min_element() < 1e-12 {
        return Err(wrong(
            "scale",
            "a scale of 0 makes the part flat".to_owned(),
        ));
    }
    let at = place(fields, "at").unwrap_or(DVec3::ZERO);
    Ok(Placement {
        at,
        rotate_rad: rotate_deg * std::f32::consts::PI / 180.0,
        scale,
    })
}

fn group(args: &Args) -> Result<LuaValue, ScriptError> {
    let parts = list(args)?;
    let leaves = parts
        .iter()
        .fold(0usize, |sum, part| sum.saturating_add(part.leaf_count()));
    if leaves > MAX_LEAVES {
        return Err(args.error(
            format!("the group contains {leaves} shapes; at most {MAX_LEAVES} are allowed"),
            None,
        ));
    }
    args.object(GroupObject {
        parts: Rc::new(parts),
        leaves,
    })
}
