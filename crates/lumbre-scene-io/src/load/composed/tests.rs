//! Composed textures of both formats, against values by hand and of Mitsuba.

use std::path::Path;

use super::*;
use crate::load::{MissingTextures, mitsuba, pbrt};
use lumbre_light::scene::desc::{MaterialDesc, TextureSlot};

/// Lines of notes.
type Notes = String;

/// Returns the material with a texture, of a file and images, and the notes.
fn material(
    file: &str,
    text: &str,
    images: impl Fn(&Path),
) -> Result<(MaterialDesc, Notes), String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(file);
    std::fs::write(&path, text).unwrap();
    images(folder.path());
    let load = if file.ends_with("xml") {
        mitsuba::load
    } else {
        pbrt::load
    };
    let (desc, notes) = load(&path, MissingTextures::Fail).map_err(|e| e.to_string())?;
    let lines = notes
        .iter()
        .map(|n| format!("{}: {}\n", n.place, n.message));
    let mut materials = desc.materials.iter();
    let textured = materials.find(|m| m.texture(TextureSlot::BaseColor).is_some());
    let found = textured.or(desc.materials.last()).unwrap().clone();
    Ok((found, lines.collect()))
}

/// Returns the base colour as a texture of a mesh's coordinates.
fn texture(m: &MaterialDesc) -> ImageTexture {
    let image = m.texture(TextureSlot::BaseColor).unwrap().clone();
    let lookup = m.lookup(TextureSlot::BaseColor);
    let tiling = Affine2::from_scale_angle_translation(Vec2::splat(m.tiling), 0.0, m.uv_offset);
    ImageTexture {
        image,
        wrap: lookup.wrap,
        filter: lookup.filter,
        map: lookup.map.unwrap_or_default() * tiling,
    }
}

/// Returns the value of a texture at a mesh's coordinates.
fn value(t: &ImageTexture, u: f64, v: f64) -> Vec3 {
    t.at(t.map.as_daffine2().transform_point2(DVec2::new(u, v)))
}

/// Writes a float image whose texels a function of column and row gives.
fn exr(folder: &Path, name: &str, size: [usize; 2], f: impl Fn(usize, usize) -> [f32; 3] + Sync) {
    let texel = |x, y| <(f32, f32, f32)>::from(f(x, y));
    exr::prelude::write_rgb_file(folder.join(name), size[0], size[1], texel).unwrap();
}

/// Writes images of 2 by 1, 1 by 2 and 4 by 2 texels.
fn images(folder: &Path) {
    exr(folder, "wide.exr", [2, 1], |x, _| {
        [[0.25, 0.5, 1.0], [0.75, 1.0, 0.125]][x]
    });
    exr(folder, "tall.exr", [1, 2], |_, y| {
        [[0.5; 3], [0.25, 0.75, 1.0]][y]
    });
    exr(folder, "steps.exr", [4, 2], |x, y| {
        [(4 * y + x) as f32 / 8.0; 3]
    });
    let four = |x, y| image::Rgb([0, 1, 2].map(|c| ((60 * x + 17 * y + 40 * c) % 256) as u8));
    image::RgbImage::from_fn(4, 4, four)
        .save(folder.join("a.png"))
        .unwrap();
    let eight = |x, y| image::Rgb([0, 1, 2].map(|c| ((30 * x + 90 * y + 70 * c) % 256) as u8));
    image::RgbImage::from_fn(8, 2, eight)
        .save(folder.join("b.png"))
        .unwrap();
}

/// Textures of images with several maps, wrap modes and filters.
const TEXTURES: &str = "
    Texture \"wide\" \"spectrum\" \"imagemap\" \"string filename\" \"wide.exr\"
    Texture \"tall\" \"spectrum\" \"imagemap\" \"string filename\" \"tall.exr\"
    Texture \"steps\" \"spectrum\" \"imagemap\" \"string filename\" \"steps.exr\"
    Texture \"clamped\" \"spectrum\" \"imagemap\" \"string filename\" \"wide.exr\"
        \"string wrap\" \"clamp\"
    Texture \"fine\" \"spectrum\" \"imagemap\" \"string filename\" \"steps.exr\"
        \"float uscale\" 3 \"float vscale\" 2
    Texture \"stepped\" \"spectrum\" \"imagemap\" \"string filename\" \"wide.exr\"
        \"string filter\" \"point\"
    Texture \"odd\" \"spectrum\" \"imagemap\" \"string filename\" \"wide.exr\"
        \"float uscale\" 3.14159
    Texture \"amount\" \"float\" \"imagemap\" \"string filename\" \"steps.exr\"\n";

