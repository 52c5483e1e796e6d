//! Forms of Mitsuba 0.6, and values that Mitsuba 3 changes.

use glam::{Vec2, Vec3};
use lumbre_light::scene::compile;
use lumbre_light::scene::compile::Wrap;
use lumbre_light::scene::desc::{Model, SceneDesc, ShapeDesc, Texels, TextureSlot};

use super::{Folder, lines};

/// Loads a scene of a version beside the image `grey.png` of 128 / 255.
fn read(version: &str, inner: &str) -> (SceneDesc, String) {
    let sensor = r#"<sensor type="perspective"><transform name="toWorld">
<lookAt origin="0, 1, 5" target="0, 1, 0" up="0, 1, 0"/></transform></sensor>"#;
    let text = format!("<scene version=\"{version}\">{sensor}{inner}</scene>");
    let folder = Folder::new(&[("a.xml", &text)]);
    let grey = image::GrayImage::from_pixel(2, 2, image::Luma([128]));
    grey.save(folder.path("grey.png")).unwrap();
    let (desc, notes) = folder.load("a.xml").unwrap_or_else(|e| panic!("{e}"));
    (desc, lines(&notes))
}

/// Loads a rectangle with a texture in its surface.
fn textured(texture: &str) -> (SceneDesc, String) {
    let surface = format!(r#"<bsdf type="diffuse">{texture}</bsdf>"#);
    read(
        "0.6.0",
        &format!(r#"<shape type="rectangle">{surface}</shape>"#),
    )
}

#[test]
fn look_at_is_written_in_three_ways() {
    let (desc, _) = read("0.6.0", "");
    assert_eq!(desc.camera.position, Vec3::new(0.0, 1.0, 5.0));
    assert!((desc.camera.target - desc.camera.position).distance(Vec3::NEG_Z) < 1e-6);
}

#[test]
fn gamma_of_a_bitmap_is_its_decoding() {
    for (gamma, expected) in [("1", 128.0 / 255.0), ("2.2", (128.0f32 / 255.0).powf(2.2))] {
        let (desc, notes) = textured(&format!(
            r#"<texture type="bitmap" name="reflectance"><string name="filename" value="grey.png"/>
<float name="gamma" value="{gamma}"/></texture>"#
        ));
        let texture = desc.materials[0].texture(TextureSlot::BaseColor).unwrap();
        let Texels::RgbaF32(texels) = &texture.texels else {
            panic!("linear floats expected")
        };
        assert!(
            (texels[0][0] - expected).abs() < 1e-6,
            "{gamma}: {}",
            texels[0][0]
        );
        assert!(!notes.contains("gamma"), "{notes}");
    }
    let (desc, _) = textured(
        r#"<texture type="bitmap" name="reflectance"><string name="filename" value="grey.png"/>
<float name="gamma" value="-1"/></texture>"#,
    );
    let texture = desc.materials[0].texture(TextureSlot::BaseColor).unwrap();
    assert!(matches!(texture.texels, Texels::Rgba8(_)));
}

#[test]
fn factors_and_offsets_of_texture_coordinates_are_a_transform() {
    let texture = |inner: &str| {
        let (desc, notes) = textured(&format!(
            r#"<texture type="checkerboard" name="reflectance">{inner}</texture>"#
        ));
        assert!(!notes.contains("not supported"), "{notes}");
        let (scene, _) = compile(&desc).unwrap();
        let m = scene.materials[0];
        let map = scene.textures[m.base_color_texture as usize].lookup.map;
        let at = |uv: Vec2| {
            let own = uv * m.tiling.scale + m.tiling.offset;
            map.map_or(own, |map| map.transform_point2(own))
        };
        [Vec2::ZERO, Vec2::ONE, Vec2::new(0.25, 0.5)].map(at)
    };
    let old = r#"<float name="uscale" value="4"/><float name="vscale" value="2"/>
<float name="uoffset" value="0.25"/><float name="voffset" value="0.125"/>"#;
    let new = r#"<transform name="to_uv"><scale x="4" y="2"/><translate x="0.25" y="0.125"/></transform>"#;
    for (old, new) in texture(old).into_iter().zip(texture(new)) {
        assert!(old.distance(new) < 1e-6, "{old} {new}");
    }
    let [a, b, _] = texture(r#"<float name="uscale" value="4"/><float name="vscale" value="4"/>"#);
    assert!((b - a).distance(Vec2::splat(4.0)) < 1e-6, "{a} {b}");
}

#[test]
fn wrap_modes_of_single_coordinates_are_read() {
    let (desc, notes) = textured(
        r#"<texture type="bitmap" name="reflectance"><string name="filename" value="grey.png"/>
<string name="wrapModeU" value="mirror"/><string name="wrapModeV" value="clamp"/></texture>"#,
    );
    let lookup = desc.materials[0].lookup(TextureSlot::BaseColor);
    assert_eq!(lookup.wrap, [Wrap::Mirror, Wrap::Clamp], "{notes}");
}

#[test]
fn a_number_of_an_emitter_is_daylight_in_version_0_6() {
    let light = r#"<shape type="rectangle"><emitter type="area"><spectrum name="radiance" value="2"/></emitter></shape>"#;
    let emission = |version: &str| {
        let (desc, _) = read(version, light);
        let emissive = desc.materials.iter().map(|m| m.emission);
        emissive.fold(Vec3::ZERO, Vec3::max)
    };
    assert_eq!(emission("0.6.0"), Vec3::splat(2.0));
    let equal_energy = Vec3::new(1.2048, 0.9483, 0.9089) * 2.0;
    assert!(emission("3.0.0").distance(equal_energy) < 1e-3);
}

#[test]
fn srgb_colours_are_decoded() {
    let (desc, _) = read(
        "0.6.0",
        r##"<bsdf type="diffuse" id="a"><srgb name="reflectance" value="0.5"/></bsdf>
<bsdf type="diffuse" id="b"><srgb name="reflectance" value="#ff0000"/></bsdf>"##,
    );
    assert!(
        (desc.materials[0].base_color - 0.214_041)
            .abs()
            .max_element()
            < 1e-5
    );
    assert_eq!(desc.materials[1].base_color, Vec3::X);
}

#[test]
fn an_alpha_of_zero_is_raised() {
    let roughness = |alpha: &str| {
        let surface = format!(
            r#"<bsdf type="roughconductor" id="a"><float name="alpha" value="{alpha}"/></bsdf>"#
        );
        read("3.0.0", &surface).0.materials[0].roughness
    };
    assert_eq!(roughness("0"), roughness("1e-4"));
    assert!((roughness("0") - 0.01).abs() < 1e-6);
}

#[test]
fn a_mirrored_sphere_is_inside_out() {
    let fronts = |steps: &str| {
        let shape = format!(
            r#"<shape type="sphere"><transform name="to_world">{steps}</transform></shape>"#
        );
        let (desc, _) = read("3.0.0", &shape);
        match &desc.entities[0].shape {
            ShapeDesc::Sphere { .. } => 1.0,
            ShapeDesc::Mesh(_) => {
                let (scene, _) = compile(&desc).unwrap();
                let outward = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a).dot(*a).signum();
                let sum: f32 = scene.triangles.iter().map(outward).sum();
                sum / scene.triangles.len() as f32
            }
        }
    };
    assert_eq!(fronts(r#"<scale value="2"/>"#), 1.0);
    assert_eq!(fronts(r#"<scale x="-1" y="1" z="1"/>"#), -1.0);
    assert_eq!(fronts(r#"<scale value="-1"/>"#), -1.0);
    assert_eq!(fronts(r#"<scale x="-1" y="-1" z="1"/>"#), 1.0);
}

/// Loads a rectangle with a surface, and returns its material with all parts by name.
fn surface(inner: &str) -> (SceneDesc, String) {
    read(
        "0.6.0",
        &format!(r#"<shape type="rectangle">{inner}</shape>"#),
    )
}

#[test]
fn weights_of_a_mixture_add_up_and_the_rest_is_absorbed() {
    let mixture = |weights: &str| {
        let one = r#"<bsdf type="diffuse"><spectrum name="reflectance" value="0.8"/></bsdf>"#;
        surface(&format!(
            r#"<bsdf type="mixturebsdf"><string name="weights" value="{weights}"/>{one}{one}</bsdf>"#
        ))
    };
    let (desc, notes) = mixture("0.5, 0.25");
    let whole = desc.materials.iter().find(|m| m.parts.len() == 3).unwrap();
    assert_eq!(whole.weights, [0.5, 0.25, 0.25]);
    let rest = desc
        .materials
        .iter()
        .find(|m| m.name == whole.parts[2])
        .unwrap();
    assert_eq!(rest.base_color, Vec3::ZERO);
    assert!(!notes.contains("weights"), "{notes}");
    let (desc, notes) = mixture("1 3");
    let whole = desc.materials.iter().find(|m| m.parts.len() == 2).unwrap();
    assert_eq!(whole.weights, [0.25, 0.75]);
    assert!(notes.contains("the weights sum to 4"), "{notes}");
}

/// The two parts drawn by their weights have the reflectances of the file together.
#[test]
fn phong_and_ward_are_a_diffuse_surface_and_a_mirror() {
    for (plugin, shape) in [
        ("phong", r#"<float name="exponent" value="50"/>"#),
        (
            "ward",
            r#"<float name="alphaU" value="0.1"/><float name="alphaV" value="0.1"/>"#,
        ),
    ] {
        let colors = |diffuse: &str, glossy: &str| {
            surface(&format!(
                r#"<bsdf type="{plugin}"><rgb name="diffuseReflectance" value="{diffuse}"/>
<rgb name="specularReflectance" value="{glossy}"/>{shape}</bsdf>"#
            ))
        };
        let parts = |desc: &SceneDesc| {
            let whole = desc.materials.iter().find(|m| m.parts.len() == 2).unwrap();
            let part = |i: usize| {
                let m = desc
                    .materials
                    .iter()
                    .find(|m| m.name == whole.parts[i])
                    .unwrap();
                (m.base_color * whole.weights[i], m.roughness)
            };
            [part(0), part(1)]
        };
        let (desc, notes) = colors("0.4, 0.2, 0.1", "0.3");
        assert!(notes.contains(plugin), "{notes}");
        let [diffuse, glossy] = parts(&desc);
        let near = |a: Vec3, b: Vec3| (a - b).abs().max_element() < 1e-6;
        assert!(near(diffuse.0, Vec3::new(0.4, 0.2, 0.1)), "{diffuse:?}");
        assert!(near(glossy.0, Vec3::splat(0.3)), "{glossy:?}");
        // alpha: sqrt(2 / (4 * 50 + 2)), and as given.
        let alpha = glossy.1 * glossy.1;
        assert!((alpha - 0.1).abs() < 1e-3, "{alpha}");
        // Together too bright: in proportion.
        let [diffuse, glossy] = parts(&colors("0.8", "0.8").0);
        assert!(near(diffuse.0, Vec3::splat(0.5)) && near(glossy.0, Vec3::splat(0.5)));
        let [diffuse, _] = parts(&colors("0.5", "0").0);
        assert!(near(diffuse.0, Vec3::splat(0.5)));
    }
}

#[test]
fn a_coating_over_a_diffuse_surface_is_a_plastic() {
    let coated = |inner: &str| {
        surface(&format!(
            r#"<bsdf type="roughcoating"><float name="alpha" value="0.2"/>
<float name="intIOR" value="1.7"/><bsdf type="{inner}"/></bsdf>"#
        ))
    };
    let (desc, notes) = coated("diffuse");
    let m = &desc.materials[0];
    assert_eq!(m.model, Model::Plastic, "{notes}");
    assert!((m.ior - 1.7 / 1.000_277).abs() < 1e-5 && (m.roughness.powi(2) - 0.2).abs() < 1e-5);
    let (desc, notes) = coated("conductor");
    assert_eq!(desc.materials[0].model, Model::Conductor);
    assert!(
        notes.contains("another surface than a diffuse one"),
        "{notes}"
    );
}

/// Radiances of Planck's law at 560 nm, near the maximum of the eye's sensitivity, by the
/// constants of the SI: 5000 K emit 1.276e4 W m^-2 sr^-1 nm^-1 there.
#[test]
fn black_bodies_are_warm_or_cold_and_as_bright_as_planck_says() {
    let emitter = |attributes: &str| {
        let (desc, notes) = surface(&format!(
            r#"<emitter type="area"><blackbody name="radiance" {attributes}/></emitter>"#
        ));
        let mut emissions = desc.materials.iter().map(|m| m.emission);
        let found = emissions.find(|e| *e != Vec3::ZERO);
        found.unwrap_or_else(|| panic!("{notes}"))
    };
    let luminance = |c: Vec3| c.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let sun = emitter(r#"temperature="5000K""#);
    assert!((luminance(sun) / 1.276e4 - 1.0).abs() < 0.05, "{sun}");
    assert!(sun.x > sun.y && sun.y > sun.z, "{sun}");
    let sky = emitter(r#"temperature="12000" scale="0.001""#);
    assert!(sky.z > sky.x && sky.z < 1e4, "{sky}");
}

/// Returns the material of every triangle of an OBJ of two faces, `Left` and `Right`, by the name of
/// its colour in `a.mtl`, in a scene of a version.
fn colors_of_faces(version: &str, inside: &str) -> (Vec<Vec3>, String) {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl Left\nf 1 2 3\nusemtl Right\nf 1 3 4\n";
    let shape =
        format!(r#"<shape type="obj"><string name="filename" value="a.obj"/>{inside}</shape>"#);
    let text = format!("<scene version=\"{version}\">{shape}</scene>");
    let mtl = "newmtl Left\nKd 1 0 0\nnewmtl Right\nKd 0 0 1\n";
    let folder = Folder::new(&[("a.xml", text.as_str()), ("a.obj", obj), ("a.mtl", mtl)]);
    let (desc, notes) = folder.load("a.xml").unwrap_or_else(|e| panic!("{e}"));
    let (scene, _) = compile(&desc).unwrap();
    let colors = scene
        .attributes
        .iter()
        .map(|a| scene.materials[a.material as usize].base_color);
    (colors.collect(), lines(&notes))
}

#[test]
fn faces_of_an_obj_have_the_surfaces_that_are_named_after_them() {
    let surface = |name: &str, color: &str| {
        format!(
            r#"<bsdf type="twosided" name="{name}"><bsdf type="diffuse"><rgb name="reflectance" value="{color}"/></bsdf></bsdf>"#
        )
    };
    let both = surface("Right", "0, 1, 0") + &surface("Left", "0, 0, 1");
    let (colors, notes) = colors_of_faces("0.6.0", &both);
    assert_eq!(colors, [Vec3::Z, Vec3::Y]);
    assert!(!notes.contains("not supported"), "{notes}");
    // A face without one has the surface of the whole shape; version 3 knows no others.
    let one = surface("", "0, 1, 0") + &surface("Left", "0, 0, 1");
    assert_eq!(colors_of_faces("0.6.0", &one).0, [Vec3::Z, Vec3::Y]);
    // Others have those of the material files.
    let left = colors_of_faces("0.6.0", &surface("Left", "0, 1, 0")).0;
    assert_eq!(left, [Vec3::Y, Vec3::Z]);
    let (any, notes) = colors_of_faces("0.6.0", &surface("any", "0, 1, 0"));
    assert_eq!(any, [Vec3::X, Vec3::Z]);
    assert!(
        notes.contains("`twosided` is not supported here"),
        "{notes}"
    );
    assert_eq!(colors_of_faces("3.0.0", &both).0, [Vec3::Y; 2]);
}

#[test]
fn an_obj_without_a_surface_has_those_of_its_material_files() {
    assert_eq!(colors_of_faces("0.6.0", "").0, [Vec3::X, Vec3::Z]);
    let grey = [Vec3::splat(0.5); 2];
    assert_eq!(colors_of_faces("3.0.0", "").0, grey);
    let off = r#"<boolean name="loadMaterials" value="False"/>"#;
    assert_eq!(colors_of_faces("0.6.0", off).0, grey);
}

#[test]
fn the_boundary_of_a_medium_is_no_surface_unless_it_has_one() {
    let medium = r#"<medium type="homogeneous" name="interior"/>"#;
    let model = |version: &str, rest: &str| {
        let (desc, notes) = read(
            version,
            &format!(r#"<shape type="sphere">{medium}{rest}</shape>"#),
        );
        assert!(notes.contains("medium"), "{notes}");
        (desc.materials[0].model, desc.materials[0].ior)
    };
    assert_eq!(model("0.6.0", ""), (Model::Dielectric, 1.0));
    assert_eq!(
        model("0.6.0", r#"<bsdf type="diffuse"/>"#).0,
        Model::Lambert
    );
    assert_eq!(model("3.0.0", "").0, Model::Lambert);
}

#[test]
fn both_names_of_a_diffuse_reflectance_are_known() {
    let (desc, notes) = read(
        "0.6.0",
        r#"<shape type="rectangle"><bsdf type="diffuse"><rgb name="diffuseReflectance" value="0.1, 0.2, 0.3"/></bsdf></shape>"#,
    );
    assert_eq!(desc.materials[0].base_color, Vec3::new(0.1, 0.2, 0.3));
    assert!(!notes.contains("diffuse_reflectance"), "{notes}");
}
