//! Facts about a run for the metadata of its pictures.

use lumbre_light::scene::desc::content_hash;
use lumbre_night::experiment::plan::ReferenceSource;
use lumbre_night::experiment::{CellRef, Plan};
use lumbre_night::text::program;
use lumbre_render::OpenStats;
use lumbre_render::denoise::Denoise;

/// Facts about a run that are written to the metadata of all its pictures.
pub(super) struct RunFacts {
    /// Id of the run.
    pub(super) run: String,
    /// Hash of the plan; empty for references, which do not belong to a single plan.
    plan: String,
    /// Hash of the scene's content in hexadecimal; empty if the reference is a file.
    pub(super) scene_hash: String,
    /// Seed of the run. For a reference, the seed of its first half.
    pub(super) seed: u64,
    /// Line about the device that renders it.
    device: String,
    /// Description of its denoiser; empty without one.
    denoise: String,
}

/// Key of the denoiser in the metadata of a picture.
pub(super) const DENOISE: &str = "denoised by";

impl RunFacts {
    /// Collects the facts about a run of a plan.
    pub(super) fn new(plan: &Plan, cell: CellRef, open: &OpenStats) -> RunFacts {
        let (seed, scene) = match cell {
            CellRef::Cell(i) => (plan.cells[i].seed, Some(&plan.cells[i].scene)),
            CellRef::Reference(i) => match &plan.references[i].source {
                ReferenceSource::Render { seeds, scene, .. } => (seeds[0], Some(scene)),
                ReferenceSource::File { .. } => (0, None),
            },
        };
        let denoise = match cell {
            CellRef::Cell(i) => plan.cells[i].config.denoise.as_ref(),
            CellRef::Reference(_) => None,
        };
        let hex = |hash: [u8; 32]| blake3::Hash::from(hash).to_hex().to_string();
        RunFacts {
            run: plan.id(cell).0.clone(),
            plan: if let CellRef::Cell(_) = cell {
                plan.hash.clone()
            } else {
                String::new()
            },
            scene_hash: scene.map(|s| hex(content_hash(s))).unwrap_or_default(),
            seed,
            device: open.device_line(),
            denoise: denoise.map(Denoise::describe).unwrap_or_default(),
        }
    }

    /// Returns the metadata of a picture. It contains no times, so that two nights that render the
    /// same pictures write the same bytes.
    pub(super) fn metadata(&self, samples: u64) -> Vec<(String, String)> {
        let plan = (!self.plan.is_empty()).then(|| ("plan", self.plan.clone()));
        let denoise = (!self.denoise.is_empty()).then(|| (DENOISE, self.denoise.clone()));
        let pairs = [
            ("run", self.run.clone()),
            ("scene_hash", self.scene_hash.clone()),
            ("samples", samples.to_string()),
            ("seed", self.seed.to_string()),
            ("device", self.device.clone()),
            ("program", program().to_owned()),
        ];
        pairs
            .into_iter()
            .chain(plan)
            .chain(denoise)
            .map(|(name, value)| (name.to_owned(), value))
            .collect()
    }
}
