//! The light subpaths of an iteration, and the list of their vertices that can be connected.

use crate::transport::integrator::bdpt::weights::StrategyCounts;
use crate::transport::integrator::iteration::light_paths::{self, LightPaths, VertexId};
use crate::transport::integrator::iteration::{Iteration, Resources, Shared};

/// Number of light subpaths from which the mean number of vertices is estimated.
const PREPARED_PATHS: u64 = 1024;

/// Number of those that a thread traces at a time.
const PREPARED_UNIT: u64 = 64;

/// Bytes of a vertex: as stored, and in the list of those that can be connected.
pub const VERTEX_BYTES: usize = light_paths::VERTEX_BYTES + 2 * size_of::<u32>();

/// Data that all samples of an iteration read.
pub struct LightVertexCache {
    /// The light subpaths.
    pub paths: LightPaths,
    /// Numbers of samples of all strategies.
    pub counts: StrategyCounts,
    /// Number of samples by which the estimate of a connection with a drawn vertex is divided, if
    /// it is the only candidate: `n c / C`.
    pub samples: f64,
    /// Indices of the vertices that can be connected, by unit of work.
    connected: Vec<Vec<u32>>,
    /// Number of such vertices in all units before each one, and in all.
    before: Vec<u64>,
}

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

/// Estimates the mean number of vertices of a light subpath.
pub fn prepare(resources: &Resources) -> Box<Shared> {
    let units = PREPARED_PATHS / PREPARED_UNIT;
    let vertices = resources.map(units as usize, |context, unit| {
        let (first, counts) = (unit as u64 * PREPARED_UNIT, StrategyCounts::ONE_EACH);
        let paths = resources.trace_light(context, first, PREPARED_UNIT, counts);
        let events = paths.store().events().iter();
        events.filter(|event| event.connects).count()
    });
    // Where no vertex was found there may be some.
    let vertices = vertices.iter().sum::<usize>().max(1) as f64;
    let setup = resources.map(1, |context, _| {
        let [width, height] = context.camera.resolution().map(u64::from);
        let (pixels, settings) = (width * height, context.settings);
        let (connections, count) = (
            settings.connections,
            settings.photons.map_or(pixels, u64::from),
        );
        let drawn = f64::from(connections) * f64::from(settings.candidates);
        Setup {
            count,
            connections,
            counts: StrategyCounts {
                connecting: drawn * PREPARED_PATHS as f64 / vertices,
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
    let connected = iteration.map(paths.units(), |_, unit| paths.connected(unit));
    let mut before = vec![0];
    let mut vertices = 0;
    for unit in &connected {
        vertices += unit.len() as u64;
        before.push(vertices);
    }
    Box::new(LightVertexCache {
        paths,
        counts,
        samples: count as f64 * f64::from(connections) / vertices as f64,
        connected,
        before,
    })
}

impl LightVertexCache {
    /// Returns the number of vertices that can be connected.
    pub fn count(&self) -> u64 {
        self.before.last().copied().unwrap_or(0)
    }

    /// Returns the vertex with a number below [`LightVertexCache::count`].
    pub fn vertex(&self, number: u64) -> VertexId {
        let unit = self.before.partition_point(|before| *before <= number) - 1;
        let index = self.connected[unit][(number - self.before[unit]) as usize];
        VertexId::new(unit, index)
    }

    /// Draws `count` vertices, each uniformly from the cache, with equal steps between their numbers;
    /// none if the cache is empty. `u` are two numbers in `[0, 1)`; the second one continues the
    /// digits of the first, which has 24 of them.
    pub fn draw(&self, [u, v]: [f32; 2], count: u32) -> impl Iterator<Item = VertexId> {
        let first = f64::from(u) + f64::from(v) * (-24f64).exp2();
        let (vertices, step) = (self.count(), f64::from(count).recip());
        let drawn = if vertices == 0 { 0 } else { count };
        (0..drawn).map(move |i| {
            let place = (first + f64::from(i) * step).fract();
            self.vertex(((place * vertices as f64) as u64).min(vertices - 1))
        })
    }
}
