//! `shape.*`: one row for each shape of [`crate::scene::shape`], and a table for its numbers.

use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use mlua::{Lua, UserData, Value as LuaValue};

use super::{numbers, object, part};
use crate::scene::desc::MeshDesc;
use crate::scene::shape::{self, Shape, ShapeError};
use crate::script::api::{ApiFn, Args, Param};
use crate::script::error::ScriptError;
use crate::script::state::Shared;
use crate::script::strict::{self, Fields};
use crate::value::Value;
use crate::value::schema::{Field, SchemaError, Table, Ty};

/// The material slot of shapes: what adds them always says a material.
const SLOT: &str = "shape";

const LENGTH: Ty = Ty::Num { min: 1e-9, max: 1e9 };
const COUNT: Ty = Ty::Int { min: 1, max: 1 << 24 };
const NUMBERS_2: Ty = Ty::Nums { len: 2, min: -1e9, max: 1e9 };
const NUMBERS_3: Ty = Ty::Nums { len: 3, min: -1e9, max: 1e9 };

/// Something that can be added to a scene: triangles, or a true sphere.
#[derive(Clone, Debug)]
pub enum ShapeObject {
    /// A mesh; every place that shows it shares it.
    Mesh(Arc<MeshDesc>),
    /// A sphere of this radius.
    Sphere(f32),
}

impl UserData for ShapeObject {}

impl ShapeObject {
    fn new(shape: Shape) -> ShapeObject {
        ShapeObject::Mesh(Arc::new(shape.into_mesh(PathBuf::new(), SLOT)))
    }

    /// The shape behind a Lua value.
    pub fn of(value: &LuaValue) -> Option<ShapeObject> {
        match value {
            LuaValue::UserData(data) => data.borrow::<ShapeObject>().ok().map(|s| s.clone()),
            _ => None,
        }
    }
}

/// The option tables, for the annotations.
pub const TABLES: &[&Table] =
    &[&BOX, &SPHERE, &BALL, &GRID, &DISK, &HEIGHTFIELD, &LATHE, &CYLINDER, &TUBE, &TORUS, &EXTRUDE, &MESH];

