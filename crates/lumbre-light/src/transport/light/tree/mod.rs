//! A tree over lights, which chooses among them by what they may send to a point [Conty Estevez and
//! Kulla 2018; Pharr et al. 2023, section 12.6.3].
//!
//! Each inner node has up to eight children, lights or nodes, with bounds ([`bounds`]) of position,
//! direction of emission and power. A choice descends from the root: at every node, a child is chosen
//! with the probability of its *importance*, an estimate of the light that it may send to the point.
//! The importance of a child is zero only if none of its lights emits towards the point. The
//! probability of a light is the product along its way from the root, which
//! [`LightTree::probability`] computes upwards.
//!
//! The importance depends on the point alone and not on the surface there: light may pass
//! transmissive surfaces, and a path need not store a normal for the densities of light that it hits.
//!
//! Directional lights and the environment reach all points and are no part of the tree. They are
//! chosen with probability 1/2 together, in proportion to their power, if there are both.

mod bounds;
mod build;

use glam::Vec3;

use crate::math::distribution::AliasTable;
use crate::math::rng::pcg4d;
use crate::scene::compile::NONE;

pub(super) use self::bounds::LightBounds;

/// Number of children of a node.
const CHILDREN: usize = 8;

/// Mark of a child that is a light.
const LIGHT: u32 = 1 << 31;

/// Least share of the total power, so that no importance becomes zero by rounding.
const LEAST_SHARE: f32 = 1e-20;

/// Least cosine in an importance, so that lights at grazing angles are not forgotten.
const LEAST_COS: f32 = 1e-3;

/// Children of a node by property. Missing children have no power.
#[derive(Clone, Debug)]
struct Node {
    /// Centre of a sphere that contains the lights.
    center: [[f32; CHILDREN]; 3],
    /// Squared radius of that sphere, in square scene units.
    radius2: [f32; CHILDREN],
    /// Axis of a cone that contains the directions of strongest emission.
    axis: [[f32; CHILDREN]; 3],
    /// Cosine of the half angle of that cone.
    cos_spread: [f32; CHILDREN],
    /// Sine of the half angle of that cone.
    sin_spread: [f32; CHILDREN],
    /// Cosine of the greatest angle between that cone and a direction of emission.
    cos_emission: [f32; CHILDREN],
    /// Share of the total power.
    power: [f32; CHILDREN],
    /// Index of a node, or of a light with the mark [`LIGHT`].
    child: [u32; CHILDREN],
    /// Position in the parent: its index times [`CHILDREN`], plus the child's number; [`NONE`] for
    /// the root.
    parent: u32,
    /// Whether all children emit in all directions, so that only power and distance matter.
    round: bool,
}

/// The tree and the lights beside it.
#[derive(Clone, Debug)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// Position of each light in its node: index of the node times [`CHILDREN`], plus the child's
    /// number; [`NONE`] for lights that are no part of the tree.
    places: Vec<u32>,
    /// Probability of choosing a light of the tree.
    near: f64,
    /// Distribution over infinitely distant lights.
    distant: Option<AliasTable>,
    /// Index of the first infinitely distant light.
    first_distant: u32,
}

impl LightTree {
    /// Builds the tree over lights with these bounds and powers. Infinitely distant lights have no
    /// bounds and are the last ones. Lights without power are never chosen. Returns `None` if no
    /// light has any.
    pub(super) fn new(
        bounds: impl Iterator<Item = Option<LightBounds>>,
        powers: &[f64],
    ) -> Option<LightTree> {
        let near: Vec<LightBounds> = bounds.map_while(|bounds| bounds).collect();
        let first_distant = near.len();
        let total: f64 = powers[..first_distant].iter().sum();
        let lights = near.into_iter().zip(powers).zip(0..);
        let lights = lights.filter(|((_, power), _)| **power > 0.0);
        let lights = lights.map(|((bounds, own), index)| {
            let power = ((own / total) as f32).max(LEAST_SHARE);
            (index, LightBounds { power, ..bounds })
        });
        let mut places = vec![NONE; first_distant];
        let nodes = build::nodes(lights.collect(), &mut places);
        let distant = AliasTable::new(powers[first_distant..].iter().copied());
        let near = match (nodes.is_empty(), &distant) {
            (true, None) => return None,
            (true, Some(_)) => 0.0,
            (false, None) => 1.0,
            (false, Some(_)) => 0.5,
        };
        Some(LightTree {
            nodes,
            places,
            near,
            distant,
            first_distant: first_distant as u32,
        })
    }

