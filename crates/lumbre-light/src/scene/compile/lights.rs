//! Compiled lights without a surface: point, spot, goniometric and directional lights, and the
//! environment.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::{CompiledScene, Texture};
use crate::scene::desc::{
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSampling, EnvironmentSource, LightKind,
    MAX_COORDINATE, SceneDesc, SpotImage, TextureDesc, place,
};
use crate::scene::{Note, SceneError};

/// A point, spot or goniometric light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointLight {
    /// Position in world space.
    pub position: Vec3,
    /// Radiant intensity along the axis of the cone, not black.
    pub intensity: Vec3,
    /// Directions into which it emits.
    pub cone: Cone,
    /// Factor on the intensity by direction.
    pub map: Option<IntensityMap>,
}

/// Factor on the intensity of a point light by direction of emission, given by an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IntensityMap {
    /// Index into [`CompiledScene::textures`] of an image with finite texels of at least 0, not
    /// black everywhere.
    pub texture: u32,
    /// Place of the image's points among the directions.
    pub mapping: MapSpace,
}

/// Place of the points of an image among directions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum MapSpace {
    /// An equirectangular map of all directions, with the orientation of [`EnvironmentDesc`].
    Sphere {
        /// Rotation of the map about +y in radians, counter-clockwise seen from above.
        rotation_rad: f32,
    },
    /// An image across the axis of the cone, beyond whose edges there is no light.
    Plane {
        /// Vector whose product with a direction, over the cosine to the axis, is 1 at the right
        /// edge and -1 at the left one.
        right: Vec3,
        /// The same for the upper and the lower edge.
        up: Vec3,
        /// Whether the intensity is divided by the cube of the cosine to the axis.
        even: bool,
    },
}

/// Directions into which a point emits. Angles are stored as heights, one minus the cosine with the
/// axis, which stays precise for narrow cones.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cone {
    /// Axis of the cone, a unit vector.
    pub axis: Vec3,
    /// Angle from the axis in radians up to which the intensity is that of the axis.
    pub beam: f32,
    /// Angle from the axis in radians beyond which the intensity is zero.
    pub cutoff: f32,
    /// One minus the cosine of `beam`.
    pub beam_height: f32,
    /// One minus the cosine of `cutoff`; 2 means all directions, without falloff.
    pub cutoff_height: f32,
    /// Whether the falloff is the square of a ramp linear in the cosine, instead of linear in the
    /// angle.
    pub smooth: bool,
}

impl Cone {
    /// Cone of all directions.
    pub const WHOLE: Cone = Cone {
        axis: Vec3::Z,
        beam: std::f32::consts::PI,
        cutoff: std::f32::consts::PI,
        beam_height: 2.0,
        cutoff_height: 2.0,
        smooth: false,
    };

    /// Creates a cone about an axis of any non-zero length.
    pub fn new(axis: Vec3, desc: &ConeDesc) -> Cone {
        let height =
            |degrees: f32| (2.0 * (f64::from(degrees).to_radians() / 2.0).sin().powi(2)) as f32;
        Cone {
            axis: axis.as_dvec3().normalize_or(DVec3::Z).as_vec3(),
            beam: desc.beam_deg.to_radians(),
            cutoff: desc.cutoff_deg.to_radians(),
            beam_height: height(desc.beam_deg),
            cutoff_height: height(desc.cutoff_deg),
            smooth: desc.edge == ConeEdge::Smooth,
        }
    }

    /// Returns whether the cone contains all directions.
    #[inline]
    pub fn is_whole(&self) -> bool {
        self.cutoff_height >= 2.0
    }

    /// Returns the mean of the falloff over all directions.
    pub fn mean_falloff(&self) -> f64 {
        let [beam, cutoff] = [self.beam, self.cutoff].map(f64::from);
        let [low, high] = [self.beam_height, self.cutoff_height].map(f64::from);
        if self.smooth || high - low < 1e-9 {
            return (low + (high - low) * if self.smooth { 1.0 / 3.0 } else { 0.5 }) / 2.0;
        }
        // The integral of sin t (cutoff - t) / (cutoff - beam) from beam to cutoff, plus that of
        // sin t from 0 to beam.
        (1.0 - (cutoff.sin() - beam.sin()) / (cutoff - beam)) / 2.0
    }
}

/// Parallel light from infinitely far away.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectionalLight {
    /// Unit direction in which the light travels.
    pub direction: Vec3,
    /// Irradiance on a surface that faces the light, not black.
    pub irradiance: Vec3,
}

