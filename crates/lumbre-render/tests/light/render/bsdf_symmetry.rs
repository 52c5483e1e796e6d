//! Symmetries of the BSDF: reciprocity, both transport modes, densities from both ends, and shading
//! normals.

use glam::Vec3;
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::compile::{Material, Model};
use lumbre_light::transport::bsdf::{Bsdf, TransportMode};
use lumbre_light::transport::surface::Surface;

use lumbre_render::lobe::cells::narrowest;

use crate::render::bsdf_grid::{
    DISNEY, NORMAL, bsdf, direction, grids, interfaces, one_sided, outgoing, sheets, surface,
    uniform,
};

/// Returns pairs of directions: half at random, half sampled so that narrow lobes are hit.
fn pairs(b: &Bsdf, n: u32) -> Vec<(Vec3, Vec3)> {
    let mut all = Vec::new();
    for i in 0..n {
        let u = uniform(i, 21);
        let wo = uniform_sphere([u[0], u[1]]);
        all.push((wo, uniform_sphere([u[2], u[3]])));
        if let Some(s) = b
            .sample(wo, u[2], [u[3], uniform(i, 22)[0]], TransportMode::Radiance)
            .filter(|s| !s.delta)
        {
            all.push((wo, s.wi));
        }
    }
    assert_eq!(b.has_density(), all.len() > n as usize);
    all
}

fn cos(w: Vec3) -> f32 {
    w.dot(NORMAL)
}

/// Returns the rounding error of grazing half vectors and narrow lobes, as for densities.
fn tolerance(m: &Material, wo: Vec3, wi: Vec3) -> f32 {
    let bend = if m.opacity < 1.0 {
        (m.ior - 1.0).abs().min(1.0)
    } else {
        1.0
    };
    1e-3 + 1e-6 / (narrowest(m) as f32 * cos(wo).abs().min(cos(wi).abs()) * bend)
}

fn materials() -> Vec<Material> {
    let mut all = grids();
    all.extend(interfaces());
    all.extend(one_sided());
    all.extend(sheets());
    for opacity in [0.0, 0.5, 1.0] {
        all.push(Material {
            model: Model::Lambert,
            opacity,
            ..DISNEY
        });
    }
    all
}

#[test]
fn reflection_is_reciprocal_and_refraction_is_up_to_the_squared_index() {
    let (mut reflected, mut refracted) = (0, 0);
    for m in materials() {
        let b = bsdf(&m);
        for (wo, wi) in pairs(&b, 300) {
            let (f, g) = (
                b.eval(wo, wi, TransportMode::Radiance),
                b.eval(wi, wo, TransportMode::Radiance),
            );
            // Radiance over squared index is conserved [Veach 1997, 5.2]: f(wo, wi) n_i^2 = f(wi,
            // wo) n_o^2.
            let n2 = |w: Vec3| if cos(w) > 0.0 { 1.0 } else { m.ior * m.ior };
            let same_side = cos(wo) * cos(wi) > 0.0;
            let (f, g) = if same_side {
                (f, g)
            } else {
                (f * n2(wi), g * n2(wo))
            };
            let close = |a: Vec3, b: Vec3| {
                (a - b).abs().max_element() <= tolerance(&m, wo, wi) * a.max(b).max_element() + 1e-5
            };
            assert!(
                f.min_element() >= 0.0 && close(f, g),
                "{f} {g}: {wo} {wi} {m:?}"
            );
            // Importance from one end equals radiance from the other, without a factor.
            let (light, camera) = (
                b.eval(wi, wo, TransportMode::Importance),
                b.eval(wo, wi, TransportMode::Radiance),
            );
            assert!(close(light, camera), "{light} {camera}: {wo} {wi} {m:?}");
            if f.max_element() > 1e-3 {
                if same_side {
                    reflected += 1
                } else {
                    refracted += 1
                }
            }
        }
    }
    assert!(
        reflected > 10_000 && refracted > 3_000,
        "{reflected} {refracted}"
    );
}

