//! The temporal profile of a material as its file specifies it.

use serde::{Deserialize, Serialize};

use super::TextureSlot;

crate::named! {
    /// Type of a temporal profile.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    pub enum DelayKind {
        /// Light is returned without delay.
        None = "none",
        /// A constant delay.
        Constant = "constant",
        /// An exponential distribution with the density `rate exp(-rate x)`.
        Exponential = "exponential",
        /// An Epanechnikov distribution with the density `3 / (4 width) (1 - ((x - mean) /
        /// width)^2)`.
        Epanechnikov = "epanechnikov",
        /// A piecewise linear density.
        Table = "table",
    }
}

/// Temporal profile of a material as specified by its file. All lengths are optical lengths in
/// scene units. A parameter with a texture evaluates to its offset plus its value times the
/// texture's red channel; without a texture, to the sum of offset and value.
#[derive(Clone, Debug, PartialEq)]
pub struct DelayDesc {
    /// Type of the profile.
    pub kind: DelayKind,
    /// Delay of `constant`, and its offset.
    pub constant: [f32; 2],
    /// Rate of `exponential`, in 1 / scene unit, and its offset.
    pub rate: [f32; 2],
    /// Mean of `epanechnikov`, and its offset.
    pub mean: [f32; 2],
    /// Half width of the support of `epanechnikov`, and its offset.
    pub width: [f32; 2],
    /// Pairs of delay and density of `table`, flattened; the density is known up to a factor.
    pub table: Vec<f32>,
}

impl Default for DelayDesc {
    fn default() -> DelayDesc {
        DelayDesc {
            kind: DelayKind::None,
            constant: [0.0; 2],
            rate: [1.0, 0.0],
            mean: [1.0, 0.0],
            width: [1.0, 0.0],
            table: Vec::new(),
        }
    }
}

/// A parameter of a profile: its name, a getter for its value and offset, and its texture slot.
pub type DelayParamRow = (&'static str, fn(&DelayDesc) -> [f32; 2], TextureSlot);

impl DelayDesc {
    /// Returns the parameters that the profile type uses.
    pub fn params(&self) -> &'static [DelayParamRow] {
        match self.kind {
            DelayKind::None | DelayKind::Table => &[],
            DelayKind::Constant => {
                &[("delay_constant", |d| d.constant, TextureSlot::DelayConstant)]
            }
            DelayKind::Exponential => &[("delay_rate", |d| d.rate, TextureSlot::DelayRate)],
            DelayKind::Epanechnikov => &[
                ("delay_mean", |d| d.mean, TextureSlot::DelayMean),
                ("delay_width", |d| d.width, TextureSlot::DelayWidth),
            ],
        }
    }

    /// Returns the (delay, density) pairs of the table.
    pub fn pairs(&self) -> Vec<[f32; 2]> {
        self.table.chunks_exact(2).map(|p| [p[0], p[1]]).collect()
    }
}
