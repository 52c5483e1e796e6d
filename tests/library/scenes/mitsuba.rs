//! Small Mitsuba scenes that use every supported plugin, and the scenes that they become.

use glam::{Vec2, Vec3};
use lumbre_light::scene::compile;
use lumbre_light::scene::compile::{NONE, Uv, Wrap};
use lumbre_light::scene::desc::{
    ConeEdge, Distribution, EnvironmentSource, Formulas, LightKind, MaskMode, MaterialDesc, Model,
    SceneDesc, ShapeDesc, TextureSlot,
};

use lumbre_light::transport::arrival::HitState;
use lumbre_light::transport::ray::{Hit, Ray};

use super::{Folder, lines, mesh_of};

/// Returns a scene with a sensor around some XML.
fn around(inner: &str) -> String {
    format!(
        r#"<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/>
<transform name="to_world"><lookat origin="0, 1, 5" target="0, 1, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="32"/></film></sensor>
{inner}</scene>"#
    )
}

/// Reads a scene around some XML, beside the image `grey.png`.
fn read(inner: &str) -> (SceneDesc, String) {
    let folder = Folder::new(&[("a.xml", &around(inner))]);
    let grey = image::GrayImage::from_fn(2, 2, |x, _| image::Luma([100 * x as u8]));
    grey.save(folder.path("grey.png")).unwrap();
    let (desc, notes) = folder.load("a.xml").unwrap_or_else(|e| panic!("{e}"));
    (desc, lines(&notes))
}

fn refused(inner: &str) -> String {
    Folder::new(&[("a.xml", &around(inner))])
        .load("a.xml")
        .unwrap_err()
        .to_string()
}

/// Returns the material `s` of some XML, and the notes.
pub fn surface(xml: &str) -> (MaterialDesc, String) {
    let (desc, notes) = read(&format!(
        "{xml}<shape type=\"rectangle\"><ref id=\"s\"/></shape>"
    ));
    let m = desc.materials[desc.material_index("s").unwrap()].clone();
    (m, notes)
}

#[test]
fn the_camera_has_its_position_and_its_vertical_field_of_view() {
    let (desc, notes) = read("");
    assert_eq!(desc.resolution, [64, 32]);
    assert_eq!(desc.camera.position, Vec3::new(0.0, 1.0, 5.0));
    assert!((desc.camera.target - desc.camera.position - Vec3::NEG_Z).length() < 1e-6);
    // tan(fov_y / 2) = tan(20 degrees) / 2 for a picture twice as wide as high.
    let expected = 2.0 * (20f32.to_radians().tan() / 2.0).atan().to_degrees();
    assert!(
        (desc.camera.view_deg() - expected).abs() < 1e-4,
        "{}",
        desc.camera.view_deg()
    );
    assert!(notes.is_empty(), "{notes}");
    // Without either a focal length of 50 mm is used.
    let none = around("").replace("<float name=\"fov\" value=\"40\"/>", "");
    let (desc, _) = Folder::new(&[("a.xml", &none)]).load("a.xml").unwrap();
    let half = 36f32.hypot(24.0) / 100.0 / 5f32.sqrt();
    assert!((desc.camera.view_deg() - 2.0 * half.atan().to_degrees()).abs() < 1e-3);
    let lens = around("").replace("perspective", "thinlens").replace(
        "<float name=\"fov\" value=\"40\"/>",
        "<string name=\"focalLength\" value=\"50mm\"/><float name=\"apertureRadius\" value=\"0.5\"/>\
         <float name=\"focusDistance\" value=\"3\"/><string name=\"fovAxis\" value=\"x\"/>",
    );
    let (desc, _) = Folder::new(&[("a.xml", &lens)]).load("a.xml").unwrap();
    assert_eq!(
        (desc.camera.lens_diameter(), desc.camera.focus_distance),
        (1.0, Some(3.0))
    );
    // The diagonal of 36 x 24 mm at 50 mm, of which the height is 1 / sqrt 5 here.
    assert!((desc.camera.view_deg() - 2.0 * half.atan().to_degrees()).abs() < 1e-3);
}

