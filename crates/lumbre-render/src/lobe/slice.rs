//! The lobe of a BSDF in a plane: its value times the cosine by angle, its density, and a histogram
//! of the directions that it samples.

use std::f32::consts::PI;

use glam::Vec3;

use lumbre_light::math::luminance::luminance_of;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::transport::bsdf::{Bsdf, TransportMode};

/// Number of intervals of the curves between -180 and 180 degrees.
pub const STEPS: usize = 360;

/// Number of bins of the histogram between -180 and 180 degrees.
pub const BINS: usize = 72;

/// Number of directions that are sampled.
const SAMPLES: u32 = 1 << 17;

/// Half of the width of the band around the plane in which directions are counted: the sine of their
/// angle with the plane. The area of a band on the unit sphere is proportional to its width.
const BAND: f32 = 0.15;

/// Number of directions along each side of a bin at which the stated density is evaluated.
const SUBDIVISIONS: u8 = 8;

/// A BSDF in the plane of the normal and the direction to the camera. Angles are counted from the
/// normal; the direction to the camera has a negative one, and its mirror image the positive one.
#[derive(Clone, Debug, PartialEq)]
pub struct Lobe {
    /// Angle between the normal and the direction to the camera, in radians.
    pub angle: f32,
    /// Luminance of the value times the cosine, in 1/sr, at `STEPS + 1` angles from -180 to 180
    /// degrees. Dirac lobes are left out.
    pub values: Vec<f64>,
    /// Density that the BSDF states for directions near the plane in 1/sr: the mean over the area of
    /// each bin of the histogram.
    pub densities: Vec<f64>,
    /// Density of the directions that were sampled near the plane in 1/sr, by bin.
    pub histogram: Vec<f64>,
    /// Share of samples in a Dirac lobe.
    pub delta: f64,
    /// Share of samples that found no direction.
    pub lost: f64,
    /// Mean luminance of the weights of samples: the reflected and transmitted share of light.
    pub albedo: f64,
}

/// The plane of the normal and the direction to the camera.
struct Plane {
    normal: Vec3,
    /// Unit vector in the plane, orthogonal to the normal, away from the camera.
    forward: Vec3,
}

impl Plane {
    fn new(normal: Vec3, wo: Vec3) -> Plane {
        let tangent = normal * wo.dot(normal) - wo;
        Plane {
            normal,
            forward: tangent.normalize_or(normal.any_orthonormal_vector()),
        }
    }

    /// Returns the direction at an angle from the normal in the plane, and the sine of one to it.
    fn direction(&self, angle: f32, sine: f32) -> Vec3 {
        let within = self.normal * angle.cos() + self.forward * angle.sin();
        within * (1.0 - sine * sine).sqrt() + self.normal.cross(self.forward) * sine
    }

    /// Returns the angle of the projection of a direction, and its sine with the plane.
    fn angles(&self, wi: Vec3) -> [f32; 2] {
        let side = self.normal.cross(self.forward);
        let angle = wi.dot(self.forward).atan2(wi.dot(self.normal));
        [angle, wi.dot(side)]
    }
}

/// Returns the angle of a curve's point in radians.
pub fn angle_of(step: usize) -> f32 {
    (step as f32 / STEPS as f32 * 2.0 - 1.0) * PI
}

/// Returns the mean density of directions in a bin of the histogram.
fn mean_density(bsdf: &Bsdf, plane: &Plane, wo: Vec3, bin: usize) -> f64 {
    let middles = || (0..SUBDIVISIONS).map(|i| (f32::from(i) + 0.5) / f32::from(SUBDIVISIONS));
    let mut sum = 0.0;
    for x in middles() {
        let angle = ((bin as f32 + x) / BINS as f32 * 2.0 - 1.0) * PI;
        for y in middles() {
            let wi = plane.direction(angle, BAND * (2.0 * y - 1.0));
            sum += f64::from(bsdf.pdf_w(wo, wi));
        }
    }
    sum / f64::from(SUBDIVISIONS).powi(2)
}

