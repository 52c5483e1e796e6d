//! Mitsuba scenes of several files: folders in which they are searched, references to later objects,
//! serialized meshes, spectra, and tilted environment maps; and what cameras cut off.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::Vec3;
use lumbre_light::scene::SceneDesc;
use lumbre_light::scene::desc::{EnvironmentSource, ShapeDesc, Texels};

use super::{Folder, QUAD, lines};

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
        let ShapeDesc::Mesh(mesh) = &desc.entities[0].shape else {
            panic!("expected a mesh")
        };
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

/// Returns a mesh of version 4 with doubles if `double`: a triangle of this height, counted `count`
/// times.
fn packed(height: f64, count: u64, double: bool) -> Vec<u8> {
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
    let mut file = vec![0x1c, 4, 4, 0];
    let mut packer = ZlibEncoder::new(&mut file, Compression::default());
    packer.write_all(&mesh).unwrap();
    packer.finish().unwrap();
    file
}

/// Returns a file of some meshes.
fn file(meshes: &[Vec<u8>]) -> Vec<u8> {
    let mut all = Vec::new();
    let mut offsets = Vec::new();
    for mesh in meshes {
        offsets.extend((all.len() as u64).to_le_bytes());
        all.extend(mesh);
    }
    all.extend(offsets);
    all.extend((meshes.len() as u32).to_le_bytes());
    all
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
        file(&[packed(2.0, 1, false), packed(3.0, 2, true)]),
    )]);
    for (index, height, triangles) in [(0, 2.0, 1), (1, 3.0, 2)] {
        folder.write("a.xml", shape(index));
        let (desc, _) = folder.load("a.xml").unwrap();
        let ShapeDesc::Mesh(mesh) = &desc.entities[0].shape else {
            panic!("expected a mesh")
        };
        assert_eq!(mesh.positions[2], Vec3::new(0.0, height, 0.0));
        assert_eq!(mesh.triangles.len(), triangles);
        // The flag of the second mesh asks for the normals of its faces.
        assert_eq!(mesh.normals.is_empty(), index == 1);
    }
    let good = file(&[packed(2.0, 1, false)]);
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
        (
            0,
            file(&[packed(2.0, u64::MAX / 3, false)]),
            "end too early",
        ),
        (0, file(&[packed(f64::NAN, 1, true)]), "not finite"),
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
    let good = file(&[packed(2.0, 1, false)]);
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
    let mut bomb = vec![0x1c, 4, 4, 0];
    let mut packer = ZlibEncoder::new(&mut bomb, Compression::best());
    (0..32).for_each(|_| packer.write_all(&[0; 1 << 20]).unwrap());
    packer.finish().unwrap();
    folder.write("m.serialized", file(&[bomb]));
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
    assert!(refused("type=\"blackbody\"/>").contains("`uniform`, `d65`"));
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
