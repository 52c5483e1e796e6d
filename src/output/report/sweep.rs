//! What runs have in the end over an axis of the sweep: final errors, rates, and what was recorded of hierarchies.

use super::ReportError;
use super::convergence::{Line, MOST_PANELS, Panel, draw, provenance};
use super::curve::{Band, BandKind, Spread};
use super::item::{Item, Kind};
use super::pgfplots::Drawn;
use super::study::{Member, Options, Shown, Study};
use crate::experiment::spec::TableValue;
use crate::output::bound;
use crate::output::labels;
use crate::output::plot::axis::{Axis, Scale};
use crate::output::quantity;
use crate::render::OpenStats;

/// Fewest numbers on an axis that make a figure unasked.
const FEWEST: usize = 3;

/// What is drawn of each run.
enum Quantity {
    /// The final value of one of the study's metrics.
    Metric(usize),
    /// A value that needs no metric.
    Plain(TableValue),
}

/// An axis as it is drawn.
struct Over<'a> {
    name: &'a str,
    values: Vec<String>,
    /// The values as numbers, if all are; otherwise each stands at its number from zero.
    numbers: Option<Vec<f64>>,
    /// Axes that follow from it, and so tell nothing apart along it.
    bound: Vec<String>,
}

impl Over<'_> {
    fn at(&self, place: usize) -> f64 {
        self.numbers.as_ref().map_or(place as f64, |numbers| numbers[place])
    }

    fn scale(&self) -> Scale {
        self.numbers.as_ref().map_or(Scale::Linear, |numbers| Scale::fitting(numbers.iter().copied()))
    }

    fn axis(&self) -> Option<Axis> {
        let Some(numbers) = &self.numbers else { return Axis::named(&self.values) };
        let mut axis = Axis::new(self.scale(), numbers.iter().copied());
        if let Some(axis) = axis.as_mut().filter(|_| numbers.iter().all(|x| x.fract() == 0.0)) {
            axis.whole();
        }
        axis
    }
}

