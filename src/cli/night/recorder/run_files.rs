//! Pictures of runs: final pictures, layers, time axes, reference halves and maps of bias checks.

use std::sync::Arc;

use super::run_facts::DENOISE;
use super::{ExtraFilms, OpenRun, Recorder, sink_error};
use crate::cli::night::disk_full_retry::{retry_while_disk_full, sleep_before_retry};
use lumbre_light::film::Film;
use lumbre_light::film::layer::LayerImage;
use lumbre_light::film::time::TimeCube;
use lumbre_night::experiment::bias_check::{BiasCheckResult, MAP_TOP};
use lumbre_night::experiment::night::reference::BiasCheckSummary;
use lumbre_night::experiment::plan::ReferenceSource;
use lumbre_night::experiment::{CellRef, SinkError};
use lumbre_night::store::schema::run::BiasCheckFile;
use lumbre_night::store::{BIAS_CHECK_PREFIX, FILMS, HALVES, NOISE, RAW, RunWriter, StoredFile};
use lumbre_night::text::program;
use lumbre_report::{exr, layer, plot, png, time};

impl Recorder<'_> {
    /// Writes the final picture of a run, the mean of its film if that was denoised, its layers and
    /// the files of its time axis. Returns the
    /// names of the layers, followed by those of the stills of the time axis.
    pub(super) fn write_pictures(
        &self,
        cell: CellRef,
        run: &OpenRun,
        film: &Film,
        extra: &ExtraFilms<'_>,
    ) -> Result<Vec<String>, SinkError> {
        let writer = &run.writer;
        let metadata = run.facts.metadata(film.samples);
        let mean = film.mean();
        let image = extra.denoised.unwrap_or(&mean);
        if extra.denoised.is_some() {
            let mut metadata = metadata.clone();
            metadata.retain(|(key, _)| key != DENOISE);
            let raw = exr::encode(&mean, &metadata).map_err(sink_error)?;
            self.retry_while_full(|| writer.write(RAW, &raw))?;
        }
        let name = match cell {
            CellRef::Cell(_) => "final",
            CellRef::Reference(_) => "ref",
        };
        // Without the render time, so that two nights write the same bytes.
        let extras = exr::Extras {
            layers: if self.plan.measure.film_files {
                &[]
            } else {
                extra.layers
            },
            samples: Some(film.samples),
            render_s: None,
        };
        let linear = exr::encode_with(image, &extras, &metadata).map_err(sink_error)?;
        self.retry_while_full(|| writer.write(&format!("{name}.exr"), &linear))?;
        let display = self.plan.measure.display;
        let preview = png::encode(image, display, &metadata).map_err(sink_error)?;
        self.retry_while_full(|| writer.write(&format!("{name}.png"), &preview))?;
        self.write_layers(cell, writer, extra.layers, &metadata)?;
        let mut films: Vec<String> = extra.layers.iter().map(|layer| layer.film.name()).collect();
        if let Some(times) = extra.times {
            films.extend(self.write_time_files(cell, writer, times, &metadata)?);
        }
        Ok(films)
    }

    /// Writes the files of a film with a time axis, and returns the names of its stills.
    fn write_time_files(
        &self,
        cell: CellRef,
        writer: &RunWriter,
        times: &TimeCube,
        metadata: &[(String, String)],
    ) -> Result<Vec<String>, SinkError> {
        let timing = match cell {
            CellRef::Cell(i) => self.plan.cells[i].config.timing.as_ref(),
            CellRef::Reference(_) => None,
        };
        let seconds = timing.and_then(|timing| timing.seconds());
        let mut stills = Vec::new();
        for file in time::files(times, seconds, metadata).map_err(sink_error)? {
            self.retry_while_full(|| writer.write(&format!("{FILMS}/{}", file.name), &file.bytes))?;
            let still = file
                .name
                .strip_suffix(".exr")
                .filter(|name| time::still_length(name).is_some());
            stills.extend(still.map(str::to_owned));
        }
        Ok(stills)
    }

    /// Writes the films of all layers as PNG, those that are not in the file of the picture as EXR
    /// too, and contact sheets of them.
    fn write_layers(
        &self,
        cell: CellRef,
        writer: &RunWriter,
        layers: &[LayerImage],
        metadata: &[(String, String)],
    ) -> Result<(), SinkError> {
        let display = self.plan.measure.display;
        for layer in layers {
            let row = layer.film.layer.row();
            let name = layer.film.name();
            let mut metadata = metadata.to_vec();
            metadata.push(("film".to_owned(), name.clone()));
            metadata.push(("channels".to_owned(), row.channels.join(", ")));
            if self.plan.measure.film_files || row.exr.is_empty() {
                let linear = exr::encode(&layer.image, &metadata).map_err(sink_error)?;
                self.retry_while_full(|| writer.write(&format!("{FILMS}/{name}.exr"), &linear))?;
            }
            let preview = layer::encode(layer, display, &metadata).map_err(sink_error)?;
            self.retry_while_full(|| writer.write(&format!("{FILMS}/{name}.png"), &preview))?;
        }
        let sheets = plot::sheets(layers, self.plan.report.display, self.path(cell), metadata)
            .map_err(sink_error)?;
        for (stem, bytes) in sheets {
            self.retry_while_full(|| writer.write(&format!("{FILMS}/{stem}.png"), &bytes))?;
        }
        Ok(())
    }

    /// Writes the two halves of a reference in progress, and its standard error per pixel.
    pub(super) fn write_halves(
        &mut self,
        reference: usize,
        halves: &[Arc<Film>; 2],
    ) -> Result<(), SinkError> {
        let Some(run) = self.open_runs.get_mut(&CellRef::Reference(reference)) else {
            return Err(SinkError(
                "the halves of a reference arrived before it was started".to_owned(),
            ));
        };
        let wait = &sleep_before_retry;
        let seeds = match &self.plan.references[reference].source {
            ReferenceSource::Render { seeds, .. } => *seeds,
            ReferenceSource::File { .. } => [0; 2],
        };
        let metadata = |samples: u64, seed: u64| {
            let mut metadata = run.facts.metadata(samples);
            metadata.retain(|(key, _)| key != "seed");
            metadata.push(("seed".to_owned(), seed.to_string()));
            metadata
        };
        for ((half, seed), name) in halves.iter().zip(seeds).zip(HALVES) {
            let bytes =
                exr::encode(&half.mean(), &metadata(half.samples, seed)).map_err(sink_error)?;
            retry_while_disk_full(&self.control, wait, || run.writer.write(name, &bytes))
                .map_err(sink_error)?;
        }
        let joint = Film::pooled(&halves[0], &halves[1]);
        let mut noise = joint.variance_of_mean();
        noise
            .data
            .as_flattened_mut()
            .iter_mut()
            .for_each(|x| *x = x.sqrt());
        let mut metadata = metadata(joint.samples, seeds[0]);
        metadata.push((
            "shows".to_owned(),
            "standard error of each pixel's mean".to_owned(),
        ));
        let bytes = exr::encode(&noise, &metadata).map_err(sink_error)?;
        retry_while_disk_full(&self.control, wait, || run.writer.write(NOISE, &bytes))
            .map_err(sink_error)?;
        run.halves = Some([halves[0].samples, halves[1].samples]);
        Ok(())
    }

    /// Writes the result of comparing a reference with a second technique to the reference's
    /// folder: a map of z-scores and the result as JSON.
    pub(super) fn write_bias_check(
        &self,
        [reference, with]: [usize; 2],
        check: &BiasCheckSummary,
        result: &BiasCheckResult,
    ) -> Result<(), SinkError> {
        let file = BiasCheckFile::new(&self.plan, [reference, with], check, result);
        let technique = &file.technique;
        let metadata = [
            ("run", file.reference.clone()),
            ("second", file.second.clone()),
            (
                "shows",
                format!("z-scores of blocks against {technique}, blue -{MAP_TOP} to red {MAP_TOP}"),
            ),
            ("program", program().to_owned()),
        ]
        .map(|(key, value)| (key.to_owned(), value));
        let picture =
            png::encode_map(&result.map, result.map.scale(None), &metadata).map_err(sink_error)?;
        for (extension, bytes) in [
            ("png", picture.as_slice()),
            ("json", file.text().as_bytes()),
        ] {
            let name = format!("{BIAS_CHECK_PREFIX}{technique}.{extension}");
            self.store
                .write_reference(&self.plan, reference, &name, bytes)
                .map_err(sink_error)?;
        }
        Ok(())
    }
}
