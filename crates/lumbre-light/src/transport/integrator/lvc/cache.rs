//! The light subpaths of an iteration, and the list of their vertices that can be connected.

use crate::transport::integrator::bdpt::draw::LightVertexCache;
use crate::transport::integrator::bdpt::store::CachedVertex;
use crate::transport::integrator::bdpt::weights::StrategyCounts;
use crate::transport::integrator::iteration::light_paths::{self, LightPaths};
use crate::transport::integrator::iteration::{Iteration, Resources, Shared};
use crate::transport::integrator::settings::Settings;

/// Number of light subpaths from which the mean number of vertices is estimated.
pub const PREPARED_PATHS: u64 = 1024;

/// Number of those that a thread traces at a time.
const PREPARED_UNIT: u64 = 64;

/// Bytes of a vertex: as stored, in the list of those that can be connected, and in that of its unit
/// of work, which has up to twice the capacity that it needs.
pub const VERTEX_BYTES: usize = light_paths::VERTEX_BYTES + 3 * size_of::<CachedVertex>();

/// Data that all iterations of a job need.
#[derive(Clone, Copy, Debug)]
struct Setup {
    /// Number of light subpaths of an iteration.
    count: u64,
    /// Number of connections of a camera vertex.
    connections: u32,
    /// Numbers of samples of all strategies.
    counts: StrategyCounts,
}

/// Returns the expected number of connections of a camera vertex with each vertex of a light subpath,
/// if [`PREPARED_PATHS`] subpaths have this number of vertices that can be connected.
pub fn connecting(settings: &Settings, vertices: u64) -> f64 {
    let drawn = f64::from(settings.connections) * f64::from(settings.candidates);
    // Where no vertex was found there may be some.
    drawn * PREPARED_PATHS as f64 / vertices.max(1) as f64
}

/// Estimates the mean number of vertices of a light subpath.
pub fn prepare(resources: &Resources) -> Box<Shared> {
    let units = PREPARED_PATHS / PREPARED_UNIT;
    let vertices = resources.map(units as usize, |context, unit| {
        let (first, counts) = (unit as u64 * PREPARED_UNIT, StrategyCounts::ONE_EACH);
        let paths = resources.trace_light(context, first, PREPARED_UNIT, counts);
        let events = paths.store().events().iter();
        events.filter(|event| event.connects).count()
    });
    let vertices = vertices.iter().sum::<usize>() as u64;
    let setup = resources.map(1, |context, _| {
        let [width, height] = context.camera.resolution().map(u64::from);
        let (pixels, settings) = (width * height, context.settings);
        let (connections, count) = (settings.connections, settings.light_paths(pixels));
        Setup {
            count,
            connections,
            counts: StrategyCounts {
                connecting: connecting(settings, vertices),
                direct: 1.0,
                lens: count as f64 / pixels as f64,
                merging: 0.0,
            },
        }
    });
    Box::new(setup[0])
}

/// Traces the light subpaths of an iteration.
pub fn begin(iteration: &Iteration) -> Box<Shared> {
    let Setup {
        count,
        connections,
        counts,
    } = *iteration.prepared::<Setup>();
    let paths = LightPaths::trace(iteration, count, counts);
    let units = paths.stores().len();
    let connected = iteration.map(units, |_, unit| paths.connected(unit));
    let vertices = connected.concat();
    Box::new(LightVertexCache::new(paths, counts, connections, vertices))
}
