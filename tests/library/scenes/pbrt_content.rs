//! Materials, textures and lights of pbrt: values by hand from the file format and the book of
//! version 4, and from the source of version 3.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use lumbre_light::scene::compile;
use lumbre_light::scene::compile::Uv;
use lumbre_light::scene::desc::{
    ConeEdge, EntityDesc, EnvironmentSource, LightKind, MaskMode, MaterialDesc, Model,
    RoughnessTexels, SceneDesc, TextureFilter, TextureSlot, Wrap,
};
use lumbre_light::transport::light::{LightId, LightPoint, Lights};

use super::mesh_of;
use super::pbrt::{TRIANGLE, VIEW, read, read_files, read_v3, refused};
use super::samples::picture;

/// Returns the material of the first shape of a world with this material.
fn material(text: &str, old: bool) -> (MaterialDesc, String) {
    let world = format!("{text}\nShape \"sphere\"\n");
    let (desc, notes) = if old { read_v3(&world) } else { read(&world) };
    let name = desc.entities[0].material.clone().unwrap();
    (
        desc.materials[desc.material_index(&name).unwrap()].clone(),
        notes,
    )
}

#[test]
fn materials_become_the_nearest_models() {
    let (m, notes) = material(
        "Material \"diffuse\" \"rgb reflectance\" [0.1 0.2 0.3]",
        false,
    );
    assert_eq!(
        (m.model, m.base_color),
        (Model::Lambert, Vec3::new(0.1, 0.2, 0.3))
    );
    assert!(notes.is_empty() && !m.one_sided, "{notes}");
    // Alpha is the square root of the roughness, and the square of ours.
    let (m, notes) = material("Material \"conductor\" \"float roughness\" 0.0625", false);
    assert_eq!((m.model, m.roughness), (Model::Conductor, 0.5));
    assert!(
        (m.eta - Vec3::new(0.1045, 0.9782, 1.2047))
            .abs()
            .max_element()
            < 1e-3,
        "{}",
        m.eta
    );
    assert!(notes.is_empty(), "{notes}");
    let (m, _) = material(
        "Material \"conductor\" \"float uroughness\" 0.4 \"float vroughness\" 0.1 \
         \"bool remaproughness\" false \"spectrum eta\" \"metal-Ag-eta\" \"rgb k\" [1 2 3]",
        false,
    );
    assert!((m.roughness - 0.04f32.sqrt().sqrt()).abs() < 1e-6 && m.k.y == 2.0);
    // The ratio of the alphas is 1 - 0.9 anisotropic.
    assert!((1.0 - 0.9 * m.anisotropic - 0.25).abs() < 1e-6 && m.eta.x < 0.13);
    let (m, _) = material(
        "Material \"conductor\" \"rgb reflectance\" [0.25 0 1]",
        false,
    );
    // k of 2 sqrt(R) / sqrt(1 - R).
    assert_eq!((m.eta, m.roughness), (Vec3::ONE, 0.0));
    assert!(
        (m.k.x - 1.154_700_5).abs() < 1e-5 && m.k.y == 0.0 && m.k.z > 99.0,
        "{}",
        m.k
    );
    let (m, notes) = material(
        "Material \"dielectric\" \"spectrum eta\" \"glass-BK7\"",
        false,
    );
    assert_eq!((m.model, m.ior, m.thin), (Model::Dielectric, 1.5168, false));
    assert!(notes.contains("dispersion"), "{notes}");
    let (m, _) = material("Material \"thindielectric\" \"float eta\" 1.3", false);
    assert_eq!((m.ior, m.thin), (1.3, true));
    let (m, notes) = material("Material \"coateddiffuse\" \"float roughness\" 0.01", false);
    assert_eq!((m.model, m.nonlinear, m.ior), (Model::Plastic, true, 1.5));
    assert!(
        notes.contains("by 2 % brighter") && notes.contains("by 13 % for 1"),
        "{notes}"
    );
    let (m, notes) = material("Material \"coatedconductor\"", false);
    assert!(
        (m.k.x * 1.5 - 3.27).abs() < 0.01 && notes.contains("coat"),
        "{notes}"
    );
    let (m, notes) = material(
        "Material \"diffusetransmission\" \"rgb reflectance\" [0.2 0.4 0.8] \"float scale\" 0.5",
        false,
    );
    assert_eq!(
        (m.model, m.base_color, m.transmittance),
        (
            Model::Translucent,
            Vec3::new(0.1, 0.2, 0.4),
            Vec3::splat(0.125)
        )
    );
    assert!(notes.is_empty(), "{notes}");
    let (m, notes) = material("Material \"interface\"", false);
    assert!(m.thin && m.ior == 1.0 && notes.is_empty());
    let (m, notes) = material("Material \"hair\" \"rgb reflectance\" [0.5 0.25 0]", false);
    assert!(
        notes.contains("`hair` is not supported") && m.base_color.y == 0.25,
        "{notes}"
    );
    let (m, notes) = material("", false);
    assert_eq!(
        (m.name.as_str(), m.base_color, notes.as_str()),
        ("default", Vec3::splat(0.5), "")
    );
}