/// Returns the surface of the texture `t` of pbrt, given its type and parameters.
fn pbrt_surface(t: &str) -> Result<(MaterialDesc, Notes), String> {
    let text = format!(
        "Camera \"perspective\"\nWorldBegin\n{TEXTURES}Texture \"t\" \"spectrum\" {t}\n\
         Material \"diffuse\" \"texture reflectance\" \"t\"\nShape \"sphere\"\n"
    );
    material("a.pbrt", &text, images)
}

/// Returns a texture of pbrt, given its type and parameters, and the notes.
fn pbrt_texture(t: &str) -> (ImageTexture, Notes) {
    let (m, notes) = pbrt_surface(t).unwrap();
    (texture(&m), notes)
}

fn close(found: Vec3, expected: [f32; 3], error: f32) {
    let expected = Vec3::from_array(expected);
    let difference = (found - expected).abs().max_element();
    assert!(difference <= error, "{found} instead of {expected}");
}

#[test]
fn products_and_mixes_are_exact_at_the_centres_of_texels() {
    for class in [
        "\"scale\" \"texture tex1\" \"wide\" \"texture tex2\" \"tall\"",
        "\"mix\" \"rgb tex1\" [0 0 0] \"texture tex2\" \"tall\" \"texture amount\" \"amount\"",
    ] {
        let (t, notes) = pbrt_texture(class);
        assert!(!notes.contains("mean"), "{notes}");
        let Texels::RgbaF32(texels) = &t.image.texels else {
            panic!("floats expected")
        };
        if class.contains("scale") {
            assert_eq!([t.image.width, t.image.height], [2, 2]);
            assert_eq!(
                texels[..],
                [
                    [0.125, 0.25, 0.5, 1.0],
                    [0.375, 0.5, 0.0625, 1.0],
                    [0.0625, 0.375, 1.0, 1.0],
                    [0.1875, 0.75, 0.125, 1.0]
                ]
            );
        } else {
            assert_eq!([t.image.width, t.image.height], [4, 2]);
            assert_eq!(texels[3], [0.1875, 0.1875, 0.1875, 1.0]);
            assert_eq!(texels[6], [0.1875, 0.5625, 0.75, 1.0]);
        }
        assert_eq!((t.wrap, t.map), ([Wrap::Repeat; 2], Affine2::IDENTITY));
    }
    let (t, notes) = pbrt_texture(
        "\"mix\" \"texture tex1\" \"wide\" \"texture tex2\" \"steps\" \
         \"texture amount\" \"amount\"",
    );
    assert!(!notes.contains("mean"), "{notes}");
    // The wide image is interpolated between its texels, across its edge at the left.
    close(value(&t, 0.125, 0.75), [0.375, 0.625, 0.78125], 1e-6);
    close(value(&t, 0.625, 0.25), [0.71875, 0.78125, 0.6484375], 1e-6);
    let (t, _) = pbrt_texture("\"scale\" \"texture tex\" \"clamped\" \"float scale\" 0.5");
    assert_eq!(t.wrap, [Wrap::Clamp; 2]);
    let (t, notes) =
        pbrt_texture("\"scale\" \"texture tex1\" \"clamped\" \"texture tex2\" \"clamped\"");
    assert!(
        t.wrap == [Wrap::Clamp; 2] && !notes.contains("mean"),
        "{notes}"
    );
    assert_eq!(value(&t, -3.0, 0.5), Vec3::new(0.0625, 0.25, 1.0));
}

