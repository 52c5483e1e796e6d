//! Metals, plastic and glass with one interface: their reflection compared with closed forms.

use glam::Vec3;
use lumbre_light::scene::compile::{
    self, Distribution, Formulas, Interface, Material, Model, diffuse_reflectance,
};
use lumbre_light::scene::desc::{MaterialDesc, SceneDesc};
use lumbre_light::transport::bsdf::{TransportMode, fresnel};

use crate::common::WHITE;
use crate::render::bsdf_grid::{NORMAL, albedo, bsdf, direction, interfaces, outgoing, uniform};

#[test]
fn diffuse_reflectance_is_the_mean_of_fresnel_over_the_projected_hemisphere() {
    let n = 20_000;
    for ior in [1.05f32, 1.33, 1.5, 2.4, 0.8, 1.0 / 1.5] {
        let at = |i: u32| {
            f64::from(
                fresnel::dielectric(((f64::from(i) + 0.5) / f64::from(n)).sqrt() as f32, ior)
                    .reflectance,
            )
        };
        let mean = (0..n).map(at).sum::<f64>() / f64::from(n);
        let found = f64::from(diffuse_reflectance(ior));
        assert!(
            (found - mean).abs() < 2e-4,
            "{ior}: {found} instead of {mean}"
        );
    }
}

#[test]
fn albedo_of_white_interfaces_is_at_most_one_and_of_plastic_at_most_1_01() {
    for m in interfaces() {
        let white = Material {
            base_color: Vec3::ONE,
            interface: Interface {
                specular: Vec3::ONE,
                ..m.interface
            },
            ..m
        };
        let bound = if m.model == Model::Plastic {
            1.01
        } else {
            1.002
        };
        for wo in outgoing() {
            for a in albedo(&white, wo) {
                assert!(a <= bound, "{a} from {wo}: {white:?}");
            }
        }
    }
}

#[test]
fn albedo_of_white_rough_diffuse_surfaces_is_at_most_1_015() {
    let white = |roughness| Material {
        model: Model::OrenNayar,
        roughness,
        ..WHITE
    };
    for roughness in [0.0, 0.05, 0.1, 0.15, 0.3, 0.5, 1.0] {
        for wo in outgoing() {
            for a in albedo(&white(roughness), wo) {
                assert!(a <= 1.015, "{a} from {wo}: {roughness}");
            }
        }
    }
    // By quadrature at normal incidence, at a roughness of 0.5: A, since B has no effect there.
    let a = albedo(&white(0.5), direction(1.0, 0.0))[1];
    assert!((a - 0.674_263).abs() < 1e-3, "{a}");
}

#[test]
fn smooth_white_glass_panes_and_mirrors_absorb_nothing() {
    let mirror = Material {
        model: Model::Conductor,
        roughness: 0.0,
        ..WHITE
    };
    let glass = Material {
        model: Model::Dielectric,
        opacity: 0.0,
        roughness: 0.0,
        ..WHITE
    };
    let pane = Material {
        interface: Interface {
            thin: true,
            ..Interface::PLAIN
        },
        roughness: 0.5,
        ..glass
    };
    for m in [mirror, glass, pane] {
        let b = bsdf(&m);
        assert!(!b.has_density());
        for wo in outgoing() {
            for i in 0..50 {
                let u = uniform(i, 51);
                let s = b
                    .sample(wo, u[0], [u[1], u[2]], TransportMode::Importance)
                    .unwrap();
                assert!(
                    s.delta && (s.weight - Vec3::ONE).abs().max_element() < 1e-5,
                    "{s:?} {m:?}"
                );
                let straight = m.interface.thin && s.wi.dot(NORMAL) * wo.dot(NORMAL) < 0.0;
                assert!(
                    !straight || (s.wi + wo).length() < 1e-5,
                    "a pane must not bend light: {s:?}"
                );
            }
        }
    }
}

