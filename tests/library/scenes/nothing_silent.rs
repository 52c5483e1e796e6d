//! Every plugin, directive, extension and keyword that a format has is supported, noted or refused:
//! the lists are those of the formats, whether this program knows the names or not.

use std::collections::BTreeMap;

use lumbre_scene_io::load::{FORMATS, SupportedElement};
use serde_json::json;

use super::{Folder, lines};

/// Surfaces of Mitsuba 0.6 and 3.
const MITSUBA_BSDFS: &str = "blendbsdf bumpmap circular coating conductor dielectric difftrans \
    diffuse hk irawan mask measured measured_polarized mixturebsdf normalmap null phong plastic \
    polarizer pplastic principled principledthin retarder roughcoating roughconductor \
    roughdielectric roughdiffuse roughplastic sssbrdf thindielectric twosided ward";
const MITSUBA_SHAPES: &str = "animatedinstance bsplinecurve cube cylinder deformable disk \
    ellipsoids ellipsoidsmesh hair heightfield instance linearcurve merge obj ply rectangle sdfgrid \
    serialized shapegroup sphere";
const MITSUBA_EMITTERS: &str = "area astronomical collimated constant directional \
    directionalarea envmap point projector sky spot sun sunsky timed_sunsky volumelight";
const MITSUBA_TEXTURES: &str = "bitmap checkerboard curvature gridtexture mesh_attribute scale \
    vertexcolors volume wireframe";
const MITSUBA_SENSORS: &str = "batch distant fluencemeter irradiancemeter orthographic perspective \
    perspective_rdist radiancemeter spherical telecentric thinlens";

/// Directives of pbrt, versions 3 and 4, with a name each, by directive.
const PBRT: [(&str, &str); 6] = [
    (
        "Shape",
        "bilinearmesh cone curve cylinder disk heightfield hyperboloid loopsubdiv nurbs paraboloid \
         plymesh sphere trianglemesh",
    ),
    (
        "Material",
        "coatedconductor coateddiffuse conductor dielectric diffuse diffusetransmission disney \
         fourier glass hair interface kdsubsurface matte measured metal mirror mix plastic \
         subsurface substrate thindielectric translucent uber",
    ),
    (
        "LightSource",
        "distant goniometric infinite point projection spot",
    ),
    ("AreaLightSource", "area diffuse"),
    (
        "Camera",
        "environment orthographic perspective realistic spherical",
    ),
    // Media of all types are left out with one note, which has their name.
    ("MakeNamedMedium", "fog"),
];
const PBRT_TEXTURES: &str = "bilerp checkerboard constant directionmix dots fbm imagemap marble mix \
    ptex scale uv windy wrinkled";

/// Registered extensions of glTF 2.0, of Khronos and of several vendors.
const GLTF_EXTENSIONS: &str = "EXT_lights_ies EXT_lights_image_based EXT_mesh_gpu_instancing \
    EXT_mesh_manifold EXT_meshopt_compression EXT_texture_astc EXT_texture_avif EXT_texture_webp \
    KHR_animation_pointer KHR_audio_emitter KHR_draco_mesh_compression KHR_lights_punctual \
    KHR_materials_anisotropy KHR_materials_clearcoat KHR_materials_diffuse_transmission \
    KHR_materials_dispersion KHR_materials_emissive_strength KHR_materials_ior \
    KHR_materials_iridescence KHR_materials_pbrSpecularGlossiness KHR_materials_sheen \
    KHR_materials_specular KHR_materials_transmission KHR_materials_unlit KHR_materials_variants \
    KHR_materials_volume KHR_materials_volume_scatter KHR_mesh_quantization KHR_node_visibility \
    KHR_physics_rigid_bodies KHR_techniques_webgl KHR_texture_basisu KHR_texture_transform \
    KHR_xmp_json_ld MSFT_lod MSFT_texture_dds";

/// Statements of material libraries, with arguments.
const MTL: [(&str, &str); 28] = [
    ("Ka", "1 1 1"),
    ("Kd", "1 1 1"),
    ("Ks", "1 1 1"),
    ("Ke", "0 0 0"),
    ("Km", "0.5"),
    ("Tf", "1 1 1"),
    ("Tr", "0.5"),
    ("d", "0.5"),
    ("Ns", "10"),
    ("Ni", "1.5"),
    ("Nr", "1"),
    ("illum", "2"),
    ("sharpness", "60"),
    ("Pr", "0.5"),
    ("Pm", "0.5"),
    ("Ps", "0.5"),
    ("Pc", "0.5"),
    ("Pcr", "0.5"),
    ("aniso", "0.5"),
    ("anisor", "0.5"),
    ("disp", "a.png"),
    ("decal", "a.png"),
    ("refl", "a.png"),
    ("map_Ka", "a.png"),
    ("map_Kd", "a.png"),
    ("map_aat", "on"),
    ("norm", "a.png"),
    ("map_Bump", "a.png"),
];