#[test]
fn images_with_maps_that_repeat_together_keep_their_maps() {
    let (t, notes) = pbrt_texture("\"scale\" \"texture tex1\" \"fine\" \"texture tex2\" \"wide\"");
    assert!(!notes.contains("mean"), "{notes}");
    assert_eq!([t.image.width, t.image.height], [12, 4]);
    for i in 0..48 {
        let (u, v) = (
            (f64::from(i % 12) + 0.5) / 12.0,
            (f64::from(i / 12) + 0.5) / 4.0,
        );
        let row = if (i / 12) % 2 == 0 { 4.0 } else { 0.0 };
        let step = (row + f64::from(i % 4)) / 8.0;
        let red = if (0.25..0.75).contains(&u) {
            0.25 + 0.5 * (2.0 * u - 0.5)
        } else {
            let from_edge = if u < 0.25 { u } else { u - 1.0 };
            0.5 - from_edge
        };
        let found = value(&t, u + 2.0, v - 1.0).x;
        assert!(
            (f64::from(found) - step * red).abs() < 1e-6,
            "{u} {v}: {found}"
        );
    }
}

#[test]
fn checkerboards_have_images_as_fields() {
    let (t, notes) = pbrt_texture(
        "\"checkerboard\" \"texture tex1\" \"wide\" \"texture tex2\" \"tall\" \"float uscale\" 2 \
         \"float vscale\" 2",
    );
    assert!(!notes.contains("mean"), "{notes}");
    // Fields have half the size of the images; the first is at the bottom left.
    close(value(&t, 0.25, 0.1), [0.25, 0.5, 1.0], 1e-4);
    close(value(&t, 0.75, 0.9), [0.75, 1.0, 0.125], 1e-4);
    close(value(&t, 0.75, 0.25), [0.25, 0.75, 1.0], 1e-4);
    close(value(&t, 5.25, -2.25), [0.5; 3], 1e-4);
    // Three fields along an image of one repeat: both repeat after two images.
    let (t, notes) = pbrt_texture(
        "\"checkerboard\" \"texture tex1\" \"wide\" \"rgb tex2\" [0 1 0] \"float uscale\" 3",
    );
    assert!(!notes.contains("mean"), "{notes}");
    close(value(&t, 0.25, 0.5), [0.25, 0.5, 1.0], 5e-3);
    close(value(&t, 0.5, 0.5), [0.0, 1.0, 0.0], 5e-3);
    close(value(&t, 1.25, 0.5), [0.0, 1.0, 0.0], 5e-3);
    close(value(&t, 1.5, 0.5), [0.5, 0.75, 0.5625], 5e-3);
    // Where a map has no period with the fields, they are the means of their images.
    let (t, notes) = pbrt_texture("\"checkerboard\" \"texture tex1\" \"odd\"");
    assert!(
        notes.contains("line 16") && notes.contains("mean"),
        "{notes}"
    );
    assert_eq!(value(&t, 0.5, 0.5), Vec3::new(0.5, 0.75, 0.5625));
    let (t, notes) =
        pbrt_texture("\"scale\" \"texture tex1\" \"odd\" \"texture tex2\" \"clamped\"");
    assert!(
        notes.contains("do not repeat together cannot be combined; the mean"),
        "{notes}"
    );
    assert_eq!(t.image.width, 2);
}

