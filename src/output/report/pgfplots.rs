//! Figures of curves for LaTeX: a `.tex` with the axes and a `.dat` with the points.

use super::convergence::{MOST_COLUMNS, Panel, labelled};
use super::item::Provenance;
use super::latex;
use super::study::Study;
use crate::output::plot::axis::{Axis, Label, Scale};
use crate::output::plot::style::style;

/// Width and height of the axes of one panel, and the room to the right and below, in points: three panels fill both
/// columns of a page.
const PLOT: [f64; 2] = [118.0, 92.0];
const GAPS: [f64; 2] = [40.0, 44.0];

/// A figure's parts.
pub(super) struct Drawn<'a> {
    pub(super) study: &'a Study<'a>,
    pub(super) panels: &'a [Panel],
    pub(super) y_label: &'a str,
    pub(super) x_label: &'a str,
    /// Those of the horizontal and the vertical axes.
    pub(super) scales: [Scale; 2],
}

impl Drawn<'_> {
    /// The two files. The columns of the `.dat` are `f<panel>s<series>` + `x`, `y`, `l` (lower) and `u` (upper end).
    pub(super) fn files(&self, stem: &str, caption: &str, provenance: &Provenance) -> Vec<(&'static str, Vec<u8>)> {
        let name = stem.rsplit('/').next().unwrap_or(stem);
        let mut columns: Vec<(String, Vec<f64>)> = Vec::new();
        let bodies: String = (0..self.panels.len()).map(|p| self.panel(p, name, &mut columns)).collect();
        let per_row = self.panels.len().min(MOST_COLUMNS);
        let colours: String = (0..self.study.series.len())
            .map(|s| format!("\\definecolor{{lumbre{s}}}{{HTML}}{{{}}}\n", style(s).colour[1..].to_uppercase()))
            .collect();
        let modes = ["xmode=log, ", "ymode=log, "];
        let logarithmic = |i: usize| if self.scales[i] == Scale::Log { modes[i] } else { "" };
        let (x_mode, y_mode, x_label) = (logarithmic(0), logarithmic(1), latex::escape(self.x_label));
        let tex = format!(
            "{}% Needs \\usepackage{{pgfplots}} and \\usepgfplotslibrary{{groupplots,fillbetween}}; as wide as \
             {per_row} of three columns of a page.\n{colours}\\begin{{tikzpicture}}\n\\begin{{groupplot}}[group \
             style={{group size={per_row} by {}, horizontal sep={}pt, vertical sep={}pt, xlabels at=edge bottom, \
             ylabels at=edge left}}, scale only axis, width={}pt, height={}pt, {x_mode}{y_mode}xlabel={{{x_label}}}, \
             ylabel={{{}}}, grid=major, grid style={{black!10}}, minor tick num=0, legend style={{at={{(0,-0.34)}}, \
             anchor=north west, legend columns=-1, draw=none, fill=none, font=\\footnotesize}}, label \
             style={{font=\\footnotesize}}, tick label style={{font=\\scriptsize}}, title \
             style={{font=\\footnotesize, yshift=-3pt}}]\n{bodies}\\end{{groupplot}}\n\\end{{tikzpicture}}\n% \
             Caption: {caption}\n",
            provenance.comment("% "),
            self.panels.len().div_ceil(per_row),
            GAPS[0],
            GAPS[1],
            PLOT[0],
            PLOT[1],
            latex::escape(self.y_label),
        );
        vec![("tex", tex.into_bytes()), ("dat", data(&columns, provenance).into_bytes())]
    }

    fn panel(&self, p: usize, name: &str, columns: &mut Vec<(String, Vec<f64>)>) -> String {
        let panel = &self.panels[p];
        let title = latex::escape(&panel.heading);
        let Some((x_axis, y_axis)) = &panel.axes else {
            return format!("\\nextgroupplot[group/empty plot, title={{{title}}}]\n");
        };
        let ([x0, x1], [y0, y1]) = (x_axis.ends(), y_axis.ends());
        let (x_ticks, y_ticks) = (ticks("x", x_axis, PLOT[0]), ticks("y", y_axis, f64::INFINITY));
        let mut body = format!(
            "\\nextgroupplot[title={{{title}}}, xmin={x0:e}, xmax={x1:e}, ymin={y0:e}, ymax={y1:e}, {x_ticks}, {y_ticks}]\n"
        );
        if let Some(floor) = panel.floor.filter(|f| y_axis.place(*f) > 0.0) {
            body += &format!("\\fill[black!12] (axis cs:{x0:e},{y0:e}) rectangle (axis cs:{x1:e},{floor:e});\n");
        }
        for line in &panel.lines {
            let look = format!("lumbre{}", line.series);
            if let Some(floor) = line.floor.filter(|f| y_axis.place(*f) > 0.0) {
                body += &format!("\\draw[{look}, dotted] (axis cs:{x0:e},{floor:e}) -- (axis cs:{x1:e},{floor:e});\n");
            }
            let stops: String = line.stops.iter().map(|(x, y)| format!("({x:e},{y:e}) ")).collect();
            body += &format!("\\addplot[{look}, only marks, mark size=1.1pt, forget plot] coordinates {{{stops}}};\n");
            let Some(band) = &line.band else { continue };
            let key = format!("f{p}s{}", line.series);
            columns.push((format!("{key}x"), band.mean.iter().map(|(x, _)| *x).collect()));
            columns.push((format!("{key}y"), band.mean.iter().map(|(_, y)| *y).collect()));
            if !band.ends.is_empty() {
                columns.push((format!("{key}l"), band.ends.iter().map(|(l, _)| *l).collect()));
                columns.push((format!("{key}u"), band.ends.iter().map(|(_, u)| *u).collect()));
                for end in ["l", "u"] {
                    body += &format!(
                        "\\addplot[name path={key}{end}, draw=none, forget plot] table[x={key}x, y={key}{end}] {{{name}.dat}};\n"
                    );
                }
                body += &format!("\\addplot[{look}, opacity=0.16, forget plot] fill between[of={key}l and {key}u];\n");
            }
            let dash = latex::dash(&line.style);
            body += &format!("\\addplot[{look}, thick{dash}, forget plot] table[x={key}x, y={key}y] {{{name}.dat}};\n");
        }
        // One legend for all panels, below the first one of the last row.
        if p == (self.panels.len() - 1) / MOST_COLUMNS * MOST_COLUMNS {
            for (s, series) in self.study.series.iter().enumerate() {
                let dash = latex::dash(&style(s));
                let title = latex::escape(&series.full());
                body += &format!("\\addlegendimage{{lumbre{s}, thick{dash}}}\n\\addlegendentry{{{title}}}\n");
            }
        }
        body
    }
}

