//! The plan pane: every reference and cell with its state and measurements.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{framed, pane};
use crate::tui::format;
use crate::tui::model::column::Column;
use crate::tui::model::eta;
use crate::tui::model::night::NightModel;
use crate::tui::model::plan_rows::{CellGroup, PlanRow};
use crate::tui::view::View;
use lumbre_night::experiment::night::run::RunState;
use lumbre_night::experiment::night::state_counts::StateCounts;
use lumbre_night::experiment::{CellRef, Outcome, WaveRow};

/// Number of rows of the plan after filtering: references, groups and cells.
pub fn rows(model: &NightModel, view: &View) -> usize {
    view.rows
        .borrow_mut()
        .update(model, &view.filter, view.layout)
        .all()
        .len()
}

/// Number of rows that fit on screen below the header.
pub fn page(area: Rect) -> usize {
    usize::from(area.height).saturating_sub(3).max(1)
}

/// Index of the first visible row: the user's scroll position, or half a page above the current
/// cell.
pub fn top(model: &NightModel, view: &View, page: usize) -> usize {
    let most = rows(model, view).saturating_sub(page);
    let follow = || {
        let row = model
            .current
            .as_ref()
            .map_or(0, |current| view.row_of(current.cell, model));
        row.saturating_sub(page / 2)
    };
    view.plan_top.unwrap_or_else(follow).min(most)
}

/// A numeric column on the right-hand side.
struct Numbers {
    name: String,
    width: usize,
    text: Box<dyn Fn(&WaveRow) -> String>,
}

/// Numeric columns, most important first: samples, the chart's metric, render time, speed.
fn numbers(model: &NightModel, view: &View) -> Vec<Numbers> {
    let column = |name: &str, width: usize, text: Box<dyn Fn(&WaveRow) -> String>| Numbers {
        name: name.to_owned(),
        width: width.max(format::width(name)),
        text,
    };
    let mut numbers = vec![column("spp", 5, Box::new(|row| format::count(row.samples)))];
    if let Some(metric) = model.metrics().get(view.metric) {
        let index = view.metric;
        let text = move |row: &WaveRow| {
            row.metrics
                .get(index)
                .map_or_else(String::new, |x| format::number(*x))
        };
        numbers.push(column(&metric.column, 7, Box::new(text)));
    }
    numbers.push(column(
        "time",
        6,
        Box::new(|row| format::duration(row.render_s)),
    ));
    numbers.push(column(
        "Mpaths/s",
        8,
        Box::new(|row| format::number(row.mpaths_per_s())),
    ));
    numbers
}

/// Draws the plan pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let caps = view.caps;
    let counts = StateCounts::of_runs(&model.night.runs);
    let mut title = vec![Span::styled(" Plan ", caps.strong())];
    if let Some(night) = model.planned() {
        let skipped = night.plan.skipped;
        let left_out = if skipped > 0 {
            format!(", {skipped} skipped")
        } else {
            String::new()
        };
        let noun = if counts.total() == 1 { "cell" } else { "cells" };
        title.push(Span::styled(
            format!("{} {noun}{left_out} ", counts.total()),
            caps.dim(),
        ));
    }
    if !view.filter.is_empty() {
        let room = usize::from(area.width).saturating_sub(30);
        let words = format::fit(&format::clean(&view.filter), room, caps.glyphs().ellipsis);
        title.push(Span::styled(format!("/{words} "), caps.warn()));
    }
    let inner = framed(frame, area, pane(caps, Line::from(title)));
    if model.planned().is_none() {
        frame.render_widget(
            Paragraph::new("waiting for the plan").style(caps.dim()),
            inner,
        );
        return;
    }
    let page = page(area);
    let top = top(model, view, page);
    let rows = view.rows.borrow();
    let all = rows.all().len();
    let running = model.current.as_ref().filter(|current| current.running);
    if !view.filter.is_empty() && running.is_some_and(|current| !rows.contains(current.cell)) {
        let note = Span::styled(" the running one is filtered out ", caps.warn());
        let at = Rect {
            x: area.x + 1,
            y: area.bottom() - 1,
            width: note.width() as u16,
            height: 1,
        };
        frame.render_widget(note, at.intersection(area));
    }
    let table = Table::new(model, view, usize::from(inner.width), rows.is_tree());
    let mut lines = vec![table.header()];
    lines.extend(rows.all().iter().skip(top).take(page).map(|row| match row {
        PlanRow::Run(cell) => table.row(*cell),
        PlanRow::References => table.references(),
        PlanRow::Group(group, open) => table.group(rows.group(*group), *open),
    }));
    if all == 0 {
        lines.push(Line::styled("no cell matches the filter", caps.dim()));
    }
    frame.render_widget(Paragraph::new(lines), inner);
    let hidden = all.saturating_sub(top + page);
    if hidden > 0 || top > 0 {
        let position = format!(" {}-{} of {all} ", top + 1, all - hidden);
        let width = format::width(&position) as u16;
        let at = Rect {
            x: area.right().saturating_sub(width + 1),
            y: area.bottom() - 1,
            width,
            height: 1,
        };
        frame.render_widget(Span::styled(position, caps.dim()), at.intersection(area));
    }
}

