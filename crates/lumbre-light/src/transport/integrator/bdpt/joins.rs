//! The ways in which the samples of a technique join subpaths from the camera with subpaths from
//! lights.

use super::directions::SubpathDirections;
use super::draw::LightVertexCache;
use super::merge::Merging;
use super::weights::StrategyCounts;
use crate::transport::integrator::Context;
use crate::transport::integrator::iteration::light_paths::LightPaths;

/// A technique that joins subpaths from the camera with subpaths from lights.
pub trait SubpathTechnique: Send + Sync + 'static {
    /// Distribution of the directions in which camera subpaths continue.
    type Directions: SubpathDirections;

    /// Returns how the samples of an iteration join them.
    fn joins<'a>(context: &Context<'a>) -> Joins<'a, Self::Directions>;
}

/// The ways in which the samples of an iteration join subpaths.
///
/// Every sample adds light that its camera subpath hits. Strategies whose
/// [number of samples](StrategyCounts) is 0 are left out.
#[derive(Clone, Copy)]
pub struct Joins<'a, D> {
    /// Directions in which camera subpaths continue.
    pub directions: D,
    /// Numbers of samples of the strategies that the weights combine.
    pub counts: StrategyCounts,
    /// Light subpaths that all samples share; `None` if each sample traces one of its own.
    pub shared: Option<&'a LightPaths>,
    /// Light vertices that each camera vertex is merged with, if any.
    pub merging: Option<Merging<'a>>,
    /// Light vertices from which those to connect with a camera vertex are drawn. Otherwise it is
    /// connected with each vertex of one light subpath.
    pub drawing: Option<&'a LightVertexCache>,
}

impl<D: SubpathDirections> Joins<'_, D> {
    /// Each sample traces a light subpath of its own and makes each connection once.
    pub const fn each(directions: D) -> Joins<'static, D> {
        Joins {
            directions,
            counts: StrategyCounts::ONE_EACH,
            shared: None,
            merging: None,
            drawing: None,
        }
    }
}
