//! Mitsuba scenes of several files: folders in which they are searched, references to later objects,
//! serialized meshes, colours of vertices, spectra, and tilted environment maps; what cameras cut off;
//! variables as options; and plugins of older versions.

use glam::Vec3;
use lumbre_light::scene::SceneDesc;
use lumbre_light::scene::desc::{EnvironmentSource, Model, Texels};
use lumbre_light::value::Value;
use lumbre_scene_io::load::MissingTextures;

use super::mitsuba::surface;
use super::samples::serialized;
use super::{Folder, QUAD, lines, mesh_of};

fn scene(inner: &str) -> String {
    format!("<scene version=\"3.0.0\">{inner}</scene>")
}

/// Loads a scene of one file.
fn read(inner: &str) -> Result<(SceneDesc, String), String> {
    let loaded = Folder::new(&[("a.xml", scene(inner))]).load("a.xml");
    let (desc, notes) = loaded.map_err(|e| e.to_string())?;
    Ok((desc, lines(&notes)))
}

#[test]
fn files_are_searched_in_the_folders_of_the_scene() {
    let mesh = "<shape type=\"obj\"><string name=\"filename\" value=\"meshes/q.obj\"/></shape>";
    let include = "<include filename=\"parts/shapes.xml\"/>";
    let folder = Folder::new(&[("parts/shapes.xml", scene(mesh)), ("a.xml", scene(include))]);
    let e = folder.load("a.xml").unwrap_err().to_string();
    assert!(e.contains("parts/meshes/q.obj"), "{e}");
    // Beside the file that names it, in the folder of the scene, in those of `path`.
    let text = |width: u32| QUAD.replace("v 1 0 -1", &format!("v {width} 0 -1"));
    let width = |folder: &Folder, name: &str| {
        let (desc, _) = folder.load(name).unwrap();
        let mesh = mesh_of(&desc, 0);
        mesh.positions.iter().map(|p| p.x).fold(0.0, f32::max)
    };
    folder.write("parts/meshes/q.obj", text(2));
    assert_eq!(width(&folder, "a.xml"), 2.0);
    folder.write("meshes/q.obj", text(3));
    assert_eq!(width(&folder, "a.xml"), 3.0);
    folder.write("common/meshes/q.obj", text(4));
    folder.write("more/meshes/q.obj", text(5));
    // A folder counts even if the file was named before it, and the last one first.
    let paths = "<path value=\"more\"/><path value=\"common\"/>";
    folder.write("b.xml", scene(&format!("{include}{paths}")));
    assert_eq!(width(&folder, "b.xml"), 4.0);
    let many = "<path value=\"more\"/>".repeat(20);
    let e = read(&many).unwrap_err();
    assert!(e.contains("more than 16 folders"), "{e}");
}

#[test]
fn references_may_precede_their_objects_and_circles_are_refused() {
    let (desc, notes) = read(
        "<shape type=\"rectangle\" id=\"lamp\"><ref id=\"paint\"/><ref id=\"glow\"/></shape>\
         <alias id=\"red\" as=\"paint\"/><bsdf type=\"diffuse\" id=\"red\">\
         <rgb name=\"reflectance\" value=\"0.5 0.25 0.125\"/></bsdf>\
         <emitter type=\"area\" id=\"glow\"><rgb name=\"radiance\" value=\"3\"/></emitter>",
    )
    .unwrap();
    let material = &desc.materials[desc.material_index("lamp_light").unwrap()];
    assert_eq!(material.emission, Vec3::splat(3.0));
    assert_eq!(material.base_color, Vec3::new(0.5, 0.25, 0.125));
    assert!(!notes.contains("not supported"), "{notes}");
    for (xml, expected) in [
        (
            "<shape type=\"cube\"><ref id=\"none\"/></shape>",
            "no object has the id `none`",
        ),
        (
            "<bsdf type=\"twosided\" id=\"a\"><ref id=\"b\"/></bsdf>\
             <bsdf type=\"twosided\" id=\"b\"><ref id=\"a\"/></bsdf>",
            "refers to itself",
        ),
        (
            "<alias id=\"a\" as=\"b\"/><alias id=\"b\" as=\"a\"/>\
             <shape type=\"cube\"><ref id=\"a\"/></shape>",
            "no object has the id",
        ),
    ] {
        let e = read(xml).unwrap_err();
        assert!(e.contains(expected) && e.contains("line 1"), "{xml}: {e}");
    }
    let chain: String = (0..5000)
        .map(|i| {
            format!(
                "<bsdf type=\"twosided\" id=\"s{i}\"><ref id=\"s{}\"/></bsdf>",
                i + 1
            )
        })
        .collect();
    let e = read(&format!("{chain}<bsdf type=\"diffuse\" id=\"s5000\"/>")).unwrap_err();
    assert!(e.contains("more than 32 levels deep"), "{e}");
}

