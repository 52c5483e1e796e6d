//! Tone maps: from linear radiance to display values in 0..=1.

use std::collections::BTreeMap;
use std::fmt;

use rayon::prelude::*;

use lumbre_light::field;
use lumbre_light::film::Image;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{Field, SchemaError, Table, Ty, unknown_name};

/// A named tone map with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tonemap {
    /// `clamp(2^exposure * x)` with the sRGB transfer curve.
    Srgb {
        /// Exposure in stops.
        exposure: f32,
    },
    /// `clamp(2^exposure * x)^(1/gamma)` per channel.
    Gamma {
        /// Exposure in stops.
        exposure: f32,
        /// Gamma of the display.
        gamma: f32,
    },
    /// `y = 2^exposure * x; (y / (1 + y))^(1/gamma)` per channel [Reinhard 2002].
    Reinhard {
        /// Exposure in stops.
        exposure: f32,
        /// Gamma of the display.
        gamma: f32,
    },
}

const EXPOSURE: Field = field! {
    exposure = "0": Ty::num(-64.0, 64.0), "stops: radiance is multiplied by 2^exposure first"
};

const GAMMA: Field = field! {
    gamma = "2.2": Ty::num(0.1, 10.0), "display gamma: values are raised to 1 / gamma last"
};

/// All tone maps: name in scripts, and schema of the parameters (the key `kind` holds the name).
pub const TONEMAPS: &[(&str, Table)] = &[
    (
        "srgb",
        Table {
            name: "SrgbParams",
            doc: "Multiply by 2^exposure, clamp to 0..1, apply the sRGB transfer curve [IEC 61966-2-1].",
            fields: &[EXPOSURE],
        },
    ),
    (
        "gamma",
        Table {
            name: "GammaParams",
            doc: "Multiply by 2^exposure, clamp to 0..1, raise to 1 / gamma.",
            fields: &[EXPOSURE, GAMMA],
        },
    ),
    (
        "reinhard",
        Table {
            name: "ReinhardParams",
            doc: "Multiply by 2^exposure, then (y / (1 + y))^(1 / gamma) per channel [Reinhard 2002].",
            fields: &[EXPOSURE, GAMMA],
        },
    ),
];

impl Tonemap {
    /// Reads a tone map from a table with the key `kind` and the parameters of that kind.
    ///
    /// # Errors
    /// When the value is no such table, the kind is unknown, or a parameter is unknown or out of
    /// range; error paths begin with `path`.
    pub fn from_value(path: &str, value: &Value) -> Result<Tonemap, SchemaError> {
        let kind = value
            .as_map()
            .and_then(|map| map.get("kind"))
            .and_then(Value::as_str);
        let (Some(map), Some(kind)) = (value.as_map(), kind) else {
            return Err(SchemaError::new(
                path,
                path.rsplit('.').next().unwrap_or(path).to_owned(),
                format!("expected a tone map, found {} `{value}`", value.kind()),
            )
            .with_help(format!(
                "known tone maps: {}",
                names().collect::<Vec<_>>().join(", ")
            )));
        };
        let Some((_, table)) = TONEMAPS.iter().find(|(name, _)| *name == kind) else {
            return Err(unknown_name(path, kind, "tone map", names()));
        };
        let params: BTreeMap<String, Value> = map
            .iter()
            .filter(|(key, _)| *key != "kind")
            .map(|(k, v)| (k.clone(), v.clone()))
            .collect();
        table.check(path, &params)?;
        let get = |field: Field| -> f32 {
            let given = params
                .get(field.key)
                .and_then(Value::as_f64)
                .map(|x| x as f32);
            given
                .or_else(|| field.default.parse().ok())
                .unwrap_or(f32::NAN)
        };
        Ok(match kind {
            "srgb" => Tonemap::Srgb {
                exposure: get(EXPOSURE),
            },
            "gamma" => Tonemap::Gamma {
                exposure: get(EXPOSURE),
                gamma: get(GAMMA),
            },
            _ => Tonemap::Reinhard {
                exposure: get(EXPOSURE),
                gamma: get(GAMMA),
            },
        })
    }

    /// Returns name and all parameters in the form that [`Tonemap::from_value`] reads.
    pub fn to_value(&self) -> Value {
        let params = self.params().map(|(key, x)| (key.to_owned(), decimal(x)));
        Value::Map(
            params
                .chain([("kind".to_owned(), self.name().into())])
                .collect(),
        )
    }

