//! Images that other programs made of scenes that nobody here made.
//!
//! A reference is a picture (EXR), the standard error of its pixels (EXR) and a JSON that says how it was made: `scene`,
//! `width`, `height`, `max_depth_edges` (-1 is no bound), `rr_depth`, `bsdf_mode`, `pixel_filter.type`, `file` and
//! `stderr_file`. What cannot be rendered alike is no reference; see [`find`].
//!
//! `bsdf_mode` says what surfaces were made of:
//! - `diffuse`: Lambert reflectors of their base colour. Here `materials.*.model = lambert` makes them so, and the pictures
//!   must be the same up to noise.
//! - `principled`: Mitsuba's principled BSDF. Its opaque lobes are the Disney lobes here within 2e-4; where a pixel sees
//!   no refractive body first, pictures must be the same up to noise. Smooth glass is not made of quite the same
//!   formulas; where it is seen the mean must agree within [`GLASS_BOUND`], and the difference is stated.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::picture::{Judgement, Picture, Setting, judge, render};
use super::technique::{self, Technique};
use super::{Check, Outcome, Request, Verdict};
use crate::cli::load;
use crate::film::Image;
use crate::math::stats::{normal_two_sided_p, sidak};
use crate::output::exr;
use crate::render::cpu::accel::Accel;
use crate::scene::edit::set;
use crate::scene::load::Missing;
use crate::scene::{CompiledScene, compile};
use crate::transport::camera::{Camera, FilterKind, FilterSpec};
use crate::transport::sampler::Sampler;

/// Camera paths of a picture, and those of a quick run.
const PATHS: u64 = 64 * 320 * 180;
const QUICK_PATHS: u64 = 4 * 320 * 180;

/// How many times as many paths a bound on the mean of few pixels needs.
const GLASS_FACTOR: u64 = 4;

/// Samples per pixel of the largest pictures.
const LEAST_SAMPLES: u64 = 2;

/// Marks the seeds of these checks.
const KIND: u64 = 3;

/// Side of a block in pixels.
const BLOCK: u32 = 20;

/// How much the mean of the pixels that see glass may differ, relatively.
pub const GLASS_BOUND: f64 = 0.01;

/// The most edges of a path without a bound; roulette ends it long before.
const UNBOUNDED: u32 = 1000;

/// How many folders below the given one a scene is looked for.
const MOST_FOLDERS: u32 = 4;

/// Camera rays by which a pixel is asked whether it sees glass.
const PROBES: u64 = 16;

/// What the surfaces of a reference were made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surfaces {
    /// Lambert reflectors.
    Diffuse,
    /// Mitsuba's principled BSDF.
    Principled,
}

/// A picture by others, and the scene that it shows.
pub struct Reference {
    /// Its name.
    pub name: String,
    /// What its surfaces were made of.
    pub surfaces: Surfaces,
    /// Greatest number of edges; `None` is no bound.
    pub max_depth: Option<u32>,
    rr_start: u32,
    scene: Arc<CompiledScene>,
    picture: Picture,
}

/// What a JSON among the references turned out to be.
pub enum Entry {
    /// One that can be compared with.
    Usable(Box<Reference>),
    /// Another kind of thing, with the reason why it is left out.
    LeftOut {
        /// Its file without the extension.
        name: String,
        /// Why.
        reason: String,
    },
}

/// The checks of this kind.
///
/// # Errors
/// When a folder, a reference or its scene cannot be read.
pub fn plan(request: &Request) -> Result<Vec<Check>, String> {
    let skip = |name: String, reason: String| vec![Check::new(name, "", move |_| Ok(Outcome::skipped(reason.clone())))];
    let Some(scenes) = &request.scenes else {
        if let Some(folder) = &request.references {
            return Err(format!("--references {} needs --scenes, the folder of their scenes", folder.display()));
        }
        return Ok(skip("all".to_owned(), "no --scenes were given".to_owned()));
    };
    let folder = request.references.clone().unwrap_or_else(|| scenes.join("..").join("references"));
    let mut checks = Vec::new();
    let mut seeds = 0;
    let paths = if request.quick { QUICK_PATHS } else { PATHS };
    for entry in find(&folder, scenes)? {
        match entry {
            Entry::LeftOut { name, reason } => checks.extend(skip(name, reason)),
            Entry::Usable(reference) => {
                let reference = Arc::new(*reference);
                let paths = if reference.surfaces == Surfaces::Principled { GLASS_FACTOR * paths } else { paths };
                let samples = (paths / reference.picture.mean.data.len().max(1) as u64).max(LEAST_SAMPLES);
                for technique in technique::plain() {
                    seeds += 1;
                    let (seed, threads) = (request.seed(KIND, seeds), request.threads);
                    let compared = format!("{technique} with {} surfaces", reference.surfaces.word());
                    let of = Arc::clone(&reference);
                    checks.push(Check::new(reference.name.clone(), compared, move |tests| {
                        Ok(of.compare(&technique, samples, seed, threads, tests)?.outcome())
                    }));
                }
            }
        }
    }
    Ok(checks)
}

