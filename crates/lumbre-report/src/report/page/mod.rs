//! The report as a single self-contained HTML file: it needs no network, server or library.
//!
//! Data, pictures as half floats, style, scripts and font are embedded. Figures are the same
//! drawings as in the report's files. Every number of a table links to its runs. Every run links to
//! its folder and shows the command that renders it again.

mod sections;
mod views;

use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::{Value as Json, json};

use super::ReportContext;
use super::item::ReportItem;
use super::study::{Member, Study};
use super::verdict::Verdict;
use crate::metric_display::MetricDisplay;
use crate::plot::axis::Scale;
use crate::provenance::Provenance;
use lumbre_metrics::map::Colours;
use lumbre_night::experiment::WaveRow;
use lumbre_night::experiment::night::Night;
use lumbre_night::text::program;

use crate::OutputError;
use crate::plot::svg::{base64, without_controls};
use lumbre_night::paths::SCRIPT_COPY;
use lumbre_night::text::visible;
use views::View;

const STYLE: &str = include_str!("page.css");
const SCRIPTS: [&str; 3] = [
    include_str!("curves.js"),
    include_str!("viewer.js"),
    include_str!("runs.js"),
];

/// Only the embedded style, scripts, pictures and font are allowed, whatever names contain.
const SECURITY_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; \
                               style-src 'unsafe-inline'; img-src data:; font-src data:";

/// Ids and names of the sections to which the page links.
const SECTIONS: [(&str, &str); 8] = [
    ("answer", "Answer"),
    ("requested", "Requested"),
    ("viewer", "Pictures"),
    ("curves", "Curves"),
    ("tables", "Tables"),
    ("figures", "Figures"),
    ("run-table", "Runs"),
    ("methods", "Methods"),
];

/// Builds the page as the report's `index.html`.
///
/// # Errors
/// Returns an error if a thumbnail cannot be encoded.
pub fn item(
    study: &Study,
    items: &[ReportItem],
    verdict: &Verdict,
    context: &ReportContext,
    notes: &mut Vec<String>,
) -> Result<ReportItem, OutputError> {
    let provenance = Provenance::from_members(study.all());
    let names: Vec<&str> = study.nights.iter().map(|n| n.plan.name.as_str()).collect();
    let title = match names.as_slice() {
        [] => "report".to_owned(),
        [first, rest @ ..] if rest.iter().all(|name| name == first) => (*first).to_owned(),
        all => all.join(", "),
    };
    let views = views::all(study, context.pictures, notes)?;
    let problems = (context.problems)();
    notes.retain(|note| !problems.iter().any(|problem| note.ends_with(problem)));
    let data = data(study, context, &views).to_string();
    let data = visible(&data).replace('<', "\\u003c");
    let text = PageText {
        title: &title,
        problems: &problems,
        notes,
        data: &data,
        provenance: &provenance,
    };
    let html = document(study, items, verdict, &views, &text, context);
    let html = without_controls(&html.into_string());
    let caption = "Complete report on one page.".to_owned();
    let files = vec![("html", html.into_bytes())];
    Ok(ReportItem::data(
        "index", &title, caption, files, provenance,
    ))
}

/// Collects the data of the page's scripts.
fn data(study: &Study, context: &ReportContext, views: &[View]) -> Json {
    let axes = study.axes();
    let metrics: Vec<Json> = study
        .metrics
        .iter()
        .enumerate()
        .map(|(index, metric)| {
            let display = MetricDisplay::for_metric(metric);
            json!({
                "index": index, "column": metric.column, "name": metric.row.name,
                "shown": display.label(metric), "unit": metric.unit(),
                "log": display.scale == Scale::Log, "complement": display.complement(),
                "magnitude": display.is_magnitude(),
            })
        })
        .collect();
    let series: Vec<Json> = study
        .series
        .iter()
        .zip(study.entries())
        .map(|(s, entry)| {
            json!({
                "full": entry.label, "long": s.long, "colour": entry.style.colour.text(),
                "dash": entry.style.dash,
            })
        })
        .collect();
    let nights: Vec<Json> = study
        .nights
        .iter()
        .zip(&study.names)
        .map(|(night, name)| json!({ "name": name, "folder": (context.link)(&night.folder) }))
        .collect();
    let runs: Vec<Json> = study
        .all()
        .zip(study.run_positions())
        .map(|(member, position)| run_data(study, context, &axes, &member, position))
        .collect();
    let facets: Vec<String> = (0..study.facets.len())
        .map(|f| study.facet_label(f))
        .collect();
    let magma: Vec<[u8; 3]> = (0..=255u8)
        .map(|i| Colours::Magma.at(f32::from(i) / 255.0))
        .collect();
    let views: Vec<&Json> = views.iter().map(|view| &view.data).collect();
    let clock = if study.devices.len() == 1 {
        format!(" on {}", study.devices[0])
    } else {
        String::new()
    };
    json!({
        "program": program(), "axes": axes, "metrics": metrics, "series": series, "nights": nights,
        "command": context.again, "facets": facets, "clock": clock, "magma": magma, "runs": runs, "views": views,
        "live": context.live,
    })
}

