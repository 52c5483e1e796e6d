//! Heat maps over two axes: the final value of a metric for each combination of their values,
//! averaged over all other axes and repeats.

use super::ReportError;
use super::convergence::mean_name;
use super::films::colour_bar;
use super::item::ReportItem;
use super::study::{ReportOptions, Study};
use crate::format;
use crate::format::significant;
use crate::metric_display::MetricDisplay;
use crate::plot::axis::Scale;
use crate::plot::sizes::{FULL, SCREEN};
use crate::plot::style::{FAINT, INK};
use crate::plot::svg::{Anchor, Drawing, Font, shorten, text_width};
use crate::provenance::Provenance;
use crate::repeats::Spread;
use lumbre_light::math::luminance::luminance;
use lumbre_metrics::map::Colours;

/// Width and height of a cell in points. The width is up to 1.5 times as large if there is space.
const CELL: (f64, f64) = (46.0, 22.0);
/// Space above the cells.
const TOP: f64 = 34.0;
/// Range of the colour map that cells use. Its ends are too close to black text and white paper.
const RANGE: [f32; 2] = [0.12, 0.92];
const LABEL: Font = Font::new(7.6, INK);
const NAME: Font = Font::strong(8.0);
const SMALL: Font = Font::new(7.0, FAINT);

/// Draws one map for each metric if two axes vary or were requested.
///
/// # Errors
/// Returns an error if a requested axis does not exist.
pub fn all(study: &Study, options: &ReportOptions) -> Result<Vec<ReportItem>, ReportError> {
    let axes = study.axes();
    let pair = match &options.heat {
        Some(pair) => {
            if let Some(missing) = pair.iter().find(|axis| !axes.contains(axis)) {
                return Err(ReportError::NoAxis {
                    axis: missing.clone(),
                    known: axes.join(", "),
                });
            }
            Some(pair.clone())
        }
        None => default_axes(study, &axes),
    };
    let Some(pair) = pair else {
        return Ok(Vec::new());
    };
    Ok((0..study.metrics.len())
        .filter_map(|metric| HeatMap::new(study, metric, &pair))
        .map(|map| map.item(study))
        .collect())
}

/// Returns the horizontal and the vertical axis: the first compared axis and the first other one
/// that varies.
fn default_axes(study: &Study, axes: &[String]) -> Option<[String; 2]> {
    let varying: Vec<&String> = axes
        .iter()
        .filter(|axis| study.values(axis).len() > 1)
        .collect();
    let compared = varying.iter().position(|axis| study.by.contains(axis));
    match (varying.as_slice(), compared) {
        ([_, _, ..], Some(across)) => Some([
            varying[across].clone(),
            varying[usize::from(across == 0)].clone(),
        ]),
        ([a, b, ..], None) => Some([(*b).clone(), (*a).clone()]),
        _ => None,
    }
}

/// Data of one map.
struct HeatMap<'a> {
    /// Index of the metric in the study.
    metric: usize,
    /// Horizontal and vertical axis.
    axes: &'a [String; 2],
    columns: Vec<String>,
    rows: Vec<String>,
    /// Mean drawn value of each row and column.
    cells: Vec<Vec<Option<f64>>>,
    /// Fewest and most runs of a cell that has any.
    runs: (usize, usize),
    /// Other axes with several values, over which cells are averaged.
    averaged: Vec<String>,
    scale: Scale,
    /// Smallest and largest value on the scale.
    low: f64,
    high: f64,
}

