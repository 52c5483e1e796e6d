//! Light vertices drawn at random from all light subpaths of an iteration, of which one is connected
//! with a camera vertex.

use super::store::CachedVertex;
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
    vertices: Vec<CachedVertex>,
}

impl LightVertexCache {
    /// Creates the cache of light subpaths for a number of connections of each camera vertex.
    /// `vertices` are those that can be connected, in order.
    pub fn new(
        paths: LightPaths,
        counts: StrategyCounts,
        connections: u32,
        vertices: Vec<CachedVertex>,
    ) -> LightVertexCache {
        LightVertexCache {
            samples: paths.count() as f64 * f64::from(connections) / vertices.len() as f64,
            paths,
            counts,
            vertices,
        }
    }

    /// Draws `count` vertices, each uniformly from the cache, with equal steps between their numbers;
    /// none if the cache is empty. `u` are two numbers in `[0, 1)`; the second one continues the
    /// digits of the first, which has 24 of them.
    pub fn draw(&self, [u, v]: [f32; 2], count: u32) -> impl Iterator<Item = CachedVertex> {
        let first = f64::from(u) + f64::from(v) * (-24f64).exp2();
        let (vertices, step) = (self.vertices.len(), f64::from(count).recip());
        let drawn = if vertices == 0 { 0 } else { count };
        (0..drawn).map(move |i| {
            let place = (first + f64::from(i) * step).fract();
            self.vertices[((place * vertices as f64) as usize).min(vertices - 1)]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::integrator::bdpt::store::VertexId;

    #[test]
    fn every_cached_vertex_is_drawn_equally_often() {
        let counts = StrategyCounts::ONE_EACH;
        for vertices in [1u32, 2, 3, 7] {
            let cached = |index| CachedVertex {
                id: VertexId::new(0, index),
                edges: 1,
            };
            let all: Vec<CachedVertex> = (0..vertices).map(cached).collect();
            let cache = LightVertexCache::new(LightPaths::none(), counts, 1, all);
            for count in [1, 4] {
                let steps = 84;
                let mut drawn = vec![0; vertices as usize];
                for i in 0..steps {
                    let u = (i as f32 + 0.5) / steps as f32;
                    for vertex in cache.draw([u, 0.5], count) {
                        drawn[vertex.id.index()] += 1;
                    }
                }
                // Steps and vertices divide: no rounding is left.
                let each = steps * count / vertices;
                assert!(
                    drawn.iter().all(|n| *n == each),
                    "{drawn:?}, expected {each} each"
                );
            }
            // The greatest numbers below 1.
            let most = 1.0 - f32::EPSILON / 2.0;
            let last = cache.draw([most, most], 1).next().unwrap();
            assert_eq!(last.id.index() as u32, vertices - 1);
        }
        let none = LightVertexCache::new(LightPaths::none(), counts, 1, Vec::new());
        assert_eq!(none.draw([0.5; 2], 4).count(), 0);
    }

    #[test]
    fn candidates_are_chosen_in_proportion_to_their_targets() {
        let targets = [0.0, 1.0, 0.0, 3.0, 0.0];
        let chosen = |choice| choose(targets.into_iter(), choice);
        for (choice, expected) in [
            (0.0, (1, 0.25)),
            (0.249, (1, 0.25)),
            (0.25, (3, 0.75)),
            (0.999, (3, 0.75)),
            // Rounding may leave a rest.
            (1.0, (3, 0.75)),
        ] {
            assert_eq!(chosen(choice), Some(expected), "{choice}");
        }
        assert_eq!(choose([0.0; 3].into_iter(), 0.5), None);
        assert_eq!(choose([].into_iter(), 0.5), None);
    }

    #[test]
    fn candidates_without_light_have_no_target() {
        assert_eq!(target(2.0, 0.25), 0.5);
        for (luminance, weight) in [
            (0.0, 1.0),
            (f64::NAN, 1.0),
            (f64::INFINITY, 1.0),
            (-1.0, 1.0),
        ] {
            assert_eq!(target(luminance, weight), 0.0);
        }
    }
}