/// Returns whether the table of a format has a name, supported or not.
fn is_in_table(format: &str, name: &str) -> bool {
    let row = FORMATS.iter().find(|row| row.name == format).unwrap();
    let has = |element: &SupportedElement| {
        let texts = [element.name, element.support, element.limits];
        let words = texts
            .iter()
            .flat_map(|text| text.split('`').skip(1).step_by(2));
        words
            .into_iter()
            .any(|word| word.eq_ignore_ascii_case(name))
    };
    row.supported.iter().any(has)
}

/// What became of an element: a note or an error that names it, or nothing.
struct Fate(String);

impl Fate {
    fn of(folder: &Folder, file: &str) -> Fate {
        Fate(match folder.load(file) {
            Ok((_, notes)) => lines(&notes),
            Err(error) => error.to_string(),
        })
    }

    fn names(&self, name: &str) -> bool {
        self.0.to_lowercase().contains(&name.to_lowercase())
    }
}

/// Returns the names that are neither in the table of the format nor named by a note or an error.
fn silent(format: &str, names: &str, fate: impl Fn(&str) -> Fate) -> Vec<String> {
    let names = names.split_whitespace();
    let is_silent = |name: &&str| !is_in_table(format, name) && !fate(name).names(name);
    names.filter(is_silent).map(str::to_owned).collect()
}

fn mitsuba(inner: &str) -> Fate {
    mitsuba_of("3.0.0", inner)
}

fn mitsuba_of(version: &str, inner: &str) -> Fate {
    let text = format!("<scene version=\"{version}\">{inner}</scene>");
    Fate::of(&Folder::new(&[("a.xml", text)]), "a.xml")
}

#[test]
fn plugins_of_mitsuba_are_supported_noted_or_refused() {
    let with = |class: &'static str, around: [&'static str; 2]| {
        move |name: &str| {
            let [before, after] = around;
            mitsuba(&format!("{before}<{class} type=\"{name}\"/>{after}"))
        }
    };
    let in_shape = ["<shape type=\"sphere\">", "</shape>"];
    let in_bsdf = [
        "<shape type=\"sphere\"><bsdf type=\"diffuse\">",
        "</bsdf></shape>",
    ];
    for (names, class, around) in [
        (MITSUBA_BSDFS, "bsdf", in_shape),
        (MITSUBA_SHAPES, "shape", ["", ""]),
        (MITSUBA_EMITTERS, "emitter", ["", ""]),
        (MITSUBA_TEXTURES, "texture name=\"reflectance\"", in_bsdf),
        (MITSUBA_SENSORS, "sensor", ["", ""]),
    ] {
        let found = silent("mitsuba", names, with(class, around));
        assert_eq!(found, Vec::<String>::new(), "{class}");
    }
}

#[test]
fn parameters_of_mitsuba_that_nothing_reads_are_noted() {
    let unknown = "<float name=\"zzz\" value=\"1\"/>";
    let inside = "<bsdf type=\"diffuse\"/>";
    for (names, class, [before, after]) in [
        (
            MITSUBA_BSDFS,
            "bsdf",
            ["<shape type=\"sphere\">", "</shape>"],
        ),
        (MITSUBA_SHAPES, "shape", ["", ""]),
        (MITSUBA_EMITTERS, "emitter", ["", ""]),
        (MITSUBA_SENSORS, "sensor", ["", ""]),
    ] {
        for name in names.split_whitespace() {
            // Adapters need surfaces inside, others ignore them.
            for inside in ["", inside, &inside.repeat(2)] {
                let fate = mitsuba(&format!(
                    "{before}<{class} type=\"{name}\">{unknown}{inside}</{class}>{after}"
                ));
                assert!(!fate.0.is_empty(), "{class} {name}: no note");
            }
        }
    }
}

#[test]
fn parameters_of_suns_and_skies_that_nothing_reads_are_noted() {
    for (version, name, parameter) in [
        ("3.0.0", "sunsky", "scale"),
        ("3.0.0", "sunsky", "stretch"),
        ("0.6.0", "sunsky", "sun_aperture"),
        ("0.6.0", "sky", "sunScale"),
        ("0.6.0", "sun", "albedo"),
    ] {
        let unknown = format!("<float name=\"{parameter}\" value=\"1\"/>");
        let emitter = format!("<emitter type=\"{name}\">{unknown}</emitter>");
        let fate = mitsuba_of(version, &emitter);
        let snake = parameter.replace("sunScale", "sun_scale");
        assert!(fate.names(&format!("`{snake}`")), "{name}: {}", fate.0);
    }
}

