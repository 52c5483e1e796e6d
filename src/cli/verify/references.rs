//! Checks against reference images that other programs rendered of third-party scenes.
//!
//! A reference consists of a picture (EXR), the standard error of its pixels (EXR) and a JSON file
//! with `scene`, `width`, `height`, `max_depth_edges` (-1 means unbounded), `rr_depth`,
//! `bsdf_mode`, `pixel_filter.type`, `file` and `stderr_file`. References with settings that
//! cannot be reproduced are excluded; see [`find`].
//!
//! `bsdf_mode` is the material model of the reference:
//! - `diffuse`: Lambert reflectors of their base colour. Here `materials.*.model = lambert`
//!   selects them, and the pictures must be equal up to noise.
//! - `principled`: Mitsuba's principled BSDF. Its opaque lobes equal the Disney lobes here within
//!   2e-4; pixels that do not see a refractive body first must be equal up to noise. The formulas
//!   for smooth glass differ slightly; where glass is visible the mean must agree within
//!   [`GLASS_BOUND`], and the difference is reported.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use serde_json::json;

use super::picture::{Judgement, NoisyPicture, Setting, confirmed, judge, render};
use super::technique::{self, Technique};
use super::{Check, Outcome, SeedFamily, Verdict, VerifyRequest};
use crate::cli::night::load;
use lumbre_light::film::Image;
use lumbre_light::math::stats::{normal_two_sided_p, sidak};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::camera::{Camera, FilterKind, FilterSpec};
use lumbre_light::transport::sampler::Sampler;
use lumbre_render::cpu::bvh::accel::Accel;
use lumbre_report::exr;
use lumbre_scene_io::edit::set;
use lumbre_scene_io::load::MissingTextures;

/// Number of camera paths of a picture, in a full and in a quick run.
const PATHS: u64 = 64 * 320 * 180;
const QUICK_PATHS: u64 = 4 * 320 * 180;

/// Factor on the number of paths for principled surfaces: the mean of few pixels is tested.
const GLASS_FACTOR: u64 = 4;

/// Smallest number of samples per pixel, used for the largest pictures.
const MIN_SAMPLES: u64 = 2;

/// Side of a block in pixels.
const BLOCK: u32 = 20;

/// Largest relative difference of the mean over pixels that see glass.
pub const GLASS_BOUND: f64 = 0.01;

/// Path depth for unbounded references; Russian roulette terminates paths long before.
const UNBOUNDED: u32 = 1000;

/// Depth of subfolders in which a scene is searched.
const MAX_FOLDERS: u32 = 4;

/// Number of camera rays per pixel for detecting glass.
const PROBES: u64 = 16;

lumbre_light::named! {
    /// Material model of a reference.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Surfaces {
        /// Lambert reflectors only.
        Diffuse = "diffuse",
        /// Mitsuba's principled BSDF.
        Principled = "principled",
    }
}

/// A picture rendered by another program, and its scene.
pub struct Reference {
    /// File name without extension.
    pub name: String,
    /// Material model of the object.
    pub surfaces: Surfaces,
    /// Largest number of path edges; `None` means unbounded.
    pub max_depth: Option<u32>,
    rr_start: u32,
    scene: Arc<CompiledScene>,
    picture: NoisyPicture,
}

/// Content of a JSON file in the folder of references.
pub enum ReferenceFile {
    /// A usable reference.
    Usable(Box<Reference>),
    /// A file that cannot be used as a reference.
    Excluded {
        /// File name without extension.
        name: String,
        /// Reason for the exclusion.
        reason: String,
    },
}

