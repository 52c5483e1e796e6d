//! Schemas of the shape constructors.

use lumbre_light::value::schema::{Table, Ty};

const LENGTH: Ty = Ty::num(1e-9, 1e9);
const COUNT: Ty = Ty::int(1, 1 << 24);
const NUMBERS_2: Ty = Ty::nums(2, -1e9, 1e9);
const NUMBERS_3: Ty = Ty::nums(3, -1e9, 1e9);

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

lumbre_light::table! {
    /// Options of `shape.box`.
    pub const BOX = "BoxShape", "Box centred at the origin.";
    size: NUMBERS_3, "edge lengths along x, y and z";
    bevel = "0": Ty::num(0.0, 1e9), "radius of rounded edges; 0 is a sharp box";
    segments = "3": Ty::int(1, 256), "segments of each rounded edge";
}
lumbre_light::table! {
    /// Options of `shape.sphere`.
    pub const SPHERE = "SphereShape", "Analytic sphere centred at the origin.";
    radius: LENGTH, "radius";
}
lumbre_light::table! {
    /// Options of `shape.ball`.
    pub const BALL = "BallShape", "Sphere of triangles centred at the origin, with smooth normals.";
    radius: LENGTH, "radius";
    splits = "4": Ty::int(0, 9),
        "number of subdivisions of an icosahedron: 20 * 4^splits triangles";
}
lumbre_light::table! {
    /// Options of `shape.grid`.
    pub const GRID = "GridShape",
        "Rectangle in the plane y = 0 that is centred at the origin and faces +y.";
    size: NUMBERS_2, "lengths along x and z";
    cells = "{ 1, 1 }": Ty::nums(2, 1.0, 65_536.0), "number of quads along x and z";
}
lumbre_light::table! {
    /// Options of `shape.disk`.
    pub const DISK = "DiskShape",
        "Disk in the plane y = 0 that is centred at the origin and faces +y.";
    radius: LENGTH, "radius";
    segments = "48": COUNT, "number of corners";
}
lumbre_light::table! {
    /// Options of `shape.heightfield`.
    pub const HEIGHTFIELD = "HeightfieldShape",
        "Rectangle centred at the origin with heights along +y and smooth normals.";
    size: NUMBERS_2, "lengths along x and z";
    cells: Ty::nums(2, 1.0, 4096.0), "number of quads along x and z";
    height: Ty::Object("fun(x: number, z: number): number"),
        "function that returns the height at a point";
}
lumbre_light::table! {
    /// Options of `shape.lathe`.
    pub const LATHE = "LatheShape",
        "Surface of revolution of a profile about the y axis, with smooth normals where the \
         profile bends by less than 40 degrees.";
    profile: Ty::List(&NUMBERS_2),
        "list of points { radius, y }; if the profile goes up, its right side is the outside";
    segments = "48": COUNT, "number of corners of the circle";
}
lumbre_light::table! {
    /// Options of `shape.cylinder`.
    pub const CYLINDER = "CylinderShape",
        "Closed cylinder or cone about the y axis, from y = 0 upwards.";
    radius: LENGTH, "radius of the lower end";
    height: LENGTH, "length along y";
    top = "the value of `radius`": Ty::num(0.0, 1e9), "radius of the upper end; 0 is a cone";
    segments = "48": COUNT, "number of corners of the circle";
}
lumbre_light::table! {
    /// Options of `shape.tube`.
    pub const TUBE = "TubeShape", "Round tube along a polyline, with smooth normals and flat ends.";
    points: Ty::List(&NUMBERS_3), "points of the polyline";
    radius: Ty::OneOrMany(&LENGTH), "radius of the tube, or a list with one for each point";
    segments = "12": COUNT, "number of corners of the circle";
    closed = "false": Ty::Bool, "whether the last point is connected to the first";
}
lumbre_light::table! {
    /// Options of `shape.torus`.
    pub const TORUS = "TorusShape", "Torus about the y axis.";
    major: LENGTH, "radius of the ring, from its centre to the centre of the tube";
    minor: LENGTH, "radius of the tube";
    segments = "{ 48, 16 }": Ty::nums(2, 3.0, 65_536.0),
        "number of corners around the ring and around the tube";
}
lumbre_light::table! {
    /// Options of `shape.extrude`.
    pub const EXTRUDE = "ExtrudeShape",
        "Solid that extends an outline in the xy plane along z, centred at z = 0.";
    outline: Ty::List(&NUMBERS_2),
        "list of corners { x, y }; the outline is closed automatically and may be concave";
    depth: LENGTH, "length along z";
}
lumbre_light::table! {
    /// Options of `shape.mesh`.
    pub const MESH = "MeshShape", "Mesh of the given triangles.";
    positions: Ty::List(&NUMBERS_3), "positions of the vertices";
    triangles: Ty::List(&Ty::nums(3, 1.0, 1e9)),
        "three vertex indices from 1 for each triangle, counter-clockwise seen from the front";
    normals = "flat shading": Ty::List(&NUMBERS_3),
        "normal of each vertex; normalised automatically";
    uvs = "none": Ty::List(&NUMBERS_2), "texture coordinates of each vertex";
    second_uvs = "none": Ty::List(&NUMBERS_2),
        "second set of texture coordinates; see `texture.lay`";
    colors = "white": Ty::List(&NUMBERS_3),
        "linear colour of each vertex, from 0 to 1, which multiplies the base colour of the \
         material";
}
