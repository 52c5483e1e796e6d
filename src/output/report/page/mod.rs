//! The report as one HTML file that needs nothing else: no network, no server, no library.
//!
//! Data, pictures as half floats, style, script and font are inside. Figures are the same drawings as the files beside
//! it. Every number of a table leads to the runs behind it, and every run to its folder and to the command that renders
//! it again.

mod views;

use std::collections::BTreeMap;

use serde_json::{Value as Json, json};

use super::Surroundings;
use super::grid::Grid;
use super::item::{Item, Kind, PROGRAM, Provenance};
use super::study::{Shown, Study};
use super::tables::TEST;
use crate::experiment::evidence::State;
use crate::metrics::map::Colours;
use crate::output::labels;
use crate::output::plot::axis::Scale;
use crate::output::plot::style::style;
use crate::output::plot::svg::{base64, escape};

const STYLE: &str = include_str!("page.css");
const SCRIPTS: [&str; 3] = [include_str!("curves.js"), include_str!("viewer.js"), include_str!("runs.js")];

/// The page, as the report's `index.html`.
pub fn item(study: &Study, items: &[Item], around: &Surroundings, notes: &mut Vec<String>) -> Item {
    let provenance = Provenance::of(study.all());
    let title = study.nights.iter().map(|n| n.name.as_str()).collect::<Vec<_>>();
    let title = match title.as_slice() {
        [] => "report".to_owned(),
        [first, rest @ ..] if rest.iter().all(|name| name == first) => (*first).to_owned(),
        all => all.join(", "),
    };
    let views = views::all(study, around.pictures, notes);
    let data = data(study, around, views).to_string().replace('<', "\\u003c");
    let html = document(study, items, &title, notes, &data, &provenance);
    Item {
        kind: Kind::Data,
        stem: "index".to_owned(),
        title,
        caption: "The whole report on one page.".to_owned(),
        svg: None,
        grid: None,
        extra: vec![("html", html.into_bytes())],
        provenance,
    }
}

fn data(study: &Study, around: &Surroundings, views: Vec<Json>) -> Json {
    let mut axes: Vec<String> = Vec::new();
    for axis in study.nights.iter().flat_map(|n| &n.axes) {
        if !axes.contains(axis) {
            axes.push(axis.clone());
        }
    }
    let metrics = study.metrics.iter().enumerate().map(|(index, metric)| {
        let shown = Shown::of(metric);
        json!({
            "index": index, "column": metric.column, "name": metric.row.name, "shown": shown.label(metric),
            "unit": metric.unit(), "log": shown.scale == Scale::Log, "complement": shown.complement(),
            "magnitude": shown.is_magnitude(),
        })
    });
    let series =
        study.series.iter().enumerate().map(
            |(i, s)| json!({ "full": s.full(), "long": s.long, "colour": style(i).colour, "dash": style(i).dash }),
        );
    let nights = study
        .nights
        .iter()
        .zip(&study.names)
        .map(|(night, name)| json!({ "name": name, "folder": (around.link)(&night.folder) }));
    let places = study.places();
    let runs = study.all().zip(places).map(|(m, (night, facet, series))| {
        let state = match &m.run.state {
            State::Done(_) => "done",
            State::Unfinished => "unfinished",
            State::Pending => "pending",
        };
        let number = |x: Option<f64>| x.filter(|x| x.is_finite()).map_or(Json::Null, |x| json!(x));
        let last = m.run.rows.last();
        let values = |row: &crate::experiment::WaveRow| -> Vec<Json> {
            (0..study.metrics.len()).map(|i| number(m.value(row, i))).collect()
        };
        let floor = |metric: &crate::metrics::MetricSpec| {
            number(m.run.floors.iter().find(|(column, _)| *column == metric.column).map(|(_, value)| *value))
        };
        let rows = m.run.rows.iter().map(|row| [vec![json!(row.samples), json!(row.render_s)], values(row)].concat());
        json!({
            "id": m.run.id, "night": night, "facet": facet, "series": series, "repeat": m.run.repeat, "state": state,
            "axes": axes.iter().map(|axis| m.run.value(axis).unwrap_or_default()).collect::<Vec<_>>(),
            "samples": last.map(|row| row.samples), "render_s": number(last.map(|row| row.render_s)),
            "rate": number(m.run.samples_per_s()),
            "last": last.map(values).unwrap_or_default(),
            "link": (around.link)(&m.run.folder), "command": (around.command)(&m.run.folder),
            "rows": rows.collect::<Vec<_>>(), "floors": study.metrics.iter().map(floor).collect::<Vec<_>>(),
        })
    });
    let magma = (0..=255u8).map(|i| Colours::Magma.at(f32::from(i) / 255.0)).collect::<Vec<_>>();
    let clock = if study.devices.len() == 1 { format!(" on {}", study.devices[0]) } else { String::new() };
    json!({
        "program": PROGRAM, "axes": axes, "metrics": metrics.collect::<Vec<_>>(),
        "series": series.collect::<Vec<_>>(), "nights": nights.collect::<Vec<_>>(),
        "facets": (0..study.facets.len()).map(|f| study.facet_label(f)).collect::<Vec<_>>(),
        "clock": clock, "magma": magma, "runs": runs.collect::<Vec<_>>(), "views": views,
    })
}

