//! Everything that was measured, as tidy CSV: one observation per line, one variable per column, units in the names.

use super::item::{Item, Kind, PROGRAM, Provenance};
use super::study::{Member, Study};
use crate::experiment::evidence::State;
use crate::output::labels::{csv_line, exact};

/// `data/runs.csv` with a line for each run, and `data/waves.csv` with a line for each measurement of each run.
///
/// Both begin with the same columns: night, plan, run, the axes (`axis.<name>`), repeat, seed, device. `data/columns.csv`
/// says what every column is and its unit.
pub fn all(study: &Study) -> Vec<Item> {
    let axes = study.axes();
    let provenance = Provenance::of(study.all());
    let item = |name: &str, title: &str, caption: &str, csv: String| Item {
        kind: Kind::Data,
        stem: format!("data/{name}"),
        title: title.to_owned(),
        caption: caption.to_owned(),
        svg: None,
        grid: None,
        extra: vec![("csv", csv.into_bytes())],
        provenance: provenance.clone(),
    };
    vec![
        item("runs", "All runs", "One line for each run of every plan, whatever its state.", runs(study, &axes)),
        item("waves", "All measurements", "One line for each measurement of each run.", waves(study, &axes)),
        item("columns", "Columns of the data", "What every column is, and its unit.", columns(study, &axes)),
    ]
}

const KEYS: [&str; 4] = ["program", "night", "plan", "run"];

fn header(axes: &[String], rest: &[String]) -> String {
    let mut header: Vec<String> = KEYS.map(str::to_owned).to_vec();
    header.extend(axes.iter().map(|axis| format!("axis.{axis}")));
    header.extend(["repeat", "seed", "integrator", "scene", "device"].map(str::to_owned));
    header.extend_from_slice(rest);
    csv_line(&header)
}

fn keys(m: &Member, axes: &[String]) -> Vec<String> {
    let mut fields = vec![PROGRAM.to_owned(), m.night.name.clone(), m.night.plan.clone(), m.run.id.clone()];
    fields.extend(axes.iter().map(|axis| m.run.value(axis).unwrap_or_default()));
    fields.extend([m.run.repeat.to_string(), m.run.seed.to_string(), m.run.integrator.clone(), m.run.scene.clone()]);
    fields.push(m.night.device(m.run).unwrap_or_default());
    fields
}

fn counts() -> [String; 5] {
    ["samples_per_pixel", "render_s", "wall_s", "paths", "rays"].map(str::to_owned)
}

fn values(m: &Member, row: &crate::experiment::WaveRow, metrics: usize) -> Vec<String> {
    let mut fields = vec![row.samples.to_string(), exact(row.render_s), exact(row.wall_s)];
    fields.extend([row.paths.to_string(), row.rays.to_string()]);
    fields.extend((0..metrics).map(|i| m.value(row, i).map(exact).unwrap_or_default()));
    fields
}

fn metric_names(study: &Study) -> impl Iterator<Item = String> {
    study.metrics.iter().map(|m| format!("metric.{}", m.column))
}

fn runs(study: &Study, axes: &[String]) -> String {
    let mut rest = vec!["state".to_owned(), "reason".to_owned()];
    rest.extend(counts());
    rest.extend(metric_names(study));
    rest.extend(["accel_build_s", "accel_nodes", "accel_bytes", "accel_cost"].map(str::to_owned));
    let mut text = header(axes, &rest);
    for m in study.all() {
        let mut fields = keys(&m, axes);
        let (state, reason) = match &m.run.state {
            State::Done(reason) => ("done", reason.clone()),
            State::Unfinished => ("unfinished", String::new()),
            State::Pending => ("pending", String::new()),
        };
        fields.extend([state.to_owned(), reason]);
        match m.run.rows.last() {
            Some(row) => fields.extend(values(&m, row, study.metrics.len())),
            None => fields.resize(fields.len() + counts().len() + study.metrics.len(), String::new()),
        }
        fields.push(m.run.accel.map(|a| exact(a.0)).unwrap_or_default());
        fields.push(m.run.accel.map(|a| a.1.to_string()).unwrap_or_default());
        fields.push(m.run.accel_size.map(|a| a.0.to_string()).unwrap_or_default());
        fields.push(m.run.accel_size.map(|a| exact(a.1)).unwrap_or_default());
        text += &csv_line(&fields);
    }
    text
}

fn waves(study: &Study, axes: &[String]) -> String {
    let mut rest = vec!["wave".to_owned()];
    rest.extend(counts());
    rest.extend(metric_names(study));
    let mut text = header(axes, &rest);
    for m in study.all() {
        let own = keys(&m, axes);
        for row in &m.run.rows {
            let mut fields = own.clone();
            fields.push(row.wave.to_string());
            fields.extend(values(&m, row, study.metrics.len()));
            text += &csv_line(&fields);
        }
    }
    text
}

fn columns(study: &Study, axes: &[String]) -> String {
    let mut text = csv_line(&["column", "unit", "meaning"]);
    let mut add = |column: &str, unit: &str, meaning: &str| text += &csv_line(&[column, unit, meaning]);
    add("program", "", "what wrote the file");
    add("night", "", "name of the experiment");
    add("plan", "", "hash of its plan");
    add("run", "", "identity of the run; its folder bears this name");
    for axis in axes {
        add(&format!("axis.{axis}"), "", "value of the axis that the script swept");
    }
    add("repeat", "", "number of the repeat, from 0");
    add("seed", "", "seed of all random numbers of the run");
    add("integrator", "", "technique");
    add("scene", "", "scene as the script wrote it");
    add("device", "", "what it was rendered on; empty if the run has not finished");
    add("state", "", "done, unfinished or pending");
    add("reason", "", "the part of the stop rule that ended the run");
    add("wave", "", "number of the measurement, from 1");
    add("samples_per_pixel", "1", "samples per pixel so far");
    add("render_s", "s", "seconds inside the renderer so far; the only time that counts");
    add("wall_s", "s", "seconds since the run started, everything included");
    add("paths", "1", "camera paths so far");
    add("rays", "1", "rays so far");
    for metric in &study.metrics {
        let options = metric.describe_options();
        let options = if options.is_empty() { String::new() } else { format!(" with {options}") };
        add(&format!("metric.{}", metric.column), &metric.unit(), &format!("{}{options}", metric.row.doc));
    }
    add("accel_build_s", "s", "seconds spent building acceleration structures, before the first sample");
    add("accel_nodes", "1", "their nodes");
    add("accel_bytes", "B", "their bytes with the primitives in them; 0 or empty if not known");
    add(
        "accel_cost",
        "1",
        "nodes and primitives that a ray meets by the surface area heuristic; 0 or empty if not known",
    );
    text
}
