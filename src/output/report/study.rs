//! Nights as a study: which runs are repeats of one another, which are compared, and which stand in separate panels.

use std::collections::BTreeMap;

use super::ReportError;
use crate::experiment::evidence::{Night, Run};
use crate::metrics::MetricSpec;
use crate::output::bound;
use crate::output::labels;
use crate::output::plot::axis::Scale;

/// What a reader may choose about a report; the default chooses for him.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Axes whose values are compared: the curves of a figure, the columns of a table. Empty is the axis that chooses
    /// the integrator, or else the last that varies.
    pub by: Vec<String>,
    /// Axes whose values stand apart: panels and rows. `None` is all others that vary.
    pub facet: Option<Vec<String>>,
    /// Names of the nights, in their order; missing ones are named by their device or folder.
    pub names: Vec<String>,
    /// Windows of crops: left, top, width, height in pixels. Empty lets the report choose.
    pub crops: Vec<[u32; 4]>,
    /// Thresholds of time-to-threshold tables by column. Columns without one get the largest final error of a panel.
    pub thresholds: Vec<(String, f64)>,
    /// The render time in seconds at which equal-time comparisons look; `None` is the longest that all runs of a panel
    /// reached.
    pub at_time: Option<f64>,
    /// The two axes of heat maps, across and down; `None` is the first that is compared and the first other that varies.
    pub heat: Option<[String; 2]>,
    /// Axes over whose values it is drawn what runs have in the end. Empty is all with three or more different numbers.
    pub sweep: Vec<String>,
}

/// One thing that is compared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Series {
    /// What tells it apart within its group: `bdpt`, `mis = power`.
    pub label: String,
    /// The group of series that share clock and device: the night's name or the device; empty if there is only one.
    pub group: String,
    /// The device, if known.
    pub device: Option<String>,
    /// The long name of the integrator, where the label is its short one.
    pub long: Option<&'static str>,
}

impl Series {
    /// Label and group.
    pub fn full(&self) -> String {
        if self.group.is_empty() { self.label.clone() } else { format!("{}, {}", self.label, self.group) }
    }
}

/// A run and the night it is of.
#[derive(Clone, Copy, Debug)]
pub struct Member<'a> {
    /// The night.
    pub night: &'a Night,
    /// The run.
    pub run: &'a Run,
    /// For each of [`Study::metrics`], its place in the night's rows.
    places: &'a [usize],
}

impl Member<'_> {
    /// The value of metric `metric` of the study in a row; `None` where the run was not measured.
    pub fn value(&self, row: &crate::experiment::WaveRow, metric: usize) -> Option<f64> {
        row.metrics.get(self.places[metric]).copied()
    }
}

/// Nights, sorted for comparison.
#[derive(Debug)]
pub struct Study<'a> {
    /// The nights.
    pub nights: &'a [Night],
    /// The metrics that all nights define alike.
    pub metrics: Vec<MetricSpec>,
    /// The axes that are compared.
    pub by: Vec<String>,
    /// The axes that stand apart.
    pub facet_axes: Vec<String>,
    /// What is compared, in the order of nights and plans.
    pub series: Vec<Series>,
    /// Values of the facet axes, in the order of the plans; one empty facet if there are no facet axes.
    pub facets: Vec<Vec<String>>,
    /// Every device, in order.
    pub devices: Vec<String>,
    /// Names of the nights.
    pub names: Vec<String>,
    /// What had to be left out.
    pub notes: Vec<String>,
    places: Vec<Vec<usize>>,
    members: BTreeMap<(usize, usize), Vec<(usize, usize)>>,
}

/// How a metric is drawn: errors on a logarithmic axis, a metric whose best value is 1 as 1 - value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// The axis.
    pub scale: Scale,
    complement: Option<f64>,
    magnitude: bool,
}

impl Shown {
    /// How this metric is drawn.
    pub fn of(metric: &MetricSpec) -> Shown {
        let (scale, complement) = match metric.row.perfect {
            best if best == f64::INFINITY => (Scale::Linear, None),
            0.0 => (Scale::Log, None),
            best => (Scale::Log, Some(best)),
        };
        Shown { scale, complement, magnitude: metric.row.better == crate::metrics::Better::NearZero }
    }

