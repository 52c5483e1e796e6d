//! Groups the runs of nights into a study: repeats, compared series, and facets in separate panels.

use std::collections::{BTreeMap, BTreeSet};

use super::ReportError;
use super::series::Series;
use crate::dependent_axes;
use crate::format;
use crate::plot::style::Style;
use crate::quantity::{self, RunValue};
use lumbre_light::transport::integrator::canonical_name;
use lumbre_metrics::{Better, MetricSpec};
use lumbre_night::experiment::WaveRow;
use lumbre_night::experiment::night::Night;
use lumbre_night::experiment::night::run::Run;
use lumbre_night::experiment::spec::TableValue;

/// Options of a report. All have defaults that suit most nights.
#[derive(Clone, Debug, Default)]
pub struct ReportOptions {
    /// Axes whose values are compared, as curves of a figure and columns of a table. If empty, the
    /// axis that selects the integrator, or else the last axis that varies.
    pub by: Vec<String>,
    /// Facet axes, whose values are shown in separate panels and rows. `None` is all other axes
    /// that vary.
    pub facet: Option<Vec<String>>,
    /// Names of the nights in order. Nights without a name are named after their device or folder.
    pub names: Vec<String>,
    /// Windows of crops as left, top, width, height in pixels. If empty, they are selected
    /// automatically.
    pub crops: Vec<[u32; 4]>,
    /// Metric columns and thresholds of time-to-threshold tables.
    pub thresholds: Vec<(String, f64)>,
    /// Render time in seconds of equal-time comparisons. `None` is the longest time that all runs
    /// of a facet reached.
    pub at_time: Option<f64>,
    /// Horizontal and vertical axis of heat maps. `None` is the first compared axis and the first
    /// other axis that varies.
    pub heat: Option<[String; 2]>,
    /// Axes over which final values are drawn. If empty, all axes with at least three different
    /// numbers.
    pub sweep: Vec<String>,
}

/// A run and its night.
#[derive(Clone, Copy, Debug)]
pub struct Member<'a> {
    /// Night of the run.
    pub night: &'a Night,
    /// Run of the study.
    pub run: &'a Run,
    /// Index of each of [`Study::metrics`] in the night's rows.
    metric_indices: &'a [usize],
}

impl Member<'_> {
    /// Returns the value of metric `metric` of the study in a row, or `None` if it was not
    /// measured.
    pub fn value(&self, row: &WaveRow, metric: usize) -> Option<f64> {
        row.metrics.get(self.metric_indices[metric]).copied()
    }
}

/// Nights with their runs grouped for comparison.
#[derive(Debug)]
pub struct Study<'a> {
    /// Nights of the study.
    pub nights: &'a [Night],
    /// Metrics that all nights define identically.
    pub metrics: Vec<MetricSpec>,
    /// Axes whose values are compared.
    pub by: Vec<String>,
    /// Axes whose values form the facets.
    pub facet_axes: Vec<String>,
    /// Compared series, in the order of nights and plans.
    pub series: Vec<Series>,
    /// Values of the facet axes, in plan order. Without facet axes there is a single empty facet.
    pub facets: Vec<Vec<String>>,
    /// Distinct devices in order.
    pub devices: Vec<String>,
    /// Names of the nights, all different.
    pub names: Vec<String>,
    /// Notes on what was left out.
    pub notes: Vec<String>,
    /// For each night, the indices of the metrics in its rows.
    metric_indices: Vec<Vec<usize>>,
    /// Indices of night and run of the members of each facet and series.
    members: BTreeMap<(usize, usize), Vec<(usize, usize)>>,
}