/// Collects the data of one run. `position` holds the indices of night, facet and series.
fn run_data(
    study: &Study,
    context: &ReportContext,
    axes: &[String],
    member: &Member,
    position: (usize, usize, usize),
) -> Json {
    let run = member.run;
    let (night, facet, series) = position;
    let number = |x: Option<f64>| x.filter(|x| x.is_finite()).map_or(Json::Null, |x| json!(x));
    let values = |row: &WaveRow| -> Vec<Json> {
        (0..study.metrics.len())
            .map(|i| number(member.value(row, i)))
            .collect()
    };
    let floors: Vec<Json> = study
        .metrics
        .iter()
        .map(|metric| {
            let mut floors = run.floors.iter();
            let floor = floors.find(|(column, _)| *column == metric.column);
            number(floor.map(|(_, floor)| floor.value))
        })
        .collect();
    let rows: Vec<Vec<Json>> = run
        .rows
        .iter()
        .map(|row| [vec![json!(row.samples), json!(row.render_s)], values(row)].concat())
        .collect();
    let axis_values: Vec<String> = axes
        .iter()
        .map(|axis| run.axis_value(axis).unwrap_or_default())
        .collect();
    let last = run.rows.last();
    json!({
        "id": run.id, "night": night, "facet": facet, "series": series, "repeat": run.repeat,
        "state": run.state.name(), "axes": axis_values, "samples": last.map(|row| row.samples),
        "render_s": number(last.map(|row| row.render_s)), "rate": number(run.samples_per_s()),
        "last": last.map(values).unwrap_or_default(), "link": (context.link)(&run.folder),
        "command": (context.command)(&run.folder), "rows": rows, "floors": floors,
    })
}

/// Texts of the page beside the report's items.
struct PageText<'a> {
    title: &'a str,
    problems: &'a [String],
    notes: &'a [String],
    /// Data of the scripts as JSON.
    data: &'a str,
    provenance: &'a Provenance,
}

/// Writes the HTML document: the answer, what the script requests, then pictures, curves, tables and figures, then the runs
/// and the methods.
fn document(
    study: &Study,
    items: &[ReportItem],
    verdict: &Verdict,
    views: &[View],
    text: &PageText,
    context: &ReportContext,
) -> Markup {
    let several = study.nights.len() > 1;
    let methods = items.iter().find(|item| item.stem == "methods");
    html! {
        (DOCTYPE)
        html lang="en" {
            (head(text.title, text.provenance))
            body {
                h1 { (text.title) }
                @if !text.problems.is_empty() {
                    div.note #problems {
                        b { "Left out because it does not match its checksum:" }
                        (list(text.problems))
                    }
                }
                @for (night, name) in study.nights.iter().zip(&study.names) {
                    (night_facts(night, Some(name.as_str()).filter(|_| several), context))
                    @for note in &night.plan.report.notes { p.meta { (note) } }
                }
                (sections::answer(study, verdict, views, text.notes.len()))
                @let requested = sections::requested(study, items);
                nav {
                    @for (id, name) in SECTIONS {
                        @if id != "requested" || requested.is_some() {
                            a href={ "#" (id) } { (name) }
                        }
                    }
                }
                @if let Some(requested) = requested { (requested) }
                (PreEscaped(include_str!("parts.html")))
                (sections::tables(study, items))
                (sections::figures(study, items))
                section #run-table {
                    h2 { "Runs" }
                    div.bar {
                        input #words size="34" placeholder="technique=bdpt repeat=0"
                            aria-label="filter runs by words";
                        span #count {}
                        button #every hidden { "show all runs" }
                    }
                    div.scroll { table #runs {} }
                }
                section #methods {
                    h2 { "Methods" }
                    @if let Some(methods) = methods { p { (sections::prose(&methods.caption)) } }
                    @if !text.notes.is_empty() {
                        h3 #notes { "Notes" }
                        (list(text.notes))
                    }
                }
                script type="application/json" id="data" { (PreEscaped(text.data)) }
                script { (PreEscaped(SCRIPTS.join("\n"))) }
            }
        }
    }
}

/// Writes sentences as a list.
fn list(sentences: &[String]) -> Markup {
    html! { ul.note { @for sentence in sentences { li { (sections::prose(sentence)) } } } }
}

/// Writes the head of the document.
fn head(title: &str, provenance: &Provenance) -> Markup {
    let font = base64(epaint_default_fonts::UBUNTU_LIGHT);
    let style = format!(
        "@font-face {{ font-family: \"Lumbre\"; src: url(data:font/ttf;base64,{font}); }}\n{STYLE}"
    );
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta http-equiv="Content-Security-Policy" content=(SECURITY_POLICY);
            meta name="generator" content=(program());
            meta name="lumbre.provenance" content=(provenance.text());
            title { (title) " · Lumbre" }
            style { (PreEscaped(style)) }
        }
    }
}

/// Writes a line of facts on a night. `name` is given if there are several nights.
fn night_facts(night: &Night, name: Option<&str>, context: &ReportContext) -> Markup {
    let finished = night.runs.iter().filter(|r| r.is_done()).count();
    let machine = night.machine.as_ref();
    let (program, date) = machine.map_or(("", ""), |m| (m.program.as_str(), m.date.as_str()));
    let facts = [
        format!("{finished} of {} runs finished", night.runs.len()),
        night.devices().join(", "),
        format!(
            "plan {}",
            night.plan.hash.get(..8).unwrap_or(&night.plan.hash)
        ),
        program.to_owned(),
        date.to_owned(),
        night.given_settings(),
    ];
    html! {
        p.meta {
            @if let Some(name) = name { b { (name) } ": " }
            @for fact in facts.iter().filter(|fact| !fact.is_empty()) { (fact) " · " }
            a href=((context.link)(&night.folder.join(SCRIPT_COPY))) { "script" }
        }
    }
}
