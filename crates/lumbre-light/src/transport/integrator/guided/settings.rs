//! The parameters of [`guided`](super).

use std::collections::BTreeMap;

use crate::value::Value;
use crate::value::schema::{Field, Ty};

/// Default of [`TRAINING`].
pub const SAMPLES_THAT_TRAIN: u64 = 256;

/// The parameter `training` of `guided`.
pub const TRAINING: Field = crate::field! {
    training = "256": TRAINING_RANGE,
        "number of samples of every pixel from which the tree learns, the first ones; they are \
         part of the picture"
};

/// Default of [`TRAINING_BEFORE`].
pub const PATHS_BEFORE: u64 = 32;

/// The parameter `training` of `guided_bdpt`.
pub const TRAINING_BEFORE: Field = crate::field! {
    training = "32": TRAINING_RANGE,
        "number of training paths of every pixel, which are traced before the first sample and \
         only shape the tree; their time counts as render time"
};

/// Range of the parameter `training`.
const TRAINING_RANGE: Ty = Ty::int(1, 1 << 20);

/// The parameter `bsdf_fraction`.
pub const BSDF_FRACTION: Field = crate::field! {
    bsdf_fraction = "0.5": Ty::num(0.05, 1.0),
        "fraction of directions that are sampled by the BSDF; the others are sampled by the tree, \
         and the density is that of the mixture"
};

/// The parameter `target`.
pub const TARGET: Field = crate::field! {
    target = "mean": Ty::Word(&["mean", "variance"]),
        "what the tree's density is proportional to: \"mean\" is what paths in a direction \
         contribute to the picture on average; \"variance\" is the root of their mean square, \
         which has the least variance but needs longer training [Rath et al. 2020]"
};

/// The parameter `split`.
pub const SPLIT: Field = crate::field! {
    split = "1000": Ty::num(1.0, 1e9),
        "a region of space is divided if more than split * sqrt(2^k) vertices of training \
         iteration k lie in it [Müller et al. 2017]"
};

/// The parameter `tree_memory`.
pub const TREE_MEMORY: Field = crate::field! {
    tree_memory = "64": Ty::int(1, 1 << 16),
        "greatest memory of the tree in MiB, while it is trained; a tree that would take more is \
         divided less"
};

/// Quantity to which the density of directions is proportional.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The root of the mean square of contributions.
    Variance,
    /// The mean contribution.
    Mean,
}

/// The parameters of [`guided`](super).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guiding {
    /// Number of paths of every pixel from which the tree learns; `None` for the technique's default.
    pub training: Option<u64>,
    /// Fraction of directions that are sampled by the BSDF.
    pub bsdf_fraction: f32,
    /// Quantity to which the density of directions is proportional.
    pub target: Target,
    /// Number of vertices above which a leaf is divided in the first training iteration.
    pub split: f64,
    /// Greatest memory of the tree in MiB.
    pub tree_memory: u64,
}

impl Guiding {
    /// Parses parameters that satisfy their schema.
    pub fn from_params(params: &BTreeMap<String, Value>) -> Guiding {
        let number = |field: Field, default: f64| {
            let given = params.get(field.key).and_then(Value::as_f64);
            given.unwrap_or(default)
        };
        let variance = params.get(TARGET.key).and_then(Value::as_str) == Some("variance");
        Guiding {
            training: params
                .get(TRAINING.key)
                .and_then(Value::as_f64)
                .map(|paths| paths as u64),
            bsdf_fraction: number(BSDF_FRACTION, 0.5) as f32,
            target: if variance {
                Target::Variance
            } else {
                Target::Mean
            },
            split: number(SPLIT, 1000.0),
            tree_memory: number(TREE_MEMORY, 64.0) as u64,
        }
    }

    /// Returns the greatest number of bytes that the tree takes.
    pub fn tree_bytes(&self) -> u64 {
        self.tree_memory << 20
    }
}

impl Target {
    /// Returns the value of a direction whose path contributed `light` to a pixel, and whose density
    /// was `pdf_w`. Its mean over samples estimates the integral of the squared or of the plain
    /// product of throughput, BSDF, cosine and radiance. Of the three channels, the square is the
    /// sum of squares.
    pub fn value(self, light: glam::Vec3, pdf_w: f32) -> f32 {
        let square = light.length_squared();
        match self {
            Target::Variance => square * pdf_w,
            Target::Mean => square.sqrt(),
        }
    }

    /// Returns the function from the sum of a cell's values and its area to its mass.
    pub fn mass_of(self) -> fn(f64, f64) -> f64 {
        match self {
            Target::Variance => |sum, area| (sum * area).sqrt(),
            Target::Mean => |sum, _| sum,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_those_of_the_schema() {
        let fields = [BSDF_FRACTION, TARGET, SPLIT, TREE_MEMORY];
        let given = fields.map(|field| {
            let value = match field.ty {
                Ty::Word(_) => Value::from(field.default),
                _ => Value::Num(field.default.parse().expect("a number")),
            };
            (field.key.to_owned(), value)
        });
        let plain = Guiding::from_params(&BTreeMap::new());
        assert_eq!(plain, Guiding::from_params(&given.into()));
        let other = [("training", Value::Int(7)), ("target", "variance".into())];
        let other = other.map(|(key, value): (&str, Value)| (key.to_owned(), value));
        let other = Guiding::from_params(&other.into());
        assert_eq!((other.training, other.target), (Some(7), Target::Variance));
        let training = [
            (TRAINING, SAMPLES_THAT_TRAIN),
            (TRAINING_BEFORE, PATHS_BEFORE),
        ];
        for (field, default) in training {
            assert_eq!(field.default, default.to_string());
        }
    }

    #[test]
    fn masses_follow_from_values_as_the_least_variance_demands() {
        // Two cells of one area with contributions 1 and 3, sampled equally often with density 2.
        for (target, expected) in [(Target::Variance, 3.0), (Target::Mean, 3.0)] {
            let mass = |light: f32| {
                let value = target.value(glam::Vec3::new(light, 0.0, 0.0), 2.0);
                (target.mass_of())(f64::from(value), 0.25)
            };
            assert!(
                (mass(3.0) / mass(1.0) - expected).abs() < 1e-6,
                "{target:?}"
            );
            // The light of a direction is divided by its density, with which it is drawn.
            let of_density = |pdf_w: f32| {
                let light = glam::Vec3::splat(6.0 / pdf_w);
                pdf_w * target.value(light, pdf_w)
            };
            assert!(
                (of_density(2.0) / of_density(4.0) - 1.0).abs() < 1e-6,
                "{target:?}"
            );
            // A cell of four times the area with the same mean value.
            let mass_of = target.mass_of();
            assert!(
                (mass_of(4.0, 1.0) / mass_of(1.0, 0.25) - 4.0).abs() < 1e-6,
                "{target:?}"
            );
        }
    }
}