impl<'a> Study<'a> {
    /// Groups the runs of some nights for comparison.
    ///
    /// # Errors
    /// Returns an error if there are no nights, an option names an unknown axis, or there are
    /// several nights and the device of one is unknown.
    pub fn new(nights: &'a [Night], options: &ReportOptions) -> Result<Study<'a>, ReportError> {
        let first = nights.first().ok_or(ReportError::Nothing)?;
        let (by, facet_axes) = chosen_axes(nights, options)?;
        let mut study = Study::ungrouped(nights, by, facet_axes);
        study.devices = all_devices(nights, options)?;
        study.names = names(nights, &study.devices, options);
        study.notes = nights.iter().flat_map(|n| n.notes.clone()).collect();
        study.keep_common_metrics(first);
        let single = options
            .by
            .iter()
            .filter(|axis| study.values(axis).len() < 2);
        let notes: Vec<String> = single
            .map(|axis| format!("nothing is compared by `{axis}`: it has a single value"))
            .collect();
        study.notes.extend(notes);
        study.group_runs(true);
        Ok(study)
    }

    /// Groups the runs of one night by some axes, and not by device.
    pub fn of_night(night: &'a Night, by: &[String], facet_axes: &[String]) -> Study<'a> {
        let nights = std::slice::from_ref(night);
        let mut study = Study::ungrouped(nights, by.to_vec(), facet_axes.to_vec());
        study.keep_common_metrics(night);
        study.group_runs(false);
        study
    }

    /// Groups the runs of the same nights by other axes.
    pub fn regrouped(&self, by: Vec<String>, facet_axes: Vec<String>) -> Study<'a> {
        let mut study = Study {
            metrics: self.metrics.clone(),
            devices: self.devices.clone(),
            names: self.names.clone(),
            metric_indices: self.metric_indices.clone(),
            ..Study::ungrouped(self.nights, by, facet_axes)
        };
        study.group_runs(true);
        study
    }

    /// Creates a study without groups and metrics.
    fn ungrouped(nights: &'a [Night], by: Vec<String>, facet_axes: Vec<String>) -> Study<'a> {
        Study {
            nights,
            by,
            facet_axes,
            metrics: Vec::new(),
            series: Vec::new(),
            facets: Vec::new(),
            devices: Vec::new(),
            names: Vec::new(),
            notes: Vec::new(),
            metric_indices: Vec::new(),
            members: BTreeMap::new(),
        }
    }

    /// Returns the distinct axes of all nights, in order.
    pub fn axes(&self) -> Vec<String> {
        all_axes(self.nights)
    }

    /// Returns the distinct values of an axis, in plan order.
    pub fn values(&self, axis: &str) -> Vec<String> {
        distinct(self.all().filter_map(|m| m.run.axis_value(axis)))
    }

    /// Returns whether the value of `from` determines that of `axis` in all runs, as for zipped
    /// axes.
    pub fn is_determined_by(&self, axis: &str, from: &str) -> bool {
        dependent_axes::is_determined(
            self.all()
                .map(|m| (m.run.axis_value(from), m.run.axis_value(axis))),
        )
    }

    /// Keeps the metrics that every night defines as the first one does.
    fn keep_common_metrics(&mut self, first: &Night) {
        for metric in &first.plan.metrics {
            let is_same = |night: &Night| {
                night
                    .metric_index(&metric.column)
                    .is_some_and(|index| night.plan.metrics[index].identity() == metric.identity())
            };
            if self.nights.iter().all(is_same) {
                self.metrics.push(metric.clone());
            } else {
                self.notes.push(format!(
                    "metric `{}` is left out: the nights define it differently",
                    metric.column
                ));
            }
        }
        let indices = |night: &Night| {
            self.metrics
                .iter()
                .filter_map(|m| night.metric_index(&m.column))
                .collect()
        };
        self.metric_indices = self.nights.iter().map(indices).collect();
    }

    /// Assigns every run to a facet and a series. `by_device` is whether runs on different devices
    /// belong to different series.
    fn group_runs(&mut self, by_device: bool) {
        let mut same_group: BTreeMap<[Vec<String>; 2], Vec<usize>> = BTreeMap::new();
        let mut facets: BTreeMap<Vec<String>, usize> = BTreeMap::new();
        let integrator_axes: Vec<bool> = self
            .by
            .iter()
            .map(|axis| is_integrator_axis(self.nights, axis))
            .collect();
        for (n, night) in self.nights.iter().enumerate() {
            let several_devices = by_device && night.devices().len() > 1;
            let mut others = night.runs.iter().skip(1);
            let mixed = others.any(|run| run.integrator != night.runs[0].integrator);
            for (r, run) in night.runs.iter().enumerate() {
                let device = run.device.clone().filter(|_| by_device);
                let mut group: Vec<String> = Vec::new();
                if self.nights.len() > 1 {
                    group.push(self.names[n].clone());
                }
                if several_devices {
                    group.extend(device.clone());
                }
                group.dedup();
                let names_device = device.as_ref().is_some_and(|device| group.contains(device));
                let ([label, short_label], long) =
                    self.series_label(night, run, &integrator_axes, mixed);
                let values = run.axis_values(&self.by);
                let group = group.join(", ");
                let key = [values.clone(), vec![label.clone(), group.clone()]];
                let series = self.find_or_add_series(
                    Series {
                        label,
                        short_label,
                        values,
                        style: Style::default(),
                        group,
                        device,
                        names_device,
                        long,
                    },
                    same_group.entry(key).or_default(),
                );
                let facet = run.axis_values(&self.facet_axes);
                let facet = *facets.entry(facet).or_insert_with_key(|facet| {
                    self.facets.push(facet.clone());
                    self.facets.len() - 1
                });
                self.members
                    .entry((facet, series))
                    .or_default()
                    .push((n, r));
            }
        }
        self.sort_series();
        self.mark_biased_series();
        self.set_styles();
    }

    /// Returns the label of a run's series with and without names of axes, and the long name if the
    /// label is an integrator. `mixed` is whether the night has several integrators.
    fn series_label(
        &self,
        night: &Night,
        run: &Run,
        integrator_axes: &[bool],
        mixed: bool,
    ) -> ([String; 2], Option<&'static str>) {
        let part = |(axis, is_integrator): (&String, &bool)| {
            let value = night.plan.report.name(&run.axis_value(axis)?);
            let named = if *is_integrator {
                value.clone()
            } else {
                format!("{axis} = {value}")
            };
            Some((named, value))
        };
        let (parts, values): (Vec<String>, Vec<String>) =
            self.by.iter().zip(integrator_axes).filter_map(part).unzip();
        let long = if parts.len() == 1 && integrator_axes.contains(&true) {
            format::integrator_long_name(&run.integrator)
        } else {
            None
        };
        let labels = match parts.as_slice() {
            [] if mixed => ["all techniques"; 2].map(str::to_owned),
            [] => [(); 2].map(|()| night.plan.report.name(&run.integrator)),
            parts => [parts.join(", "), values.join(", ")],
        };
        (labels, long)
    }

    /// Returns the index of a series, given those of the same values, label and group. Runs that
    /// have not finished have no known device; they join any of them.
    fn find_or_add_series(&mut self, series: Series, same_group: &mut Vec<usize>) -> usize {
        let is_same = |s: &&usize| {
            let devices = (self.series[**s].device.as_ref(), series.device.as_ref());
            devices.0 == devices.1 || devices.0.is_none() || devices.1.is_none()
        };
        let Some(index) = same_group.iter().find(is_same).copied() else {
            self.series.push(series);
            same_group.push(self.series.len() - 1);
            return self.series.len() - 1;
        };
        if self.series[index].device.is_none() {
            self.series[index].device = series.device;
            self.series[index].names_device = series.names_device;
        }
        index
    }

    /// Orders the series so that those of one group are adjacent, as columns of one device.
    fn sort_series(&mut self) {
        let mut order: Vec<usize> = (0..self.series.len()).collect();
        let groups = self.groups();
        order.sort_by_key(|s| groups.iter().position(|g| *g == self.series[*s].group));
        let new_index = |s: usize| order.iter().position(|o| *o == s).unwrap_or(s);
        self.members = std::mem::take(&mut self.members)
            .into_iter()
            .map(|((f, s), m)| ((f, new_index(s)), m))
            .collect();
        self.series = order.iter().map(|s| self.series[*s].clone()).collect();
    }

    /// Returns the distinct groups of series, in order.
    pub fn groups(&self) -> Vec<String> {
        let mut groups: Vec<String> = Vec::new();
        for series in &self.series {
            if !groups.contains(&series.group) {
                groups.push(series.group.clone());
            }
        }
        groups
    }

    /// Returns the runs of a series in a facet, finished or not, with repeats in order.
    pub fn members(&'a self, facet: usize, series: usize) -> Vec<Member<'a>> {
        let list = self
            .members
            .get(&(facet, series))
            .map_or(&[][..], Vec::as_slice);
        list.iter()
            .map(|(n, r)| Member {
                night: &self.nights[*n],
                run: &self.nights[*n].runs[*r],
                metric_indices: &self.metric_indices[*n],
            })
            .collect()
    }

    /// Returns the finished runs of a series in a facet, with repeats in order.
    pub fn finished(&'a self, facet: usize, series: usize) -> Vec<Member<'a>> {
        let mut members = self.members(facet, series);
        members.retain(|member| member.run.is_done());
        members
    }

    /// Returns every run of all nights.
    pub fn all(&'a self) -> impl Iterator<Item = Member<'a>> {
        self.nights
            .iter()
            .zip(&self.metric_indices)
            .flat_map(|(night, metric_indices)| {
                night.runs.iter().map(move |run| Member {
                    night,
                    run,
                    metric_indices,
                })
            })
    }

    /// Returns the value of a run at its last measurement, or `None` if it has no such value.
    pub fn run_value(&self, value: &TableValue, member: &Member) -> Option<RunValue> {
        let metric = |row: &WaveRow, index: usize| member.value(row, index);
        quantity::run_value(&self.metrics, value, member.run, metric)
    }

    /// Returns the metric of comparisons at equal error and of the numbers below crops: the first
    /// of relative MSE, RMSE, MSE and MAE that is measured, or else any error.
    pub fn error_metric(&self) -> Option<usize> {
        let find = |name: &&str| self.metrics.iter().position(|m| m.row.name == *name);
        let known = ["relmse", "rmse", "mse", "mae"].iter().find_map(find);
        let is_error = |m: &MetricSpec| m.row.better == Better::Lower;
        known.or_else(|| self.metrics.iter().position(is_error))
    }

    /// Returns the indices of night, facet and series of every run, in the order of [`Study::all`].
    pub fn run_positions(&self) -> Vec<(usize, usize, usize)> {
        let mut positions: BTreeMap<(usize, usize), (usize, usize)> = BTreeMap::new();
        for ((facet, series), members) in &self.members {
            positions.extend(members.iter().map(|member| (*member, (*facet, *series))));
        }
        positions
            .into_iter()
            .map(|((night, _), (facet, series))| (night, facet, series))
            .collect()
    }

    /// Returns the label of a facet, such as `scene = box, depth = 5`. It is empty if there are no
    /// facet axes.
    pub fn facet_label(&self, facet: usize) -> String {
        let values = self.facet_values(facet);
        // The values of a single axis of names are clear without the axis name, numbers are not.
        if let [value] = values.as_slice()
            && value.parse::<f64>().is_err()
            && value != "true"
            && value != "false"
        {
            return value.clone();
        }
        let pairs = self.facet_axes.iter().zip(&values);
        pairs
            .map(|(axis, value)| format!("{axis} = {value}"))
            .collect::<Vec<_>>()
            .join(", ")
    }

    /// Returns a sentence on the devices that times were measured on: `verb` with the device, such
    /// as `Measured on D.`, or a list of several devices. Returns `None` if no device is known.
    pub fn device_sentence(&self, verb: &str) -> Option<String> {
        match self.devices.as_slice() {
            [] => None,
            [one] => Some(format!("{verb} on {one}.")),
            _ => {
                let mut named: Vec<String> = Vec::new();
                for series in &self.series {
                    let Some(device) = &series.device else {
                        continue;
                    };
                    let text = if series.names_device || series.group.is_empty() {
                        device.clone()
                    } else {
                        format!("{}: {device}", series.group)
                    };
                    if !named.contains(&text) {
                        named.push(text);
                    }
                }
                Some(format!(
                    "Times are from {} devices: {}.",
                    self.devices.len(),
                    named.join("; ")
                ))
            }
        }
    }
}

/// Returns each value once, in the order in which they first occur.
pub(super) fn distinct(values: impl Iterator<Item = String>) -> Vec<String> {
    let mut seen = BTreeSet::new();
    values.filter(|value| seen.insert(value.clone())).collect()
}

/// Returns whether an axis selects the integrator of all runs.
pub(super) fn is_integrator_axis(nights: &[Night], axis: &str) -> bool {
    let mut runs = nights.iter().flat_map(|n| &n.runs);
    runs.all(|run| {
        let value = run.axis_value(axis);
        value.is_some_and(|value| canonical_name(&value) == run.integrator)
    })
}

/// Returns the distinct axes of all nights, in order.
fn all_axes(nights: &[Night]) -> Vec<String> {
    let mut axes: Vec<String> = Vec::new();
    for axis in nights.iter().flat_map(|night| &night.plan.axes) {
        if !axes.contains(axis) {
            axes.push(axis.clone());
        }
    }
    axes
}

/// Returns the axes that are compared and the facet axes: those of the options or the defaults.
fn chosen_axes(
    nights: &[Night],
    options: &ReportOptions,
) -> Result<(Vec<String>, Vec<String>), ReportError> {
    let axes = all_axes(nights);
    let known = |axis: &String| {
        if axes.contains(axis) {
            Ok(axis.clone())
        } else {
            Err(ReportError::NoAxis {
                axis: axis.clone(),
                known: axes.join(", "),
            })
        }
    };
    let varies = |axis: &&String| {
        let mut values = nights
            .iter()
            .flat_map(|n| &n.runs)
            .map(|run| run.axis_value(axis));
        let first = values.next();
        values.any(|value| Some(value) != first)
    };
    let by: Vec<String> = if options.by.is_empty() {
        let integrator = axes.iter().find(|axis| is_integrator_axis(nights, axis));
        integrator
            .or_else(|| axes.iter().rev().find(varies))
            .cloned()
            .into_iter()
            .collect()
    } else {
        options.by.iter().map(known).collect::<Result<_, _>>()?
    };
    let facet_axes: Vec<String> = match &options.facet {
        Some(facet) => facet.iter().map(known).collect::<Result<_, _>>()?,
        None => axes
            .iter()
            .filter(|axis| !by.contains(axis))
            .filter(varies)
            .cloned()
            .collect(),
    };
    Ok((by, facet_axes))
}

/// Returns the distinct devices of all nights.
///
/// # Errors
/// Returns an error if there are several nights and the device of one is unknown, since their times
/// are drawn on one axis.
fn all_devices(nights: &[Night], options: &ReportOptions) -> Result<Vec<String>, ReportError> {
    let mut devices: Vec<String> = Vec::new();
    for (n, night) in nights.iter().enumerate() {
        let own = night.devices();
        let finished = night.runs.iter().any(|run| run.is_done());
        let named = night.machine.is_some() || options.names.get(n).is_some();
        if nights.len() > 1 && finished && (own.is_empty() || !named) {
            return Err(ReportError::NoDevice {
                folder: night.folder.clone(),
            });
        }
        for device in own {
            if !devices.contains(&device) {
                devices.push(device);
            }
        }
    }
    Ok(devices)
}

/// Returns distinct names of the nights: the given name, or the device if it is different for each
/// night, or the name of the folder.
fn names(nights: &[Night], devices: &[String], options: &ReportOptions) -> Vec<String> {
    let by_device = |night: &Night| match night.devices().as_slice() {
        [one] if devices.len() == nights.len() => Some(one.clone()),
        _ => None,
    };
    let folder = |night: &Night| {
        night
            .folder
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default()
    };
    let mut names: Vec<String> = Vec::new();
    for (n, night) in nights.iter().enumerate() {
        let name = options
            .names
            .get(n)
            .cloned()
            .or_else(|| by_device(night))
            .unwrap_or_else(|| folder(night));
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
