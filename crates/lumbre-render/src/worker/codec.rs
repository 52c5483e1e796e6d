//! Encoding of messages: the binary format postcard, which `serde` drives. Both ends are the same
//! program, so fields are neither named nor tagged with their types.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Error: bytes that are not the encoding of the expected type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("corrupt message from worker")]
pub struct CorruptMessage;

/// Encodes a value.
///
/// # Panics
/// Panics if the value refuses to be written, which no message does.
pub fn encode(value: &impl Serialize) -> Vec<u8> {
    postcard::to_allocvec(value).expect("every message can be written")
}

/// Decodes a value from all of these bytes.
///
/// # Errors
/// Returns [`CorruptMessage`] if they encode no such value, or more than one.
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CorruptMessage> {
    match postcard::take_from_bytes(bytes) {
        Ok((value, [])) => Ok(value),
        _ => Err(CorruptMessage),
    }
}

/// Returns the backend of an error that arrived; the receiver knows the backend of its run.
pub fn backend_of_worker() -> &'static str {
    "worker"
}

/// Writes rows of static tables as their names.
macro_rules! names {
    ($($module:ident: $row:ty = $find:path),+ $(,)?) => { $(
        /// Serialisation of a row as its name.
        pub mod $module {
            use serde::de::{Deserialize, Deserializer, Error};
            use serde::ser::Serializer;

            /// Writes the name.
            pub fn serialize<S: Serializer>(row: &&'static $row, to: S) -> Result<S::Ok, S::Error> {
                to.serialize_str(row.name)
            }

            /// Reads a name and returns its row.
            pub fn deserialize<'de, D: Deserializer<'de>>(
                from: D,
            ) -> Result<&'static $row, D::Error> {
                let name = String::deserialize(from)?;
                $find(&name).ok_or_else(|| D::Error::custom("a name without a row"))
            }
        }
    )+ };
}

names! {
    integrator_name: lumbre_light::transport::integrator::IntegratorRow
        = lumbre_light::transport::integrator::integrator,
    sampler_name: lumbre_light::transport::sampler::SamplerRow
        = lumbre_light::transport::sampler::sampler,
}

/// Serialisation of settings as JSON text, because the types of parameters are not known beforehand.
pub mod json_text {
    use serde::de::{Deserialize, Deserializer, Error as _};
    use serde::ser::{Error as _, Serializer};

    use crate::Settings;

    /// Writes the settings.
    pub fn serialize<S: Serializer>(settings: &Settings, to: S) -> Result<S::Ok, S::Error> {
        let text = serde_json::to_string(settings).map_err(S::Error::custom)?;
        to.serialize_str(&text)
    }

    /// Reads the settings.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Settings, D::Error> {
        let text = String::deserialize(from)?;
        serde_json::from_str(&text).map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn values_round_trip_to_the_bit() {
        let value = (
            vec![Some(Vec3::new(1.0, -0.0, f32::NAN)), None],
            "\u{e8}".to_owned(),
            [7u64, u64::MAX],
            f64::from_bits(0x7ff8_0000_0000_1234),
        );
        type All = (Vec<Option<Vec3>>, String, [u64; 2], f64);
        let back: All = decode(&encode(&value)).unwrap();
        let bits = |all: &All| {
            let vectors: Vec<_> = all
                .0
                .iter()
                .map(|v| v.map(|v| v.to_array().map(f32::to_bits)))
                .collect();
            (vectors, all.1.clone(), all.2, all.3.to_bits())
        };
        assert_eq!(bits(&back), bits(&value));
    }

    #[test]
    fn truncated_and_continued_messages_are_corrupt() {
        let bytes = encode(&[1u64, 2]);
        assert!(decode::<[u64; 2]>(&bytes[..bytes.len() - 1]).is_err());
        assert!(decode::<[u64; 2]>(&[&bytes[..], &[0]].concat()).is_err());
        assert!(decode::<u8>(&[1, 2]).is_err());
        assert!(decode::<bool>(&[2]).is_err());
    }

    #[test]
    fn an_impossible_length_is_refused_without_its_memory() {
        let mut bytes = encode(&u64::MAX);
        bytes.push(1);
        assert!(decode::<Vec<u8>>(&bytes).is_err() && decode::<String>(&bytes).is_err());
        assert!(decode::<Vec<[f64; 3]>>(&encode(&(1u64 << 40))).is_err());
    }
}
