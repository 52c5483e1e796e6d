//! Values of the BSDF compared with the published equations, implemented again in double precision
//! and in another form where one exists.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use lumbre_light::math::Frame;
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::compile::{Formulas, Material};
use lumbre_light::transport::bsdf::{Bsdf, TransportMode};
use lumbre_light::transport::surface::Surface;

use crate::render::bsdf_grid::{grids, surface, uniform};

/// Returns a surface point whose frame is that of the world.
fn upright(m: &Material) -> Surface<'_> {
    Surface {
        n_geometric: Vec3::Z,
        n_shading: Vec3::Z,
        tangent: Vec3::X,
        ..surface(m)
    }
}

/// Returns Fresnel's equations in the form of Cook and Torrance, without refracted angles; `eta` is
/// far over near.
fn fresnel(c: f64, eta: f64) -> f64 {
    let g2 = eta * eta - 1.0 + c * c;
    if g2 <= 0.0 {
        return 1.0;
    }
    let g = g2.sqrt();
    let (a, b) = ((g - c) / (g + c), (c * (g + c) - 1.0) / (c * (g - c) + 1.0));
    0.5 * a * a * (1.0 + b * b)
}

fn schlick(c: f64) -> f64 {
    (1.0 - c).powi(5)
}

/// Returns Smith's masking of GGX by its Lambda.
fn g1(w: DVec3, [ax, ay]: [f64; 2]) -> f64 {
    let tan2 = (ax * ax * w.x * w.x + ay * ay * w.y * w.y) / (w.z * w.z);
    1.0 / (1.0 + 0.5 * ((1.0 + tan2).sqrt() - 1.0))
}

/// Returns the GGX distribution of normals, equation 4.18 of thesis S0.
fn d(h: DVec3, [ax, ay]: [f64; 2]) -> f64 {
    1.0 / (PI * ax * ay * ((h.x / ax).powi(2) + (h.y / ay).powi(2) + h.z * h.z).powi(2))
}

fn alphas(m: &Material) -> [f64; 2] {
    let aspect = (1.0 - 0.9 * f64::from(m.anisotropic)).sqrt();
    let alpha = f64::from(m.roughness).powi(2);
    [(alpha / aspect).max(0.001), (alpha * aspect).max(0.001)]
}

/// Returns the transmittance of a coat in one direction, and the coat's value.
fn coat(m: &Material, o: DVec3, i: DVec3, h: DVec3) -> (f64, f64) {
    let strength = 0.25 * f64::from(m.clearcoat);
    let f = |c: f64| strength * (0.04 + 0.96 * schlick(c));
    let a = 0.1 * (1.0 - f64::from(m.clearcoat_gloss)) + 0.001 * f64::from(m.clearcoat_gloss);
    let gtr1 = (a * a - 1.0) / (PI * (a * a).ln() * (1.0 + (a * a - 1.0) * h.z * h.z));
    let value = f(o.dot(h)) * gtr1 * g1(o, [0.25; 2]) * g1(i, [0.25; 2]) / (4.0 * o.z * i.z);
    match m.formulas {
        Formulas::Lumbre => ((1.0 - f(o.z)) * (1.0 - f(i.z.abs())), value),
        Formulas::Mitsuba => (1.0, value * 4.0 * o.z * i.z),
    }
}

