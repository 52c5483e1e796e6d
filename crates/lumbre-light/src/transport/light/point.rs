//! Point lights: with the same intensity in every direction, with the intensity of a spot light's
//! cone, or with that of a goniometric light's map.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::Vec3;

use super::environment::DirectionMap;
use super::source::{EmittingLanes, LightFacts, LightSource, PowerContext};
use super::table::light_rows;
use super::tree::LightBounds;
use super::{Lights, SelectedLights};
use crate::math::luminance::luminance_of;
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::{Lanes, map_vectors};
use crate::math::{Frame, warp};
use crate::scene::CompiledScene;
use crate::scene::compile::PointLight;

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

/// Flags of a point light with a map.
const MAPPED: f32 = 2.0;

/// Returns the map of a point light, if it has one.
pub(super) fn direction_map(light: &PointLight, scene: &CompiledScene) -> Option<DirectionMap> {
    let map = light.map?;
    let texture = scene.textures.get(map.texture as usize)?;
    Some(DirectionMap::new(
        Arc::new(texture.clone()),
        map.rotation_rad,
    ))
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
        let flags = match self.map {
            None => f32::from(u8::from(cone.smooth)),
            Some(_) => MAPPED,
        };
        let power = match direction_map(self, scene) {
            None => {
                let falloff = 4.0 * std::f64::consts::PI * cone.mean_falloff();
                falloff * luminance_of(self.intensity)
            }
            Some(map) => map.power(self.intensity),
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
        let mapped = lanes & lights.flags().eq(R::splat(MAPPED));
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
            smooth: self.flags().gt(R::splat(0.0)),
            whole: first[7].ge(R::splat(2.0)),
        }
    }
}
