//! Declarations of a script so far, each with its position for errors that are found later.

use std::collections::BTreeMap;

use mlua::Function;

use super::rule::RuleObject;
use crate::source::SourcePlace;
use lumbre_light::value::Value;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::StopRule;
use lumbre_night::experiment::spec::{
    Axis, FigureSpec, MeasureSpec, NightSpec, Presentation, SheetSpec, TableSpec,
};

/// Declarations of an experiment, collected while its script runs.
#[derive(Debug, Default)]
pub struct Builder {
    /// Name, seed and repeats from `experiment(..)`.
    pub head: Option<Head>,
    /// Techniques from `external(..)`: their parameters by the name of the integrator.
    pub externals: Externals,
    /// Axes from `x:axis(..)`, in order.
    pub axes: Vec<Axis>,
    /// Reasons and rules from `x:skip(..)`, in order.
    pub skips: Vec<(String, Function)>,
    /// Function passed to `x:render(..)`.
    pub render: Option<(Function, SourcePlace)>,
    /// Reference from `x:reference(..)`.
    pub reference: Option<Reference>,
    /// Measurements from `x:measure(..)`.
    pub measure: Option<(MeasureSpec, SourcePlace)>,
    /// Tone map from `x:measure(..)`, if it sets one.
    pub display: Option<Tonemap>,
    /// Stop rule from `x:stop(..)`.
    pub stop: Option<(Stop, SourcePlace)>,
    /// Selection of `x:control(..)`; the inner `None` selects the default points.
    pub aa_check: Option<Option<Function>>,
    /// Settings of nights: `x:checkpoint(..)`, `x:deadline(..)`, and order and warm-up from
    /// `experiment(..)`.
    pub night: NightSpec,
    /// Figures from `x:figure(..)`, in order.
    pub figures: Vec<(FigureSpec, SourcePlace)>,
    /// Tables from `x:table(..)`, in order.
    pub tables: Vec<(TableSpec, SourcePlace)>,
    /// Sheets from `x:sheet(..)` and `x:frames(..)`, in order.
    pub sheets: Vec<(SheetSpec, SourcePlace)>,
    /// Presentation from `x:report(..)`.
    pub report: Option<(Presentation, SourcePlace)>,
    /// Notes from `x:note(..)`, in order.
    pub notes: Vec<String>,
}

/// Parameters of techniques that a script declares, by the name of the integrator.
pub type Externals = BTreeMap<String, BTreeMap<String, Value>>;

/// Values from `experiment(..)`.
#[derive(Debug)]
pub struct Head {
    /// Name of the experiment.
    pub name: String,
    /// Seed of the experiment.
    pub seed: u64,
    /// Number of runs of every point.
    pub repeats: u32,
    /// Lua object that the script has to return.
    pub object: mlua::Table,
    /// Position of the call.
    pub place: SourcePlace,
}

/// Reference from `x:reference(..)`.
#[derive(Clone, Debug)]
pub enum Reference {
    /// A reference that is rendered.
    Render(RenderedReference),
    /// The same image file for every cell.
    Image {
        /// File name as written in the script.
        file: String,
        /// Origin of the image; empty if not given.
        source: String,
        /// Position of the call.
        place: SourcePlace,
    },
    /// A function that returns the image file of each cell.
    ImageFunction {
        /// Function from a point to a file name.
        file: Function,
        /// Origin of the images; empty if not given.
        source: String,
    },
}

/// Reference that is rendered.
#[derive(Clone, Debug)]
pub struct RenderedReference {
    /// Function that returns the differences from the cell's render table.
    pub from: Option<Function>,
    /// Stop rule of the reference.
    pub stop: Stop,
    /// Second technique with which the reference is compared.
    pub bias_check: Option<BiasCheck>,
    /// Number of shards in which the reference is rendered.
    pub shards: u32,
    /// Position of the call.
    pub place: SourcePlace,
}

/// Option `agree` of `x:reference(..)`.
#[derive(Clone, Debug)]
pub struct BiasCheck {
    /// Changes to the reference's render table, with the second integrator and its parameters.
    pub changes: BTreeMap<String, Value>,
    /// Stop rule of the second picture; `None` uses that of the reference.
    pub stop: Option<StopRule>,
    /// Accepted rate of false discoveries.
    pub rate: f64,
}

/// Stop rule of cells or of references.
#[derive(Clone, Debug)]
pub enum Stop {
    /// One rule for all cells.
    Rule(RuleObject),
    /// Function that returns the rule of each cell.
    Function(Function),
}

impl Builder {
    /// Returns the names of the axes, in order.
    pub fn axis_names(&self) -> Vec<&str> {
        self.axes
            .iter()
            .flat_map(|a| a.names.iter().map(String::as_str))
            .collect()
    }

    /// Returns the names of the metric columns, in order.
    pub fn columns(&self) -> Vec<&str> {
        self.measure
            .iter()
            .flat_map(|(m, _)| m.metrics.iter().map(|m| m.column.as_str()))
            .collect()
    }
}
