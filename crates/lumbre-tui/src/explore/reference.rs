//! A picture that was frozen as reference, and the curves of the errors against it.

use std::sync::Arc;

use super::parameters::{self, INTEGRATOR, SEED};
use super::session::{Frame, Slot};
use super::settings::{SceneFile, Settings};
use crate::tui::model::curve::Curve;
use lumbre_metrics::floor::Halves;
use lumbre_metrics::{METRICS, MetricSpec};
use lumbre_night::experiment::WaveRow;

/// Largest number of curves: as many as there are colours to distinguish them.
const MOST_CURVES: usize = 6;

/// Returns all metrics with their default options, in the order of [`METRICS`].
pub fn metrics() -> Vec<MetricSpec> {
    let spec = |name| MetricSpec::new(name, name, Default::default()).ok();
    METRICS.iter().filter_map(|row| spec(row.name)).collect()
}

/// A frozen picture with the settings that rendered it.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Number that distinguishes references.
    pub number: u64,
    /// Picture that was frozen as reference.
    pub frame: Arc<Frame>,
    /// Scene of the picture.
    pub scene: SceneFile,
    /// Settings of the picture.
    pub settings: Settings,
}

/// Reason why a picture is not measured against a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mismatch {
    /// Scene, camera or resolution differ.
    View,
    /// The picture has the random numbers of the reference, and so a part of its noise.
    Seed,
}

impl Mismatch {
    /// Returns the reason as a sentence without full stop.
    pub fn text(self) -> &'static str {
        match self {
            Mismatch::View => "the reference shows another view or scene",
            Mismatch::Seed => "the reference has the same seed, so its noise is shared",
        }
    }
}

impl Reference {
    /// Returns why the picture of these settings cannot be measured; `None` if it can.
    pub fn mismatch(
        &self,
        scene: &SceneFile,
        settings: &Settings,
        resolution: [u32; 2],
    ) -> Option<Mismatch> {
        let size = [self.frame.image.width, self.frame.image.height];
        let same_view = self.scene == *scene
            && size == resolution
            && self.settings.view() == settings.view()
            && self.settings.set == settings.set;
        if !same_view {
            return Some(Mismatch::View);
        }
        (self.settings.seed() == settings.seed()).then_some(Mismatch::Seed)
    }

    /// Estimates the value that the true picture would have for each metric, from the two parts of
    /// the samples; empty if there is only one part.
    pub fn floors(&self, metrics: &[MetricSpec]) -> Vec<Option<f64>> {
        let Some((means, samples)) = self.frame.halves() else {
            return Vec::new();
        };
        let halves = Halves {
            means: [&means[0], &means[1]],
            samples,
        };
        let floor = |spec: &MetricSpec| {
            let floor = spec.floor(&self.frame.image, halves).ok().flatten();
            floor.map(|floor| floor.value)
        };
        metrics.iter().map(floor).collect()
    }
}

/// Class of the ratio of a measured error to the noise floor of its reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FloorDistance {
    /// At least twice the floor, or there is no floor.
    Far,
    /// Below twice the floor.
    Near,
    /// At least half of the squared error is the reference's own.
    AtFloor,
}

/// Compares a value of a metric with the floor of its reference.
pub fn floor_distance(spec: &MetricSpec, value: f64, floor: Option<f64>) -> FloorDistance {
    let Some(floor) = floor else {
        return FloorDistance::Far;
    };
    if spec.is_at_floor(value, floor) {
        return FloorDistance::AtFloor;
    }
    match (spec.distance(value), spec.distance(floor)) {
        (Some(value), Some(floor)) if value < 2.0 * floor => FloorDistance::Near,
        _ => FloorDistance::Far,
    }
}

/// The errors of one setting.
#[derive(Clone, Debug)]
pub struct SettingCurve {
    /// Slot in which it was rendered.
    pub slot: Slot,
    /// Number of its request.
    pub request: u64,
    /// Technique, and what differs from the settings of the reference.
    pub label: String,
    /// Index of its colour.
    pub colour: usize,
    /// Its measurements; the metrics are those of [`metrics`].
    pub curve: Curve,
}

/// The errors of all settings since a reference was frozen.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    list: Vec<SettingCurve>,
}

impl Curves {
    /// Starts the curve of a request. It replaces that of the same settings in this slot, and one
    /// without measurements.
    pub fn begin(&mut self, slot: Slot, request: u64, label: String) {
        self.list.retain(|known| {
            let replaced = known.label == label || known.curve.last().is_none();
            known.slot != slot || !replaced
        });
        if self.list.len() >= MOST_CURVES {
            self.list.remove(0);
        }
        let is_free = |colour: &usize| self.list.iter().all(|known| known.colour != *colour);
        let colour = (0..MOST_CURVES).find(is_free).unwrap_or(0);
        self.list.push(SettingCurve {
            slot,
            request,
            label,
            colour,
            curve: Curve::default(),
        });
    }

    /// Adds a measurement to the curve of a request, unless it is there already or the curve was
    /// dropped.
    pub fn push(&mut self, slot: Slot, request: u64, row: WaveRow) {
        let found = self
            .list
            .iter_mut()
            .find(|known| (known.slot, known.request) == (slot, request));
        if let Some(known) = found
            && known
                .curve
                .last()
                .is_none_or(|last| last.samples < row.samples)
        {
            known.curve.push(Arc::new(row));
        }
    }

    /// Returns the curves in the order in which they were started.
    pub fn list(&self) -> &[SettingCurve] {
        &self.list
    }

    /// Returns the curve of a request.
    pub fn of(&self, slot: Slot, request: u64) -> Option<&SettingCurve> {
        self.list
            .iter()
            .find(|known| (known.slot, known.request) == (slot, request))
    }
}

/// Returns the name of a curve: the technique, and what differs from the settings of the reference.
pub fn label(settings: &Settings, reference: &Settings) -> String {
    let mut label = settings.technique().name.to_owned();
    let own = settings.render_table();
    for (path, value) in settings.changes_from(reference) {
        let head = path.split('.').next().unwrap_or(path);
        // The seed changes nothing but the noise, and other techniques ignore some parameters.
        let counts = own.contains_key(head) || value.is_none();
        if path == INTEGRATOR || path == SEED || is_display(head) || !counts {
            continue;
        }
        let name = path.rsplit('.').next().unwrap_or(path);
        let value = value.map_or_else(|| "default".to_owned(), parameters::text);
        label += &format!(" {name}={value}");
    }
    label
}

/// Whether a group of settings changes the display or the end of a picture alone.
fn is_display(group: &str) -> bool {
    matches!(group, "display" | "limit" | "films")
}
