//! Axes of a sweep: overrides, selections, and the sequence of points.

use std::collections::BTreeSet;

use super::PlanError;
use crate::experiment::spec::{Axis, MeasureSpec, Point};
use crate::experiment::stop::StopRule;
use lumbre_light::value::{Value, suggest};
use lumbre_render::settings::named;

/// Greatest number of cells in a plan.
pub const MAX_CELLS: u64 = 1_000_000;

/// Changes to a script's experiment by the command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides {
    /// New values for axes, and values of settings that are no axes. Zipped axes are restricted to the
    /// steps that have one of the values. A setting becomes an axis, the last one, whose values
    /// replace what the script's functions return.
    pub axes: Vec<(String, Vec<Value>)>,
    /// Selected points: a point must match one of the values of every axis named here.
    pub only: Vec<(String, Value)>,
    /// Whether pictures have an eighth of the pixels, and runs a sixteenth of the time and samples.
    pub quick: bool,
    /// Backend that replaces the script's, for cells and references.
    pub backend: Option<String>,
    /// Whether the plan is for other machines, so that backends need not be usable on this one.
    pub elsewhere: bool,
    /// Whether commands of the script may run. Otherwise the versions of its external techniques
    /// remain unknown, and nothing of them can be rendered.
    pub commands: bool,
}

/// Factor by which [`Overrides::quick`] shortens times and samples.
const QUICK_FACTOR: u64 = 16;

/// Description of [`Overrides::quick`].
pub(super) const QUICK: &str = "--quick (an eighth of the pixels, a sixteenth of the time)";

impl Overrides {
    /// Returns the stop rule of a run by the script's.
    pub(super) fn stop(&self, rule: StopRule) -> StopRule {
        if self.quick {
            rule.divided(QUICK_FACTOR)
        } else {
            rule
        }
    }

    /// Returns the measurements of a run by the script's.
    pub(super) fn measure(&self, measure: &MeasureSpec) -> MeasureSpec {
        let mut measure = measure.clone();
        if self.quick {
            measure.every_s /= QUICK_FACTOR as f64;
        }
        measure
    }

    /// Returns the resolution of pictures by the script's or the scene's.
    pub(super) fn resolution(&self, sides: [u32; 2]) -> [u32; 2] {
        if !self.quick {
            return sides;
        }
        sides.map(|side| ((f64::from(side) / 8f64.sqrt()).round() as u32).max(side.min(1)))
    }
}

/// Applies overrides and selections to the axes and checks the result.
pub(super) fn select(
    axes: &[Axis],
    overrides: &Overrides,
    repeats: u32,
) -> Result<Vec<Axis>, PlanError> {
    let mut axes = axes.to_vec();
    check_names(&axes)?;
    for (name, values) in &overrides.axes {
        let has = |name: &str| axes.iter().any(|axis| axis.names.iter().any(|n| n == name));
        // Two names of the same, of which a script's axis may have either.
        let name = match name.as_str() {
            "technique" if !has(name) && has("integrator") => "integrator",
            "integrator" if !has(name) && has("technique") => "technique",
            name => name,
        };
        if has(name) || !named::is_setting(name) {
            replace(&mut axes, name, values)?;
        } else {
            axes.push(Axis {
                names: vec![name.to_owned()],
                steps: values.iter().map(|value| vec![value.clone()]).collect(),
            });
        }
    }
    axes.iter().try_for_each(check_steps)?;
    keep_only(&mut axes, &overrides.only)?;
    check_size(&axes, repeats)?;
    Ok(axes)
}

/// All points of the sweep, with the last axis varying fastest.
pub(super) fn points(axes: &[Axis]) -> impl Iterator<Item = Point> + '_ {
    let count: usize = axes.iter().map(|axis| axis.steps.len()).product();
    (0..count).map(move |index| {
        let mut rest = index;
        let mut steps = vec![0; axes.len()];
        for (axis, step) in axes.iter().zip(&mut steps).rev() {
            *step = rest % axis.steps.len();
            rest /= axis.steps.len();
        }
        let values = |(axis, step): (&Axis, usize)| -> Point {
            axis.names
                .iter()
                .cloned()
                .zip(axis.steps[step].iter().cloned())
                .collect()
        };
        axes.iter().zip(steps).flat_map(values).collect()
    })
}

/// Describes a point for messages. The only point of a sweep has an empty description.
pub(super) fn describe(point: &Point) -> String {
    let parts: Vec<String> = point
        .iter()
        .map(|(name, value)| format!("{name} = {value}"))
        .collect();
    parts.join(", ")
}

fn check_names(axes: &[Axis]) -> Result<(), PlanError> {
    let mut seen = BTreeSet::new();
    match axes
        .iter()
        .flat_map(|axis| &axis.names)
        .find(|name| !seen.insert(name.as_str()))
    {
        Some(axis) => Err(PlanError::DuplicateAxis { axis: axis.clone() }),
        None => Ok(()),
    }
}

fn check_steps(axis: &Axis) -> Result<(), PlanError> {
    let name = axis.names.join(", ");
    if axis.steps.is_empty() {
        return Err(PlanError::EmptyAxis { axis: name });
    }
    let mut seen = BTreeSet::new();
    let twice = axis.steps.iter().find(|step| {
        let mut hasher = blake3::Hasher::new();
        step.iter().for_each(|value| value.hash_into(&mut hasher));
        !seen.insert(*hasher.finalize().as_bytes())
    });
    match twice {
        Some(step) => {
            let value = step
                .iter()
                .map(Value::to_string)
                .collect::<Vec<_>>()
                .join(", ");
            Err(PlanError::DuplicateValue { axis: name, value })
        }
        None => Ok(()),
    }
}

