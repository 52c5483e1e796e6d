//! Settings of a film's time axis, and their conversion from and to script tables.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::delay::Profile;
use crate::film::time::{TimeAxis, TimeFilter};
use crate::scene::desc::{DelayDesc, DelayKind, MaterialDesc, delay};
use crate::value::Value;
use crate::value::schema::{Field, SchemaError, Table, Ty};

/// Settings of a film's time axis that affect light transport.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// The time bins.
    pub axis: TimeAxis,
    /// Filter that spreads contributions over the bins.
    pub filter: TimeFilter,
    /// Whether the segment between the camera and the first surface counts.
    pub camera: bool,
    /// Index of refraction of the medium around the camera.
    pub medium: f32,
    /// Time of emission: the profile of the lights' pulse.
    pub emission: Profile,
    /// Metres per scene unit, for times in seconds; 0 if unspecified. Affects labels only.
    pub metres: f64,
}

/// Maximum optical length in scene units.
const FAR: f64 = 1e9;

/// The speed of light in vacuum, in metres per second.
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

const fn number(
    key: &'static str,
    [min, max]: [f64; 2],
    default: &'static str,
    doc: &'static str,
) -> Field {
    Field {
        key,
        ty: Ty::Num { min, max },
        required: false,
        default,
        doc,
    }
}

/// Schema of `emission` in the time table.
pub const EMISSION: Table = Table {
    name: "EmissionProfile",
    doc: "Time of emission of lights: the profile of their pulse, with the parameters of a \
          material's delay.",
    fields: &[
        crate::field! {
            profile: Ty::Word(DelayKind::NAMES),
                "emission at time 0, at a constant time, or at a time drawn from a distribution"
        },
        number(
            "constant",
            [0.0, FAR],
            "0",
            "time of emission of a constant profile, in scene units",
        ),
        number(
            "rate",
            [1e-9, FAR],
            "1",
            "rate of an exponential profile, in 1 / scene unit",
        ),
        number(
            "mean",
            [0.0, FAR],
            "1",
            "mean of an epanechnikov profile, in scene units",
        ),
        number(
            "width",
            [1e-9, FAR],
            "1",
            "half of the extent of an epanechnikov profile, at most the mean",
        ),
        crate::field! {
            table = "": Ty::List(&Ty::num(0.0, FAR)),
                "alternating times and densities of a table profile"
        },
    ],
};

/// Schema of `time` in the film table.
pub const TIME: Table = Table {
    name: "TimeAxis",
    doc: "Bins of optical length, in scene units: distance times index of refraction, summed over \
          a path, plus all delays.",
    fields: &[
        number(
            "start",
            [-FAR, FAR],
            "0",
            "start of the first bin; earlier light is stored in an underflow slot",
        ),
        crate::field! {
            bin: Ty::num(1e-9, FAR),
                "width of a bin; a bin stores radiance that is not divided by the width"
        },
        crate::field! {
            bins: Ty::int(1, 1_000_000),
                "number of bins; light after the last one is stored in an overflow slot"
        },
        crate::field! {
            camera = "true": Ty::Bool,
                "whether the segment from the first surface to the camera counts; false shows \
                 light as it passes over surfaces"
        },
        number(
            "medium",
            [0.01, 100.0],
            "1",
            "index of refraction of the medium around the camera",
        ),
        crate::field! {
            filter = "none": Ty::Word(TimeFilter::WORDS),
                "how a contribution is spread over the bins about its time: not at all, evenly, or \
                 by a Gaussian truncated at three sigma"
        },
        number(
            "radius",
            [0.0, 1000.0],
            "0.5",
            "half width of the box, or sigma of the Gaussian, in bins",
        ),
        crate::field! {
            emission = "a pulse at 0": Ty::Table(&EMISSION), "time of emission of lights"
        },
        number(
            "metres",
            [0.0, 1e30],
            "unspecified",
            "metres per scene unit, for labels in seconds: 1 m of optical length is 3.3356 ns",
        ),
    ],
};

crate::table! {
    /// Schema of `film` in the render table.
    pub const FILM = "FilmOptions", "What the film stores besides the picture.";
    time = "none": Ty::Table(&TIME),
        "a time axis: the light of every pixel, binned by the optical length of its path";
}

