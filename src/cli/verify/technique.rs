//! Techniques that must all render the same picture.

use std::collections::BTreeMap;
use std::fmt;

use lumbre_light::transport::integrator::{IntegratorRow, integrators};
use lumbre_light::transport::mis;
use lumbre_light::value::Value;

/// An integrator with parameters.
#[derive(Clone, Debug)]
pub struct Technique {
    /// Table row of the integrator.
    pub row: &'static IntegratorRow,
    /// Parameters that differ from the defaults.
    pub params: BTreeMap<String, Value>,
}

impl fmt::Display for Technique {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.row.name)?;
        self.params
            .iter()
            .try_for_each(|(key, value)| write!(f, " {key}={value}"))
    }
}

impl Technique {
    /// Creates a technique with default parameters.
    pub fn plain(row: &'static IntegratorRow) -> Technique {
        Technique {
            row,
            params: BTreeMap::new(),
        }
    }

    /// Whether the variance is unbounded, which holds for `mis = "none"`: short connections and
    /// lights near surfaces contribute rare samples of any size, and a sum without them
    /// underestimates its own error.
    pub fn has_unbounded_variance(&self) -> bool {
        self.params.get(mis::FIELD.key).and_then(Value::as_str) == Some("none")
    }

    /// Returns the same integrator with each non-default value of each enumerated parameter.
    /// Enumerated parameters select how light is sampled; other parameters may change the picture.
    pub fn variants(&self) -> Vec<Technique> {
        let row = self.row;
        let variants = row.params.variants().into_iter();
        variants.map(|params| Technique { row, params }).collect()
    }
}

/// Returns every unbiased integrator with default parameters.
pub fn plain() -> Vec<Technique> {
    let unbiased = integrators().filter(|row| row.bias.is_none());
    unbiased.map(Technique::plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unbiased_integrator_is_listed_with_every_value_of_its_parameters() {
        let names: Vec<String> = plain().iter().map(Technique::to_string).collect();
        assert!(
            names.starts_with(&["bpt".to_owned(), "nee".to_owned()]),
            "{names:?}"
        );
        for technique in plain() {
            for variant in technique.variants() {
                variant.row.params.check("", &variant.params).unwrap();
                assert_eq!(variant.params.len(), 1);
            }
        }
        let nee: Vec<String> = plain()[1]
            .variants()
            .iter()
            .map(Technique::to_string)
            .collect();
        assert!(
            nee.contains(&"nee mis=balance".to_owned()) && nee.contains(&"nee mis=none".to_owned()),
            "{nee:?}"
        );
        assert!(!nee.contains(&"nee mis=power".to_owned()), "{nee:?}");
    }
}
