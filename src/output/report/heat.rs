//! Heat maps over two axes: the final value of a metric at every combination, averaged over everything else.

use super::ReportError;
use super::convergence::{FULL, SCREEN};
use super::crops::shorten;
use super::films::colour_bar;
use super::item::{Item, Kind, Provenance};
use super::study::{Options, Shown, Study};
use crate::metrics::map::Colours;
use crate::output::labels::{self, significant};
use crate::output::plot::axis::Scale;
use crate::output::plot::style::{FAINT, INK};
use crate::output::plot::svg::{Anchor, Drawing, Font, text_width};

const CELL: (f64, f64) = (46.0, 22.0);
/// The part of magma that cells use: its ends are so near black and white that cells would fade into text and paper.
const RANGE: [f32; 2] = [0.12, 0.92];
const LABEL: Font = Font::new(7.6, INK);
const NAME: Font = Font::strong(8.0);
const SMALL: Font = Font::new(7.0, FAINT);

/// One map for each metric, if there are two axes that vary or were asked for.
///
/// # Errors
/// When an axis was asked for that is not there.
pub fn all(study: &Study, options: &Options) -> Result<Vec<Item>, ReportError> {
    let axes = study.axes();
    let pair = match &options.heat {
        Some(pair) => {
            if let Some(missing) = pair.iter().find(|axis| !axes.contains(axis)) {
                return Err(ReportError::NoAxis { axis: missing.clone(), known: axes.join(", ") });
            }
            Some(pair.clone())
        }
        None => {
            let varying: Vec<&String> = axes.iter().filter(|axis| study.values(axis).len() > 1).collect();
            // What is compared across, what stands apart down.
            let compared = varying.iter().position(|axis| study.by.contains(axis));
            match (varying.as_slice(), compared) {
                ([_, _, ..], Some(across)) => {
                    Some([varying[across].clone(), varying[usize::from(across == 0)].clone()])
                }
                ([a, b, ..], None) => Some([(*b).clone(), (*a).clone()]),
                _ => None,
            }
        }
    };
    let Some(pair) = pair else { return Ok(Vec::new()) };
    Ok((0..study.metrics.len()).filter_map(|metric| map(study, metric, &pair)).collect())
}

fn map(study: &Study, metric: usize, [across, down]: &[String; 2]) -> Option<Item> {
    let spec = &study.metrics[metric];
    let shown = Shown::of(spec);
    let (columns, rows) = (study.values(across), study.values(down));
    let mut counts = Vec::new();
    let mut mean = |column: &String, row: &String| -> Option<f64> {
        let here = study.all().filter(|m| {
            m.run.done() && m.run.value(across).as_ref() == Some(column) && m.run.value(down).as_ref() == Some(row)
        });
        let finals: Vec<f64> = here.filter_map(|m| shown.value(m.value(m.run.rows.last()?, metric)?)).collect();
        counts.push(finals.len());
        let log = shown.scale == Scale::Log;
        let sum: f64 = finals.iter().map(|v| if log { v.ln() } else { *v }).sum();
        let mean = sum / finals.len() as f64;
        (!finals.is_empty()).then(|| if log { mean.exp() } else { mean })
    };
    let cells: Vec<Vec<Option<f64>>> =
        rows.iter().map(|row| columns.iter().map(|column| mean(column, row)).collect()).collect();
    let place = |v: f64| if shown.scale == Scale::Log { v.ln() } else { v };
    let all = || cells.iter().flatten().flatten().map(|v| place(*v));
    let (low, high) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if low > high {
        return None;
    }
    let title = format!("{} over {across} and {down}", shown.label(spec));
    let provenance = Provenance::of(study.all().filter(|m| m.run.done()));
    let left = rows.iter().map(|r| text_width(r, LABEL.size)).fold(30.0, f64::max).min(140.0) + 8.0;
    let width = ((FULL - left - 52.0) / columns.len() as f64).clamp(18.0, CELL.0 * 1.5);
    let top = 34.0;
    let mut drawing = Drawing::default();
    drawing.text((left, 8.0), NAME, Anchor::Start, &labels::with_unit(&shown.label(spec), &spec.unit()));
    drawing.text((left, 18.5), SMALL, Anchor::Start, &format!("across: {across}, down: {down}"));
    for (i, column) in columns.iter().enumerate() {
        let x = left + (i as f64 + 0.5) * width;
        drawing.text((x, top - 4.0), LABEL, Anchor::Middle, &shorten(column, LABEL.size, width - 1.0));
    }
    for (j, row) in rows.iter().enumerate() {
        let y = top + j as f64 * CELL.1;
        let label = shorten(row, LABEL.size, left - 6.0);
        drawing.text((left - 5.0, y + CELL.1 / 2.0 + 2.6), LABEL, Anchor::End, &label);
        for (i, value) in cells[j].iter().enumerate() {
            let x = left + i as f64 * width;
            let Some(value) = value else {
                drawing.text((x + width / 2.0, y + CELL.1 / 2.0 + 2.6), SMALL, Anchor::Middle, "–");
                continue;
            };
            let part = if high > low { (place(*value) - low) / (high - low) } else { 0.5 };
            let [r, g, b] = Colours::Magma.at(RANGE[0] + (RANGE[1] - RANGE[0]) * part as f32);
            drawing.fill([x, y, width - 0.7, CELL.1 - 0.7], &format!("#{r:02x}{g:02x}{b:02x}"));
            let bright = 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b) > 120.0;
            let font = Font::new(if width < 32.0 { 6.0 } else { 7.4 }, if bright { "#000000" } else { "#ffffff" });
            let text = significant(*value, 3);
            drawing.text((x + width / 2.0 - 0.3, y + CELL.1 / 2.0 + 2.4), font, Anchor::Middle, &text);
        }
    }
    let (x, height) = (left + columns.len() as f64 * width + 6.0, rows.len() as f64 * CELL.1 - 0.7);
    if high > low {
        colour_bar(&mut drawing, [x, top, 5.0, height], RANGE);
        let back = |v: f64| significant(if shown.scale == Scale::Log { v.exp() } else { v }, 2);
        drawing.text((x + 8.0, top + 6.0), SMALL, Anchor::Start, &back(high));
        drawing.text((x + 8.0, top + height), SMALL, Anchor::Start, &back(low));
    }
    let svg = drawing.finish_scaled(x + 44.0, top + height + 3.0, SCREEN, &title, &provenance.text());
    let kind = if shown.scale == Scale::Log { "Geometric mean" } else { "Mean" };
    let used = counts.iter().copied().filter(|n| *n > 0);
    let (least, most) = used.fold((usize::MAX, 0), |(a, b), n| (a.min(n), b.max(n)));
    let counted = if least == most { most.to_string() } else { format!("{least} to {most}") };
    let options = spec.describe_options();
    let options = if options.is_empty() { String::new() } else { format!(" with {options}") };
    let caption = format!(
        "{}{options} when runs stopped. {kind} of {counted} finished runs in each cell, over all other axes and repeats.",
        labels::metric_title(spec)
    );
    let stem = format!("figures/heat-{}", spec.column);
    Some(Item { kind: Kind::Figure, stem, title, caption, svg: Some(svg), grid: None, extra: Vec::new(), provenance })
}