impl Timing {
    /// Returns a time axis with script defaults for everything else.
    pub fn plain(axis: TimeAxis) -> Timing {
        Timing {
            axis,
            filter: TimeFilter::None,
            camera: true,
            medium: 1.0,
            emission: Profile::NONE,
            metres: 0.0,
        }
    }

    /// Parses the table `film`, which must satisfy [`FILM`]; `None` without a time axis. `path` is
    /// prepended to fields in errors.
    ///
    /// # Errors
    /// Returns an error if the parameters of the emission profile contradict each other.
    pub fn from_film(
        film: &BTreeMap<String, Value>,
        path: &str,
    ) -> Result<Option<Timing>, SchemaError> {
        let Some(time) = film.get("time").and_then(Value::as_map) else {
            return Ok(None);
        };
        let number =
            |key: &str, default: f64| time.get(key).and_then(Value::as_f64).unwrap_or(default);
        let word = time.get("filter").and_then(Value::as_str).unwrap_or("none");
        let emission = match time.get("emission").and_then(Value::as_map) {
            Some(map) => emission(map, &format!("{path}.time.emission"))?,
            None => Profile::NONE,
        };
        Ok(Some(Timing {
            axis: TimeAxis {
                start: number("start", 0.0),
                bin: number("bin", 1.0),
                bins: number("bins", 1.0) as u32,
            },
            filter: TimeFilter::from_name(word, number("radius", 0.5)).unwrap_or(TimeFilter::None),
            camera: time.get("camera") != Some(&Value::Bool(false)),
            medium: number("medium", 1.0) as f32,
            emission,
            metres: number("metres", 0.0),
        }))
    }

    /// Returns the table `film` for this axis. Without `labels` it contains only what affects
    /// pictures: the axis' part of a run's identity.
    pub fn to_film(&self, labels: bool) -> Value {
        let (filter, radius) = self.filter.name_and_size();
        let mut time = vec![
            ("start", Value::number(self.axis.start)),
            ("bin", Value::number(self.axis.bin)),
            ("bins", Value::Int(i64::from(self.axis.bins))),
            ("camera", Value::Bool(self.camera)),
            ("medium", Value::number(f64::from(self.medium))),
            ("filter", filter.into()),
            ("radius", Value::number(radius)),
            ("emission", profile_value(&self.emission)),
        ];
        if labels && self.metres > 0.0 {
            time.push(("metres", Value::number(self.metres)));
        }
        Value::from_iter([("time", Value::from_iter(time))])
    }

    /// Returns the seconds that light takes for the optical length of one scene unit; `None` if the
    /// scene unit has no length.
    pub fn seconds(&self) -> Option<f64> {
        (self.metres > 0.0).then(|| self.metres / SPEED_OF_LIGHT)
    }
}

fn emission(map: &BTreeMap<String, Value>, path: &str) -> Result<Profile, SchemaError> {
    let number = |key: &str, default: f32| {
        map.get(key)
            .and_then(Value::as_f64)
            .map_or(default, |x| x as f32)
    };
    let word = map.get("profile").and_then(Value::as_str).unwrap_or("none");
    let kind = DelayKind::from_name(word).unwrap_or(DelayKind::None);
    let table = map
        .get("table")
        .and_then(Value::as_list)
        .unwrap_or_default();
    let desc = DelayDesc {
        kind,
        constant: [number("constant", 0.0), 0.0],
        rate: [number("rate", 1.0), 0.0],
        mean: [number("mean", 1.0), 0.0],
        width: [number("width", 1.0), 0.0],
        table: table
            .iter()
            .filter_map(Value::as_f64)
            .map(|x| x as f32)
            .collect(),
    };
    // An emission profile obeys the same rules as a material's delay.
    let material = MaterialDesc {
        delay: desc,
        ..MaterialDesc::new("")
    };
    delay::check_profile(&material).map_err(|e| SchemaError {
        path: format!("{path}.{}", e.key.trim_start_matches("delay_")),
        key: e.key.trim_start_matches("delay_").to_owned(),
        ..e
    })?;
    Ok(Profile::of(&material.delay))
}

