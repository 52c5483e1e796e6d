//! What names of textures and materials mean in pbrt, forms of version 3, and area lights that are
//! invisible, on interfaces, or on both sides.

use glam::Vec3;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{MaterialDesc, SceneDesc, TextureSlot};

use super::pbrt::{TRIANGLE, VIEW, corners, read, read_files, read_v3};

/// Returns the material of each entity.
fn materials(desc: &SceneDesc) -> Vec<&MaterialDesc> {
    let of = |name: &Option<String>| {
        let name = name.as_deref().unwrap_or_default();
        &desc.materials[desc.material_index(name).unwrap()]
    };
    desc.entities.iter().map(|e| of(&e.material)).collect()
}

/// Returns the base colour of the material of each entity.
fn colors(desc: &SceneDesc) -> Vec<Vec3> {
    materials(desc).iter().map(|m| m.base_color).collect()
}

const RED: &str = "Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [1 0 0]\n";
const BLUE: &str = "Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [0 0 1]\n";

#[test]
fn a_material_keeps_the_texture_that_had_the_name_when_it_was_made() {
    let named = |name: &str| {
        format!("MakeNamedMaterial \"{name}\" \"string type\" \"matte\" \"texture Kd\" \"t\"\n")
    };
    let world = format!(
        "{RED}{}{BLUE}{}NamedMaterial \"a\"\n{TRIANGLE}NamedMaterial \"b\"\n{TRIANGLE}",
        named("a"),
        named("b")
    );
    assert_eq!(colors(&read_v3(&world).0), [Vec3::X, Vec3::Z]);
    let own = format!("{RED}Material \"matte\" \"texture Kd\" \"t\"\n{BLUE}{TRIANGLE}");
    assert_eq!(colors(&read_v3(&own).0), [Vec3::X]);
    // Named again, a material is another one; shapes before keep theirs.
    let again = format!(
        "{RED}{}NamedMaterial \"a\"\n{BLUE}{}{TRIANGLE}NamedMaterial \"a\"\n{TRIANGLE}",
        named("a"),
        named("a")
    );
    assert_eq!(colors(&read_v3(&again).0), [Vec3::X, Vec3::Z]);
}

#[test]
fn names_of_version_3_last_to_the_end_of_their_block() {
    let matte = "Material \"matte\" \"texture Kd\" \"t\"\n";
    let world = format!(
        "{RED}AttributeBegin\n{BLUE}{matte}{TRIANGLE}AttributeEnd\n{matte}{TRIANGLE}\
         TransformBegin\n{BLUE}TransformEnd\n{matte}{TRIANGLE}"
    );
    assert_eq!(colors(&read_v3(&world).0), [Vec3::Z, Vec3::X, Vec3::Z]);
    let make = |color: &str| {
        format!("MakeNamedMaterial \"m\" \"string type\" \"matte\" \"rgb Kd\" [{color}]\n")
    };
    let world = format!(
        "{}AttributeBegin\n{}AttributeEnd\nNamedMaterial \"m\"\n{TRIANGLE}",
        make("1 0 0"),
        make("0 0 1")
    );
    assert_eq!(colors(&read_v3(&world).0), [Vec3::X]);
}

#[test]
fn names_of_version_4_have_one_meaning() {
    let diffuse = "Material \"diffuse\" \"texture reflectance\" \"t\"\n";
    let world = format!("AttributeBegin\n{RED}AttributeEnd\n{diffuse}{TRIANGLE}");
    assert_eq!(colors(&read(&world).0), [Vec3::X]);
    // A texture may follow the material.
    let world = format!("{diffuse}{BLUE}{TRIANGLE}");
    assert_eq!(colors(&read(&world).0), [Vec3::Z]);
}

#[test]
fn a_mix_of_version_3_has_an_amount_of_any_type_and_the_materials_before_it() {
    let make = |name: &str, color: &str| {
        format!("MakeNamedMaterial \"{name}\" \"string type\" \"matte\" \"rgb Kd\" [{color}]\n")
    };
    let mix = |amount: &str| {
        let world = format!(
            "{}{}Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [.25 .25 .25]\n\
             Material \"mix\" \"string namedmaterial1\" \"a\" \"string namedmaterial2\" \"b\" {amount}\n\
             {}{TRIANGLE}",
            make("a", "1 0 0"),
            make("b", "0 0 1"),
            make("a", "0 1 0"),
        );
        let (desc, notes) = read_v3(&world);
        let m = materials(&desc)[0].clone();
        let first = &desc.materials[desc.material_index(&m.parts[0]).unwrap()];
        assert_eq!(first.base_color, Vec3::X);
        (m, notes)
    };
    for amount in [
        "\"rgb amount\" [.25 .25 .25]",
        "\"color amount\" [.25 .25 .25]",
        "\"texture amount\" \"t\"",
        "\"float amount\" .25",
    ] {
        let (m, notes) = mix(amount);
        assert_eq!(m.weights, [0.25, 0.75], "{amount}");
        assert!(!notes.contains("amount"), "{notes}");
        assert!(m.texture(TextureSlot::Weights).is_none());
    }
    let (m, notes) = mix("\"rgb amount\" [.25 .5 .75]");
    assert_eq!(m.weights, [0.5, 0.5]);
    assert!(notes.contains("coloured `amount`"), "{notes}");
}

