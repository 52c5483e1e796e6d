//! Directions of anisotropy from a texture, compared with turned texture coordinates here and in
//! Mitsuba.

use std::path::Path;

use lumbre_light::film::Image;

use super::external::interpreter;
use super::workplace::Workplace;

/// Side of a block of pixels.
const BLOCK: u32 = 8;

/// Renders the plate and returns its picture.
fn picture(place: &Workplace, technique: &str, directions: &str, python: &str) -> Image {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = root.join("scripts/recipes/scenes/brushed_plate.lua");
    let script = format!(
        r#"
local x = experiment("plate_{directions}_{name}", {{ seed = 3 }})
x:render(function(p)
  return {{
    scene = [[{scene}]], scene_options = {{ directions = "{directions}" }}, view = "plate",
    integrator = "{technique}", {python} resolution = {{ 48, 40 }}, max_depth = 2,
  }}
end)
x:stop(stop.samples(1024))
return x
"#,
        name = technique.replace(':', "_"),
        scene = scene.display(),
        python = if technique == "nee" {
            String::new()
        } else {
            format!("python = [[{python}]],")
        },
    );
    place.write("plate.lua", &script);
    let out = format!("out-{directions}-{}", technique.replace(':', "-"));
    place.succeed(&["run", "plate.lua", "-q", "--backend", "cpu", "--out", &out]);
    let exr = place.first_ending(&out, "final.exr");
    let bytes = std::fs::read(place.path(&exr)).unwrap();
    lumbre_report::exr::decode(&bytes).unwrap().0
}

/// Returns the greatest difference of the mean luminance of blocks, relative to the mean of the
/// picture.
fn difference(a: &Image, b: &Image) -> f64 {
    let grey =
        |image: &Image, x: u32, y: u32| image.at(x, y).iter().map(|v| f64::from(*v)).sum::<f64>();
    let block = |image: &Image, left: u32, top: u32| -> f64 {
        let pixels = (0..BLOCK * BLOCK).map(|i| (left + i % BLOCK, top + i / BLOCK));
        pixels.map(|(x, y)| grey(image, x, y)).sum()
    };
    let blocks = || (0..a.height / BLOCK).flat_map(|y| (0..a.width / BLOCK).map(move |x| (x, y)));
    let mean = blocks()
        .map(|(x, y)| block(a, x * BLOCK, y * BLOCK))
        .sum::<f64>();
    let mean = mean / blocks().count() as f64;
    blocks()
        .map(|(x, y)| {
            let [a, b] = [a, b].map(|image| block(image, x * BLOCK, y * BLOCK));
            (a - b).abs() / mean
        })
        .fold(0.0, f64::max)
}

#[test]
fn a_texture_of_directions_equals_turned_coordinates() {
    let place = Workplace::new();
    let [texture, coordinates, none] =
        ["texture", "coordinates", "none"].map(|kind| picture(&place, "nee", kind, ""));
    let same = difference(&texture, &coordinates);
    let other = difference(&texture, &none);
    println!("turned coordinates {same}, without directions {other}");
    assert!(same < 0.02, "{same}");
    assert!(other > 0.3, "{other}");
}

#[test]
fn a_texture_of_directions_equals_the_plate_in_mitsuba() {
    let Some(python) = interpreter() else {
        crate::common::skipped(
            "no interpreter with the package mitsuba; name one with LUMBRE_MITSUBA_PYTHON",
        );
        return;
    };
    let place = Workplace::new();
    let texture = picture(&place, "nee", "texture", &python);
    let mitsuba = picture(&place, "external:mitsuba", "coordinates", &python);
    let off = difference(&texture, &mitsuba);
    println!("Mitsuba {off}");
    assert!(off < 0.03, "{off}");
}
