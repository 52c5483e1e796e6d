//! Errors between an image and its reference. This room sees images only.
//!
//! One file and one row of [`METRICS`] each; columns, curves, stop rules and documentation follow from the row.

pub mod tonemap;

use crate::film::Image;
use crate::value::schema::Table;

/// Whether a smaller or a larger value is the better one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Zero is perfect.
    Lower,
    /// One, or infinity, is perfect.
    Higher,
}

/// A metric with its options, as a script asks for it.
#[derive(Clone, Debug, PartialEq)]
pub struct MetricSpec {
    /// The name of its column: `rmse`, or what the script called it.
    pub column: String,
    /// Its row.
    pub row: &'static MetricRow,
    /// Options, checked against the row's schema, with defaults not filled in.
    pub options: std::collections::BTreeMap<String, crate::value::Value>,
}

/// One row of [`METRICS`].
pub struct MetricRow {
    /// The short name in scripts and columns.
    pub name: &'static str,
    /// The long name that stands beside it in plots.
    pub long_name: &'static str,
    /// Definition and source in a sentence.
    pub doc: &'static str,
    /// Direction.
    pub better: Better,
    /// Options in scripts.
    pub options: Table,
    /// Computes it: image, reference, options.
    pub eval: fn(&Image, &Image, &MetricSpec) -> f64,
}

impl PartialEq for MetricRow {
    fn eq(&self, other: &MetricRow) -> bool {
        self.name == other.name
    }
}

impl std::fmt::Debug for MetricRow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "MetricRow({})", self.name)
    }
}

/// Why a metric cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MetricError {
    /// The two images differ in size.
    #[error("image is {}x{} but reference is {}x{}", image[0], image[1], reference[0], reference[1])]
    Size {
        /// Width and height of the image.
        image: [u32; 2],
        /// Width and height of the reference.
        reference: [u32; 2],
    },
}

/// Every metric there is.
pub const METRICS: &[MetricRow] = &[];

/// The row with this name.
pub fn metric(name: &str) -> Option<&'static MetricRow> {
    METRICS.iter().find(|row| row.name == name)
}

impl MetricSpec {
    /// Computes the metric.
    ///
    /// # Errors
    /// When the sizes differ.
    pub fn eval(&self, image: &Image, reference: &Image) -> Result<f64, MetricError> {
        if (image.width, image.height) != (reference.width, reference.height) {
            return Err(MetricError::Size {
                image: [image.width, image.height],
                reference: [reference.width, reference.height],
            });
        }
        Ok((self.row.eval)(image, reference, self))
    }
}
