//! Outline of a plan, read from `plan.json`: enough to display a night that another process
//! rendered, on any machine.

use std::path::PathBuf;
use std::sync::Arc;

use crate::experiment::StopRule;
use crate::experiment::plan_outline::{CellOutline, PlanOutline, ReferenceOutline, StopOutline};
use crate::store::schema::plan::{PlanFile, PlannedReference, StopRecord};
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;

/// Reads the outline of a plan. Metrics that this version does not know, or defines otherwise, are
/// left out; rows are matched by column names.
pub(crate) fn outline(plan: &PlanFile) -> PlanOutline {
    let stops: Vec<Arc<StopOutline>> = plan.stops.iter().map(stop_outline).collect();
    let cells = plan.cells.iter().map(|cell| CellOutline {
        point: cell.point.0.clone(),
        repeat: cell.repeat,
        stop: stops.get(cell.stop).cloned(),
        reference: cell.reference,
        config: None,
        scene: None,
    });
    let references = plan.references.iter().map(|reference| match reference {
        PlannedReference::File(found) => ReferenceOutline {
            file: Some(PathBuf::from(&found.source)),
            ..ReferenceOutline::default()
        },
        PlannedReference::Render(rendered) => ReferenceOutline {
            config: rendered.source.known().cloned().map(Arc::new),
            stop: Some(stop_outline(&rendered.stop)),
            ..ReferenceOutline::default()
        },
    });
    let metrics = plan.measure.metrics.iter().filter_map(|metric| {
        MetricSpec::new(&metric.column, &metric.metric, metric.options.clone()).ok()
    });
    let display = Tonemap::from_value("display", &plan.measure.display);
    PlanOutline {
        name: plan.name.clone(),
        hash: plan.hash.clone(),
        axes: plan.axes.clone(),
        varying: Vec::new(),
        references: references.collect(),
        repeated: plan.cells.iter().any(|cell| cell.repeat > 0),
        cells: cells.collect(),
        skipped: plan.skipped.len(),
        metrics: metrics.collect(),
        display: display.unwrap_or(Tonemap::Srgb { exposure: 0.0 }),
    }
    .with_distinctions()
}

fn stop_outline(record: &StopRecord) -> Arc<StopOutline> {
    Arc::new(StopOutline {
        rule: StopRule::from_canonical(&record.rule),
        text: record.text.clone(),
    })
}