    /// Name of the tone map in scripts.
    pub fn name(&self) -> &'static str {
        match self {
            Tonemap::Srgb { .. } => "srgb",
            Tonemap::Gamma { .. } => "gamma",
            Tonemap::Reinhard { .. } => "reinhard",
        }
    }

    fn params(&self) -> impl Iterator<Item = (&'static str, f32)> {
        let (exposure, gamma) = match *self {
            Tonemap::Srgb { exposure } => (exposure, None),
            Tonemap::Gamma { exposure, gamma } | Tonemap::Reinhard { exposure, gamma } => {
                (exposure, Some(gamma))
            }
        };
        [
            Some((EXPOSURE.key, exposure)),
            gamma.map(|g| (GAMMA.key, g)),
        ]
        .into_iter()
        .flatten()
    }

    /// Maps an image of linear radiance to display values in 0..=1. Negative radiance becomes 0,
    /// infinite radiance 1; NaN stays NaN.
    pub fn apply(&self, image: &Image) -> Image {
        let mut data = image.data.clone();
        let rows = data.par_chunks_mut((image.width as usize).max(1));
        match *self {
            Tonemap::Srgb { exposure } => {
                let scale = exposure.exp2();
                rows.for_each(|row| {
                    row.as_flattened_mut()
                        .iter_mut()
                        .for_each(|x| *x = srgb(*x * scale))
                });
            }
            Tonemap::Gamma { exposure, gamma } => {
                let (scale, power) = (exposure.exp2(), 1.0 / gamma);
                rows.for_each(|row| {
                    row.as_flattened_mut()
                        .iter_mut()
                        .for_each(|x| *x = (*x * scale).clamp(0.0, 1.0).powf(power));
                });
            }
            Tonemap::Reinhard { exposure, gamma } => {
                let (scale, power) = (exposure.exp2(), 1.0 / gamma);
                rows.for_each(|row| {
                    row.as_flattened_mut()
                        .iter_mut()
                        .for_each(|x| *x = reinhard(*x * scale, power))
                });
            }
        }
        Image::from_pixels(image.width, image.height, data)
    }
}

impl fmt::Display for Tonemap {
    /// Text for captions, such as `reinhard (exposure 0, gamma 2.2)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let params: Vec<String> = self.params().map(|(key, x)| format!("{key} {x}")).collect();
        write!(f, "{} ({})", self.name(), params.join(", "))
    }
}

fn names() -> impl Iterator<Item = &'static str> {
    TONEMAPS.iter().map(|(name, _)| *name)
}

/// Shortest decimal that denotes this `f32`, so that 2.2 is written 2.2 and not 2.200000047683716.
fn decimal(x: f32) -> Value {
    Value::number(x.to_string().parse().unwrap_or(f64::from(x)))
}

/// Applies the sRGB transfer curve [IEC 61966-2-1] to linear light, after a clamp to 0..=1.
pub fn srgb(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    }
}

/// Returns the linear light of an sRGB display value clamped to 0..=1; the inverse of [`srgb`].
pub fn srgb_light(v: f32) -> f32 {
    let v = v.clamp(0.0, 1.0);
    if v <= 0.040_45 {
        v / 12.92
    } else {
        ((v + 0.055) / 1.055).powf(2.4)
    }
}

fn reinhard(x: f32, power: f32) -> f32 {
    let x = x.clamp(0.0, f32::MAX);
    (x / (1.0 + x)).powf(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(pairs: &[(&str, Value)]) -> Value {
        Value::Map(
            pairs
                .iter()
                .map(|(k, v)| ((*k).to_owned(), v.clone()))
                .collect(),
        )
    }

    #[test]
    fn values_round_trip_with_defaults_filled_in() {
        let reinhard = Tonemap::from_value("on", &map(&[("kind", "reinhard".into())])).unwrap();
        assert_eq!(
            reinhard,
            Tonemap::Reinhard {
                exposure: 0.0,
                gamma: 2.2
            }
        );
        assert_eq!(
            reinhard.to_value().to_string(),
            "{exposure = 0, gamma = 2.2, kind = reinhard}"
        );
        for (name, _) in TONEMAPS {
            let tonemap = Tonemap::from_value(
                "on",
                &map(&[("kind", (*name).into()), ("exposure", 0.1.into())]),
            )
            .unwrap();
            assert_eq!(tonemap.name(), *name);
            assert_eq!(
                Tonemap::from_value("on", &tonemap.to_value()).unwrap(),
                tonemap
            );
        }
    }

    #[test]
    fn wrong_tone_maps_are_explained() {
        let e = Tonemap::from_value("measure.display", &Value::Int(3)).unwrap_err();
        assert_eq!(
            (e.path.as_str(), e.key.as_str()),
            ("measure.display", "display")
        );
        assert!(e.problem.contains("an integer `3`"), "{e}");
        let e = Tonemap::from_value(
            "on",
            &map(&[("kind", "srgb".into()), ("gamma", 2.2.into())]),
        )
        .unwrap_err();
        assert_eq!(e.path, "on.gamma");
        let e = Tonemap::from_value(
            "on",
            &map(&[("kind", "reinhard".into()), ("gamma", 0.0.into())]),
        )
        .unwrap_err();
        assert!(e.problem.contains("between 0.1 and 10"), "{e}");
    }

    #[test]
    fn known_values_and_limits() {
        let one = |tonemap: Tonemap, x: f32| {
            tonemap.apply(&Image::from_fn(1, 1, |_, _| [x; 3])).at(0, 0)[1]
        };
        let srgb = Tonemap::Srgb { exposure: 1.0 };
        // Linear 0.5 is 0.735357 in sRGB.
        assert!((one(srgb, 0.25) - 0.735_357).abs() < 1e-5);
        let reinhard = Tonemap::Reinhard {
            exposure: 0.0,
            gamma: 2.0,
        };
        assert!((one(reinhard, 1.0) - 0.5f32.sqrt()).abs() < 1e-6);
        let gamma = Tonemap::Gamma {
            exposure: 0.0,
            gamma: 2.0,
        };
        assert!((one(gamma, 0.25) - 0.5).abs() < 1e-6 && one(gamma, 4.0) == 1.0);
        for tonemap in [srgb, gamma, reinhard] {
            assert_eq!(one(tonemap, -1.0), 0.0);
            assert!((one(tonemap, f32::INFINITY) - 1.0).abs() < 1e-6);
            assert!(one(tonemap, f32::NAN).is_nan());
        }
    }
}