/// Reads every JSON of a folder of references, in order of name, with its pictures and its scene, which is looked for
/// below `scenes`.
///
/// # Errors
/// A folder or file that cannot be read, a picture of another size than its JSON says, a scene that is not there: with
/// the file's name and the reason.
pub fn find(folder: &Path, scenes: &Path) -> Result<Vec<Entry>, String> {
    let unreadable = |e: std::io::Error| format!("cannot read the references in {}: {e}", folder.display());
    if !scenes.is_dir() {
        return Err(format!("there is no folder of scenes {}", scenes.display()));
    }
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        files.push(entry.map_err(unreadable)?.path());
    }
    files.retain(|f| f.extension().is_some_and(|e| e == "json"));
    files.sort();
    if files.is_empty() {
        return Err(format!("there is no reference (JSON) in {}", folder.display()));
    }
    files.iter().map(|file| read(file, scenes)).collect()
}

/// A file whose problems carry its name.
fn about(file: &Path) -> impl Fn(&dyn std::fmt::Display) -> String {
    let file = file.display().to_string();
    move |problem| format!("{file}: {problem}")
}

fn read(file: &Path, scenes: &Path) -> Result<Entry, String> {
    let problem = about(file);
    let text = std::fs::read_to_string(file).map_err(|e| problem(&e))?;
    let json: Json = serde_json::from_str(&text).map_err(|e| problem(&format!("no valid JSON: {e}")))?;
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let left_out = |reason: String| Ok(Entry::LeftOut { name: name.clone(), reason });
    if json.get("stderr_file").is_none() {
        return left_out("it names no picture of standard errors (`stderr_file`)".to_owned());
    }
    let word = |key: &str| match json.get(key).and_then(Json::as_str) {
        Some(word) => Ok(word.to_owned()),
        None => Err(problem(&format!("`{key}` is no text"))),
    };
    let number = |key: &str| match json.get(key).and_then(Json::as_i64) {
        Some(n) => Ok(n),
        None => Err(problem(&format!("`{key}` is no whole number"))),
    };
    let surfaces = match word("bsdf_mode")?.as_str() {
        "diffuse" => Surfaces::Diffuse,
        "principled" => Surfaces::Principled,
        other => return left_out(format!("surfaces of the mode `{other}` are not known here")),
    };
    let filter = json.pointer("/pixel_filter/type").and_then(Json::as_str).unwrap_or("unknown");
    if filter != "box" {
        return left_out(format!("its pixel filter is `{filter}`, not `box`"));
    }
    let max_depth = match number("max_depth_edges")? {
        -1 => None,
        edges => Some(u32::try_from(edges).map_err(|_| problem(&format!("`max_depth_edges` is {edges}")))?),
    };
    let beside = |name: String| file.with_file_name(name);
    let mean = picture(&beside(word("file")?))?;
    let mut variance = picture(&beside(word("stderr_file")?))?;
    variance.data.iter_mut().for_each(|p| *p = p.map(|e| e * e));
    let size = [number("width")?, number("height")?];
    for (key, image) in [("file", &mean), ("stderr_file", &variance)] {
        let found = [image.width, image.height].map(i64::from);
        if found != size {
            return Err(problem(&format!("`{key}` is a picture of {found:?} pixels, not of {size:?}")));
        }
    }
    let scene = word("scene")?;
    let Some(path) = below(scenes, &scene, MOST_FOLDERS) else {
        return Err(problem(&format!("its scene {scene} is not below {}", scenes.display())));
    };
    Ok(Entry::Usable(Box::new(Reference {
        name,
        surfaces,
        max_depth,
        rr_start: u32::try_from(number("rr_depth")?).unwrap_or(u32::MAX),
        scene: Arc::new(compiled(&path, surfaces)?),
        picture: Picture::known(mean, variance),
    })))
}

pub(super) fn picture(file: &Path) -> Result<Image, String> {
    let problem = about(file);
    let bytes = std::fs::read(file).map_err(|e| problem(&e))?;
    let (image, _) = exr::decode(&bytes).map_err(|e| problem(&e))?;
    match image.data.iter().flatten().all(|v| v.is_finite()) {
        true => Ok(image),
        false => Err(problem(&"it has pixels that are no numbers")),
    }
}

fn compiled(path: &Path, surfaces: Surfaces) -> Result<CompiledScene, String> {
    let (mut desc, _) = load::scene(path, Missing::Refused).map_err(|e| e.to_string())?;
    if surfaces == Surfaces::Diffuse {
        set(&mut desc, "materials.*.model", &"lambert".into()).map_err(|e| e.to_string())?;
    }
    Ok(compile(&desc).map_err(|e| e.to_string())?.0)
}

/// The file of this name in a folder or in the nearest of the folders below it.
fn below(folder: &Path, name: &str, folders: u32) -> Option<PathBuf> {
    let here = folder.join(name);
    if here.is_file() {
        return Some(here);
    }
    let mut inner: Vec<PathBuf> = std::fs::read_dir(folder).ok()?.flatten().map(|e| e.path()).collect();
    inner.retain(|path| path.is_dir());
    inner.sort();
    if folders == 0 {
        return None;
    }
    inner.iter().find_map(|path| below(path, name, folders - 1))
}

