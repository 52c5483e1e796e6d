//! Files of many small parts, of every format.

use super::samples::QUAD;

/// A kind of file: the name of its file, and the texts of its files for a number of parts. The
/// first is the one to read.
pub type Kind = (&'static str, fn(usize) -> Vec<(&'static str, String)>);

/// The corners (0, 0, 0), (1, 0, 0) and (0, 1, 0) as floats.
const CORNERS: &str =
    "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// Joins the text of `n` parts.
fn parts(n: usize, separator: &str, part: impl Fn(usize) -> String) -> String {
    (0..n).map(part).collect::<Vec<_>>().join(separator)
}

/// Returns a Mitsuba scene of `n` parts after a head.
fn xml(head: &str, n: usize, part: impl Fn(usize) -> String) -> Vec<(&'static str, String)> {
    let parts = parts(n, "\n", part);
    let text = format!("<scene version=\"3.0.0\">{head}{parts}</scene>");
    vec![("a.xml", text)]
}

/// Returns a scene of pbrt of `n` parts.
fn pbrt(n: usize, part: impl Fn(usize) -> String) -> Vec<(&'static str, String)> {
    let parts = parts(n, "\n", part);
    vec![("a.pbrt", format!("WorldBegin\n{parts}\n"))]
}

/// Returns a glTF of `n` nodes, each with the mesh that `mesh` states, and the meshes.
fn gltf(n: usize, mesh: fn(usize) -> usize) -> Vec<(&'static str, String)> {
    let nodes = parts(n, ",", |i| format!(r#"{{"mesh":{}}}"#, mesh(i)));
    let meshes = parts(mesh(n - 1) + 1, ",", |i| {
        format!(r#"{{"primitives":[{{"attributes":{{"POSITION":0}},"material":{i}}}]}}"#)
    });
    let materials = parts(mesh(n - 1) + 1, ",", |i| format!(r#"{{"name":"m{i}"}}"#));
    let roots = parts(n, ",", |i| i.to_string());
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[{roots}]}}],"nodes":[{nodes}],
"meshes":[{meshes}],"materials":[{materials}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
"bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"uri":"{CORNERS}","byteLength":36}}]}}"#
    );
    vec![("a.gltf", text)]
}

/// All kinds of files.
pub const KINDS: &[Kind] = &[
    ("obj, a material for each face", |n| {
        let library = parts(n, "\n", |i| format!("newmtl m{i}\nKd 0.1 0.2 0.3"));
        let faces = parts(n, "\n", |i| format!("usemtl m{i}\nf 1 2 3"));
        let text = format!("mtllib a.mtl\n{TRIANGLE}{faces}\n");
        vec![("a.obj", text), ("a.mtl", library)]
    }),
    ("obj, unknown materials", |n| {
        let faces = parts(n, "\n", |i| format!("usemtl m{i}\nf 1 2 3"));
        vec![("a.obj", format!("{TRIANGLE}{faces}\n"))]
    }),
    ("obj, equal faces", |n| {
        vec![(
            "a.obj",
            format!("{TRIANGLE}{}\n", parts(n, "\n", |_| "f 1 2 3".to_owned())),
        )]
    }),
    ("obj, one polygon", |n| {
        let corner = |i: usize| {
            let angle = i as f32 / n as f32 * std::f32::consts::TAU;
            format!("v {} {} 0", angle.cos(), angle.sin())
        };
        let indices = parts(n, " ", |i| (i + 1).to_string());
        vec![(
            "a.obj",
            format!("{}\nf {indices}\n", parts(n, "\n", corner)),
        )]
    }),
    ("ply, equal faces", |n| {
        let faces = parts(n, "\n", |_| "3 0 1 2".to_owned());
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty \
             float z\nelement face {n}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n\
             1 0 0\n0 1 0\n{faces}\n"
        );
        vec![("a.ply", text)]
    }),
    ("gltf, one mesh", |n| gltf(n, |_| 0)),
    ("gltf, a mesh for each node", |n| gltf(n, |i| i)),
    ("mitsuba, surfaces by reference", |n| {
        let surfaces = parts(n, "\n", |i| format!("<bsdf type=\"diffuse\" id=\"b{i}\"/>"));
        let shape = |i| format!("<shape type=\"sphere\"><ref id=\"b{i}\"/></shape>");
        xml(&surfaces, n, shape)
    }),
    ("mitsuba, lights", |n| {
        let light = "<emitter type=\"area\"/><bsdf type=\"diffuse\"/>";
        xml("", n, |_| format!("<shape type=\"sphere\">{light}</shape>"))
    }),
    ("mitsuba, notes", |n| {
        xml("", n, |i| {
            format!("<shape type=\"sphere\"><bsdf type=\"unknown{i}\"/></shape>")
        })
    }),
    ("mitsuba, instances", |n| {
        let group = "<shape type=\"shapegroup\" id=\"g\"><shape type=\"sphere\"/></shape>";
        xml(group, n, |_| {
            "<shape type=\"instance\"><ref id=\"g\"/></shape>".to_owned()
        })
    }),
    ("pbrt, a material for each shape", |n| {
        let part = |i| {
            format!(
                "MakeNamedMaterial \"m{i}\" \"string type\" \"diffuse\"\nNamedMaterial \"m{i}\"\n\
                 AreaLightSource \"diffuse\" \"float power\" 1\nShape \"sphere\""
            )
        };
        pbrt(n, part)
    }),
    ("pbrt, notes", |n| {
        pbrt(n, |i| {
            format!("Material \"x{i}\" \"float y{i}\" 1\nShape \"sphere\"")
        })
    }),
    ("pbrt, one directive with many parameters", |n| {
        let parameters = parts(n, " ", |i| format!("\"float y{i}\" 1"));
        let text = format!("WorldBegin\nShape \"sphere\" {parameters}");
        vec![("a.pbrt", text)]
    }),
    ("pbrt, blocks and instances", |n| {
        let head = "ObjectBegin \"o\"\nShape \"sphere\"\nObjectEnd\n";
        let part = |i| {
            let object = if i == 0 { head } else { "" };
            format!("{object}AttributeBegin\nObjectInstance \"o\"")
        };
        pbrt(n, part)
    }),
    ("pbrt, one mesh", |n| {
        let indices = parts(n, " ", |_| "0 1 2".to_owned());
        let text = format!(
            "WorldBegin\nShape \"trianglemesh\" \"integer indices\" [{indices}] \"point3 P\" [0 0 \
             0 1 0 0 0 1 0]"
        );
        vec![("a.pbrt", text)]
    }),
    ("folder, a material for each object", |n| {
        let materials = parts(n, ",", |i| format!("{{'name':'m{i}'}}"));
        let objects = parts(n, ",", |i| format!("{{'name':'floor','material':'m{i}'}}"));
        let text = format!("{{'materials':[{materials}],'objects':[{objects}]}}");
        vec![("scene.json", text), ("Objects/floor.obj", QUAD.to_owned())]
    }),
    ("scn, a material for each entity", |n| {
        let materials = parts(n, ",", |i| format!(r#"{{"name":"m{i}"}}"#));
        let entities = parts(n, ",", |i| {
            format!(r#"{{"type":"sphere","radius":1,"material":"m{i}"}}"#)
        });
        let camera = r#""camera":{"position":[0,1,4],"lookat":[0,0,0]}"#;
        let text = format!(r#"{{{camera},"materials":[{materials}],"entities":[{entities}]}}"#);
        vec![("a.scn", text)]
    }),
];
