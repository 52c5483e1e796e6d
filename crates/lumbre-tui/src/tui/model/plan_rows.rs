//! Rows of the plan pane: references, groups of cells and cells that pass the filter.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::night::NightModel;
use crate::tui::format;
use crate::tui::modes::PlanLayout;
use lumbre_night::experiment::night::NightPlan;
use lumbre_night::experiment::night::run::RunState;
use lumbre_night::experiment::{CellRef, Night, Outcome};

/// Smallest number of cells that is shown as a tree.
const SMALLEST_TREE: usize = 25;

/// Smallest number of finished references that share one row.
const FOLDED_REFERENCES: usize = 4;

/// A row of the plan pane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanRow {
    /// A reference or a cell.
    Run(CellRef),
    /// All references in one row, once they are finished.
    References,
    /// A group of cells: its index, and whether its cells follow.
    Group(usize, bool),
}

/// Everything that the rows depend on. Equal keys give equal rows.
#[derive(Clone, Debug, Default, PartialEq)]
struct RowsKey {
    plan: usize,
    filter: String,
    layout: PlanLayout,
    open: Option<usize>,
    references_are_done: bool,
    /// Revision of the model; zero without a filter, since only a filter depends on states.
    revision: u64,
}

/// Cells that share the value of the slowest axis that differs between cells.
#[derive(Clone, Debug)]
pub struct CellGroup {
    /// Name and value of the axis, as `depth=5`.
    pub name: String,
    /// Indices of the cells.
    pub cells: Vec<usize>,
}

/// Cached rows of the plan pane, rebuilt only if something that they depend on changes.
#[derive(Debug, Default)]
pub struct PlanRows {
    key: Option<RowsKey>,
    rows: Vec<PlanRow>,
    /// The plan for which `groups`, `group_of` and `labels` (in lower case) were built.
    plan: Option<Arc<NightPlan>>,
    groups: Vec<CellGroup>,
    group_of: Vec<usize>,
    labels: Vec<String>,
    references: usize,
}

impl PlanRows {
    /// Rebuilds the rows if anything has changed.
    pub fn update(&mut self, model: &NightModel, filter: &str, layout: PlanLayout) -> &PlanRows {
        let Some(night) = model.planned() else {
            *self = PlanRows::default();
            return self;
        };
        let plan = &night.plan;
        let known = self.plan.as_ref();
        if !known.is_some_and(|known| Arc::ptr_eq(known, plan)) {
            self.prepare(night, model);
        }
        let open = match model.current.as_ref().map(|current| current.cell) {
            Some(CellRef::Cell(i)) => self.group_of.get(i).copied(),
            _ => None,
        };
        let key = RowsKey {
            plan: Arc::as_ptr(plan) as usize,
            filter: filter.to_owned(),
            layout,
            open,
            references_are_done: references_are_done(model),
            revision: if filter.is_empty() { 0 } else { model.revision },
        };
        if self.key.as_ref() != Some(&key) {
            self.rows = self.build(model, filter, layout, open);
            self.key = Some(key);
        }
        self
    }

    fn prepare(&mut self, night: &Night, model: &NightModel) {
        self.key = None;
        self.labels = (0..night.runs.len())
            .map(|i| format::cell_name(night, CellRef::Cell(i)).to_lowercase())
            .collect();
        self.references = night.references.len();
        (self.groups, self.group_of) = (Vec::new(), Vec::new());
        let several = model.columns.len() > 1 && night.runs.len() >= SMALLEST_TREE;
        if let (true, Some(column)) = (several, model.columns.first()) {
            let mut known: BTreeMap<&str, usize> = BTreeMap::new();
            for (i, value) in column.values.iter().enumerate() {
                let group = *known.entry(value).or_insert_with(|| {
                    self.groups.push(CellGroup {
                        name: format!("{}={value}", column.name),
                        cells: Vec::new(),
                    });
                    self.groups.len() - 1
                });
                self.groups[group].cells.push(i);
                self.group_of.push(group);
            }
        }
        // If most groups would hold a single cell, a list is easier to read.
        if self.groups.len() * 2 > night.runs.len() {
            (self.groups, self.group_of) = (Vec::new(), Vec::new());
        }
        self.plan = Some(Arc::clone(&night.plan));
    }

