//! Reading of stop rules from their canonical form, for processes that only watch a night.

use super::{Comparison, StopRule};
use lumbre_light::value::Value;

impl StopRule {
    /// Reads a rule from its [canonical form](StopRule::canonical), for display.
    ///
    /// Predicates cannot be reconstructed without the script; they become predicates with a
    /// meaningless number, as do unknown forms, which may come from a newer version. The result
    /// must not be used to render.
    pub fn from_canonical(form: &Value) -> StopRule {
        Self::known_rule(form).unwrap_or(StopRule::Predicate(0))
    }

    /// Reads a rule of a known form, or returns `None`.
    fn known_rule(form: &Value) -> Option<StopRule> {
        let (kind, argument) = form.as_map()?.iter().next()?;
        let whole = |v: &Value| -> Option<u64> {
            v.as_i64()
                .and_then(|n| u64::try_from(n).ok())
                .or_else(|| v.as_str()?.parse().ok())
        };
        let parts = || {
            Some(
                argument
                    .as_list()?
                    .iter()
                    .map(StopRule::from_canonical)
                    .collect(),
            )
        };
        Some(match kind.as_str() {
            "time" => StopRule::Time(argument.as_f64()?),
            "samples" => StopRule::Samples(whole(argument)?),
            "waves" => StopRule::Waves(whole(argument)?),
            "nan" => StopRule::Nan(whole(argument)?),
            "any" => StopRule::Any(parts()?),
            "all" => StopRule::All(parts()?),
            "not" => StopRule::Not(Box::new(StopRule::from_canonical(argument))),
            "when" => {
                let [column, op, value, hold] = argument.as_list()? else {
                    return None;
                };
                StopRule::When {
                    column: column.as_str()?.to_owned(),
                    op: comparison(op.as_str()?)?,
                    value: value.as_f64()?,
                    hold: u32::try_from(whole(hold)?).ok()?,
                }
            }
            "plateau" => {
                let [column, exponent, over, p] = argument.as_list()? else {
                    return None;
                };
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

/// Returns the comparison of an operator.
fn comparison(symbol: &str) -> Option<Comparison> {
    use Comparison::{Greater, GreaterEqual, Less, LessEqual};
    [Less, LessEqual, Greater, GreaterEqual]
        .into_iter()
        .find(|op| op.symbol() == symbol)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_survives_a_round_trip() {
        let when = |op| StopRule::When {
            column: "rmse".into(),
            op,
            value: 0.25,
            hold: 3,
        };
        let rules = vec![
            StopRule::Time(8.5),
            StopRule::Samples(u64::MAX),
            StopRule::Waves(8),
            StopRule::Nan(1),
            when(Comparison::Less),
            when(Comparison::GreaterEqual),
            StopRule::Plateau {
                column: "rmse".into(),
                exponent: -0.1,
                over: 4.0,
                p: 0.01,
            },
            StopRule::Not(Box::new(StopRule::Samples(8))),
        ];
        let rule = StopRule::Any(vec![
            StopRule::All(rules.clone()),
            StopRule::Any(rules),
            StopRule::Predicate(0),
        ]);
        let form = rule.canonical(&|_| Value::from("the hash of a script"));
        let text = serde_json::to_string(&form).unwrap();
        let read: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(StopRule::from_canonical(&read), rule);
    }

    #[test]
    fn unknown_forms_become_predicates() {
        for text in [
            r#"{"full_moon": 3}"#,
            r#"{"samples": "many"}"#,
            r#"{"when": ["rmse", "~", 1, 1]}"#,
            "7",
            "{}",
        ] {
            let form = Value::from_json(&serde_json::from_str(text).unwrap());
            assert_eq!(
                StopRule::from_canonical(&form),
                StopRule::Predicate(0),
                "{text}"
            );
        }
    }
}
