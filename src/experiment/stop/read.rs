//! A stop rule read back from its canonical form, for those who only watch.

use super::{Comparison, StopRule};
use crate::value::Value;

impl StopRule {
    /// The rule that a [canonical form](StopRule::canonical) stands for, as far as it can be known without the script.
    ///
    /// A predicate is a predicate again, but its number means nothing; so is every form that is not known here, which
    /// may come from a newer program: both are something whose end cannot be foretold. Nothing is rendered by what
    /// comes out of this.
    pub fn read(form: &Value) -> StopRule {
        Self::known(form).unwrap_or(StopRule::Predicate(0))
    }

    fn known(form: &Value) -> Option<StopRule> {
        let (kind, argument) = form.as_map()?.iter().next()?;
        let whole = |v: &Value| -> Option<u64> {
            v.as_i64().and_then(|n| u64::try_from(n).ok()).or_else(|| v.as_str()?.parse().ok())
        };
        let parts = || Some(argument.as_list()?.iter().map(StopRule::read).collect());
        Some(match kind.as_str() {
            "time" => StopRule::Time(argument.as_f64()?),
            "samples" => StopRule::Samples(whole(argument)?),
            "waves" => StopRule::Waves(whole(argument)?),
            "nan" => StopRule::Nan(whole(argument)?),
            "any" => StopRule::Any(parts()?),
            "all" => StopRule::All(parts()?),
            "not" => StopRule::Not(Box::new(StopRule::read(argument))),
            "when" => {
                let [column, op, value, hold] = argument.as_list()? else { return None };
                StopRule::When {
                    column: column.as_str()?.to_owned(),
                    op: comparison(op.as_str()?)?,
                    value: value.as_f64()?,
                    hold: u32::try_from(whole(hold)?).ok()?,
                }
            }
            "plateau" => {
                let [column, exponent, over, p] = argument.as_list()? else { return None };
                StopRule::Plateau {
                    column: column.as_str()?.to_owned(),
                    exponent: exponent.as_f64()?,
                    over: over.as_f64()?,
                    p: p.as_f64()?,
                }
            }
            _ => return None,
        })
    }
}

fn comparison(symbol: &str) -> Option<Comparison> {
    use Comparison::{Greater, GreaterEqual, Less, LessEqual};
    [Less, LessEqual, Greater, GreaterEqual].into_iter().find(|op| op.symbol() == symbol)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_reads_back_as_itself() {
        let when = |op| StopRule::When { column: "rmse".into(), op, value: 0.25, hold: 3 };
        let rules = vec![
            StopRule::Time(8.5),
            StopRule::Samples(u64::MAX),
            StopRule::Waves(8),
            StopRule::Nan(1),
            when(Comparison::Less),
            when(Comparison::GreaterEqual),
            StopRule::Plateau { column: "rmse".into(), exponent: -0.1, over: 4.0, p: 0.01 },
            StopRule::Not(Box::new(StopRule::Samples(8))),
        ];
        let rule = StopRule::Any(vec![StopRule::All(rules.clone()), StopRule::Any(rules), StopRule::Predicate(0)]);
        let form = rule.canonical(&|_| Value::from("the hash of a script")).to_json();
        assert_eq!(StopRule::read(&Value::from_json(&form)), rule);
    }

    #[test]
    fn what_is_not_known_cannot_be_foretold() {
        for text in [r#"{"full_moon": 3}"#, r#"{"samples": "many"}"#, r#"{"when": ["rmse", "~", 1, 1]}"#, "7", "{}"] {
            let form = Value::from_json(&serde_json::from_str(text).unwrap());
            assert_eq!(StopRule::read(&form), StopRule::Predicate(0), "{text}");
        }
    }
}
