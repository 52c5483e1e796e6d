//! `summary.csv`: one line for each cell of the plan, also for those that failed or were never reached.

use std::collections::BTreeMap;

use super::labels::{csv_line, exact};
use crate::experiment::floors::net_columns;
use crate::experiment::plan::Plan;
use crate::experiment::{CellRef, CellResult, Outcome};

const BEFORE: [&str; 2] = ["cell", "run"];
const AFTER: [&str; 8] =
    ["repeat", "status", "reason", "samples_per_pixel", "render_s", "wall_s", "mpaths_per_s", "invalid_samples"];

/// The text of `summary.csv`, cells in the order of the plan.
///
/// Columns: `cell` (index from 0), `run` (identity), one for each axis, `repeat` (from 0), `status` (`done`, `cached`,
/// `failed`, `interrupted`, `not reached`), `reason`, the last wave's `samples_per_pixel`, `render_s`, `wall_s`,
/// `mpaths_per_s` and `invalid_samples`, then one for each metric by its column name, and at last, where the noise of a
/// reference is known, `<column>_floor` (what the true picture would have) and `<column>_net` (the value without the
/// reference's own error, where that can be taken off). What was not measured is empty; an axis or metric whose name is
/// taken already is called `axis.<name>` or `metric.<name>`.
pub fn csv(plan: &Plan, results: &[CellResult]) -> String {
    let known = results.iter().fold(vec![None; plan.measure.metrics.len()], |known: Vec<Option<f64>>, result| {
        known.iter().enumerate().map(|(i, k)| k.or(result.floors.get(i).copied().flatten())).collect()
    });
    let floored: Vec<usize> = (0..known.len()).filter(|i| known[*i].is_some()).collect();
    let net: Vec<usize> = net_columns(plan, &known).into_iter().map(|(i, _)| i).collect();
    let mut text = csv_line(&header(plan, &floored, &net));
    let by_cell: BTreeMap<CellRef, &CellResult> = results.iter().map(|r| (r.cell, r)).collect();
    for (index, cell) in plan.cells.iter().enumerate() {
        let result = by_cell.get(&CellRef::Cell(index)).copied();
        let (status, reason) = match result.map(|r| &r.outcome) {
            Some(Outcome::Done(reason)) => ("done", reason.clone()),
            Some(Outcome::Cached(folder)) => ("cached", folder.display().to_string()),
            Some(Outcome::Failed(reason)) => ("failed", reason.clone()),
            Some(Outcome::Interrupted) => ("interrupted", String::new()),
            None => ("not reached", String::new()),
        };
        let mut fields = vec![index.to_string(), cell.id.to_string()];
        fields.extend(plan.axes.iter().map(|axis| {
            let value = cell.point.iter().find(|(name, _)| name == axis);
            value.map(|(_, v)| v.to_string()).unwrap_or_default()
        }));
        fields.extend([cell.repeat.to_string(), status.to_owned(), reason]);
        let metrics = plan.measure.metrics.len();
        match result.and_then(|r| r.rows.last()) {
            Some(row) => {
                let times = [row.render_s, row.wall_s, row.mpaths_per_s()].map(exact);
                fields.push(row.samples.to_string());
                fields.extend(times);
                fields.push(row.invalid.to_string());
                fields.extend((0..metrics).map(|m| row.metrics.get(m).copied().map(exact).unwrap_or_default()));
                let floor = |m: &usize| result.and_then(|r| r.floors.get(*m).copied().flatten());
                fields.extend(floored.iter().map(|m| floor(m).map(exact).unwrap_or_default()));
                let own = |m: &usize| plan.measure.metrics[*m].net(*row.metrics.get(*m)?, floor(m)?);
                fields.extend(net.iter().map(|m| own(m).map(exact).unwrap_or_default()));
            }
            None => fields.resize(fields.len() + 5 + metrics + floored.len() + net.len(), String::new()),
        }
        text += &csv_line(&fields);
    }
    text
}

fn header(plan: &Plan, floored: &[usize], net: &[usize]) -> Vec<String> {
    let mut header: Vec<String> = BEFORE.map(str::to_owned).to_vec();
    let taken = |name: &String| BEFORE.contains(&name.as_str()) || AFTER.contains(&name.as_str());
    header.extend(plan.axes.iter().map(|a| if taken(a) { format!("axis.{a}") } else { a.clone() }));
    header.extend(AFTER.map(str::to_owned));
    for metric in &plan.measure.metrics {
        let column = &metric.column;
        let name = if header.contains(column) { format!("metric.{column}") } else { column.clone() };
        header.push(name);
    }
    for (places, kind) in [(floored, "floor"), (net, "net")] {
        for metric in places.iter().map(|i| &plan.measure.metrics[*i]) {
            let name = format!("{}_{kind}", metric.column);
            header.push(if header.contains(&name) { format!("{kind}.{name}") } else { name });
        }
    }
    header
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn every_cell_has_its_line() {
        let plan =
            fixture::plan(&[("scene", fixture::words(&["a, b", "c"])), ("depth", fixture::numbers(&[2.0, 5.0]))], 1);
        let mut partial = fixture::done(2, &[(0.5, f64::NAN)]);
        partial.outcome = Outcome::Failed("device said \"no\"".to_owned());
        let results = [
            fixture::done(0, &[(0.5, 0.25), (1.0, 0.125)]),
            fixture::ended(1, Outcome::Cached("runs/x".into())),
            partial,
        ];
        assert_eq!(
            csv(&plan, &results),
            "cell,run,scene,depth,repeat,status,reason,samples_per_pixel,render_s,wall_s,mpaths_per_s,invalid_samples,rmse,ssim,psnr\n\
             0,run00,\"a, b\",2,0,done,64 samples,2,1,1.5,4,0,0.125,0.9375,35\n\
             1,run01,\"a, b\",5,0,cached,runs/x,,,,,,,,\n\
             2,run02,c,2,0,failed,\"device said \"\"no\"\"\",1,0.5,0.75,4,0,nan,nan,nan\n\
             3,run03,c,5,0,not reached,,,,,,,,,\n"
        );
    }

    #[test]
    fn names_that_are_taken_stay_apart() {
        let mut plan = fixture::plan(&[("repeat", fixture::numbers(&[1.0])), ("rmse", fixture::numbers(&[1.0]))], 1);
        plan.measure.metrics.truncate(1);
        let text = csv(&plan, &[]);
        let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
        assert_eq!(header[2..5], ["axis.repeat", "rmse", "repeat"]);
        assert_eq!(header.last(), Some(&"metric.rmse"));
    }

    #[test]
    fn a_plan_without_cells_is_a_header() {
        let mut plan = fixture::plan(&[("depth", fixture::numbers(&[2.0]))], 1);
        plan.cells.clear();
        assert_eq!(csv(&plan, &[]).lines().count(), 1);
    }
}
