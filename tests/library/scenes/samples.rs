//! One valid file of every scene format, with all files that it names. Damaged and hostile files
//! are made from them: by the tests here, and as the first inputs of the targets in `fuzz/`.

use std::io::{Cursor, Write};

use flate2::Compression;
use flate2::write::ZlibEncoder;

/// A readable file, and the files that it names.
pub struct Sample {
    /// Name of the format, and of the variant of it.
    pub name: &'static str,
    /// Names and bytes; the first file is the one to read.
    pub files: Vec<(&'static str, Vec<u8>)>,
}

/// A mesh of two triangles with normals.
pub const QUAD: &str = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nvn 0 1 0\nf 1//1 2//1 3//1 4//1\n";

/// A `.scn` with every part of the format.
pub const SCN: &str = r#"{ "resolution": [16, 8], "maxdepth": 4,
  "camera": { "position": [0, 1, 4], "lookat": [0, 0.5, 0], "fov": 40.5, "antialiasing_radius": 0.2 },
  "materials": [ { "name": "a", "color": [0.5, 0.25, 1e-1], "albedotexture": "t.png", "tiling": 2 },
                 { "name": "light", "emission": [1, 2, 3], "metallic": 0.5 } ],
  "entities": [ { "type": "mesh", "file": "m.obj", "position": [0, -1, 0], "rotation": [0, 0.5, 0], "scale": [1, 2, 1] },
                { "type": "sphere", "radius": 0.5, "material": "light", "inverted_normal": 1 } ] }"#;

/// The mesh that [`SCN`] names.
pub fn scn_mesh() -> String {
    format!(
        "# mesh\nmtllib x.mtl\no one\n{QUAD}vt 0 0\nvt 1 1\nusemtl a\nf 1/1/1 2/2/1 -2/1/1\nf 1 2 3\n"
    )
}

/// A `.scn` with light, time and composed materials, which [`SCN`] leaves out.
const SCN_MORE: &str = r#"{ "camera": { "position": [0, 1, 4], "f_number": 2.8, "focal_length": 0.05, "focus_distance": 3 },
  "materials": [ { "name": "now" }, { "name": "later", "delay": "epanechnikov", "delay_mean": 0.5, "delay_width": 0.25 },
                 { "name": "both", "parts": ["now", "later"], "weights": [0.25, 0.75], "masktexture": "t.png" } ],
  "entities": [ { "type": "mesh", "file": "m.obj", "material": "both" } ],
  "lights": [ { "type": "point", "position": [0, 2, 0], "intensity": [1, 1, 1] } ], "environment": { "color": [0.1, 0.1, 0.2] } }"#;

const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0 \nv 1 1 0\nv 0 1 0 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nvn 0 0 0\n\
                   usemtl one\nf 1/1/1 2/2/1 3/3/2 4/1/1\no next\ng group\ns 1\nusemtl two\nf 1 2 -1\nf 1//1 2//1 \\\n 3//1\nl 1 2\n";

const MTL: &str = "# ours\nnewmtl one\nKd 0.5 0.25 0.1\nKs 0.1 0.1 0.1\nNs 20\nmap_Kd -s 2 2 1 -o 0.5 0 0 t.png\nmap_d t.png\nillum 2\n\
                   newmtl two\nKe 1 2 3\nNi 1.5\nd 0.5\nPr 0.3\nPm 1\nPs 0.1\nPc 0.5\nPcr 0.2\naniso 0.5\nbump t.png\n";