fn replace(axes: &mut [Axis], name: &str, values: &[Value]) -> Result<(), PlanError> {
    let (axis, column) = find(axes, name).map_err(|error| {
        match suggest::nearest(name, named::names()) {
            // An axis of the script is nearer than a setting.
            Some(near) if nearest_axis(axes, name).is_none() => PlanError::UnknownSetting {
                name: name.to_owned(),
                near,
            },
            _ => error,
        }
    })?;
    let axis = &mut axes[axis];
    if values.is_empty() {
        return Err(PlanError::EmptyAxis {
            axis: name.to_owned(),
        });
    }
    if axis.names.len() > 1 {
        for value in values {
            expect_value(axis, column, value)?;
        }
        axis.steps
            .retain(|step| values.iter().any(|value| same(value, &step[column])));
        return Ok(());
    }
    // Prefer the script's own value and its type: on the command line `1` may mean the string "1".
    let of_script = |value: &Value| {
        axis.steps
            .iter()
            .map(|step| &step[0])
            .find(|v| same(value, v))
    };
    let steps = values
        .iter()
        .map(|value| vec![of_script(value).unwrap_or(value).clone()])
        .collect();
    axis.steps = steps;
    Ok(())
}

fn keep_only(axes: &mut [Axis], only: &[(String, Value)]) -> Result<(), PlanError> {
    let mut kept: Vec<Vec<(usize, Vec<&Value>)>> = vec![Vec::new(); axes.len()];
    for (name, value) in only {
        let (axis, column) = find(axes, name)?;
        expect_value(&axes[axis], column, value)?;
        match kept[axis].iter_mut().find(|(c, _)| *c == column) {
            Some((_, values)) => values.push(value),
            None => kept[axis].push((column, vec![value])),
        }
    }
    for (axis, wanted) in axes.iter_mut().zip(&kept) {
        axis.steps.retain(|step| {
            wanted
                .iter()
                .all(|(c, values)| values.iter().any(|v| same(v, &step[*c])))
        });
        if axis.steps.is_empty() {
            let wanted = only
                .iter()
                .map(|(name, value)| format!("{name} = {value}"))
                .collect::<Vec<_>>()
                .join(", ");
            return Err(PlanError::NothingSelected { wanted });
        }
    }
    Ok(())
}

fn check_size(axes: &[Axis], repeats: u32) -> Result<(), PlanError> {
    if repeats == 0 {
        return Err(PlanError::NoRepeats);
    }
    let cells = axes
        .iter()
        .map(|axis| axis.steps.len() as f64)
        .product::<f64>()
        * f64::from(repeats);
    if cells <= MAX_CELLS as f64 {
        return Ok(());
    }
    let factor = |axis: &Axis| format!("{} of `{}`", axis.steps.len(), axis.names.join(", "));
    let mut factors: Vec<String> = axes.iter().map(factor).collect();
    factors.push(format!("{repeats} repeats"));
    Err(PlanError::TooManyCells {
        cells: format!("{cells}"),
        factors: factors.join(" x "),
        limit: MAX_CELLS,
    })
}

/// Returns the axis with the name that is most similar to another one, if any is.
fn nearest_axis<'a>(axes: &'a [Axis], name: &str) -> Option<&'a str> {
    let names = axes.iter().flat_map(|axis| &axis.names);
    suggest::nearest(name, names.map(String::as_str))
}

/// Finds an axis by name: its index, and the index of the name among zipped axes.
fn find(axes: &[Axis], name: &str) -> Result<(usize, usize), PlanError> {
    let position = |(i, axis): (usize, &Axis)| {
        axis.names
            .iter()
            .position(|n| n == name)
            .map(|column| (i, column))
    };
    axes.iter()
        .enumerate()
        .find_map(position)
        .ok_or_else(|| PlanError::UnknownAxis {
            axis: name.to_owned(),
            help: help(
                name,
                axes.iter().flat_map(|axis| &axis.names).map(String::as_str),
            ),
        })
}

fn expect_value(axis: &Axis, column: usize, value: &Value) -> Result<(), PlanError> {
    if axis.steps.iter().any(|step| same(value, &step[column])) {
        return Ok(());
    }
    let known: Vec<String> = axis
        .steps
        .iter()
        .map(|step| step[column].to_string())
        .collect();
    Err(PlanError::UnknownValue {
        axis: axis.names[column].clone(),
        value: value.to_string(),
        help: help(&value.to_string(), known.iter().map(String::as_str)),
    })
}

/// Whether a value from the command line stands for a value of the script.
fn same(given: &Value, of_script: &Value) -> bool {
    given == of_script || given.to_string() == of_script.to_string()
}

/// Suggests the most similar known name, or lists the first few.
pub(super) fn help<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 12;
    let known: Vec<&str> = known.into_iter().collect();
    match suggest::nearest(name, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => "there are none".to_owned(),
        None if known.len() > SHOWN => {
            format!(
                "known: {}, and {} more",
                known[..SHOWN].join(", "),
                known.len() - SHOWN
            )
        }
        None => format!("known: {}", known.join(", ")),
    }
}