const BOX: Table = Table {
    name: "BoxShape",
    doc: "A box about the origin.",
    fields: &[
        Field::required("size", NUMBERS_3, "lengths along x, y and z"),
        Field::optional(
            "bevel",
            Ty::Num { min: 0.0, max: 1e9 },
            "0",
            "radius of its edges; above 0 they are round and smooth",
        ),
        Field::optional("segments", Ty::Int { min: 1, max: 256 }, "3", "steps of each round edge"),
    ],
};
const SPHERE: Table = Table {
    name: "SphereShape",
    doc: "A true sphere about the origin.",
    fields: &[Field::required("radius", LENGTH, "its radius")],
};
const BALL: Table = Table {
    name: "BallShape",
    doc: "A ball of triangles about the origin, smooth.",
    fields: &[
        Field::required("radius", LENGTH, "its radius"),
        Field::optional("splits", Ty::Int { min: 0, max: 9 }, "4", "how often the 20 triangles are split in four"),
    ],
};
const GRID: Table = Table {
    name: "GridShape",
    doc: "A rectangle about the origin that faces +y.",
    fields: &[
        Field::required("size", NUMBERS_2, "lengths along x and z"),
        Field::optional("cells", Ty::Nums { len: 2, min: 1.0, max: 65_536.0 }, "{ 1, 1 }", "quads along x and z"),
    ],
};
const DISK: Table = Table {
    name: "DiskShape",
    doc: "A disk about the origin that faces +y.",
    fields: &[Field::required("radius", LENGTH, "its radius"), Field::optional("segments", COUNT, "48", "corners")],
};
const HEIGHTFIELD: Table = Table {
    name: "HeightfieldShape",
    doc: "A rectangle about the origin that faces up, with heights, smooth.",
    fields: &[
        Field::required("size", NUMBERS_2, "lengths along x and z"),
        Field::required("cells", Ty::Nums { len: 2, min: 1.0, max: 4096.0 }, "quads along x and z"),
        Field::required("height", Ty::Object("fun(x: number, z: number): number"), "the height above each point"),
    ],
};
const LATHE: Table = Table {
    name: "LatheShape",
    doc: "What a profile makes when it is turned about the y axis; smooth where it bends by less than 40 degrees.",
    fields: &[
        Field::required("profile", Ty::List(&NUMBERS_2), "points { radius, y }; going up, the outside is on the right"),
        Field::optional("segments", COUNT, "48", "corners of the circle"),
    ],
};
const CYLINDER: Table = Table {
    name: "CylinderShape",
    doc: "A closed cylinder, or a cone, about the y axis, standing on y = 0.",
    fields: &[
        Field::required("radius", LENGTH, "its radius below"),
        Field::required("height", LENGTH, "its height"),
        Field::optional("top", Ty::Num { min: 0.0, max: 1e9 }, "the radius", "its radius above"),
        Field::optional("segments", COUNT, "48", "corners of the circle"),
    ],
};
const TUBE: Table = Table {
    name: "TubeShape",
    doc: "A round tube along a line of points, smooth, with flat ends.",
    fields: &[
        Field::required("points", Ty::List(&NUMBERS_3), "the line"),
        Field::required("radius", Ty::OneOrMany(&LENGTH), "its radius, or one for each point"),
        Field::optional("segments", COUNT, "12", "corners of the circle"),
        Field::optional("closed", Ty::Bool, "false", "whether the last point joins the first"),
    ],
};
const TORUS: Table = Table {
    name: "TorusShape",
    doc: "A ring about the y axis.",
    fields: &[
        Field::required("major", LENGTH, "radius of the ring"),
        Field::required("minor", LENGTH, "radius of its tube"),
        Field::optional(
            "segments",
            Ty::Nums { len: 2, min: 3.0, max: 65_536.0 },
            "{ 48, 16 }",
            "corners round the ring and the tube",
        ),
    ],
};
const EXTRUDE: Table = Table {
    name: "ExtrudeShape",
    doc: "A flat-sided solid with an outline in the plane of x and y, about z = 0.",
    fields: &[
        Field::required("outline", Ty::List(&NUMBERS_2), "corners { x, y }; it closes by itself and may be concave"),
        Field::required("depth", LENGTH, "its length along z"),
    ],
};
const MESH: Table = Table {
    name: "MeshShape",
    doc: "Triangles as they are given.",
    fields: &[
        Field::required("positions", Ty::List(&NUMBERS_3), "the vertices"),
        Field::required(
            "triangles",
            Ty::List(&Ty::Nums { len: 3, min: 1.0, max: 1e9 }),
            "corners from 1, counter-clockwise from the front",
        ),
        Field::optional("normals", Ty::List(&NUMBERS_3), "flat", "a direction for each vertex; made unit vectors"),
        Field::optional("uvs", Ty::List(&NUMBERS_2), "none", "texture coordinates of each vertex"),
        Field::optional("second_uvs", Ty::List(&NUMBERS_2), "none", "a second set of them: see `texture.lay`"),
        Field::optional(
            "colors",
            Ty::List(&NUMBERS_3),
            "white",
            "linear colours of each vertex, from 0 to 1, which multiply the base colour of its material",
        ),
    ],
};

macro_rules! rows {
    ($($name:literal, $table:ident, $make:ident, $doc:literal;)*) => {
        /// The constructors of shapes.
        pub const GLOBALS: &[ApiFn] = &[
            $(ApiFn {
                name: concat!("shape.", $name),
                params: &[Param { name: "options", ty: $table.name, doc: "Its numbers, in scene units." }],
                returns: "Shape",
                doc: $doc,
                call: |shared, lua, args| {
                    let fields = options(shared, args, &$table, concat!("shape.", $name))?;
                    let shape = $make(shared, args, &fields)?;
                    object(shared, lua, shape)
                },
            },)*
            ApiFn {
                name: "shape.join",
                params: &[Param { name: "parts", ty: "Part[]", doc: "Shapes, each with its place; materials do not count." }],
                returns: "Shape",
                doc: "Makes one mesh out of several.",
                call: join,
            },
        ];
    };
}