    fn build(
        &self,
        model: &NightModel,
        filter: &str,
        layout: PlanLayout,
        open: Option<usize>,
    ) -> Vec<PlanRow> {
        let wanted: Vec<&str> = filter.split_whitespace().collect();
        let shown = |i: &usize| {
            let state = model.night.state(CellRef::Cell(*i)).map_or("", state_word);
            wanted
                .iter()
                .all(|word| self.labels[*i].contains(word) || state.starts_with(word))
        };
        let entry = |i: usize| PlanRow::Run(CellRef::Cell(i));
        let mut rows: Vec<PlanRow> = Vec::new();
        if wanted.is_empty() {
            let fold = self.references >= FOLDED_REFERENCES && references_are_done(model);
            if fold && layout != PlanLayout::Open {
                rows.push(PlanRow::References);
            } else {
                rows.extend((0..self.references).map(|i| PlanRow::Run(CellRef::Reference(i))));
            }
        }
        if self.groups.is_empty() || layout == PlanLayout::Flat {
            rows.extend((0..self.labels.len()).filter(shown).map(entry));
            return rows;
        }
        for (g, group) in self.groups.iter().enumerate() {
            let cells: Vec<usize> = group.cells.iter().copied().filter(shown).collect();
            if cells.is_empty() {
                continue;
            }
            let is_open = layout == PlanLayout::Open || !wanted.is_empty() || open == Some(g);
            rows.push(PlanRow::Group(g, is_open));
            if is_open {
                rows.extend(cells.into_iter().map(entry));
            }
        }
        rows
    }

    /// Returns all rows from the top.
    pub fn all(&self) -> &[PlanRow] {
        &self.rows
    }

    /// Returns a group by its index.
    pub fn group(&self, group: usize) -> Option<&CellGroup> {
        self.groups.get(group)
    }

    /// Whether the rows contain groups.
    pub fn is_tree(&self) -> bool {
        self.rows
            .iter()
            .any(|row| matches!(row, PlanRow::Group(..)))
    }

    /// Whether a cell or reference has a row of its own.
    pub fn contains(&self, cell: CellRef) -> bool {
        self.rows.contains(&PlanRow::Run(cell))
    }

    /// Index of the row of a cell or reference, or of its group; 0 if neither is shown.
    pub fn index_of(&self, cell: CellRef) -> usize {
        let group = match cell {
            CellRef::Cell(i) => self.group_of.get(i).copied(),
            CellRef::Reference(_) => None,
        };
        let own = self.rows.iter().position(|row| *row == PlanRow::Run(cell));
        let is_shared = |row: &PlanRow| match row {
            PlanRow::Group(g, _) => Some(*g) == group,
            PlanRow::References => group.is_none(),
            PlanRow::Run(_) => false,
        };
        let shared = || self.rows.iter().position(is_shared);
        own.or_else(shared).unwrap_or(0)
    }
}

/// Returns whether every reference is finished.
fn references_are_done(model: &NightModel) -> bool {
    let mut references = model.night.references.iter();
    references.all(|reference| reference.state.is_done())
}

/// Returns the word with which a filter matches a state.
fn state_word(state: &RunState) -> &'static str {
    match state {
        RunState::Pending | RunState::Damaged(_) => "waiting",
        RunState::Running => "running",
        RunState::Ended(Outcome::Done(_)) => "done",
        RunState::Ended(Outcome::Cached(_)) => "cached",
        RunState::Ended(Outcome::Failed(_)) => "failed",
        RunState::Ended(Outcome::Interrupted) => "interrupted",
    }
}