#[test]
fn materials_of_version_3_become_the_nearest_models() {
    let (m, _) = material("Material \"matte\" \"color Kd\" [0.1 0.2 0.3]", true);
    assert_eq!(
        (m.model, m.base_color),
        (Model::Lambert, Vec3::new(0.1, 0.2, 0.3))
    );
    // The polynomial of the logarithm of 0.01.
    let (m, _) = material("Material \"metal\"", true);
    let x = 0.01f32.ln();
    let alpha =
        1.62142 + 0.819955 * x + 0.1734 * x * x + 0.0171201 * x.powi(3) + 0.000640711 * x.powi(4);
    assert!(
        (m.roughness - alpha.sqrt()).abs() < 1e-4,
        "{} {}",
        m.roughness,
        alpha.sqrt()
    );
    let (m, _) = material("Material \"mirror\"", true);
    assert_eq!(
        (m.eta, m.k, m.base_color),
        (Vec3::ZERO, Vec3::ONE, Vec3::splat(0.9))
    );
    let (m, _) = material(
        "Material \"glass\" \"float index\" 1.3 \"rgb Kt\" [0.5 1 1]",
        true,
    );
    assert_eq!((m.ior, m.base_color.x, m.roughness), (1.3, 0.25, 0.0));
    let (m, notes) = material("Material \"substrate\" \"rgb Ks\" [0.04 0.04 0.04]", true);
    assert!((m.ior - 1.5).abs() < 1e-6 && m.specular == Vec3::ONE && notes.contains("Ashikhmin"));
    let (m, notes) = material(
        "Material \"translucent\" \"rgb Kd\" [0.8 0.4 0.2] \"rgb reflect\" [0.25 0.25 0.25]",
        true,
    );
    assert_eq!(
        (m.model, m.base_color, m.transmittance),
        (
            Model::Translucent,
            Vec3::new(0.2, 0.1, 0.05),
            Vec3::new(0.4, 0.2, 0.1)
        )
    );
    assert!(notes.contains("glossy lobes"), "{notes}");
    let curtain = "Material \"uber\" \"rgb Ks\" [0 0 0] \"rgb opacity\" [0.5 0.5 0.5]";
    let (m, notes) = material(curtain, true);
    assert_eq!((m.model, m.mask_mode), (Model::Lambert, MaskMode::Blend));
    assert!(
        m.texture(TextureSlot::Mask).is_some() && notes.is_empty(),
        "{notes}"
    );
}