/// Returns what a mesh of version 4 expands to, with doubles if `double`: a triangle of this height,
/// counted `count` times.
fn mesh(height: f64, count: u64, double: bool) -> Vec<u8> {
    let mut mesh = (if double { 0x2010u32 } else { 0x1000 })
        .to_le_bytes()
        .to_vec();
    mesh.extend(b"t\0");
    mesh.extend(3u64.to_le_bytes());
    mesh.extend(count.to_le_bytes());
    for x in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, height, 0.0] {
        if double {
            mesh.extend(x.to_le_bytes());
        } else {
            mesh.extend((x as f32).to_le_bytes());
        }
    }
    (0..count.min(100))
        .for_each(|_| mesh.extend([0u32, 1, 2].into_iter().flat_map(u32::to_le_bytes)));
    mesh
}

/// Returns a file of meshes of version 4.
fn file(meshes: &[Vec<u8>]) -> Vec<u8> {
    let meshes: Vec<_> = meshes.iter().map(|m| (4, m.as_slice())).collect();
    serialized(&meshes)
}

#[test]
fn serialized_meshes_are_read_by_index_and_within_limits() {
    let shape = |index: i64| {
        scene(&format!(
            "<shape type=\"serialized\"><string name=\"filename\" value=\"m.serialized\"/>\
             <integer name=\"shape_index\" value=\"{index}\"/></shape>"
        ))
    };
    let folder = Folder::new(&[(
        "m.serialized",
        file(&[mesh(2.0, 1, false), mesh(3.0, 2, true)]),
    )]);
    for (index, height, triangles) in [(0, 2.0, 1), (1, 3.0, 2)] {
        folder.write("a.xml", shape(index));
        let (desc, _) = folder.load("a.xml").unwrap();
        let mesh = mesh_of(&desc, 0);
        assert_eq!(mesh.positions[2], Vec3::new(0.0, height, 0.0));
        assert_eq!(mesh.triangles.len(), triangles);
        // The flag of the second mesh asks for the normals of its faces.
        assert_eq!(mesh.normals.is_empty(), index == 1);
    }
    let good = file(&[mesh(2.0, 1, false)]);
    let mut beyond = good.clone();
    let at = beyond.len() - 12;
    beyond[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes());
    for (index, bytes, expected) in [
        (2, good.clone(), "has 1 meshes"),
        (-1, good.clone(), "whole number of 0 or more"),
        (0, beyond, "beyond the meshes"),
        (0, b"ply\n".to_vec(), "no file of serialized meshes"),
        (0, vec![0x1c, 4, 9, 0], "expected version 3 or 4, found 9"),
        (0, vec![0x1c, 4, 4, 0], "longer than the file"),
        (0, good[..good.len() - 20].to_vec(), "mesh"),
        (0, file(&[mesh(2.0, u64::MAX / 3, false)]), "end too early"),
        (0, file(&[mesh(f64::NAN, 1, true)]), "not finite"),
    ] {
        folder.write("m.serialized", bytes);
        folder.write("a.xml", shape(index));
        let e = folder.load("a.xml").unwrap_err().to_string();
        assert!(e.contains(expected), "{expected}: {e}");
    }
}

