//! Identity of a cell, in parts that cells share: a plan of ten thousand cells has as many.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{RunId, identity};
use lumbre_light::value::Value;

/// Everything that determines a cell's picture and its measurements. It is the map of all its parts,
/// and its hash is the run id.
#[derive(Clone, Debug, Default)]
pub struct CellIdentity {
    /// Fields that the repeats of a point share.
    picture: Arc<BTreeMap<String, Value>>,
    /// Measurements, which cells with or without a reference share.
    measure: Arc<Value>,
    seed: Value,
    stop: Arc<Value>,
    reference: Value,
}

impl CellIdentity {
    /// Returns the identity of a picture with this seed, stop rule, measurements and reference.
    pub(super) fn new(
        picture: &Arc<BTreeMap<String, Value>>,
        measure: &Arc<Value>,
        seed: u64,
        stop: &Arc<Value>,
        reference: Option<&RunId>,
    ) -> CellIdentity {
        CellIdentity {
            picture: Arc::clone(picture),
            measure: Arc::clone(measure),
            seed: identity::seed_value(seed),
            stop: Arc::clone(stop),
            reference: reference.map_or(Value::Nil, |id| id.0.as_str().into()),
        }
    }

    /// Returns the run id.
    pub(super) fn run_id(&self) -> RunId {
        let mut hasher = blake3::Hasher::new();
        let mut fields: Vec<_> = self.fields().collect();
        fields.sort_unstable_by_key(|(key, _)| *key);
        Value::hash_fields(fields.into_iter(), &mut hasher);
        identity::id_of_hash(&hasher.finalize())
    }

    /// Returns a field, or nothing if there is none of this name.
    pub fn field(&self, name: &str) -> &Value {
        let found = self.fields().find(|(key, _)| *key == name);
        found.map_or(&Value::Nil, |(_, value)| value)
    }

    /// Returns the map of all fields, for display and for `config.json`.
    pub fn to_value(&self) -> Value {
        let owned = |(key, value): (&str, &Value)| (key.to_owned(), value.clone());
        Value::Map(self.fields().map(owned).collect())
    }

    /// Returns all fields in no order.
    fn fields(&self) -> impl Iterator<Item = (&str, &Value)> {
        let own = [
            ("measure", &*self.measure),
            (identity::SEED, &self.seed),
            ("stop", &*self.stop),
            ("reference", &self.reference),
        ];
        let picture = self.picture.iter();
        picture.map(|(key, value)| (key.as_str(), value)).chain(own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_id_is_that_of_the_whole_map() {
        let picture = [("scene", "a"), ("sampler", "b"), ("accel", "c")];
        let picture = picture.map(|(key, value)| (key.to_owned(), Value::from(value)));
        let picture = Arc::new(BTreeMap::from(picture));
        let [measure, stop] = ["metrics", "rule"].map(|text| Arc::new(Value::from(text)));
        let reference = RunId("r".to_owned());
        let ids = [None, Some(&reference)].map(|reference| {
            let cell = CellIdentity::new(&picture, &measure, 7, &stop, reference);
            assert_eq!(cell.run_id(), identity::run_id(&cell.to_value()));
            assert_eq!(cell.to_value().as_map().unwrap().len(), 7);
            assert_eq!(cell.field("sampler").as_str(), Some("b"));
            cell.run_id()
        });
        assert_ne!(ids[0], ids[1]);
    }
}