impl<'a> HeatMap<'a> {
    /// Averages the final values. Returns `None` if there are none.
    fn new(study: &Study, metric: usize, axes: &'a [String; 2]) -> Option<HeatMap<'a>> {
        let [across, down] = axes;
        let display = MetricDisplay::for_metric(&study.metrics[metric]);
        let (columns, rows) = (study.values(across), study.values(down));
        let mut counts = Vec::new();
        let mut mean = |column: &String, row: &String| -> Option<f64> {
            let runs = study.all().filter(|m| {
                m.run.is_done()
                    && m.run.axis_value(across).as_ref() == Some(column)
                    && m.run.axis_value(down).as_ref() == Some(row)
            });
            let finals: Vec<f64> = runs
                .filter_map(|m| display.drawn_value(m.value(m.run.rows.last()?, metric)?))
                .collect();
            counts.push(finals.len());
            Some(Spread::from_values(display.scale, &finals)?.mean)
        };
        let cells: Vec<Vec<Option<f64>>> = rows
            .iter()
            .map(|row| columns.iter().map(|column| mean(column, row)).collect())
            .collect();
        let values = cells.iter().flatten().flatten();
        let (low, high) = values
            .map(|v| display.scale.scaled(*v))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                (a.min(v), b.max(v))
            });
        let counts = counts.iter().copied().filter(|n| *n > 0);
        let runs = counts.fold((usize::MAX, 0), |(a, b), n| (a.min(n), b.max(n)));
        let varies = |axis: &String| !axes.contains(axis) && study.values(axis).len() > 1;
        let named = |values: &[String]| values.iter().map(|value| study.name(value)).collect();
        let (columns, rows) = (named(&columns), named(&rows));
        (low <= high).then_some(HeatMap {
            averaged: study.axes().into_iter().filter(varies).collect(),
            metric,
            axes,
            columns,
            rows,
            cells,
            runs,
            scale: display.scale,
            low,
            high,
        })
    }

    fn item(&self, study: &Study) -> ReportItem {
        let spec = &study.metrics[self.metric];
        let label = MetricDisplay::for_metric(spec).label(spec);
        let title = format!("{label} over {} and {}", self.axes[0], self.axes[1]);
        let provenance = Provenance::from_members(study.all().filter(|m| m.run.is_done()));
        let heading = format::with_unit(&label, &spec.unit());
        let svg = self.draw(&heading, &title, &provenance.text());
        let count = if self.runs.0 == self.runs.1 {
            self.runs.1.to_string()
        } else {
            format!("{} to {}", self.runs.0, self.runs.1)
        };
        let scale = if self.scale == Scale::Log {
            " The colour scale is logarithmic."
        } else {
            ""
        };
        let mut caption = format!(
            "{} at the end of each run. {} of {count} finished runs per cell, over {}.{scale}",
            format::metric_description(spec),
            mean_name(self.scale),
            self.averaged_over(),
        );
        for sentence in study.bias_sentences() {
            caption += &format!(" {sentence}");
        }
        ReportItem::figure(
            "Heat maps",
            format!("figures/heat-{}", spec.column),
            title,
            caption,
            svg,
            provenance,
        )
    }

    /// Names the axes over which cells are averaged, such as `depth and repeats`.
    fn averaged_over(&self) -> String {
        match self.averaged.as_slice() {
            [] => "repeats".to_owned(),
            axes => format!("{} and repeats", axes.join(", ")),
        }
    }

    fn draw(&self, heading: &str, title: &str, description: &str) -> String {
        let left = self
            .rows
            .iter()
            .map(|r| text_width(r, LABEL.size))
            .fold(30.0, f64::max)
            .min(140.0)
            + 8.0;
        let width = ((FULL - left - 52.0) / self.columns.len() as f64).clamp(18.0, CELL.0 * 1.5);
        let subtitle = format!(
            "columns: {}, rows: {}; means over {}",
            self.axes[0],
            self.axes[1],
            self.averaged_over()
        );
        let mut drawing = Drawing::default();
        drawing.text((left, 8.0), NAME, Anchor::Start, heading);
        drawing.text((left, 18.5), SMALL, Anchor::Start, &subtitle);
        for (i, column) in self.columns.iter().enumerate() {
            let x = left + (i as f64 + 0.5) * width;
            drawing.text(
                (x, TOP - 4.0),
                LABEL,
                Anchor::Middle,
                &shorten(column, LABEL.size, width - 1.0),
            );
        }
        for (j, row) in self.rows.iter().enumerate() {
            let y = TOP + j as f64 * CELL.1;
            drawing.text(
                (left - 5.0, y + CELL.1 / 2.0 + 2.6),
                LABEL,
                Anchor::End,
                &shorten(row, LABEL.size, left - 6.0),
            );
            for (i, value) in self.cells[j].iter().enumerate() {
                let x = left + i as f64 * width;
                self.draw_cell(&mut drawing, (x, y), width, *value);
            }
        }
        let x = left + self.columns.len() as f64 * width + 6.0;
        let height = self.rows.len() as f64 * CELL.1 - 0.7;
        self.draw_scale(&mut drawing, x, height);
        let head = text_width(heading, NAME.size).max(text_width(&subtitle, SMALL.size));
        let right = (x + 44.0).max(left + head + 4.0);
        drawing.finish_scaled(right, TOP + height + 3.0, SCREEN, title, description)
    }

    fn draw_cell(&self, drawing: &mut Drawing, (x, y): (f64, f64), width: f64, value: Option<f64>) {
        let Some(value) = value else {
            drawing.text(
                (x + width / 2.0, y + CELL.1 / 2.0 + 2.6),
                SMALL,
                Anchor::Middle,
                "–",
            );
            return;
        };
        let fraction = if self.high > self.low {
            (self.scale.scaled(value) - self.low) / (self.high - self.low)
        } else {
            0.5
        };
        let [r, g, b] = Colours::Magma.at(RANGE[0] + (RANGE[1] - RANGE[0]) * fraction as f32);
        drawing.fill(
            [x, y, width - 0.7, CELL.1 - 0.7],
            &format!("#{r:02x}{g:02x}{b:02x}"),
        );
        let is_light = luminance([r, g, b].map(f64::from)) > 120.0;
        let font = Font::new(
            if width < 32.0 { 6.0 } else { 7.4 },
            if is_light { "#000000" } else { "#ffffff" },
        );
        drawing.text(
            (x + width / 2.0 - 0.3, y + CELL.1 / 2.0 + 2.4),
            font,
            Anchor::Middle,
            &significant(value, 3),
        );
    }

    /// Draws the colour scale right of the cells, unless all values are equal.
    fn draw_scale(&self, drawing: &mut Drawing, x: f64, height: f64) {
        if self.high <= self.low {
            return;
        }
        colour_bar(drawing, [x, TOP, 5.0, height], RANGE);
        let label = |v: f64| significant(self.scale.unscaled(v), 2);
        drawing.text(
            (x + 8.0, TOP + 6.0),
            SMALL,
            Anchor::Start,
            &label(self.high),
        );
        drawing.text(
            (x + 8.0, TOP + height),
            SMALL,
            Anchor::Start,
            &label(self.low),
        );
        // The value in the middle shows whether the scale is logarithmic.
        drawing.text(
            (x + 8.0, TOP + height / 2.0 + 3.0),
            SMALL,
            Anchor::Start,
            &label((self.low + self.high) / 2.0),
        );
    }
}