#[test]
fn damaged_serialized_meshes_are_refused_or_read_without_a_panic() {
    let shape =
        "<shape type=\"serialized\"><string name=\"filename\" value=\"m.serialized\"/></shape>";
    let folder = Folder::new(&[("a.xml", scene(shape))]);
    let good = file(&[mesh(2.0, 1, false)]);
    for cut in 0..good.len() {
        folder.write("m.serialized", &good[..cut]);
        assert!(folder.load("a.xml").is_err(), "cut at byte {cut}");
    }
    for i in 0..8 * good.len() {
        let mut bytes = good.clone();
        bytes[i / 8] ^= 1 << (i % 8);
        folder.write("m.serialized", bytes);
        if let Ok((desc, _)) = folder.load("a.xml") {
            assert!(lumbre_light::scene::compile(&desc).is_ok(), "bit {i}");
        }
    }
    // A mesh may not expand beyond 16 MiB and 64 times the file.
    folder.write("m.serialized", file(&[vec![0; 32 << 20]]));
    let e = folder.load("a.xml").unwrap_err().to_string();
    assert!(e.contains("expand too far"), "{e}");
}

#[test]
fn spectra_are_those_of_mitsuba_in_rgb() {
    let color = |inner: &str| {
        let xml = format!(
            "<bsdf type=\"diffuse\" id=\"s\">{inner}</bsdf><shape type=\"cube\"><ref id=\"s\"/></shape>"
        );
        let (desc, notes) = read(&xml).unwrap();
        assert!(!notes.contains("spectr"), "{notes}");
        desc.materials[desc.material_index("s").unwrap()].base_color
    };
    let near = |a: Vec3, b: [f32; 3]| {
        assert!(
            (a / Vec3::from(b) - 1.0).abs().max_element() < 3e-3,
            "{a} {b:?}"
        );
    };
    // Values of Mitsuba 3.9.1 in `scalar_rgb`.
    near(
        color("<spectrum name=\"reflectance\" value=\"0.5\"/>"),
        [0.5; 3],
    );
    let ramp = "400:0.1, 500:0.3, 600:0.7, 700:0.2";
    let ramp = color(&format!(
        "<spectrum name=\"reflectance\" value=\"{ramp}\"/>"
    ));
    near(ramp, [0.682_387, 0.478_298, 0.168_871]);
    let uniform = "<spectrum name=\"reflectance\" type=\"uniform\"><float name=\"value\" value=\"0.3\"/></spectrum>";
    near(color(uniform), [0.3; 3]);
    let light = |value: &str| {
        let xml =
            format!("<emitter type=\"constant\"><spectrum name=\"radiance\" {value}</emitter>");
        match read(&xml).unwrap().0.environment.unwrap().source {
            EnvironmentSource::Color(color) => color,
            other => panic!("{other:?}"),
        }
    };
    near(light("value=\"0.5\"/>"), [0.602_397, 0.474_145, 0.454_458]);
    near(
        light("value=\"400:0, 500:8, 600:15.6, 700:18.4\"/>"),
        [20.710_8, 10.854_6, 2.771_15],
    );
    near(
        light("type=\"d65\"><float name=\"scale\" value=\"2\"/></spectrum>"),
        [2.0; 3],
    );
    let refused = |value: &str| {
        read(&format!(
            "<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" {value}</bsdf>"
        ))
        .unwrap_err()
    };
    assert!(refused("type=\"blackbody\"/>").contains("`blackbody` needs `temperature`"));
    assert!(refused("value=\"400:0.5, 500\"/>").contains("pairs of wavelength and value"));
    let folder = Folder::new(&[
        ("x.spd", "# nm value\n400 0.5\n700 1.5\n"),
        (
            "a.xml",
            &scene(
                "<emitter type=\"constant\"><spectrum name=\"radiance\" filename=\"x.spd\"/></emitter>",
            ),
        ),
        ("y.spd", "400 x"),
        (
            "b.xml",
            &scene(
                "<emitter type=\"constant\"><spectrum name=\"radiance\" filename=\"y.spd\"/></emitter>",
            ),
        ),
    ]);
    assert!(folder.load("a.xml").is_ok());
    let e = folder.load("b.xml").unwrap_err().to_string();
    assert!(e.contains("pairs of wavelength and value"), "{e}");
}