/// Returns the mean of lists of numbers of parts, weighted by the probabilities of the parts.
pub(super) fn mean_of<T>(parts: &[(f64, T)], of: impl Fn(&T) -> &Vec<f64>) -> Vec<f64> {
    let length = parts.iter().map(|(_, part)| of(part).len()).max();
    (0..length.unwrap_or(0))
        .map(|i| parts.iter().map(|(p, part)| p * of(part)[i]).sum())
        .collect()
}

impl Lobe {
    /// Evaluates and samples a BSDF. `normal` is the unit shading normal on either side, `wo` the
    /// unit direction to the camera.
    pub fn new(bsdf: &Bsdf, normal: Vec3, wo: Vec3) -> Lobe {
        let normal = if normal.dot(wo) < 0.0 {
            -normal
        } else {
            normal
        };
        let plane = Plane::new(normal, wo);
        let at = |step: usize| {
            let wi = plane.direction(angle_of(step), 0.0);
            let f = bsdf.eval(wo, wi, TransportMode::Radiance);
            let cos = f64::from(wi.dot(normal).abs());
            luminance_of(f) * cos
        };
        let mut lobe = Lobe {
            angle: wo.dot(normal).clamp(-1.0, 1.0).acos(),
            values: (0..=STEPS).map(at).collect(),
            densities: (0..BINS)
                .map(|bin| mean_density(bsdf, &plane, wo, bin))
                .collect(),
            histogram: vec![0.0; BINS],
            delta: 0.0,
            lost: 0.0,
            albedo: 0.0,
        };
        lobe.sample(bsdf, &plane, wo);
        lobe
    }

    /// Returns the lobe of a composed material, given the probabilities of its parts, which sum to
    /// 1, and their lobes for the same direction to the camera; `None` without parts.
    pub fn composed(parts: &[(f64, Lobe)]) -> Option<Lobe> {
        let angle = parts.first()?.1.angle;
        let mean = |of: fn(&Lobe) -> f64| parts.iter().map(|(p, lobe)| p * of(lobe)).sum();
        Some(Lobe {
            angle,
            values: mean_of(parts, |lobe| &lobe.values),
            densities: mean_of(parts, |lobe| &lobe.densities),
            histogram: mean_of(parts, |lobe| &lobe.histogram),
            delta: mean(|lobe| lobe.delta),
            lost: mean(|lobe| lobe.lost),
            albedo: mean(|lobe| lobe.albedo),
        })
    }

    fn sample(&mut self, bsdf: &Bsdf, plane: &Plane, wo: Vec3) {
        let share = 1.0 / f64::from(SAMPLES);
        let solid_angle = f64::from(2.0 * BAND) * std::f64::consts::TAU / BINS as f64;
        for i in 0..SAMPLES {
            let [u, v, w, _] = pcg4d([i, 0, 0, 0]).map(unit::<u32>);
            let Some(sample) = bsdf.sample(wo, u, [v, w], TransportMode::Radiance) else {
                self.lost += share;
                continue;
            };
            self.albedo += share * luminance_of(sample.weight);
            if sample.delta {
                self.delta += share;
                continue;
            }
            let [angle, sine] = plane.angles(sample.wi);
            if sine.abs() < BAND {
                let bin = ((angle / PI + 1.0) * 0.5 * BINS as f32) as usize;
                self.histogram[bin.min(BINS - 1)] += share / solid_angle;
            }
        }
    }

    /// Returns the greatest value times cosine, in 1/sr.
    pub fn greatest_value(&self) -> f64 {
        self.values.iter().copied().fold(0.0, f64::max)
    }

