//! Pictures of shipped scripts are not displayed white: at most a tenth of the object is.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use lumbre_light::film::Image;
use lumbre_light::film::layer::{Layer, PathSubset};
use lumbre_light::math::luminance::luminance_f32;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::SceneDesc;
use lumbre_light::value::Value;
use lumbre_lua::scene;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::plan::Plan;
use lumbre_render::{Renderer, cpu::renderer::CpuRenderer};
use lumbre_scene_io::load::MissingTextures;

use super::shipped::{planned, scripts};
use crate::common::named_job;

/// Greatest share of the object of a picture that may be saturated.
const MAX_SHARE: f64 = 0.1;

/// Script of the gallery, which shows dark rooms and a court in the sun with one tone map.
const GALLERY: &str = "scenes";

/// Greatest share of the object that may be saturated in a picture of [`GALLERY`].
const MAX_SHARE_OF_GALLERY: f64 = 0.2;

/// Displayed value from which on a pixel is saturated; curves round 1 down.
const WHITE: f32 = 0.99999;

/// Width of the rendered pictures, in pixels.
const WIDTH: u32 = 32;

/// Samples of each pixel.
const SAMPLES: u64 = 24;

/// A picture of shipped scripts, and how they display it.
struct Shown {
    scene: Arc<SceneDesc>,
    /// Scene file, as a script names it.
    file: String,
    size: [u32; 2],
    max_depth: u32,
    /// Tone maps, each with the names of the scripts that use it.
    displays: Vec<(Tonemap, Vec<String>)>,
}

/// Returns the tone maps with which a night of the plan displays pictures, except those that are
/// chosen for each picture.
fn displays(plan: &Plan) -> Vec<Tonemap> {
    let mut found = vec![plan.measure.display];
    found.extend(plan.report.display);
    found.extend(plan.sheets.iter().filter_map(|sheet| sheet.display));
    found
}

/// Adds the pictures of a plan, by the hash of their scene with all changes. Paths are as long as the
/// longest of any cell, and all techniques have one picture.
fn add(plan: &Plan, name: &str, pictures: &mut BTreeMap<String, Shown>) {
    for cell in &plan.cells {
        let key = cell.identity.field("scene").to_string();
        let [width, height] = cell.config.resolution.unwrap_or(cell.scene.resolution);
        let shown = pictures.entry(key).or_insert_with(|| Shown {
            scene: Arc::clone(&cell.scene),
            file: cell.config.scene.clone(),
            size: [WIDTH, (WIDTH * height).div_ceil(width)],
            max_depth: 1,
            displays: Vec::new(),
        });
        let max_depth = cell.config.max_depth.unwrap_or(cell.scene.max_depth);
        shown.max_depth = shown.max_depth.max(max_depth);
        for display in displays(plan) {
            let known = shown
                .displays
                .iter_mut()
                .find(|(known, _)| *known == display);
            match known {
                Some((_, names)) if names.iter().any(|known| known == name) => {}
                Some((_, names)) => names.push(name.to_owned()),
                None => shown.displays.push((display, vec![name.to_owned()])),
            }
        }
    }
}

/// Returns the distinct pictures of all shipped scripts.
fn shown() -> BTreeMap<String, Shown> {
    let mut scenes: BTreeMap<(PathBuf, String), _> = BTreeMap::new();
    let mut pictures = BTreeMap::new();
    for folder in ["scripts", "scripts/recipes", "scripts/theses"] {
        for file in scripts(folder) {
            let name = file.file_stem().unwrap().to_string_lossy().into_owned();
            let quick = ("quick".to_owned(), vec![Value::Bool(true)]);
            let axes = Some(quick).filter(|_| folder.ends_with("theses"));
            let plan = planned(&file, axes.as_slice(), &mut |path, options| {
                let key = (path.to_owned(), format!("{options:?}"));
                if let Some(known) = scenes.get(&key) {
                    return Ok(Clone::clone(known));
                }
                let read = scene::read(path, options, MissingTextures::Fail)?;
                scenes.insert(key, read.clone());
                Ok(read)
            });
            let plan = plan.unwrap_or_else(|e| panic!("{name}: {e}"));
            add(&plan, &name, &mut pictures);
        }
    }
    pictures
}