#[test]
fn directions_sampled_from_one_end_have_a_density_from_the_other() {
    // `pdf_w(wi, wo)` is the density of sampling from the other end, as the chi-square tests show
    // for every first argument. This test checks that it is positive where needed, and that both
    // ends give a path the same value.
    for m in grids() {
        let b = bsdf(&m);
        for wo in outgoing() {
            for i in 0..200 {
                let u = uniform(i, 23);
                let Some(s) = b
                    .sample(wo, u[0], [u[1], u[2]], TransportMode::Radiance)
                    .filter(|s| !s.delta)
                else {
                    continue;
                };
                let back = b.pdf_w(s.wi, wo);
                assert!(
                    back > 0.0 && back.is_finite(),
                    "{back} after {s:?} from {wo}: {m:?}"
                );
                // Both ends give the path the same value: weight pdf_w = f cos.
                let camera = s.weight * s.pdf_w / cos(s.wi).abs();
                let light = b.eval(s.wi, wo, TransportMode::Importance);
                let allowed = tolerance(&m, wo, s.wi) * camera.max_element() + 1e-4;
                assert!(
                    (camera - light).abs().max_element() <= allowed,
                    "{camera} {light} {s:?} {wo} {m:?}"
                );
            }
        }
    }
}

/// `evaluate` and `sample` return the density of the reverse direction beside that of the forward
/// one; both must be what [`Bsdf::pdf_w`] is with the directions exchanged.
#[test]
fn reverse_densities_are_the_densities_of_exchanged_directions() {
    let both = [TransportMode::Radiance, TransportMode::Importance];
    for m in materials() {
        let b = bsdf(&m);
        let same = |found: f32, wo: Vec3, wi: Vec3, what: &str| {
            let expected = b.pdf_w(wi, wo);
            // Only the Disney model computes the two by different operations, and only sampled
            // directions are rounded in between.
            let exact = m.model != Model::Disney && what == "evaluate";
            let bound = if exact {
                0.0
            } else {
                tolerance(&m, wo, wi) * expected.abs().max(found.abs()) + 1e-12
            };
            assert!(
                (found - expected).abs() <= bound,
                "{what}: {found} instead of {expected} from {wo} to {wi} for {m:?}"
            );
            u32::from(expected > 0.0)
        };
        let mut positive = 0;
        for (wo, wi) in pairs(&b, 300) {
            for mode in both {
                let value = b.evaluate(wo, wi, mode);
                assert!((value.pdf_w > 0.0) == (b.pdf_w(wo, wi) > 0.0));
                positive += same(value.reverse_pdf_w, wo, wi, "evaluate");
            }
        }
        for (i, wo) in (0..60).flat_map(|i| outgoing().map(|wo| (i, wo))) {
            let u = uniform(i, 24);
            for mode in both {
                let out = b.outgoing(wo);
                let (some, s, reverse) = b.samples::<true>(&out, u[0], [u[1], u[2]], mode);
                match (out.same_side && some).then_some((s, reverse)) {
                    Some((s, reverse)) if s.delta => assert_eq!(reverse, 0.0),
                    Some((s, reverse)) => positive += same(reverse, wo, s.wi, "sample"),
                    None => {}
                }
            }
        }
        assert!(positive > 100 || !b.has_density(), "{positive}: {m:?}");
    }
}

#[test]
fn smooth_interfaces_are_reciprocal_up_to_the_squared_index() {
    for m in [
        Material {
            opacity: 0.0,
            roughness: 0.0,
            ..DISNEY
        },
        Material {
            model: Model::Lambert,
            opacity: 0.0,
            ..DISNEY
        },
    ] {
        let b = bsdf(&m);
        for wo in outgoing() {
            for u in [0.0, 0.02, 0.5, 0.999_999] {
                let Some(s) = b.sample(wo, u, [0.5; 2], TransportMode::Radiance) else {
                    continue;
                };
                assert!(s.delta);
                // The reverse event: one of the two numbers selects it.
                let back = [0.0, 0.999_999]
                    .into_iter()
                    .filter_map(|u| b.sample(s.wi, u, [0.5; 2], TransportMode::Importance))
                    .find(|x| x.wi.dot(wo) > 0.999_9)
                    .unwrap();
                assert!(
                    (back.pdf_w - s.pdf_w).abs() < 1e-3 && (back.eta * s.eta - 1.0).abs() < 1e-5
                );
                // The value of a Dirac lobe times the cosine is weight times density. Only radiance
                // is scaled by the squared index.
                assert!(
                    (back.weight - s.weight * s.eta * s.eta).abs().max_element() < 1e-4,
                    "{back:?} {s:?}"
                );
                assert_eq!(b.pdf_w(wo, s.wi), 0.0);
                assert_eq!(b.eval(wo, s.wi, TransportMode::Radiance), Vec3::ZERO);
            }
        }
        assert!(!b.has_density());
    }
}