    /// The drawn value; `None` if it has no place on its axis.
    pub fn value(self, value: f64) -> Option<f64> {
        let value = if self.magnitude { value.abs() } else { value };
        let value = self.complement.map_or(value, |best| best - value);
        self.scale.holds(value).then_some(value)
    }

    /// The best value, where what is drawn is the distance from it.
    pub fn complement(self) -> Option<f64> {
        self.complement
    }

    /// Whether the sign is not drawn.
    pub fn is_magnitude(self) -> bool {
        self.magnitude
    }

    /// The metric's value from the drawn one; the sign of a magnitude is lost.
    pub fn back(self, drawn: f64) -> f64 {
        self.complement.map_or(drawn, |best| best - drawn)
    }

    /// `RMSE`, `1 − SSIM`, `|bias|`.
    pub fn label(self, metric: &MetricSpec) -> String {
        let own = metric.column != metric.row.name;
        let name = if own { format!("{} ({})", metric.row.label, metric.column) } else { metric.row.label.to_owned() };
        match self.complement {
            Some(best) => format!("{best} − {name}"),
            None if self.magnitude => format!("|{name}|"),
            None => name,
        }
    }
}

impl<'a> Study<'a> {
    /// Sorts nights for comparison.
    ///
    /// # Errors
    /// No night, an axis that no night has, or several nights of which one does not say on what device it rendered.
    pub fn new(nights: &'a [Night], options: &Options) -> Result<Study<'a>, ReportError> {
        let first = nights.first().ok_or(ReportError::Nothing)?;
        let mut axes: Vec<String> = Vec::new();
        for axis in nights.iter().flat_map(|night| &night.axes) {
            if !axes.contains(axis) {
                axes.push(axis.clone());
            }
        }
        let known = |axis: &String| match axes.contains(axis) {
            true => Ok(axis.clone()),
            false => Err(ReportError::NoAxis { axis: axis.clone(), known: axes.join(", ") }),
        };
        let varies = |axis: &&String| {
            let mut values = nights.iter().flat_map(|n| &n.runs).map(|run| run.value(axis));
            let first = values.next();
            values.any(|value| Some(value) != first)
        };
        let chooses_integrator = |axis: &&String| {
            let mut runs = nights.iter().flat_map(|n| &n.runs);
            runs.all(|run| run.value(axis).as_deref() == Some(run.integrator.as_str()))
        };
        let by: Vec<String> = if options.by.is_empty() {
            let integrator = axes.iter().find(chooses_integrator);
            integrator.or_else(|| axes.iter().rev().find(varies)).cloned().into_iter().collect()
        } else {
            options.by.iter().map(known).collect::<Result<_, _>>()?
        };
        let facet_axes: Vec<String> = match &options.facet {
            Some(facet) => facet.iter().map(known).collect::<Result<_, _>>()?,
            None => axes.iter().filter(|axis| !by.contains(axis)).filter(varies).cloned().collect(),
        };
        let devices = all_devices(nights, options)?;
        let names = names(nights, &devices, options);
        let mut study = Study {
            nights,
            metrics: Vec::new(),
            series: Vec::new(),
            facets: Vec::new(),
            devices,
            names,
            notes: nights.iter().flat_map(|night| night.notes.iter().cloned()).collect(),
            places: Vec::new(),
            members: BTreeMap::new(),
            by,
            facet_axes,
        };
        study.agree_on_metrics(first);
        let single = options.by.iter().filter(|axis| study.values(axis).len() < 2);
        let alone: Vec<String> =
            single.map(|axis| format!("`{axis}` has a single value, so there is nothing to compare by it")).collect();
        study.notes.extend(alone);
        study.sort();
        Ok(study)
    }

    /// The same nights with other axes compared and apart.
    pub fn regrouped(&self, by: Vec<String>, facet_axes: Vec<String>) -> Study<'a> {
        let mut study = Study {
            nights: self.nights,
            metrics: self.metrics.clone(),
            by,
            facet_axes,
            series: Vec::new(),
            facets: Vec::new(),
            devices: self.devices.clone(),
            names: self.names.clone(),
            notes: Vec::new(),
            places: self.places.clone(),
            members: BTreeMap::new(),
        };
        study.sort();
        study
    }

    /// Every axis of every night, in order.
    pub fn axes(&self) -> Vec<String> {
        let mut axes: Vec<String> = Vec::new();
        for axis in self.nights.iter().flat_map(|night| &night.axes) {
            if !axes.contains(axis) {
                axes.push(axis.clone());
            }
        }
        axes
    }

