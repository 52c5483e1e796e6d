//! Comparison with Mitsuba 3: scenes of the table in `cases.txt`, and exported materials, rendered by
//! both programs.

mod cases;
mod files;
pub mod page;
mod peer;

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};

use self::cases::{Case, Subject};
use self::peer::{Peer, PeerRequest, SmallView};
use super::picture::{NoisyPicture, Setting, judge, render};
use super::technique::Technique;
use super::{Check, Outcome, SeedFamily, Verdict, VerifyRequest};
use lumbre_light::scene::compile;
use lumbre_light::scene::{Note, SceneDesc};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::value::Value;
use lumbre_scene_io::{edit, export, load};

/// Side in pixels of the compared blocks.
const BLOCK: u32 = 8;

/// Greatest side in pixels of the pictures of scene files.
const MAX_SIDE: u32 = 96;

/// Greatest number of path edges in pictures of scene files.
const MAX_DEPTH: u32 = 16;

/// Result of a case, as part of the report in JSON.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct CaseFigures {
    /// `agrees`, `noted` or `FAILS`.
    pub result: String,
    /// Ratios of the means over the picture by channel, Lumbre over Mitsuba.
    pub ratios: [Option<f64>; 3],
    /// Notes of the loader or of the exporter.
    pub notes: Vec<String>,
    /// Samples per pixel of both pictures.
    pub samples: u64,
    /// Version of Mitsuba.
    pub mitsuba: String,
    /// Statistic of the comparison.
    pub statistic: Json,
}

/// Everything that the cases share.
struct Workplace {
    peer: RefCell<Peer>,
    version: String,
    /// Folder of the files of all cases; removed in the end.
    folder: tempfile::TempDir,
    samples: u64,
    threads: usize,
}

/// Lists the cases; one that is skipped if Mitsuba is missing.
///
/// # Errors
/// Returns a message if the files of the cases cannot be written.
pub fn plan(request: &VerifyRequest) -> Result<Vec<Check>, String> {
    let peer = match Peer::start(&request.python) {
        Ok(peer) => peer,
        Err(reason) => {
            let skip = move |_| {
                Ok(Outcome::skipped(format!(
                    "{reason}; install it with `pip install mitsuba`, or name an interpreter with \
                     --python"
                )))
            };
            return Ok(vec![Check::new("mitsuba", "all cases", skip)]);
        }
    };
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    files::write(folder.path())?;
    let all = match request.files.as_slice() {
        [] => cases::all()?,
        files => files.iter().map(|file| Case::of_file(file)).collect(),
    };
    let place = Rc::new(Workplace {
        version: peer.version.clone(),
        peer: RefCell::new(peer),
        folder,
        samples: if request.quick { 128 } else { 512 },
        threads: request.threads,
    });
    let chosen = all.into_iter().enumerate();
    Ok(chosen
        .filter(|(_, case)| case.quick || !request.quick)
        .map(|(i, case)| {
            let (place, seed) = (Rc::clone(&place), request.seed(SeedFamily::Mitsuba, i));
            let (list, text) = (case.list.clone(), case.text.clone());
            Check::new(list, text, move |tests| {
                place.compare(&case, i, seed, tests)
            })
        })
        .collect())
}

impl Workplace {
    /// Renders a case with both programs and compares the pictures.
    fn compare(&self, case: &Case, i: usize, seed: u64, tests: usize) -> Result<Outcome, String> {
        let (desc, file, notes) = match &case.subject {
            Subject::Scene(xml) => {
                let file = self.folder.path().join(format!("case_{i}.xml"));
                std::fs::write(&file, xml).map_err(|e| e.to_string())?;
                let (desc, notes) = load_file(&file)?;
                (desc, file, notes)
            }
            Subject::Material(settings) => self.export(settings, i)?,
            Subject::File(file) => {
                let (mut desc, notes) = load_file(file)?;
                desc.resolution = small(desc.resolution);
                desc.max_depth = desc.max_depth.min(MAX_DEPTH);
                (desc, file.clone(), notes)
            }
        };
        let own_view = matches!(case.subject, Subject::File(_)).then(|| SmallView {
            size: desc.resolution,
            fov_y: desc.camera.picture_deg(),
            shown: desc.camera.window.size()[1],
            offset: desc.camera.window.offset(),
            max_depth: desc.max_depth,
        });
        let (scene, _) = compile(&desc).map_err(|e| e.to_string())?;
        let setting = Setting {
            resolution: scene.resolution,
            max_depth: scene.max_depth,
            samples: self.samples,
            seed,
            threads: self.threads,
            ..Setting::PLAIN
        };
        let technique = integrator("nee").map(Technique::plain);
        let technique = technique.ok_or("there is no integrator `nee`")?;
        let ours = render(&Arc::new(scene), &technique, setting)?;
        let request = PeerRequest {
            scene: &file,
            out: &self.folder.path().join(format!("picture_{i}")),
            samples: self.samples,
            seed,
            view: own_view,
        };
        let theirs = self.peer.borrow_mut().render(&request)?;
        let messages: Vec<String> = notes.into_iter().map(|note| note.message).collect();
        Ok(self.outcome(&ours, &theirs, &messages, tests))
    }