    /// Returns the bytes of the tree.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.places.len() * size_of::<u32>()
    }

    /// Chooses a light for the point `from` by a number in `[0, 1)` with 24 bits: returns its index
    /// and its probability.
    #[inline(always)]
    pub fn choose(&self, from: Vec3, choice: f32) -> (u32, f32) {
        // The tree divides the interval further than 24 bits tell apart.
        let [x, y, z] = from.to_array().map(f32::to_bits);
        let [below, ..] = pcg4d([x, y, z, choice.to_bits()]);
        let u = f64::from(choice) + f64::from(below) * (-56f64).exp2();
        if u < self.near {
            let (light, probability) = self.descend(from, u / self.near);
            return (light, (self.near * probability) as f32);
        }
        let Some(distant) = &self.distant else {
            return (0, 0.0);
        };
        let rest = (u - self.near) / (1.0 - self.near);
        // Rounded down to the steps of the table.
        let step = ((rest * 24f64.exp2()) as u32).min((1 << 24) - 1);
        let (index, probability) = distant.sample(step as f32 * (-24f32).exp2());
        let probability = (1.0 - self.near) * f64::from(probability);
        (self.first_distant + index as u32, probability as f32)
    }

    /// Returns the probability with which [`LightTree::choose`] chooses a light for the point
    /// `from`; zero for a light that the scene does not have.
    #[inline(always)]
    pub fn probability(&self, from: Vec3, index: u32) -> f32 {
        if index >= self.first_distant {
            return self.distant_probability(index);
        }
        let mut place = self.places[index as usize];
        if place == NONE {
            return 0.0;
        }
        let mut probability = self.near;
        while place != NONE {
            let node = &self.nodes[place as usize / CHILDREN];
            let importances = node.importances(from);
            let own = f64::from(importances[place as usize % CHILDREN]);
            probability *= own / sum(&importances);
            place = node.parent;
        }
        probability as f32
    }

    /// Returns the probability of an infinitely distant light, the same for all points; zero for a
    /// light that the scene does not have.
    #[inline]
    pub fn distant_probability(&self, index: u32) -> f32 {
        let pmf = self.distant.as_ref().map(|distant| &distant.pmf);
        let own = pmf.and_then(|pmf| pmf.get((index - self.first_distant) as usize));
        own.map_or(0.0, |own| ((1.0 - self.near) * f64::from(*own)) as f32)
    }

    /// Chooses a light of the tree: returns its index and its probability.
    #[inline(always)]
    fn descend(&self, from: Vec3, mut u: f64) -> (u32, f64) {
        let mut probability = 1.0;
        let mut index = 0;
        loop {
            let node = &self.nodes[index as usize];
            let importances = node.importances(from);
            // Sums of the importances up to each child, without a branch between children.
            let (mut sums, mut total) = ([0.0; CHILDREN], 0.0);
            for (end, importance) in sums.iter_mut().zip(&importances) {
                total += f64::from(*importance);
                *end = total;
            }
            let at = u * total;
            let before: usize = sums.iter().map(|end| usize::from(*end <= at)).sum();
            // Rounding may leave the interval of the last child.
            let last = || importances.iter().rposition(|own| *own > 0.0);
            let chosen = if before < CHILDREN {
                before
            } else {
                last().unwrap_or(0)
            };
            let rest = at - chosen.checked_sub(1).map_or(0.0, |i| sums[i]);
            let own = f64::from(importances[chosen]);
            probability *= own / total;
            u = (rest / own).clamp(0.0, BELOW_ONE);
            let child = node.child[chosen];
            if child & LIGHT != 0 {
                return (child & !LIGHT, probability);
            }
            index = child;
        }
    }
}

/// Greatest number below one.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// Sums importances in double precision.
#[inline(always)]
fn sum(importances: &[f32; CHILDREN]) -> f64 {
    importances.iter().map(|own| f64::from(*own)).sum()
}