#[test]
fn named_materials_mixes_and_attributes_are_found() {
    let (m, _) = material(
        "MakeNamedMaterial \"red\" \"string type\" \"diffuse\" \"rgb reflectance\" [1 0 0]\n\
         MakeNamedMaterial \"gold\" \"string type\" \"conductor\"\n\
         Material \"mix\" \"string materials\" [\"red\" \"gold\"] \"float amount\" 0.25",
        false,
    );
    assert_eq!(
        (m.parts, m.weights),
        (vec!["red".into(), "gold".into()], vec![0.75, 0.25])
    );
    // In version 3 the amount is that of the first.
    let (m, _) = material(
        "MakeNamedMaterial \"a\" \"string type\" \"matte\"\n\
         MakeNamedMaterial \"b\" \"string type\" \"mirror\"\n\
         Material \"mix\" \"string namedmaterial1\" \"a\" \"string namedmaterial2\" \"b\" \
         \"float amount\" 0.25",
        true,
    );
    assert_eq!(m.weights, [0.25, 0.75]);
    let endless = "MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"m\" \
    \"m\"]\n\
                   NamedMaterial \"m\"\nShape \"sphere\"";
    assert!(refused(endless).contains("levels deep"));
    assert!(refused("NamedMaterial \"x\"\nShape \"sphere\"").contains("no material with the name"));
    let (desc, notes) = read(
        "AttributeBegin\nAttribute \"shape\" \"float radius\" 3\nShape \"sphere\"\nAttributeEnd\n\
         Shape \"sphere\" \"float colour\" 1\n",
    );
    let (scene, _) = compile(&desc).unwrap();
    assert_eq!(
        (scene.spheres[0].radius, scene.spheres[1].radius),
        (3.0, 1.0)
    );
    assert!(
        notes.contains("line 9: Shape \"sphere\": `colour` is not supported"),
        "{notes}"
    );
}

#[test]
fn textures_are_decoded_scaled_and_mapped() {
    let mut png = std::io::Cursor::new(Vec::new());
    image::GrayImage::from_pixel(1, 1, image::Luma([128]))
        .write_to(&mut png, image::ImageFormat::Png)
        .unwrap();
    let png = png.into_inner();
    let with = |texture: &str, use_it: &str| {
        let text =
            format!("{VIEW}WorldBegin\nTexture \"t\" {texture}\n{use_it}\nShape \"sphere\"\n");
        let (desc, notes) = read_files(&[("a.pbrt", text.as_bytes()), ("t.png", &png)])
            .unwrap_or_else(|e| panic!("{e}"));
        let name = desc.entities[0].material.clone().unwrap();
        (
            desc.materials[desc.material_index(&name).unwrap()].clone(),
            notes,
        )
    };
    let file = "\"string filename\" \"t.png\"";
    let color = "Material \"diffuse\" \"texture reflectance\" \"t\"";
    let texel = |m: &MaterialDesc, slot: TextureSlot| match &m.texture(slot).unwrap().texels {
        lumbre_light::scene::desc::Texels::Rgba8(t) => f32::from(t[0][0]),
        lumbre_light::scene::desc::Texels::RgbaF32(t) => t[0][0],
    };
    let base = TextureSlot::BaseColor;
    let (m, notes) = with(
        &format!(
            "\"spectrum\" \"imagemap\" {file} \"float uscale\" 3 \"float vdelta\" 0.5 \
             \"string wrap\" \"clamp\" \"string filter\" \"point\""
        ),
        color,
    );
    assert!(notes.is_empty() && texel(&m, base) == 128.0, "{notes}");
    let lookup = m.lookup(base);
    assert_eq!(lookup.wrap, [Wrap::Clamp; 2]);
    assert_eq!(lookup.filter, TextureFilter::Nearest);
    let map = lookup.map.unwrap();
    assert_eq!(
        map.transform_point2(Vec2::new(1.0, 1.0)),
        Vec2::new(3.0, 1.5)
    );
    // 128 / 255 is 0.2158605 in sRGB.
    let (m, _) = with(
        &format!("\"spectrum\" \"imagemap\" {file} \"float scale\" 2"),
        color,
    );
    assert!(
        (texel(&m, base) - 0.431_721).abs() < 1e-5,
        "{}",
        texel(&m, base)
    );
    let encoded = "\"string encoding\" \"linear\" \"bool invert\" true";
    let (m, _) = with(
        &format!("\"spectrum\" \"imagemap\" {file} {encoded}"),
        color,
    );
    assert!((texel(&m, base) - 127.0 / 255.0).abs() < 1e-5);
    // Alpha is the square root of 0.2158605.
    let rough = "Material \"conductor\" \"texture roughness\" \"t\"";
    let (m, _) = with(&format!("\"float\" \"imagemap\" {file}"), rough);
    let found = texel(&m, TextureSlot::Roughness);
    assert!((found - 0.215_860_5f32.sqrt()).abs() < 1e-5, "{found}");
    assert_eq!(m.roughness_texels, RoughnessTexels::Alpha);
    let (m, notes) = with(
        "\"spectrum\" \"checkerboard\" \"float uscale\" 4 \"float vscale\" 4 \"rgb tex1\" [1 0 0] \
         \"rgb tex2\" [0 0 1]",
        color,
    );
    let lumbre_light::scene::desc::Texels::RgbaF32(t) = &m.texture(base).unwrap().texels else {
        panic!("floats expected")
    };
    // The first row is the top one: the second colour at the left, the first one at the bottom
    // left.
    assert_eq!((t[0][2], t[2][0]), (1.0, 1.0));
    assert_eq!(m.lookup(base).filter, TextureFilter::Nearest);
    assert!(!notes.contains("mean"), "{notes}");
    let at = m.lookup(base).map.unwrap().transform_point2(Vec2::ONE);
    assert_eq!(at, Vec2::splat(2.0), "an image has two fields");
    let (m, _) = with(
        "\"spectrum\" \"scale\" \"rgb tex\" [0.5 1 0] \"float scale\" 0.5",
        color,
    );
    assert_eq!(m.base_color, Vec3::new(0.25, 0.5, 0.0));
    let mix =
        "\"spectrum\" \"mix\" \"rgb tex1\" [1 0 0] \"rgb tex2\" [0 1 0] \"float amount\" 0.25";
    assert_eq!(with(mix, color).0.base_color, Vec3::new(0.75, 0.25, 0.0));
    let (m, notes) = with("\"spectrum\" \"wrinkled\"", color);
    assert!(
        m.base_color == Vec3::splat(0.398_437_5) && notes.contains("its mean is used"),
        "{notes}"
    );
}

