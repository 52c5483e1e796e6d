//! Identities of lights, and the parameters of every light in rows of numbers.

use glam::Vec3;

use crate::math::simd::F32x8;
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::transport::vertex::greatest_coordinate;

/// Kinds of lights, as numbers of the last column of a light's rows. Lanes without a light have the
/// kind 0.
pub(super) const TRIANGLE: f32 = 1.0;
pub(super) const SPHERE: f32 = 2.0;
pub(super) const POINT: f32 = 3.0;
pub(super) const DIRECTIONAL: f32 = 4.0;
pub(super) const ENVIRONMENT: f32 = 5.0;

/// Rows of one light. The second row ends with radiance (intensity of a point light, irradiance of a
/// directional light), a flag, the extent of a primitive
/// ([`EdgeEnd::extent`](crate::transport::vertex::EdgeEnd::extent)) or 0, and the kind.
///
/// | kind | first row | start of the second row | flag |
/// |---|---|---|---|
/// | triangle | three corners, without the last z | that z, area | textured |
/// | sphere | centre, radius | 0, area | textured |
/// | point | position, axis of the cone, `beam_height`, `cutoff_height` | `beam`, `cutoff` | `smooth` |
/// | directional | direction | | |
/// | environment | | | |
///
/// Textured lights have an emission texture or a mask.
pub(super) type LightRows = [F32x8; 2];

/// Rows of lanes without a light.
pub(super) const NO_LIGHT: LightRows = [F32x8([0.0; 8]); 2];

/// Returns the rows of a light.
pub(super) fn light_rows(scene: &CompiledScene, light: LightId) -> LightRows {
    let flag = |set: bool| f32::from(u8::from(set));
    let mut rows = NO_LIGHT;
    let [first, second] = rows.each_mut().map(|row| &mut row.0);
    let mut set_radiance = |radiance: Vec3| second[2..5].copy_from_slice(&radiance.to_array());
    match light {
        LightId::Emitter(i) => {
            let emitter = &scene.emitters[i as usize];
            let m = super::area::material(scene, i);
            set_radiance(m.emission);
            second[1] = emitter.area;
            second[5] = flag(m.mask_texture != NONE || m.emission_texture != NONE);
            match super::area::sphere(scene, i) {
                None => {
                    let [a, b, c] = scene.corners(emitter.primitive, emitter.instance);
                    *first = [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y];
                    (second[0], second[7]) = (c.z, TRIANGLE);
                    let moved = scene.instance_extent(emitter.instance);
                    second[6] = greatest_coordinate(&[a, b, c]).max(moved);
                }
                Some(sphere) => {
                    first[..3].copy_from_slice(&sphere.center.to_array());
                    (first[3], second[7]) = (sphere.radius, SPHERE);
                    second[6] = greatest_coordinate(&[sphere.center]) + sphere.radius;
                }
            }
        }
        LightId::Point(i) => {
            let light = &scene.points[i as usize];
            let (p, cone) = (light.position, &light.cone);
            let axis = cone.axis;
            set_radiance(light.intensity);
            *first = [
                p.x,
                p.y,
                p.z,
                axis.x,
                axis.y,
                axis.z,
                cone.beam_height,
                cone.cutoff_height,
            ];
            [second[0], second[1]] = [cone.beam, cone.cutoff];
            (second[5], second[7]) = (flag(cone.smooth), POINT);
        }
        LightId::Directional(i) => {
            let light = &scene.directionals[i as usize];
            set_radiance(light.irradiance);
            first[..3].copy_from_slice(&light.direction.to_array());
            second[7] = DIRECTIONAL;
        }
        LightId::Environment => second[7] = ENVIRONMENT,
    }
    rows
}

/// Identifies one light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightId {
    /// An emissive primitive: index into [`CompiledScene::emitters`].
    Emitter(u32),
    /// A point light: index into [`CompiledScene::points`].
    Point(u32),
    /// A directional light: index into [`CompiledScene::directionals`].
    Directional(u32),
    /// The environment: [`CompiledScene::environment`].
    Environment,
}
