//! Stop rules as Lua objects.

use std::collections::BTreeMap;
use std::rc::Rc;

use mlua::{Function, UserData, UserDataFields};

use crate::kind::KIND;
use crate::source::SourcePlace;
use lumbre_night::experiment::StopRule;

/// Largest number of different predicate functions of one plan.
pub(super) const MAX_PREDICATES: usize = 100_000;

/// Stop rule with the Lua functions and source positions that plain data cannot contain.
#[derive(Debug)]
pub enum Rule {
    /// Rule without columns or functions.
    Leaf(StopRule),
    /// Rule about a metric column, with the column and the position of the call.
    Column(StopRule, String, SourcePlace),
    /// Function that returns whether to stop.
    Predicate(Function),
    /// Fulfilled if at least one of the rules is.
    Any(Vec<RuleObject>),
    /// Fulfilled if all of the rules are.
    All(Vec<RuleObject>),
    /// Fulfilled if the rule is not.
    Not(RuleObject),
}

/// Lua object of a stop rule.
#[derive(Clone, Debug)]
pub struct RuleObject {
    pub(super) rule: Rc<Rule>,
    size: usize,
    depth: usize,
}

impl UserData for RuleObject {
    fn add_fields<F: UserDataFields<Self>>(fields: &mut F) {
        fields.add_meta_field(KIND, "a stop rule");
    }
}

/// Predicate functions of a plan. Stop rules refer to them by number.
#[derive(Debug, Default)]
pub struct Predicates {
    functions: Vec<Function>,
    numbers: BTreeMap<usize, usize>,
}

impl Predicates {
    /// Returns the predicate with this number.
    pub fn get(&self, number: usize) -> Option<Function> {
        self.functions.get(number).cloned()
    }

    /// Returns the number of a function, which is new only for a new function; `None` if there are
    /// too many.
    pub(super) fn number(&mut self, function: &Function) -> Option<usize> {
        // The function is stored, so no other function can have its address.
        let address = function.to_pointer() as usize;
        if let Some(number) = self.numbers.get(&address) {
            return Some(*number);
        }
        if self.functions.len() >= MAX_PREDICATES {
            return None;
        }
        let number = self.functions.len();
        self.functions.push(function.clone());
        self.numbers.insert(address, number);
        Some(number)
    }
}

impl RuleObject {
    /// Creates the object of a rule.
    pub fn new(rule: Rule) -> RuleObject {
        let (size, depth) = match &rule {
            Rule::Any(rules) | Rule::All(rules) => (
                rules.iter().map(|r| r.size).fold(1, usize::saturating_add),
                1 + rules.iter().map(|r| r.depth).max().unwrap_or(0),
            ),
            Rule::Not(inner) => (inner.size.saturating_add(1), inner.depth + 1),
            _ => (1, 1),
        };
        RuleObject {
            rule: Rc::new(rule),
            size,
            depth,
        }
    }

    /// Returns the number of rules in this rule, including itself.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Returns the depth of nesting; 1 for a rule without inner rules.
    pub fn depth(&self) -> usize {
        self.depth
    }
}
