//! Records of runs: `done.json`.

use std::collections::BTreeMap;
use std::time::SystemTime;

use super::{OpenRun, Recorder};
use lumbre_night::experiment::WaveRow;
use lumbre_night::experiment::noise_floor::{net_columns, net_values};
use lumbre_night::store::schema::journal::named;
use lumbre_night::store::schema::run::{DoneFile, RunResults};
use lumbre_night::store::schema::values::Real;
use lumbre_night::store::schema::{Program, Version};
use lumbre_night::store::utc;

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
            floors: floors.map(|floors| {
                let values = floors.iter().map(|floor| floor.map(|f| f.value));
                named(&columns, values)
            }),
            floor_errors: floors.map(|floors| {
                let errors = floors.iter().map(|floor| Some(floor.as_ref()?.error));
                named(&columns, errors.map(|e| e.filter(|error| *error > 0.0)))
            }),
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
