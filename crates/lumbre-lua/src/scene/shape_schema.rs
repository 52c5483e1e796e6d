//! Schemas of the shape constructors.

use lumbre_light::value::schema::{Field, Table, Ty};

const LENGTH: Ty = Ty::Num {
    min: 1e-9,
    max: 1e9,
};
const COUNT: Ty = Ty::Int {
    min: 1,
    max: 1 << 24,
};
const NUMBERS_2: Ty = Ty::Nums {
    len: 2,
    min: -1e9,
    max: 1e9,
};
const NUMBERS_3: Ty = Ty::Nums {
    len: 3,
    min: -1e9,
    max: 1e9,
};

/// Option tables of all shapes, for the annotations and the reference page.
pub const TABLES: &[&Table] = &[
    &BOX,
    &SPHERE,
    &BALL,
    &GRID,
    &DISK,
    &HEIGHTFIELD,
    &LATHE,
    &CYLINDER,
    &TUBE,
    &TORUS,
    &EXTRUDE,
    &MESH,
];

/// Options of `shape.box`.
pub const BOX: Table = Table {
    name: "BoxShape",
    doc: "Box centred at the origin.",
    fields: &[
        Field::required("size", NUMBERS_3, "edge lengths along x, y and z"),
        Field::optional(
            "bevel",
            Ty::Num { min: 0.0, max: 1e9 },
            "0",
            "radius of rounded edges; 0 is a sharp box",
        ),
        Field::optional(
            "segments",
            Ty::Int { min: 1, max: 256 },
            "3",
            "segments of each rounded edge",
        ),
    ],
};
/// Options of `shape.sphere`.
pub const SPHERE: Table = Table {
    name: "SphereShape",
    doc: "Analytic sphere centred at the origin.",
    fields: &[Field::required("radius", LENGTH, "radius")],
};
/// Options of `shape.ball`.
pub const BALL: Table = Table {
    name: "BallShape",
    doc: "Sphere of triangles centred at the origin, with smooth normals.",
    fields: &[
        Field::required("radius", LENGTH, "radius"),
        Field::optional(
            "splits",
            Ty::Int { min: 0, max: 9 },
            "4",
            "number of subdivisions of an icosahedron: 20 * 4^splits triangles",
        ),
    ],
};
/// Options of `shape.grid`.
pub const GRID: Table = Table {
    name: "GridShape",
    doc: "Rectangle in the plane y = 0 that is centred at the origin and faces +y.",
    fields: &[
        Field::required("size", NUMBERS_2, "lengths along x and z"),
        Field::optional(
            "cells",
            Ty::Nums {
                len: 2,
                min: 1.0,
                max: 65_536.0,
            },
            "{ 1, 1 }",
            "number of quads along x and z",
        ),
    ],
};
/// Options of `shape.disk`.
pub const DISK: Table = Table {
    name: "DiskShape",
    doc: "Disk in the plane y = 0 that is centred at the origin and faces +y.",
    fields: &[
        Field::required("radius", LENGTH, "radius"),
        Field::optional("segments", COUNT, "48", "number of corners"),
    ],
};
/// Options of `shape.heightfield`.
pub const HEIGHTFIELD: Table = Table {
    name: "HeightfieldShape",
    doc: "Rectangle centred at the origin with heights along +y and smooth normals.",
    fields: &[
        Field::required("size", NUMBERS_2, "lengths along x and z"),
        Field::required(
            "cells",
            Ty::Nums {
                len: 2,
                min: 1.0,
                max: 4096.0,
            },
            "number of quads along x and z",
        ),
        Field::required(
            "height",
            Ty::Object("fun(x: number, z: number): number"),
            "function that returns the height at a point",
        ),
    ],
};
/// Options of `shape.lathe`.
pub const LATHE: Table = Table {
    name: "LatheShape",
    doc: "Surface of revolution of a profile about the y axis, with smooth normals where the \
          profile bends by less than 40 degrees.",
    fields: &[
        Field::required(
            "profile",
            Ty::List(&NUMBERS_2),
            "list of points { radius, y }; if the profile goes up, its right side is the outside",
        ),
        Field::optional("segments", COUNT, "48", "number of corners of the circle"),
    ],
};
/// Options of `shape.cylinder`.
pub const CYLINDER: Table = Table {
    name: "CylinderShape",
    doc: "Closed cylinder or cone about the y axis, from y = 0 upwards.",
    fields: &[
        Field::required("radius", LENGTH, "radius of the lower end"),
        Field::required("height", LENGTH, "length along y"),
        Field::optional(
            "top",
            Ty::Num { min: 0.0, max: 1e9 },
            "the value of `radius`",
            "radius of the upper end; 0 is a cone",
        ),
        Field::optional("segments", COUNT, "48", "number of corners of the circle"),
    ],
};
/// Options of `shape.tube`.
pub const TUBE: Table = Table {
    name: "TubeShape",
    doc: "Round tube along a polyline, with smooth normals and flat ends.",
    fields: &[
        Field::required("points", Ty::List(&NUMBERS_3), "points of the polyline"),
        Field::required(
            "radius",
            Ty::OneOrMany(&LENGTH),
            "radius of the tube, or a list with one for each point",
        ),
        Field::optional("segments", COUNT, "12", "number of corners of the circle"),
        Field::optional(
            "closed",
            Ty::Bool,
            "false",
            "whether the last point is connected to the first",
        ),
    ],
};
/// Options of `shape.torus`.
pub const TORUS: Table = Table {
    name: "TorusShape",
    doc: "Torus about the y axis.",
    fields: &[
        Field::required(
            "major",
            LENGTH,
            "radius of the ring, from its centre to the centre of the tube",
        ),
        Field::required("minor", LENGTH, "radius of the tube"),
        Field::optional(
            "segments",
            Ty::Nums {
                len: 2,
                min: 3.0,
                max: 65_536.0,
            },
            "{ 48, 16 }",
            "number of corners around the ring and around the tube",
        ),
    ],
};
/// Options of `shape.extrude`.
pub const EXTRUDE: Table = Table {
    name: "ExtrudeShape",
    doc: "Solid that extends an outline in the xy plane along z, centred at z = 0.",
    fields: &[
        Field::required(
            "outline",
            Ty::List(&NUMBERS_2),
            "list of corners { x, y }; the outline is closed automatically and may be concave",
        ),
        Field::required("depth", LENGTH, "length along z"),
    ],
};
/// Options of `shape.mesh`.
pub const MESH: Table = Table {
    name: "MeshShape",
    doc: "Mesh of the given triangles.",
    fields: &[
        Field::required(
            "positions",
            Ty::List(&NUMBERS_3),
            "positions of the vertices",
        ),
        Field::required(
            "triangles",
            Ty::List(&Ty::Nums {
                len: 3,
                min: 1.0,
                max: 1e9,
            }),
            "three vertex indices from 1 for each triangle, counter-clockwise seen from the front",
        ),
        Field::optional(
            "normals",
            Ty::List(&NUMBERS_3),
            "flat shading",
            "normal of each vertex; normalised automatically",
        ),
        Field::optional(
            "uvs",
            Ty::List(&NUMBERS_2),
            "none",
            "texture coordinates of each vertex",
        ),
        Field::optional(
            "second_uvs",
            Ty::List(&NUMBERS_2),
            "none",
            "second set of texture coordinates; see `texture.lay`",
        ),
        Field::optional(
            "colors",
            Ty::List(&NUMBERS_3),
            "white",
            "linear colour of each vertex, from 0 to 1, which multiplies the base colour of the \
             material",
        ),
    ],
};
