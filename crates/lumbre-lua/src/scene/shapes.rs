//! Constructors of shapes, `shape.NAME`: one function for each shape of [`lumbre_light::scene::shape`],
//! and `shape.join`.

use glam::{Vec2, Vec3};
use mlua::Value as LuaValue;

use super::part;
use super::shape_object::ShapeObject;
use super::shape_schema::{
    BALL, BOX, CYLINDER, DISK, EXTRUDE, GRID, HEIGHTFIELD, LATHE, MESH, SPHERE, TORUS, TUBE,
};
use crate::api::{ApiFn, Args, Param};
use crate::error::ScriptError;
use crate::strict::{Fields, numbers};
use lumbre_light::scene::shape::{self, Shape, ShapeError};
use lumbre_light::value::Value;
use lumbre_light::value::schema::SchemaError;

macro_rules! rows {
    ($($name:literal, $table:ident, $make:expr, $doc:literal;)*) => {
        /// Constructors of shapes.
        pub const GLOBALS: &[ApiFn] = &[
            $(ApiFn {
                name: concat!("shape.", $name),
                params: &[Param { name: "options", ty: $table.name, doc: "Dimensions in scene units." }],
                returns: "Shape",
                doc: $doc,
                call: |args| {
                    let fields = args.fields(0, "options", &$table, concat!("shape.", $name))?;
                    let make: fn(&Args, &Fields) -> Result<ShapeObject, ScriptError> = $make;
                    args.object(make(args, &fields)?)
                },
            },)*
            ApiFn {
                name: "shape.join",
                params: &[Param { name: "parts", ty: "Part[]", doc: "List of shapes, each with its placement; their materials are ignored." }],
                returns: "Shape",
                doc: "Returns one mesh that combines several.",
                call: join,
            },
        ];
    };
}

rows! {
    "box", BOX, |args, f| mesh(args, make_box(f)), "Returns a box with sharp or rounded edges.";
    "sphere", SPHERE, make_sphere, "Returns an analytic sphere, which has no triangles.";
    "ball", BALL, |args, f| mesh(args, make_ball(f)), "Returns a sphere of triangles.";
    "grid", GRID, |args, f| mesh(args, make_grid(f)), "Returns a rectangle of quads that faces +y.";
    "disk", DISK, |args, f| mesh(args, make_disk(f)), "Returns a disk that faces +y.";
    "heightfield", HEIGHTFIELD, make_heightfield,
        "Returns a rectangle with heights, such as a landscape.";
    "lathe", LATHE, |args, f| mesh(args, make_lathe(f)),
        "Returns a surface of revolution, such as a vase or a column.";
    "cylinder", CYLINDER, |args, f| mesh(args, make_cylinder(f)),
        "Returns a closed cylinder or cone.";
    "tube", TUBE, |args, f| mesh(args, make_tube(f)), "Returns a tube along a line.";
    "torus", TORUS, |args, f| mesh(args, make_torus(f)), "Returns a torus.";
    "extrude", EXTRUDE, |args, f| mesh(args, make_extrude(f)), "Returns an extruded outline.";
    "mesh", MESH, make_mesh, "Returns a mesh of the given triangles.";
}

/// Returns the object of a mesh, or the error of the call.
fn mesh(args: &Args, shape: Result<Shape, ShapeError>) -> Result<ShapeObject, ScriptError> {
    shape
        .map(ShapeObject::new)
        .map_err(|e| args.error(e.to_string(), None))
}

fn number(fields: &Fields, key: &str, default: f32) -> f32 {
    fields.f32(key).unwrap_or(default)
}

fn count(fields: &Fields, key: &str, default: u32) -> u32 {
    fields
        .i64(key)
        .map_or(default, |n| n.clamp(0, i64::from(u32::MAX)) as u32)
}

fn vector<const N: usize>(fields: &Fields, key: &str, default: [f32; N]) -> [f32; N] {
    fields.numbers(key).unwrap_or(default)
}

fn points<const N: usize, V: From<[f32; N]>>(fields: &Fields, key: &str) -> Vec<V> {
    let items = fields.values.get(key).and_then(Value::as_list);
    let items = items.unwrap_or_default().iter();
    items.map(|item| V::from(numbers(item))).collect()
}

fn integers<const N: usize>(fields: &Fields, key: &str, default: [f32; N]) -> [u32; N] {
    vector(fields, key, default).map(|x| x as u32)
}

fn make_box(f: &Fields) -> Result<Shape, ShapeError> {
    let size = Vec3::from(vector(f, "size", [1.0; 3]));
    shape::cuboid(size, number(f, "bevel", 0.0), count(f, "segments", 3))
}

fn make_sphere(_: &Args, f: &Fields) -> Result<ShapeObject, ScriptError> {
    Ok(ShapeObject::Sphere(number(f, "radius", 1.0)))
}

fn make_ball(f: &Fields) -> Result<Shape, ShapeError> {
    shape::icosphere(number(f, "radius", 1.0), count(f, "splits", 4))
}

