//! Parts: a shape or a group with a place and a material, and groups of them.

use std::rc::Rc;

use glam::{Affine3A, EulerRot, Quat, Vec3};
use mlua::{Lua, UserData, Value as LuaValue};

use super::shapes::ShapeObject;
use super::{numbers, object};
use crate::scene::desc::Transform;
use crate::scene::names::Names;
use crate::script::api::{ApiFn, Args, Param, kind};
use crate::script::error::ScriptError;
use crate::script::state::Shared;
use crate::script::strict::{self, Fields};
use crate::value::Value;
use crate::value::schema::{Field, SchemaError, Table, Ty};

/// The most leaves that groups of groups may have together.
const MAX_LEAVES: usize = 1 << 22;

const NUMBERS_3: Ty = Ty::Nums { len: 3, min: -1e9, max: 1e9 };

const AT: Field =
    Field { key: "at", ty: NUMBERS_3, required: false, default: "{ 0, 0, 0 }", doc: "where its origin stands" };
const ROTATE: Field = Field {
    key: "rotate",
    ty: Ty::Any("number|number[]"),
    required: false,
    default: "0",
    doc: "degrees about +y, or about x, y and z",
};
const SCALE: Field = Field {
    key: "scale",
    ty: Ty::Any("number|number[]"),
    required: false,
    default: "1",
    doc: "factor on its size, or one for each of x, y and z; negative mirrors",
};

/// A place alone.
pub const PLACE: Table = Table {
    name: "Place",
    doc: "A place: scaled first, then turned about z, y and x, then moved.",
    fields: &[AT, ROTATE, SCALE],
};

/// What `s:add` and groups take.
pub const PART: Table = Table {
    name: "Part",
    doc: "A shape or a group at a place. It is scaled first, then turned about z, y and x, then moved.",
    fields: &[
        Field { key: "shape", ty: Ty::Object("Shape|Group"), required: true, default: "", doc: "what it is" },
        Field {
            key: "name",
            ty: Ty::Str,
            required: false,
            default: "the material's, with a number",
            doc: "the name by which sweeps reach it: entities.NAME.position; of a group's part entities.GROUP/NAME.position",
        },
        Field {
            key: "material",
            ty: Ty::Str,
            required: false,
            default: "the group's",
            doc: "name of its material; a group's goes to its parts without one",
        },
        AT,
        ROTATE,
        SCALE,
        Field {
            key: "anisotropic_direction",
            ty: NUMBERS_3,
            required: false,
            default: "the material's",
            doc: "direction in world space along which highlights are stretched",
        },
    ],
};

/// The constructor of groups.
pub const GLOBALS: &[ApiFn] = &[ApiFn {
    name: "group",
    params: &[Param { name: "parts", ty: "Part[]", doc: "Shapes and groups, each with its place." }],
    returns: "Group",
    doc: "Makes one thing out of several, to be added as often as wanted; what is added often is kept once.",
    call: group,
}];

/// A shape or a group at a place.
#[derive(Clone, Debug)]
pub struct Part {
    name: Option<String>,
    material: Option<String>,
    place: Placement,
    anisotropic_direction: Option<Vec3>,
    what: What,
}

#[derive(Clone, Debug)]
enum What {
    Shape(ShapeObject),
    Group(GroupObject),
}

/// A place as parts say it.
#[derive(Clone, Copy, Debug)]
struct Placement {
    at: Vec3,
    rotate_rad: Vec3,
    scale: Vec3,
}

impl Placement {
    fn matrix(&self) -> Affine3A {
        let [x, y, z] = self.rotate_rad.to_array();
        Affine3A::from_scale_rotation_translation(self.scale, Quat::from_euler(EulerRot::XYZ, x, y, z), self.at)
    }
}

/// Parts that belong together, and how many leaves they have.
#[derive(Clone, Debug)]
pub struct GroupObject {
    parts: Rc<Vec<Part>>,
    leaves: usize,
}

impl UserData for GroupObject {}

/// One shape of a part, with everything that was said around it.
#[derive(Clone, Debug)]
pub struct Leaf {
    /// The names on the way to it.
    pub names: Vec<String>,
    /// What it is.
    pub shape: ShapeObject,
    /// From its own space to that of the scene.
    pub frame: Affine3A,
    /// Its place in a form that edits can change, which means the same as `frame`.
    pub transform: Transform,
    /// Its material, or that of the innermost group that says one.
    pub material: Option<String>,
    /// In world space.
    pub anisotropic_direction: Option<Vec3>,
}

impl Part {
    fn leaf_count(&self) -> usize {
        match &self.what {
            What::Shape(_) => 1,
            What::Group(group) => group.leaves,
        }
    }

