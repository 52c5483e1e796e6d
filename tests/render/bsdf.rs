//! Sampling of the BSDF against its density, and its symmetries.

use glam::Vec3;
use lumbre::math::rng::{pcg4d, unit};
use lumbre::math::stats::{chi_square_p, sidak};
use lumbre::math::warp::uniform_sphere;
use lumbre::scene::compile::{Material, NONE};
use lumbre::transport::bsdf::{Bsdf, Mode};
use lumbre::transport::surface::Surface;

use crate::common::WHITE;

fn surface(material: &Material) -> Surface<'_> {
    let n = Vec3::new(0.36, 0.48, 0.8);
    Surface {
        position: Vec3::ZERO,
        n_geometric: n,
        n_shading: n,
        tangent: Vec3::ZERO,
        uv: Default::default(),
        material,
        emitter: NONE,
    }
}

fn corners() -> Vec<Material> {
    let mut all = Vec::new();
    for metallic in [0.0, 0.4, 1.0] {
        for opacity in [0.0, 0.5, 1.0] {
            for ior in [1.2, 2.5] {
                all.push(Material { base_color: Vec3::new(0.8, 0.5, 0.2), metallic, opacity, ior, ..WHITE });
            }
        }
    }
    all
}

fn outgoing() -> [Vec3; 4] {
    // Normal, oblique, grazing, and from behind.
    let n = Vec3::new(0.36, 0.48, 0.8);
    let t = n.any_orthonormal_vector();
    [n, (n + t).normalize_or_zero(), (n * 0.05 + t).normalize_or_zero(), (t - n).normalize_or_zero()]
}

#[test]
fn directions_follow_their_density() {
    let cases = corners().len() * outgoing().len();
    for material in corners() {
        let s = surface(&material);
        let bsdf = Bsdf::new(&s, &[]);
        for wo in outgoing() {
            // 8 bands of cosine x 16 sectors, integrated by midpoints within each cell.
            let (bands, sectors, n) = (16usize, 16usize, 40_000u32);
            let t = s.n_shading.any_orthonormal_vector();
            let b = s.n_shading.cross(t);
            let mut observed = vec![0.0; bands * sectors + 1];
            for i in 0..n {
                let u = pcg4d([i, 41, 42, 43]).map(unit);
                match bsdf.sample(wo, u[0], [u[1], u[2]], Mode::Radiance) {
                    Some(x) if !x.delta => {
                        assert!((x.pdf_w - bsdf.pdf_w(wo, x.wi)).abs() < 1e-4 * x.pdf_w.max(1.0));
                        let f = bsdf.eval(wo, x.wi, Mode::Radiance) * x.wi.dot(s.n_shading).abs() / x.pdf_w;
                        // The weight of a sample from one lobe of a mixture is that lobe's own.
                        assert!((f - x.weight).length() < 1e-3, "{f} {}", x.weight);
                        let band = (((x.wi.dot(s.n_shading) + 1.0) * 0.5 * bands as f32) as usize).min(bands - 1);
                        let phi = x.wi.dot(b).atan2(x.wi.dot(t)) / std::f32::consts::TAU + 0.5;
                        observed[band * sectors + ((phi * sectors as f32) as usize).min(sectors - 1)] += 1.0;
                    }
                    _ => observed[bands * sectors] += 1.0,
                }
            }
            let mut expected = vec![0.0; bands * sectors];
            let sub = 8;
            for (cell, e) in expected.iter_mut().enumerate() {
                for k in 0..sub * sub {
                    let z =
                        -1.0 + 2.0 * ((cell / sectors) as f32 + ((k / sub) as f32 + 0.5) / sub as f32) / bands as f32;
                    let phi = std::f32::consts::TAU
                        * (((cell % sectors) as f32 + ((k % sub) as f32 + 0.5) / sub as f32) / sectors as f32 - 0.5);
                    let r = (1.0 - z * z).max(0.0).sqrt();
                    let wi = s.n_shading * z + t * (r * phi.cos()) + b * (r * phi.sin());
                    *e += f64::from(bsdf.pdf_w(wo, wi));
                }
                let cell_w = 4.0 * std::f64::consts::PI / (bands * sectors) as f64;
                *e *= cell_w / f64::from(sub * sub) * f64::from(n);
            }
            let mass: f64 = expected.iter().sum();
            expected.push(f64::from(n) - mass);
            assert!(mass <= f64::from(n) * 1.001);
            let p = chi_square_p(&observed, &expected, 0);
            assert!(p > sidak(0.01, cases), "p = {p} for {material:?}, {wo}");
        }
    }
}

#[test]
fn values_are_reciprocal_and_bounded() {
    for material in corners() {
        let s = surface(&material);
        let bsdf = Bsdf::new(&s, &[]);
        for i in 0..2000 {
            let u = pcg4d([i, 51, 52, 53]).map(unit);
            let (wo, wi) = (uniform_sphere([u[0], u[1]]), uniform_sphere([u[2], u[3]]));
            let (f, g) = (bsdf.eval(wo, wi, Mode::Radiance), bsdf.eval(wi, wo, Mode::Radiance));
            assert!((f - g).length() < 1e-6);
            assert!(f.min_element() >= 0.0 && f.max_element() <= 1.0 / std::f32::consts::PI);
        }
    }
}

#[test]
fn shading_normals_do_not_leak_light_through_the_surface() {
    let material = WHITE;
    let mut s = surface(&material);
    s.n_shading = (s.n_geometric + s.n_geometric.any_orthonormal_vector() * 1.2).normalize_or_zero();
    let bsdf = Bsdf::new(&s, &[]);
    for i in 0..2000 {
        let u = pcg4d([i, 61, 62, 63]).map(unit);
        let wo = uniform_sphere([u[0], u[1]]);
        if let Some(x) = bsdf.sample(wo, 0.3, [u[2], u[3]], Mode::Radiance) {
            assert!(x.wi.dot(s.n_geometric) * wo.dot(s.n_geometric) > 0.0);
        }
    }
}