#[test]
fn transforms_apply_their_steps_in_order() {
    let (desc, notes) = read(
        r#"<shape type="sphere" id="ball"><point name="center" x="1"/><float name="radius" value="2"/>
<transform name="toWorld"><scale value="3"/><rotate y="1" angle="90"/><translate x="10"/></transform></shape>"#,
    );
    assert!(notes.contains("toWorld") || notes.is_empty(), "{notes}");
    let (scene, _) = compile(&desc).unwrap();
    // (1, 0, 0) -> (3, 0, 0) -> (0, 0, -3) -> (10, 0, -3).
    assert!(
        (scene.spheres[0].center - Vec3::new(10.0, 0.0, -3.0)).length() < 1e-4,
        "{}",
        scene.spheres[0].center
    );
    assert!((scene.spheres[0].radius - 6.0).abs() < 1e-4);
    let (desc, notes) = read(
        "<shape type=\"sphere\"><transform name=\"to_world\"><scale y=\"2\"/></transform></shape>",
    );
    assert!(
        matches!(desc.entities[0].shape, ShapeDesc::Mesh(_)) && notes.contains("becomes a mesh"),
        "{notes}"
    );
}

#[test]
fn bsdf_plugins_become_the_matching_models() {
    let (m, notes) = surface(
        r##"<bsdf type="twosided" id="s"><bsdf type="diffuse"><rgb name="reflectance" value="#ff8000"/></bsdf></bsdf>"##,
    );
    assert_eq!(
        (m.model, m.base_color.x, m.base_color.z),
        (Model::Lambert, 1.0, 0.0)
    );
    assert!(
        (m.base_color.y - 0.215_86).abs() < 1e-4 && notes.is_empty(),
        "{} {notes}",
        m.base_color
    );
    let (m, notes) = surface(
        r#"<bsdf type="roughconductor" id="s"><string name="material" value="Cu"/><float name="alpha" value="0.25"/>
<string name="distribution" value="ggx"/><rgb name="specular_reflectance" value="0.3"/></bsdf>"#,
    );
    assert_eq!(
        (m.model, m.roughness, m.distribution),
        (Model::Conductor, 0.5, Distribution::Ggx)
    );
    assert_eq!(
        (m.eta, m.base_color),
        (Vec3::new(0.200438, 0.924033, 1.10221), Vec3::splat(0.3))
    );
    assert!(m.one_sided && notes.is_empty(), "{notes}");
    let (m, _) = surface(r#"<bsdf type="conductor" id="s"/>"#);
    assert_eq!(
        (m.roughness, m.eta, m.k),
        (0.0, Vec3::ZERO, Vec3::ONE),
        "a perfect mirror"
    );
    let (m, notes) = surface(
        r#"<bsdf type="roughdielectric" id="s"><float name="intIOR" value="2"/><string name="extIOR" value="water"/></bsdf>"#,
    );
    assert_eq!(
        (m.model, m.distribution, m.ior),
        (
            Model::Dielectric,
            Distribution::Beckmann,
            (2.0 / 1.333) as f32
        )
    );
    assert!(
        (m.roughness - 0.1f32.sqrt()).abs() < 1e-6 && notes.is_empty(),
        "{notes}"
    );
    assert!(surface(r#"<bsdf type="thindielectric" id="s"/>"#).0.thin);
    let (m, _) = surface(
        r#"<bsdf type="roughplastic" id="s"><rgb name="diffuse_reflectance" value="0.1, 0.2, 0.3"/>
<boolean name="nonlinear" value="true"/><float name="alpha_u" value="0.4"/><float name="alpha_v" value="0.1"/></bsdf>"#,
    );
    assert_eq!(
        (m.model, m.nonlinear, m.base_color),
        (Model::Plastic, true, Vec3::new(0.1, 0.2, 0.3))
    );
    assert!(
        (m.roughness - 0.2f32.sqrt()).abs() < 1e-6 && (m.anisotropic - 0.75 / 0.9).abs() < 1e-6
    );
    // Formulas of Mitsuba where they differ, and a material like any other where they agree.
    assert_eq!(m.formulas, Formulas::Mitsuba);
    for (inner, formulas) in [
        ("", Formulas::Lumbre),
        (
            r#"<float name="clearcoat" value="0.5"/>"#,
            Formulas::Mitsuba,
        ),
        (
            r#"<float name="spec_tint" value="0.5"/>"#,
            Formulas::Mitsuba,
        ),
    ] {
        let (m, notes) = surface(&format!(r#"<bsdf type="principled" id="s">{inner}</bsdf>"#));
        assert_eq!((m.formulas, notes.as_str()), (formulas, ""), "{inner}");
    }
    let (m, notes) = surface(
        r#"<bsdf type="principled" id="s"><rgb name="base_color" value="0.2"/><float name="metallic" value="0.7"/>
<float name="spec_trans" value="0.25"/><float name="specular" value="0.5"/><float name="sheen" value="2"/></bsdf>"#,
    );
    assert_eq!(
        (m.model, m.metallic, m.opacity, m.sheen),
        (Model::Disney, 0.7, 0.75, 1.0)
    );
    assert!(
        (m.ior - 1.5).abs() < 1e-6 && notes.contains("`sheen` is 2"),
        "{} {notes}",
        m.ior
    );
    let (m, _) = surface(
        r#"<bsdf type="mask" id="s"><float name="opacity" value="0.25"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf>"#,
    );
    assert!(m.mask_mode == MaskMode::Blend && m.texture(TextureSlot::Mask).is_some());
    assert!(!m.one_sided, "it is two-sided inside of the mask");
    assert_eq!(m.base_color, Vec3::splat(0.5));
    let (m, notes) = surface(
        r#"<bsdf type="bumpmap" id="s"><texture type="bitmap" name="any"><string name="filename" value="grey.png"/><transform name="to_uv"><scale value="4"/></transform>
</texture><float name="scale" value="0.02"/><bsdf type="twosided"><bsdf type="roughplastic"/></bsdf></bsdf>"#,
    );
    assert_eq!(
        (m.model, m.bump_height, m.tiling),
        (Model::Plastic, 0.02, 4.0)
    );
    assert!(
        m.texture(TextureSlot::Bump).is_some()
            && m.formulas == Formulas::Mitsuba
            && notes.contains("by up to 1 %"),
        "{notes}"
    );
    let (m, notes) = surface(
        r#"<bsdf type="bumpmap" id="s"><texture type="checkerboard"/><bsdf type="diffuse"/></bsdf>"#,
    );
    assert!(m.textures.is_empty() && notes.contains("has no slopes"));
    let (m, notes) = surface(r#"<bsdf type="hair" id="s"><float name="x" value="1"/></bsdf>"#);
    assert!(
        m.model == Model::Lambert && notes.contains("`hair` is not supported"),
        "{notes}"
    );
}

#[test]
fn a_blend_is_composed_of_its_two_surfaces() {
    let (desc, notes) = read(
        r#"<bsdf type="bumpmap" id="s"><texture type="bitmap" name="any"><string name="filename" value="grey.png"/></texture>
<bsdf type="blendbsdf"><float name="weight" value="0.25"/>
<bsdf type="twosided"><bsdf type="diffuse"/></bsdf><bsdf type="conductor"/></bsdf></bsdf>
<bsdf type="blendbsdf" id="t"><texture type="checkerboard" name="weight"/>
<ref id="s"/><bsdf type="diffuse"/></bsdf>"#,
    );
    assert!(notes.contains("perfectly smooth lobe"), "{notes}");
    let [first, second, whole] =
        ["s_1", "s_2", "s"].map(|name| &desc.materials[desc.material_index(name).unwrap()]);
    assert_eq!(whole.parts, ["s_1", "s_2"]);
    assert_eq!(whole.weights, [0.75, 0.25]);
    assert_eq!(
        [first.model, second.model],
        [Model::Lambert, Model::Conductor]
    );
    assert!(!first.one_sided && second.one_sided);
    assert!(
        [first, second]
            .iter()
            .all(|m| m.texture(TextureSlot::Bump).is_some())
    );
    let textured = &desc.materials[desc.material_index("t").unwrap()];
    assert!(textured.texture(TextureSlot::Weights).is_some() && textured.parts.len() == 2);
    let (scene, _) = compile(&desc).unwrap();
    let root = desc.material_index("t").unwrap() as u32;
    let leaf = |u: f32, weight: f32| {
        let (m, _) = scene.delays.choose_component(root, || u, |_| weight);
        desc.materials[m as usize].name.as_str()
    };
    // The second surface has the weight of the texture; the first is itself a blend.
    assert_eq!(
        [leaf(0.95, 0.1), leaf(0.6, 0.1), leaf(0.8, 0.1)],
        ["t_2", "t_1_1", "t_1_2"]
    );
    assert_eq!(scene.delays.leaves(root).len(), 3);
    let one = refused(r#"<bsdf type="blendbsdf" id="s"><bsdf type="diffuse"/></bsdf>"#);
    assert!(one.contains("exactly two surfaces"), "{one}");
}

#[test]
fn the_integrator_inside_of_another_limits_paths() {
    let depth = |xml: &str| {
        let (desc, notes) = read(xml);
        (desc.max_depth, notes.contains("unlimited"))
    };
    let path = r#"<integrator type="path"><integer name="max_depth" value="4"/></integrator>"#;
    assert_eq!(depth(path), (4, false));
    let aov = format!(
        r#"<integrator type="aov"><string name="aovs" value="dd:depth"/>{path}</integrator>"#
    );
    assert_eq!(depth(&aov), (4, false));
    assert_eq!(depth(r#"<integrator type="direct"/>"#), (2, false));
    assert!(depth(r#"<integrator type="path"/>"#).1);
}

#[test]
fn a_spectrum_may_be_an_image_or_have_any_form_of_samples() {
    let color = |spectrum: &str| {
        let (m, notes) = surface(&format!(r#"<bsdf type="diffuse" id="s">{spectrum}</bsdf>"#));
        assert!(!notes.contains("not supported"), "{notes}");
        m
    };
    let image = color(
        r#"<spectrum type="bitmap" name="reflectance"><string name="filename" value="grey.png"/></spectrum>"#,
    );
    assert!(image.texture(TextureSlot::BaseColor).is_some());
    let plain = |spectrum: &str| color(spectrum).base_color;
    let pairs = plain(r#"<spectrum name="reflectance" value="400:0.1, 500:0.6, 600:0.3"/>"#);
    let irregular = r#"<spectrum type="irregular" name="reflectance"><string name="wavelengths" value="400, 500, 600"/><string name="values" value="0.1, 0.6, 0.3"/></spectrum>"#;
    assert_eq!(plain(irregular), pairs);
    let regular = r#"<spectrum type="regular" name="reflectance"><float name="wavelength_min" value="400"/><float name="wavelength_max" value="600"/><string name="values" value="0.1 0.6 0.3"/></spectrum>"#;
    assert_eq!(plain(regular), pairs);
    let srgb = r#"<spectrum type="srgb" name="reflectance"><rgb name="color" value="0.1, 0.2, 0.3"/></spectrum>"#;
    assert_eq!(plain(srgb), Vec3::new(0.1, 0.2, 0.3));
    let (one, _) = read(
        r#"<emitter type="constant"><spectrum type="blackbody" name="radiance"><float name="temperature" value="3000"/></spectrum></emitter>"#,
    );
    let (other, _) = read(
        r#"<emitter type="constant"><blackbody name="radiance" temperature="3000K"/></emitter>"#,
    );
    assert_eq!(
        one.environment.unwrap().source,
        other.environment.unwrap().source
    );
    let few = r#"<bsdf type="diffuse" id="s"><spectrum type="regular" name="reflectance"><string name="values" value="1"/></spectrum></bsdf>"#;
    assert!(refused(few).contains("wavelength_min"), "{}", refused(few));
    let tinted = r#"<spectrum type="d65" name="reflectance"><rgb name="color" value="0.2, 0.4, 0.6"/><float name="scale" value="0.5"/></spectrum>"#;
    assert_eq!(plain(tinted), Vec3::new(0.1, 0.2, 0.3));
    let unknown = r#"<bsdf type="diffuse" id="s"><spectrum type="any" name="reflectance"/></bsdf>"#;
    assert!(refused(unknown).contains("the spectrum `any` is not supported"));
    let back = r#"<bsdf type="diffuse" id="s"><spectrum type="irregular" name="reflectance"><string name="wavelengths" value="500, 400"/><string name="values" value="1, 1"/></spectrum></bsdf>"#;
    assert!(refused(back).contains("that grow"));
    let odd = r#"<bsdf type="diffuse" id="s"><spectrum type="irregular" name="reflectance"><string name="wavelengths" value="400, 500"/><string name="values" value="1"/></spectrum></bsdf>"#;
    assert!(
        refused(odd).contains("as many wavelengths"),
        "{}",
        refused(odd)
    );
}

#[test]
fn comments_with_hyphens_and_flags_in_any_case_are_read() {
    let (desc, _) = read(
        r#"<!-- two -- hyphens, and three ---><shape type="rectangle"><boolean name="flip_normals" value="True"/></shape>"#,
    );
    assert_eq!(desc.entities.len(), 1);
    let error = refused(
        "<!-- a -- b -->\n<shape type=\"rectangle\"><boolean name=\"flip_normals\" value=\"yes\"/></shape>",
    );
    assert!(
        error.contains("line 5") && error.contains("true or false"),
        "{error}"
    );
}

#[test]
fn colours_of_a_ply_may_be_numbered() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               property float color_0\nproperty float color_1\nproperty float color_2\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n0 0 0 1 0 0\n1 0 0 0 1 0\n0 1 0 0 0 1\n3 0 1 2\n";
    let xml = around(
        r#"<shape type="ply"><string name="filename" value="a.ply"/><bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance"><string name="name" value="vertex_color"/></texture></bsdf></shape>"#,
    );
    let (desc, notes) = Folder::new(&[("a.xml", xml.as_str()), ("a.ply", ply)])
        .load("a.xml")
        .unwrap();
    assert_eq!(mesh_of(&desc, 0).colors, [Vec3::X, Vec3::Y, Vec3::Z]);
    assert!(!lines(&notes).contains("no colours"), "{notes:?}");
}

#[test]
fn each_side_of_a_twosided_surface_may_have_its_own() {
    let (desc, notes) = read(
        r#"<bsdf type="twosided" id="s"><bsdf type="diffuse"/><bsdf type="roughconductor"/></bsdf>
<shape type="rectangle"><ref id="s"/></shape>
<shape type="sphere"><ref id="s"/><point name="center" x="10" y="0" z="0"/></shape>
<shape type="rectangle"><ref id="s"/>
<transform name="to_world"><scale x="-1"/><translate x="20"/></transform></shape>"#,
    );
    assert!(!notes.contains("surfaces of"), "{notes}");
    let (scene, _) = compile(&desc).unwrap();
    let triangles = scene.triangles.len() as u32;
    assert_eq!((triangles, scene.spheres.len()), (4, 1));
    let part = |primitive: u32, x: f32, z: f32, t: f32| {
        let ray = Ray {
            origin: Vec3::new(x, 0.0, z),
            dir: Vec3::new(0.0, 0.0, -z.signum()),
        };
        let hit = Hit {
            t,
            primitive,
            instance: NONE,
            uv: [0.5, 0.5],
        };
        let state = HitState::new(&scene, &ray, &hit, || 0.3);
        desc.materials[state.material as usize].name.as_str()
    };
    // From the front and from behind; the last rectangle is mirrored, which keeps its front.
    for (primitive, x) in [(0, 0.0), (1, 0.0), (2, 20.0), (3, 20.0)] {
        let sides = [5.0, -5.0].map(|z| part(primitive, x, z, 5.0));
        assert_eq!(sides, ["s_1", "s_2"], "{primitive}");
    }
    // From outside and from within.
    let sides = [4.0, 6.0].map(|t| part(triangles, 10.0, 5.0, t));
    assert_eq!(sides, ["s_1", "s_2"]);
    let three = read(
        r#"<bsdf type="twosided" id="s"><bsdf type="diffuse"/><bsdf type="diffuse"/><bsdf type="diffuse"/></bsdf>"#,
    );
    assert!(
        three.1.contains("only the first of the 3 surfaces"),
        "{}",
        three.1
    );
}

#[test]
fn a_light_without_a_surface_is_black_and_a_shape_without_one_is_grey_at_its_front() {
    let (desc, _) =
        read(r#"<shape type="rectangle"><emitter type="area"/></shape><shape type="rectangle"/>"#);
    let material = |i: usize| {
        let name = desc.entities[i].material.as_deref().unwrap();
        &desc.materials[desc.material_index(name).unwrap()]
    };
    assert!(material(0).emission == Vec3::ONE && !material(0).emitter_reflects);
    assert!(material(1).one_sided && material(1).base_color == Vec3::splat(0.5));
}

#[test]
fn textured_and_anisotropic_spheres_have_the_coordinates_of_mitsuba() {
    let sphere = |surface: &str| {
        let (desc, notes) = read(&format!(
            r#"<shape type="sphere"><float name="radius" value="2"/>{surface}</shape>"#
        ));
        let is_mesh = matches!(desc.entities[0].shape, ShapeDesc::Mesh(_));
        assert_eq!(is_mesh, notes.contains("becomes a mesh"), "{notes}");
        is_mesh
    };
    assert!(!sphere(r#"<bsdf type="diffuse"/>"#));
    assert!(sphere(
        r#"<bsdf type="diffuse"><texture type="checkerboard" name="reflectance"/></bsdf>"#
    ));
    assert!(sphere(
        r#"<bsdf type="principled"><float name="anisotropic" value="0.5"/></bsdf>"#
    ));
    assert!(sphere(
        r#"<emitter type="area"><texture type="checkerboard" name="radiance"/></emitter>"#
    ));
}

#[test]
fn emitters_are_read_with_their_parameters() {
    let (desc, notes) = read(
        r#"<bsdf type="twosided" id="white"><bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf></bsdf>
<shape type="rectangle" id="lamp"><ref id="white"/><emitter type="area"><rgb name="radiance" value="1, 2, 3"/></emitter></shape>
<shape type="rectangle" id="wall"><ref id="white"/></shape>
<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>
<emitter type="point"><point name="position" x="1" y="2" z="3"/><rgb name="intensity" value="4"/></emitter>
<emitter type="directional" id="sun"><vector name="direction" value="0, -1, 0"/></emitter>
<emitter type="spot" id="beam"><float name="cutoff_angle" value="40"/><rgb name="intensity" value="5"/>
<transform name="to_world"><lookat origin="1, 2, 3" target="1, 0, 3" up="1, 0, 0"/></transform></emitter>
<emitter type="volumelight"/>"#,
    );
    assert_eq!(desc.entities[0].material.as_deref(), Some("lamp_light"));
    let lamp = &desc.materials[desc.material_index("lamp_light").unwrap()];
    assert_eq!(
        (lamp.emission, lamp.base_color),
        (Vec3::new(1.0, 2.0, 3.0), Vec3::splat(0.8))
    );
    assert_eq!(desc.entities[1].material.as_deref(), Some("white"));
    assert_eq!(
        desc.environment.as_ref().unwrap().source,
        EnvironmentSource::Color(Vec3::splat(0.5))
    );
    assert!(
        matches!(desc.lights[0].kind, LightKind::Point { position, .. } if position == Vec3::new(1.0, 2.0, 3.0))
    );
    assert_eq!(desc.lights[1].name, "sun");
    assert!(
        notes.contains("the light `volumelight` is not supported"),
        "{notes}"
    );
    let LightKind::Spot {
        position,
        direction,
        intensity,
        cone,
        image: None,
    } = desc.lights[2].kind
    else {
        panic!()
    };
    assert_eq!(
        (position, intensity),
        (Vec3::new(1.0, 2.0, 3.0), Vec3::splat(5.0))
    );
    assert!((direction - Vec3::NEG_Y).length() < 1e-6);
    assert_eq!(
        (cone.beam_deg, cone.cutoff_deg, cone.edge),
        (30.0, 40.0, ConeEdge::Linear)
    );
    let (scene, _) = compile(&desc).unwrap();
    assert_eq!((scene.emitters.len(), scene.triangles.len()), (2, 4));
    // The rectangle faces +z.
    let [a, b, c] = scene.triangles[0];
    assert!((b - a).cross(c - a).z > 0.0);
}

#[test]
fn variables_includes_references_and_old_spellings_are_resolved() {
    let folder = Folder::new(&[
        (
            "a.xml",
            r#"<scene version="0.5.0"><default name="d" value="7"/><default name="depth" value="9"/>
<integrator type="$kind"><integer name="maxDepth" value="$depth"/></integrator><default name="kind" value="x"/></scene>"#,
        ),
        (
            "b.xml",
            r#"<scene version="3.0.0"><default name="d" value="7"/><default name="depth" value="9"/><default name="depth" value="3"/>
<include filename="more/c.xml"/><integrator type="path"><integer name="max_depth" value="$depth"/></integrator>
<alias id="red" as="rot"/><shape type="cube"><ref id="rot"/></shape></scene>"#,
        ),
        (
            "round.xml",
            r#"<scene version="3.0.0"><include filename="round.xml"/></scene>"#,
        ),
    ]);
    let e = folder.load("a.xml").unwrap_err().to_string();
    assert!(
        e.contains("a.xml") && e.contains("line 2") && e.contains("$kind"),
        "{e}"
    );
    std::fs::create_dir(folder.path("more")).unwrap();
    folder.write("more/c.xml", r#"<scene version="3.0.0"><bsdf type="diffuse" id="red"/><shape type="obj"><string name="filename" value="q.obj"/></shape></scene>"#);
    folder.write("more/q.obj", super::QUAD);
    let (desc, _) = folder.load("b.xml").unwrap();
    assert_eq!((desc.max_depth, desc.entities.len()), (9, 2));
    assert_eq!(desc.entities[1].material.as_deref(), Some("red"));
    assert_eq!(
        desc.entities[0].name, "q",
        "the mesh lies beside the file that names it"
    );
    assert!(
        folder
            .load("round.xml")
            .unwrap_err()
            .to_string()
            .contains("cycle")
    );
}

#[test]
fn instances_share_their_meshes() {
    let (desc, notes) = read(
        r#"<bsdf type="dielectric" id="g"/>
<shape type="shapegroup" id="tree"><shape type="cube"><ref id="g"/></shape><shape type="sphere"><ref id="g"/></shape></shape>
<shape type="instance"><ref id="tree"/><transform name="to_world"><translate x="5"/></transform></shape>
<shape type="instance"><ref id="tree"/><transform name="to_world"><scale value="2"/></transform></shape>"#,
    );
    assert!(notes.is_empty(), "{notes}");
    assert_eq!(desc.entities.len(), 4);
    let (scene, _) = compile(&desc).unwrap();
    assert_eq!((scene.triangles.len(), scene.spheres.len()), (24, 2));
    assert_eq!(
        (scene.spheres[0].center.x, scene.spheres[1].radius),
        (5.0, 2.0)
    );
}

#[test]
fn bitmaps_have_the_orientation_of_mitsuba() {
    // The bitmap is red on top and green below. Its top is at the least y of a rectangle, and at
    // the greatest v of an OBJ.
    let folder = Folder::new(&[(
        "q.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    )]);
    let mut image = image::RgbImage::from_pixel(2, 4, image::Rgb([255, 0, 0]));
    (0..2).for_each(|x| (2..4).for_each(|y| image.put_pixel(x, y, image::Rgb([0, 255, 0]))));
    image.save(folder.path("t.png")).unwrap();
    let texture = |more: &str| {
        format!(
            r#"<bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="filename" value="t.png"/>{more}</texture></bsdf>"#
        )
    };
    let color_at = |shape: &str, more: &str, corner: usize| {
        let rest = if shape == "obj" {
            "<string name=\"filename\" value=\"q.obj\"/>"
        } else {
            ""
        };
        folder.write(
            "a.xml",
            around(&format!(
                "<shape type=\"{shape}\">{rest}{}</shape>",
                texture(more)
            )),
        );
        let (scene, _) = compile(&folder.load("a.xml").unwrap().0).unwrap();
        let m = &scene.materials[scene.attributes[0].material as usize];
        // A point slightly inside the bitmap, where it does not repeat.
        let uvs = scene.uvs[0];
        let uv = uvs[corner].lerp((uvs[0] + uvs[1] + uvs[2]) / 3.0, 0.3);
        let texture = &scene.textures[m.base_color_texture as usize];
        let c = texture.filtered(texture.image_uv(Uv::same(uv), m.tiling));
        if c.x > c.y { "red" } else { "green" }
    };
    assert_eq!(
        (color_at("rectangle", "", 0), color_at("rectangle", "", 2)),
        ("red", "green")
    );
    assert_eq!(
        (color_at("obj", "", 0), color_at("obj", "", 2)),
        ("green", "red")
    );
    // The bitmap is flipped by a negative factor on v alone, and on both coordinates.
    let over =
        "<transform name=\"to_uv\"><scale x=\"1\" y=\"-1\"/><translate y=\"1\"/></transform>";
    assert_eq!(
        (
            color_at("rectangle", over, 0),
            color_at("rectangle", over, 2)
        ),
        ("green", "red")
    );
    let turned = "<transform name=\"to_uv\"><scale x=\"-1\" y=\"-1\"/></transform>";
    assert_eq!(
        (
            color_at("rectangle", turned, 0),
            color_at("rectangle", turned, 2)
        ),
        ("green", "red")
    );
}

#[test]
fn texture_coordinates_of_meshes_are_flipped_as_the_shape_says() {
    let folder = Folder::new(&[(
        "q.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 0.75\nf 1/1 2/2 3/3\n",
    )]);
    let heights = |flag: &str| {
        let file = "<string name=\"filename\" value=\"q.obj\"/>";
        let shape = format!("<shape type=\"obj\">{file}{flag}</shape>");
        folder.write("a.xml", around(&shape));
        let (scene, _) = folder.load("a.xml").unwrap();
        let mesh = mesh_of(&scene, 0);
        mesh.uvs.iter().map(|uv| uv.y).collect::<Vec<f32>>()
    };
    let default = heights("");
    let flag = |value| format!("<boolean name=\"flip_tex_coords\" value=\"{value}\"/>");
    assert_eq!(heights(&flag(true)), default);
    let other: Vec<f32> = default.iter().map(|v| 1.0 - v).collect();
    assert_eq!(heights(&flag(false)), other);
}

/// Compares bitmaps of one surface, each with its own transform and wrap mode, with Mitsuba's
/// coordinates, which start at the top left.
#[test]
fn bitmaps_follow_their_own_to_uv_and_wrap_mode() {
    let bitmap = |name: &str, steps: &str, more: &str| {
        format!(
            "<texture type=\"bitmap\" name=\"{name}\"><string name=\"filename\" value=\"t.png\"/>{more}\
             <transform name=\"to_uv\">{steps}</transform></texture>"
        )
    };
    let even = "<scale value=\"2\"/><translate x=\"0.25\" y=\"0.5\"/>";
    let uneven = "<scale x=\"2\" y=\"3\"/><rotate z=\"1\" angle=\"90\"/><translate x=\"0.25\"/>";
    let clamp = "<string name=\"wrap_mode\" value=\"clamp\"/>";
    type Step = fn(Vec2) -> Vec2;
    let steps: [Step; 2] = [
        |p| p * 2.0 + Vec2::new(0.25, 0.5),
        |p| Vec2::new(0.25 - 3.0 * p.y, 2.0 * p.x),
    ];
    for ([first, second], [one, other]) in [
        ([even, uneven], steps),
        ([uneven, even], [steps[1], steps[0]]),
        ([uneven, uneven], [steps[1]; 2]),
    ] {
        let xml = format!(
            "<bsdf type=\"principled\" id=\"s\">{}{}</bsdf>",
            bitmap("base_color", first, ""),
            bitmap("roughness", second, clamp)
        );
        let folder = Folder::new(&[(
            "a.xml",
            &around(&format!(
                "{xml}<shape type=\"rectangle\"><ref id=\"s\"/></shape>"
            )),
        )]);
        image::RgbImage::new(2, 2)
            .save(folder.path("t.png"))
            .unwrap();
        let (desc, notes) = folder.load("a.xml").unwrap();
        assert!(!lines(&notes).contains("texture"), "{}", lines(&notes));
        let (scene, _) = compile(&desc).unwrap();
        let m = &scene.materials[scene.attributes[0].material as usize];
        let of = |texture: u32| &scene.textures[texture as usize];
        assert_eq!(of(m.base_color_texture).lookup.wrap, [Wrap::Repeat; 2]);
        assert_eq!(of(m.roughness_texture).lookup.wrap, [Wrap::Clamp; 2]);
        for uv in [Vec2::ZERO, Vec2::new(0.3, 0.9), Vec2::new(-1.5, 2.0)] {
            let turned = |uv: Vec2| Vec2::new(uv.x, 1.0 - uv.y);
            for (texture, step) in [(m.base_color_texture, one), (m.roughness_texture, other)] {
                let (found, expected) = (
                    of(texture).image_uv(Uv::same(uv), m.tiling),
                    turned(step(turned(uv))),
                );
                assert!(
                    (found - expected).length() < 1e-5,
                    "{first} {second}: {found} instead of {expected}"
                );
            }
        }
    }
}

#[test]
fn unsupported_elements_are_noted_and_errors_name_their_line() {
    let (_, notes) = read(
        r#"<shape type="cube"><float name="wobble" value="1"/><medium type="homogeneous" name="interior"/></shape>
<shape type="hairball"/><integrator type="path"><boolean name="hide_emitters" value="true"/></integrator>"#,
    );
    for expected in [
        "`wobble` of the shape `cube`",
        "medium `homogeneous`",
        "shape `hairball`",
        "hide_emitters",
        "unlimited path length",
    ] {
        assert!(notes.contains(expected), "{expected}: {notes}");
    }
    for (xml, expected) in [
        (
            "<shape type=\"cube\"><ref id=\"unknown\"/></shape>",
            "the id `unknown`",
        ),
        (
            "<shape type=\"sphere\"><float name=\"radius\" value=\"-1\"/></shape>",
            "positive radius",
        ),
        (
            "<shape type=\"sphere\"><float name=\"radius\" value=\"x\"/></shape>",
            "`x` is not a number",
        ),
        (
            "<shape type=\"sphere\"><string name=\"radius\" value=\"1\"/></shape>",
            "expected a finite number",
        ),
        (
            "<shape type=\"obj\"><string name=\"filename\" value=\"../../etc/none.obj\"/></shape>",
            "none.obj",
        ),
        (
            "<bsdf type=\"conductor\"><string name=\"material\" value=\"Xx\"/></bsdf>",
            "Ag, Al, Au",
        ),
        (
            "<bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"no.png\"/></texture></bsdf>",
            "pass `--lenient` to use the material's constant value",
        ),
        (
            "<bsdf type=\"dielectric\"><float name=\"int_ior\" value=\"0\"/></bsdf>",
            "int_ior",
        ),
        (
            "<bsdf type=\"diffuse\" id=\"a\"/><bsdf type=\"diffuse\" id=\"a\"/>",
            "two objects",
        ),
        ("<wobble/>", "`wobble` is not an element"),
        (
            "<shape type=\"cube\"><transform name=\"to_world\"><matrix value=\"1 2\"/></transform></shape>",
            "16 numbers",
        ),
        (
            "<emitter type=\"point\"><rgb name=\"intensity\" value=\"-1\"/></emitter>",
            "intensity",
        ),
        (
            "<shape type=\"cube\"><emitter type=\"point\"/></shape>",
            "must be `area`",
        ),
    ] {
        let e = refused(xml);
        assert!(
            e.contains(expected) && e.contains("line 4") && e.contains("a.xml"),
            "{xml}: {e}"
        );
    }
}
