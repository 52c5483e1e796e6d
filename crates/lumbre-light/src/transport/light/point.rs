//! Point lights: with the same intensity in every direction, with the intensity of a spot light's
//! cone, with that of its image too, or with that of a goniometric light's map.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::Vec3;

use super::environment::{DirectionMap, Edge, bilinear};
use super::source::{EmittingLanes, LightFacts, LightSource, PowerContext};
use super::table::light_rows;
use super::tree::LightBounds;
use super::{Lights, SelectedLights};
use crate::math::luminance::luminance_of;
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::{Lanes, map_vectors};
use crate::math::{Frame, warp};
use crate::scene::CompiledScene;
use crate::scene::compile::{Cone, MapSpace, PointLight, Texture};

/// The cones of point lights: [`Cone`](crate::scene::compile::Cone) in lanes.
#[derive(Clone, Copy, Debug)]
struct Cones<R: Real> {
    axis: R::Vec3,
    beam: R,
    cutoff: R,
    beam_height: R,
    cutoff_height: R,
    smooth: R::Mask,
    /// Whether the cone contains all directions.
    whole: R::Mask,
}

impl Cones<f32> {
    /// Returns one cone.
    fn of(cone: &Cone) -> Cones<f32> {
        Cones {
            axis: cone.axis,
            beam: cone.beam,
            cutoff: cone.cutoff,
            beam_height: cone.beam_height,
            cutoff_height: cone.cutoff_height,
            smooth: cone.smooth,
            whole: cone.is_whole(),
        }
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Cones<R> {
    /// Returns one minus the cosine of a unit direction with the axis.
    #[inline(always)]
    fn height(&self, dir: V) -> R {
        R::splat(0.5) * (dir - self.axis).length_squared()
    }

    /// Returns the fraction of the intensity in a unit direction, from 0 to 1.
    #[inline(always)]
    fn falloff(&self, dir: V) -> R {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        if !(!self.whole).any() {
            return one;
        }
        let height = self.height(dir);
        let t = (self.cutoff_height - height) / (self.cutoff_height - self.beam_height);
        let mut edge = t * t;
        if (!self.smooth).any() {
            let (near, far) = ((dir - self.axis).length(), (dir + self.axis).length());
            let angle = R::splat(2.0) * near.zip_lanes(far, f32::atan2);
            let linear = ((self.cutoff - angle) / (self.cutoff - self.beam)).clamp(0.0, 1.0);
            edge = R::select(self.smooth, edge, linear);
        }
        let outside = R::select(height.ge(self.cutoff_height), zero, edge);
        R::select(self.whole | height.le(self.beam_height), one, outside)
    }

    /// Returns the density per solid angle of a direction of emission: uniform over the whole cone.
    #[inline(always)]
    fn pdf_w(&self, dir: V) -> R {
        let one = R::splat(1.0);
        let inside = self.height(dir).le(self.cutoff_height);
        let cone = one / (R::splat(TAU) * self.cutoff_height);
        let everywhere = R::splat(1.0 / (4.0 * PI));
        R::select(
            self.whole,
            everywhere,
            R::select(inside, cone, R::splat(0.0)),
        )
    }

    /// Samples a direction uniform over the cone.
    #[inline(always)]
    fn sample(&self, v: [R; 2]) -> V {
        let (zero, one, two) = (R::splat(0.0), R::splat(1.0), R::splat(2.0));
        let sphere = warp::uniform_sphere(v);
        if !(!self.whole).any() {
            return sphere;
        }
        let height = v[0] * self.cutoff_height;
        let r = (height * (two - height)).max(zero).sqrt();
        let angle = R::splat(TAU) * v[1];
        let (sin, cos) = (angle.map_lanes(f32::sin), angle.map_lanes(f32::cos));
        let local = V::new(r * cos, r * sin, one - height);
        let cone = Frame::from_normal(self.axis).to_world(local);
        V::select(self.whole, sphere, cone)
    }
}

/// Least flags of a point light with a map; the rest is 1 for a smooth cone.
const MAPPED: f32 = 2.0;

/// The map of a point light.
#[derive(Clone, Debug)]
pub(super) enum PointMap {
    /// A map of all directions.
    Sphere(DirectionMap),
    /// An image across the axis.
    Plane(PlaneMap),
}

/// An image that a spot light projects.
#[derive(Clone, Debug)]
pub(super) struct PlaneMap {
    texture: Arc<Texture>,
    axis: Vec3,
    right: Vec3,
    up: Vec3,
    even: bool,
}

impl PointMap {
    /// Returns the map of a point light, if it has one.
    pub fn new(light: &PointLight, scene: &CompiledScene) -> Option<PointMap> {
        let map = light.map?;
        let texture = Arc::new(scene.textures.get(map.texture as usize)?.clone());
        Some(match map.mapping {
            MapSpace::Sphere { rotation_rad } => {
                PointMap::Sphere(DirectionMap::new(texture, rotation_rad))
            }
            MapSpace::Plane { right, up, even } => PointMap::Plane(PlaneMap {
                texture,
                axis: light.cone.axis,
                right,
                up,
                even,
            }),
        })
    }

    /// Returns the factor on the intensity in a unit direction.
    fn color(&self, dir: Vec3) -> Vec3 {
        match self {
            PointMap::Sphere(map) => map.color(dir),
            PointMap::Plane(map) => map.color(dir),
        }
    }
}

impl PlaneMap {
    /// Returns the factor on the intensity in a unit direction.
    fn color(&self, dir: Vec3) -> Vec3 {
        let cos = dir.dot(self.axis);
        let (x, y) = (dir.dot(self.right) / cos, dir.dot(self.up) / cos);
        if !(cos > 0.0 && x.abs() <= 1.0 && y.abs() <= 1.0) {
            return Vec3::ZERO;
        }
        let color = bilinear(&self.texture, [0.5 + 0.5 * x, 0.5 - 0.5 * y], Edge::Clamped);
        if self.even {
            color / (cos * cos * cos)
        } else {
            color
        }
    }

    /// Returns the luminance of the intensity with the falloff of a cone, integrated over all
    /// directions by the midpoint rule.
    fn power(&self, intensity: Vec3, cone: &Cones<f32>) -> f64 {
        let across = [self.texture.width, self.texture.height].map(|n| n.clamp(64, 1024));
        // Vectors of the plane at distance 1 to its right and upper edge.
        let normal = self.right.cross(self.up).as_dvec3();
        let [right, up] = [
            self.up.as_dvec3().cross(normal) / normal.length_squared(),
            normal.cross(self.right.as_dvec3()) / normal.length_squared(),
        ];
        let area = right.cross(up).length() * 4.0 / f64::from(across[0] * across[1]);
        let at = |i: u32, n: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
        let points = (0..across[1]).flat_map(|j| (0..across[0]).map(move |i| (i, j)));
        let light = points.map(|(i, j)| {
            let p = self.axis.as_dvec3() + right * at(i, across[0]) + up * at(j, across[1]);
            let dir = p.normalize().as_vec3();
            let solid_angle = area / p.length_squared().powf(1.5);
            luminance_of(self.color(dir) * intensity) * f64::from(cone.falloff(dir)) * solid_angle
        });
        light.sum()
    }
}

impl Lights {
    /// Returns the factor on the intensity of the point light with this index in a unit direction.
    fn point_map_color(&self, index: u32, dir: Vec3) -> [f32; 3] {
        let own = (index - self.first[0]) as usize;
        let map = self.point_maps.get(own).and_then(Option::as_ref);
        map.map_or([1.0; 3], |map| map.color(dir).to_array())
    }
}

impl LightSource for PointLight {
    fn facts(&self, scene: &CompiledScene, _: &PowerContext) -> LightFacts {
        let (p, axis, cone) = (self.position, self.cone.axis, &self.cone);
        let heights = [cone.beam_height, cone.cutoff_height];
        let first = [
            p.x, p.y, p.z, axis.x, axis.y, axis.z, heights[0], heights[1],
        ];
        let smooth = f32::from(u8::from(cone.smooth));
        let flags = smooth + if self.map.is_some() { MAPPED } else { 0.0 };
        let power = match PointMap::new(self, scene) {
            None => {
                let falloff = 4.0 * std::f64::consts::PI * cone.mean_falloff();
                falloff * luminance_of(self.intensity)
            }
            Some(PointMap::Sphere(map)) => map.power(self.intensity),
            Some(PointMap::Plane(map)) => map.power(self.intensity, &Cones::of(cone)),
        };
        LightFacts {
            rows: light_rows(
                first,
                [cone.beam, cone.cutoff],
                self.intensity,
                [flags, 0.0],
            ),
            power,
            bounds: Some(LightBounds::point(p, cone, 0.0)),
        }
    }
}

impl<R: Lanes<N>, const N: usize> EmittingLanes<R, N> for PointLight {
    #[inline(always)]
    fn sample(lights: &SelectedLights<R, N>, v: [R; 2], lanes: R::Mask) -> ([R::Vec3; 2], R) {
        let cones = lights.cones();
        let dir = cones.sample(v);
        ([dir, Self::emitted(lights, dir, lanes)], cones.pdf_w(dir))
    }

    #[inline(always)]
    fn pdf_w(lights: &SelectedLights<R, N>, dir: R::Vec3, _: R::Mask) -> R {
        lights.cones().pdf_w(dir)
    }

    #[inline(always)]
    fn emitted(lights: &SelectedLights<R, N>, dir: R::Vec3, lanes: R::Mask) -> R::Vec3 {
        let intensity = lights.radiance() * lights.cones().falloff(dir);
        let mapped = lanes & lights.flags().ge(R::splat(MAPPED));
        if !mapped.any() {
            return intensity;
        }
        let [r, g, b] = map_vectors::<R, N, 3>(dir, mapped, |lane, dir| {
            lights.lights.point_map_color(lights.indices[lane], dir)
        });
        R::Vec3::select(mapped, intensity * R::Vec3::new(r, g, b), intensity)
    }
}

impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
    /// Returns the cones of point lights.
    #[inline(always)]
    fn cones(&self) -> Cones<R> {
        let [first, second] = &self.rows;
        Cones {
            axis: self.vector(3),
            beam: second[0],
            cutoff: second[1],
            beam_height: first[6],
            cutoff_height: first[7],
            smooth: self.flags().eq(R::splat(1.0)) | self.flags().eq(R::splat(MAPPED + 1.0)),
            whole: first[7].ge(R::splat(2.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::{ConeDesc, ConeEdge};

    /// Returns the map of an image on a plane, 2 tan 30 degrees wide and half as high, for a light
    /// that looks along +x with +z up, and a cone around it.
    fn plane(texels: &[[f32; 3]], even: bool) -> (PlaneMap, Cones<f32>) {
        let half = 30f32.to_radians().tan();
        let map = PlaneMap {
            texture: Arc::new(Texture::new(2, texels.len() as u32 / 2, texels.to_vec())),
            axis: Vec3::X,
            right: Vec3::NEG_Y / half,
            up: Vec3::Z * 2.0 / half,
            even,
        };
        let cone = ConeDesc {
            beam_deg: 60.0,
            cutoff_deg: 60.0,
            edge: ConeEdge::Linear,
        };
        (map, Cones::of(&Cone::new(Vec3::X, &cone)))
    }

    #[test]
    fn images_are_upright_and_end_at_their_edges() {
        let half = 30f32.to_radians().tan();
        let (map, _) = plane(&[[1.0; 3], [2.0; 3], [3.0; 3], [4.0; 3]], false);
        let at = |x: f32, y: f32| {
            let dir = Vec3::new(1.0, -x * half, y * half / 2.0).normalize_or_zero();
            map.color(dir).x
        };
        for (x, y, expected) in [
            (-0.9, 0.9, 1.0),
            (0.9, 0.9, 2.0),
            (-0.9, -0.9, 3.0),
            (0.9, -0.9, 4.0),
            (0.0, 0.0, 2.5),
            (1.01, 0.0, 0.0),
            (0.0, -1.01, 0.0),
        ] {
            assert!((at(x, y) - expected).abs() < 1e-4, "{x} {y}: {}", at(x, y));
        }
        assert_eq!(map.color(Vec3::NEG_X), Vec3::ZERO);
    }

    #[test]
    fn the_power_of_images_is_their_integral_over_directions() {
        let half = 30f64.to_radians().tan();
        // An even irradiance has the area of the image at distance 1, an even intensity its solid
        // angle.
        let area = 4.0 * half * half / 2.0;
        let across = half * half / 2.0 / ((1.0 + half * half) * (1.0 + half * half / 4.0)).sqrt();
        for (even, expected) in [(true, area), (false, 4.0 * across.asin())] {
            let (map, cone) = plane(&[[1.0; 3]; 2], even);
            let found = map.power(Vec3::ONE, &cone);
            assert!(
                (found / expected - 1.0).abs() < 1e-3,
                "{even}: {found}, not {expected}"
            );
        }
    }
}