impl Node {
    /// Returns the importances of all children for a point: power times a bound of the cosine at the
    /// lights over the squared distance [Conty Estevez and Kulla 2018, equation 3]. If none can send
    /// light to the point, returns their powers, so that probabilities sum to one.
    #[inline(always)]
    fn importances(&self, from: Vec3) -> [f32; CHILDREN] {
        let mut importances = [0.0; CHILDREN];
        if self.round {
            for (i, importance) in importances.iter_mut().enumerate() {
                let (_, distance2) = self.offset(i, from);
                *importance = self.power[i] / distance2.max(self.radius2[i]);
            }
        } else {
            for (i, importance) in importances.iter_mut().enumerate() {
                *importance = self.importance(i, from);
            }
        }
        let total: f32 = importances.iter().sum();
        if total > 0.0 && total < f32::INFINITY {
            importances
        } else {
            self.power
        }
    }

    /// Returns the vector from the centre of a child to a point, and its squared length.
    #[inline(always)]
    fn offset(&self, i: usize, from: Vec3) -> ([f32; 3], f32) {
        let d = [
            from.x - self.center[0][i],
            from.y - self.center[1][i],
            from.z - self.center[2][i],
        ];
        (d, d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    }

    /// Returns the importance of a child for a point.
    #[inline(always)]
    fn importance(&self, i: usize, from: Vec3) -> f32 {
        let (d, distance2) = self.offset(i, from);
        let radius2 = self.radius2[i];
        let inverse2 = 1.0 / distance2.max(f32::MIN_POSITIVE);
        let along = self.axis[0][i] * d[0] + self.axis[1][i] * d[1] + self.axis[2][i] * d[2];
        // Angle between the axis and the direction from the centre to the point.
        let cos = (along * inverse2.sqrt()).clamp(-1.0, 1.0);
        let sin = (1.0 - cos * cos).sqrt();
        // Less the half angle of the cone.
        let (cos_o, sin_o) = (self.cos_spread[i], self.sin_spread[i]);
        let in_cone = cos >= cos_o;
        let cos_x = if in_cone {
            1.0
        } else {
            cos * cos_o + sin * sin_o
        };
        let sin_x = if in_cone {
            0.0
        } else {
            sin * cos_o - cos * sin_o
        };
        // Less the half angle under which the point sees the sphere.
        let sin2_u = (radius2 * inverse2).min(1.0);
        let (cos_u, sin_u) = ((1.0 - sin2_u).sqrt(), sin2_u.sqrt());
        let in_sphere = cos_x >= cos_u || distance2 <= radius2;
        let least = if in_sphere {
            1.0
        } else {
            cos_x * cos_u + sin_x * sin_u
        };
        let lit = least >= self.cos_emission[i];
        let value = self.power[i] * least.max(LEAST_COS) / distance2.max(radius2);
        if lit { value } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_among_others_may_be_chosen_from_the_points_that_it_reaches() {
        // Narrow spots that point upwards, in a cube that contains the points to light, and a
        // light in all directions.
        let count = 64;
        let at = |i: u32| {
            let [x, y, z, _] =
                pcg4d([i, 1, 2, 3]).map(|bits| (bits >> 8) as f32 / (1 << 24) as f32);
            Vec3::new(x, y, z)
        };
        let spot = |i: u32| LightBounds {
            emission: 0.1,
            directions: bounds::Directions {
                axis: Vec3::Z,
                spread: 0.0,
            },
            ..LightBounds::round([at(i); 2], 1.0)
        };
        let mut items: Vec<(u32, LightBounds)> = (0..count).map(|i| (i, spot(i))).collect();
        items.push((count, LightBounds::round([Vec3::splat(9.0); 2], 1.0)));
        let mut places = vec![NONE; items.len()];
        let tree = LightTree {
            nodes: build::nodes(items, &mut places),
            places,
            near: 1.0,
            distant: None,
            first_distant: count + 1,
        };
        for i in 0..count {
            let lit = at(i) + 0.05 * Vec3::Z;
            assert!(tree.probability(lit, i) > 0.0, "spot {i}");
        }
    }
}
