//! Light vertices drawn at random from all light subpaths of an iteration, of which one is connected
//! with a camera vertex.

use super::store::VertexId;
use super::weights::StrategyCounts;
use crate::transport::integrator::iteration::light_paths::LightPaths;

/// The light subpaths of an iteration, and the list of their vertices that can be connected.
pub struct LightVertexCache {
    /// The light subpaths.
    pub paths: LightPaths,
    /// Numbers of samples of all strategies.
    pub counts: StrategyCounts,
    /// Number of samples by which the estimate of a connection with a drawn vertex is divided, if
    /// it is the only candidate: `n c / C`.
    samples: f64,
    /// Indices of the vertices that can be connected, by unit of work.
    connected: Vec<Vec<u32>>,
    /// Number of such vertices in all units before each one, and in all.
    before: Vec<u64>,
}

impl LightVertexCache {
    /// Creates the cache of light subpaths for a number of connections of each camera vertex.
    /// `connected` are the indices of the vertices that can be connected, by unit of work.
    pub fn new(
        paths: LightPaths,
        counts: StrategyCounts,
        connections: u32,
        connected: Vec<Vec<u32>>,
    ) -> LightVertexCache {
        let mut before = vec![0];
        let mut vertices = 0;
        for unit in &connected {
            vertices += unit.len() as u64;
            before.push(vertices);
        }
        LightVertexCache {
            samples: paths.count() as f64 * f64::from(connections) / vertices as f64,
            paths,
            counts,
            connected,
            before,
        }
    }

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

    /// Returns the number of samples by which the estimate of a connection is divided whose vertex
    /// was chosen among `candidates` drawn ones with a probability.
    pub fn samples_of(&self, candidates: u32, probability: f64) -> f64 {
        self.samples * f64::from(candidates) * probability
    }
}

/// Returns the target density of a candidate whose connection has an unweighted luminance and an MIS
/// weight, up to a factor; 0 if it brings no light.
#[inline]
pub fn target(luminance: f64, weight: f64) -> f64 {
    let target = luminance * weight;
    if target > 0.0 && target.is_finite() {
        target
    } else {
        0.0
    }
}

/// Chooses one of several candidates in proportion to its [target density](target), by a number in
/// `[0, 1)`. Returns its index and the probability of choosing it; `None` if all densities are 0.
pub fn choose(targets: impl Iterator<Item = f64> + Clone, choice: f32) -> Option<(usize, f64)> {
    let total: f64 = targets.clone().sum();
    let mut rest = f64::from(choice) * total;
    let mut chosen = None;
    for (index, target) in targets.enumerate().filter(|(_, target)| *target > 0.0) {
        chosen = Some((index, target / total));
        rest -= target;
        if rest < 0.0 {
            break;
        }
    }
    chosen
}
