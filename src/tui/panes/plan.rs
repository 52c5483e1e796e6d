//! The plan: every reference and every cell with its state and its numbers.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::pane;
use crate::experiment::{CellRef, WaveRow};
use crate::tui::column::Column;
use crate::tui::entry::{Counts, Entry, State};
use crate::tui::eta;
use crate::tui::model::Model;
use crate::tui::rows::{Group, Row};
use crate::tui::view::View;
use crate::tui::words;

/// Rows that the plan has: its references, groups and cells, as far as the filter leaves them.
pub fn rows(model: &Model, view: &View) -> usize {
    view.rows.borrow_mut().update(model, view).all().len()
}

/// Rows that fit on screen below the header.
pub fn page(area: Rect) -> usize {
    usize::from(area.height).saturating_sub(3).max(1)
}

/// The first row on screen: where the user scrolled to, else so that the current cell has some of its past above it.
pub fn top(model: &Model, view: &View, page: usize) -> usize {
    let most = rows(model, view).saturating_sub(page);
    let follow = || {
        let row = model.current.as_ref().map_or(0, |current| view.row_of(current.cell, model));
        row.saturating_sub(page / 2)
    };
    view.plan_top.unwrap_or_else(follow).min(most)
}

/// A number column on the right-hand side.
struct Numbers {
    name: String,
    width: usize,
    text: Box<dyn Fn(&WaveRow) -> String>,
}

/// The number columns, most important first: samples, the chart's metric, render time, speed.
fn numbers(model: &Model, view: &View) -> Vec<Numbers> {
    let column = |name: &str, width: usize, text: Box<dyn Fn(&WaveRow) -> String>| Numbers {
        name: name.to_owned(),
        width: width.max(words::width(name)),
        text,
    };
    let mut numbers = vec![column("spp", 5, Box::new(|row| words::count(row.samples)))];
    let metrics = model.plan.as_ref().map_or(&[][..], |plan| &plan.metrics[..]);
    if let Some(metric) = metrics.get(view.metric) {
        let index = view.metric;
        let text = move |row: &WaveRow| row.metrics.get(index).map_or_else(String::new, |x| words::number(*x));
        numbers.push(column(&metric.column, 7, Box::new(text)));
    }
    numbers.push(column("time", 6, Box::new(|row| words::duration(row.render_s))));
    numbers.push(column("Mpaths/s", 8, Box::new(|row| words::number(row.mpaths_per_s()))));
    numbers
}

/// Draws the plan.
pub fn draw(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    let counts = Counts::of(&model.cells);
    let mut title = vec![Span::styled(" Plan ", look.strong())];
    if let Some(plan) = &model.plan {
        let skipped = plan.skipped;
        let left_out = if skipped > 0 { format!(", {skipped} left out") } else { String::new() };
        let noun = if counts.total() == 1 { "cell" } else { "cells" };
        title.push(Span::styled(format!("{} {noun}{left_out} ", counts.total()), look.dim()));
    }
    if !view.filter.is_empty() {
        let room = usize::from(area.width).saturating_sub(30);
        let words = words::fit(&words::clean(&view.filter), room, look.glyphs().ellipsis);
        title.push(Span::styled(format!("/{words} "), look.warn()));
    }
    let block = pane(look, Line::from(title));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    if model.plan.is_none() {
        frame.render_widget(Paragraph::new("waiting for the plan").style(look.dim()), inner);
        return;
    }
    let page = page(area);
    let top = top(model, view, page);
    let rows = view.rows.borrow();
    let all = rows.all().len();
    let table = Table::new(model, view, usize::from(inner.width), rows.is_tree());
    let mut lines = vec![table.header()];
    lines.extend(rows.all().iter().skip(top).take(page).map(|row| match row {
        Row::Entry(cell) => table.row(*cell),
        Row::Group(group, open) => table.group(rows.group(*group), *open),
    }));
    if all == 0 {
        lines.push(Line::styled("no cell has these words", look.dim()));
    }
    frame.render_widget(Paragraph::new(lines), inner);
    let hidden = all.saturating_sub(top + page);
    if hidden > 0 || top > 0 {
        let place = format!(" {}-{} of {all} ", top + 1, all - hidden);
        let width = words::width(&place) as u16;
        let at = Rect { x: area.right().saturating_sub(width + 1), y: area.bottom() - 1, width, height: 1 };
        frame.render_widget(Span::styled(place, look.dim()), at.intersection(area));
    }
}