    /// The values of an axis in the order of the plans.
    pub fn values(&self, axis: &str) -> Vec<String> {
        let mut values: Vec<String> = Vec::new();
        for value in self.all().filter_map(|m| m.run.value(axis)) {
            if !values.contains(&value) {
                values.push(value);
            }
        }
        values
    }

    /// Whether the value of `axis` follows from that of `from` in all runs, as those of zipped axes do.
    pub fn follows(&self, axis: &str, from: &str) -> bool {
        bound::follows(self.all().map(|m| (m.run.value(from), m.run.value(axis))))
    }

    /// Keeps the metrics that every night defines as the first does.
    fn agree_on_metrics(&mut self, first: &Night) {
        for metric in &first.metrics {
            let agrees = |night: &Night| {
                night.column(&metric.column).is_some_and(|at| night.metrics[at].identity() == metric.identity())
            };
            if self.nights.iter().all(agrees) {
                self.metrics.push(metric.clone());
            } else {
                self.notes.push(format!("`{}` is left out: the nights do not define it alike", metric.column));
            }
        }
        let place = |night: &Night| self.metrics.iter().filter_map(|m| night.column(&m.column)).collect();
        self.places = self.nights.iter().map(place).collect();
    }

    fn sort(&mut self) {
        let chosen: Vec<bool> = self.by.iter().map(|axis| self.is_integrator_axis(axis)).collect();
        for (n, night) in self.nights.iter().enumerate() {
            let several_devices = night.devices().len() > 1;
            let mut others = night.runs.iter().skip(1);
            let mixed = others.any(|run| run.integrator != night.runs[0].integrator);
            for (r, run) in night.runs.iter().enumerate() {
                let part = |(axis, integrator): (&String, &bool)| {
                    let value = run.value(axis)?;
                    Some(if *integrator { value } else { format!("{axis} = {value}") })
                };
                let parts: Vec<String> = self.by.iter().zip(&chosen).filter_map(part).collect();
                let device = night.device(run);
                let mut group: Vec<String> = Vec::new();
                if self.nights.len() > 1 {
                    group.push(self.names[n].clone());
                }
                if several_devices {
                    group.extend(device.clone());
                }
                group.dedup();
                let long = if parts.len() == 1 { labels::integrator_long_name(&parts[0]) } else { None };
                let label = match parts.as_slice() {
                    [] if mixed => "all techniques".to_owned(),
                    [] => run.integrator.clone(),
                    parts => parts.join(", "),
                };
                let series = Series { label, group: group.join(", "), device, long };
                let facet: Vec<String> =
                    self.facet_axes.iter().map(|axis| run.value(axis).unwrap_or_else(|| "–".to_owned())).collect();
                // What has not finished does not know its device; it belongs to those that have its name.
                let same = |s: &Series| {
                    let devices = (s.device.as_ref(), series.device.as_ref());
                    s.label == series.label
                        && s.group == series.group
                        && (devices.0 == devices.1 || devices.0.is_none() || devices.1.is_none())
                };
                let s = self.series.iter().position(same).unwrap_or_else(|| {
                    self.series.push(series.clone());
                    self.series.len() - 1
                });
                if self.series[s].device.is_none() {
                    self.series[s].device.clone_from(&series.device);
                }
                let f = self.facets.iter().position(|known| *known == facet).unwrap_or_else(|| {
                    self.facets.push(facet.clone());
                    self.facets.len() - 1
                });
                self.members.entry((f, s)).or_default().push((n, r));
            }
        }
        // Series of one group stand side by side, as columns of one device.
        let mut order: Vec<usize> = (0..self.series.len()).collect();
        let groups = self.groups();
        order.sort_by_key(|s| groups.iter().position(|g| *g == self.series[*s].group));
        let place = |s: usize| order.iter().position(|o| *o == s).unwrap_or(s);
        self.members = std::mem::take(&mut self.members).into_iter().map(|((f, s), m)| ((f, place(s)), m)).collect();
        self.series = order.iter().map(|s| self.series[*s].clone()).collect();
    }

    /// Whether an axis chooses the integrator.
    fn is_integrator_axis(&self, axis: &str) -> bool {
        let mut runs = self.nights.iter().flat_map(|n| &n.runs);
        runs.all(|run| run.value(axis).as_deref() == Some(run.integrator.as_str()))
    }

