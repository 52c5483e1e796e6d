//! The ways of rendering a picture that must all show the same.

use std::collections::BTreeMap;
use std::fmt;

use crate::transport::integrator::{INTEGRATORS, IntegratorRow};
use crate::transport::mis;
use crate::value::Value;
use crate::value::schema::Ty;

/// An integrator with parameters.
#[derive(Clone, Debug)]
pub struct Technique {
    /// The integrator.
    pub row: &'static IntegratorRow,
    /// What differs from its defaults.
    pub params: BTreeMap<String, Value>,
}

impl fmt::Display for Technique {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.row.name)?;
        self.params.iter().try_for_each(|(key, value)| write!(f, " {key}={value}"))
    }
}

impl Technique {
    /// An integrator with its defaults.
    pub fn plain(row: &'static IntegratorRow) -> Technique {
        Technique { row, params: BTreeMap::new() }
    }

    /// Whether strategies count whatever their density, `mis = "none"`: then short connections and lights near surfaces
    /// bring rare samples of any size, the variance has no bound, and a small sum that missed them looks surer than it is.
    pub fn is_wild(&self) -> bool {
        self.params.get(mis::FIELD.key).and_then(Value::as_str) == Some("none")
    }

    /// The same integrator with each other word of each of its parameters in turn. Words choose how light is found;
    /// parameters of other types may choose which light, and are left alone.
    pub fn variants(&self) -> Vec<Technique> {
        let mut variants = Vec::new();
        for field in self.row.params.fields {
            let Ty::Word(words) = field.ty else { continue };
            for word in words.iter().filter(|word| **word != field.default) {
                let params = BTreeMap::from([(field.key.to_owned(), Value::from(*word))]);
                variants.push(Technique { row: self.row, params });
            }
        }
        variants
    }
}

/// Every integrator with its defaults.
pub fn plain() -> Vec<Technique> {
    INTEGRATORS.iter().map(Technique::plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_integrator_is_there_with_every_word_of_its_parameters() {
        let names: Vec<String> = plain().iter().map(Technique::to_string).collect();
        assert!(names.starts_with(&["bpt".to_owned(), "nee".to_owned()]), "{names:?}");
        for technique in plain() {
            for variant in technique.variants() {
                variant.row.params.check("", &variant.params).unwrap();
                assert_eq!(variant.params.len(), 1);
            }
        }
        let nee: Vec<String> = plain()[1].variants().iter().map(Technique::to_string).collect();
        assert!(nee.contains(&"nee mis=balance".to_owned()) && nee.contains(&"nee mis=none".to_owned()), "{nee:?}");
        assert!(!nee.contains(&"nee mis=power".to_owned()), "{nee:?}");
    }
}