#[test]
fn rough_matte_surfaces_are_rough_and_diffuse() {
    let matte = |sigma: &str| {
        material(
            &format!("Material \"matte\" \"rgb Kd\" [0.8 0.4 0.2] {sigma}"),
            true,
        )
    };
    for (sigma, model, roughness) in [
        ("\"float sigma\" 0", Model::Lambert, None),
        ("\"float sigma\" 45", Model::OrenNayar, Some(0.5)),
        ("\"float sigma\" 400", Model::OrenNayar, Some(1.0)),
    ] {
        let (m, notes) = matte(sigma);
        assert_eq!(m.model, model, "{sigma}");
        assert_eq!(m.base_color, Vec3::new(0.8, 0.4, 0.2));
        assert!(roughness.is_none_or(|roughness| m.roughness == roughness));
        assert!(notes.is_empty(), "{notes}");
    }
}

/// Returns the lights of a world.
fn lights(world: &str, old: bool) -> Vec<LightKind> {
    let (desc, _) = if old { read_v3(world) } else { read(world) };
    desc.lights.iter().map(|l| l.kind.clone()).collect()
}

#[test]
fn lights_have_the_units_and_directions_of_pbrt() {
    let [
        LightKind::Point {
            position,
            intensity,
        },
    ] = lights(
        "Translate 1 0 0\nLightSource \"point\" \"rgb I\" [1 2 3] \"float scale\" 2 \"point3 \
        from\" [0 1 0]",
        false,
    )[..]
    else {
        panic!("a point light expected")
    };
    assert_eq!(
        (position, intensity),
        (Vec3::new(1.0, 1.0, 0.0), Vec3::new(2.0, 4.0, 6.0))
    );
    let [LightKind::Point { intensity, .. }] =
        lights("LightSource \"point\" \"float power\" 12.566371", false)[..]
    else {
        panic!("a point light expected")
    };
    assert!((intensity - 1.0).abs().max_element() < 1e-6, "{intensity}");
    let spot = "LightSource \"spot\" \"float coneangle\" 40 \"float conedeltaangle\" 10 \
                \"point3 from\" [0 2 0] \"point3 to\" [0 0 0]";
    let [
        LightKind::Spot {
            direction, cone, ..
        },
    ] = lights(spot, false)[..]
    else {
        panic!("a spot light expected")
    };
    assert_eq!(
        (direction.normalize_or(Vec3::ZERO), cone.cutoff_deg),
        (Vec3::NEG_Y, 40.0)
    );
    assert_eq!((cone.beam_deg, cone.edge), (30.0, ConeEdge::Linear));
    // Version 3: the same light as a fourth power between 30 and 40 degrees.
    let [LightKind::Spot { cone, .. }] = lights(spot, true)[..] else {
        panic!("a spot light expected")
    };
    let (c0, c1) = (30f32.to_radians().cos(), 40f32.to_radians().cos());
    let c = cone.beam_deg.to_radians().cos();
    let (own, theirs) = ((1.0 - c) + (c - c1) / 3.0, (1.0 - c0) + (c0 - c1) / 5.0);
    assert!((own / theirs - 1.0).abs() < 1e-5 && cone.edge == ConeEdge::Smooth);
    let sun = "Rotate 90 0 0 1\nLightSource \"distant\" \"point3 from\" [1 0 0] \"point3 to\" [0 0 \
               0] \"float illuminance\" 5";
    let [
        LightKind::Directional {
            direction,
            irradiance,
        },
    ] = lights(sun, false)[..]
    else {
        panic!("a directional light expected")
    };
    assert!(direction.distance(Vec3::NEG_Y) < 1e-6 && irradiance == Vec3::splat(5.0));
}