fn pbrt(version: u32, world: &str) -> Fate {
    let text = match version {
        4 => format!("Camera \"perspective\"\nWorldBegin\n{world}"),
        _ => format!("Camera \"perspective\"\nWorldBegin\n{world}\nWorldEnd\n"),
    };
    Fate::of(&Folder::new(&[("a.pbrt", text)]), "a.pbrt")
}

#[test]
fn names_of_pbrt_are_supported_noted_or_refused() {
    for version in [3, 4] {
        for (directive, names) in PBRT {
            let found = silent("pbrt", names, |name| match directive {
                "Camera" => {
                    let text = format!("Camera \"{name}\"\nWorldBegin\n");
                    Fate::of(&Folder::new(&[("a.pbrt", text)]), "a.pbrt")
                }
                _ => pbrt(
                    version,
                    &format!("{directive} \"{name}\"\nShape \"sphere\"\n"),
                ),
            });
            assert_eq!(
                found,
                Vec::<String>::new(),
                "{directive}, version {version}"
            );
        }
        let found = silent("pbrt", PBRT_TEXTURES, |name| {
            let material = if version == 4 {
                "Material \"diffuse\" \"texture reflectance\" \"t\""
            } else {
                "Material \"matte\" \"texture Kd\" \"t\""
            };
            let texture = format!("Texture \"t\" \"spectrum\" \"{name}\"");
            pbrt(
                version,
                &format!("{texture}\n{material}\nShape \"sphere\"\n"),
            )
        });
        assert_eq!(found, Vec::<String>::new(), "textures, version {version}");
    }
}

#[test]
fn parameters_of_pbrt_that_nothing_reads_are_noted() {
    for (directive, names) in PBRT {
        for name in names.split_whitespace() {
            let line = match directive {
                "MakeNamedMedium" => {
                    format!("MakeNamedMedium \"m\" \"string type\" \"{name}\" \"float zzz\" 1")
                }
                _ => format!("{directive} \"{name}\" \"float zzz\" 1\nShape \"sphere\""),
            };
            let fate = if directive == "Camera" {
                let text = format!("{line}\nWorldBegin\n").replace("\nShape \"sphere\"", "");
                Fate::of(&Folder::new(&[("a.pbrt", text)]), "a.pbrt")
            } else {
                pbrt(4, &line)
            };
            assert!(!fate.0.is_empty(), "{directive} {name}: no note");
        }
    }
}

#[test]
fn extensions_of_gltf_are_supported_noted_or_refused() {
    let found = silent("gltf", GLTF_EXTENSIONS, |name| {
        // Extensions of materials are noted at the materials that have them.
        let document = json!({
            "asset": { "version": "2.0" }, "extensionsUsed": [name],
            "materials": [{ "extensions": { name: {} } }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
            "accessors": [{ "componentType": 5126, "count": 3, "type": "VEC3" }],
            "nodes": [{ "mesh": 0 }],
        });
        Fate::of(&Folder::new(&[("a.gltf", document.to_string())]), "a.gltf")
    });
    assert_eq!(found, Vec::<String>::new());
}

#[test]
fn statements_of_material_libraries_are_supported_noted_or_refused() {
    let arguments: BTreeMap<&str, &str> = MTL.into_iter().collect();
    let names: Vec<&str> = MTL.iter().map(|(name, _)| *name).collect();
    let found = silent("obj", &names.join(" "), |name| {
        let library = format!("newmtl m\n{name} {}\n", arguments[name]);
        let mesh = "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        let folder = Folder::new(&[("a.obj", mesh), ("a.mtl", &library)]);
        image::GrayImage::new(2, 2)
            .save(folder.path("a.png"))
            .unwrap();
        Fate::of(&folder, "a.obj")
    });
    assert_eq!(found, Vec::<String>::new());
}

#[test]
fn statements_of_obj_and_elements_of_ply_are_supported_noted_or_refused() {
    let statements = "bevel bmat bsp bzp c_interp con cstype ctech curv curv2 d_interp deg end g \
                      hole l lod maplib mg mtllib o p parm res s scrv shadow_obj sp stech step \
                      surf trace_obj trim usemap usemtl vp";
    let found = silent("obj", statements, |name| {
        let mesh = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{name} 1 2\nf 1 2 3\n");
        Fate::of(&Folder::new(&[("a.obj", mesh)]), "a.obj")
    });
    assert_eq!(found, Vec::<String>::new());
    let properties = "alpha confidence intensity material_index nxx quality radius red2 scale_0 \
                      rot_0 opacity f_dc_0 f_rest_0 value";
    let found = silent("ply", properties, |name| {
        let mesh = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nproperty float {name}\nelement face 1\nproperty list uchar int \
             vertex_indices\nend_header\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n"
        );
        Fate::of(&Folder::new(&[("a.ply", mesh)]), "a.ply")
    });
    assert_eq!(found, Vec::<String>::new());
}
