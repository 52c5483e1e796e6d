//! Checks that the sheets of a plan can be drawn, before anything is rendered for them.

use std::collections::BTreeSet;

use super::{Cell, Plan, PlanError};
use crate::experiment::sheet::{MAX_COLUMNS, MAX_PICTURES};
use crate::experiment::spec::{PictureMoment, SheetContent, SheetSpec, Snapshots};
use lumbre_light::transport::delay;
use lumbre_light::value::schema::SchemaError;

/// Checks all sheets of a plan.
///
/// # Errors
/// Returns an error for a sheet with too many pictures or columns, for one at a moment of which no
/// picture is kept, and for frames of runs without a time axis, outside of it, or with the density
/// of a material that has none.
pub(super) fn check(plan: &Plan) -> Result<(), PlanError> {
    // Nothing is drawn of a plan whose points are all left out.
    if plan.cells.is_empty() {
        return Ok(());
    }
    plan.sheets.iter().try_for_each(|sheet| {
        check_sheet(plan, sheet).map_err(|error| PlanError::Sheet {
            name: sheet.name.clone(),
            error: Box::new(error),
        })
    })
}

fn check_sheet(plan: &Plan, sheet: &SheetSpec) -> Result<(), SchemaError> {
    let error = |key: &str, problem: String| {
        SchemaError::new(
            format!("{}.{}.{key}", sheet.kind(), sheet.name),
            key,
            problem,
        )
    };
    let (rows, columns, key, wraps) = match &sheet.content {
        SheetContent::Pictures { cols, .. } => {
            let columns = combinations(plan, cols);
            (&sheet.rows, columns, "cols", sheet.rows.is_empty())
        }
        SheetContent::Frames {
            at,
            density,
            complete,
        } => {
            let columns = at.len() + usize::from(*complete) + usize::from(density.is_some());
            let every_point = sheet.rows.is_empty();
            let rows = if every_point { &plan.axes } else { &sheet.rows };
            (rows, columns, "at", false)
        }
    };
    if columns == 0 {
        return Err(error(key, "no moment is given".to_owned()));
    }
    if columns > MAX_COLUMNS && !wraps {
        let problem = format!("{columns} columns are more than the limit of {MAX_COLUMNS}");
        return Err(error(key, problem));
    }
    let pictures = combinations(plan, rows) * columns;
    if pictures > MAX_PICTURES {
        let problem = format!("{pictures} pictures are more than the limit of {MAX_PICTURES}");
        return Err(error(key, problem).with_help("use fewer axes or values"));
    }
    match &sheet.content {
        SheetContent::Pictures { at, .. } => {
            if *at != PictureMoment::End && plan.measure.snapshots == Snapshots::Last {
                let problem = "only final pictures are kept".to_owned();
                return Err(error("at", problem)
                    .with_help("add keep = { exr = \"pow2\" } to x:measure, or use at = \"end\""));
            }
            Ok(())
        }
        SheetContent::Frames { at, density, .. } => {
            check_frames(&plan.cells, at, density.as_deref(), error)
        }
    }
}

/// Returns the number of combinations of values of some axes among the cells.
fn combinations(plan: &Plan, axes: &[String]) -> usize {
    let values = |cell: &Cell| {
        let point = cell.point.iter().filter(|(axis, _)| axes.contains(axis));
        point
            .map(|(_, value)| value.to_string())
            .collect::<Vec<_>>()
    };
    plan.cells.iter().map(values).collect::<BTreeSet<_>>().len()
}

fn check_frames(
    cells: &[Cell],
    at: &[f64],
    density: Option<&str>,
    error: impl Fn(&str, String) -> SchemaError,
) -> Result<(), SchemaError> {
    let timed = || {
        cells
            .iter()
            .filter_map(|c| Some((c, c.config.timing.as_ref()?.axis)))
    };
    let Some((_, first)) = timed().next() else {
        return Err(error("at", "no run has a time axis".to_owned())
            .with_help("add film = { time = { start = 0, bin = 0.1, bins = 100 } } to x:render"));
    };
    let is_outside = |at: &&f64| timed().all(|(_, axis)| **at < axis.start || **at >= axis.end());
    if let Some(outside) = at.iter().find(is_outside) {
        let problem = format!(
            "{outside} is outside of the time axis, which covers {} to {}",
            first.start,
            first.end()
        );
        return Err(error("at", problem));
    }
    if let Some(material) = density {
        for (cell, _) in timed() {
            delay::mixture(&cell.scene, material).map_err(|problem| error("density", problem))?;
        }
    }
    Ok(())
}