#[test]
fn goniometric_lights_have_the_axes_and_units_of_pbrt() {
    // Returns the factor of the map in a direction of the world, and the light.
    let read = |world: &str, image: &[u8], old: bool| {
        let film = if old { "Film \"image\"\n" } else { "" };
        let end = if old { "WorldEnd\n" } else { "" };
        let text = format!("{VIEW}{film}WorldBegin\n{world}\n{end}");
        let (desc, notes) = read_files(&[("a.pbrt", text.as_bytes()), ("t.png", image)]).unwrap();
        let (scene, _) = compile(&desc).unwrap();
        let lights = Lights::new(&scene);
        let at = LightPoint {
            lights: [LightId::Point(0)],
            position: scene.points[0].position,
            normal: Vec3::Y,
            extent: 0.0,
            uv: Uv::zero(),
        };
        let emitted = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z]
            .map(|dir| lights.emitted(&scene, &at, dir));
        (scene.points[0].position, emitted, notes)
    };
    let png = |width: u32, texels: &[u8]| {
        let height = texels.len() as u32 / width;
        let image = image::GrayImage::from_raw(width, height, texels.to_vec()).unwrap();
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::DynamicImage::from(image)
            .into_rgb8()
            .write_to(&mut bytes, image::ImageFormat::Png)
            .unwrap();
        bytes.into_inner()
    };
    // Version 3: the top row is +y of the light, the columns are +x, +z, -x, -z.
    let gonio = "LightSource \"goniometric\" \"rgb I\" [2 2 2] \"string mapname\" \"t.png\"";
    let top = png(1, &[vec![255; 32], vec![0; 32]].concat());
    let (position, emitted, _) = read(&format!("Translate 1 2 3\n{gonio}"), &top, true);
    assert_eq!(position, Vec3::new(1.0, 2.0, 3.0));
    assert!((emitted[1] - 2.0).abs().max_element() < 1e-5 && emitted[4] == Vec3::ZERO);
    let wedge: Vec<u8> = (0..64)
        .map(|i| if (8..24).contains(&i) { 255 } else { 0 })
        .collect();
    let (_, emitted, _) = read(gonio, &png(64, &wedge), true);
    assert!((emitted[2] - 2.0).abs().max_element() < 1e-5, "{emitted:?}");
    assert!(
        [0, 3, 5].iter().all(|i| emitted[*i].max_element() < 1e-5),
        "{emitted:?}"
    );
    // Version 4: the middle of the square is +z of the texture's space, +y of the light.
    let square: Vec<u8> = (0..32 * 32)
        .map(|i| {
            let inside = [i % 32, i / 32].iter().all(|x| (12..20).contains(x));
            if inside { 255 } else { 0 }
        })
        .collect();
    let gonio = "LightSource \"goniometric\" \"string filename\" \"t.png\"";
    let (_, emitted, notes) = read(gonio, &png(32, &square), false);
    assert!((emitted[1] - 1.0).abs().max_element() < 1e-5, "{emitted:?}");
    assert!(
        [0, 2, 3, 4, 5].iter().all(|i| emitted[*i] == Vec3::ZERO),
        "{emitted:?}"
    );
    assert!(notes.contains("equal areas"), "{notes}");
    // A power of 4 pi is a mean intensity of 1: 16 where a sixteenth of the square is white.
    let power = format!("{gonio} \"float power\" 12.566371");
    let (_, emitted, _) = read(&power, &png(32, &square), false);
    assert!(
        (emitted[1] / 16.0 - 1.0).abs().max_element() < 1e-3,
        "{emitted:?}"
    );
    // Without a map it is a point light.
    let [LightKind::Point { intensity, .. }] =
        lights("LightSource \"goniometric\" \"rgb I\" [1 2 3]", false)[..]
    else {
        panic!("a point light expected")
    };
    assert_eq!(intensity, Vec3::new(1.0, 2.0, 3.0));
}