#[test]
fn dots_cover_the_part_of_the_plane_that_they_cover_in_pbrt() {
    let (t, notes) = pbrt_texture("\"dots\" \"rgb inside\" [1 0.5 0] \"rgb outside\" [0 0 1]");
    assert!(notes.contains("other cells have dots"), "{notes}");
    // Noise is positive in 0.4018 of all cells; of 256 cells the deviation is 0.03.
    let part = std::f32::consts::PI * 0.35 * 0.35;
    let mean = TextureValue::Image(t.clone()).mean(true);
    let dots = mean.x / part * 256.0;
    assert!((dots / 256.0 - 0.4018).abs() < 0.06, "{dots}");
    assert!(
        (dots - dots.round()).abs() < 0.1,
        "dots of the radius 0.35: {dots}"
    );
    close(mean, [mean.x, mean.x / 2.0, 1.0 - mean.x], 1e-5);
    // Cells are around whole numbers, and each of them has a whole dot or none.
    let covered = |s: i32, t_: i32| {
        let inside = |i: i32| {
            let (x, y) = (f64::from(i % 64) + 0.5, f64::from(i / 64) + 0.5);
            value(
                &t,
                f64::from(s) + x / 64.0 - 0.5,
                f64::from(t_) + y / 64.0 - 0.5,
            )
            .x
        };
        (0..4096).map(inside).sum::<f32>() / 4096.0
    };
    for i in 0..40 {
        let found = covered(i % 8, i / 8 - 2);
        assert!(found == 0.0 || (found - part).abs() < 0.005, "{i}: {found}");
    }
    let (t, notes) = pbrt_texture("\"dots\" \"texture inside\" \"wide\" \"rgb outside\" [0 0 2]");
    assert!(!notes.contains("the mean"), "{notes}");
    let blue = |i: i32| value(&t, f64::from(i % 16) + 0.25, f64::from(i / 16)).z;
    let found: Vec<f32> = (0..256).map(blue).collect();
    assert!(found.iter().any(|b| (b - 1.0).abs() < 0.05) && found.contains(&2.0));
    let (m, notes) = pbrt_surface("\"dots\" \"string mapping\" \"planar\"").unwrap();
    assert!(notes.contains("the mean of the texture `dots`"), "{notes}");
    close(m.base_color, [mean.x; 3], 1e-5);
}

#[test]
fn corners_and_coordinates_are_interpolated() {
    let (t, notes) = pbrt_texture(
        "\"bilerp\" \"rgb v00\" [1 0 0] \"rgb v01\" [0 1 0] \"rgb v10\" [0 0 1] \
         \"rgb v11\" [1 1 1] \
         \"float uscale\" 2",
    );
    assert!(notes.contains("extrapolates"), "{notes}");
    assert_eq!(value(&t, 0.0, 0.0), Vec3::X);
    assert_eq!(value(&t, 0.0, 1.0), Vec3::Y);
    assert_eq!(value(&t, 0.5, 0.0), Vec3::Z);
    assert_eq!(value(&t, 0.5, 1.0), Vec3::ONE);
    assert_eq!(value(&t, 0.5, 7.0), Vec3::ONE);
    close(value(&t, 0.125, 0.5), [0.5, 0.5, 0.25], 1e-6);
    let (t, _) = pbrt_texture("\"bilerp\"");
    assert_eq!(value(&t, 0.3, 0.75), Vec3::splat(0.75));
    let (t, _) = pbrt_texture("\"uv\" \"float udelta\" 0.5");
    close(value(&t, 0.25, 3.125), [0.75, 0.125, 0.0], 1e-6);
}

#[test]
fn textures_of_positions_and_directions_have_their_mean() {
    let mean = |class: &str| {
        let (m, notes) = pbrt_surface(class).unwrap();
        assert!(notes.contains("its mean is used"), "{notes}");
        m.base_color.to_array()
    };
    assert_eq!(mean("\"fbm\""), [0.0; 3]);
    assert_eq!(mean("\"wrinkled\" \"integer octaves\" 2"), [0.3; 3]);
    assert_eq!(
        mean("\"directionmix\" \"rgb tex2\" [1 0.5 0]"),
        [0.5, 0.25, 0.0]
    );
    // The spline of pbrt's marble over all phases of its wave.
    let colors = [
        [0.58, 0.58, 0.6],
        [0.58, 0.58, 0.6],
        [0.58, 0.58, 0.6],
        [0.5, 0.5, 0.5],
        [0.6, 0.59, 0.58],
        [0.58, 0.58, 0.6],
        [0.58, 0.58, 0.6],
        [0.2, 0.2, 0.33],
        [0.58, 0.58, 0.6],
    ]
    .map(Vec3::from_array);
    let marble = |i: i32| {
        let at = 3.0 + 3.0 * (std::f32::consts::TAU * (i as f32 + 0.5) / 4096.0).sin();
        let first = (at as usize).min(5);
        let mut points: Vec<Vec3> = colors[first..first + 4].to_vec();
        while points.len() > 1 {
            let next = points.windows(2);
            points = next.map(|p| p[0].lerp(p[1], at - first as f32)).collect();
        }
        1.5 * points[0]
    };
    let expected = (0..4096).map(marble).sum::<Vec3>() / 4096.0;
    close(expected, mean("\"marble\""), 1e-4);
}