rows! {
    "box", BOX, make_box, "A box, with sharp or round edges.";
    "sphere", SPHERE, make_sphere, "A true sphere: no triangles, one formula.";
    "ball", BALL, make_ball, "A ball of triangles.";
    "grid", GRID, make_grid, "A rectangle of quads that faces +y.";
    "disk", DISK, make_disk, "A disk that faces +y.";
    "heightfield", HEIGHTFIELD, make_heightfield, "A landscape.";
    "lathe", LATHE, make_lathe, "A turned body: vases, columns, lamps.";
    "cylinder", CYLINDER, make_cylinder, "A cylinder or a cone.";
    "tube", TUBE, make_tube, "A tube along a line.";
    "torus", TORUS, make_torus, "A ring.";
    "extrude", EXTRUDE, make_extrude, "An outline raised to a solid.";
    "mesh", MESH, make_mesh, "Any triangles.";
}

/// The one table that every constructor takes.
fn options(shared: &Shared, args: &Args, table: &Table, path: &str) -> Result<Fields, ScriptError> {
    args.at_most(shared, 1)?;
    let given = args.table(shared, 0, "options")?;
    strict::fields(&given, table, path, false).map_err(|e| args.blame(shared, e))
}

type Made = Result<ShapeObject, ScriptError>;

fn made(shared: &Shared, args: &Args, shape: Result<Shape, ShapeError>) -> Made {
    shape.map(ShapeObject::new).map_err(|e| args.error(shared, e.to_string(), None))
}

fn number(fields: &Fields, key: &str, default: f32) -> f32 {
    fields.values.get(key).and_then(Value::as_f64).map_or(default, |x| x as f32)
}

fn count(fields: &Fields, key: &str, default: u32) -> u32 {
    fields.values.get(key).and_then(Value::as_i64).map_or(default, |n| n.clamp(0, i64::from(u32::MAX)) as u32)
}

fn vector<const N: usize>(fields: &Fields, key: &str, default: [f32; N]) -> [f32; N] {
    fields.values.get(key).map_or(default, numbers)
}

fn points<const N: usize>(fields: &Fields, key: &str) -> Vec<[f32; N]> {
    fields.values.get(key).and_then(Value::as_list).unwrap_or_default().iter().map(numbers).collect()
}

fn whole<const N: usize>(fields: &Fields, key: &str, default: [f32; N]) -> [u32; N] {
    vector(fields, key, default).map(|x| x as u32)
}

fn make_box(shared: &Shared, args: &Args, f: &Fields) -> Made {
    let size = Vec3::from(vector(f, "size", [1.0; 3]));
    made(shared, args, shape::cuboid(size, number(f, "bevel", 0.0), count(f, "segments", 3)))
}

fn make_sphere(_: &Shared, _: &Args, f: &Fields) -> Made {
    Ok(ShapeObject::Sphere(number(f, "radius", 1.0)))
}

fn make_ball(shared: &Shared, args: &Args, f: &Fields) -> Made {
    made(shared, args, shape::icosphere(number(f, "radius", 1.0), count(f, "splits", 4)))
}

fn make_grid(shared: &Shared, args: &Args, f: &Fields) -> Made {
    made(shared, args, shape::grid(Vec2::from(vector(f, "size", [1.0; 2])), whole(f, "cells", [1.0; 2])))
}

fn make_disk(shared: &Shared, args: &Args, f: &Fields) -> Made {
    made(shared, args, shape::disk(number(f, "radius", 1.0), count(f, "segments", 48)))
}

fn make_heightfield(shared: &Shared, args: &Args, f: &Fields) -> Made {
    let size = vector(f, "size", [1.0; 2]);
    let cells: [u32; 2] = whole(f, "cells", [1.0; 2]);
    let Some(LuaValue::Function(height)) = f.objects.get("height") else {
        return Err(args.error(shared, "height: expected a function of x and z", None));
    };
    let place = |i: u32, along: usize| (f64::from(i) / f64::from(cells[along]) - 0.5) * f64::from(size[along]);
    let mut heights = Vec::with_capacity((cells[0] as usize + 1) * (cells[1] as usize + 1));
    for z in 0..=cells[1] {
        for x in 0..=cells[0] {
            let value: f64 = height.call((place(x, 0), place(z, 1))).map_err(|e| shared.convert(&e))?;
            heights.push(value as f32);
        }
    }
    made(shared, args, shape::heightfield(Vec2::from(size), cells, &heights))
}

