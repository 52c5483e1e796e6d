//! What a script has said so far, each part with its place for errors that are found later.

use mlua::Function;

use super::stop::RuleObject;
use crate::experiment::StopRule;
use crate::experiment::spec::{Axis, FigureSpec, Measure, NightSpec, TableSpec};
use crate::script::source::Place;

/// Everything a script said.
#[derive(Debug, Default)]
pub struct Builder {
    /// `experiment(..)`.
    pub head: Option<Head>,
    /// `x:axis(..)`, in order.
    pub axes: Vec<Axis>,
    /// `x:skip(..)`: reason and rule, in order.
    pub skips: Vec<(String, Function)>,
    /// `x:render(..)`.
    pub render: Option<(Function, Place)>,
    /// `x:reference(..)`.
    pub reference: Option<Reference>,
    /// `x:measure(..)`.
    pub measure: Option<(Measure, Place)>,
    /// `x:stop(..)`.
    pub stop: Option<(Stop, Place)>,
    /// `x:control(..)`, with the function that chooses its points.
    pub control: Option<Option<Function>>,
    /// `x:checkpoint(..)`, `x:deadline(..)`, and what `experiment(..)` said of order and warm-up.
    pub night: NightSpec,
    /// `x:figure(..)`, in order.
    pub figures: Vec<(FigureSpec, Place)>,
    /// `x:table(..)`, in order.
    pub tables: Vec<(TableSpec, Place)>,
}

/// What `experiment(..)` said.
#[derive(Debug)]
pub struct Head {
    /// Name of the experiment.
    pub name: String,
    /// Its seed.
    pub seed: u64,
    /// How often every point is rendered.
    pub repeats: u32,
    /// The object that the script has to return.
    pub object: mlua::Table,
    /// Where.
    pub place: Place,
}

/// What `x:reference(..)` said.
#[derive(Clone, Debug)]
pub enum Reference {
    /// Render it.
    Render {
        /// Says how it differs from the cell.
        from: Option<Function>,
        /// When it is good enough.
        stop: Stop,
        /// What it is compared with.
        agree: Option<Agree>,
        /// In how many parts it is rendered.
        parts: u32,
        /// Where.
        place: Place,
    },
    /// Always the same file.
    Image {
        /// As the script wrote it.
        file: String,
        /// Who made it; empty if that was not said.
        source: String,
        /// Where.
        place: Place,
    },
    /// A function says which file.
    ImageOf {
        /// Says which.
        file: Function,
        /// Who made them; empty if that was not said.
        source: String,
    },
}

/// What `agree` in `x:reference(..)` said.
#[derive(Clone, Debug)]
pub struct Agree {
    /// The second integrator.
    pub with: String,
    /// When its picture is good enough; `None` is when the reference is.
    pub stop: Option<StopRule>,
    /// The share of false discoveries.
    pub rate: f64,
}

/// What `x:stop(..)` said.
#[derive(Clone, Debug)]
pub enum Stop {
    /// One rule for every cell.
    Rule(RuleObject),
    /// A function that makes the rule of each cell.
    Function(Function),
}

impl Builder {
    /// The names of the axes, in order.
    pub fn axis_names(&self) -> Vec<&str> {
        self.axes.iter().flat_map(|a| a.names.iter().map(String::as_str)).collect()
    }

    /// The names of the metric columns, in order.
    pub fn columns(&self) -> Vec<&str> {
        self.measure.iter().flat_map(|(m, _)| m.metrics.iter().map(|m| m.column.as_str())).collect()
    }
}