#[test]
fn equal_textures_share_an_image() {
    let mut cache = ImageCache::default();
    let board = |cache: &mut ImageCache| {
        let mask = checkerboard(cache, Affine2::IDENTITY).unwrap();
        let fine = ImageTexture {
            map: Affine2::from_scale(Vec2::splat(3.0)),
            ..mask.clone()
        };
        let values = [
            TextureValue::Constant(Vec3::X),
            TextureValue::Image(fine),
            TextureValue::Image(mask),
        ];
        let mixed = mixed(cache, values, &mut |_| panic!("no note expected")).unwrap();
        mixed.image().unwrap().image.clone()
    };
    let (first, second) = (board(&mut cache), board(&mut cache));
    assert!(Arc::ptr_eq(&first, &second));
    assert_eq!([first.width, first.height], [6, 6]);
}

#[test]
fn sizes_and_work_are_bounded() {
    let e = pbrt_surface("\"checkerboard\" \"float uscale\" 3e38 \"float udelta\" -3e38");
    assert!(!e.unwrap().1.contains("mean"));
    for scale in ["3e38", "1e-38", "0", "50000", "0.00003"] {
        let t = format!(
            "\"checkerboard\" \"texture tex1\" \"wide\" \"texture tex2\" \"steps\" \
             \"float uscale\" {scale} \"float vscale\" {scale}"
        );
        let (t, notes) = pbrt_texture(&t);
        assert!(notes.contains("the mean is used"), "{scale}: {notes}");
        assert_eq!(t.image.width, 2);
    }
    let (t, notes) = pbrt_texture(
        "\"checkerboard\" \"texture tex1\" \"stepped\" \"float uscale\" 8100 \"float vscale\" 2",
    );
    assert!(notes.contains("texels would be needed"), "{notes}");
    assert_eq!([t.image.width, t.image.height], [4096, 2]);
    let halves = value(&t, 0.25, 0.5) + value(&t, 0.25, 1.0);
    close(halves, [0.25, 0.5, 1.0], 0.1);
    let e = pbrt_surface(
        "\"mix\" \"texture tex1\" \"wide\" \"rgb tex2\" [1e9 1 1] \"float amount\" 3e38",
    );
    let e = e.unwrap_err();
    assert!(e.contains("line 16") && e.contains("not finite"), "{e}");
}

/// Returns the surface of a texture of Mitsuba, given its attributes and content.
fn mitsuba_surface(version: &str, texture: &str) -> Result<(MaterialDesc, Notes), String> {
    let text = format!(
        "<scene version=\"{version}\"><shape type=\"sphere\"><bsdf type=\"diffuse\">\
         <texture name=\"reflectance\" {texture}</texture></bsdf></shape></scene>"
    );
    material("a.xml", &text, images)
}