/// Returns the value for radiance; `z` is the shading normal.
fn reference(m: &Material, mut o: DVec3, mut i: DVec3) -> DVec3 {
    let base = m.base_color.as_dvec3();
    let (metallic, opacity, ior) = (
        f64::from(m.metallic),
        f64::from(m.opacity),
        f64::from(m.ior),
    );
    let mut eta = ior;
    if o.z < 0.0 {
        (o.z, i.z, eta) = (-o.z, -i.z, 1.0 / ior);
    }
    let refractive = (1.0 - metallic) * (1.0 - opacity);
    let alpha = alphas(m);
    if i.z < 0.0 {
        // [Walter et al. 2007, equation 21] with the near index 1 and the far index eta, for light
        // from the far side.
        let h = (o + eta * i).normalize();
        let h = if h.z < 0.0 { -h } else { h };
        let (oh, ih) = (o.dot(h), i.dot(h));
        if oh <= 0.0 || ih >= 0.0 {
            return DVec3::ZERO;
        }
        let f = (oh * ih).abs() / (o.z * i.z).abs()
            * (1.0 - fresnel(oh, eta))
            * g1(o, alpha)
            * g1(-i, alpha)
            * d(h, alpha)
            / (oh + eta * ih).powi(2);
        return base.powf(0.5) * (refractive * f * coat(m, o, i, h).0);
    }
    let h = (o + i).normalize();
    let cos = o.dot(h);
    let luminance = base.dot(DVec3::new(0.2126, 0.7152, 0.0722));
    let tint = |part: f32| DVec3::ONE.lerp(base / luminance, f64::from(part));
    // S0, equations 4.15 to 4.17, and sheen.
    let (rough, subsurface) = (f64::from(m.roughness), f64::from(m.subsurface));
    let blend = |f90: f64| (1.0 + (f90 - 1.0) * schlick(i.z)) * (1.0 + (f90 - 1.0) * schlick(o.z));
    let fd = blend(0.5 + 2.0 * rough * cos * cos);
    let fss = 1.25 * (blend(rough * cos * cos) * (1.0 / (i.z + o.z) - 0.5) + 0.5);
    let diffuse = base / PI * (fd * (1.0 - subsurface) + fss * subsurface)
        + tint(m.sheen_tint) * (f64::from(m.sheen) * schlick(cos));
    let microfacets = d(h, alpha) * g1(o, alpha) * g1(i, alpha) / (4.0 * o.z * i.z);
    let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
    let exact = fresnel(cos, ior);
    let dielectric = (tint(m.specular_tint) * f0)
        .min(DVec3::ONE)
        .lerp(DVec3::ONE, (exact - f0) / (1.0 - f0));
    // The share of the tint by Schlick's formula, as in `principled` of Mitsuba.
    let share = f64::from(m.specular_tint);
    let by_schlick = (tint(1.0) * f0).lerp(DVec3::ONE, schlick(cos));
    let dielectric = match m.formulas {
        _ if share == 0.0 => DVec3::splat(exact),
        Formulas::Lumbre => dielectric.max(DVec3::ZERO),
        Formulas::Mitsuba => DVec3::splat(exact).lerp(by_schlick, share),
    };
    let metal = base + (DVec3::ONE - base) * schlick(cos);
    // S0, figure 4.11.
    let opaque = diffuse + dielectric * microfacets;
    let refracting = DVec3::splat(fresnel(cos, eta) * microfacets);
    let below = (opaque * opacity + refracting * (1.0 - opacity)) * (1.0 - metallic)
        + metal * (microfacets * metallic);
    let (passes, varnish) = coat(m, o, i, h);
    below * passes + varnish
}

#[test]
fn values_equal_the_published_equations() {
    let mut compared = 0;
    for m in grids().into_iter().filter(|m| m.roughness >= 0.1) {
        let s = upright(&m);
        let b = Bsdf::new(&s, &[]);
        for i in 0..600 {
            let u = uniform(i, 11);
            let o = uniform_sphere([u[0], u[1]]);
            // Half of the pairs are sampled, so that narrow lobes are hit.
            let w = match b.sample(o, u[2], [u[3], uniform(i, 12)[0]], TransportMode::Radiance) {
                Some(s) if i % 2 == 0 && !s.delta => s.wi,
                _ => uniform_sphere([u[2], u[3]]),
            };
            if o.z.abs().min(w.z.abs()) < 0.01 {
                continue;
            }
            let exact = reference(&m, o.as_dvec3().normalize(), w.as_dvec3().normalize());
            let found = b.eval(o, w, TransportMode::Radiance).as_dvec3();
            let error = (found - exact).abs().max_element();
            // Half vectors of grazing pairs lose digits, the more the narrower the lobe and the
            // less refraction bends.
            let tolerance = 1e-3
                + 1e-6
                    / (alphas(&m)[1]
                        * f64::from((m.ior - 1.0).abs().min(1.0))
                        * f64::from(o.z.abs().min(w.z.abs())));
            assert!(
                error <= tolerance * exact.max_element() + 1e-6,
                "{found} instead of {exact} for {o} {w} {m:?}"
            );
            compared += 1;
        }
    }
    assert!(compared > 30_000, "{compared}");
}

