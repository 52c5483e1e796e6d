//! Scenes, techniques, metrics and durations of the suite. A change of any of them, or of a scene
//! file, raises [`SUITE_VERSION`](super::result::SUITE_VERSION).

use std::collections::BTreeMap;
use std::sync::Arc;

use super::result::SuiteSettings;
use crate::cli::args::BenchArgs;
use crate::cli::scene::builtin::BuiltIn;
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::value::Value;
use lumbre_light::value::schema::SchemaError;
use lumbre_metrics::MetricSpec;
use lumbre_scene_io::edit;
use lumbre_scene_io::load::MissingTextures;

/// Techniques of the suite, as in table 5.2 of thesis S0.
pub const TECHNIQUES: [&str; 3] = ["bpt", "nee", "bdpt"];

/// Width and height of the pictures in pixels.
const RESOLUTION: [u32; 2] = [240, 135];

/// Greatest number of path edges, as in the tables of thesis S0.
const MAX_DEPTH: u32 = 5;

/// Number of runs of each measurement.
const REPEATS: u32 = 5;

/// Render time of a run in seconds.
const RUN_S: f64 = 2.0;

/// Render times at which errors are compared, as fractions of [`RUN_S`]. The first suits devices
/// whose pictures are soon better than a reference can tell, the second processors.
const EQUAL_TIMES: [f64; 2] = [0.05, 1.0];

/// Share of the render times and of the samples of references with `--quick`.
const QUICK_SHARE: f64 = 0.05;

/// Greatest duration of the suite on two cores and one backend in seconds: 510 s for references,
/// 330 s for runs, about 60 s for scenes, pictures and metrics, and a reserve for slower cores.
const BUDGET_S: f64 = 20.0 * 60.0;

/// Least number of samples of a reference, one for each of its halves.
const LEAST_REFERENCE_SAMPLES: u64 = 2;

/// Metric whose values are divided by the mean radiance of the reference.
pub const RELATIVE_RMSE: &str = "relative_rmse";

/// A metric of the suite.
pub struct SuiteMetric {
    /// The metric; its column is its name in files.
    pub spec: MetricSpec,
    /// Name in tables.
    pub label: &'static str,
    /// Value of which the time until it is reached is measured.
    pub threshold: f64,
}

impl SuiteMetric {
    /// Returns a value without the noise of its reference, whose value for the true image is
    /// `floor`, where that can be subtracted.
    pub fn net(&self, value: f64, floor: Option<f64>) -> f64 {
        let net = floor.and_then(|floor| self.spec.net(value, floor));
        net.unwrap_or(value)
    }
}

/// Returns the metrics of the suite.
///
/// # Errors
/// Returns a message if the program lacks one of them.
pub fn metrics() -> Result<Vec<SuiteMetric>, String> {
    let rmse = MetricSpec::new(RELATIVE_RMSE, "rmse", BTreeMap::new());
    // Pictures are compared as they are displayed, as in thesis S0.
    let display = [("kind", Value::from("gamma")), ("gamma", Value::from(2.2))];
    let options = BTreeMap::from([("on".to_owned(), Value::from_iter(display))]);
    let ssim = MetricSpec::new("ssim", "ssim", options);
    let rows = [(rmse, "relative RMSE", 0.25), (ssim, "SSIM", 0.8)];
    let metric = |(spec, label, threshold): (Result<MetricSpec, SchemaError>, _, _)| {
        Ok(SuiteMetric {
            spec: spec.map_err(|e| e.to_string())?,
            label,
            threshold,
        })
    };
    rows.into_iter().map(metric).collect()
}

/// A scene of the suite with one of its lights.
pub struct SuiteScene {
    /// Name in files and tables.
    pub name: &'static str,
    /// Built-in Lua file.
    file: &'static str,
    /// Options of the file.
    options: &'static [(&'static str, &'static str)],
    /// View that replaces the first one of the file.
    view: Option<&'static str>,
    /// Colours that make the light.
    colors: &'static [(&'static str, [f64; 3])],
    /// Technique of the reference, which has the least error in this scene at equal time.
    pub reference: &'static str,
    /// Samples per pixel of the reference, which two cores render in 40 s to 60 s.
    reference_samples: u64,
}

impl SuiteScene {
    /// A scene without options, changes and reference.
    const PLAIN: SuiteScene = SuiteScene {
        name: "",
        file: "",
        options: &[],
        view: None,
        colors: &[],
        reference: "bdpt",
        reference_samples: 0,
    };