impl Surfaces {
    fn word(self) -> &'static str {
        match self {
            Surfaces::Diffuse => "diffuse",
            Surfaces::Principled => "principled",
        }
    }
}

impl Reference {
    /// Renders the same picture and compares, as one of `tests` such questions.
    ///
    /// # Errors
    /// When it cannot be rendered, with a message for people.
    pub fn compare(
        &self,
        technique: &Technique,
        samples: u64,
        seed: u64,
        threads: usize,
        tests: usize,
    ) -> Result<Comparison, String> {
        let resolution = [self.picture.mean.width, self.picture.mean.height];
        let setting = Setting {
            resolution,
            max_depth: self.max_depth.unwrap_or(UNBOUNDED),
            rr_start: self.max_depth.is_none().then_some(self.rr_start),
            samples,
            seed,
            threads,
        };
        let ours = render(&self.scene, technique, setting)?;
        if self.surfaces == Surfaces::Diffuse {
            return Ok(Comparison { opaque: judge(&ours, &self.picture, BLOCK, tests), glass: None });
        }
        let glass = sees_glass(&self.scene, resolution)?;
        let is_glass = |x: u32, y: u32| glass[(y * resolution[0] + x) as usize];
        let part = |p: &Picture, wanted: bool| p.only(|x, y| is_glass(x, y) == wanted);
        let opaque = judge(&part(&ours, false), &part(&self.picture, false), BLOCK, tests);
        let seen = glass.contains(&true).then(|| Glass::new(&part(&ours, true), &part(&self.picture, true), tests));
        Ok(Comparison { opaque, glass: seen })
    }
}

/// Which pixels have a refractive body as the first thing that some ray meets.
fn sees_glass(scene: &Arc<CompiledScene>, resolution: [u32; 2]) -> Result<Vec<bool>, String> {
    let accel = Accel::build(Arc::clone(scene)).map_err(|e| e.to_string())?;
    let camera = Camera::new(&scene.camera, resolution, FilterSpec { kind: FilterKind::Box, radius: 0.5 });
    let pixels = (0..resolution[1]).flat_map(|y| (0..resolution[0]).map(move |x| [x, y]));
    let sees = |pixel: [u32; 2]| {
        (0..PROBES).any(|sample| {
            let ray = camera.sample_ray(pixel, &mut Sampler::new(0, pixel, sample));
            let hit = accel.closest(&ray, f32::INFINITY);
            hit.is_some_and(|hit| {
                scene.materials[scene.material_of(hit.primitive, hit.instance) as usize].opacity < 1.0
            })
        })
    };
    Ok(pixels.map(sees).collect())
}

/// How a picture compares with its reference.
pub struct Comparison {
    /// All pixels, or those that see no glass first.
    pub opaque: Judgement,
    /// Those that do.
    pub glass: Option<Glass>,
}

/// The pixels that see glass, taken together.
#[derive(Clone, Copy, Debug)]
pub struct Glass {
    /// Ratio of the means, ours over theirs.
    pub ratio: f64,
    /// Its standard error.
    pub error: f64,
    tests: usize,
}

impl Glass {
    fn new(ours: &Picture, theirs: &Picture, tests: usize) -> Glass {
        let ((a, ea), (b, eb)) = (ours.total(), theirs.total());
        Glass { ratio: a / b, error: a / b * (ea / a).hypot(eb / b), tests }
    }

    /// Whether the difference is not significantly more than [`GLASS_BOUND`].
    pub fn agrees(&self) -> bool {
        let beyond = (self.ratio - 1.0).abs() - GLASS_BOUND;
        beyond <= 0.0 || normal_two_sided_p(beyond / self.error) > sidak(super::SIGNIFICANCE, self.tests)
    }

    /// Whether noise is small enough for the bound to mean anything.
    fn is_sharp(&self) -> bool {
        self.error < GLASS_BOUND
    }
}

impl Comparison {
    /// Whether both parts agree.
    pub fn agrees(&self) -> bool {
        self.opaque.agrees && self.glass.as_ref().is_none_or(Glass::agrees)
    }

    /// The verdict with the statistics.
    pub fn outcome(&self) -> Outcome {
        let Some(glass) = &self.glass else { return self.opaque.outcome() };
        if self.opaque.too_dark() {
            return self.opaque.outcome();
        }
        let percent = |x: f64| 100.0 * x;
        let difference = format!("{:+.2} ± {:.2} %", percent(glass.ratio - 1.0), percent(glass.error));
        let part = if glass.is_sharp() {
            format!("glass {difference}, allowed {:.0} %", percent(GLASS_BOUND))
        } else {
            format!("glass {difference}, too noisy to be judged")
        };
        Outcome {
            verdict: if self.agrees() { Verdict::Passed } else { Verdict::Failed },
            statement: format!("opaque {}; {part}", self.opaque.statement()),
            figures: json!({
                "opaque": self.opaque.figures(),
                "glass": { "ratio": glass.ratio, "ratio_error": glass.error, "bound": GLASS_BOUND },
            }),
        }
    }
}