    /// Returns the scene with a material, the file to which it is exported, and the notes about it.
    fn export(
        &self,
        settings: &[(String, String)],
        i: usize,
    ) -> Result<(SceneDesc, PathBuf, Vec<Note>), String> {
        let file = self.folder.path().join("materials.xml");
        std::fs::write(&file, cases::material_scene()?).map_err(|e| e.to_string())?;
        let (mut desc, _) = load_file(&file)?;
        if let Some(material) = desc.material_index("subject") {
            desc.materials[material].one_sided = false;
        }
        for (key, text) in settings {
            let path = format!("materials.subject.{key}");
            edit::set(&mut desc, &path, &self.value(text)).map_err(|e| e.to_string())?;
        }
        let folder = self.folder.path().join(format!("material_{i}"));
        let exported = export::mitsuba(&desc, &folder).map_err(|e| e.to_string())?;
        Ok((desc, exported.scene, exported.notes))
    }

    /// Returns the value that a text of the table stands for.
    fn value(&self, text: &str) -> Value {
        let number = |text: &str| text.parse::<f64>().ok().map(Value::number);
        match text {
            "true" | "false" => Value::Bool(text == "true"),
            _ if text.contains(',') => Value::List(text.split(',').filter_map(number).collect()),
            _ if text.ends_with(".png") => {
                Value::Str(self.folder.path().join(text).display().to_string())
            }
            _ => number(text).unwrap_or_else(|| Value::Str(text.to_owned())),
        }
    }

    /// Returns the verdict on two pictures: they must be equal up to noise, or differ as the notes
    /// state.
    fn outcome(
        &self,
        ours: &NoisyPicture,
        theirs: &NoisyPicture,
        notes: &[String],
        tests: usize,
    ) -> Outcome {
        let size = |picture: &NoisyPicture| [picture.mean.width, picture.mean.height];
        if size(ours) != size(theirs) {
            return Outcome::failed(format!("{:?} and {:?} pixels", size(ours), size(theirs)));
        }
        let judgement = judge(ours, theirs, BLOCK, tests);
        let (a, b) = (ours.mean.mean(), theirs.mean.mean());
        let ratios = [0, 1, 2].map(|c| a[c] / b[c]);
        let (verdict, result) = if judgement.agrees {
            (Verdict::Passed, "agrees")
        } else if explains(notes, ratios) {
            (Verdict::Passed, "noted")
        } else {
            (Verdict::Failed, "FAILS")
        };
        let figures = CaseFigures {
            result: result.to_owned(),
            ratios: ratios.map(|ratio: f64| ratio.is_finite().then_some(ratio)),
            notes: notes.to_vec(),
            samples: self.samples,
            mitsuba: self.version.clone(),
            statistic: judgement.figures(),
        };
        Outcome {
            verdict,
            statement: format!("{result}: {}", judgement.statement()),
            figures: json!(figures),
        }
    }
}

/// Returns a size of the same shape with sides of at most [`MAX_SIDE`].
fn small(size: [u32; 2]) -> [u32; 2] {
    let scale = f64::from(MAX_SIDE) / f64::from(size[0].max(size[1]));
    size.map(|side| ((f64::from(side) * scale.min(1.0)).round() as u32).max(1))
}

/// Loads a scene of Mitsuba.
fn load_file(file: &Path) -> Result<(SceneDesc, Vec<Note>), String> {
    load::load(file).map_err(|e| e.to_string())
}

/// Returns whether notes explain ratios of means: the sizes that they state bound the difference, or
/// one states that something is not supported.
fn explains(notes: &[String], ratios: [f64; 3]) -> bool {
    let stated: f64 = notes.iter().filter_map(|note| percent(note)).sum();
    let difference = |ratio: f64| (ratio - 1.0).abs().min((1.0 / ratio - 1.0).abs());
    let unsupported = |note: &String| note.contains("not supported");
    notes.iter().any(unsupported) || ratios.into_iter().all(|r| difference(r) <= stated / 100.0)
}

/// Returns the percentage that a note states.
fn percent(note: &str) -> Option<f64> {
    let (before, _) = note.split_once(" %")?;
    before.rsplit(' ').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_explains_a_difference_up_to_its_size() {
        let note = |text: &str| vec![text.to_owned()];
        let sized = note("the coat is darker, by up to 8 % here");
        assert!(explains(&sized, [0.93, 1.0, 1.0]) && !explains(&sized, [0.9, 1.0, 1.0]));
        assert!(explains(&note("`x` is not supported"), [0.5, 1.0, 1.0]));
        assert!(!explains(&note("a mesh of triangles"), [0.99, 1.0, 1.0]));
    }
}