    /// Returns whether anything is transmitted, other than by a Dirac lobe.
    pub fn is_transmissive(&self) -> bool {
        let quarter = STEPS / 4;
        let below = |i: &usize| *i < quarter || *i > 3 * quarter;
        (0..=STEPS)
            .filter(below)
            .any(|i| self.values[i] > 1e-4 * self.greatest_value())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::cpu::prepared_scene::PreparedScene;
    use crate::hierarchy::AccelSpec;
    use lumbre_light::scene::compile;
    use lumbre_light::scene::desc::Model;
    use lumbre_light::transport::surface::Surface;
    use lumbre_scene_io::load;

    /// Returns the lobe at a pixel of a wall of the Cornell box, made of another material.
    fn lobe(model: Model, metallic: f32, roughness: f32) -> Lobe {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../scenes/cornell/cornell.scn"
        );
        let (desc, _) = load::load(path.as_ref()).unwrap();
        let (mut scene, _) = compile(&desc).unwrap();
        for material in &mut scene.materials {
            (material.model, material.metallic, material.roughness) = (model, metallic, roughness);
            material.base_color = Vec3::splat(0.8);
        }
        let camera = scene.camera.clone();
        let prepared = PreparedScene::new(Arc::new(scene), &AccelSpec::default(), 1).unwrap();
        let (ray, hit) = prepared.center_hit(&camera, [64, 64], [6, 30]);
        let surface = Surface::at(prepared.scene(), &ray, &hit.unwrap());
        let bsdf = Bsdf::new(&surface, &prepared.scene().textures);
        Lobe::new(&bsdf, surface.n_shading, -ray.dir)
    }

    /// Mean distance between the histogram and a density, over the mean of the histogram.
    fn distance(lobe: &Lobe, density: impl Fn(usize) -> f64) -> f64 {
        let bins = lobe.histogram.iter().enumerate();
        let sum: f64 = bins.map(|(bin, x)| (x - density(bin)).abs()).sum();
        sum / lobe.histogram.iter().sum::<f64>()
    }

    #[test]
    fn a_diffuse_lobe_is_a_cosine() {
        let lobe = lobe(Model::Lambert, 0.0, 1.0);
        for step in (0..=STEPS).step_by(10) {
            let cos = f64::from(angle_of(step).cos());
            let expected = 0.8 / std::f64::consts::PI * cos.max(0.0);
            assert!((lobe.values[step] - expected).abs() < 1e-5, "{step}");
        }
        assert!((lobe.albedo - 0.8).abs() < 1e-3, "{}", lobe.albedo);
        assert!(!lobe.is_transmissive() && lobe.delta == 0.0);
        let off = distance(&lobe, |bin| lobe.densities[bin]);
        assert!(off < 0.05, "{off}");
    }

    #[test]
    fn the_histogram_follows_the_stated_density_and_not_its_mirror_image() {
        let lobe = lobe(Model::Disney, 1.0, 0.4);
        assert!(lobe.angle > 0.2, "{}", lobe.angle);
        let highest = (0..=STEPS).max_by(|a, b| lobe.values[*a].total_cmp(&lobe.values[*b]));
        assert!(
            angle_of(highest.unwrap()) > 0.1,
            "the highlight is away from the camera"
        );
        let right = distance(&lobe, |bin| lobe.densities[bin]);
        let wrong = distance(&lobe, |bin| lobe.densities[BINS - 1 - bin]);
        assert!(right < 0.15 && wrong > 2.0 * right, "{right} {wrong}");
    }

    #[test]
    fn a_mirror_has_nothing_but_a_dirac_lobe() {
        let lobe = lobe(Model::Lambert, 1.0, 0.0);
        assert_eq!((lobe.greatest_value(), lobe.lost), (0.0, 0.0));
        assert!((lobe.delta - 1.0).abs() < 1e-9, "{}", lobe.delta);
        // Schlick's reflectance at the angle of the camera.
        let reflectance = 0.8 + 0.2 * (1.0 - f64::from(lobe.angle.cos())).powi(5);
        assert!((lobe.albedo - reflectance).abs() < 1e-3, "{}", lobe.albedo);
    }
}