#[test]
fn a_tilted_environment_map_is_computed_in_the_axes_of_the_scene() {
    let hdr = {
        // Rows from +y to -y: a bright top.
        let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n".to_vec();
        for row in 0..8 {
            let texel = if row == 0 {
                [128, 128, 128, 133]
            } else {
                [128, 128, 128, 129]
            };
            (0..16).for_each(|_| bytes.extend(texel));
        }
        bytes
    };
    let xml = |steps: &str| {
        scene(&format!(
            "<emitter type=\"envmap\"><string name=\"filename\" value=\"e.hdr\"/>\
             <transform name=\"to_world\">{steps}</transform></emitter>"
        ))
    };
    let folder = Folder::new(&[("e.hdr", hdr)]);
    folder.write("a.xml", xml("<rotate x=\"1\" angle=\"90\"/>"));
    let (desc, notes) = folder.load("a.xml").unwrap();
    assert!(
        lines(&notes).contains("in the axes of the scene"),
        "{}",
        lines(&notes)
    );
    let Some(EnvironmentSource::Map(map)) = desc.environment.map(|e| e.source) else {
        panic!("expected a map")
    };
    let Texels::RgbaF32(texels) = &map.texels else {
        panic!("expected floats")
    };
    let at = |x: usize, y: usize| texels[y * 1024 + x][0];
    // +y is turned to +z, which is in the middle of the map.
    let [left, right, top, middle] = [at(0, 256), at(1023, 255), at(0, 0), at(512, 256)];
    assert!(middle > 5.0, "{middle}");
    assert!(
        left < 1.5 && right < 1.5 && top < 1.5,
        "{left} {right} {top}"
    );
    folder.write("b.xml", xml("<scale x=\"0\"/>"));
    let e = folder.load("b.xml").unwrap_err().to_string();
    assert!(e.contains("not invertible"), "{e}");
}

