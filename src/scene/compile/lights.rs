//! Lights without a surface, as the integrators read them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;

use super::Texture;
use crate::scene::desc::{EnvironmentDesc, EnvironmentSource, LightKind, MAX_COORDINATE, SceneDesc};
use crate::scene::{Note, SceneError};

/// A point that shines equally in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Position in world space.
    pub position: Vec3,
    /// Radiant intensity, not black.
    pub intensity: Vec3,
}

/// Parallel light from infinitely far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalLight {
    /// Unit direction in which the light travels.
    pub direction: Vec3,
    /// Irradiance on a surface that faces the light, not black.
    pub irradiance: Vec3,
}

/// What surrounds the scene; never black everywhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Equirectangular map with texels that are finite and not negative; `None` is the same colour from everywhere.
    /// Its orientation is that of [`EnvironmentDesc`].
    pub map: Option<Arc<Texture>>,
    /// Radiance of a constant environment, factor on a map.
    pub radiance: Vec3,
    /// Angle in radians by which the map is turned about +y, counter-clockwise seen from above.
    pub rotation_rad: f32,
}

/// Everything of a description that shines without a surface.
pub(super) struct Compiled {
    pub points: Vec<PointLight>,
    pub directionals: Vec<DirectionalLight>,
    pub environment: Option<Environment>,
}

/// Checks and sorts the lights of a description; black ones are left out with a [`Note`].
///
/// # Errors
/// A light with a value that is not finite or negative, out of range, or a direction of length zero.
pub(super) fn compile(desc: &SceneDesc, notes: &mut Vec<Note>) -> Result<Compiled, SceneError> {
    let mut compiled = Compiled { points: Vec::new(), directionals: Vec::new(), environment: None };
    for light in &desc.lights {
        let place = format!("lights.{}", light.name);
        let fail = |problem: String| SceneError::Malformed { file: PathBuf::new(), place: place.clone(), problem };
        let mut dark = |color: Vec3| {
            if color == Vec3::ZERO {
                notes.push(note(&place, "it is black: left out"));
            }
            color == Vec3::ZERO
        };
        match light.kind {
            LightKind::Point { position, intensity } => {
                if !position.is_finite() || position.abs().max_element() > MAX_COORDINATE {
                    let problem =
                        format!("its position {position} does not lie within {MAX_COORDINATE:e} of the origin");
                    return Err(fail(problem));
                }
                check_color("intensity", intensity).map_err(fail)?;
                if !dark(intensity) {
                    compiled.points.push(PointLight { position, intensity });
                }
            }
            LightKind::Directional { direction, irradiance } => {
                let unit = direction.as_dvec3().try_normalize().map(|d| d.as_vec3());
                let Some(direction) = unit else {
                    return Err(fail(format!("its direction {direction} points nowhere")));
                };
                check_color("irradiance", irradiance).map_err(fail)?;
                if !dark(irradiance) {
                    compiled.directionals.push(DirectionalLight { direction, irradiance });
                }
            }
        }
    }
    if let Some(environment) = &desc.environment {
        compiled.environment = surroundings(environment, notes)?;
    }
    Ok(compiled)
}

fn surroundings(desc: &EnvironmentDesc, notes: &mut Vec<Note>) -> Result<Option<Environment>, SceneError> {
    let fail = |key: &str, problem: String| SceneError::Malformed {
        file: PathBuf::new(),
        place: format!("environment.{key}"),
        problem,
    };
    if !(desc.scale.is_finite() && desc.scale >= 0.0) {
        return Err(fail("scale", format!("expected a number that is not negative, found {}", desc.scale)));
    }
    if !desc.rotation_deg.is_finite() {
        return Err(fail("rotation", format!("expected an angle in degrees, found {}", desc.rotation_deg)));
    }
    let (map, color) = match &desc.source {
        EnvironmentSource::Color(color) => {
            check_color("color", *color).map_err(|problem| fail("color", problem))?;
            (None, *color)
        }
        EnvironmentSource::Map(texture) => {
            let mut map = Texture::decode(texture, true);
            let repaired = repair(&mut map);
            if repaired > 0 {
                notes.push(Note {
                    file: texture.file.clone(),
                    place: "image".to_owned(),
                    message: format!("values that are negative or not finite: {repaired} count as black"),
                });
            }
            let black = map.texels.as_flattened().iter().all(|x| *x == 0.0);
            (Some(Arc::new(map)), if black { Vec3::ZERO } else { Vec3::ONE })
        }
    };
    let radiance = color * desc.scale;
    if !radiance.is_finite() {
        return Err(fail("scale", "the radiance leaves the range of numbers".to_owned()));
    }
    if radiance == Vec3::ZERO {
        notes.push(note("environment", "it is black: left out"));
        return Ok(None);
    }
    let rotation_rad = f64::from(desc.rotation_deg).rem_euclid(360.0).to_radians() as f32;
    Ok(Some(Environment { map, radiance, rotation_rad }))
}

