//! Decides by which axes the curves of a figure are distinguished and split into pictures.

use std::slice::from_ref;

use super::AxisPairs;
use crate::experiment::plan::Plan;
use crate::experiment::spec::{FigureKind, FigureSpec};
use crate::output::dependent_axes::{change_phrase, is_determined};
use crate::output::format;

/// Roles of the axes in a figure.
pub(super) struct CurveGrouping {
    /// Axes that distinguish curves: those of `by`, or all that vary and have no other role.
    pub(super) by: Vec<String>,
    /// Axes that distinguish pictures.
    pub(super) facet: Vec<String>,
    /// For a sweep, the axes that are determined by the horizontal axis and the requested axes.
    /// They distinguish nothing.
    pub(super) dependent: Vec<String>,
    /// Remarks for the subtitle on axes that distinguish nothing.
    pub(super) remarks: Vec<String>,
}

/// Assigns the roles of the axes.
pub(super) fn group_axes(plan: &Plan, spec: &FigureSpec) -> CurveGrouping {
    let mut grouping = CurveGrouping {
        by: spec.by.iter().cloned().collect(),
        facet: spec.facet.clone(),
        dependent: Vec::new(),
        remarks: Vec::new(),
    };
    let mut over = None;
    if let FigureKind::Sweep { over: axis, .. } = &spec.kind {
        over = Some(axis);
        group_sweep(plan, spec, axis, &mut grouping);
    }
    if grouping.by.is_empty() {
        let varies = |axis: &&String| {
            let first = format::axis_value(plan, 0, axis);
            (0..plan.cells.len()).any(|cell| format::axis_value(plan, cell, axis) != first)
        };
        let is_free = |axis: &&String| {
            !grouping.facet.contains(axis)
                && !grouping.dependent.contains(axis)
                && over != Some(*axis)
        };
        let by = plan.axes.iter().filter(is_free).filter(varies);
        grouping.by = by.cloned().collect();
    }
    grouping
}

/// Finds the dependent axes of a figure over the axis `over`. Removes requested axes that have
/// only one position on the horizontal axis for each of their values, since no line could be drawn.
fn group_sweep(plan: &Plan, spec: &FigureSpec, over: &String, grouping: &mut CurveGrouping) {
    let cells: Vec<usize> = (0..plan.cells.len())
        .filter(|i| plan.cells[*i].double_of.is_none() && spec.shows(&plan.cells[*i].point))
        .collect();
    let has_single_value = |axis: &String| {
        let values = cells
            .iter()
            .map(|cell| format::axis_value(plan, *cell, axis));
        is_determined(values.map(|value| ((), value)))
    };
    let depends = |axis: &String, from: &[String]| {
        let pair = |cell: &usize| {
            let key = axis_pairs(plan, from, *cell);
            (key, format::axis_value(plan, *cell, axis))
        };
        is_determined(cells.iter().map(pair))
    };
    grouping.remarks.extend(
        [over]
            .into_iter()
            .chain(&grouping.by)
            .filter(|axis| has_single_value(axis))
            .map(|axis| format!("{axis} has a single value")),
    );
    let is_equivalent = |axis: &String| {
        !has_single_value(axis) && depends(axis, from_ref(over)) && depends(over, from_ref(axis))
    };
    grouping.by.retain(|axis| !is_equivalent(axis));
    grouping.facet.retain(|axis| !is_equivalent(axis));
    let requested: Vec<String> = [over]
        .into_iter()
        .chain(&grouping.facet)
        .chain(&grouping.by)
        .cloned()
        .collect();
    grouping.dependent = plan
        .axes
        .iter()
        .filter(|axis| !requested.contains(axis) && !has_single_value(axis))
        .filter(|axis| depends(axis, &requested))
        .cloned()
        .collect();
    let along: Vec<String> = grouping
        .dependent
        .iter()
        .filter(|axis| depends(axis, from_ref(over)))
        .cloned()
        .collect();
    let remark = change_phrase(&along).map(|change| format!("{change} with {over}"));
    grouping.remarks.extend(remark);
}

/// Returns the names and values of some axes at a cell.
pub(super) fn axis_pairs(plan: &Plan, axes: &[String], cell: usize) -> AxisPairs {
    let pair =
        |axis: &String| format::axis_value(plan, cell, axis).map(|v| (axis.clone(), v.to_string()));
    axes.iter().filter_map(pair).collect()
}
