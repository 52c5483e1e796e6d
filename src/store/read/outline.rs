//! Outline of a plan, read from `plan.json`: enough to display a night that another process
//! rendered, on any machine.

use std::path::PathBuf;
use std::sync::Arc;

use crate::experiment::plan_outline::{CellOutline, PlanOutline, ReferenceOutline, StopOutline};
use crate::experiment::{CellConfig, StopRule};
use crate::store::schema::plan::{PlanFile, PlannedReference, StopRecord};
use crate::store::schema::run::RenderSettings;
use lumbre_light::film::layer::Layer;
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::path_time::Timing;
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_render::denoise::Denoise;
use lumbre_render::hierarchy::AccelSpec;
use lumbre_render::shaders::{ShaderFolder, Shaders};

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
            config: cell_config(&rendered.source).map(Arc::new),
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

/// Returns the configuration that a run was rendered with. `None` if a name or value in it is not
/// known to this version.
pub fn cell_config(render: &RenderSettings) -> Option<CellConfig> {
    let film = render.film.as_ref().and_then(Value::as_map);
    Some(CellConfig {
        scene: render.scene.clone(),
        scene_file: PathBuf::from(&render.scene_file),
        scene_options: render.scene_options.clone(),
        integrator: render.integrator.clone(),
        params: render.params.clone(),
        max_depth: render.max_depth,
        resolution: render.resolution,
        rr_start: render.rr_start,
        filter: FilterSpec {
            kind: FilterKind::from_name(&render.aa.filter)?,
            radius: render.aa.radius,
        },
        films: render
            .films
            .iter()
            .map(|name| Layer::from_name(name))
            .collect::<Option<_>>()?,
        timing: match film {
            Some(film) => Timing::from_film(film, "film").ok()?,
            None => None,
        },
        denoise: match &render.denoise {
            Some(denoise) => Some(Denoise::from_value(denoise)?),
            None => None,
        },
        sampler: render.sampler.clone(),
        accel: AccelSpec::from_identity(&render.accel),
        set: render.set.clone(),
        shaders: match &render.shaders {
            Some(shaders) => Shaders::Folder(ShaderFolder {
                path: PathBuf::from(&shaders.folder),
                hash: shaders.hash.clone(),
            }),
            None => Shaders::BuiltIn,
        },
        backend: render.backend.clone(),
        fallback: None,
    })
}
