//! Checks of stop rules, and their conversion to plain data ([`StopRule`]).

use mlua::Value as LuaValue;

use super::builder::Builder;
use super::measure::unknown_column;
use super::rule::{MAX_PREDICATES, Rule, RuleObject};
use crate::error::ScriptError;
use crate::source::SourcePlace;
use crate::state::Shared;
use lumbre_light::value::schema::Ty;
use lumbre_night::experiment::StopRule;

/// Count without an upper limit.
const INTEGER: Ty = Ty::int(i64::MIN, i64::MAX);

/// Number without limits.
const NUMBER: Ty = Ty::num(f64::MIN, f64::MAX);

lumbre_light::table! {
    /// Columns of a measurement that exist in every experiment.
    pub const ROW = "Row",
        "Measurement, as stop.predicate receives it. Metric columns are fields too if the \
         experiment has a reference.";
    wave: INTEGER, "number of the wave, from 1";
    samples: INTEGER, "samples per pixel so far";
    render_s: NUMBER, "render time in seconds so far";
    wall_s: NUMBER, "wall time of the cell in seconds so far";
    measure_s: NUMBER, "time spent on measuring, in seconds";
    paths: INTEGER, "camera paths so far";
    rays: INTEGER, "rays so far";
    invalid: INTEGER, "samples so far that were NaN or infinite";
}

/// Metric columns that a stop rule may use.
pub struct RuleColumns<'a> {
    /// Names of the metric columns.
    pub columns: &'a [&'a str],
    /// Reason why no column can be used; `None` if all can.
    pub unmeasured: Option<&'static str>,
}

impl RuleObject {
    /// Checks the metric columns in the rule.
    ///
    /// # Errors
    /// Returns an error at the line of `stop.when` or `stop.plateau` for an unknown column, or if
    /// no column can be used.
    pub fn check(&self, shared: &Shared, allowed: &RuleColumns) -> Result<(), ScriptError> {
        match &*self.rule {
            Rule::Leaf(_) | Rule::Predicate(_) => Ok(()),
            Rule::Any(rules) | Rule::All(rules) => {
                rules.iter().try_for_each(|r| r.check(shared, allowed))
            }
            Rule::Not(inner) => inner.check(shared, allowed),
            Rule::Column(rule, column, place) => {
                let function = if let StopRule::Plateau { .. } = rule {
                    "stop.plateau"
                } else {
                    "stop.when"
                };
                let fail = |problem: String, help: Option<String>| {
                    Err(shared
                        .sources
                        .borrow()
                        .field(place, function, problem, help))
                };
                if let Some(reason) = allowed.unmeasured {
                    return fail(
                        format!("`{column}` cannot be compared here: {reason}"),
                        None,
                    );
                }
                if allowed.columns.contains(&column.as_str()) {
                    return Ok(());
                }
                let error = unknown_column("", column, allowed.columns);
                fail(error.problem, error.help)
            }
        }
    }

    /// Converts the rule to plain data. `place` is the position of its declaration.
    ///
    /// # Errors
    /// Returns an error if the plan has too many predicates.
    pub fn lower(&self, shared: &Shared, place: &SourcePlace) -> Result<StopRule, ScriptError> {
        let many = |rules: &[RuleObject]| {
            rules
                .iter()
                .map(|r| r.lower(shared, place))
                .collect::<Result<Vec<_>, _>>()
        };
        Ok(match &*self.rule {
            Rule::Leaf(rule) | Rule::Column(rule, ..) => rule.clone(),
            Rule::Any(rules) => StopRule::Any(many(rules)?),
            Rule::All(rules) => StopRule::All(many(rules)?),
            Rule::Not(inner) => StopRule::Not(Box::new(inner.lower(shared, place)?)),
            Rule::Predicate(function) => {
                let number = shared.predicates.borrow_mut().number(function);
                StopRule::Predicate(number.ok_or_else(|| {
                    let problem =
                        format!("the plan has more than {MAX_PREDICATES} different predicates");
                    let help = "create the predicate once, outside the function".to_owned();
                    shared
                        .sources
                        .borrow()
                        .field(place, "stop.predicate", problem, Some(help))
                })?)
            }
        })
    }
}

/// Returns the rule behind a Lua value; `None` if the value is not a stop rule.
pub fn rule_from_value(value: &LuaValue) -> Option<RuleObject> {
    match value {
        LuaValue::UserData(data) => data.borrow::<RuleObject>().ok().map(|r| r.clone()),
        _ => None,
    }
}

/// Returns the columns that the stop rule of a cell may use.
pub fn cell_rules<'a>(builder: &Builder, columns: &'a [&'a str]) -> RuleColumns<'a> {
    let unmeasured = match builder.reference {
        Some(_) => None,
        None => Some("metrics need a reference, and the script has no x:reference"),
    };
    RuleColumns {
        columns,
        unmeasured,
    }
}

/// Returns the columns that the stop rule of a reference may use: none.
pub fn reference_rules<'a>(columns: &'a [&'a str]) -> RuleColumns<'a> {
    RuleColumns {
        columns,
        unmeasured: Some("a reference is not compared with anything"),
    }
}
