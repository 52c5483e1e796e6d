//! Settings of a run: the record [`Settings`], and the table [`SETTINGS`] of the keys by which
//! scripts set them. A new key is a field of the record and a row of the table.

mod camera;
pub mod find;
mod given;
mod keys;
pub mod named;
mod stored;

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

pub use self::camera::ENVIRONMENT_MAP;
pub use self::given::Given;
pub use self::keys::{EDGES, INTEGRATOR_NAMES, LIBRARY, SETTINGS, Setting, setting};
pub use self::stored::StoredSettings;
use crate::Job;
use crate::denoise::{Denoise, GUIDES};
use crate::hierarchy::AccelSpec;
use crate::shaders::Shaders;
use lumbre_light::film::layer::Layer;
use lumbre_light::transport::camera::FilterSpec;
use lumbre_light::transport::delay;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::sampler::{SAMPLER_NAMES, sampler};
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;

macro_rules! settings {
    ($(
        $(#[doc = $doc:literal])+
        $(#[serde($($attribute:tt)+)])*
        pub $field:ident $(as $stored:literal)?: $ty:ty,
    )+) => {
        /// Everything that decides the picture of a run, its cost, and what is kept of it, besides its
        /// seed and the number of its samples. In JSON it has the keys of [`Settings::STORED`].
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct Settings {
            $(
                $(#[doc = $doc])+
                $(#[serde(rename = $stored)])?
                $(#[serde($($attribute)+)])*
                pub $field: $ty,
            )+
            /// Backend that takes over if `backend` fails; present if the script asked for `auto`.
            /// Not stored.
            #[serde(skip)]
            pub fallback: Option<&'static str>,
        }

        impl Settings {
            /// Keys in JSON with their meaning.
            pub const STORED: &'static [(&'static str, &'static str)] = &[
                $((settings!(@key $field $($stored)?), concat!($($doc),+))),+
            ];
        }
    };
    (@key $field:ident) => { stringify!($field) };
    (@key $field:ident $stored:literal) => { $stored };
}

settings! {
    /// Scene as written in the script.
    pub scene: String,
    /// Resolved path of the scene file.
    #[serde(with = "stored::path")]
    pub scene_file: PathBuf,
    /// Values of the options that a Lua scene offers.
    pub scene_options: BTreeMap<String, Value>,
    /// Name of the integrator.
    pub integrator: String,
    /// Parameters of the integrator.
    pub params: BTreeMap<String, Value>,
    /// Greatest number of path edges; `null` for the value of the scene.
    pub max_depth: Option<u32>,
    /// Width and height in pixels; `null` for the value of the scene.
    pub resolution: Option<[u32; 2]>,
    /// First path edge with Russian roulette; `null` for never.
    pub rr_start: Option<u32>,
    /// Pixel reconstruction filter: its name `filter` and its `radius` in pixels.
    pub filter as "aa": FilterSpec,
    /// Names of the layers that are stored beside the picture.
    pub films: Vec<Layer>,
    /// Time axis of the film; `null` without one.
    #[serde(with = "stored::timing")]
    pub timing as "film": Option<Timing>,
    /// Denoiser with its settings. Only of runs that have one.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "stored::denoise")]
    pub denoise: Option<Denoise>,
    /// Name of the sampler.
    pub sampler: String,
    /// Settings of the bounding volume hierarchy.
    #[serde(with = "stored::accel")]
    pub accel: AccelSpec,
    /// Changes to the scene by path.
    pub set: BTreeMap<String, Value>,
    /// Folder of shaders that replaced those of the program: its path `folder`, and the `hash` of the
    /// files that differed. Only of runs that have one.
    #[serde(
        default = "stored::built_in_shaders",
        skip_serializing_if = "stored::has_no_folder",
        with = "stored::shaders"
    )]
    pub shaders: Shaders,
    /// Name of the backend.
    pub backend: String,
}

impl Settings {
    /// Returns the options of the scene and the changes to it, by name and path.
    pub fn scene_changes(&self) -> BTreeMap<String, Value> {
        let all = self.scene_options.iter().chain(&self.set);
        all.map(|(name, value)| (name.clone(), value.clone()))
            .collect()
    }

    /// Returns the settings of an integrator with the defaults of scripts: default parameters, no
    /// roulette, a box filter of one pixel, the independent sampler. They name no scene.
    pub fn new(integrator: &str) -> Settings {
        Settings {
            scene: String::new(),
            scene_file: PathBuf::new(),
            scene_options: BTreeMap::new(),
            integrator: integrator.to_owned(),
            params: BTreeMap::new(),
            max_depth: None,
            resolution: None,
            rr_start: None,
            filter: FilterSpec::PIXEL,
            films: Vec::new(),
            timing: None,
            denoise: None,
            sampler: SAMPLER_NAMES[0].to_owned(),
            accel: AccelSpec::default(),
            set: BTreeMap::new(),
            shaders: Shaders::Unset,
            backend: "auto".to_owned(),
            fallback: None,
        }
    }

    /// Returns the layers that are rendered: those that are stored, and the guides of a denoiser.
    pub fn rendered_layers(&self) -> Vec<Layer> {
        let guides = self.denoise.iter().flat_map(|_| GUIDES);
        let others = guides.filter(|guide| !self.films.contains(guide));
        self.films.iter().copied().chain(others).collect()
    }

    /// Returns what of the settings determines the picture and its measurements, in canonical form:
    /// the part of a run's identity that its settings decide. They must be fully resolved.
    pub fn identity(&self) -> BTreeMap<String, Value> {
        let entries = SETTINGS.iter().filter_map(|row| (row.identity)(self));
        // Delays of materials have an effect on path times alone.
        let delays = ("delays", Value::Int(i64::from(delay::REVISION)));
        let delays = self.timing.is_some().then_some(delays);
        let entries = entries.chain(delays);
        entries
            .map(|(key, value)| (key.to_owned(), value))
            .collect()
    }

    /// Returns the job that renders these settings with `threads` threads (0: one per core), with
    /// seed 0 from the first sample. `resolution` and `max_depth` are those of the scene, which
    /// apply where the settings leave them open.
    ///
    /// # Errors
    /// Returns a message if this version has no such integrator or sampler.
    pub fn job(&self, resolution: [u32; 2], max_depth: u32, threads: usize) -> Result<Job, String> {
        let name = &self.integrator;
        Ok(Job {
            integrator: integrator(name)
                .ok_or_else(|| format!("there is no integrator `{name}`"))?,
            sampler: sampler(&self.sampler)
                .ok_or_else(|| format!("there is no sampler `{}`", self.sampler))?,
            resolution: self.resolution.unwrap_or(resolution),
            max_depth: self.max_depth.unwrap_or(max_depth),
            settings: self.clone(),
            seed: 0,
            first_sample: 0,
            threads,
            view: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guides_are_rendered_once_and_only_for_a_denoiser() {
        let stored = [Layer::Normal, Layer::Rays];
        let mut settings = Settings {
            films: stored.to_vec(),
            ..Settings::new("nee")
        };
        assert_eq!(settings.rendered_layers(), stored);
        settings.denoise = Denoise::from_name("atrous", &BTreeMap::new());
        assert_eq!(
            settings.rendered_layers(),
            [Layer::Normal, Layer::Rays, Layer::Albedo]
        );
    }
}