fn make_grid(f: &Fields) -> Result<Shape, ShapeError> {
    shape::grid(
        Vec2::from(vector(f, "size", [1.0; 2])),
        integers(f, "cells", [1.0; 2]),
    )
}

fn make_disk(f: &Fields) -> Result<Shape, ShapeError> {
    shape::disk(number(f, "radius", 1.0), count(f, "segments", 48))
}

fn make_heightfield(args: &Args, f: &Fields) -> Result<ShapeObject, ScriptError> {
    let size = vector(f, "size", [1.0; 2]);
    let cells: [u32; 2] = integers(f, "cells", [1.0; 2]);
    let Some(LuaValue::Function(height)) = f.objects.get("height") else {
        return Err(args.error("height: expected a function of x and z", None));
    };
    let place = |i: u32, along: usize| {
        (f64::from(i) / f64::from(cells[along]) - 0.5) * f64::from(size[along])
    };
    let mut heights = Vec::with_capacity((cells[0] as usize + 1) * (cells[1] as usize + 1));
    for z in 0..=cells[1] {
        for x in 0..=cells[0] {
            let value: f64 = height
                .call((place(x, 0), place(z, 1)))
                .map_err(|e| args.shared.convert(&e))?;
            heights.push(value as f32);
        }
    }
    mesh(args, shape::heightfield(Vec2::from(size), cells, &heights))
}

fn make_lathe(f: &Fields) -> Result<Shape, ShapeError> {
    let profile: Vec<Vec2> = points(f, "profile");
    shape::lathe(&profile, count(f, "segments", 48))
}

fn make_cylinder(f: &Fields) -> Result<Shape, ShapeError> {
    let (radius, height) = (number(f, "radius", 1.0), number(f, "height", 1.0));
    let top = number(f, "top", radius);
    let profile = [(0.0, 0.0), (radius, 0.0), (top, height), (0.0, height)].map(Vec2::from);
    shape::lathe(&profile, count(f, "segments", 48))
}

fn make_tube(f: &Fields) -> Result<Shape, ShapeError> {
    let line: Vec<Vec3> = points(f, "points");
    let radii = match f.values.get("radius") {
        Some(Value::List(each)) => each
            .iter()
            .filter_map(Value::as_f64)
            .map(|r| r as f32)
            .collect(),
        _ => vec![number(f, "radius", 1.0); line.len()],
    };
    let closed = f.is_true("closed");
    shape::tube(&line, &radii, count(f, "segments", 12), closed)
}

fn make_torus(f: &Fields) -> Result<Shape, ShapeError> {
    let segments = integers(f, "segments", [48.0, 16.0]);
    shape::torus(number(f, "major", 1.0), number(f, "minor", 0.25), segments)
}

fn make_extrude(f: &Fields) -> Result<Shape, ShapeError> {
    let outline: Vec<Vec2> = points(f, "outline");
    shape::extrude(&outline, number(f, "depth", 1.0))
}

fn make_mesh(args: &Args, f: &Fields) -> Result<ShapeObject, ScriptError> {
    let normals: Vec<Vec3> = points(f, "normals");
    let normals: Option<Vec<Vec3>> = normals.into_iter().map(Vec3::try_normalize).collect();
    let Some(normals) = normals else {
        let error = SchemaError::new(
            "shape.mesh.normals",
            "normals",
            "a normal is zero or not finite",
        );
        return Err(args.locate_error(error));
    };
    let shape = Shape {
        positions: points(f, "positions"),
        normals,
        uvs: points(f, "uvs"),
        second_uvs: points(f, "second_uvs"),
        colors: points(f, "colors"),
        triangles: points::<3, [f32; 3]>(f, "triangles")
            .into_iter()
            .map(|t| t.map(|c| c as u32 - 1))
            .collect(),
        ..Shape::default()
    };
    mesh(args, shape.checked())
}

fn join(args: &Args) -> Result<LuaValue, ScriptError> {
    let mut joined = Shape::default();
    for part in part::list(args)? {
        for leaf in part.leaves() {
            let ShapeObject::Mesh(mesh) = &leaf.shape else {
                let help = "use shape.ball, a sphere of triangles".to_owned();
                return Err(args.error("an analytic sphere cannot be joined to a mesh", Some(help)));
            };
            let copy = Shape {
                positions: mesh.positions.clone(),
                normals: mesh.normals.clone(),
                uvs: mesh.uvs.clone(),
                second_uvs: mesh.second_uvs.clone(),
                tangents: mesh.tangents.clone(),
                colors: mesh.colors.clone(),
                triangles: mesh.triangles.clone(),
            };
            let moved = copy
                .transformed(&leaf.frame)
                .and_then(|shape| joined.append(shape));
            moved.map_err(|e| args.error(e.to_string(), None))?;
        }
    }
    if joined.triangles.is_empty() {
        return Err(args.error("there are no shapes to join", None));
    }
    args.object(ShapeObject::new(joined))
}
