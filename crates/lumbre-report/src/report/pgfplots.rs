//! Exports convergence and sweep figures to LaTeX: a `.tex` file with the axes and a `.dat` file
//! with the points.

use crate::latex;
use crate::plot::axis::{Axis, Scale};
use crate::plot::draw::labelled_ticks;
use crate::plot::figure::{Figure, Line};
use crate::plot::sizes;
use crate::plot::style::Style;
use crate::plot::svg::TickLabel;
use crate::provenance::Provenance;

/// Width and height of a plot in points. Three plots with their gaps fill the width of a page.
const PLOT: [f64; 2] = [118.0, 92.0];
/// Horizontal and vertical gap between plots in points.
const GAPS: [f64; 2] = [40.0, 44.0];

/// Columns of the `.dat` file: names and values.
type DataColumns = Vec<(String, Vec<f64>)>;

/// A figure to export.
pub(super) struct PgfFigure<'a> {
    pub(super) figure: &'a Figure,
    pub(super) x_label: &'a str,
    /// Scales of the horizontal and the vertical axis.
    pub(super) scales: [Scale; 2],
}

impl PgfFigure<'_> {
    /// Returns extension and content of the two files. The columns of the `.dat` file are called
    /// `f<panel>s<series>` followed by `x`, `y`, `l` (lower end) or `u` (upper end).
    pub(super) fn files(
        &self,
        stem: &str,
        caption: &str,
        provenance: &Provenance,
    ) -> Vec<(&'static str, Vec<u8>)> {
        let name = stem.rsplit('/').next().unwrap_or(stem);
        let mut columns = DataColumns::new();
        let Figure { panels, series, .. } = self.figure;
        let y_label = panels.first().map_or("", |panel| &panel.y_label);
        let bodies: String = (0..panels.len())
            .map(|p| self.panel(p, name, &mut columns))
            .collect();
        let per_row = sizes::columns(panels.len());
        let colours: String = series
            .iter()
            .enumerate()
            .map(|(s, entry)| {
                format!(
                    "\\definecolor{{lumbre{s}}}{{HTML}}{{{}}}\n",
                    entry.style.colour.text()[1..].to_uppercase()
                )
            })
            .collect();
        let modes = ["xmode=log, ", "ymode=log, "];
        let logarithmic = |i: usize| {
            if self.scales[i] == Scale::Log {
                modes[i]
            } else {
                ""
            }
        };
        let (x_mode, y_mode) = (logarithmic(0), logarithmic(1));
        let tex = format!(
            "{}% Needs \\usepackage{{pgfplots}} and \
             \\usepgfplotslibrary{{groupplots,fillbetween}}. The width is {per_row}/3 of \
             that of a page.\n\
             {colours}\\begin{{tikzpicture}}\n\\begin{{groupplot}}[\
             group style={{group size={per_row} by {}, horizontal sep={}pt, vertical sep={}pt, \
             ylabels at=edge left}}, scale only axis, width={}pt, \
             height={}pt, {x_mode}{y_mode}ylabel={{{}}}, grid=major, \
             grid style={{black!10}}, minor tick num=0, legend style={{at={{(0,-0.34)}}, \
             anchor=north west, legend columns=-1, draw=none, fill=none, font=\\footnotesize}}, \
             label style={{font=\\footnotesize}}, tick label style={{font=\\scriptsize}}, \
             title style={{font=\\footnotesize, yshift=-3pt}}]\n{bodies}\\end{{groupplot}}\n\
             \\end{{tikzpicture}}\n% Caption: {caption}\n",
            provenance.comment("% "),
            panels.len().div_ceil(per_row),
            GAPS[0],
            GAPS[1],
            PLOT[0],
            PLOT[1],
            latex::escape(y_label),
        );
        vec![
            ("tex", tex.into_bytes()),
            ("dat", data(&columns, provenance).into_bytes()),
        ]
    }

    fn panel(&self, p: usize, name: &str, columns: &mut DataColumns) -> String {
        let Figure { panels, series, .. } = self.figure;
        let panel = &panels[p];
        let title = latex::escape(&panel.heading);
        let Some((x_axis, y_axis)) = &panel.axes else {
            return format!("\\nextgroupplot[group/empty plot, title={{{title}}}]\n");
        };
        let ([x0, x1], [y0, y1]) = (x_axis.range(), y_axis.range());
        let (x_ticks, y_ticks) = (
            ticks("x", x_axis, PLOT[0]),
            ticks("y", y_axis, f64::INFINITY),
        );
        let per_row = sizes::columns(panels.len());
        let x_label = if p + per_row >= panels.len() {
            format!(", xlabel={{{}}}", latex::escape(self.x_label))
        } else {
            String::new()
        };
        let mut body = format!(
            "\\nextgroupplot[title={{{title}}}{x_label}, xmin={x0:e}, xmax={x1:e}, ymin={y0:e}, \
             ymax={y1:e}, {x_ticks}, {y_ticks}]\n"
        );
        let is_inside = |floor: &f64| y_axis.position(*floor) > 0.0;
        if let Some(floor) = panel.floor.filter(is_inside) {
            body += &format!(
                "\\fill[black!12] (axis cs:{x0:e},{y0:e}) rectangle (axis cs:{x1:e},{floor:e});\n"
            );
        }
        for line in &panel.lines {
            let colour = format!("lumbre{}", line.series);
            if let Some(floor) = line.floor.filter(is_inside) {
                body += &format!(
                    "\\draw[{colour}, dotted] (axis cs:{x0:e},{floor:e}) -- (axis \
                     cs:{x1:e},{floor:e});\n"
                );
            }
            let style = self.figure.entry(line).style;
            body += &line_commands(p, (line, style), name, columns);
        }
        // All panels share one legend, below the first panel of the last row.
        if p == (panels.len() - 1) / per_row * per_row {
            for (s, entry) in series.iter().enumerate() {
                let dash = latex::dash(&entry.style);
                let title = latex::escape(&entry.label);
                body += &format!(
                    "\\addlegendimage{{lumbre{s}, thick{dash}}}\n\\addlegendentry{{{title}}}\n"
                );
            }
        }
        body
    }
}