/// Renders a picture, and returns it with the object of each pixel: whether all samples hit surfaces
/// and none sees a light.
fn render(shown: &Shown) -> (Image, Vec<bool>) {
    let (compiled, _) = compile(&shown.scene).unwrap();
    let job = named_job("bdpt", shown.size, shown.max_depth, 1);
    let job = job.with(|settings| settings.films = vec![Layer::Depth, Layer::Distance]);
    let mut renderer = CpuRenderer::new(Arc::new(compiled), job).unwrap();
    renderer.advance(SAMPLES).unwrap();
    let layers = renderer.layer_images().unwrap();
    let layer = |layer, subset| {
        let found = layers
            .iter()
            .find(|i| i.film.layer == layer && i.film.subset == subset);
        &found.unwrap().image.data
    };
    let emitted = layer(Layer::Depth, PathSubset::Depth(1)).iter();
    let hits = layer(Layer::Distance, PathSubset::Whole).iter();
    let object = hits
        .zip(emitted)
        .map(|(hit, emitted)| hit[1] >= 1.0 && *emitted == [0.0; 3]);
    (renderer.film().mean(), object.collect())
}

/// Returns the share of the object that a tone map saturates: pixels whose luminance is displayed as
/// white, and still so with 2 % less light.
fn saturated_share(image: &Image, object: &[bool], display: Tonemap) -> f64 {
    let mut grey = image.clone();
    for pixel in &mut grey.data {
        *pixel = [0.98 * luminance_f32(*pixel); 3];
    }
    let pixels = display.apply(&grey).data;
    let of_object = || {
        pixels
            .iter()
            .zip(object)
            .filter(|(_, is_object)| **is_object)
    };
    let saturated = of_object().filter(|(pixel, _)| pixel[0] >= WHITE);
    saturated.count() as f64 / of_object().count().max(1) as f64
}

#[test]
fn pictures_of_shipped_scripts_are_not_white() {
    let pictures = shown();
    assert!(pictures.len() > 150, "{}", pictures.len());
    let mut white = Vec::new();
    for shown in pictures.values() {
        let (image, object) = render(shown);
        for (display, names) in &shown.displays {
            let share = saturated_share(&image, &object, *display);
            let names = names.iter().map(String::as_str).filter(|name| {
                let most = if *name == GALLERY {
                    MAX_SHARE_OF_GALLERY
                } else {
                    MAX_SHARE
                };
                share > most
            });
            let names: Vec<_> = names.collect();
            if !names.is_empty() {
                let (names, file) = (names.join(", "), &shown.file);
                let percent = 100.0 * share;
                white.push(format!(
                    "{names}: {percent:.0} % of {file} with {display}\n"
                ));
            }
        }
    }
    assert!(
        white.is_empty(),
        "change `display` of these scripts; saturated are\n{}",
        white.concat()
    );
}

#[test]
fn a_white_object_is_found_beside_a_background() {
    // A quarter of the picture is an object, of which one half is four times as bright as white.
    let radiance = |x: u32, y: u32| match (x < 4, y < 4) {
        (true, true) => 4.0,
        (true, false) => 1.0,
        (false, _) => 9.0,
    };
    let image = Image::from_fn(16, 8, |x, y| [radiance(x, y); 3]);
    let object: Vec<bool> = (0..16 * 8).map(|i| i % 16 < 4).collect();
    let srgb = |exposure| Tonemap::Srgb { exposure };
    assert_eq!(saturated_share(&image, &object, srgb(0.0)), 0.5);
    assert_eq!(saturated_share(&image, &object, srgb(-2.0)), 0.0);
    let reinhard = Tonemap::Reinhard {
        exposure: 0.0,
        gamma: 2.2,
    };
    assert_eq!(saturated_share(&image, &object, reinhard), 0.0);
    // Red of a luminance below that of white is not white.
    let red = Image::from_fn(16, 8, |_, _| [2.0, 0.1, 0.1]);
    assert_eq!(saturated_share(&red, &object, srgb(0.0)), 0.0);
    assert_eq!(saturated_share(&red, &object, srgb(2.0)), 1.0);
    assert_eq!(saturated_share(&red, &[false; 16 * 8], srgb(2.0)), 0.0);
}