fn note(place: &str, message: &str) -> Note {
    Note { file: Path::new("").to_owned(), place: place.to_owned(), message: message.to_owned() }
}

fn check_color(key: &str, color: Vec3) -> Result<(), String> {
    if color.is_finite() && color.min_element() >= 0.0 {
        return Ok(());
    }
    Err(format!("its {key} must be finite and not negative, found {color}"))
}

/// Makes values black that no light can have; returns how many.
fn repair(map: &mut Texture) -> usize {
    let mut repaired = 0;
    for x in map.texels.as_flattened_mut().iter_mut().filter(|x| !(x.is_finite() && **x >= 0.0)) {
        *x = 0.0;
        repaired += 1;
    }
    repaired
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::{CameraDesc, LightDesc, Optics, Texels, TextureDesc, texture_hash};

    fn scene(lights: Vec<LightKind>, environment: Option<EnvironmentDesc>) -> SceneDesc {
        let named = |(i, kind)| LightDesc { name: format!("l{i}"), kind };
        SceneDesc {
            views: Vec::new(),
            resolution: [1, 1],
            max_depth: 1,
            camera: CameraDesc {
                position: Vec3::Z,
                target: Vec3::ZERO,
                up: Vec3::Y,
                fov_deg: 45.0,
                aperture: 0.0,
                focus_distance: None,
                optics: Optics::default(),
            },
            materials: vec![],
            entities: vec![],
            lights: lights.into_iter().enumerate().map(named).collect(),
            environment,
        }
    }

    fn map(texels: Vec<[f32; 4]>) -> EnvironmentSource {
        let (width, texels) = (texels.len() as u32, Texels::RgbaF32(texels));
        let content_hash = texture_hash(width, 1, &texels);
        EnvironmentSource::Map(Arc::new(TextureDesc { file: "m.hdr".into(), width, height: 1, texels, content_hash }))
    }

    #[test]
    fn lights_are_sorted_by_kind_and_directions_become_unit() {
        let point = LightKind::Point { position: Vec3::X, intensity: Vec3::ONE };
        let sun = LightKind::Directional { direction: Vec3::new(0.0, -3e-30, 0.0), irradiance: Vec3::ONE };
        let dark = LightKind::Point { position: Vec3::X, intensity: Vec3::ZERO };
        let mut notes = Vec::new();
        let c = compile(&scene(vec![sun, dark, point], None), &mut notes).unwrap();
        assert_eq!((c.points.len(), c.directionals.len()), (1, 1));
        assert_eq!(c.directionals[0].direction, Vec3::NEG_Y);
        assert_eq!(notes.len(), 1);
        assert!(notes[0].place == "lights.l1" && notes[0].message.contains("black"));
    }

    #[test]
    fn nonsense_is_an_error_that_names_the_light() {
        let bad = [
            LightKind::Point { position: Vec3::NAN, intensity: Vec3::ONE },
            LightKind::Point { position: Vec3::X, intensity: -Vec3::ONE },
            LightKind::Directional { direction: Vec3::ZERO, irradiance: Vec3::ONE },
            LightKind::Directional { direction: Vec3::X, irradiance: Vec3::INFINITY },
        ];
        for kind in bad {
            let e = compile(&scene(vec![kind], None), &mut Vec::new()).err().unwrap().to_string();
            assert!(e.contains("lights.l0"), "{e}");
        }
        for (rotation_deg, scale) in [(f32::NAN, 1.0), (0.0, -1.0), (0.0, f32::INFINITY)] {
            let e = EnvironmentDesc { source: EnvironmentSource::Color(Vec3::ONE), rotation_deg, scale };
            assert!(compile(&scene(vec![], Some(e)), &mut Vec::new()).is_err());
        }
    }

    #[test]
    fn a_black_environment_is_noted_and_left_out_and_bad_texels_are_black() {
        let env = |source, scale| Some(EnvironmentDesc { source, rotation_deg: 370.0, scale });
        let black = [
            env(EnvironmentSource::Color(Vec3::ZERO), 1.0),
            env(EnvironmentSource::Color(Vec3::ONE), 0.0),
            env(map(vec![[0.0; 4]; 2]), 1.0),
        ];
        for e in black {
            let mut notes = Vec::new();
            assert!(compile(&scene(vec![], e), &mut notes).unwrap().environment.is_none());
            assert!(notes.len() == 1 && notes[0].message.contains("black"));
        }
        let mut notes = Vec::new();
        let e = env(map(vec![[2.0, f32::NAN, -1.0, 1.0], [1.0; 4]]), 3.0);
        let e = compile(&scene(vec![], e), &mut notes).unwrap().environment.unwrap();
        assert_eq!(e.map.unwrap().texels[0], [2.0, 0.0, 0.0]);
        assert_eq!(e.radiance, Vec3::splat(3.0));
        assert!((e.rotation_rad - 10f32.to_radians()).abs() < 1e-6);
        assert!(notes.len() == 1 && notes[0].message.contains('2'), "{notes:?}");
    }
}