#[test]
fn checkerboards_of_images_are_those_of_mitsuba() {
    let bitmap = |name: &str, file: &str, inner: &str| {
        format!(
            "<texture type=\"bitmap\" name=\"{name}\"><string name=\"filename\" value=\"{file}\"/>\
             {inner}</texture>"
        )
    };
    let to_uv = |inner: &str| format!("<transform name=\"to_uv\">{inner}</transform>");
    let nearest = "<string name=\"filter_type\" value=\"nearest\"/>";
    let points = [
        [0.03, 0.07],
        [0.4, 0.11],
        [0.62, 0.2],
        [0.91, 0.83],
        [0.3, 0.71],
        [1.37, -0.57],
        [1.9, 1.45],
        [-0.66, 0.55],
    ];
    // Values of Mitsuba 3.9.1 (scalar_rgb).
    let boards = [
        (
            bitmap(
                "color0",
                "a.png",
                &(nearest.to_owned() + &to_uv("<scale value=\"2\"/>")),
            ) + "<rgb name=\"color1\" value=\"0.1 0.5 0.7\"/>",
            [
                [0.0, 0.02122, 0.08022],
                [0.45641, 0.71569, 0.00121],
                [0.1, 0.5, 0.7],
                [0.67244, 0.9911, 0.01938],
                [0.1, 0.5, 0.7],
                [0.40724, 0.65141, 0.96469],
                [0.1, 0.5, 0.7],
                [0.1, 0.5, 0.7],
            ],
        ),
        (
            to_uv("<scale x=\"2\" y=\"3\"/>")
                + &bitmap("color0", "a.png", "<boolean name=\"raw\" value=\"true\"/>")
                + &bitmap(
                    "color1",
                    "b.png",
                    "<string name=\"wrap_mode\" value=\"mirror\"/>",
                ),
            [
                [0.31224, 0.38517, 0.24447],
                [0.08513, 0.31304, 0.72718],
                [0.24172, 0.60727, 0.00801],
                [0.02061, 0.15075, 0.44496],
                [0.27317, 0.65706, 0.05816],
                [0.58127, 0.23984, 0.10592],
                [0.07831, 0.27277, 0.45423],
                [0.31569, 0.47255, 0.62941],
            ],
        ),
        (
            to_uv("<scale value=\"1.5\"/><translate x=\"0.25\" y=\"0.5\"/>")
                + &bitmap("color0", "a.png", "")
                + &bitmap("color1", "b.png", &to_uv("<rotate z=\"1\" angle=\"90\"/>")),
            [
                [0.36512, 0.10887, 0.26742],
                [0.06691, 0.16148, 0.31008],
                [0.18214, 0.30408, 0.24254],
                [0.67182, 0.17053, 0.06024],
                [0.09609, 0.20802, 0.37601],
                [0.30603, 0.40308, 0.02975],
                [0.49175, 0.22225, 0.09817],
                [0.08833, 0.19784, 0.36331],
            ],
        ),
    ];
    for (inner, expected) in boards {
        let (m, notes) =
            mitsuba_surface("3.0.0", &format!("type=\"checkerboard\">{inner}")).unwrap();
        assert!(!notes.contains("mean"), "{notes}");
        let t = texture(&m);
        for ([u, v], expected) in points.into_iter().zip(expected) {
            // Mitsuba's coordinates start at the top left.
            let found = value(&t, u, 1.0 - v);
            let difference = (found - Vec3::from_array(expected)).abs().max_element();
            assert!(
                difference < 2e-3,
                "{u} {v}: {found} instead of {expected:?}"
            );
        }
    }
}

#[test]
fn textures_of_mitsuba_that_are_nested_are_scaled_and_bounded() {
    let inner = "<texture type=\"bitmap\"><string name=\"filename\" value=\"wide.exr\"/></texture>\
                 <rgb name=\"scale\" value=\"0.5 1 2\"/>";
    let (m, notes) = mitsuba_surface("0.6.0", &format!("type=\"scale\">{inner}")).unwrap();
    assert!(!notes.contains("not supported"), "{notes}");
    assert_eq!(value(&texture(&m), 0.25, 0.5), Vec3::new(0.125, 0.5, 2.0));
    let black = inner.replace("0.5 1 2", "0");
    let (m, _) = mitsuba_surface("0.6.0", &format!("type=\"scale\">{black}")).unwrap();
    assert_eq!(value(&texture(&m), 0.25, 0.5), Vec3::ZERO);
    let (_, notes) = mitsuba_surface("0.6.0", "type=\"scale\">").unwrap();
    assert!(notes.contains("without a texture"), "{notes}");
    let (_, notes) = mitsuba_surface("3.0.0", &format!("type=\"scale\">{inner}")).unwrap();
    assert!(notes.contains("`scale` is not supported"), "{notes}");
    let mut nested = "type=\"checkerboard\">".to_owned();
    for _ in 0..10 {
        nested = format!("type=\"checkerboard\"><texture name=\"color1\" {nested}</texture>");
    }
    let e = mitsuba_surface("3.0.0", &nested).unwrap_err();
    assert!(e.contains("levels deep") && e.contains("line 1"), "{e}");
    let map = "type=\"checkerboard\"><transform name=\"to_uv\"><scale value=\"1e39\"/></transform>";
    let e = mitsuba_surface("3.0.0", map).unwrap_err();
    assert!(e.contains("not finite"), "{e}");
}
