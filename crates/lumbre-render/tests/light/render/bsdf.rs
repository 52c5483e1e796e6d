//! BSDF sampling compared with its density and value.

use glam::Vec3;
use lumbre_light::math::stats::{chi_square_p, sidak};
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::compile::{Distribution, Material, Model};
use lumbre_light::transport::bsdf::{Bsdf, TransportMode};
use lumbre_light::transport::surface::{Surface, TerminatorOffset};

use crate::common::WHITE;
use lumbre_render::lobe::cells::{SphereCells, narrowest};

use crate::render::bsdf_grid::{
    DISNEY, Mix, NORMAL, albedo, bsdf, grid, grids, interfaces, one_sided, outgoing, sheets,
    surface, uniform,
};

/// Significance of all chi-square tests of this file together.
const SIGNIFICANCE: f64 = 0.01;
/// Samples of each test.
const SAMPLES: u32 = 16_000;

/// Returns the ideal materials.
fn ideal() -> Vec<Material> {
    let mut all = Vec::new();
    for metallic in [0.0, 0.4, 1.0] {
        for opacity in [0.0, 0.5, 1.0] {
            for ior in [1.2, 2.5] {
                all.push(Material {
                    model: Model::Lambert,
                    metallic,
                    opacity,
                    ior,
                    ..DISNEY
                });
            }
        }
    }
    all
}

/// Returns the number of chi-square tests of this file: one for each material and direction.
fn tests() -> usize {
    let materials = [grids(), ideal(), interfaces(), one_sided(), sheets()];
    materials.iter().map(Vec::len).sum::<usize>() * outgoing().len()
}

/// Returns the relative error of a density from rounding a direction: the logarithm of GGX changes
/// by up to 2 / alpha per radian of the half vector, which turns by 1 / (2 cos) of the turn of a
/// grazing direction, and further where refraction bends little. The logarithm of Beckmann's
/// distribution changes by up to 2 x / alpha, where x is four in the tails that are still sampled.
fn rounding(m: &Material, wo: Vec3, wi: Vec3) -> f32 {
    let cos = wo.dot(NORMAL).abs().min(wi.dot(NORMAL).abs());
    let bend = if m.opacity < 1.0 {
        (m.ior - 1.0).abs().min(1.0)
    } else {
        1.0
    };
    let tails = if m.interface.distribution == Distribution::Beckmann {
        4.0
    } else {
        1.0
    };
    1e-3 + tails * 5e-7 / (narrowest(m) as f32 * cos * bend)
}

/// Compares samples with the density integrated over cells. Samples without a density are counted
/// in a further cell, whose probability is one minus the integral of the density.
fn assert_samples_follow_density(materials: &[Material]) {
    let level = sidak(SIGNIFICANCE, tests());
    for material in materials {
        let b = bsdf(material);
        for wo in outgoing() {
            let samples: Vec<_> = (0..SAMPLES)
                .map(|i| {
                    let u = uniform(i, 7);
                    let s = b.sample(wo, u[0], [u[1], u[2]], TransportMode::Importance);
                    s.filter(|s| !s.delta)
                })
                .collect();
            for s in samples.iter().flatten() {
                let close = |a: f32, b: f32, relative: f32| {
                    (a - b).abs() <= relative * a.abs().max(b.abs()) + 1e-5
                };
                assert!((s.wi.length() - 1.0).abs() < 1e-5);
                let pdf_w = b.pdf_w(wo, s.wi);
                assert!(
                    close(s.pdf_w, pdf_w, rounding(material, wo, s.wi)),
                    "{s:?} {pdf_w} {material:?}"
                );
                let weight =
                    b.eval(wo, s.wi, TransportMode::Importance) * (s.wi.dot(NORMAL).abs() / pdf_w);
                assert!(
                    (0..3).all(|c| close(weight[c], s.weight[c], 1e-3)),
                    "{s:?} {weight} {material:?}"
                );
                let unbent = material.ior == 1.0 || s.wi.dot(NORMAL) * wo.dot(NORMAL) > 0.0;
                assert_eq!(unbent, s.eta == 1.0);
            }
            let sphere = SphereCells::for_lobes(material, NORMAL, wo);
            let mut observed = vec![0.0; sphere.cells() + 1];
            for s in &samples {
                observed[s.map_or(sphere.cells(), |s| sphere.cell(s.wi))] += 1.0;
            }
            let n = f64::from(SAMPLES);
            let mass = sphere.integrate(|wi| [f64::from(b.pdf_w(wo, wi))]);
            let mut expected: Vec<f64> = mass.iter().map(|m| m[0] * n).collect();
            let total: f64 = expected.iter().sum();
            assert!(
                total <= n * 1.001,
                "the density integrates to {}: {material:?} {wo}",
                total / n
            );
            // The error of the quadrature must not make the last probability negative.
            expected.push((n - total).max(1e-4 * n));
            let p = chi_square_p(&observed, &expected, 0);
            assert!(p > level, "p = {p} for {material:?}, {wo}");
        }
    }
}

