//! Decides by which axes the curves of a figure are distinguished and split into pictures.

use std::slice::from_ref;

use std::sync::Arc;

use crate::dependent_axes::{change_phrase, is_determined};
use lumbre_night::experiment::night::Night;
use lumbre_night::experiment::night::run::Run;
use lumbre_night::experiment::spec::{FigureKind, FigureSpec};

/// Roles of the axes in a figure.
pub(super) struct AxisRoles {
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

impl AxisRoles {
    /// Assigns the roles of the axes.
    pub(super) fn new(night: &Night, spec: &FigureSpec) -> AxisRoles {
        let mut roles = AxisRoles {
            by: spec.by.iter().cloned().collect(),
            facet: spec.facet.clone(),
            dependent: Vec::new(),
            remarks: Vec::new(),
        };
        let mut over = None;
        if let FigureKind::Sweep { over: axis, .. } = &spec.kind {
            over = Some(axis);
            let shown = night.runs.iter().filter(|run| spec.shows(&run.point));
            roles.find_dependent(&shown.collect::<Vec<_>>(), &night.plan.axes, axis);
        }
        if roles.by.is_empty() {
            let varies = |axis: &&String| {
                let mut values = night.runs.iter().map(|run| run.axis_value(axis));
                let first = values.next();
                values.any(|value| Some(value) != first)
            };
            let is_free = |axis: &&String| {
                !roles.facet.contains(axis)
                    && !roles.dependent.contains(axis)
                    && over != Some(*axis)
            };
            let by = night.plan.axes.iter().filter(is_free).filter(varies);
            roles.by = by.cloned().collect();
        }
        roles
    }

    /// Finds the dependent axes of a figure over the axis `over`. Removes requested axes that have
    /// only one position on the horizontal axis for each of their values, since no line could be
    /// drawn.
    fn find_dependent(&mut self, runs: &[&Arc<Run>], axes: &[String], over: &String) {
        let has_single_value =
            |axis: &String| is_determined(runs.iter().map(|run| ((), run.axis_value(axis))));
        let depends = |axis: &String, from: &[String]| {
            let pairs = runs.iter();
            is_determined(pairs.map(|run| (run.axis_values(from), run.axis_value(axis))))
        };
        self.remarks.extend(
            [over]
                .into_iter()
                .chain(&self.by)
                .filter(|axis| has_single_value(axis))
                .map(|axis| format!("{axis} has a single value")),
        );
        let is_equivalent = |axis: &String| {
            !has_single_value(axis)
                && depends(axis, from_ref(over))
                && depends(over, from_ref(axis))
        };
        self.by.retain(|axis| !is_equivalent(axis));
        self.facet.retain(|axis| !is_equivalent(axis));
        let requested = [from_ref(over), &self.facet, &self.by].concat();
        self.dependent = axes
            .iter()
            .filter(|axis| !requested.contains(axis) && !has_single_value(axis))
            .filter(|axis| depends(axis, &requested))
            .cloned()
            .collect();
        let along = self.dependent.iter();
        let along = along.filter(|axis| depends(axis, from_ref(over)));
        let remark = change_phrase(&along.cloned().collect::<Vec<_>>());
        self.remarks
            .extend(remark.map(|change| format!("{change} with {over}")));
    }
}