/// Light that surrounds the scene; never black everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// Equirectangular map with finite texels of at least 0; `None` is a constant environment. Its
    /// orientation is that of [`EnvironmentDesc`].
    pub map: Option<Arc<Texture>>,
    /// Radiance of a constant environment, or factor on the map.
    pub radiance: Vec3,
    /// Rotation of the map about +y in radians, counter-clockwise seen from above.
    pub rotation_rad: f32,
    /// Distribution with which directions towards the map are sampled.
    pub sampling: EnvironmentSampling,
}

/// Returns the number of lights without a surface, except the environment.
pub(super) fn count(scene: &CompiledScene) -> usize {
    scene.points.len() + scene.directionals.len()
}

/// Checks the lights of a description and returns a scene that contains these alone, by type; black
/// ones are left out with a [`Note`]. Maps of goniometric lights are appended to `textures`.
///
/// # Errors
/// Fails for a light with a value that is not finite, negative or out of range, or a direction of
/// length zero.
pub(super) fn compile(
    desc: &SceneDesc,
    textures: &mut Vec<Texture>,
    notes: &mut Vec<Note>,
) -> Result<CompiledScene, SceneError> {
    let mut maps = IntensityMaps {
        textures,
        index: BTreeMap::new(),
    };
    let mut compiled = CompiledScene {
        origin: place::origin(desc),
        ..CompiledScene::default()
    };
    for light in &desc.lights {
        let place = format!("lights.{}", light.name);
        let rest = light.rest;
        let mut add_point = |position, intensity, cone, map| {
            let light = point_light(position, intensity, cone)?;
            let position = compiled.placed(light.position, rest);
            compiled.points.push(PointLight {
                position,
                map,
                ..light
            });
            Ok(())
        };
        let (color, result) = match light.kind {
            LightKind::Point {
                position,
                intensity,
            } => (intensity, add_point(position, intensity, None, None)),
            LightKind::Spot {
                position,
                direction,
                intensity,
                cone,
                ref image,
            } => {
                let map = match image {
                    None => Ok(None),
                    Some(image) => spot_map(image, direction, &mut maps, notes),
                };
                let black = image.is_some() && map == Ok(None);
                let intensity = if black { Vec3::ZERO } else { intensity };
                let result = map
                    .and_then(|map| add_point(position, intensity, Some((direction, cone)), map));
                (intensity, result)
            }
            LightKind::Goniometric {
                position,
                intensity,
                ref map,
                rotation_deg,
            } => {
                let map = maps.add(map, notes).map(|texture| IntensityMap {
                    texture,
                    mapping: MapSpace::Sphere {
                        rotation_rad: radians(rotation_deg),
                    },
                });
                let intensity = if map.is_some() { intensity } else { Vec3::ZERO };
                let result = check_rotation(rotation_deg)
                    .and_then(|()| add_point(position, intensity, None, map));
                (intensity, result)
            }
            LightKind::Directional {
                direction,
                irradiance,
            } => (
                irradiance,
                directional_light(direction, irradiance)
                    .map(|light| compiled.directionals.push(light)),
            ),
        };
        result.map_err(|problem| SceneError::malformed("", place.clone(), problem))?;
        if color == Vec3::ZERO {
            notes.push(Note::new(
                "",
                &place,
                "the light is black and has been left out",
            ));
        }
    }
    compiled
        .points
        .retain(|light| light.intensity != Vec3::ZERO);
    compiled
        .directionals
        .retain(|light| light.irradiance != Vec3::ZERO);
    if let Some(environment) = &desc.environment {
        compiled.environment = compile_environment(environment, notes)?;
    }
    Ok(compiled)
}

/// Returns a compiled point light, or with an axis and a cone a compiled spot light.
fn point_light(
    position: Vec3,
    intensity: Vec3,
    spot: Option<(Vec3, ConeDesc)>,
) -> Result<PointLight, String> {
    if !position.is_finite() || position.abs().max_element() > MAX_COORDINATE {
        return Err(format!(
            "the position is {position}; coordinates must be within {MAX_COORDINATE:e} of the \
             origin"
        ));
    }
    check_color("intensity", intensity)?;
    let mut cone = Cone::WHOLE;
    if let Some((direction, desc)) = spot {
        if direction.as_dvec3().try_normalize().is_none() {
            return Err(zero_direction(direction));
        }
        if !desc.is_possible() {
            let ConeDesc {
                beam_deg,
                cutoff_deg,
                ..
            } = desc;
            return Err(format!(
                "a beam of {beam_deg} and a cutoff of {cutoff_deg} degrees form no cone; expected \
                 0 <= beam <= cutoff < 180"
            ));
        }
        cone = Cone::new(direction, &desc);
    }
    Ok(PointLight {
        position,
        intensity,
        cone,
        map: None,
    })
}