fn make_lathe(shared: &Shared, args: &Args, f: &Fields) -> Made {
    let profile: Vec<Vec2> = points(f, "profile").into_iter().map(Vec2::from_array).collect();
    made(shared, args, shape::lathe(&profile, count(f, "segments", 48)))
}

fn make_cylinder(shared: &Shared, args: &Args, f: &Fields) -> Made {
    let (radius, height) = (number(f, "radius", 1.0), number(f, "height", 1.0));
    let top = number(f, "top", radius);
    let profile = [(0.0, 0.0), (radius, 0.0), (top, height), (0.0, height)].map(Vec2::from);
    made(shared, args, shape::lathe(&profile, count(f, "segments", 48)))
}

fn make_tube(shared: &Shared, args: &Args, f: &Fields) -> Made {
    let line: Vec<Vec3> = points(f, "points").into_iter().map(Vec3::from_array).collect();
    let radii = match f.values.get("radius") {
        Some(Value::List(each)) => each.iter().filter_map(Value::as_f64).map(|r| r as f32).collect(),
        _ => vec![number(f, "radius", 1.0); line.len()],
    };
    let closed = f.values.get("closed") == Some(&Value::Bool(true));
    made(shared, args, shape::tube(&line, &radii, count(f, "segments", 12), closed))
}

fn make_torus(shared: &Shared, args: &Args, f: &Fields) -> Made {
    let segments = whole(f, "segments", [48.0, 16.0]);
    made(shared, args, shape::torus(number(f, "major", 1.0), number(f, "minor", 0.25), segments))
}

fn make_extrude(shared: &Shared, args: &Args, f: &Fields) -> Made {
    let outline: Vec<Vec2> = points(f, "outline").into_iter().map(Vec2::from_array).collect();
    made(shared, args, shape::extrude(&outline, number(f, "depth", 1.0)))
}

fn make_mesh(shared: &Shared, args: &Args, f: &Fields) -> Made {
    let unit = |n: [f32; 3]| Vec3::from_array(n).try_normalize();
    let normals: Option<Vec<Vec3>> = points(f, "normals").into_iter().map(unit).collect();
    let Some(normals) = normals else {
        let error = SchemaError {
            path: "shape.mesh.normals".to_owned(),
            problem: "a normal has no direction".to_owned(),
            help: None,
            key: "normals".to_owned(),
        };
        return Err(args.blame(shared, error));
    };
    let shape = Shape {
        positions: points(f, "positions").into_iter().map(Vec3::from_array).collect(),
        normals,
        uvs: points(f, "uvs").into_iter().map(Vec2::from_array).collect(),
        second_uvs: points(f, "second_uvs").into_iter().map(Vec2::from_array).collect(),
        colors: points(f, "colors").into_iter().map(Vec3::from_array).collect(),
        triangles: points::<3>(f, "triangles").into_iter().map(|t| t.map(|c| c as u32 - 1)).collect(),
    };
    made(shared, args, shape.checked())
}

fn join(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    let mut whole = Shape::default();
    for part in part::list(shared, args)? {
        for leaf in part.leaves() {
            let ShapeObject::Mesh(mesh) = &leaf.shape else {
                let help = "shape.ball makes one of triangles".to_owned();
                return Err(args.error(shared, "a true sphere cannot be joined to a mesh", Some(help)));
            };
            let copy = Shape {
                positions: mesh.positions.clone(),
                normals: mesh.normals.clone(),
                uvs: mesh.uvs.clone(),
                second_uvs: mesh.second_uvs.clone(),
                colors: mesh.colors.clone(),
                triangles: mesh.triangles.clone(),
            };
            let moved = copy.transformed(&leaf.frame).and_then(|shape| whole.append(shape));
            moved.map_err(|e| args.error(shared, e.to_string(), None))?;
        }
    }
    if whole.triangles.is_empty() {
        return Err(args.error(shared, "there is nothing to join", None));
    }
    object(shared, lua, ShapeObject::new(whole))
}