#[test]
fn a_pane_reflects_the_series_of_reflections_between_its_faces() {
    let pane = |ior| Material {
        model: Model::Dielectric,
        opacity: 0.0,
        ior,
        interface: Interface {
            thin: true,
            ..Interface::PLAIN
        },
        ..WHITE
    };
    // A pane has no inside: which of its sides an index is relative to makes no difference.
    let cosines = [1.0f32, 0.5, 0.2, -0.5];
    for (ior, cos) in [1.5, 1.0 / 1.5]
        .into_iter()
        .flat_map(|ior| cosines.map(|cos| (ior, cos)))
    {
        let wo = direction(cos, 0.3);
        let s = bsdf(&pane(ior))
            .sample(wo, 0.0, [0.5; 2], TransportMode::Radiance)
            .unwrap();
        let r = f64::from(fresnel::dielectric(cos.abs(), 1.5).reflectance);
        let series: f64 = r
            + (0..60)
                .map(|k| (1.0 - r).powi(2) * r.powi(2 * k + 1))
                .sum::<f64>();
        assert!(
            (f64::from(s.pdf_w) - series).abs() < 1e-5,
            "{ior} {cos}: {} instead of {series}",
            s.pdf_w
        );
    }
}

#[test]
fn the_diffuse_albedo_of_smooth_plastic_is_the_series_of_internal_reflections() {
    // The fraction 1 - F of light enters the body. Each internal reflection multiplies it by the
    // albedo of the body; a white body absorbs nothing.
    let fdr = 1.0 - (1.0 - diffuse_reflectance(1.5)) / 2.25;
    for (nonlinear, color) in [(true, 1.0f32), (true, 0.5), (false, 0.5)] {
        let m = Material {
            model: Model::Plastic,
            roughness: 0.0,
            base_color: Vec3::splat(color),
            interface: Interface {
                nonlinear,
                internal_reflectance: fdr,
                ..Interface::PLAIN
            },
            ..WHITE
        };
        for cos in [1.0f32, 0.6, 0.1] {
            let enters = 1.0 - f64::from(fresnel::dielectric(cos, 1.5).reflectance);
            let (a, f) = (f64::from(color), f64::from(fdr));
            let expected = enters * a * (1.0 - f) / (1.0 - if nonlinear { a * f } else { f });
            let found = albedo(&m, direction(cos, 1.0))[1];
            assert!(
                (found - expected).abs() < 2e-3,
                "{cos} {color} {nonlinear}: {found} instead of {expected}"
            );
        }
    }
}

#[test]
fn beckmann_tails_are_lower_than_ggx_tails() {
    let metal = |distribution| Material {
        model: Model::Conductor,
        roughness: 0.5,
        interface: Interface {
            distribution,
            ..Interface::PLAIN
        },
        ..WHITE
    };
    let at = |distribution, cos: f32| {
        bsdf(&metal(distribution))
            .eval(
                direction(1.0, 0.0),
                direction(cos, 0.4),
                TransportMode::Radiance,
            )
            .x
    };
    assert!(at(Distribution::Ggx, 0.3) > 5.0 * at(Distribution::Beckmann, 0.3));
    assert!(at(Distribution::Beckmann, 0.93) > at(Distribution::Ggx, 0.93));
}

/// Returns a material, compiled.
fn compiled(desc: MaterialDesc) -> Material {
    let desc = SceneDesc {
        materials: vec![desc].into(),
        ..SceneDesc::default()
    };
    compile::compile(&desc).unwrap().0.materials[0]
}