/// The columns that fit into the pane.
struct Table<'m> {
    model: &'m NightModel,
    view: &'m View,
    /// Width of each axis column.
    axes: Vec<usize>,
    /// Width of the label of a cell: all axis columns together.
    label: usize,
    numbers: Vec<Numbers>,
    /// Width of the pane.
    width: usize,
    /// Whether cells are listed below groups.
    tree: bool,
}

impl<'m> Table<'m> {
    /// Chooses the columns. Axes come first, then as many numeric columns as fit; if even the axes
    /// do not fit, the widest of them are truncated.
    fn new(model: &'m NightModel, view: &'m View, width: usize, tree: bool) -> Table<'m> {
        let mut numbers = numbers(model, view);
        // In a tree the row of the group shows the first axis, and cells are indented instead.
        let indent = if tree { 2 } else { 0 };
        let mut axes: Vec<usize> = model.columns.iter().map(|column| column.width).collect();
        if tree && !axes.is_empty() {
            axes[0] = 0;
        }
        let wanted = |axes: &[usize]| {
            2 + indent + axes.iter().map(|w| w + 2).sum::<usize>().saturating_sub(2)
        };
        let needed = |numbers: &[Numbers]| numbers.iter().map(|n| n.width + 1).sum::<usize>();
        // The name of a reference needs a minimum width even if cells have short labels.
        let least = if model.night.references.is_empty() {
            2
        } else {
            15
        };
        while numbers.len() > 1 && wanted(&axes).max(least) + needed(&numbers) > width {
            numbers.pop();
        }
        if wanted(&axes) + needed(&numbers) > width {
            numbers.clear();
        }
        while wanted(&axes) > width && axes.iter().any(|w| *w > 3) {
            if let Some(widest) = axes.iter_mut().max_by_key(|w| **w) {
                *widest -= 1;
            }
        }
        let label = width.saturating_sub(2 + needed(&numbers));
        Table {
            model,
            view,
            axes,
            label,
            numbers,
            width,
            tree,
        }
    }

    fn axis_texts<'a>(&'a self, text: impl Fn(&'a Column) -> &'a str) -> String {
        let ellipsis = self.view.caps.glyphs().ellipsis;
        let columns = self
            .model
            .columns
            .iter()
            .zip(&self.axes)
            .skip(usize::from(self.tree));
        let texts = columns.map(|(column, width)| {
            let text = format::fit(text(column), *width, ellipsis);
            let pad = " ".repeat(width.saturating_sub(format::width(&text)));
            if column.numeric {
                pad + &text
            } else {
                text + &pad
            }
        });
        let indent = if self.tree { "  " } else { "" };
        indent.to_owned() + &texts.collect::<Vec<_>>().join("  ")
    }

    fn padded(&self, text: &str) -> String {
        let text = format::fit(text, self.label, self.view.caps.glyphs().ellipsis);
        let pad = " ".repeat(self.label.saturating_sub(format::width(&text)));
        text + &pad
    }

    fn header(&self) -> Line<'static> {
        let mut line = format!("  {}", self.padded(&self.axis_texts(|column| &column.name)));
        for n in &self.numbers {
            let name = format::fit(&n.name, n.width, self.view.caps.glyphs().ellipsis);
            line.push_str(&format!(" {name:>width$}", width = n.width));
        }
        Line::styled(line, self.view.caps.dim())
    }

    /// PlanRow of all references, which are finished.
    fn references(&self) -> Line<'static> {
        let (caps, glyphs) = (self.view.caps, self.view.caps.glyphs());
        let count = self.model.night.references.len();
        Line::from(vec![
            Span::styled(glyphs.closed, caps.accent()),
            Span::raw(" references  "),
            Span::styled(format!("{count}/{count} "), caps.dim()),
            Span::styled(glyphs.done, caps.good()),
        ])
    }

    /// PlanRow of a group: its value, and the number of its finished and failed cells.
    fn group(&self, group: Option<&CellGroup>, open: bool) -> Line<'static> {
        let Some(group) = group else {
            return Line::default();
        };
        let (caps, glyphs) = (self.view.caps, self.view.caps.glyphs());
        let state = |i: &usize| self.model.night.state(CellRef::Cell(*i));
        let counts = StateCounts::of(group.cells.iter().filter_map(state));
        let (done, failed) = (counts.done + counts.cached, counts.failed);
        let style = if counts.running > 0 {
            caps.strong()
        } else {
            Style::new()
        };
        let mut line = Line::from(vec![
            Span::styled(
                if open { glyphs.open } else { glyphs.closed },
                caps.accent(),
            ),
            Span::styled(
                format!(
                    " {}  ",
                    format::fit(&group.name, self.width.saturating_sub(16), glyphs.ellipsis)
                ),
                style,
            ),
            Span::styled(format!("{done}/{}", group.cells.len()), caps.dim()),
        ]);
        if failed > 0 {
            line.push_span(Span::styled(format!("  {failed} failed"), caps.bad()));
        }
        line
    }

    /// PlanRow of a reference or a cell.
    fn row(&self, cell: CellRef) -> Line<'static> {
        let Some(state) = self.model.night.state(cell) else {
            return Line::default();
        };
        let last = self.model.night.last_row(cell);
        let label = self.label(cell);
        let (glyph, style) = self.sign(state);
        let text = match state {
            RunState::Pending => self.view.caps.dim(),
            RunState::Running => self.view.caps.strong(),
            _ => Style::new(),
        };
        let mut spans = vec![Span::styled(glyph, style), Span::raw(" ")];
        if let RunState::Ended(Outcome::Failed(reason)) = state {
            let label = format!("{label}  ");
            let room = self.width.saturating_sub(2 + format::width(&label));
            spans.push(Span::styled(label, text));
            spans.push(Span::styled(
                format::fit(
                    &format::clean(reason),
                    room,
                    self.view.caps.glyphs().ellipsis,
                ),
                style,
            ));
            return Line::from(spans);
        }
        let running = *state == RunState::Running;
        let progress = self
            .shards(cell)
            .or_else(|| if running { self.progress(cell) } else { None });
        let with_progress = progress.map(|percent| format!("{label}  {percent}"));
        let label = with_progress
            .filter(|text| format::width(text) <= self.label)
            .unwrap_or(label);
        let mut line = self.padded(&label);
        for n in &self.numbers {
            let value = last.map_or_else(String::new, &n.text);
            line.push_str(&format!(" {value:>width$}", width = n.width));
        }
        spans.push(Span::styled(line, text));
        Line::from(spans)
    }

    /// Label of a cell (its values in the axis columns) or of a reference (its longest name that
    /// fits).
    fn label(&self, cell: CellRef) -> String {
        let name = format::cell_name(&self.model.night, cell);
        match cell {
            CellRef::Cell(i) if !self.axes.is_empty() => {
                self.axis_texts(|column| column.values.get(i).map_or("", String::as_str))
            }
            CellRef::Cell(_) => name,
            CellRef::Reference(i) => {
                let technique = name.split(' ').next().unwrap_or("");
                // The number of finished shards is more useful than the full name.
                let shards = self.shards(cell).map_or(0, |text| 2 + text.len());
                let room = self.label.saturating_sub(shards);
                let values = self.model.night.references.get(i).map(|reference| {
                    let values = reference.values.iter().map(|(_, value)| value.as_str());
                    std::iter::once(technique)
                        .chain(values)
                        .collect::<Vec<_>>()
                        .join(" ")
                });
                let names = [
                    format!("reference {name}"),
                    format!("reference {}", values.unwrap_or_default()),
                    format!("reference {technique}"),
                    format!("reference {}", i + 1),
                ];
                let fitting = names.iter().find(|name| format::width(name) <= room);
                fitting.cloned().unwrap_or_else(|| format!("ref {}", i + 1))
            }
        }
    }

    /// Number of finished shards of a reference that is not complete.
    fn shards(&self, cell: CellRef) -> Option<String> {
        self.model
            .shard_progress(cell)
            .map(|(done, count)| format!("{done}/{count} shards"))
    }

    /// Completed part of a running cell's stop rule, in per cent.
    fn progress(&self, cell: CellRef) -> Option<String> {
        let last = self.model.night.last_row(cell)?;
        let fraction = eta::fraction(self.model.stop_rule(cell)?, last)?;
        Some(format!("{:.0} %", (fraction * 100.0).floor()))
    }

    fn sign(&self, state: &RunState) -> (&'static str, Style) {
        let (caps, glyphs) = (self.view.caps, self.view.caps.glyphs());
        match state {
            RunState::Pending | RunState::Damaged(_) => (glyphs.waiting, caps.dim()),
            RunState::Running => (glyphs.running, caps.accent()),
            RunState::Ended(Outcome::Done(_)) => (glyphs.done, caps.good()),
            RunState::Ended(Outcome::Cached(_)) => (glyphs.cached, caps.good()),
            RunState::Ended(Outcome::Failed(_)) => (glyphs.failed, caps.bad()),
            RunState::Ended(Outcome::Interrupted) => (glyphs.interrupted, caps.warn()),
        }
    }
}
