//! The row of an integrator.

use super::context::Context;
use super::iteration::Sharing;
use crate::transport::contribution::Contribution;
use crate::transport::sampler::Sampler;
use crate::value::schema::Table;

/// Computes one sample of one pixel and passes every contribution to the sink.
pub type SampleFn = fn(&Context, pixel: [u32; 2], &mut Sampler, sink: &mut dyn FnMut(Contribution));

/// An integrator: one entry of [`INTEGRATORS`](super::INTEGRATORS), or a
/// [technique of one's own](super::own).
#[derive(Clone, Copy, Debug)]
pub struct IntegratorRow {
    /// Short name in scripts, columns and paths.
    pub name: &'static str,
    /// Long name shown beside it in tables and plots; ends in `biased` if it is.
    pub long_name: &'static str,
    /// Revision, raised whenever the pictures change; part of every run's identity.
    pub revision: u32,
    /// Description in one sentence, with its source.
    pub doc: &'static str,
    /// Schema of its own parameters in a script's `render` table.
    pub params: Table,
    /// Whether a sample can contribute to other pixels than its own.
    pub splats: bool,
    /// Source of the bias, in a clause, of an integrator for which the expected value of a picture
    /// is not the exact one, although its error may vanish with the number of samples; what it
    /// shows, if that is no radiance. `None` if it is unbiased.
    pub bias: Option<&'static str>,
    /// Functions by which the samples of an iteration share data; `None` if they share none.
    pub sharing: Option<Sharing>,
    /// Computes one sample of one pixel on the CPU.
    pub sample: SampleFn,
}

impl IntegratorRow {
    /// Returns whether pixels have common noise, because the samples of an iteration share data that
    /// differ between iterations.
    pub fn has_common_noise(&self) -> bool {
        self.sharing
            .is_some_and(|sharing| sharing.constant_from.is_none())
    }
}