#[test]
fn what_a_camera_of_mitsuba_cuts_off_is_noted() {
    let floor = |half: f32, far: &str| {
        let scale = format!(r#"<scale value="{half}"/><rotate x="1" angle="-90"/>"#);
        let shape = format!(
            r#"<shape type="rectangle"><transform name="to_world">{scale}</transform></shape>"#
        );
        let place = r#"<lookat origin="0, 1, 5" target="0, 1, 0" up="0, 1, 0"/>"#;
        let camera = format!(
            r#"<sensor type="perspective">{far}<transform name="to_world">{place}</transform></sensor>"#
        );
        read(&(camera + &shape)).unwrap().1
    };
    assert_eq!(floor(4000.0, ""), "");
    let notes = floor(40_000.0, "");
    let expected = "more than 10000 units away (`far_clip`), which is not supported; the scene \
                    reaches 40005 units";
    assert!(notes.contains(expected), "{notes}");
    let far = r#"<float name="far_clip" value="5"/>"#;
    assert!(
        floor(1.0, far).contains("reaches 6 units"),
        "{}",
        floor(1.0, far)
    );
}

#[test]
fn variables_are_options_of_the_scene() {
    let xml = scene(
        r#"<default name="depth" value="9"/><default name="grey" value="0.5"/>
<integrator type="path"><integer name="max_depth" value="$depth"/></integrator>
<bsdf type="diffuse" id="s"><rgb name="reflectance" value="$grey"/></bsdf>
<shape type="$kind"><ref id="s"/></shape>"#,
    );
    let folder = Folder::new(&[("a.xml", xml.as_str()), ("m.obj", QUAD)]);
    let read = |file: &str, options: &[(&str, Value)]| {
        let options = options
            .iter()
            .map(|(name, v)| ((*name).to_owned(), v.clone()));
        lumbre_lua::scene::read(
            &folder.path(file),
            &options.collect(),
            MissingTextures::Fail,
        )
    };
    let kind = ("kind", Value::from("disk"));
    let (desc, _) = read("a.xml", std::slice::from_ref(&kind)).unwrap();
    assert_eq!(
        (desc.max_depth, desc.materials[0].base_color),
        (9, Vec3::splat(0.5))
    );
    let color = Value::from("0.25 0.5 0.75");
    let given = [kind, ("depth", Value::Int(3)), ("grey", color)];
    let (desc, _) = read("a.xml", &given).unwrap();
    let expected = (3, Vec3::new(0.25, 0.5, 0.75));
    assert_eq!((desc.max_depth, desc.materials[0].base_color), expected);
    // A stage stands around the scene as before.
    let staged = [given[0].clone(), ("stage", Value::from("white"))];
    assert!(read("a.xml", &staged).unwrap().0.environment.is_some());
    let table = Value::Map(Default::default());
    for (file, options, expected) in [
        ("a.xml", vec![], "set the scene option of this name"),
        (
            "a.xml",
            [&given[..], &[("dept", Value::Int(3))]].concat(),
            "unknown option `dept`: did you mean `depth`?",
        ),
        ("a.xml", vec![("kind", table)], "`kind` is a table"),
        (
            "a.xml",
            vec![("depth", Value::from("x")), given[0].clone()],
            "`x` is not a number",
        ),
        ("m.obj", vec![given[0].clone()], "the option `stage` only"),
    ] {
        let e = read(file, &options).unwrap_err().to_string();
        assert!(e.contains(expected), "{expected}: {e}");
    }
}

#[test]
fn colours_of_vertices_are_those_of_surfaces_that_ask_for_them() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
               property float z\nproperty float r\nproperty float g\nproperty float b\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0 1 0 0\n1 0 0 0 0.5 0\n1 1 0 0.25 0.5 1\n3 0 1 2\n";
    let read = |surface: &str, file: &str| {
        let xml = scene(&format!(
            "<sensor type=\"perspective\"/><bsdf type=\"diffuse\" id=\"s\">{surface}</bsdf>\
             <shape type=\"{kind}\"><string name=\"filename\" value=\"m.{kind}\"/><ref id=\"s\"/></shape>",
            kind = file
        ));
        let folder = Folder::new(&[("a.xml", xml.as_str()), ("m.ply", ply), ("m.obj", QUAD)]);
        let (desc, notes) = folder.load("a.xml").unwrap_or_else(|e| panic!("{e}"));
        let mesh = mesh_of(&desc, 0);
        (
            desc.materials[0].base_color.x,
            mesh.colors.clone(),
            lines(&notes),
        )
    };
    let attribute = |name: &str| {
        format!(
            "<texture type=\"mesh_attribute\" name=\"reflectance\"><float name=\"scale\" value=\"0.5\"/>\
             <string name=\"name\" value=\"{name}\"/></texture>"
        )
    };
    let (base, colors, notes) = read(&attribute("vertex_color"), "ply");
    assert_eq!(
        (base, colors[2]),
        (0.5, Vec3::new(0.25, 0.5, 1.0)),
        "{notes}"
    );
    assert!(notes.is_empty(), "{notes}");
    let (_, colors, notes) = read("", "ply");
    assert!(colors.is_empty() && notes.is_empty(), "{notes}");
    let (_, colors, notes) = read(&attribute("face_color"), "ply");
    assert!(
        colors.is_empty() && notes.contains("`face_color` is not supported"),
        "{notes}"
    );
    let (_, _, notes) = read(&attribute("vertex_color"), "obj");
    assert!(notes.contains("no colours of vertices"), "{notes}");
}

#[test]
fn diffuse_plugins_of_version_0_6_become_the_matching_models() {
    let (m, notes) = surface(
        r#"<bsdf type="difftrans" id="s"><rgb name="transmittance" value="0.1, 0.2, 0.3"/></bsdf>"#,
    );
    assert_eq!(
        (m.model, m.base_color, m.transmittance),
        (Model::Translucent, Vec3::ZERO, Vec3::new(0.1, 0.2, 0.3))
    );
    assert!(!m.one_sided && notes.is_empty(), "{notes}");
    let (m, notes) = surface(
        r#"<bsdf type="roughdiffuse" id="s"><rgb name="reflectance" value="0.1, 0.2, 0.3"/>
<float name="alpha" value="1"/></bsdf>"#,
    );
    assert_eq!(
        (m.model, m.base_color),
        (Model::OrenNayar, Vec3::new(0.1, 0.2, 0.3))
    );
    // Slopes of deviation 1 over both axes: sqrt(1/2) radians, of the 90 degrees of roughness 1.
    assert!((m.roughness - 0.450_158).abs() < 1e-5, "{}", m.roughness);
    assert!(
        notes.lines().count() == 1 && notes.contains("from facet to facet"),
        "{notes}"
    );
    let (_, notes) = surface(
        r#"<bsdf type="roughdiffuse" id="s"><boolean name="useFastApprox" value="true"/></bsdf>"#,
    );
    assert_eq!(notes, "");
}