/// Returns the emission of the first entity under an area light.
fn emission(desc: &SceneDesc) -> Vec3 {
    materials(desc)[0].emission
}

#[test]
fn the_area_light_of_version_3_has_two_names() {
    for name in ["area", "diffuse"] {
        let world = format!("AreaLightSource \"{name}\" \"rgb L\" [1 .5 .25]\n{TRIANGLE}");
        assert_eq!(emission(&read_v3(&world).0), Vec3::new(1.0, 0.5, 0.25));
    }
}

#[test]
fn an_area_light_on_an_interface_is_ignored_in_version_4() {
    let light = "AreaLightSource \"diffuse\"\n";
    let named = "MakeNamedMaterial \"i\" \"string type\" \"interface\"\nNamedMaterial \"i\"\n";
    for material in ["Material \"interface\"\n", named] {
        let (desc, notes) = read(&format!("{material}{light}{TRIANGLE}"));
        assert_eq!(emission(&desc), Vec3::ZERO);
        assert!(notes.contains("ignores an area light on"), "{notes}");
    }
    let (desc, _) = read_v3(&format!("Material \"none\"\n{light}{TRIANGLE}"));
    assert_eq!(emission(&desc), Vec3::ONE);
}

#[test]
fn an_invisible_light_stays_with_a_note() {
    let triangle = TRIANGLE.trim_end();
    let world = format!("AreaLightSource \"diffuse\"\n{triangle} \"float alpha\" 0\n");
    let (desc, notes) = read(&world);
    assert_eq!(emission(&desc), Vec3::ONE);
    assert!(materials(&desc)[0].texture(TextureSlot::Mask).is_none());
    assert!(notes.contains("invisible light"), "{notes}");
    let (desc, notes) = read(&format!("{triangle} \"float alpha\" 0\n"));
    assert!(materials(&desc)[0].texture(TextureSlot::Mask).is_some());
    assert!(!notes.contains("invisible light"), "{notes}");
}

#[test]
fn a_light_of_two_sides_has_a_front_on_either() {
    let light = "AreaLightSource \"diffuse\" \"bool twosided\" true\n";
    for (before, place) in [
        ("", "Translate 0 0 2\n"),
        ("ReverseOrientation\n", "Translate 0 0 2\nScale -1 1 1\n"),
        ("", "Translate 1000 0 2\nScale 100 100 .001\n"),
    ] {
        let world = format!("{place}{before}{light}{TRIANGLE}");
        let (desc, notes) = read(&world);
        assert!(!notes.contains("twosided"), "{notes}");
        let (scene, _) = compile(&desc).unwrap();
        let [front, back] = &scene.triangles[..] else {
            panic!("{:?}", scene.triangles)
        };
        let normal = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a).normalize_or_zero();
        assert!(normal(front).distance(-normal(back)) < 1e-3);
        // Each is the nearer one on its side.
        let gap = (front[0] - back[0]).dot(normal(front));
        let size = (front[1] - front[0]).length();
        assert!(gap > 0.0 && gap < 1e-3 * size.max(10.0), "{gap}");
        assert_eq!(scene.emitters.len(), 2);
    }
    let (desc, notes) = read(&format!("{light}Shape \"sphere\"\n"));
    let inwards = corners(&desc, 0)
        .iter()
        .filter(|p| p.length() < 0.99995)
        .count();
    assert!(
        inwards > 0 && notes.contains("mesh of triangles"),
        "{notes}"
    );
}

#[test]
fn carriage_returns_end_comments_and_version_2_is_noted() {
    let world = format!(
        "# the first\r{RED}Material \"matte\" \"texture Kd\" \"t\" # the second\r{TRIANGLE}"
    );
    assert_eq!(colors(&read_v3(&world.replace('\n', "\r")).0), [Vec3::X]);
    let text = format!("{VIEW}SurfaceIntegrator \"path\"\nWorldBegin\n{TRIANGLE}WorldEnd\n");
    let (_, notes) = read_files(&[("a.pbrt", text.as_bytes())]).unwrap();
    assert!(notes.contains("version 2"), "{notes}");
}