#[test]
fn the_density_of_refraction_has_the_jacobian_found_by_finite_differences() {
    // The density of refracted directions is that of visible normals over the change of solid angle
    // from normals to directions, which finite differences of the normal measure here.
    for m in grids().into_iter().filter(|m| {
        m.opacity == 0.0 && m.metallic == 0.0 && m.roughness >= 0.1 && m.clearcoat == 0.0
    }) {
        let s = upright(&m);
        let b = Bsdf::new(&s, &[]);
        let alpha = alphas(&m);
        let mut tested = 0;
        for k in 0..300 {
            let u = uniform(k, 13);
            let wo = uniform_sphere([u[0], u[1]]);
            let Some(x) = b.sample(wo, u[2], [u[3], uniform(k, 14)[0]], TransportMode::Radiance)
            else {
                continue;
            };
            if x.eta == 1.0 || wo.z.abs() < 0.1 || x.wi.z.abs() < 0.1 {
                continue;
            }
            // The upper side of the surface is the side of `wo`.
            let up =
                |w: Vec3| w.as_dvec3().normalize() * DVec3::new(1.0, 1.0, f64::from(wo.z.signum()));
            let (o, i, eta) = (up(wo), up(x.wi), f64::from(x.eta));
            let h = -(o + eta * i).normalize() * (eta - 1.0).signum();
            let refract = |h: DVec3| {
                let c = o.dot(h);
                let t = (1.0 - (1.0 - c * c) / (eta * eta)).sqrt();
                (h * (c / eta - t) - o / eta).normalize()
            };
            assert!((refract(h) - i).length() < 1e-4, "{h} {i} {}", refract(h));
            let (a, b2) = h.any_orthonormal_pair();
            let e = 1e-5;
            let [da, db] = [a, b2]
                .map(|t| refract((h + t * e).normalize()) - refract((h - t * e).normalize()));
            let stretch = da.cross(db).length() / (4.0 * e * e);
            let normals = d(h, alpha) * g1(o, alpha) * o.dot(h) / o.z;
            let expected = (1.0 - fresnel(o.dot(h), eta)) * normals / stretch;
            let found = f64::from(b.pdf_w(wo, x.wi));
            assert!(
                (found / expected - 1.0).abs() < 0.01,
                "{found} instead of {expected}: {wo} {} {m:?}",
                x.wi
            );
            tested += 1;
        }
        assert!(tested > 60, "{tested} {m:?}");
    }
}

#[test]
fn anisotropic_lobes_are_wider_along_the_tangent() {
    // The lobe is wider for half vectors tilted along the tangent than across it, for any length of
    // the tangent.
    let m = Material {
        metallic: 1.0,
        roughness: 0.4,
        anisotropic: 0.9,
        ..crate::render::bsdf_grid::DISNEY
    };
    for tangent in [Vec3::X * 0.01, Vec3::new(5.0, 0.0, 3.0)] {
        let s = Surface {
            tangent,
            ..upright(&m)
        };
        let b = Bsdf::new(&s, &[]);
        let towards = |v: Vec3| {
            b.eval(
                Vec3::Z,
                (Vec3::Z + v).normalize_or(Vec3::Z),
                TransportMode::Radiance,
            )
            .y
        };
        assert!(towards(Vec3::X) > 20.0 * towards(Vec3::Y));
        assert!((towards(Vec3::X) / towards(-Vec3::X) - 1.0).abs() < 1e-5);
    }
    // Isotropic lobes do not depend on the frame that is chosen without a tangent.
    let round = Material {
        anisotropic: 0.0,
        ..m
    };
    let (s, t) = (
        Surface {
            tangent: Vec3::ZERO,
            ..upright(&round)
        },
        upright(&round),
    );
    let (s, t) = (Bsdf::new(&s, &[]), Bsdf::new(&t, &[]));
    let frame = Frame::from_normal(Vec3::Z);
    for k in 0..100 {
        let u = uniform(k, 15);
        let (o, w) = (
            frame.to_world(uniform_sphere([u[0] * 0.5, u[1]])),
            uniform_sphere([u[2] * 0.5, u[3]]),
        );
        let (f, g) = (
            s.eval(o, w, TransportMode::Radiance),
            t.eval(o, w, TransportMode::Radiance),
        );
        assert!((f - g).abs().max_element() <= 1e-3 * f.max_element());
    }
}
