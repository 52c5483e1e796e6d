//! The rows of the plan: references, groups of cells, cells; those that a filter leaves.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::entry::State;
use super::model::Model;
use super::view::{Listing, View};
use super::words;
use crate::experiment::{CellRef, Outline};

/// Fewest cells of which a tree is made.
const SMALLEST_TREE: usize = 25;

/// One row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Row {
    /// A reference or a cell.
    Entry(CellRef),
    /// A group of cells, by its number; whether its cells follow.
    Group(usize, bool),
}

/// What the rows were made of. The same key means the same rows.
#[derive(Clone, Debug, Default, PartialEq)]
struct Key {
    plan: usize,
    filter: String,
    listing: Listing,
    open: Option<usize>,
    /// Only a filter by states depends on what happens.
    revision: u64,
}

/// Cells that share the value of the slowest axis that differs between cells.
#[derive(Clone, Debug)]
pub struct Group {
    /// The value.
    pub name: String,
    /// The cells.
    pub cells: Vec<usize>,
}

/// The rows, kept as long as nothing that they depend on changes.
#[derive(Debug, Default)]
pub struct Rows {
    key: Option<Key>,
    rows: Vec<Row>,
    /// Made once for a plan: the groups, the group of every cell, and every cell's text in lower case.
    outline: Option<Arc<Outline>>,
    groups: Vec<Group>,
    group_of: Vec<usize>,
    labels: Vec<String>,
    references: usize,
}

impl Rows {
    /// Makes the rows anew if anything has changed.
    pub fn update(&mut self, model: &Model, view: &View) -> &Rows {
        let Some(plan) = &model.plan else {
            *self = Rows::default();
            return self;
        };
        if !self.outline.as_ref().is_some_and(|known| Arc::ptr_eq(known, plan)) {
            self.prepare(plan, model);
        }
        let open = match model.current.as_ref().map(|current| current.cell) {
            Some(CellRef::Cell(i)) => self.group_of.get(i).copied(),
            _ => None,
        };
        let key = Key {
            plan: Arc::as_ptr(plan) as usize,
            filter: view.filter.clone(),
            listing: view.listing,
            open,
            revision: if view.filter.is_empty() { 0 } else { model.revision },
        };
        if self.key.as_ref() != Some(&key) {
            self.rows = self.made(model, view, open);
            self.key = Some(key);
        }
        self
    }

    fn prepare(&mut self, plan: &Arc<Outline>, model: &Model) {
        self.key = None;
        self.labels = (0..plan.cells.len()).map(|i| words::cell_name(plan, CellRef::Cell(i)).to_lowercase()).collect();
        self.references = plan.references.len();
        (self.groups, self.group_of) = (Vec::new(), Vec::new());
        let several = model.columns.len() > 1 && plan.cells.len() >= SMALLEST_TREE;
        if let (true, Some(column)) = (several, model.columns.first()) {
            let mut known: BTreeMap<&str, usize> = BTreeMap::new();
            for (i, value) in column.values.iter().enumerate() {
                let group = *known.entry(value).or_insert_with(|| {
                    self.groups.push(Group { name: format!("{}={value}", column.name), cells: Vec::new() });
                    self.groups.len() - 1
                });
                self.groups[group].cells.push(i);
                self.group_of.push(group);
            }
        }
        // A tree whose branches have one leaf each is a list.
        if self.groups.len() * 2 > plan.cells.len() {
            (self.groups, self.group_of) = (Vec::new(), Vec::new());
        }
        self.outline = Some(Arc::clone(plan));
    }

    fn made(&self, model: &Model, view: &View, open: Option<usize>) -> Vec<Row> {
        let wanted: Vec<&str> = view.filter.split_whitespace().collect();
        let shown = |i: &usize| {
            let state = model.cells.get(*i).map_or("", |entry| state_word(&entry.state));
            wanted.iter().all(|word| self.labels[*i].contains(word) || state.starts_with(word))
        };
        let entry = |i: usize| Row::Entry(CellRef::Cell(i));
        let mut rows: Vec<Row> = Vec::new();
        if wanted.is_empty() {
            rows.extend((0..self.references).map(|i| Row::Entry(CellRef::Reference(i))));
        }
        if self.groups.is_empty() || view.listing == Listing::Flat {
            rows.extend((0..self.labels.len()).filter(shown).map(entry));
            return rows;
        }
        for (g, group) in self.groups.iter().enumerate() {
            let cells: Vec<usize> = group.cells.iter().copied().filter(shown).collect();
            if cells.is_empty() {
                continue;
            }
            let is_open = view.listing == Listing::Open || !wanted.is_empty() || open == Some(g);
            rows.push(Row::Group(g, is_open));
            if is_open {
                rows.extend(cells.into_iter().map(entry));
            }
        }
        rows
    }

    /// The rows from the top.
    pub fn all(&self) -> &[Row] {
        &self.rows
    }

    /// A group by its number.
    pub fn group(&self, group: usize) -> Option<&Group> {
        self.groups.get(group)
    }

    /// Whether cells stand below groups.
    pub fn is_tree(&self) -> bool {
        self.rows.iter().any(|row| matches!(row, Row::Group(..)))
    }

    /// The row of a cell or reference, or of the group that it is in; 0 if neither is shown.
    pub fn place(&self, cell: CellRef) -> usize {
        let group = match cell {
            CellRef::Cell(i) => self.group_of.get(i).copied(),
            CellRef::Reference(_) => None,
        };
        let own = self.rows.iter().position(|row| *row == Row::Entry(cell));
        let shared = || self.rows.iter().position(|row| matches!(row, Row::Group(g, _) if Some(*g) == group));
        own.or_else(shared).unwrap_or(0)
    }
}

/// The word by which a filter finds a state.
fn state_word(state: &State) -> &'static str {
    match state {
        State::Waiting => "waiting",
        State::Running => "running",
        State::Done(_) => "done",
        State::Cached => "cached",
        State::Failed(_) => "failed",
        State::Interrupted => "interrupted",
    }
}
