//! Values in files that JSON has no exact form for: numbers that may not be finite, and names in the
//! order in which they were written.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use serde::ser::{Serialize, Serializer};

/// A number that may be infinite or NaN, which are written as `"inf"`, `"-inf"` and `"NaN"`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Real(pub f64);

impl Serialize for Real {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() {
            to.serialize_f64(self.0)
        } else {
            to.collect_str(&self.0)
        }
    }
}

impl<'de> Deserialize<'de> for Real {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Real, D::Error> {
        from.deserialize_any(RealVisitor)
    }
}

struct RealVisitor;

impl Visitor<'_> for RealVisitor {
    type Value = Real;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, `inf`, `-inf` or `NaN`")
    }

    fn visit_f64<E>(self, x: f64) -> Result<Real, E> {
        Ok(Real(x))
    }

    fn visit_i64<E>(self, x: i64) -> Result<Real, E> {
        Ok(Real(x as f64))
    }

    fn visit_u64<E>(self, x: u64) -> Result<Real, E> {
        Ok(Real(x as f64))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Real, E> {
        match text {
            "inf" => Ok(Real(f64::INFINITY)),
            "-inf" => Ok(Real(f64::NEG_INFINITY)),
            "NaN" => Ok(Real(f64::NAN)),
            _ => Err(E::custom(format!("`{text}` is not a number"))),
        }
    }
}

/// Values by name, in the order in which they were written.
#[derive(Clone, Debug, PartialEq)]
pub struct Named<T>(pub Vec<(String, T)>);

impl<T> Default for Named<T> {
    fn default() -> Named<T> {
        Named(Vec::new())
    }
}

impl<T> Named<T> {
    /// The value with a name.
    pub fn get(&self, name: &str) -> Option<&T> {
        let found = self.0.iter().find(|(other, _)| other == name);
        found.map(|(_, value)| value)
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<T> FromIterator<(String, T)> for Named<T> {
    fn from_iter<I: IntoIterator<Item = (String, T)>>(values: I) -> Named<T> {
        Named(values.into_iter().collect())
    }
}

impl<T: Serialize> Serialize for Named<T> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Named<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Named<T>, D::Error> {
        from.deserialize_map(NamedVisitor(PhantomData))
    }
}

struct NamedVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for NamedVisitor<T> {
    type Value = Named<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("values by name")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Named<T>, A::Error> {
        let mut values = Vec::new();
        while let Some(entry) = entries.next_entry()? {
            values.push(entry);
        }
        Ok(Named(values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_to_the_same_bits_and_names_keep_their_order() {
        let values: Named<Real> = [
            ("z", 1.0 / 3.0),
            ("a", f64::INFINITY),
            ("m", -0.0),
            ("b", f64::NEG_INFINITY),
        ]
        .map(|(name, x)| (name.to_owned(), Real(x)))
        .into_iter()
        .collect();
        let text = serde_json::to_string(&values).unwrap();
        assert_eq!(
            text,
            r#"{"z":0.3333333333333333,"a":"inf","m":-0.0,"b":"-inf"}"#
        );
        let read: Named<Real> = serde_json::from_str(&text).unwrap();
        let bits = |named: &Named<Real>| -> Vec<(String, u64)> {
            let bits = named
                .0
                .iter()
                .map(|(name, x)| (name.clone(), x.0.to_bits()));
            bits.collect()
        };
        assert_eq!(bits(&read), bits(&values));
        let nan: Real = serde_json::from_str("\"NaN\"").unwrap();
        assert!(nan.0.is_nan());
        assert!(serde_json::from_str::<Real>("\"1e3\"").is_err());
    }
}
