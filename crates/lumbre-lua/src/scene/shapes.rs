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
    ($($name:literal, $table:ident, $make:ident, $doc:literal;)*) => {
        /// Constructors of shapes.
        pub const GLOBALS: &[ApiFn] = &[
            $(ApiFn {
                name: concat!("shape.", $name),
                params: &[Param { name: "options", ty: $table.name, doc: "Dimensions in scene units." }],
                returns: "Shape",
                doc: $doc,
                call: |args| {
                    let fields = args.fields(0, "options", &$table, concat!("shape.", $name))?;
                    let shape = $make(args, &fields)?;
                    args.object(shape)
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
    "box", BOX, make_box, "Returns a box with sharp or rounded edges.";
    "sphere", SPHERE, make_sphere, "Returns an analytic sphere, which has no triangles.";
    "ball", BALL, make_ball, "Returns a sphere of triangles.";
    "grid", GRID, make_grid, "Returns a rectangle of quads that faces +y.";
    "disk", DISK, make_disk, "Returns a disk that faces +y.";
    "heightfield", HEIGHTFIELD, make_heightfield, "Returns a rectangle with heights, such as a landscape.";
    "lathe", LATHE, make_lathe, "Returns a surface of revolution, such as a vase or a column.";
    "cylinder", CYLINDER, make_cylinder, "Returns a closed cylinder or cone.";
    "tube", TUBE, make_tube, "Returns a tube along a line.";
    "torus", TORUS, make_torus, "Returns a torus.";
    "extrude", EXTRUDE, make_extrude, "Returns an extruded outline.";
    "mesh", MESH, make_mesh, "Returns a mesh of the given triangles.";
}

/// Result of a constructor.
type ShapeResult = Result<ShapeObject, ScriptError>;

/// Converts the result of a shape function to a Lua object or an error of the call.
fn shape_result(args: &Args, shape: Result<Shape, ShapeError>) -> ShapeResult {
    shape
        .map(ShapeObject::new)
        .map_err(|e| args.error(e.to_string(), None))
}

fn number(fields: &Fields, key: &str, default: f32) -> f32 {
    fields.f64(key).map_or(default, |x| x as f32)
}

fn count(fields: &Fields, key: &str, default: u32) -> u32 {
    fields
        .i64(key)
        .map_or(default, |n| n.clamp(0, i64::from(u32::MAX)) as u32)
}

fn vector<const N: usize>(fields: &Fields, key: &str, default: [f32; N]) -> [f32; N] {
    fields.numbers(key).unwrap_or(default)
}

fn points<const N: usize>(fields: &Fields, key: &str) -> Vec<[f32; N]> {
    fields
        .values
        .get(key)
        .and_then(Value::as_list)
        .unwrap_or_default()
        .iter()
        .map(numbers)
        .collect()
}

fn integers<const N: usize>(fields: &Fields, key: &str, default: [f32; N]) -> [u32; N] {
    vector(fields, key, default).map(|x| x as u32)
}

fn make_box(args: &Args, f: &Fields) -> ShapeResult {
    let size = Vec3::from(vector(f, "size", [1.0; 3]));
    shape_result(
        args,
        shape::cuboid(size, number(f, "bevel", 0.0), count(f, "segments", 3)),
    )
}

fn make_sphere(_: &Args, f: &Fields) -> ShapeResult {
    Ok(ShapeObject::Sphere(number(f, "radius", 1.0)))
}

fn make_ball(args: &Args, f: &Fields) -> ShapeResult {
    shape_result(
        args,
        shape::icosphere(number(f, "radius", 1.0), count(f, "splits", 4)),
    )
}

fn make_grid(args: &Args, f: &Fields) -> ShapeResult {
    shape_result(
        args,
        shape::grid(
            Vec2::from(vector(f, "size", [1.0; 2])),
            integers(f, "cells", [1.0; 2]),
        ),
    )
}

fn make_disk(args: &Args, f: &Fields) -> ShapeResult {
    shape_result(
        args,
        shape::disk(number(f, "radius", 1.0), count(f, "segments", 48)),
    )
}

fn make_heightfield(args: &Args, f: &Fields) -> ShapeResult {
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
    shape_result(args, shape::heightfield(Vec2::from(size), cells, &heights))
}

fn make_lathe(args: &Args, f: &Fields) -> ShapeResult {
    let profile: Vec<Vec2> = points(f, "profile")
        .into_iter()
        .map(Vec2::from_array)
        .collect();
    shape_result(args, shape::lathe(&profile, count(f, "segments", 48)))
}

fn make_cylinder(args: &Args, f: &Fields) -> ShapeResult {
    let (radius, height) = (number(f, "radius", 1.0), number(f, "height", 1.0));
    let top = number(f, "top", radius);
    let profile = [(0.0, 0.0), (radius, 0.0), (top, height), (0.0, height)].map(Vec2::from);
    shape_result(args, shape::lathe(&profile, count(f, "segments", 48)))
}

fn make_tube(args: &Args, f: &Fields) -> ShapeResult {
    let line: Vec<Vec3> = points(f, "points")
        .into_iter()
        .map(Vec3::from_array)
        .collect();
    let radii = match f.values.get("radius") {
        Some(Value::List(each)) => each
            .iter()
            .filter_map(Value::as_f64)
            .map(|r| r as f32)
            .collect(),
        _ => vec![number(f, "radius", 1.0); line.len()],
    };
    let closed = f.is_true("closed");
    shape_result(
        args,
        shape::tube(&line, &radii, count(f, "segments", 12), closed),
    )
}

fn make_torus(args: &Args, f: &Fields) -> ShapeResult {
    let segments = integers(f, "segments", [48.0, 16.0]);
    shape_result(
        args,
        shape::torus(number(f, "major", 1.0), number(f, "minor", 0.25), segments),
    )
}

fn make_extrude(args: &Args, f: &Fields) -> ShapeResult {
    let outline: Vec<Vec2> = points(f, "outline")
        .into_iter()
        .map(Vec2::from_array)
        .collect();
    shape_result(args, shape::extrude(&outline, number(f, "depth", 1.0)))
}

fn make_mesh(args: &Args, f: &Fields) -> ShapeResult {
    let unit = |n: [f32; 3]| Vec3::from_array(n).try_normalize();
    let normals: Option<Vec<Vec3>> = points(f, "normals").into_iter().map(unit).collect();
    let Some(normals) = normals else {
        let error = SchemaError::new(
            "shape.mesh.normals",
            "normals",
            "a normal is zero or not finite",
        );
        return Err(args.locate_error(error));
    };
    let shape = Shape {
        positions: points(f, "positions")
            .into_iter()
            .map(Vec3::from_array)
            .collect(),
        normals,
        uvs: points(f, "uvs").into_iter().map(Vec2::from_array).collect(),
        second_uvs: points(f, "second_uvs")
            .into_iter()
            .map(Vec2::from_array)
            .collect(),
        colors: points(f, "colors")
            .into_iter()
            .map(Vec3::from_array)
            .collect(),
        triangles: points::<3>(f, "triangles")
            .into_iter()
            .map(|t| t.map(|c| c as u32 - 1))
            .collect(),
        ..Shape::default()
    };
    shape_result(args, shape.checked())
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