    /// Loads and compiles the scene.
    ///
    /// # Errors
    /// Returns a message if it cannot be read, or lacks an option, a view or a material.
    pub fn load(&self, built_in: &BuiltIn) -> Result<Arc<CompiledScene>, String> {
        let options = self.options.iter();
        let options = options.map(|(key, value)| ((*key).to_owned(), Value::from(*value)));
        let (mut desc, _) = lumbre_lua::scene::read(
            &built_in.file(self.file),
            &options.collect(),
            MissingTextures::Fail,
        )
        .map_err(|e| e.to_string())?;
        let colors = self.colors.iter().map(|(path, color)| {
            let numbers = color.map(Value::from).to_vec();
            (*path, Value::List(numbers))
        });
        let view = self.view.map(|view| ("camera", Value::from(view)));
        for (path, value) in colors.chain(view) {
            edit::set(&mut desc, path, &value).map_err(|e| e.to_string())?;
        }
        Ok(Arc::new(compile(&desc).map_err(|e| e.to_string())?.0))
    }

    /// Returns the samples per pixel of the reference.
    pub fn reference_samples(&self, settings: &SuiteSettings) -> u64 {
        let samples = self.reference_samples as f64 * settings.reference_share;
        (samples.round() as u64).max(LEAST_REFERENCE_SAMPLES)
    }
}

/// Switches the light of the Cornell box off.
const NO_CORNELL_LIGHT: (&str, [f64; 3]) = ("materials.light.emission", [0.0; 3]);

/// Scenes of the suite: the eight rows of table 5.2 of thesis S0, and a second light for the scenes
/// that have one there.
pub const SCENES: [SuiteScene; 11] = [
    SuiteScene {
        name: "cornell-balls",
        file: "cornell.lua",
        options: &[("inside", "balls")],
        reference_samples: 1280,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "cornell-spheres",
        file: "cornell.lua",
        options: &[("inside", "spheres")],
        reference_samples: 2048,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "cornell-sky",
        file: "cornell.lua",
        options: &[("inside", "spheres")],
        colors: &[NO_CORNELL_LIGHT, ("environment.color", [1.0, 1.1, 1.3])],
        reference: "bpt",
        reference_samples: 12288,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "bedroom",
        file: "bedroom.lua",
        reference: "nee",
        reference_samples: 1024,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "bedroom-lamps",
        file: "bedroom.lua",
        colors: &[
            ("materials.daylight.emission", [0.0; 3]),
            ("materials.shade.emission", [24.0, 17.0, 9.0]),
        ],
        reference_samples: 288,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "veach-lamps",
        file: "veach_lamps.lua",
        reference_samples: 704,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "veach-floor-lamp",
        file: "veach_lamps.lua",
        colors: &[("materials.spot_light.emission", [0.0; 3])],
        reference_samples: 704,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "atrium-sky",
        file: "atrium.lua",
        options: &[("light", "skybox")],
        view: Some("atrium"),
        reference: "bpt",
        reference_samples: 896,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "gallery-sky",
        file: "atrium.lua",
        options: &[("light", "skybox")],
        view: Some("gallery"),
        reference: "bpt",
        reference_samples: 1024,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "atrium-lamps",
        file: "atrium.lua",
        options: &[("light", "lamps")],
        view: Some("atrium"),
        reference_samples: 352,
        ..SuiteScene::PLAIN
    },
    SuiteScene {
        name: "gallery-lamps",
        file: "atrium.lua",
        options: &[("light", "lamps")],
        view: Some("gallery"),
        reference_samples: 352,
        ..SuiteScene::PLAIN
    },
];

/// Returns the settings of the suite for the options of the command.
pub fn settings(args: &BenchArgs) -> SuiteSettings {
    let quick = if args.quick { QUICK_SHARE } else { 1.0 };
    let share = args.time.map_or(quick, |time| time / BUDGET_S);
    let run_s = RUN_S * share;
    SuiteSettings {
        resolution: args.size.unwrap_or(RESOLUTION),
        max_depth: MAX_DEPTH,
        repeats: REPEATS,
        run_s,
        equal_times_s: EQUAL_TIMES.map(|fraction| fraction * run_s).to_vec(),
        reference_share: share,
    }
}