/// The ticks of an axis that is so many points long, with the labels that have room.
fn ticks(axis: &str, on: &Axis, length: f64) -> String {
    let at: Vec<String> = on.ticks.iter().map(|(value, _)| format!("{value:e}")).collect();
    let upright = length.is_finite() && on.upright(length, 7.0) > 0.0;
    let turned = if upright { ", x tick label style={rotate=90, anchor=east}" } else { "" };
    let named: Vec<bool> = match length.is_finite() && !upright {
        true => labelled(on, &|value| length * on.place(value)),
        false => vec![true; on.ticks.len()],
    };
    let text = |((_, label), named): (&(f64, Label), &bool)| match label {
        _ if !named => "{}".to_owned(),
        Label::Plain(text) => format!("{{{}}}", latex::escape(text)),
        Label::Power { factor: None, exponent } => format!("{{$10^{{{exponent}}}$}}"),
        Label::Power { factor: Some(factor), exponent } => {
            format!("{{${} \\times 10^{{{exponent}}}$}}", factor.replace('−', "-"))
        }
    };
    let labels: Vec<String> = on.ticks.iter().zip(&named).map(text).collect();
    format!(
        "{axis}tick={{{}}}, {axis}ticklabels={{{}}}, minor {axis} tick num=0{turned}",
        at.join(","),
        labels.join(",")
    )
}

fn data(columns: &[(String, Vec<f64>)], provenance: &Provenance) -> String {
    let length = columns.iter().map(|(_, v)| v.len()).max().unwrap_or(0);
    let mut dat = provenance.comment("# ");
    dat += &(columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(" ") + "\n");
    for row in 0..length {
        let value = |(_, v): &(String, Vec<f64>)| v.get(row).map_or("nan".to_owned(), |x| format!("{x:e}"));
        dat += &(columns.iter().map(value).collect::<Vec<_>>().join(" ") + "\n");
    }
    dat
}