#[test]
fn each_of_several_area_lights_has_its_own_radiance() {
    let light = |l: u32| {
        format!(
            "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [{l} {l} {l}]\nNamedMaterial \"black\"\n\
             Shape \"sphere\"\nShape \"sphere\" \"float radius\" 2\nAttributeEnd\n"
        )
    };
    let lights: String = (1..=8).map(light).collect();
    let black =
        "MakeNamedMaterial \"black\" \"string type\" \"diffuse\" \"rgb reflectance\" [0 0 0]\n";
    let (desc, _) = read(&format!("{black}{lights}"));
    let emission = |entity: &EntityDesc| {
        let name = entity.material.as_deref().unwrap();
        desc.materials[desc.material_index(name).unwrap()]
            .emission
            .x
    };
    let emissions: Vec<f32> = desc.entities.iter().map(emission).collect();
    let expected: Vec<f32> = (1..=8).flat_map(|l| [l as f32; 2]).collect();
    assert_eq!(emissions, expected);
    // Both shapes of a light share its material.
    assert_eq!(desc.materials.len(), 1 + 8);
}

#[test]
fn area_lights_emit_on_the_front_with_radiance_or_power() {
    let emission = |light: &str, shape: &str| {
        let (desc, notes) = read(&format!("AreaLightSource \"diffuse\" {light}\n{shape}\n"));
        let name = desc.entities[0].material.clone().unwrap();
        let m = &desc.materials[desc.material_index(&name).unwrap()];
        assert!(m.emitter_reflects);
        (m.emission, notes)
    };
    let (l, notes) = emission("\"rgb L\" [1 2 3] \"float scale\" 2", "Shape \"sphere\"");
    assert_eq!((l, notes.as_str()), (Vec3::new(2.0, 4.0, 6.0), ""));
    // Power over pi times the area, 4 pi 2^2.
    let (l, _) = emission("\"float power\" 100", "Scale 2 2 2\nShape \"sphere\"");
    assert!((l.x - 100.0 / (PI * 16.0 * PI)).abs() < 1e-5, "{l}");
    // Each triangle of a mesh has the power.
    let (l, _) = emission("\"float power\" 100", TRIANGLE);
    assert!((l.x - 100.0 / (PI * 0.5)).abs() < 1e-4, "{l}");
    // Of two sides each has half of it.
    let both = "\"float power\" 100 \"bool twosided\" true";
    let (l, _) = emission(both, TRIANGLE);
    assert!((l.x - 100.0 / PI).abs() < 1e-4, "{l}");
    let (desc, notes) = read(
        "ObjectBegin \"o\"\nAreaLightSource \"diffuse\"\nShape \
        \"sphere\"\nObjectEnd\nObjectInstance \"o\"",
    );
    let dark = desc.materials.iter().all(|m| m.emission == Vec3::ZERO);
    assert!(dark && notes.contains("ignores area lights"), "{notes}");
}