    /// The groups of series, each once, in order.
    pub fn groups(&self) -> Vec<String> {
        let mut groups: Vec<String> = Vec::new();
        for series in &self.series {
            if !groups.contains(&series.group) {
                groups.push(series.group.clone());
            }
        }
        groups
    }

    /// The runs of a series in a facet, whatever their state, repeats in order.
    pub fn members(&'a self, facet: usize, series: usize) -> Vec<Member<'a>> {
        let list = self.members.get(&(facet, series)).map_or(&[][..], Vec::as_slice);
        list.iter()
            .map(|(n, r)| Member { night: &self.nights[*n], run: &self.nights[*n].runs[*r], places: &self.places[*n] })
            .collect()
    }

    /// Every run.
    pub fn all(&'a self) -> impl Iterator<Item = Member<'a>> {
        self.nights
            .iter()
            .zip(&self.places)
            .flat_map(|(night, places)| night.runs.iter().map(move |run| Member { night, run, places }))
    }

    /// Night, facet and series of every run, in the order of [`Study::all`].
    pub fn places(&self) -> Vec<(usize, usize, usize)> {
        let mut places: BTreeMap<(usize, usize), (usize, usize)> = BTreeMap::new();
        for ((facet, series), members) in &self.members {
            places.extend(members.iter().map(|member| (*member, (*facet, *series))));
        }
        places.into_iter().map(|((night, _), (facet, series))| (night, facet, series)).collect()
    }

    /// `scene = box, depth = 5`, empty for the only facet.
    pub fn facet_label(&self, facet: usize) -> String {
        let pairs = self.facet_axes.iter().zip(&self.facets[facet]);
        // A single axis of names needs no name itself; a number does.
        if let [value] = self.facets[facet].as_slice()
            && value.parse::<f64>().is_err()
            && value != "true"
            && value != "false"
        {
            return value.clone();
        }
        pairs.map(|(axis, value)| format!("{axis} = {value}")).collect::<Vec<_>>().join(", ")
    }

    /// What the clock's readings are of: `on D`, or of several devices each with its group's name. Empty if nothing
    /// finished.
    pub fn clock(&self) -> String {
        match self.devices.as_slice() {
            [] => String::new(),
            [one] => format!("on {one}"),
            _ => {
                let mut named: Vec<String> = Vec::new();
                for series in &self.series {
                    let Some(device) = &series.device else { continue };
                    let text = if series.group.contains(device.as_str()) || series.group.is_empty() {
                        device.clone()
                    } else {
                        format!("{}: {device}", series.group)
                    };
                    if !named.contains(&text) {
                        named.push(text);
                    }
                }
                format!("times are of {} devices: {}", self.devices.len(), named.join("; "))
            }
        }
    }
}

/// Every device of all nights. Times of several nights on one axis need the name of the device behind each.
fn all_devices(nights: &[Night], options: &Options) -> Result<Vec<String>, ReportError> {
    let mut devices: Vec<String> = Vec::new();
    for (n, night) in nights.iter().enumerate() {
        let own = night.devices();
        let finished = night.runs.iter().any(Run::done);
        let named = night.machine.is_some() || options.names.get(n).is_some();
        if nights.len() > 1 && finished && (own.is_empty() || !named) {
            return Err(ReportError::NoDevice { folder: night.folder.clone() });
        }
        for device in own {
            if !devices.contains(&device) {
                devices.push(device);
            }
        }
    }
    Ok(devices)
}

/// Names of the nights, all different: as given, or the device where it tells them apart, or the folder's name.
fn names(nights: &[Night], devices: &[String], options: &Options) -> Vec<String> {
    let by_device = |night: &Night| match night.devices().as_slice() {
        [one] if devices.len() == nights.len() => Some(one.clone()),
        _ => None,
    };
    let folder = |night: &Night| night.folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let mut names: Vec<String> = Vec::new();
    for (n, night) in nights.iter().enumerate() {
        let name = options.names.get(n).cloned().or_else(|| by_device(night)).unwrap_or_else(|| folder(night));
        let mut unique = name.clone();
        let mut number = 2;
        while names.contains(&unique) {
            unique = format!("{name} ({number})");
            number += 1;
        }
        names.push(unique);
    }
    names
}