fn document(
    study: &Study,
    items: &[Item],
    title: &str,
    notes: &[String],
    data: &str,
    provenance: &Provenance,
) -> String {
    let index: BTreeMap<&str, usize> = study.all().enumerate().map(|(i, m)| (m.run.id.as_str(), i)).collect();
    let font = base64(epaint_default_fonts::UBUNTU_LIGHT);
    let mut out = String::new();
    out += "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
    out += "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
    // Whatever a name may hold, the page loads nothing and runs nothing but its own script.
    out += "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline'; \
            style-src 'unsafe-inline'; img-src data:; font-src data:\">\n";
    out += &format!("<meta name=\"generator\" content=\"{PROGRAM}\">\n");
    out += &format!("<meta name=\"lumbre.provenance\" content=\"{}\">\n", escape(&provenance.text()));
    out += &format!("<title>{} · Lumbre</title>\n", escape(title));
    out += &format!(
        "<style>\n@font-face {{ font-family: \"Lumbre\"; src: url(data:font/ttf;base64,{font}); }}\n{STYLE}</style>\n\
         </head>\n<body>\n<h1>{}</h1>\n",
        escape(title)
    );
    for (night, name) in study.nights.iter().zip(&study.names) {
        let done = night.runs.iter().filter(|r| r.done()).count();
        let named = if study.nights.len() > 1 { format!("<b>{}</b>: ", escape(name)) } else { String::new() };
        let (program, date) = night.machine.as_ref().map_or(("", ""), |m| (m.program.as_str(), m.date.as_str()));
        let facts = [
            format!("{done} of {} runs finished", night.runs.len()),
            night.devices().join(", "),
            format!("plan {}", night.plan.get(..8).unwrap_or(&night.plan)),
            program.to_owned(),
            date.to_owned(),
        ];
        let facts: Vec<String> = facts.iter().filter(|f| !f.is_empty()).map(|f| escape(f)).collect();
        out += &format!("<p class=\"meta\">{named}{}</p>\n", facts.join(" · "));
    }
    out += "<nav><a href=\"#curves\">Curves</a><a href=\"#viewer\">Pictures</a><a href=\"#tables\">Tables</a>\
            <a href=\"#figures\">Figures</a><a href=\"#run-table\">Runs</a><a href=\"#methods\">Methods</a></nav>\n";
    out += include_str!("parts.html");
    out += "<section id=\"tables\">\n<h2>Tables</h2>\n";
    if items.iter().filter_map(|item| item.grid.as_deref()).any(|grid| grid.caption.contains(TEST)) {
        out += &format!("<p class=\"note\">{} Every number leads to its runs.</p>\n", escape(TEST));
    }
    for grid in items.iter().filter_map(|item| item.grid.as_deref()) {
        out += &table(grid, &index);
    }
    out += "</section>\n<section id=\"figures\">\n<h2>Figures</h2>\n";
    for item in items.iter().filter(|item| item.kind == Kind::Figure) {
        out += &figure(item);
    }
    out += "</section>\n<section id=\"run-table\">\n<h2>Runs</h2>\n<div class=\"bar\"><input id=\"words\" size=\"34\" \
            placeholder=\"technique=bdpt repeat=0\" aria-label=\"show only runs that contain these words\">\
            <span id=\"count\"></span><button id=\"every\" hidden>show every run</button></div>\n\
            <div class=\"scroll\"><table id=\"runs\"></table></div>\n</section>\n";
    out += "<section id=\"methods\">\n<h2>Methods</h2>\n";
    if let Some(methods) = items.iter().find(|item| item.stem == "methods") {
        out += &format!("<p>{}</p>\n", escape(&methods.caption));
    }
    if !notes.is_empty() {
        let list: String = notes.iter().map(|note| format!("<li>{}</li>\n", escape(note))).collect();
        out += &format!("<h3>Left out</h3>\n<ul class=\"note\">\n{list}</ul>\n");
    }
    out += "</section>\n";
    out += &format!(
        "<script type=\"application/json\" id=\"data\">{data}</script>\n<script>\n{}</script>\n",
        SCRIPTS.join("\n")
    );
    out + "</body>\n</html>\n"
}

