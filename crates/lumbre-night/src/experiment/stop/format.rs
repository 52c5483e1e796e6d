//! Description of stop rules for people, and the canonical form that is part of a run's identity.

use std::collections::BTreeMap;

use super::StopRule;
use crate::text::counted;
use lumbre_light::value::Value;

impl StopRule {
    /// Describes the rule: `ssim > 0.95 held for 3 measurements, or 350 s of render time`.
    pub fn describe(&self) -> String {
        match self {
            StopRule::Time(seconds) => format!("{seconds} s of render time"),
            StopRule::Samples(n) => format!("{} per pixel", counted(*n, "sample")),
            StopRule::Waves(n) => counted(*n, "wave"),
            StopRule::When {
                column,
                op,
                value,
                hold: 0 | 1,
            } => format!("{column} {} {value}", op.symbol()),
            StopRule::When {
                column,
                op,
                value,
                hold,
            } => {
                format!(
                    "{column} {} {value} held for {hold} measurements",
                    op.symbol()
                )
            }
            StopRule::Plateau {
                column,
                exponent,
                over,
                p,
            } => format!(
                "the error of {column} falls more slowly than time^{exponent} over the last factor \
                 of {over} in render time (p < {p})"
            ),
            StopRule::Nan(n) => counted(*n, "invalid sample"),
            StopRule::Predicate(_) => "a function of the script".to_owned(),
            StopRule::Any(parts) => join(parts, ", or "),
            StopRule::All(parts) => join(parts, ", and "),
            StopRule::Not(part) => format!("not ({})", part.describe()),
        }
    }

    /// Returns the canonical form. `predicate` returns the identity of a predicate, whose number is
    /// meaningless outside of the loaded script.
    pub fn canonical(&self, predicate: &dyn Fn(usize) -> Value) -> Value {
        let whole =
            |n: u64| i64::try_from(n).map_or_else(|_| Value::Str(n.to_string()), Value::Int);
        let list = |parts: &[StopRule]| {
            Value::List(parts.iter().map(|p| p.canonical(predicate)).collect())
        };
        let (kind, argument) = match self {
            StopRule::Time(seconds) => ("time", Value::number(*seconds)),
            StopRule::Samples(n) => ("samples", whole(*n)),
            StopRule::Waves(n) => ("waves", whole(*n)),
            StopRule::When {
                column,
                op,
                value,
                hold,
            } => {
                let parts = [
                    column.as_str().into(),
                    op.symbol().into(),
                    Value::number(*value),
                    whole(u64::from(*hold)),
                ];
                ("when", Value::List(parts.into()))
            }
            StopRule::Plateau {
                column,
                exponent,
                over,
                p,
            } => {
                let parts = [column.as_str().into()]
                    .into_iter()
                    .chain([*exponent, *over, *p].map(Value::number));
                ("plateau", Value::List(parts.collect()))
            }
            StopRule::Nan(n) => ("nan", whole(*n)),
            StopRule::Predicate(id) => ("predicate", predicate(*id)),
            StopRule::Any(parts) => ("any", list(parts)),
            StopRule::All(parts) => ("all", list(parts)),
            StopRule::Not(part) => ("not", part.canonical(predicate)),
        };
        Value::Map(BTreeMap::from([(kind.to_owned(), argument)]))
    }
}

/// Joins the descriptions of rules, with nested combinations in parentheses.
fn join(parts: &[StopRule], separator: &str) -> String {
    let part = |rule: &StopRule| match rule {
        StopRule::Any(_) | StopRule::All(_) => format!("({})", rule.describe()),
        _ => rule.describe(),
    };
    parts.iter().map(part).collect::<Vec<_>>().join(separator)
}

#[cfg(test)]
mod tests {
    use super::super::Comparison;
    use super::*;

    #[test]
    fn rules_are_described() {
        let ssim = StopRule::When {
            column: "ssim".into(),
            op: Comparison::Greater,
            value: 0.95,
            hold: 3,
        };
        let rule = StopRule::Any(vec![ssim.clone(), StopRule::Time(350.0)]);
        assert_eq!(
            rule.describe(),
            "ssim > 0.95 held for 3 measurements, or 350 s of render time"
        );
        let rule = StopRule::All(vec![
            rule,
            StopRule::Not(Box::new(StopRule::Nan(1))),
            StopRule::Samples(1),
        ]);
        assert_eq!(
            rule.describe(),
            "(ssim > 0.95 held for 3 measurements, or 350 s of render time), and not (1 invalid \
             sample), and 1 sample per pixel"
        );
    }

    #[test]
    fn the_canonical_form_distinguishes_all_rules() {
        let when = |op, value, hold| StopRule::When {
            column: "rmse".into(),
            op,
            value,
            hold,
        };
        let plateau = |exponent, over, p| StopRule::Plateau {
            column: "rmse".into(),
            exponent,
            over,
            p,
        };
        let rules = [
            StopRule::Time(8.0),
            StopRule::Samples(8),
            StopRule::Waves(8),
            StopRule::Nan(8),
            StopRule::Predicate(8),
            StopRule::Predicate(9),
            when(Comparison::Less, 8.0, 1),
            when(Comparison::LessEqual, 8.0, 1),
            when(Comparison::Less, 8.5, 1),
            when(Comparison::Less, 8.0, 2),
            plateau(-0.1, 4.0, 0.01),
            plateau(-0.2, 4.0, 0.01),
            plateau(-0.1, 8.0, 0.01),
            plateau(-0.1, 4.0, 0.05),
            StopRule::Any(vec![StopRule::Samples(8)]),
            StopRule::All(vec![StopRule::Samples(8)]),
            StopRule::Not(Box::new(StopRule::Samples(8))),
        ];
        let forms: Vec<String> = rules
            .iter()
            .map(|r| serde_json::to_string(&r.canonical(&|id| Value::Int(id as i64))).unwrap())
            .collect();
        for (i, a) in forms.iter().enumerate() {
            assert!(
                forms[i + 1..].iter().all(|b| a != b),
                "{a} stands for two rules"
            );
        }
        assert_eq!(forms[6], r#"{"when":["rmse","<",8,1]}"#);
    }
}
