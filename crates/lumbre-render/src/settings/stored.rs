//! Forms in JSON of settings whose own type has another one.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::Settings;
use crate::denoise::Denoise;
use crate::hierarchy::AccelSpec;
use crate::shaders::{ShaderFolder, Shaders};
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;

type Map = BTreeMap<String, Value>;

/// Settings as a file holds them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum StoredSettings {
    /// Settings that this version knows.
    Known(Box<Settings>),
    /// Settings of another version, of which a name or a value is not known to this one.
    Unknown(BTreeMap<String, Value>),
}

impl StoredSettings {
    /// Returns the name of the integrator; empty if there is none.
    pub fn integrator(&self) -> &str {
        match self {
            StoredSettings::Known(settings) => &settings.integrator,
            StoredSettings::Unknown(map) => {
                let name = map.get("integrator").and_then(Value::as_str);
                name.unwrap_or_default()
            }
        }
    }

    /// Returns the settings, if this version knows them.
    pub fn known(&self) -> Option<&Settings> {
        match self {
            StoredSettings::Known(settings) => Some(settings),
            StoredSettings::Unknown(_) => None,
        }
    }
}

impl Default for StoredSettings {
    fn default() -> StoredSettings {
        StoredSettings::Unknown(BTreeMap::new())
    }
}

/// Writes and reads a setting in the form that two functions convert it to and from.
macro_rules! form {
    ($(#[doc = $doc:literal])+ $module:ident: $ty:ty = $form:ty, $to:expr, $from:expr) => {
        $(#[doc = $doc])+
        pub(super) mod $module {
            use super::*;

            pub fn serialize<S: serde::Serializer>(from: &$ty, to: S) -> Result<S::Ok, S::Error> {
                let form: $form = $to(from);
                form.serialize(to)
            }

            pub fn deserialize<'de, D: serde::Deserializer<'de>>(from: D) -> Result<$ty, D::Error> {
                let form = <$form>::deserialize(from)?;
                let read: Option<$ty> = $from(form);
                read.ok_or_else(|| {
                    let name = stringify!($module);
                    serde::de::Error::custom(format!("this version does not know this {name}"))
                })
            }
        }
    };
}

form! {
    /// A path as text.
    path: PathBuf = String, |path: &PathBuf| path.display().to_string(), |text| Some(PathBuf::from(text))
}

form! {
    /// A time axis as the table `film` of scripts.
    timing: Option<Timing> = Option<Value>,
    |timing: &Option<Timing>| timing.as_ref().map(|timing| timing.to_film(true)),
    |film: Option<Value>| match film {
        None => Some(None),
        Some(film) => Timing::from_film(film.as_map()?, "film").ok(),
    }
}

form! {
    /// A denoiser with its settings.
    denoise: Option<Denoise> = Option<Value>,
    |denoise: &Option<Denoise>| denoise.as_ref().map(Denoise::to_value),
    |form: Option<Value>| match form {
        None => Some(None),
        Some(form) => Denoise::from_value(&form).map(Some),
    }
}

form! {
    /// Those settings of a hierarchy that differ from the default.
    accel: AccelSpec = Map, AccelSpec::identity, |map| Some(AccelSpec::from_identity(&map))
}

/// A folder of shaders in JSON.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredFolder {
    folder: String,
    hash: String,
}

form! {
    /// A folder of shaders.
    shaders: Shaders = StoredFolder,
    |shaders: &Shaders| {
        let folder = shaders.folder().cloned().unwrap_or_default();
        StoredFolder { folder: folder.path.display().to_string(), hash: folder.hash }
    },
    |stored: StoredFolder| {
        let path = PathBuf::from(stored.folder);
        Some(Shaders::Folder(ShaderFolder { path, hash: stored.hash }))
    }
}

/// Whether shaders are those of the program, which are not stored.
pub(super) fn has_no_folder(shaders: &Shaders) -> bool {
    shaders.folder().is_none()
}

/// Shaders of runs whose file names none.
pub(super) fn built_in_shaders() -> Shaders {
    Shaders::BuiltIn
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::film::layer::LAYERS;
    use lumbre_light::transport::camera::FilterKind;

    /// Settings of every kind, as files hold them.
    const STORED: &str = r#"{"scene":"box","scene_file":"s/box.scn","scene_options":{"light":"sun"},
"integrator":"nee","params":{"mis":"power"},"max_depth":5,"resolution":[8,4],"rr_start":3,
"aa":{"filter":"blackman_harris","radius":1.5},"films":["depth","normal"],
"film":{"time":{"bin":0.1,"bins":8,"camera":true,"emission":{"profile":"none"},"filter":"none",
"medium":1,"radius":0.5,"start":0}},"denoise":{"filter":"oidn","version":"2.3"},
"sampler":"sobol","accel":{"lanes":"auto","quality":"high"},"set":{"camera.fov":30},
"shaders":{"folder":"mine","hash":"ab"},"backend":"vulkan"}"#;

    #[test]
    fn settings_are_read_as_they_were_written() {
        let json: serde_json::Value = serde_json::from_str(STORED).unwrap();
        let stored: StoredSettings = serde_json::from_value(json.clone()).unwrap();
        let settings = stored.known().expect("all of it is known");
        assert_eq!(settings.rr_start, Some(3));
        assert_eq!(settings.filter.radius, 1.5);
        assert_eq!(settings.timing.as_ref().unwrap().axis.bins, 8);
        assert_eq!(settings.shaders.folder().unwrap().hash, "ab");
        let back = serde_json::to_value(settings).unwrap();
        let again: Settings = serde_json::from_value(back.clone()).unwrap();
        assert_eq!(
            (&again, &back),
            (settings, &serde_json::to_value(&again).unwrap())
        );
        let keys = |json: &serde_json::Value| {
            let keys = json.as_object().unwrap().keys().cloned();
            keys.collect::<Vec<String>>()
        };
        assert_eq!(keys(&back), keys(&json));
        let documented = Settings::STORED.iter().map(|(key, _)| (*key).to_owned());
        assert_eq!(documented.collect::<Vec<_>>(), keys(&json));
        let plain = serde_json::to_value(Settings::new("nee")).unwrap();
        assert!(plain.get("denoise").is_none() && plain.get("shaders").is_none());
        let plain: Settings = serde_json::from_value(plain).unwrap();
        assert_eq!(plain.shaders, Shaders::BuiltIn);
    }

    #[test]
    fn settings_of_other_versions_are_kept_but_not_known() {
        for (known, other) in [
            ("\"depth\"", "\"smell\""),
            ("blackman_harris", "round"),
            ("\"oidn\"", "\"magic\""),
            ("\"set\"", "\"unset\""),
        ] {
            let text = STORED.replace(known, other);
            let stored: StoredSettings = serde_json::from_str(&text).unwrap();
            assert!(stored.known().is_none(), "{other}");
            assert_eq!(stored.integrator(), "nee");
        }
        assert!(serde_json::from_str::<StoredSettings>("5").is_err());
    }

    #[test]
    fn names_in_json_are_those_of_scripts() {
        for kind in FilterKind::ALL {
            let name = kind.name();
            assert_eq!(serde_json::to_value(kind).unwrap(), name);
        }
        for row in LAYERS {
            assert_eq!(serde_json::to_value(row.layer).unwrap(), row.name);
        }
    }
}