/// Lists the checks against references.
///
/// # Errors
/// If a folder, a reference or its scene cannot be read.
pub fn plan(request: &VerifyRequest) -> Result<Vec<Check>, String> {
    let skip = |name: String, reason: String| {
        vec![Check::new(name, "", move |_| {
            Ok(Outcome::skipped(reason.clone()))
        })]
    };
    let Some(scenes) = &request.scenes else {
        if let Some(folder) = &request.references {
            return Err(format!(
                "--references {} needs --scenes, the folder of their scenes",
                folder.display()
            ));
        }
        return Ok(skip("all".to_owned(), "--scenes was not given".to_owned()));
    };
    let folder = request
        .references
        .clone()
        .unwrap_or_else(|| scenes.join("..").join("references"));
    let mut checks = Vec::new();
    let mut seeds = 0;
    let paths = if request.quick { QUICK_PATHS } else { PATHS };
    for entry in find(&folder, scenes)? {
        match entry {
            ReferenceFile::Excluded { name, reason } => checks.extend(skip(name, reason)),
            ReferenceFile::Usable(reference) => {
                let reference = Arc::new(*reference);
                let paths = if reference.surfaces == Surfaces::Principled {
                    GLASS_FACTOR * paths
                } else {
                    paths
                };
                let samples =
                    (paths / reference.picture.mean.data.len().max(1) as u64).max(MIN_SAMPLES);
                for technique in technique::plain() {
                    seeds += 1;
                    let (seed, threads) =
                        (request.seed(SeedFamily::Reference, seeds), request.threads);
                    let compared =
                        format!("{technique} with {} surfaces", reference.surfaces.name());
                    let reference = Arc::clone(&reference);
                    checks.push(Check::new(reference.name.clone(), compared, move |tests| {
                        confirmed(|attempt| {
                            let setting =
                                attempt.setting(reference.setting(samples, seed, threads));
                            Ok(reference.compare(&technique, setting, tests)?.outcome())
                        })
                    }));
                }
            }
        }
    }
    Ok(checks)
}

/// Reads every JSON file of a folder of references in order of name, with its pictures and its
/// scene, which is searched below `scenes`.
///
/// # Errors
/// If a folder or file cannot be read, a picture has another size than its JSON file states, or a
/// scene is missing. The message contains the file's name and the reason.
pub fn find(folder: &Path, scenes: &Path) -> Result<Vec<ReferenceFile>, String> {
    let unreadable =
        |e: std::io::Error| format!("cannot read the references in {}: {e}", folder.display());
    if !scenes.is_dir() {
        return Err(format!(
            "the scenes folder {} does not exist",
            scenes.display()
        ));
    }
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        files.push(entry.map_err(unreadable)?.path());
    }
    files.retain(|f| f.extension().is_some_and(|e| e == "json"));
    files.sort();
    if files.is_empty() {
        return Err(format!(
            "the folder {} contains no references (JSON files)",
            folder.display()
        ));
    }
    files.iter().map(|file| read(file, scenes)).collect()
}

/// Returns a function that prefixes error messages with the file's name.
fn named_error(file: &Path) -> impl Fn(&dyn std::fmt::Display) -> String {
    let file = file.display().to_string();
    move |problem| format!("{file}: {problem}")
}

/// Reads one JSON file of the folder of references.
fn read(file: &Path, scenes: &Path) -> Result<ReferenceFile, String> {
    let problem = named_error(file);
    let name = file
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let Some(settings) = ReferenceSettings::read(file)? else {
        let reason = "it has no picture of standard errors (`stderr_file`)".to_owned();
        return Ok(ReferenceFile::Excluded { name, reason });
    };
    let surfaces = match settings.surfaces() {
        Ok(surfaces) => surfaces,
        Err(reason) => return Ok(ReferenceFile::Excluded { name, reason }),
    };
    let max_depth = match settings.max_depth_edges {
        -1 => None,
        edges => Some(u32::try_from(edges).map_err(|_| {
            problem(&format!(
                "`max_depth_edges` is {edges}; expected -1 or a positive number"
            ))
        })?),
    };
    let scene = &settings.scene;
    let picture = settings.picture(file)?;
    let Some(path) = find_below(scenes, scene, MAX_FOLDERS) else {
        return Err(problem(&format!(
            "the scene {scene} was not found below {}",
            scenes.display()
        )));
    };
    Ok(ReferenceFile::Usable(Box::new(Reference {
        name,
        surfaces,
        max_depth,
        rr_start: u32::try_from(settings.rr_depth).unwrap_or(u32::MAX),
        scene: Arc::new(compiled(&path, surfaces)?),
        picture,
    })))
}

/// The JSON file of a reference, which another program wrote. Other fields are of no interest.
#[derive(Deserialize)]
struct ReferenceSettings {
    /// File name of the scene.
    scene: String,
    /// File name of the picture.
    file: String,
    /// File name of the picture of standard errors.
    stderr_file: String,
    /// Width of the picture in pixels.
    width: u32,
    /// Height of the picture in pixels.
    height: u32,
    /// Largest number of path edges; -1 means unbounded.
    max_depth_edges: i64,
    /// Depth at which Russian roulette starts.
    rr_depth: i64,
    /// Material model of the object.
    bsdf_mode: String,
    pixel_filter: Option<PixelFilter>,
}

/// The field without which a reference cannot be used.
#[derive(Deserialize)]
struct StandardErrors {
    stderr_file: Option<String>,
}

#[derive(Deserialize)]
struct PixelFilter {
    #[serde(rename = "type")]
    kind: String,
}

