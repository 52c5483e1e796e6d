//! Records of runs: `done.json`, and metadata of pictures.

use std::collections::BTreeMap;
use std::time::SystemTime;

use super::{OpenRun, Recorder};
use lumbre_light::scene::desc::content_hash;
use lumbre_night::experiment::noise_floor::{NoiseFloors, net_columns, net_values};
use lumbre_night::experiment::plan::ReferenceSource;
use lumbre_night::experiment::{CellRef, Plan, WaveRow};
use lumbre_night::store::schema::journal::named;
use lumbre_night::store::schema::run::{DoneFile, RunResults};
use lumbre_night::store::schema::values::Real;
use lumbre_night::store::schema::{Program, Version};
use lumbre_night::store::utc;
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
    scene_hash: String,
    /// Seed of the run. For a reference, the seed of its first half.
    seed: u64,
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

impl Recorder<'_> {
    /// Returns the content of `done.json`. `films` are the names of the layers and of the stills of
    /// the time axis.
    pub(super) fn done_file(
        &self,
        run: &OpenRun,
        reason: &str,
        samples: u64,
        last: &WaveRow,
        films: Vec<String>,
    ) -> DoneFile {
        let columns = self.plan.columns();
        let metrics = last.metrics.iter().copied().map(Some);
        let floors = Some(&run.floors).filter(|floors| !floors.is_empty());
        let net = floors.map(|floors| {
            let names = net_columns(&self.plan, floors)
                .into_iter()
                .map(|(_, name)| name);
            let values = net_values(&self.plan, floors, &last.metrics);
            names.zip(values.into_iter().map(Real)).collect()
        });
        let facts = &run.facts;
        DoneFile::Rendered(Box::new(RunResults {
            version: Version,
            program: Program::default(),
            run: facts.run.clone(),
            reason: reason.to_owned(),
            samples,
            render_s: last.render_s,
            lost_s: run.open.watches_processor.then_some(last.lost_s),
            wall_s: last.wall_s,
            measure_s: last.measure_s,
            waves: last.wave,
            paths: last.paths,
            rays: last.rays,
            invalid: last.invalid,
            first_invalid: last.first_invalid,
            metrics: named(&columns, metrics),
            floors: floors.map(|floors| named(&columns, floors.iter().copied())),
            net,
            halves: run.halves,
            films,
            seed: facts.seed,
            devices: run.open.devices.clone(),
            device: None,
            processor: self.processor.clone(),
            open: (&run.open).into(),
            scene_hash: facts.scene_hash.clone(),
            finished: utc(SystemTime::now()),
            files: BTreeMap::new(),
            check: String::new(),
        }))
    }
}

/// Returns a row with the values of its net columns appended to its metrics.
pub(super) fn with_net_values(plan: &Plan, floors: &NoiseFloors, row: &WaveRow) -> WaveRow {
    let net = net_values(plan, floors, &row.metrics);
    WaveRow {
        metrics: row.metrics.iter().copied().chain(net).collect(),
        ..row.clone()
    }
}