fn profile_value(profile: &Profile) -> Value {
    let (kind, params, table) = profile.to_parts();
    let desc = DelayDesc {
        kind,
        ..DelayDesc::default()
    };
    let numbers = desc
        .params()
        .iter()
        .zip(params)
        .map(|((name, ..), x)| (*name, Value::number(f64::from(x))));
    let pairs = table.map(|table| {
        (
            "table",
            Value::List(table.pairs().flatten().map(Value::number).collect()),
        )
    });
    let fields = numbers
        .chain(pairs)
        .chain([("profile", kind.name().into())]);
    Value::Map(
        fields
            .map(|(k, v)| (k.trim_start_matches("delay_").to_owned(), v))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use crate::transport::time_settings::*;

    fn film(time: &[(&str, Value)]) -> BTreeMap<String, Value> {
        let time = time
            .iter()
            .map(|(k, v)| ((*k).to_owned(), v.clone()))
            .collect();
        BTreeMap::from([("time".to_owned(), Value::Map(time))])
    }

    fn emission(pairs: &[(&str, Value)]) -> Value {
        Value::Map(
            pairs
                .iter()
                .map(|(k, v)| ((*k).to_owned(), v.clone()))
                .collect(),
        )
    }

    /// Returns one emission profile of each kind.
    fn profiles() -> [Value; 4] {
        let table = Value::List([0, 1, 2, 3].map(Value::Int).to_vec());
        [
            emission(&[
                ("profile", "constant".into()),
                ("constant", Value::Num(1.5)),
            ]),
            emission(&[("profile", "exponential".into()), ("rate", Value::Num(0.5))]),
            emission(&[
                ("profile", "epanechnikov".into()),
                ("mean", Value::Num(0.5)),
                ("width", Value::Num(0.25)),
            ]),
            emission(&[("profile", "table".into()), ("table", table)]),
        ]
    }

    #[test]
    fn a_time_axis_is_read_and_written_back() {
        assert_eq!(Timing::from_film(&BTreeMap::new(), "film"), Ok(None));
        let bins = [("bin", Value::Num(0.5)), ("bins", Value::Int(40))];
        let plain = Timing::from_film(&film(&bins), "film").unwrap().unwrap();
        assert_eq!(
            plain.axis,
            TimeAxis {
                start: 0.0,
                bin: 0.5,
                bins: 40
            }
        );
        assert!(
            plain.camera
                && plain.medium == 1.0
                && plain.filter == TimeFilter::None
                && plain.seconds().is_none()
        );
        for profile in profiles() {
            let film = film(&[
                bins[0].clone(),
                bins[1].clone(),
                ("camera", Value::Bool(false)),
                ("filter", "gauss".into()),
                ("radius", Value::Num(1.5)),
                ("medium", Value::Num(1.5)),
                ("metres", Value::Int(1)),
                ("emission", profile),
            ]);
            FILM.check("film", &film).unwrap();
            let timing = Timing::from_film(&film, "film").unwrap().unwrap();
            let Value::Map(back) = timing.to_film(true) else {
                panic!("a table")
            };
            FILM.check("film", &back).unwrap();
            assert_eq!(Timing::from_film(&back, "film").unwrap().unwrap(), timing);
            assert!((timing.seconds().unwrap() * 1e9 - 3.335_640_95).abs() < 1e-6);
            let Value::Map(identity) = timing.to_film(false) else {
                panic!("a table")
            };
            assert_eq!(
                Timing::from_film(&identity, "film").unwrap().unwrap(),
                Timing {
                    metres: 0.0,
                    ..timing
                }
            );
        }
    }

    #[test]
    fn emission_that_begins_before_it_does_is_refused_by_name() {
        let early = emission(&[
            ("profile", "epanechnikov".into()),
            ("mean", Value::Num(0.1)),
            ("width", Value::Num(0.2)),
        ]);
        let said = film(&[
            ("bin", Value::Num(0.5)),
            ("bins", Value::Int(40)),
            ("emission", early),
        ]);
        let error = Timing::from_film(&said, "render.film").unwrap_err();
        assert!(
            error.path == "render.film.time.emission.mean"
                && error.problem.contains("below the width"),
            "{error}"
        );
    }
}