impl ReferenceSettings {
    /// Reads a file. Returns `None` if it states no picture of standard errors.
    fn read(file: &Path) -> Result<Option<ReferenceSettings>, String> {
        let problem = named_error(file);
        let invalid = |e: serde_json::Error| problem(&format!("invalid JSON: {e}"));
        let text = std::fs::read_to_string(file).map_err(|e| problem(&e))?;
        let errors: StandardErrors = serde_json::from_str(&text).map_err(invalid)?;
        if errors.stderr_file.is_none() {
            return Ok(None);
        }
        serde_json::from_str(&text).map(Some).map_err(invalid)
    }

    /// Returns the material model, or the reason why the reference is excluded.
    fn surfaces(&self) -> Result<Surfaces, String> {
        let mode = &self.bsdf_mode;
        let surfaces = Surfaces::from_name(mode).ok_or_else(|| {
            let names = Surfaces::NAMES.join(", ");
            format!("its `bsdf_mode` is `{mode}`; supported: {names}")
        })?;
        let filter = self.pixel_filter.as_ref();
        let filter = filter.map_or("unknown", |filter| filter.kind.as_str());
        if filter != "box" {
            return Err(format!(
                "its pixel filter is `{filter}`; only `box` is supported"
            ));
        }
        Ok(surfaces)
    }

    /// Reads the picture and its standard errors, which lie beside the JSON file.
    fn picture(&self, json: &Path) -> Result<NoisyPicture, String> {
        let mean = picture(&json.with_file_name(&self.file))?;
        let mut variance = picture(&json.with_file_name(&self.stderr_file))?;
        variance.data.iter_mut().for_each(|p| *p = p.map(|e| e * e));
        let size = [self.width, self.height];
        for (key, image) in [("file", &mean), ("stderr_file", &variance)] {
            let actual = [image.width, image.height];
            if actual != size {
                return Err(named_error(json)(&format!(
                    "`{key}` is a picture of {actual:?} pixels, but the JSON file states {size:?}"
                )));
            }
        }
        Ok(NoisyPicture::from_values(mean, variance))
    }
}

/// Reads an EXR picture whose pixels must all be finite.
pub(super) fn picture(file: &Path) -> Result<Image, String> {
    let problem = named_error(file);
    let bytes = std::fs::read(file).map_err(|e| problem(&e))?;
    let (image, _) = exr::decode(&bytes).map_err(|e| problem(&e))?;
    if image.data.iter().flatten().all(|v| v.is_finite()) {
        Ok(image)
    } else {
        Err(problem(&"the picture has NaN or infinite pixels"))
    }
}

/// Loads and compiles the scene of a reference.
fn compiled(path: &Path, surfaces: Surfaces) -> Result<CompiledScene, String> {
    let (mut desc, _) = load::load_scene(path, MissingTextures::Fail).map_err(|e| e.to_string())?;
    if surfaces == Surfaces::Diffuse {
        set(&mut desc, "materials.*.model", &"lambert".into()).map_err(|e| e.to_string())?;
    }
    Ok(compile(&desc).map_err(|e| e.to_string())?.0)
}

/// Finds a file by name in a folder or in the nearest of its subfolders.
fn find_below(folder: &Path, name: &str, folders: u32) -> Option<PathBuf> {
    let candidate = folder.join(name);
    if candidate.is_file() {
        return Some(candidate);
    }
    let mut inner: Vec<PathBuf> = std::fs::read_dir(folder)
        .ok()?
        .flatten()
        .map(|e| e.path())
        .collect();
    inner.retain(|path| path.is_dir());
    inner.sort();
    if folders == 0 {
        return None;
    }
    inner
        .iter()
        .find_map(|path| find_below(path, name, folders - 1))
}

impl Reference {
    /// Returns the setting in which a picture is rendered that is compared with the reference.
    pub fn setting(&self, samples: u64, seed: u64, threads: usize) -> Setting {
        Setting {
            resolution: [self.picture.mean.width, self.picture.mean.height],
            max_depth: self.max_depth.unwrap_or(UNBOUNDED),
            rr_start: self.max_depth.is_none().then_some(self.rr_start),
            samples,
            seed,
            threads,
        }
    }