fn files(item: &Item) -> String {
    let drawn = item.svg.iter().flat_map(|_| ["svg", "png", "pdf"]);
    let all = drawn.chain(item.extra.iter().map(|(extension, _)| *extension));
    let link = |extension: &str| format!("<a href=\"{}.{extension}\">{extension}</a>", escape(&item.stem));
    all.map(link).collect::<Vec<_>>().join(" ")
}

fn figure(item: &Item) -> String {
    let svg = item.svg.as_deref().unwrap_or_default();
    // The page has one font for all drawings.
    let svg = svg.replacen("font-family=\"Ubuntu,", "font-family=\"Lumbre, Ubuntu,", 1);
    format!(
        "<figure id=\"{}\">\n<h3>{}</h3>\n{svg}<figcaption>{} {}</figcaption>\n</figure>\n",
        escape(&item.stem),
        escape(&item.title),
        escape(&item.caption),
        files(item)
    )
}

fn table(grid: &Grid, index: &BTreeMap<&str, usize>) -> String {
    let mut out = format!(
        "<h3 id=\"tables/{}\">{}</h3>\n<div class=\"scroll\"><table><thead>",
        escape(&grid.name),
        escape(&grid.title)
    );
    if grid.groups.iter().any(|(group, _)| !group.is_empty()) {
        out += "<tr>";
        out += &"<th></th>".repeat(grid.corner.len());
        for (group, span) in &grid.groups {
            out += &format!("<th class=\"g\" colspan=\"{span}\">{}</th>", escape(group));
        }
        out += "</tr>";
    }
    out += "<tr>";
    out += &grid.corner.iter().map(|h| format!("<th>{}</th>", escape(h))).collect::<String>();
    out += &grid.columns.iter().map(|h| format!("<th class=\"n\">{}</th>", escape(h))).collect::<String>();
    out += "</tr></thead><tbody>\n";
    for (labels, entries) in &grid.rows {
        out += "<tr>";
        out += &labels.iter().map(|l| format!("<td>{}</td>", escape(l))).collect::<String>();
        for entry in entries {
            let text = escape(&grid.entry(entry));
            let text = if entry.best { format!("<b>{text}</b>") } else { text };
            let of: Vec<String> =
                entry.of.iter().filter_map(|id| index.get(id.as_str())).map(usize::to_string).collect();
            let text = match of.is_empty() {
                true => text,
                false => format!("<a href=\"#run-table\" data-runs=\"{}\">{text}</a>", of.join(" ")),
            };
            out += &format!("<td class=\"n\">{text}</td>");
        }
        out += "</tr>\n";
    }
    let stem = format!("tables/{}", grid.name);
    let links = ["md", "csv", "tex"].map(|e| format!("<a href=\"{}.{e}\">{e}</a>", escape(&stem))).join(" ");
    let caption = grid.caption.replace(&format!(" {TEST}"), "");
    out + &format!("</tbody></table></div>\n<p class=\"note\">{} {links}</p>\n", escape(&caption))
}

/// Significant digits of numbers below pictures.
pub(super) fn brief(x: f64) -> String {
    labels::significant(x, 3)
}