    /// Every shape in it, in the order in which groups list them.
    pub fn leaves(&self) -> Vec<Leaf> {
        let mut leaves = Vec::with_capacity(self.leaf_count());
        self.collect(&mut leaves, &[], Affine3A::IDENTITY, None, None);
        leaves
    }

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
        match &self.what {
            What::Group(group) => {
                group.parts.iter().for_each(|part| part.collect(leaves, &names, frame, material, direction));
            }
            What::Shape(shape) => leaves.push(Leaf {
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
    /// A description's own order is scale after rotation, which is the same only if one of them is even.
    fn transform(&self, around: Affine3A) -> Transform {
        let even = self.scale.min_element() == self.scale.max_element();
        if even || self.rotate_rad == Vec3::ZERO {
            let (translate, rotate_rad, scale) = (self.at, self.rotate_rad, self.scale);
            Transform { translate, rotate_rad, scale, frame: around }
        } else {
            let turned = Placement { at: Vec3::ZERO, ..*self }.matrix();
            let moved = around * Affine3A::from_translation(self.at);
            Transform::framed(moved * turned)
        }
    }
}

/// A name for a leaf that nothing else has: what was said, or its material with a number.
pub fn name(names: &mut Names, leaf: &Leaf) -> String {
    match leaf.names.as_slice() {
        [] => names.numbered(leaf.material.as_deref().unwrap_or("part"), 1),
        said => names.give(&said.join("/")),
    }
}

/// Reads the list of parts that is a function's only argument.
pub fn list(shared: &Shared, args: &Args) -> Result<Vec<Part>, ScriptError> {
    args.at_most(shared, 1)?;
    let table = args.table(shared, 0, "parts")?;
    let items: Vec<LuaValue> =
        table.sequence_values::<LuaValue>().collect::<Result<_, _>>().map_err(|e| shared.convert(&e))?;
    if items.is_empty() {
        let help = "parts stand in a list: { { shape = .. }, { shape = .. } }".to_owned();
        return Err(args.error(shared, "expected a list of parts, found none", Some(help)));
    }
    let read_item = |(i, item): (usize, &LuaValue)| match item {
        LuaValue::Table(t) => read(shared, args, t, &format!("part[{}]", i + 1)),
        other => Err(args.error(shared, format!("part[{}]: expected a table, found {}", i + 1, kind(other)), None)),
    };
    items.iter().enumerate().map(read_item).collect()
}

/// Reads one part.
pub fn read(shared: &Shared, args: &Args, table: &mlua::Table, path: &str) -> Result<Part, ScriptError> {
    let fields = strict::fields(table, &PART, path, false).map_err(|e| args.blame(shared, e))?;
    let fail = |key: &str, problem: String| {
        let path = format!("{path}.{key}");
        Err(args.blame(shared, SchemaError { path, problem, help: None, key: key.to_owned() }))
    };
    let shape = fields.objects.get("shape").cloned().unwrap_or(LuaValue::Nil);
    let what = match (ShapeObject::of(&shape), &shape) {
        (Some(shape), _) => What::Shape(shape),
        (None, LuaValue::UserData(data)) if data.is::<GroupObject>() => {
            What::Group(data.borrow::<GroupObject>().map_err(|e| shared.convert(&e))?.clone())
        }
        _ => return fail("shape", format!("expected a shape or a group, found {}", kind(&shape))),
    };
    let text = |key: &str| fields.values.get(key).and_then(Value::as_str).map(str::to_owned);
    let place = placement(&fields, path).map_err(|e| args.blame(shared, e))?;
    let even = place.scale.abs().min_element() == place.scale.abs().max_element();
    if matches!(&what, What::Shape(ShapeObject::Sphere(_))) && !even {
        return fail("scale", "a true sphere takes only one number; shape.ball can be stretched".to_owned());
    }
    Ok(Part {
        name: text("name"),
        material: text("material"),
        place,
        anisotropic_direction: vector(&fields, "anisotropic_direction"),
        what,
    })
}

/// Reads a table that is only a place.
pub fn frame(shared: &Shared, args: &Args, table: &mlua::Table, path: &str) -> Result<Affine3A, ScriptError> {
    let read = || placement(&strict::fields(table, &PLACE, path, false)?, path);
    read().map(|place| place.matrix()).map_err(|e| args.blame(shared, e))
}

fn vector(fields: &Fields, key: &str) -> Option<Vec3> {
    fields.values.get(key).map(|v| Vec3::from(numbers::<3>(v)))
}

fn placement(fields: &Fields, path: &str) -> Result<Placement, SchemaError> {
    let wrong = |key: &str, problem: String| SchemaError {
        path: format!("{path}.{key}"),
        problem,
        help: None,
        key: key.to_owned(),
    };
    let three = |key: &str, one: fn(f32) -> Vec3, otherwise: Vec3| match fields.values.get(key) {
        None => Ok(otherwise),
        Some(value) => match (value.as_f64(), value) {
            (Some(x), _) if x.is_finite() => Ok(one(x as f32)),
            (None, list) if NUMBERS_3.check("", key, list).is_ok() => Ok(Vec3::from(numbers::<3>(list))),
            _ => Err(wrong(key, format!("expected a number or three, found {value}"))),
        },
    };
    let rotate_deg = three("rotate", |y| Vec3::new(0.0, y, 0.0), Vec3::ZERO)?;
    let scale = three("scale", Vec3::splat, Vec3::ONE)?;
    if scale.abs().min_element() < 1e-12 {
        return Err(wrong("scale", "it makes the part flat".to_owned()));
    }
    let at = vector(fields, "at").unwrap_or(Vec3::ZERO);
    Ok(Placement { at, rotate_rad: rotate_deg * std::f32::consts::PI / 180.0, scale })
}

fn group(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    let parts = list(shared, args)?;
    let leaves = parts.iter().fold(0usize, |sum, part| sum.saturating_add(part.leaf_count()));
    if leaves > MAX_LEAVES {
        return Err(args.error(shared, format!("it would hold {leaves} shapes: at most {MAX_LEAVES} do"), None));
    }
    object(shared, lua, GroupObject { parts: Rc::new(parts), leaves })
}