/// Values are those of `bsdf.eval` of Mitsuba 3.9.1 over the cosine. Transmittances of rough interfaces
/// are interpolated between fewer cosines here.
#[test]
fn formulas_of_mitsuba_have_its_values() {
    let plastic = |distribution, alpha: f32, nonlinear| MaterialDesc {
        model: Model::Plastic,
        roughness: alpha.sqrt(),
        distribution,
        nonlinear,
        ..MaterialDesc::new("m")
    };
    let (ggx, beckmann) = (Distribution::Ggx, Distribution::Beckmann);
    let coat = MaterialDesc {
        roughness: 0.4,
        clearcoat: 1.0,
        clearcoat_gloss: 0.5,
        ..MaterialDesc::new("m")
    };
    let tint = MaterialDesc {
        roughness: 0.4,
        specular_tint: 0.8,
        ..MaterialDesc::new("m")
    };
    let cases = [
        (
            plastic(ggx, 0.1, true),
            [
                [0.151, 0.06992, 0.03264],
                [0.17672, 0.10916, 0.07808],
                [0.08989, 0.04081, 0.01824],
                [0.46062, 0.3837, 0.34832],
            ],
        ),
        (
            plastic(ggx, 0.1, false),
            [
                [0.20547, 0.11895, 0.06127],
                [0.22211, 0.15001, 0.10194],
                [0.12286, 0.07048, 0.03557],
                [0.5123, 0.43021, 0.37548],
            ],
        ),
        (
            plastic(ggx, 0.3, true),
            [
                [0.13605, 0.07221, 0.03927],
                [0.20943, 0.15508, 0.12704],
                [0.09154, 0.04612, 0.0227],
                [0.23337, 0.17402, 0.14341],
            ],
        ),
        (
            plastic(ggx, 0.3, false),
            [
                [0.16247, 0.0979, 0.05485],
                [0.23193, 0.17696, 0.14031],
                [0.11034, 0.0644, 0.03378],
                [0.25793, 0.19791, 0.15789],
            ],
        ),
        (
            plastic(beckmann, 0.1, true),
            [
                [0.15298, 0.06757, 0.02935],
                [0.12863, 0.05847, 0.02707],
                [0.07941, 0.03507, 0.01523],
                [0.62038, 0.53906, 0.50266],
            ],
        ),
        (
            plastic(beckmann, 0.1, false),
            [
                [0.2166, 0.12377, 0.06189],
                [0.1809, 0.10464, 0.0538],
                [0.11243, 0.06425, 0.03212],
                [0.68096, 0.59258, 0.53365],
            ],
        ),
        (
            plastic(beckmann, 0.3, true),
            [
                [0.16087, 0.08283, 0.04622],
                [0.30315, 0.2363, 0.20495],
                [0.10381, 0.04735, 0.02087],
                [0.27675, 0.20338, 0.16897],
            ],
        ),
        (
            plastic(beckmann, 0.3, false),
            [
                [0.20941, 0.12711, 0.07224],
                [0.34472, 0.27423, 0.22723],
                [0.13893, 0.07939, 0.03969],
                [0.32238, 0.24501, 0.19343],
            ],
        ),
        (
            coat,
            [
                [0.23504, 0.13954, 0.07588],
                [0.31616, 0.22532, 0.16476],
                [0.25552, 0.14673, 0.0742],
                [0.53599, 0.44091, 0.37752],
            ],
        ),
        (
            tint,
            [
                [0.2331, 0.13382, 0.06763],
                [0.30799, 0.19398, 0.11797],
                [0.25581, 0.1463, 0.07329],
                [0.51543, 0.33163, 0.2091],
            ],
        ),
    ];
    let pairs = [
        ([0.9, 0.0], [0.8, 2.0]),
        ([0.3, 1.0], [0.7, 4.0]),
        ([0.1, 0.0], [0.5, 0.5]),
        ([0.6, 0.0], [0.6, 3.3]),
    ];
    for (desc, values) in cases {
        let material = compiled(MaterialDesc {
            base_color: Vec3::new(0.7, 0.4, 0.2),
            formulas: Formulas::Mitsuba,
            ..desc.clone()
        });
        for ((o, i), expected) in pairs.into_iter().zip(values) {
            let [wo, wi] = [o, i].map(|[cos, azimuth]| direction(cos, azimuth));
            let found = bsdf(&material).eval(wo, wi, TransportMode::Radiance);
            let error = (found / Vec3::from_array(expected) - 1.0)
                .abs()
                .max_element();
            assert!(
                error < 0.006,
                "{desc:?} at {o:?} {i:?}: {found}, not {expected:?}"
            );
        }
    }
}