/// Interleaved positions and normals, quantised texture coordinates, a sparse part: see
/// [`gltf_buffer`].
pub const GLTF: &str = r#"{ "asset": { "version": "2.0" }, "scene": 0, "scenes": [ { "nodes": [0, 3, 4] } ],
"nodes": [ { "name": "arm", "translation": [1, 0, 0], "children": [1, 2] },
  { "mesh": 0, "scale": [2, 2, 2] }, { "mesh": 0, "rotation": [0, 1, 0, 0] },
  { "camera": 0, "translation": [0, 0, 5] },
  { "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,7,0,1], "extensions": { "KHR_lights_punctual": { "light": 0 } } } ],
"cameras": [ { "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } } ],
"extensions": { "KHR_lights_punctual": { "lights": [ { "type": "point", "color": [1, 0.5, 0], "intensity": 4 } ] } },
"meshes": [ { "name": "leaf", "primitives": [ { "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 }, "indices": 3, "material": 0 } ] } ],
"materials": [ { "name": "skin", "alphaMode": "MASK", "alphaCutoff": 0.25, "emissiveFactor": [1, 0, 0],
  "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 0.5], "roughnessFactor": 0.5,
    "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 0 } },
  "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 3 }, "KHR_materials_ior": { "ior": 1.8 },
    "KHR_materials_transmission": { "transmissionFactor": 0.75 }, "KHR_materials_iridescence": {} } } ],
"textures": [ { "source": 0 } ], "images": [ { "uri": "a%20t.png" } ],
"accessors": [ { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
    "sparse": { "count": 1, "indices": { "bufferView": 2, "byteOffset": 6, "componentType": 5123 }, "values": { "bufferView": 3 } } },
  { "bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 3, "type": "VEC3" },
  { "bufferView": 1, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC2" },
  { "bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR" } ],
"bufferViews": [ { "buffer": 0, "byteOffset": 0, "byteLength": 72, "byteStride": 24 }, { "buffer": 0, "byteOffset": 72, "byteLength": 12, "byteStride": 4 },
  { "buffer": 0, "byteOffset": 84, "byteLength": 8 }, { "buffer": 0, "byteOffset": 92, "byteLength": 12 } ],
"buffers": [ { "uri": "b.bin", "byteLength": 104 } ] }"#;

/// Returns float positions and normals of a triangle, bytes as texture coordinates, and a change of
/// the last position from (0, 1, 0) to (0, 2, 0).
pub fn gltf_buffer() -> Vec<u8> {
    let mut bytes = Vec::new();
    for p in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        p.iter()
            .chain(&[0.0, 0.0, 1.0])
            .for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    // At 72: unsigned bytes, two and two of padding for each vertex.
    bytes.extend([0, 0, 9, 9, 255, 0, 9, 9, 0, 51, 9, 9]);
    // At 84: indices, and the sparse part.
    [0u16, 1, 2, 2]
        .iter()
        .for_each(|i| bytes.extend(i.to_le_bytes()));
    [0.0f32, 2.0, 0.0]
        .iter()
        .for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes
}

/// Returns a `.glb` of a JSON text and a binary chunk.
pub fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut text = json.as_bytes().to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    let total = 12 + 8 + text.len() + 8 + binary.len();
    [2, total as u32, text.len() as u32, 0x4E4F_534A]
        .iter()
        .for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes.extend(&text);
    [binary.len() as u32, 0x004E_4942]
        .iter()
        .for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes.extend(binary);
    bytes
}

/// Returns [`GLTF`] as a `.glb`.
pub fn gltf_as_glb() -> Vec<u8> {
    glb(&GLTF.replace("\"uri\": \"b.bin\", ", ""), &gltf_buffer())
}

/// Many of the plugins of Mitsuba's XML.
pub const MITSUBA: &str = r##"<scene version="3.0.0"><default name="spp" value="4"/>
<integrator type="path"><integer name="max_depth" value="5"/></integrator>
<sensor type="thinlens"><float name="fov" value="40"/><float name="aperture_radius" value="0.1"/>
<transform name="to_world"><lookat origin="0, 1, 5" target="0, 1, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="32"/></film></sensor>
<texture type="checkerboard" id="t"><rgb name="color0" value="#ff0010"/><transform name="to_uv"><scale x="2" y="3"/></transform></texture>
<bsdf type="twosided" id="a"><bsdf type="roughplastic"><ref name="diffuse_reflectance" id="t"/><float name="alpha" value="0.3"/></bsdf></bsdf>
<bsdf type="mask" id="b"><float name="opacity" value="0.5"/><bsdf type="roughconductor"><string name="material" value="Au"/></bsdf></bsdf>
<shape type="obj"><string name="filename" value="m.obj"/><ref id="a"/></shape>
<shape type="sphere"><point name="center" x="1" y="2" z="3"/><ref id="b"/><emitter type="area"><rgb name="radiance" value="1 2 3"/></emitter></shape>
<shape type="shapegroup" id="g"><shape type="cube"/></shape><shape type="instance"><ref id="g"/></shape>
<emitter type="constant"><spectrum name="radiance" value="400:1, 700:2"/></emitter></scene>"##;

/// The other plugins of Mitsuba's XML.
const MITSUBA_MORE: &str = r#"<scene version="0.6.0"><include filename="i.xml"/>
<bsdf type="Composed" id="c"><bsdf type="Separable"><bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="t.png"/><boolean name="raw" value="true"/></texture></bsdf>
<TemporalProfile type="PosEpanTP"><float name="mean" value="0.5"/><float name="sigma" value="0.2"/></TemporalProfile></bsdf><bsdf type="difftrans"><rgb name="transmittance" value="0.2"/></bsdf><float name="weight" value="0.5"/></bsdf>
<bsdf type="principled" id="p"><rgb name="base_color" value="0.1 0.2 0.3"/><float name="roughness" value="0.4"/><float name="spec_trans" value="0.5"/></bsdf>
<bsdf type="normalmap" id="n"><texture name="normalmap" type="bitmap"><string name="filename" value="t.png"/></texture><bsdf type="plastic"/></bsdf>
<shape type="ply"><string name="filename" value="m.ply"/><ref id="n"/><transform name="toWorld"><rotate y="1" angle="$turn"/><matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></transform></shape>
<shape type="rectangle"><ref id="p"/><boolean name="flipNormals" value="true"/></shape><shape type="disk"><bsdf type="thindielectric"/></shape>
<shape type="cylinder"><point name="p1" value="0 0 2"/><float name="radius" value="0.5"/><bsdf type="roughdielectric"><float name="intIOR" value="1.33"/></bsdf></shape>
<emitter type="point"><point name="position" value="0 3 0"/><rgb name="intensity" value="5 5 5"/></emitter>
<emitter type="spot"><transform name="toWorld"><translate x="1"/></transform><float name="cutoffAngle" value="30"/></emitter>
<emitter type="directional"><vector name="direction" value="0 -1 0"/></emitter></scene>"#;

const INCLUDED: &str = r#"<scene version="3.0.0"><default name="turn" value="30"/><bsdf type="diffuse" id="d"/><alias id="d" as="e"/></scene>"#;

/// The template of a scene folder in thesis S1, with its quotes.
pub const FOLDER: &str = "{
  'camera' : {'xRes' : 1280, 'yRes' : 720, 'position' : {x : 0, y : 1, z : -2},
              'focalLength' : 0.05, 'focusDistance' : 1, 'aperture' : 2.8},
  'materials' : [{name' : 'mat1'}, {'name' : 'mat2', 'albedo' : {'r' : 1, 'g' : 0, 'b' : 0}, 'roughness' : 0.2}],
  'objects' : [{name' : 'floor', 'material' : 'mat1'}, {'name' : 'floor',
               'material' : 'mat2'}],
  'pointLights' : [{position' : {'x' : 1, 'y': 2, 'z': 3}, 'radiance' {'r' : 1, 'g' : 0, 'b' : 0}}]
}";

/// Many of the directives of pbrt, version 4.
pub const PBRT: &str = r#"# a scene
Integrator "volpath" "integer maxdepth" [ 5 ]
Film "rgb" "integer xresolution" 64 "integer yresolution" 32 "float iso" 150
Scale -1 1 1
LookAt 0 1 5  0 1 0  0 1 0
Camera "perspective" "float fov" 40 "float lensradius" 0.1 "float focaldistance" 4
WorldBegin
LightSource "infinite" "rgb L" [ 0.1 0.2 0.3 ] "float scale" 2
AttributeBegin
  Rotate -90 1 0 0
  LightSource "spot" "blackbody I" 3000 "point3 from" [ 0 0 4 ] "float coneangle" 40
AttributeEnd
Texture "t" "spectrum" "imagemap" "string filename" "t.png" "float uscale" 2 "string encoding" "linear"
Texture "c" "spectrum" "checkerboard" "rgb tex1" [ 1 0 0 ] "float uscale" 4
Texture "half" "float" "imagemap" "string filename" "t.png" "bool invert" true
MakeNamedMaterial "a" "string type" "coateddiffuse" "texture reflectance" "t" "float roughness" 0.3
MakeNamedMaterial "b" "string type" "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k"
MakeNamedMaterial "m" "string type" "mix" "string materials" [ "a" "b" ] "texture amount" "half"
NamedMaterial "m"
Shape "plymesh" "string filename" "m.ply"
ObjectBegin "o"
  Material "diffusetransmission" "texture reflectance" "c" "texture transmittance" "c" "float scale" 0.5
  Translate 1 0 0
  Shape "sphere" "float radius" 0.5
  Shape "disk" "float alpha" 0.5
ObjectEnd
AttributeBegin
  ConcatTransform [ 2 0 0 0  0 2 0 0  0 0 2 0  1 0 0 1 ]
  ObjectInstance "o"
  Attribute "shape" "float radius" 0.25
  AreaLightSource "diffuse" "rgb L" [ 3 2 1 ] "float power" 10
  Shape "sphere"
AttributeEnd
Material "dielectric" "spectrum eta" "glass-BK7" "float roughness" 0.1
Shape "loopsubdiv" "integer levels" 2 "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ 0 0 0 1 0 0 1 1 0 0 1 0 ]
Include "i.pbrt"
"#;

/// A part of a sphere, apart from [`PBRT`]: it becomes so many triangles that it takes most of the time
/// of a file.
const PBRT_PART: &str = r#"WorldBegin
LightSource "point" "point3 from" [ 0 0 2 ]
Shape "sphere" "float radius" 0.5 "float zmax" 0.4
"#;

/// A file that [`PBRT`] includes.
const PBRT_INCLUDED: &str = "ReverseOrientation\nMaterial \"diffuse\" \"spectrum reflectance\" [ 400 0.2 700 0.8 ]\n\
    Shape \"bilinearmesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 1 1 1 ] \"point2 uv\" [ 0 0 2 0 0 2 2 2 ]\n";

/// Directives of version 3.
const PBRT_OLD: &str = r#"LookAt 0 1 -5  0 1 0  0 1 0
Camera "perspective" "float fov" [ 50 ] "float screenwindow" [ -1 1 -1 1 ]
Film "image" "integer xresolution" [ 16 ] "integer yresolution" [ 16 ] "float scale" [ 2 ]
WorldBegin
  LightSource "infinite" "string mapname" [ "t.png" ] "color L" [ 1 2 1 ]
  LightSource "distant" "point from" [ 0 1 0 ] "point to" [ 0 0 0 ] "xyz L" [ 1 1 1 ]
  TransformBegin
    Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 -0.5 0 0 1 ]
    Material "uber" "rgb Kd" [ 0.5 0.4 0.3 ] "rgb opacity" [ 0.5 0.5 0.5 ] "float roughness" [ 0.2 ]
    Shape "trianglemesh" "integer indices" [ 0 1 2 ] "point P" [ 0 0 0 1 0 0 0 1 0 ] "normal N" [ 0 0 1 0 0 1 0 0 1 ]
  TransformEnd
  Material "substrate" "rgb Ks" [ 0.04 0.04 0.04 ] "float uroughness" 0.1 "float vroughness" 0.3
  Shape "cylinder" "float radius" [ 0.5 ] "float phimax" [ 180 ]
WorldEnd
"#;

const LUA: &str = "local s = scene { resolution = { 64, 32 }, max_depth = 3 }
s:camera { position = { 0, 1, 5 }, target = { 0, 1, 0 } }
s:view(\"above\", { position = { 0, 4, 0.1 }, target = { 0, 0, 0 }, fov = 40 })
s:material(\"clay\", { base_color = { 0.5, 0.4, 0.3 }, base_color_texture = texture.file(\"t.png\") })
s:material(\"wet\", { from = \"clay\", clearcoat = 1 })
s:add { shape = shape.box { size = { 1, 2, 3 } }, material = \"clay\", at = { 0, 1, 0 }, rotate = 90 }
s:import(\"m.obj\", { material = \"wet\" })
s:light { position = { 0, 4, 0 }, intensity = { 10, 10, 10 } }
return s
";

/// Returns a quad with normals, in one of the encodings of PLY.
pub fn ply(format: &str) -> Vec<u8> {
    let head = "element vertex 4\nproperty float x\nproperty double y\nproperty float z\nproperty float nz\nproperty uchar s\n\
                element edge 1\nproperty list uchar short which\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let mut bytes = format!("ply\nformat {format} 1.0\n{head}").into_bytes();
    if format == "ascii" {
        bytes.extend(b"0 0 0 1 7\n1 0 0 1 7\n1 1 0 1 7\n0 1 0 1 7\n2 0 1\n4 0 1 2 3\n");
        return bytes;
    }
    let mut put = |mut raw: Vec<u8>| {
        if format == "binary_big_endian" {
            raw.reverse();
        }
        bytes.extend(raw);
    };
    for [x, y] in [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        put(x.to_le_bytes().to_vec());
        put(f64::from(y).to_le_bytes().to_vec());
        [0.0f32, 1.0]
            .iter()
            .for_each(|z| put(z.to_le_bytes().to_vec()));
        put(vec![7]);
    }
    put(vec![2]);
    [0i16, 1].iter().for_each(|i| put(i.to_le_bytes().to_vec()));
    put(vec![4]);
    [0i32, 1, 2, 3]
        .iter()
        .for_each(|i| put(i.to_le_bytes().to_vec()));
    bytes
}

/// A Mitsuba scene of one mesh of a [`serialized`] file.
const MITSUBA_SERIALIZED: &str = r#"<scene version="3.0.0"><shape type="serialized"><string name="filename" value="m.serialized"/></shape></scene>"#;

/// Returns a file of serialized meshes, each given by its version and what its stream expands to.
pub fn serialized(meshes: &[(u16, &[u8])]) -> Vec<u8> {
    let (mut file, mut offsets) = (Vec::new(), Vec::new());
    for (version, mesh) in meshes {
        offsets.extend((file.len() as u64).to_le_bytes());
        file.extend([0x1c, 4]);
        file.extend(version.to_le_bytes());
        let mut packer = ZlibEncoder::new(&mut file, Compression::default());
        packer
            .write_all(mesh)
            .and_then(|()| packer.try_finish())
            .expect("writing to a vector does not fail");
    }
    file.extend(offsets);
    file.extend((meshes.len() as u32).to_le_bytes());
    file
}

/// Returns what the stream of a serialized mesh of version 4 expands to: two triangles with normals,
/// texture coordinates and colours.
pub fn serialized_mesh() -> Vec<u8> {
    let mut mesh = (0x1000u32 | 1 | 2 | 8).to_le_bytes().to_vec();
    mesh.extend(b"t\0");
    mesh.extend([4u64, 2].into_iter().flat_map(u64::to_le_bytes));
    let corners = [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut put = |of: &dyn Fn([f32; 2]) -> Vec<f32>| {
        let numbers = corners.into_iter().flat_map(of);
        mesh.extend(numbers.flat_map(f32::to_le_bytes));
    };
    put(&|[x, y]| vec![x, y, 0.0]);
    put(&|_| vec![0.0, 0.0, 1.0]);
    put(&|[x, y]| vec![x, y]);
    put(&|_| vec![1.0; 3]);
    mesh.extend([0u32, 1, 2, 0, 2, 3].into_iter().flat_map(u32::to_le_bytes));
    mesh
}

/// Returns a small picture in a format of the `image` crate.
pub fn picture(format: image::ImageFormat) -> Vec<u8> {
    let small = image::RgbImage::from_fn(5, 4, |x, y| image::Rgb([x as u8 * 50, y as u8 * 60, 7]));
    let small = image::DynamicImage::from(small);
    let small = if format == image::ImageFormat::Hdr {
        image::DynamicImage::from(small.into_rgb32f())
    } else {
        small
    };
    let mut bytes = Cursor::new(Vec::new());
    small
        .write_to(&mut bytes, format)
        .expect("the format can be encoded");
    bytes.into_inner()
}

fn exr() -> Vec<u8> {
    let image = lumbre_light::film::Image {
        width: 5,
        height: 4,
        data: (0..20).map(|i| [i as f32, 0.5, 0.0]).collect(),
    };
    lumbre_report::exr::encode(&image, &[("spp".to_owned(), "4".to_owned())])
        .expect("a small image can be encoded")
}

/// Returns all samples. A format with several variants has several.
pub fn samples() -> Vec<Sample> {
    use image::ImageFormat::{Bmp, Hdr, Jpeg, Png, Tga, WebP};
    let png = picture(Png);
    let one = |name, file, bytes: &[u8], beside: &[(&'static str, &[u8])]| Sample {
        name,
        files: [(file, bytes.to_vec())]
            .into_iter()
            .chain(beside.iter().map(|(n, b)| (*n, b.to_vec())))
            .collect(),
    };
    let (quad, mesh, plain) = (QUAD.as_bytes(), scn_mesh(), ply("ascii"));
    let mut all = vec![
        one(
            "scn",
            "a.scn",
            SCN.as_bytes(),
            &[("m.obj", mesh.as_bytes()), ("t.png", &png)],
        ),
        one(
            "scn, more",
            "a.scn",
            SCN_MORE.as_bytes(),
            &[("m.obj", quad), ("t.png", &png)],
        ),
        one(
            "obj",
            "a.obj",
            OBJ.as_bytes(),
            &[("a.mtl", MTL.as_bytes()), ("t.png", &png)],
        ),
        one("ply", "a.ply", &plain, &[]),
        one("ply, little", "a.ply", &ply("binary_little_endian"), &[]),
        one("ply, big", "a.ply", &ply("binary_big_endian"), &[]),
        one(
            "gltf",
            "a.gltf",
            GLTF.as_bytes(),
            &[("b.bin", &gltf_buffer()), ("a t.png", &png)],
        ),
        one("glb", "a.glb", &gltf_as_glb(), &[("a t.png", &png)]),
        one("mitsuba", "a.xml", MITSUBA.as_bytes(), &[("m.obj", quad)]),
        one(
            "mitsuba, more",
            "a.xml",
            MITSUBA_MORE.as_bytes(),
            &[
                ("i.xml", INCLUDED.as_bytes()),
                ("m.ply", &plain),
                ("t.png", &png),
            ],
        ),
        one(
            "mitsuba, serialized",
            "a.xml",
            MITSUBA_SERIALIZED.as_bytes(),
            &[(
                "m.serialized",
                &serialized(&[(4, serialized_mesh().as_slice())]),
            )],
        ),
        one(
            "pbrt",
            "a.pbrt",
            PBRT.as_bytes(),
            &[
                ("i.pbrt", PBRT_INCLUDED.as_bytes()),
                ("m.ply", &plain),
                ("t.png", &png),
            ],
        ),
        one("pbrt, part", "a.pbrt", PBRT_PART.as_bytes(), &[]),
        one(
            "pbrt, old",
            "a.pbrt",
            PBRT_OLD.as_bytes(),
            &[("t.png", &png)],
        ),
        one(
            "folder",
            "scene.json",
            FOLDER
                .replacen('{', "{ 'hdri' : {'name' : 'sky', 'xOffset' : 0.25},", 1)
                .as_bytes(),
            &[
                ("Objects/floor.obj", quad),
                ("Textures/mat1_albedo.bmp", &picture(Bmp)),
                ("HDRI/sky.hdr", &picture(Hdr)),
            ],
        ),
        one(
            "lua",
            "a.lua",
            LUA.as_bytes(),
            &[("m.obj", quad), ("t.png", &png)],
        ),
        one("exr", "a.exr", &exr(), &[]),
    ];
    let pictures = [
        ("png", "a.png", Png),
        ("jpeg", "a.jpg", Jpeg),
        ("bmp", "a.bmp", Bmp),
        ("hdr", "a.hdr", Hdr),
        ("webp", "a.webp", WebP),
    ];
    all.extend(
        pictures
            .into_iter()
            .map(|(name, file, format)| one(name, file, &picture(format), &[])),
    );
    all.push(one("tga", "a.tga", &picture(Tga), &[]));
    all
}