/// The columns that fit into the pane.
struct Table<'m> {
    model: &'m Model,
    view: &'m View,
    /// Width of each axis column.
    axes: Vec<usize>,
    /// Width of what describes a cell, all axis columns together.
    label: usize,
    numbers: Vec<Numbers>,
    /// Width of everything.
    width: usize,
    /// Whether cells stand below groups.
    tree: bool,
}

impl<'m> Table<'m> {
    /// Chooses columns: the axes come first, number columns as far as there is room, and where even the axes do not
    /// fit, the widest of them are cut.
    fn new(model: &'m Model, view: &'m View, width: usize, tree: bool) -> Table<'m> {
        let mut numbers = numbers(model, view);
        // In a tree the first axis stands on the group's row, and as much room is left for its branch.
        let indent = if tree { 2 } else { 0 };
        let mut axes: Vec<usize> = model.columns.iter().map(|column| column.width).collect();
        if tree && !axes.is_empty() {
            axes[0] = 0;
        }
        let wanted = |axes: &[usize]| 2 + indent + axes.iter().map(|w| w + 2).sum::<usize>().saturating_sub(2);
        let needed = |numbers: &[Numbers]| numbers.iter().map(|n| n.width + 1).sum::<usize>();
        // What a reference is called needs some room even where cells are told apart by little.
        let least = if model.references.is_empty() { 2 } else { 15 };
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
        Table { model, view, axes, label, numbers, width, tree }
    }

    fn axis_texts<'a>(&'a self, text: impl Fn(&'a Column) -> &'a str) -> String {
        let ellipsis = self.view.look.glyphs().ellipsis;
        let columns = self.model.columns.iter().zip(&self.axes).skip(usize::from(self.tree));
        let texts = columns.map(|(column, width)| {
            let text = words::fit(text(column), *width, ellipsis);
            let pad = " ".repeat(width.saturating_sub(words::width(&text)));
            if column.numeric { pad + &text } else { text + &pad }
        });
        let indent = if self.tree { "  " } else { "" };
        indent.to_owned() + &texts.collect::<Vec<_>>().join("  ")
    }

    fn padded(&self, text: &str) -> String {
        let text = words::fit(text, self.label, self.view.look.glyphs().ellipsis);
        let pad = " ".repeat(self.label.saturating_sub(words::width(&text)));
        text + &pad
    }

    fn header(&self) -> Line<'static> {
        let mut line = format!("  {}", self.padded(&self.axis_texts(|column| &column.name)));
        for n in &self.numbers {
            let name = words::fit(&n.name, n.width, self.view.look.glyphs().ellipsis);
            line.push_str(&format!(" {name:>width$}", width = n.width));
        }
        Line::styled(line, self.view.look.dim())
    }

    /// The row of a group: its value, how many of its cells are settled, and how many failed.
    fn group(&self, group: Option<&Group>, open: bool) -> Line<'static> {
        let Some(group) = group else { return Line::default() };
        let (look, glyphs) = (self.view.look, self.view.look.glyphs());
        let state = |i: &usize| self.model.cells.get(*i).map(|entry| &entry.state);
        let settled = group.cells.iter().filter_map(state);
        let (mut done, mut failed, mut running) = (0, 0, false);
        for state in settled {
            match state {
                State::Done(_) | State::Cached => done += 1,
                State::Failed(_) => failed += 1,
                State::Running => running = true,
                State::Waiting | State::Interrupted => {}
            }
        }
        let style = if running { look.strong() } else { Style::new() };
        let mut line = Line::from(vec![
            Span::styled(if open { glyphs.open } else { glyphs.closed }, look.accent()),
            Span::styled(
                format!(" {}  ", words::fit(&group.name, self.width.saturating_sub(16), glyphs.ellipsis)),
                style,
            ),
            Span::styled(format!("{done}/{}", group.cells.len()), look.dim()),
        ]);
        if failed > 0 {
            line.push_span(Span::styled(format!("  {failed} failed"), look.bad()));
        }
        line
    }

    /// The row of a reference or a cell.
    fn row(&self, cell: CellRef) -> Line<'static> {
        let Some(entry) = self.model.entry(cell) else { return Line::default() };
        let label = self.label(cell);
        let (glyph, style) = self.sign(entry);
        let text = match entry.state {
            State::Waiting => self.view.look.dim(),
            State::Running => self.view.look.strong(),
            _ => Style::new(),
        };
        let mut spans = vec![Span::styled(glyph, style), Span::raw(" ")];
        if let State::Failed(reason) = &entry.state {
            let label = format!("{label}  ");
            let room = self.width.saturating_sub(2 + words::width(&label));
            spans.push(Span::styled(label, text));
            spans.push(Span::styled(words::fit(reason, room, self.view.look.glyphs().ellipsis), style));
            return Line::from(spans);
        }
        let running = matches!(entry.state, State::Running);
        let progress = self.parts(cell).or_else(|| if running { self.progress(cell, entry) } else { None });
        let with_progress = progress.map(|percent| format!("{label}  {percent}"));
        let label = with_progress.filter(|text| words::width(text) <= self.label).unwrap_or(label);
        let mut line = self.padded(&label);
        for n in &self.numbers {
            let value = entry.last.as_deref().map_or_else(String::new, &n.text);
            line.push_str(&format!(" {value:>width$}", width = n.width));
        }
        spans.push(Span::styled(line, text));
        Line::from(spans)
    }

    /// What a cell is: its values in the axis columns; or the longest name of a reference that fits.
    fn label(&self, cell: CellRef) -> String {
        let name = self.model.plan.as_ref().map_or_else(String::new, |plan| words::cell_name(plan, cell));
        match cell {
            CellRef::Cell(i) if !self.axes.is_empty() => {
                self.axis_texts(|column| column.values.get(i).map_or("", String::as_str))
            }
            CellRef::Cell(_) => name,
            CellRef::Reference(i) => {
                let technique = name.split(' ').next().unwrap_or("");
                // How many parts are there says more than its whole name.
                let parts = self.parts(cell).map_or(0, |parts| 2 + parts.len());
                let room = self.label.saturating_sub(parts);
                let names =
                    [format!("reference {name}"), format!("reference {technique}"), format!("reference {}", i + 1)];
                let fitting = names.iter().find(|name| words::width(name) <= room);
                fitting.cloned().unwrap_or_else(|| format!("ref {}", i + 1))
            }
        }
    }

    /// How many parts of a reference are there, while they are not joined.
    fn parts(&self, cell: CellRef) -> Option<String> {
        self.model.parts_of(cell).map(|(done, of)| format!("{done}/{of} parts"))
    }

    /// How much of a running cell's stop rule is behind it.
    fn progress(&self, cell: CellRef, entry: &Entry) -> Option<String> {
        let fraction = eta::fraction(self.model.stop_rule(cell)?, entry.last.as_deref()?)?;
        Some(format!("{:.0} %", (fraction * 100.0).floor()))
    }

    fn sign(&self, entry: &Entry) -> (&'static str, Style) {
        let (look, glyphs) = (self.view.look, self.view.look.glyphs());
        match entry.state {
            State::Waiting => (glyphs.waiting, look.dim()),
            State::Running => (glyphs.running, look.accent()),
            State::Done(_) => (glyphs.done, look.good()),
            State::Cached => (glyphs.cached, look.good()),
            State::Failed(_) => (glyphs.failed, look.bad()),
            State::Interrupted => (glyphs.interrupted, look.warn()),
        }
    }
}