/// Returns the map of a spot light's image; `None` for one that is black everywhere.
fn spot_map(
    image: &SpotImage,
    direction: Vec3,
    maps: &mut IntensityMaps,
    notes: &mut Vec<Note>,
) -> Result<Option<IntensityMap>, String> {
    let axis = direction.as_dvec3().normalize_or(DVec3::Z);
    let [right, up] = [image.right, image.up].map(|v| {
        let v = v.as_dvec3();
        v - axis * axis.dot(v)
    });
    let area = right.cross(up).dot(axis).abs();
    if !(area > 1e-12 && right.length().max(up.length()) < 1e6) {
        return Err("the image of the light needs a width and a height across its axis".to_owned());
    }
    let mapping = MapSpace::Plane {
        right: dual(right, up).as_vec3(),
        up: dual(up, right).as_vec3(),
        even: image.even,
    };
    let map = maps.add(&image.texture, notes);
    Ok(map.map(|texture| IntensityMap { texture, mapping }))
}

/// Returns the vector in the plane of two others whose product with the first is 1, and with the
/// second 0.
fn dual(of: DVec3, other: DVec3) -> DVec3 {
    let across = of - other * (of.dot(other) / other.length_squared());
    across / across.dot(of)
}

/// Textures of a scene, to which the maps of goniometric lights are added, each once.
struct IntensityMaps<'a> {
    textures: &'a mut Vec<Texture>,
    /// Index of a map by its content hash; `None` if it is black everywhere.
    index: BTreeMap<[u8; 32], Option<u32>>,
}

impl IntensityMaps<'_> {
    /// Returns the index of a map's texture; `None` if it is black everywhere.
    fn add(&mut self, desc: &TextureDesc, notes: &mut Vec<Note>) -> Option<u32> {
        if let Some(known) = self.index.get(&desc.content_hash) {
            return *known;
        }
        let map = decode_map(desc, notes);
        let index = (!is_black(&map)).then(|| {
            self.textures.push(map);
            self.textures.len() as u32 - 1
        });
        self.index.insert(desc.content_hash, index);
        index
    }
}

/// Returns a compiled directional light.
fn directional_light(direction: Vec3, irradiance: Vec3) -> Result<DirectionalLight, String> {
    let Some(unit) = direction.as_dvec3().try_normalize() else {
        return Err(zero_direction(direction));
    };
    check_color("irradiance", irradiance)?;
    Ok(DirectionalLight {
        direction: unit.as_vec3(),
        irradiance,
    })
}

/// Returns the error message for a direction without a length.
fn zero_direction(direction: Vec3) -> String {
    format!("the direction {direction} must be finite and have a length above 0")
}

/// Checks and decodes an environment. Returns `None`, with a note, for a black one.
fn compile_environment(
    desc: &EnvironmentDesc,
    notes: &mut Vec<Note>,
) -> Result<Option<Environment>, SceneError> {
    let fail = |key: &str, problem: String| {
        SceneError::malformed("", format!("environment.{key}"), problem)
    };
    if !(desc.scale.is_finite() && desc.scale >= 0.0) {
        return Err(fail(
            "scale",
            format!("expected a number of 0 or more, found {}", desc.scale),
        ));
    }
    check_rotation(desc.rotation_deg).map_err(|problem| fail("rotation", problem))?;
    let (map, color) = match &desc.source {
        EnvironmentSource::Color(color) => {
            check_color("color", *color).map_err(|problem| fail("color", problem))?;
            (None, *color)
        }
        EnvironmentSource::Map(texture) => {
            let map = decode_map(texture, notes);
            let factor = if is_black(&map) {
                Vec3::ZERO
            } else {
                Vec3::ONE
            };
            (Some(Arc::new(map)), factor)
        }
    };
    let radiance = color * desc.scale;
    if !radiance.is_finite() {
        return Err(fail(
            "scale",
            "the radiance exceeds the range of 32-bit floats".to_owned(),
        ));
    }
    if radiance == Vec3::ZERO {
        notes.push(Note::new(
            "",
            "environment",
            "the environment is black and has been left out",
        ));
        return Ok(None);
    }
    Ok(Some(Environment {
        map,
        radiance,
        rotation_rad: radians(desc.rotation_deg),
        sampling: desc.sampling,
    }))
}