/// Returns the commands that draw a line of panel `p`, and appends its points to `columns`.
fn line_commands(
    p: usize,
    (line, style): (&Line, Style),
    name: &str,
    columns: &mut DataColumns,
) -> String {
    let colour = format!("lumbre{}", line.series);
    let stops: String = line
        .stops
        .iter()
        .map(|(x, y)| format!("({x:e},{y:e}) "))
        .collect();
    let mut body = format!(
        "\\addplot[{colour}, only marks, mark size=1.1pt, forget plot] coordinates {{{stops}}};\n"
    );
    let Some(band) = &line.band else {
        return body;
    };
    let key = format!("f{p}s{}", line.series);
    let mut add = |suffix: &str, values: Vec<f64>| columns.push((format!("{key}{suffix}"), values));
    add("x", band.mean.iter().map(|(x, _)| *x).collect());
    add("y", band.mean.iter().map(|(_, y)| *y).collect());
    if !band.ends.is_empty() {
        add("l", band.ends.iter().map(|(l, _)| *l).collect());
        add("u", band.ends.iter().map(|(_, u)| *u).collect());
        for end in ["l", "u"] {
            body += &format!(
                "\\addplot[name path={key}{end}, draw=none, forget plot] table[x={key}x, \
                 y={key}{end}] {{{name}.dat}};\n"
            );
        }
        body += &format!(
            "\\addplot[{colour}, opacity=0.16, forget plot] fill between[of={key}l and {key}u];\n"
        );
    }
    let dash = latex::dash(&style);
    body += &format!(
        "\\addplot[{colour}, thick{dash}, forget plot] table[x={key}x, y={key}y] {{{name}.dat}};\n"
    );
    body
}

/// Returns the tick options of an axis of `length` points. Labels that would overlap are left out.
fn ticks(name: &str, axis: &Axis, length: f64) -> String {
    let values: Vec<String> = axis
        .ticks
        .iter()
        .map(|(value, _)| format!("{value:e}"))
        .collect();
    let rotated = length.is_finite() && axis.rotated_label_extent(length, 7.0) > 0.0;
    let rotation = if rotated {
        ", x tick label style={rotate=90, anchor=east}"
    } else {
        ""
    };
    let has_label: Vec<bool> = if length.is_finite() && !rotated {
        labelled_ticks(axis, &|value| length * axis.position(value))
    } else {
        vec![true; axis.ticks.len()]
    };
    let labels: Vec<String> = axis
        .ticks
        .iter()
        .zip(&has_label)
        .map(|((_, label), has_label)| tick_label(label, *has_label))
        .collect();
    format!(
        "{name}tick={{{}}}, {name}ticklabels={{{}}}, minor {name} tick num=0{rotation}",
        values.join(","),
        labels.join(",")
    )
}

fn tick_label(label: &TickLabel, is_shown: bool) -> String {
    match label {
        _ if !is_shown => "{}".to_owned(),
        TickLabel::Plain(text) => format!("{{{}}}", latex::escape(text)),
        TickLabel::Power {
            factor: None,
            exponent,
        } => format!("{{$10^{{{exponent}}}$}}"),
        TickLabel::Power {
            factor: Some(factor),
            exponent,
        } => format!(
            "{{${} \\times 10^{{{exponent}}}$}}",
            factor.replace('−', "-")
        ),
    }
}

/// Formats the `.dat` file. Shorter columns are padded with `nan`.
fn data(columns: &[(String, Vec<f64>)], provenance: &Provenance) -> String {
    let length = columns.iter().map(|(_, v)| v.len()).max().unwrap_or(0);
    let mut dat = provenance.comment("# ");
    dat += &(columns
        .iter()
        .map(|(name, _)| name.as_str())
        .collect::<Vec<_>>()
        .join(" ")
        + "\n");
    for row in 0..length {
        let value =
            |(_, v): &(String, Vec<f64>)| v.get(row).map_or("nan".to_owned(), |x| format!("{x:e}"));
        dat += &(columns.iter().map(value).collect::<Vec<_>>().join(" ") + "\n");
    }
    dat
}
