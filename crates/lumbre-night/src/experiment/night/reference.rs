//! A reference of a night: what was planned, its state, and what it was compared with.

use std::collections::BTreeSet;
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::Arc;

use super::run::{RunState, StopOutline};
use crate::experiment::noise_floor::NoiseFloors;
use crate::experiment::outcome::WaveRow;
use lumbre_light::scene::SceneDesc;
use lumbre_render::Settings;

/// Describes what a biased technique of a reference does to a comparison, without a full stop.
pub fn biased_reference((technique, bias): (&str, &str)) -> String {
    format!(
        "the reference is rendered by `{technique}`, which is biased: {bias}. Errors are distances from \
         its limit, which favours `{technique}` and what is biased alike"
    )
}

/// Plan of a reference.
#[derive(Clone, Debug, Default)]
pub struct ReferencePlan {
    /// Id of the reference.
    pub id: String,
    /// Names and values of the axes that distinguish it from other references.
    pub values: Vec<(String, String)>,
    /// Image file, if it is not rendered.
    pub file: Option<PathBuf>,
    /// Render settings, if it is rendered and this version knows them.
    pub settings: Option<Arc<Settings>>,
    /// Scene with all changes applied, if known.
    pub content: Option<Arc<SceneDesc>>,
    /// Stop rule, if it is rendered.
    pub stop: Option<Arc<StopOutline>>,
}

/// Result of comparing a reference with the same picture by another technique.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BiasCheckSummary {
    /// Integrator of the second picture.
    pub technique: String,
    /// Whether no comparison found a difference.
    pub agrees: bool,
    /// The result in one sentence.
    pub finding: String,
}

/// Origin of the picture of a reference.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReferenceOrigin {
    /// It was rendered.
    Rendered {
        /// Name of the integrator.
        integrator: String,
        /// Samples per pixel.
        samples: u64,
    },
    /// It is a file or is not finished, as this text describes.
    Other(String),
}

impl ReferenceOrigin {
    /// Returns a description for people: `bpt, 16 samples per pixel`, or the name of a file.
    pub fn describe(&self) -> String {
        match self {
            ReferenceOrigin::Rendered {
                integrator,
                samples,
            } => format!("{integrator}, {samples} samples per pixel"),
            ReferenceOrigin::Other(text) => text.clone(),
        }
    }
}

impl Default for ReferenceOrigin {
    fn default() -> ReferenceOrigin {
        ReferenceOrigin::Other(String::new())
    }
}

/// Shards of a reference that is rendered in parts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ShardProgress {
    /// Numbers of the finished shards.
    pub finished: BTreeSet<usize>,
    /// Number of all shards.
    pub count: usize,
}

/// A reference that runs are measured against.
#[derive(Clone, Debug, Default)]
pub struct Reference {
    /// Plan of the reference, whose fields are those of the reference.
    pub planned: Arc<ReferencePlan>,
    /// State of the reference.
    pub state: RunState,
    /// Its newest measurement, or all of them, oldest first.
    pub rows: Arc<Vec<WaveRow>>,
    /// Its shards, if it has been rendered in some.
    pub shards: Option<ShardProgress>,
    /// The value that the true picture would measure against it, in the order of the night's
    /// metrics, if known.
    pub floors: Option<NoiseFloors>,
    /// Comparisons with other techniques, each with the newest result.
    pub checks: Vec<BiasCheckSummary>,
    /// Folder of the reference, which may not exist; empty if the night is not read from files.
    pub folder: PathBuf,
    /// File of the picture, if it exists.
    pub picture: Option<PathBuf>,
    /// Origin of the picture, if the night is read from files.
    pub origin: ReferenceOrigin,
}

impl Deref for Reference {
    type Target = ReferencePlan;

    fn deref(&self) -> &ReferencePlan {
        &self.planned
    }
}

impl Reference {
    /// Returns the technique that renders it, if it is known.
    pub fn integrator(&self) -> Option<&str> {
        match (&self.settings, &self.origin) {
            (Some(settings), _) => Some(&settings.integrator),
            (None, ReferenceOrigin::Rendered { integrator, .. }) => Some(integrator),
            (None, ReferenceOrigin::Other(_)) => None,
        }
    }

    /// Returns whether it is rendered, not an image file.
    pub fn is_rendered(&self) -> bool {
        self.file.is_none()
    }

    /// Returns whether a second technique disagrees with it beyond noise.
    pub fn is_contradicted(&self) -> bool {
        self.checks.iter().any(|check| !check.agrees)
    }
}
