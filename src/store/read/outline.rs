//! Outline of a plan, read from `plan.json`: enough to display a night that another process
//! rendered, on any machine.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::Value as Json;

use crate::experiment::plan_outline::{CellOutline, PlanOutline, ReferenceOutline, StopOutline};
use crate::experiment::{CellConfig, Point, StopRule};
use crate::metrics::MetricSpec;
use crate::metrics::tonemap::Tonemap;
use lumbre_light::film::layer::Layer;
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::path_time::Timing;
use lumbre_light::value::Value;
use lumbre_render::hierarchy::AccelSpec;

/// Reads the outline of a plan. Metrics that this version does not know, or defines otherwise, are
/// left out; rows are matched by column names.
pub(crate) fn outline(plan: &Json) -> PlanOutline {
    let stops: Vec<Arc<StopOutline>> = list(&plan["stops"]).iter().map(stop_outline).collect();
    let axes: Vec<String> = list(&plan["axes"]).iter().map(text).collect();
    let cells = list(&plan["cells"]).iter().map(|cell| CellOutline {
        point: point(&cell["point"]),
        repeat: cell["repeat"]
            .as_u64()
            .and_then(|n| u32::try_from(n).ok())
            .unwrap_or(0),
        stop: cell["stop"]
            .as_u64()
            .and_then(|i| stops.get(usize::try_from(i).ok()?))
            .cloned(),
        reference: cell["reference"]
            .as_u64()
            .and_then(|n| usize::try_from(n).ok()),
        config: None,
        scene: None,
    });
    let cells: Vec<CellOutline> = cells.collect();
    let references = list(&plan["references"])
        .iter()
        .map(|reference| ReferenceOutline {
            file: reference["source"].as_str().map(PathBuf::from),
            config: config(&reference["source"]).map(Arc::new),
            scene: None,
            stop: reference["stop"]
                .is_object()
                .then(|| stop_outline(&reference["stop"])),
        });
    let display = Tonemap::from_value("display", &Value::from_json(&plan["measure"]["display"]));
    PlanOutline {
        name: text(&plan["name"]),
        hash: text(&plan["hash"]),
        axes,
        references: references.collect(),
        repeated: cells.iter().any(|cell| cell.repeat > 0),
        cells,
        skipped: list(&plan["skipped"]).len(),
        metrics: list(&plan["measure"]["metrics"])
            .iter()
            .filter_map(metric)
            .collect(),
        display: display.unwrap_or(Tonemap::Srgb { exposure: 0.0 }),
    }
}

fn list(json: &Json) -> &[Json] {
    json.as_array().map_or(&[], Vec::as_slice)
}

fn text(json: &Json) -> String {
    json.as_str().unwrap_or_default().to_owned()
}

fn point(json: &Json) -> Point {
    json.as_object()
        .into_iter()
        .flatten()
        .map(|(axis, value)| (axis.clone(), Value::from_json(value)))
        .collect()
}

fn stop_outline(json: &Json) -> Arc<StopOutline> {
    let rule = StopRule::from_canonical(&Value::from_json(&json["rule"]));
    Arc::new(StopOutline {
        rule,
        text: text(&json["words"]),
    })
}

fn values(json: &Json) -> BTreeMap<String, Value> {
    Value::from_json(json).as_map().cloned().unwrap_or_default()
}

fn metric(json: &Json) -> Option<MetricSpec> {
    MetricSpec::new(
        json["column"].as_str()?,
        json["metric"].as_str()?,
        values(&json["options"]),
    )
    .ok()
}

/// Reads render settings from the `render` table of a `config.json`, or from a reference in a plan.
pub(crate) fn config(json: &Json) -> Option<CellConfig> {
    let number = |json: &Json| json.as_u64().and_then(|n| u32::try_from(n).ok());
    let size = &json["resolution"];
    Some(CellConfig {
        scene: json["scene"].as_str()?.to_owned(),
        scene_file: PathBuf::from(text(&json["scene_file"])),
        scene_options: values(&json["scene_options"]),
        integrator: json["integrator"].as_str()?.to_owned(),
        params: values(&json["params"]),
        max_depth: number(&json["max_depth"]),
        resolution: number(&size[0]).zip(number(&size[1])).map(|(w, h)| [w, h]),
        rr_start: number(&json["rr_start"]),
        filter: FilterSpec {
            kind: FilterKind::from_name(json["aa"]["filter"].as_str()?)?,
            radius: json["aa"]["radius"].as_f64()? as f32,
        },
        films: list(&json["films"])
            .iter()
            .filter_map(|name| Layer::from_name(name.as_str()?))
            .collect(),
        timing: Timing::from_film(&values(&json["film"]), "film").ok()?,
        sampler: text(&json["sampler"]),
        accel: AccelSpec::from_identity(&values(&json["accel"])),
        set: values(&json["set"]),
        backend: text(&json["backend"]),
        fallback: None,
    })
}