#[test]
fn the_film_exposes_and_environments_are_turned() {
    let film = "Film \"rgb\" \"float iso\" 200\nCamera \"perspective\" \"float shutterclose\" \
    0.25\n\
                WorldBegin\nLightSource \"infinite\" \"rgb L\" [1 2 3]\n";
    let (desc, _) = read_files(&[("a.pbrt", film.as_bytes())]).unwrap();
    let environment = desc.environment.unwrap();
    assert_eq!(
        environment.source,
        EnvironmentSource::Color(Vec3::new(0.5, 1.0, 1.5))
    );
    let old = "Film \"image\" \"float scale\" 3\nWorldBegin\nLightSource \"point\"\nWorldEnd\n";
    let (desc, _) = read_files(&[("a.pbrt", old.as_bytes())]).unwrap();
    assert!(
        matches!(desc.lights[0].kind, LightKind::Point { intensity, .. } if intensity.x == 3.0)
    );
    // Version 3: up is +z of the light. Rotated to +y, the texels keep their rows.
    let png = picture(image::ImageFormat::Png);
    let sky = format!(
        "{VIEW}Film \"image\"\nWorldBegin\nRotate -90 1 0 0\nLightSource \"infinite\" \"string \
         mapname\" \"t.png\" \"rgb L\" [2 2 2] \"rgb scale\" [1 1 1]\nWorldEnd\n"
    );
    let (desc, notes) = read_files(&[("a.pbrt", sky.as_bytes()), ("t.png", &png)]).unwrap();
    let environment = desc.environment.unwrap();
    let EnvironmentSource::Map(map) = &environment.source else {
        panic!("a map expected")
    };
    assert_eq!(
        (map.width, map.height, environment.scale),
        (5, 4, 2.0),
        "{notes}"
    );
    let wide =
        format!("{VIEW}WorldBegin\nLightSource \"infinite\" \"string filename\" \"t.png\"\n");
    let e = read_files(&[("a.pbrt", wide.as_bytes()), ("t.png", &png)]).unwrap_err();
    assert!(e.contains("a square of equal areas"), "{e}");
}

/// Curves of a straight line from the origin to (3, 0, 0), by basis and degree.
#[test]
fn curves_become_tubes_and_ribbons_of_their_widths() {
    let curve = |more: &str| read(&format!("Shape \"curve\" {more}\n"));
    let extent = |desc: &SceneDesc| {
        let mesh = mesh_of(desc, 0);
        let (low, high) = mesh
            .positions
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
                (low.min(*p), high.max(*p))
            });
        (low, high)
    };
    for points in [
        "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]",
        "\"integer degree\" 2 \"point3 P\" [0 0 0 1.5 0 0 3 0 0]",
        "\"string basis\" \"bspline\" \"point3 P\" [-3 0 0 0 0 0 3 0 0 6 0 0]",
    ] {
        let (desc, notes) = curve(&format!(
            "{points} \"float width0\" 0.4 \"float width1\" 0.2"
        ));
        let (low, high) = extent(&desc);
        assert!((high.x - low.x - 3.0).abs() < 0.7, "{points}: {low} {high}");
        assert!(
            (low.z + 0.2).abs() < 0.03 && (high.z - 0.2).abs() < 0.03,
            "{low} {high}"
        );
        assert!(notes.contains("becomes a tube"), "{notes}");
    }
    let line = "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]";
    let (desc, notes) = curve(&format!(
        "{line} \"string type\" \"cylinder\" \"float width\" 0.4"
    ));
    assert!(!notes.contains("tube"), "{notes}");
    let radii = mesh_of(&desc, 0).positions.iter().map(|p| p.y.hypot(p.z));
    assert!(radii.into_iter().all(|r| r < 0.2001), "a round tube");
    let ribbon =
        format!("{line} \"string type\" \"ribbon\" \"normal N\" [0 1 0 0 1 0] \"float width\" 0.4");
    let (desc, _) = curve(&ribbon);
    let (low, high) = extent(&desc);
    assert!(low.distance(Vec3::new(0.0, 0.0, -0.2)) < 1e-6, "{low}");
    assert!(high.distance(Vec3::new(3.0, 0.0, 0.2)) < 1e-6, "{high}");
    assert!(mesh_of(&desc, 0).normals.iter().all(|n| n.y > 0.999));
    for (bad, expected) in [
        ("\"point3 P\" [0 0 0 1 0 0]", "no curve of degree 3"),
        (
            "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0]",
            "no curve of degree 3",
        ),
        ("\"point3 P\" [0 0 0 0 0 0 0 0 0 0 0 0]", "coincide"),
        (
            &ribbon.replace("[0 1 0 0 1 0]", "[0 1 0]"),
            "needs 2 normals, found 1",
        ),
        (&format!("{line} \"float width\" 0"), "must be above 0"),
        (
            &format!("{line} \"string type\" \"hair\""),
            "unknown type of curve `hair`",
        ),
    ] {
        let message = refused(&format!("Shape \"curve\" {bad}\n"));
        assert!(message.contains(expected), "{bad}: {message}");
    }
}