/// Checks the rotation of a map.
fn check_rotation(degrees: f32) -> Result<(), String> {
    if degrees.is_finite() {
        return Ok(());
    }
    Err(format!("expected an angle in degrees, found {degrees}"))
}

/// Returns an angle of any number of degrees in radians, at least 0 and below one turn.
fn radians(degrees: f32) -> f32 {
    f64::from(degrees).rem_euclid(360.0).to_radians() as f32
}

/// Returns whether all texels of a map are black.
fn is_black(map: &Texture) -> bool {
    map.texels.iter().all(|texel| texel == [0.0; 3])
}

/// Decodes a map of directions, with a note if it has invalid values.
fn decode_map(texture: &TextureDesc, notes: &mut Vec<Note>) -> Texture {
    let mut map = Texture::decode(texture, true);
    let repaired = repair(&mut map);
    if repaired > 0 {
        notes.push(Note::new(
            texture.file.clone(),
            "image",
            format!("found {repaired} values that are negative or not finite; they count as black"),
        ));
    }
    map
}

/// Checks that a colour is finite and not negative.
fn check_color(key: &str, color: Vec3) -> Result<(), String> {
    if color.is_finite() && color.min_element() >= 0.0 {
        return Ok(());
    }
    Err(format!(
        "the {key} must be finite and not negative, found {color}"
    ))
}

