//! The night of a plan, read from `plan.json`: enough to display and report what another process
//! rendered, on any machine.

use std::path::PathBuf;
use std::sync::Arc;

use super::night_reader::NightReader;
use crate::experiment::CellRef;
use crate::experiment::night::reference::ReferencePlan;
use crate::experiment::night::run::{RunPlan, StopOutline};
use crate::experiment::night::{Night, NightPlan};
use crate::experiment::plan::counted_reasons;
use crate::experiment::spec::{Presentation, SheetSpec};
use crate::experiment::stop::StopRule;
use crate::store::schema::StoredFile;
use crate::store::schema::plan::{
    NightNote, NotesFile, PlanFile, PlannedCell, PlannedReference, PresentationRecord, StopRecord,
};
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;

/// Returns the night of a folder, as if nothing had been rendered. Metrics that this version does
/// not know, or defines otherwise, are left out with a note; rows are matched by column names.
pub(crate) fn planned_night(files: &NightReader) -> Night {
    let plan = files.plan();
    let absent = plan.skipped.iter().filter(|skipped| skipped.absent);
    let absent = counted_reasons(absent.map(|skipped| skipped.reason.as_str()));
    let mut notes = missing_support(&absent);
    let metrics = metrics(plan, &mut notes);
    let stops: Vec<Arc<StopOutline>> = plan.stops.iter().map(stop_outline).collect();
    let run = |cell: &PlannedCell| RunPlan {
        id: cell.run.clone(),
        path: cell.path.clone(),
        point: cell.point.0.clone(),
        repeat: cell.repeat,
        double_of: cell.double_of,
        seed: cell.seed,
        integrator: cell.integrator.clone(),
        backend: cell.backend.clone(),
        denoise: cell.denoise.clone(),
        timing: cell.timing.clone(),
        delays: cell.delays.clone(),
        scene: cell.scene.clone(),
        changes: cell.changes.clone(),
        max_depth: cell.max_depth,
        resolution: cell.resolution,
        reference: cell.reference,
        stop: stops.get(cell.stop).cloned(),
        settings: None,
        content: None,
    };
    let reference = |reference: &PlannedReference| {
        let id = reference.run().to_owned();
        match reference {
            PlannedReference::File(found) => ReferencePlan {
                id,
                file: Some(PathBuf::from(&found.source)),
                ..ReferencePlan::default()
            },
            PlannedReference::Render(rendered) => ReferencePlan {
                id,
                settings: rendered.source.known().cloned().map(Arc::new),
                stop: Some(stop_outline(&rendered.stop)),
                ..ReferencePlan::default()
            },
        }
    };
    let mut report = plan.report.as_ref().map(presentation).unwrap_or_default();
    match NotesFile::read(files.folder()) {
        Ok(taken) => {
            let taken = taken.notes.iter();
            report.notes.extend(taken.map(NightNote::line));
        }
        Err(error) if error.is_missing() => {}
        Err(error) => notes.push(error.to_string()),
    }
    let mut sheets = Vec::new();
    for sheet in &plan.sheets {
        match SheetSpec::new(sheet.clone()) {
            Ok(sheet) => sheets.push(sheet),
            Err(e) => notes.push(format!("a sheet is left out: {e}")),
        }
    }
    let defaults = NightPlan::default();
    let display = Tonemap::from_value("display", &plan.measure.display);
    let facts = NightPlan {
        name: plan.name.clone(),
        hash: plan.hash.clone(),
        seed: plan.seed,
        axes: plan.axes.clone(),
        settings: plan.settings.clone(),
        metrics,
        display: display.unwrap_or(defaults.display),
        sheets,
        report,
        order: plan.night.order.clone(),
        skipped: plan.skipped.len(),
        absent,
        figures: plan.figures.clone(),
        tables: plan.tables.clone(),
        ..defaults
    };
    let runs = plan.cells.iter().map(run).collect();
    let mut night = Night::new(facts, runs, plan.references.iter().map(reference).collect());
    for (i, run) in night.runs.iter_mut().enumerate() {
        Arc::make_mut(run).folder = files.run_folder(CellRef::Cell(i));
    }
    for (i, reference) in night.references.iter_mut().enumerate() {
        Arc::make_mut(reference).folder = files.run_folder(CellRef::Reference(i));
    }
    (night.folder, night.notes) = (files.folder().to_owned(), notes);
    night
}

/// Describes points that were skipped because the machine lacks support, each reason once.
fn missing_support(absent: &[(String, usize)]) -> Vec<String> {
    let note = |(reason, count): &(String, usize)| match count {
        1 => format!("1 point of the sweep is left out: {reason}"),
        _ => format!("{count} points of the sweep are left out: {reason}"),
    };
    absent.iter().map(note).collect()
}

/// Reads the definitions of the metrics.
fn metrics(plan: &PlanFile, notes: &mut Vec<String>) -> Vec<MetricSpec> {
    let mut metrics = Vec::new();
    for metric in &plan.measure.metrics {
        match MetricSpec::new(&metric.column, &metric.metric, metric.options.clone()) {
            Ok(spec) => metrics.push(spec),
            Err(e) => notes.push(format!("column `{}` is left out: {e}", metric.column)),
        }
    }
    metrics
}

/// Reads the presentation of the results. A tone map that this version does not know is left
/// out.
fn presentation(record: &PresentationRecord) -> Presentation {
    Presentation {
        display: Tonemap::from_value("report.display", &record.display).ok(),
        names: record.names.clone(),
        colours: record.colours.clone(),
        notes: record.notes.clone(),
    }
}

fn stop_outline(record: &StopRecord) -> Arc<StopOutline> {
    Arc::new(StopOutline {
        rule: StopRule::from_canonical(&record.rule),
        text: record.text.clone(),
    })
}
