//! Multiple importance sampling: weights of strategies that can find the same path [Veach 1997, ch.
//! 9].
//!
//! A weight is `term(p_own) / sum of term(p_i)` over all strategies that could have found the path.
//! Any positive terms that are functions of the path alone give weights that sum to one, and so
//! preserve the mean; the terms affect only the variance. This is why Russian roulette may be left
//! out of the densities: it divides the surviving contribution by the survival probability, which
//! preserves the mean of each strategy's estimator separately, whatever weight multiplies it.

use std::collections::BTreeMap;

use crate::math::real::{Double, Mask, Real};
use crate::value::Value;
use crate::value::schema::{Field, Ty};

/// The parameter `mis` of every integrator that combines strategies.
pub const FIELD: Field = crate::field! {
    mis = "power": Ty::Word(&["power", "balance", "none"]),
        "how strategies that find the same light are weighted: by the squares of their densities, \
         by their densities, or not by densities at all [Veach 1997, ch. 9]"
};

/// The function that maps a density to its term in a weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heuristic {
    /// The squared density: the power heuristic with exponent two.
    Power,
    /// The density: the balance heuristic.
    Balance,
    /// One if the density is positive: all strategies that can find a path share it equally.
    Uniform,
}

impl Heuristic {
    /// Returns the heuristic that the parameter `mis` names; `None` for `"none"`.
    #[inline]
    pub fn from_params(params: &BTreeMap<String, Value>) -> Option<Heuristic> {
        match params.get(FIELD.key).and_then(Value::as_str) {
            Some("none") => None,
            Some("balance") => Some(Heuristic::Balance),
            _ => Some(Heuristic::Power),
        }
    }

    /// Returns the term of a density, or of a ratio of densities: the term of a product is the
    /// product of the terms.
    #[inline(always)]
    pub fn term<D: Double>(self, p: D) -> D {
        match self {
            Heuristic::Power => p * p,
            Heuristic::Balance => p,
            Heuristic::Uniform => D::select(p.gt(D::splat(0.0)), D::splat(1.0), D::splat(0.0)),
        }
    }

    /// Returns the weight of a strategy of density `own` against one other of density `other` in
    /// the same measure.
    #[inline(always)]
    pub fn weight<R: Real>(self, own: R, other: R) -> R {
        let zero = R::splat(0.0);
        let some = own.gt(zero);
        if !some.any() {
            return zero;
        }
        let one = R::Double::splat(1.0);
        R::select(
            some,
            (one / (one + self.term(other.double() / own.double()))).single(),
            zero,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_weights_sum_to_one_at_every_scale() {
        for h in [Heuristic::Power, Heuristic::Balance, Heuristic::Uniform] {
            for (a, b) in [(1.0, 3.0), (1e-20, 1e20), (1e30, 1e30), (2.0, 0.0)] {
                assert!(
                    (h.weight(a, b) + h.weight(b, a) - 1.0).abs() < 1e-6,
                    "{h:?} {a} {b}"
                );
            }
        }
        assert_eq!(Heuristic::Power.weight(3.0, 1.0), 0.9);
        assert_eq!(Heuristic::Balance.weight(3.0, 1.0), 0.75);
        assert_eq!(Heuristic::Uniform.weight(3.0, 1.0), 0.5);
    }

    #[test]
    fn parameters_name_heuristics() {
        let params = |word: &str| BTreeMap::from([("mis".to_owned(), Value::from(word))]);
        assert_eq!(
            Heuristic::from_params(&BTreeMap::new()),
            Some(Heuristic::Power)
        );
        assert_eq!(
            Heuristic::from_params(&params("balance")),
            Some(Heuristic::Balance)
        );
        assert_eq!(Heuristic::from_params(&params("none")), None);
    }
}