/// The figures over every axis that was asked for, or else over all with enough different numbers. Hierarchies are drawn
/// where they differ along the axis. Of an axis that was asked for and shows nothing, a note says why.
///
/// # Errors
/// When an axis was asked for that is not there.
pub fn all(study: &Study, options: &Options, notes: &mut Vec<String>) -> Result<Vec<Item>, ReportError> {
    let axes = study.axes();
    if let Some(missing) = options.sweep.iter().find(|axis| !axes.contains(axis)) {
        return Err(ReportError::NoAxis { axis: missing.clone(), known: axes.join(", ") });
    }
    let mut items = Vec::new();
    for name in &axes {
        let values = study.values(name);
        let numbers: Option<Vec<f64>> = values.iter().map(|v| v.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        let asked = options.sweep.contains(name);
        let unasked = options.sweep.is_empty() && numbers.is_some() && values.len() >= FEWEST;
        if asked && values.len() < 2 {
            notes.push(format!("nothing is drawn over `{name}`: it has a single value"));
        } else if asked || unasked {
            let bound = axes.iter().filter(|axis| *axis != name && study.values(axis).len() > 1);
            let bound = bound.filter(|axis| study.follows(axis, name)).cloned().collect();
            let made = over(study, options, &Over { name, values, numbers, bound }, notes);
            if asked && made.is_empty() {
                notes.push(format!("nothing is drawn over `{name}`: no two of its values have finished runs to join"));
            }
            items.extend(made);
        }
    }
    Ok(items)
}

/// The figures over one axis.
fn over(study: &Study, options: &Options, over: &Over, notes: &mut Vec<String>) -> Vec<Item> {
    // What was asked for tells lines and panels apart, unless each of its values had a single place.
    let mut without = |axes: &[String], asked: bool| -> Vec<String> {
        let mut kept: Vec<String> = axes.iter().filter(|axis| *axis != over.name).cloned().collect();
        kept.retain(|axis| {
            let bound = over.bound.contains(axis) && (!asked || study.follows(over.name, axis));
            if bound && asked {
                notes.push(format!("over `{}` nothing is told apart by `{axis}`, which changes with it", over.name));
            }
            !bound
        });
        kept
    };
    let mut by = without(&study.by, !options.by.is_empty());
    let mut facet = without(&study.facet_axes, options.facet.is_some());
    if by.is_empty() {
        by.extend(facet.pop());
    }
    let apart = study.regrouped(by, facet);
    let metrics = (0..study.metrics.len()).map(Quantity::Metric);
    let built = [TableValue::AccelBuildS, TableValue::AccelNodes, TableValue::AccelMib, TableValue::AccelCost];
    let built = if hierarchies_differ(&apart) { &built[..] } else { &[] };
    let plain = [TableValue::MpathsPerS].iter().chain(built).cloned().map(Quantity::Plain);
    metrics.chain(plain).flat_map(|quantity| figures(&apart, over, &quantity)).collect()
}

/// Whether a series has more than one hierarchy in some facet.
fn hierarchies_differ(study: &Study) -> bool {
    let one = |m: Member| m.run.accel.map(|(_, nodes)| (nodes, m.run.accel_size.map(|(bytes, _)| bytes)));
    let several = |(facet, series)| {
        let mut all = study.members(facet, series).into_iter().filter_map(one);
        let first = all.next();
        all.any(|other| Some(other) != first)
    };
    (0..study.facets.len()).any(|facet| (0..study.series.len()).any(|series| several((facet, series))))
}

/// The figures of one quantity: pages of panels, and of a clock's readings one for each device of a night.
fn figures(study: &Study, over: &Over, quantity: &Quantity) -> Vec<Item> {
    let timed = matches!(quantity, Quantity::Plain(value) if value.is_clock());
    let apart = timed && study.nights.len() == 1 && study.devices.len() > 1;
    let clocks: Vec<Option<usize>> = if apart { (0..study.devices.len()).map(Some).collect() } else { vec![None] };
    let mut items = Vec::new();
    for clock in clocks {
        let device = clock.map(|i| study.devices[i].as_str());
        let scale = scale(study, quantity);
        let one = |facet: usize| Some((facet, panel(study, over, quantity, (facet, scale), device)?));
        let panels: Vec<(usize, Panel)> = (0..study.facets.len()).filter_map(one).collect();
        let pages = panels.len().div_ceil(MOST_PANELS);
        let mut panels = panels.into_iter();
        for page in 0..pages {
            let (facets, shown): (Vec<usize>, Vec<Panel>) = panels.by_ref().take(MOST_PANELS).unzip();
            let mut suffix = clock.map_or_else(String::new, |i| format!("-device-{}", i + 1));
            if pages > 1 {
                suffix += &format!("-{}", page + 1);
            }
            items.push(item(study, over, quantity, (&facets, &shown), (scale, &suffix), device));
        }
    }
    items
}

fn item(
    study: &Study,
    over: &Over,
    quantity: &Quantity,
    (facets, panels): (&[usize], &[Panel]),
    (scale, suffix): (Scale, &str),
    device: Option<&str>,
) -> Item {
    let (column, label, what) = match quantity {
        Quantity::Metric(metric) => {
            let spec = &study.metrics[*metric];
            let label = labels::with_unit(&Shown::of(spec).label(spec), &spec.unit());
            let options = spec.describe_options();
            let options = if options.is_empty() { String::new() } else { format!(" with {options}") };
            (spec.column.clone(), label, format!("{}{options} when runs stopped", labels::metric_title(spec)))
        }
        Quantity::Plain(value) => {
            let (label, what) = quantity::words(value);
            (value.word(), label.to_owned(), what.to_owned())
        }
    };
    let title = format!("{label} over {}", over.name);
    let change = bound::change(&over.bound).map_or_else(String::new, |change| format!(", with which {change}"));
    let mut caption = format!("{what}, over {}{change}.", over.name);
    let bands = || panels.iter().flat_map(|p| &p.lines).filter_map(|line| line.band.as_ref());
    let mean = if scale == Scale::Log { "Geometric mean" } else { "Mean" };
    let repeated = study.all().any(|m| m.run.repeat > 0);
    match bands().map(|band| band.kind).max() {
        Some(BandKind::Confidence) => {
            caption += &format!(" {mean} of repeats; band: 95 % confidence interval of the mean by Student's t.");
        }
        Some(BandKind::Range) => caption += &format!(" {mean} of repeats; band: the range of the two."),
        _ if repeated => caption += &format!(" {mean} of repeats."),
        _ => caption += " One run each.",
    }
    if repeated && bands().any(|band| band.kind == BandKind::Single) {
        caption += " A line that has a single run at some place has no band.";
    }
    let clock = study.clock();
    match (quantity, device) {
        (Quantity::Plain(value), None) if value.is_clock() && !clock.is_empty() => {
            caption += &format!(" Measured {clock}.").replace("Measured times", "Times");
        }
        (_, Some(device)) => caption += &format!(" Shown are the runs on {device}."),
        _ => {}
    }
    let provenance = provenance(study, facets);
    let svg = draw(study, panels, &label, over.name, &title, &provenance.text());
    let stem = format!("figures/sweep-{}-{column}{suffix}", over.name);
    let drawn = Drawn { study, panels, y_label: &label, x_label: over.name, scales: [over.scale(), scale] };
    let extra = drawn.files(&stem, &caption, &provenance);
    Item { kind: Kind::Figure, stem, title, caption, svg: Some(svg), grid: None, extra, provenance }
}

/// What a finished run has, as it is drawn.
fn value(study: &Study, quantity: &Quantity, member: &Member) -> Option<f64> {
    let last = member.run.rows.last().filter(|_| member.run.done())?;
    match quantity {
        Quantity::Metric(metric) => Shown::of(&study.metrics[*metric]).value(member.value(last, *metric)?),
        Quantity::Plain(value) => {
            let (accel_build_s, accel_nodes) = member.run.accel.unwrap_or_default();
            let (accel_bytes, accel_cost) = member.run.accel_size.unwrap_or_default();
            let open = OpenStats { accel_build_s, accel_nodes, accel_bytes, accel_cost, ..OpenStats::default() };
            quantity::plain(value, last, &open).filter(|x| x.is_finite())
        }
    }
}

/// The vertical scale of all panels.
fn scale(study: &Study, quantity: &Quantity) -> Scale {
    match quantity {
        Quantity::Metric(metric) => Shown::of(&study.metrics[*metric]).scale,
        Quantity::Plain(_) => Scale::fitting(study.all().filter_map(|m| value(study, quantity, &m))),
    }
}

/// One facet, if it has two places or more on the axis.
fn panel(
    study: &Study,
    over: &Over,
    quantity: &Quantity,
    (facet, scale): (usize, Scale),
    device: Option<&str>,
) -> Option<Panel> {
    let mut lines = Vec::new();
    let mut places = 0;
    for series in 0..study.series.len() {
        if device.is_some() && study.series[series].device.as_deref() != device {
            continue;
        }
        let members = study.members(facet, series);
        let mut marks: Vec<(f64, Spread)> = Vec::new();
        let mut fewest = usize::MAX;
        for (place, text) in over.values.iter().enumerate() {
            let here = members.iter().filter(|m| m.run.value(over.name).as_ref() == Some(text));
            // Where one of the repeats has no such value, a mean of the others would be none of them all.
            let values: Option<Vec<f64>> = here.filter(|m| m.run.done()).map(|m| value(study, quantity, m)).collect();
            if let Some((count, spread)) = values.and_then(|v| Some((v.len(), Spread::of(scale, &v)?))) {
                fewest = fewest.min(count);
                marks.push((over.at(place), spread));
            }
        }
        places = places.max(marks.len());
        if marks.is_empty() {
            continue;
        }
        marks.sort_by(|a, b| a.0.total_cmp(&b.0));
        // No band where a place has a single run, whose mean would look certain.
        let kind = BandKind::of(fewest);
        let ends = if kind == BandKind::Single { Vec::new() } else { marks.iter().map(|(_, s)| s.ends).collect() };
        let mean = marks.iter().map(|(x, spread)| (*x, spread.mean)).collect();
        lines.push(Line::of(series, Band { mean, ends, kind }));
    }
    if places < 2 {
        return None;
    }
    let bands = || lines.iter().filter_map(|line| line.band.as_ref());
    let mean = || bands().flat_map(|band| &band.mean).map(|(_, y)| *y);
    // A band that reaches far below its line must not squeeze the others.
    let (low, high) = mean().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(y), b.max(y)));
    let near = |y: &f64| scale == Scale::Linear || (*y > low / 1.6 && *y < high * 1.6);
    let ends = bands().flat_map(|band| &band.ends).flat_map(|(a, b)| [*a, *b]).filter(near);
    let axes = over.axis().zip(Axis::new(scale, mean().chain(ends)));
    Some(Panel { heading: study.facet_label(facet), axes, lines, floor: None })
}