    /// Renders the same picture in a [`Reference::setting`] and compares it with the reference, as
    /// one of `tests` tests.
    ///
    /// # Errors
    /// A message for the user if the picture cannot be rendered.
    pub fn compare(
        &self,
        technique: &Technique,
        setting: Setting,
        tests: usize,
    ) -> Result<Comparison, String> {
        let resolution = setting.resolution;
        let rendered = render(&self.scene, technique, setting)?;
        if self.surfaces == Surfaces::Diffuse {
            return Ok(Comparison {
                opaque: judge(&rendered, &self.picture, BLOCK, tests),
                glass: None,
            });
        }
        let glass = sees_glass(&self.scene, resolution)?;
        let is_glass = |x: u32, y: u32| glass[(y * resolution[0] + x) as usize];
        let part = |p: &NoisyPicture, glass: bool| p.masked(|x, y| is_glass(x, y) == glass);
        let opaque = judge(
            &part(&rendered, false),
            &part(&self.picture, false),
            BLOCK,
            tests,
        );
        let glass = glass.contains(&true).then(|| {
            GlassComparison::new(&part(&rendered, true), &part(&self.picture, true), tests)
        });
        Ok(Comparison { opaque, glass })
    }
}

/// Marks the pixels in which some camera ray hits a refractive body first.
fn sees_glass(scene: &Arc<CompiledScene>, resolution: [u32; 2]) -> Result<Vec<bool>, String> {
    let accel = Accel::build(Arc::clone(scene)).map_err(|e| e.to_string())?;
    let camera = Camera::new(
        &scene.camera,
        resolution,
        FilterSpec {
            kind: FilterKind::Box,
            radius: 0.5,
        },
    );
    let pixels = (0..resolution[1]).flat_map(|y| (0..resolution[0]).map(move |x| [x, y]));
    let sees = |pixel: [u32; 2]| {
        (0..PROBES).any(|sample| {
            let ray = camera.sample_ray(pixel, &mut Sampler::new(0, pixel, sample));
            let hit = accel.closest(&ray, f32::INFINITY);
            hit.is_some_and(|hit| {
                scene.materials[scene.material_of(hit.primitive, hit.instance) as usize].opacity
                    < 1.0
            })
        })
    };
    Ok(pixels.map(sees).collect())
}

/// Comparison of a picture with its reference.
pub struct Comparison {
    /// Result for all pixels, or for those that do not see glass first.
    pub opaque: Judgement,
    /// Result for the pixels that see glass first.
    pub glass: Option<GlassComparison>,
}

/// Mean over the pixels that see glass first, relative to the reference.
#[derive(Clone, Copy, Debug)]
pub struct GlassComparison {
    /// Ratio of the means, rendered over reference.
    pub ratio: f64,
    /// Standard error of the ratio.
    pub error: f64,
    tests: usize,
}

impl GlassComparison {
    fn new(rendered: &NoisyPicture, reference: &NoisyPicture, tests: usize) -> GlassComparison {
        let ((a, ea), (b, eb)) = (rendered.total(), reference.total());
        GlassComparison {
            ratio: a / b,
            error: a / b * (ea / a).hypot(eb / b),
            tests,
        }
    }

    /// Whether the difference is not significantly larger than [`GLASS_BOUND`].
    pub fn agrees(&self) -> bool {
        let beyond = (self.ratio - 1.0).abs() - GLASS_BOUND;
        beyond <= 0.0
            || normal_two_sided_p(beyond / self.error) > sidak(super::SIGNIFICANCE, self.tests)
    }

    /// Whether the standard error is smaller than the bound.
    fn is_precise(&self) -> bool {
        self.error < GLASS_BOUND
    }
}

impl Comparison {
    /// Whether both parts agree.
    pub fn agrees(&self) -> bool {
        self.opaque.agrees && self.glass.as_ref().is_none_or(GlassComparison::agrees)
    }

    /// Returns the verdict with the statistics.
    pub fn outcome(&self) -> Outcome {
        let Some(glass) = &self.glass else {
            return self.opaque.outcome();
        };
        if self.opaque.too_dark() {
            return self.opaque.outcome();
        }
        let percent = |x: f64| 100.0 * x;
        let difference = format!(
            "{:+.2} ± {:.2} %",
            percent(glass.ratio - 1.0),
            percent(glass.error)
        );
        let part = if glass.is_precise() {
            format!("glass {difference}, allowed {:.0} %", percent(GLASS_BOUND))
        } else {
            format!("glass {difference}, too noisy for a verdict")
        };
        Outcome {
            verdict: if self.agrees() {
                Verdict::Passed
            } else {
                Verdict::Failed
            },
            statement: format!("opaque {}; {part}", self.opaque.statement()),
            figures: json!({
                "opaque": self.opaque.figures(),
                "glass": { "ratio": glass.ratio, "ratio_error": glass.error, "bound": GLASS_BOUND },
            }),
        }
    }
}