#[test]
fn radiance_and_importance_agree_for_shading_normals() {
    // A light path must contribute what a camera path along the same edges does [Veach 1997,
    // 5.3.2]. Between the vertex's edges to camera and light: f_camera |l . n_s| / |l . n_g| =
    // f_light |c . n_s| / |c . n_g|.
    let mut tested = 0;
    for m in materials() {
        let mut s: Surface<'_> = surface(&m);
        s.n_shading = (NORMAL + direction(0.0, 1.0) * 0.6).normalize_or(NORMAL);
        let b = Bsdf::new(&s, &[]);
        for i in 0..200 {
            let u = uniform(i, 24);
            let c = uniform_sphere([u[0], u[1]]);
            let l = match b.sample(c, u[2], [u[3], uniform(i, 25)[0]], TransportMode::Radiance) {
                Some(s) if !s.delta => s.wi,
                _ => continue,
            };
            let ratio = |w: Vec3| w.dot(s.n_shading).abs() / w.dot(s.n_geometric).abs();
            if ratio(c).max(ratio(l)) > 20.0 || ratio(c).min(ratio(l)) < 0.05 {
                continue;
            }
            let camera = b.eval(c, l, TransportMode::Radiance) * ratio(l);
            let light = b.eval(l, c, TransportMode::Importance) * ratio(c);
            let allowed = 2.0 * tolerance(&m, c, l) * camera.max_element() + 1e-4;
            assert!(
                (camera - light).abs().max_element() <= allowed,
                "{camera} {light}: {c} {l} {m:?}"
            );
            tested += 1;
        }
        // Values sampled in importance mode equal those evaluated.
        for i in 0..100 {
            let u = uniform(i, 26);
            let wo = uniform_sphere([u[0], u[1]]);
            let Some(x) = b
                .sample(
                    wo,
                    u[2],
                    [u[3], uniform(i, 27)[0]],
                    TransportMode::Importance,
                )
                .filter(|x| !x.delta)
            else {
                continue;
            };
            let weight = b.eval(wo, x.wi, TransportMode::Importance)
                * (x.wi.dot(s.n_shading).abs() / b.pdf_w(wo, x.wi));
            assert!(
                (weight - x.weight).abs().max_element() <= 2e-3 * weight.max_element() + 1e-5,
                "{weight} {x:?} {m:?}"
            );
        }
    }
    assert!(tested > 5_000, "{tested}");
}

#[test]
fn a_one_sided_surface_lacks_its_opaque_lobes_at_the_back_alone() {
    for m in one_sided() {
        let (b, both) = (
            bsdf(&m),
            bsdf(&Material {
                one_sided: false,
                ..m
            }),
        );
        let glass = Material {
            metallic: 0.0,
            opacity: 0.0,
            clearcoat: 0.0,
            ..m
        };
        let share = (1.0 - m.metallic) * (1.0 - m.opacity);
        for (wo, wi) in pairs(&both, 100) {
            let f = b.eval(wo, wi, TransportMode::Radiance);
            if cos(wo) > 0.0 || cos(wi) > 0.0 {
                assert_eq!(f, both.eval(wo, wi, TransportMode::Radiance), "{m:?}");
            } else if matches!(m.model, Model::Disney | Model::Dielectric) {
                // Only the refractive share is left.
                let share = if m.model == Model::Disney { share } else { 1.0 };
                let left = bsdf(&glass).eval(wo, wi, TransportMode::Radiance) * share;
                let most = tolerance(&m, wo, wi) * left.max_element() + 1e-6;
                assert!((f - left).abs().max_element() <= most, "{f} {left} {m:?}");
            } else {
                assert_eq!(f, Vec3::ZERO, "{m:?}");
            }
        }
    }
}

#[test]
fn opaque_surfaces_look_the_same_from_both_sides() {
    for m in grids().into_iter().filter(|m| m.opacity == 1.0) {
        let b = bsdf(&m);
        let flip = |w: Vec3| w - NORMAL * (2.0 * cos(w));
        for (wo, wi) in pairs(&b, 100) {
            let (f, g) = (
                b.eval(wo, wi, TransportMode::Radiance),
                b.eval(flip(wo), flip(wi), TransportMode::Radiance),
            );
            assert!((f - g).abs().max_element() <= tolerance(&m, wo, wi) * f.max_element() + 1e-4);
            if cos(wo) * cos(wi) < 0.0 {
                assert_eq!(f, Vec3::ZERO);
            }
        }
    }
}
