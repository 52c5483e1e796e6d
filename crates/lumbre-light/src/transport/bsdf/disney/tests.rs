//! Coats over glass and metal, rough and smooth.

use std::ops::Range;

use glam::Vec3;

use super::super::material::{BsdfClass, MaterialConstants};
use super::super::{LobeSample, MixtureSample, TransportMode};
use super::*;
use crate::math::rng::{pcg4d, unit};
use crate::scene::compile::{Distribution, Formulas, KNOTS, Model};

/// Returns a white surface of a roughness, with the weights of the opaque dielectric, the metal and
/// the refractive dielectric, under a clear coat of a strength.
fn surface(roughness: f32, weights: [f32; 3], clearcoat: f32, one_sided: bool) -> Disney {
    let constants = MaterialConstants {
        ior: 1.5,
        aspect: 1.0,
        smooth_below: 0.01,
        subsurface: 0.0,
        specular_tint: 0.0,
        sheen: 0.0,
        sheen_tint: 0.0,
        coat: Clearcoat::new(clearcoat, 0.5, Formulas::Lumbre),
        specular: Vec3::ONE,
        eta: Vec3::ONE,
        k: Vec3::ZERO,
        internal_reflectance: 0.0,
        transmittance: [0.0; KNOTS],
    };
    let class = BsdfClass {
        model: Model::Disney,
        formulas: Formulas::Lumbre,
        rough_body: false,
        distribution: Distribution::Ggx,
        thin: false,
        nonlinear: false,
        one_sided,
        anisotropic: false,
        tinted: false,
    };
    Disney::with_weights(&class, &constants, Vec3::ONE, roughness, weights)
}

/// Returns a unit direction with a cosine to the normal.
fn direction(cos: f32) -> Vec3 {
    Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos)
}

/// Returns samples of a surface for one direction.
fn samples(surface: &Disney, wo: Vec3, numbers: Range<u32>) -> Vec<MixtureSample> {
    let out = surface.outgoing(wo);
    let count = numbers.len() as f32;
    numbers
        .filter_map(|i| {
            let [v, w, ..] = pcg4d([i, 5, 6, 7]).map(unit);
            let u = (i as f32 + 0.5) / count;
            let (some, sample, _) =
                surface.sample::<false>(&out, u, [v, w], TransportMode::Radiance);
            some.then_some(sample)
        })
        .collect()
}

/// Returns the shares of light that are reflected and transmitted.
fn shares(surface: &Disney, wo: Vec3) -> [f32; 2] {
    let count = 1 << 13;
    let mut shares = [0.0; 2];
    for MixtureSample { sample, .. } in samples(surface, wo, 0..count) {
        // Refraction scales radiance by one over the square of the index.
        let LobeSample { wi, weight, eta } = sample;
        shares[usize::from(wi.z * wo.z < 0.0)] += weight.x * eta * eta / count as f32;
    }
    shares
}

/// The coat is the same whether the glass below is smooth or a little rough: light that is reflected
/// at the back of a one-sided surface does not pass it, all other light does.
#[test]
fn coated_glass_that_is_almost_smooth_looks_like_smooth_glass() {
    let glass = [0.0, 0.0, 1.0];
    for one_sided in [false, true] {
        // Cosines at which the ray outside is at a grazing angle, where the coat reflects much.
        for cos in [0.2f32, -0.757] {
            let wo = direction(cos);
            let [rough, smooth] =
                [0.04, 0.0].map(|roughness| shares(&surface(roughness, glass, 1.0, one_sided), wo));
            for (share, (a, b)) in ["reflected", "transmitted"]
                .iter()
                .zip(rough.iter().zip(smooth))
            {
                let what = format!("one-sided {one_sided}, cosine {cos}, {share}");
                assert!((a - b).abs() < 0.02, "{what}: {a} if rough, {b} if smooth");
            }
        }
    }
}

/// A coat never adds energy: what is below it gets and returns only what the coat lets pass.
#[test]
fn coated_white_glass_conserves_energy() {
    for roughness in [0.0, 0.1, 0.3] {
        for cos in [0.2f32, 0.5, 1.0, -0.757, -1.0] {
            let coated = surface(roughness, [0.0, 0.0, 1.0], 1.0, false);
            let sum = shares(&coated, direction(cos)).iter().sum::<f32>();
            assert!(sum < 1.005, "roughness {roughness}, cosine {cos}: {sum}");
        }
    }
}

#[test]
fn a_surface_has_a_density_exactly_if_it_samples_directions_by_one() {
    for (roughness, weights, clearcoat, expected) in [
        (0.0, [1.0, 0.0, 0.0], 0.0, true),
        (0.0, [0.0, 1.0, 0.0], 0.0, false),
        (0.3, [0.0, 1.0, 0.0], 0.0, true),
        (0.0, [0.0, 1.0, 0.0], 1.0, true),
        (0.0, [0.0, 0.0, 1.0], 0.0, false),
        (0.3, [0.0, 0.0, 1.0], 0.0, true),
        (0.0, [0.0, 0.0, 1.0], 1.0, true),
    ] {
        let surface = surface(roughness, weights, clearcoat, false);
        let sampled = samples(&surface, direction(0.4), 0..1024)
            .iter()
            .any(|s| !s.delta);
        let what = format!("roughness {roughness}, weights {weights:?}, clear coat {clearcoat}");
        assert_eq!(sampled, expected, "{what}: samples");
        assert_eq!(surface.has_density(), expected, "{what}: has_density");
    }
}