/// Replaces invalid radiances by black; returns their number.
fn repair(map: &mut Texture) -> usize {
    let mut repaired = 0;
    let floats = map.texels.floats_mut().unwrap_or_default();
    for x in floats
        .as_flattened_mut()
        .iter_mut()
        .filter(|x| !(x.is_finite() && **x >= 0.0))
    {
        *x = 0.0;
        repaired += 1;
    }
    repaired
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::{CameraDesc, LightDesc, Texels, texture_hash};

    fn scene(lights: Vec<LightKind>, environment: Option<EnvironmentDesc>) -> SceneDesc {
        let named = |(i, kind)| LightDesc::new(format!("l{i}"), kind);
        SceneDesc {
            resolution: [1, 1],
            max_depth: 1,
            camera: CameraDesc {
                position: Vec3::Z,
                target: Vec3::ZERO,
                ..CameraDesc::default()
            },
            lights: lights.into_iter().enumerate().map(named).collect(),
            environment,
            ..SceneDesc::default()
        }
    }

    fn compile_lights(
        desc: &SceneDesc,
        notes: &mut Vec<Note>,
    ) -> Result<CompiledScene, SceneError> {
        let mut textures = Vec::new();
        let lights = compile(desc, &mut textures, notes)?;
        Ok(CompiledScene { textures, ..lights })
    }

    fn image(texels: Vec<[f32; 4]>) -> Arc<TextureDesc> {
        let (width, texels) = (texels.len() as u32, Texels::RgbaF32(texels));
        let content_hash = texture_hash(width, 1, &texels);
        Arc::new(TextureDesc {
            file: "m.hdr".into(),
            width,
            height: 1,
            texels,
            content_hash,
        })
    }

    fn map(texels: Vec<[f32; 4]>) -> EnvironmentSource {
        EnvironmentSource::Map(image(texels))
    }

    #[test]
    fn lights_are_sorted_by_type_and_directions_are_normalised() {
        let point = LightKind::Point {
            position: Vec3::X,
            intensity: Vec3::ONE,
        };
        let sun = LightKind::Directional {
            direction: Vec3::new(0.0, -3e-30, 0.0),
            irradiance: Vec3::ONE,
        };
        let dark = LightKind::Point {
            position: Vec3::X,
            intensity: Vec3::ZERO,
        };
        let mut notes = Vec::new();
        let c = compile_lights(&scene(vec![sun, dark, point], None), &mut notes).unwrap();
        assert_eq!((c.points.len(), c.directionals.len()), (1, 1));
        assert_eq!(c.directionals[0].direction, Vec3::NEG_Y);
        assert_eq!(notes.len(), 1);
        assert!(notes[0].place == "lights.l1" && notes[0].message.contains("black"));
    }

    #[test]
    fn goniometric_lights_are_point_lights_that_share_equal_maps() {
        let light = |texel: f32, rotation_deg| LightKind::Goniometric {
            position: Vec3::X,
            intensity: Vec3::ONE,
            map: image(vec![[texel, f32::NAN, 0.5, 1.0]]),
            rotation_deg,
        };
        let mut notes = Vec::new();
        let lights = vec![light(2.0, 0.0), light(2.0, -90.0), light(3.0, 0.0)];
        let c = compile_lights(&scene(lights, None), &mut notes).unwrap();
        let map = |i: usize| c.points[i].map.unwrap();
        assert_eq!([0, 1, 2].map(|i| map(i).texture), [0, 0, 1]);
        assert_eq!(c.textures.len(), 2);
        let MapSpace::Sphere { rotation_rad } = map(1).mapping else {
            panic!("a map of all directions expected")
        };
        assert!((rotation_rad - 270f32.to_radians()).abs() < 1e-6);
        assert_eq!(c.textures[0].texels.at(0), [2.0, 0.0, 0.5]);
        assert!(notes.len() == 2 && notes[0].message.contains("count as black"));

        let black = LightKind::Goniometric {
            position: Vec3::X,
            intensity: Vec3::ONE,
            map: image(vec![[0.0; 4]]),
            rotation_deg: 0.0,
        };
        let mut notes = Vec::new();
        let c = compile_lights(&scene(vec![black], None), &mut notes).unwrap();
        assert!(c.points.is_empty() && c.textures.is_empty());
        assert!(notes.len() == 1 && notes[0].message.contains("black"));
        let bad = scene(vec![light(1.0, f32::NAN)], None);
        let e = compile_lights(&bad, &mut Vec::new()).err().unwrap();
        assert!(e.to_string().contains("an angle"), "{e}");
    }

    #[test]
    fn invalid_values_are_errors_that_name_the_light() {
        let bad = [
            LightKind::Point {
                position: Vec3::NAN,
                intensity: Vec3::ONE,
            },
            LightKind::Point {
                position: Vec3::X,
                intensity: -Vec3::ONE,
            },
            LightKind::Directional {
                direction: Vec3::ZERO,
                irradiance: Vec3::ONE,
            },
            LightKind::Directional {
                direction: Vec3::X,
                irradiance: Vec3::INFINITY,
            },
        ];
        for kind in bad {
            let e = compile_lights(&scene(vec![kind], None), &mut Vec::new())
                .err()
                .unwrap()
                .to_string();
            assert!(e.contains("lights.l0"), "{e}");
        }
        for (rotation_deg, scale) in [(f32::NAN, 1.0), (0.0, -1.0), (0.0, f32::INFINITY)] {
            let e = EnvironmentDesc {
                rotation_deg,
                scale,
                ..EnvironmentDesc::new(EnvironmentSource::Color(Vec3::ONE))
            };
            assert!(compile_lights(&scene(vec![], Some(e)), &mut Vec::new()).is_err());
        }
    }

    #[test]
    fn a_black_environment_is_noted_and_left_out_and_invalid_texels_are_black() {
        let env = |source, scale| {
            Some(EnvironmentDesc {
                rotation_deg: 370.0,
                scale,
                ..EnvironmentDesc::new(source)
            })
        };
        let black = [
            env(EnvironmentSource::Color(Vec3::ZERO), 1.0),
            env(EnvironmentSource::Color(Vec3::ONE), 0.0),
            env(map(vec![[0.0; 4]; 2]), 1.0),
        ];
        for e in black {
            let mut notes = Vec::new();
            assert!(
                compile_lights(&scene(vec![], e), &mut notes)
                    .unwrap()
                    .environment
                    .is_none()
            );
            assert!(notes.len() == 1 && notes[0].message.contains("black"));
        }
        let mut notes = Vec::new();
        let e = env(map(vec![[2.0, f32::NAN, -1.0, 1.0], [1.0; 4]]), 3.0);
        let e = compile_lights(&scene(vec![], e), &mut notes)
            .unwrap()
            .environment
            .unwrap();
        assert_eq!(e.map.unwrap().texels.at(0), [2.0, 0.0, 0.0]);
        assert_eq!(e.radiance, Vec3::splat(3.0));
        assert!((e.rotation_rad - 10f32.to_radians()).abs() < 1e-6);
        assert!(
            notes.len() == 1 && notes[0].message.contains('2'),
            "{notes:?}"
        );
    }
}