#[test]
fn opaque_dielectrics_follow_their_density() {
    assert_samples_follow_density(&grid(Mix::Opaque));
}

#[test]
fn metals_follow_their_density() {
    assert_samples_follow_density(&grid(Mix::Metal));
}

#[test]
fn rough_glass_follows_its_density_from_both_sides() {
    assert_samples_follow_density(&grid(Mix::Glass));
}

#[test]
fn mixtures_follow_their_density() {
    assert_samples_follow_density(&grid(Mix::All));
}

#[test]
fn ideal_surfaces_follow_their_density() {
    assert_samples_follow_density(&ideal());
}

#[test]
fn metals_plastic_and_glass_of_both_distributions_follow_their_density() {
    assert_samples_follow_density(&interfaces());
}

#[test]
fn translucent_sheets_follow_their_density() {
    assert_samples_follow_density(&sheets());
}

#[test]
fn one_sided_surfaces_follow_their_density() {
    assert_samples_follow_density(&one_sided());
}

#[test]
fn the_mean_weight_of_samples_is_the_integral_of_the_value() {
    // Sampling must cover all directions that the quadrature of the value covers.
    let n = 8000;
    let all = grids().into_iter().chain(interfaces()).chain(one_sided());
    let cases: Vec<Material> = all.step_by(3).chain(sheets()).collect();
    let level = sidak(0.01, cases.len() * outgoing().len() * 3);
    for material in cases {
        let b = bsdf(&material);
        for wo in outgoing() {
            let expected = albedo(&material, wo);
            let (mut sum, mut sum2) = ([0.0f64; 3], [0.0f64; 3]);
            for i in 0..n {
                let u = uniform(i, 8);
                let Some(s) = b.sample(wo, u[0], [u[1], u[2]], TransportMode::Importance) else {
                    continue;
                };
                for c in 0..3 {
                    let w = if s.delta { 0.0 } else { f64::from(s.weight[c]) };
                    sum[c] += w;
                    sum2[c] += w * w;
                }
            }
            for c in 0..3 {
                let mean = sum[c] / f64::from(n);
                let variance = (sum2[c] / f64::from(n) - mean * mean).max(0.0) / f64::from(n);
                let sigma = variance.sqrt().max(1e-3 * expected[c]) + 1e-6;
                let p = lumbre_light::math::stats::normal_two_sided_p((mean - expected[c]) / sigma);
                assert!(
                    p > level,
                    "{mean} +- {sigma} instead of {} for {material:?}, {wo}",
                    expected[c]
                );
            }
        }
    }
}

#[test]
fn shading_normals_do_not_leak_light_through_the_surface() {
    let material = WHITE;
    let mut s = surface(&material);
    s.n_shading =
        (s.n_geometric + s.n_geometric.any_orthonormal_vector() * 1.2).normalize_or(Vec3::Z);
    let bsdf = Bsdf::new(&s, &[]);
    for i in 0..2000 {
        let u = uniform(i, 9);
        let wo = uniform_sphere([u[0], u[1]]);
        if let Some(x) = bsdf.sample(wo, 0.3, [u[2], u[3]], TransportMode::Radiance) {
            assert!(x.wi.dot(s.n_geometric) * wo.dot(s.n_geometric) > 0.0);
        }
    }
}

#[test]
fn light_from_below_a_triangle_is_reflected_to_the_camera_and_not_the_other_way() {
    let tilt = NORMAL.any_orthonormal_vector();
    let point = Surface {
        n_shading: (NORMAL + 0.5 * tilt).normalize_or(NORMAL),
        terminator: Some(TerminatorOffset {
            exists: true,
            base: Vec3::ZERO,
            lifted_point: NORMAL,
            up: NORMAL,
            lifted: false,
        }),
        ..surface(&WHITE)
    };
    let bsdf = Bsdf::new(&point, &[]);
    let out = bsdf.outgoing((NORMAL + 0.3 * tilt).normalize_or(NORMAL));
    // Above the plane of the shading normal, above and below the triangle.
    for (below, modes) in [(0.2, [true, true]), (-0.2, [true, false])] {
        let wi = (tilt + below * NORMAL).normalize_or(NORMAL);
        let lit = [TransportMode::Radiance, TransportMode::Importance].map(|mode| {
            let value = bsdf.values::<true>(&out, wi, mode, true);
            value.f != Vec3::ZERO
        });
        assert_eq!(lit, modes, "{below}");
    }
}
