//! Lights without a surface, as the integrators read them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;

use super::Texture;
use crate::scene::desc::{
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightKind, MAX_COORDINATE, SceneDesc,
};
use crate::scene::{Note, SceneError};

/// A point that shines in all directions or into a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Position in world space.
    pub position: Vec3,
    /// Radiant intensity along the axis of the cone, not black.
    pub intensity: Vec3,
    /// Where it shines.
    pub cone: Cone,
}

/// The directions into which a point shines. The height of a direction is one minus its cosine with the axis, which keeps
/// its digits in narrow cones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Its axis, a unit vector.
    pub axis: Vec3,
    /// Angle from the axis in radians up to which the intensity is whole.
    pub beam: f32,
    /// Angle from the axis in radians from which on there is none.
    pub cutoff: f32,
    /// Height of `beam`.
    pub beam_height: f32,
    /// Height of `cutoff`; 2 is that of all directions, where nothing falls off.
    pub cutoff_height: f32,
    /// Whether intensity falls off with the square of what is linear in the cosine, instead of linearly with the angle.
    pub smooth: bool,
}

impl Cone {
    /// All directions.
    pub const WHOLE: Cone = Cone {
        axis: Vec3::Z,
        beam: std::f32::consts::PI,
        cutoff: std::f32::consts::PI,
        beam_height: 2.0,
        cutoff_height: 2.0,
        smooth: false,
    };

    /// A cone about a direction of any length but zero.
    pub fn new(axis: Vec3, desc: &ConeDesc) -> Cone {
        let height = |degrees: f32| (2.0 * (f64::from(degrees).to_radians() / 2.0).sin().powi(2)) as f32;
        Cone {
            axis: axis.as_dvec3().normalize_or(glam::DVec3::Z).as_vec3(),
            beam: desc.beam_deg.to_radians(),
            cutoff: desc.cutoff_deg.to_radians(),
            beam_height: height(desc.beam_deg),
            cutoff_height: height(desc.cutoff_deg),
            smooth: desc.edge == ConeEdge::Smooth,
        }
    }

    /// Whether it is all directions.
    #[inline]
    pub fn is_whole(&self) -> bool {
        self.cutoff_height >= 2.0
    }

    /// Mean over all directions of what is left of the intensity.
    pub fn share(&self) -> f64 {
        let [beam, cutoff] = [self.beam, self.cutoff].map(f64::from);
        let [low, high] = [self.beam_height, self.cutoff_height].map(f64::from);
        if self.smooth || high - low < 1e-9 {
            return (low + (high - low) * if self.smooth { 1.0 / 3.0 } else { 0.5 }) / 2.0;
        }
        // The integral of sin t (cutoff - t) / (cutoff - beam) from beam to cutoff, and of sin t before.
        (1.0 - (cutoff.sin() - beam.sin()) / (cutoff - beam)) / 2.0
    }
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
            LightKind::Point { position, intensity } | LightKind::Spot { position, intensity, .. } => {
                if !position.is_finite() || position.abs().max_element() > MAX_COORDINATE {
                    let problem =
                        format!("its position {position} does not lie within {MAX_COORDINATE:e} of the origin");
                    return Err(fail(problem));
                }
                check_color("intensity", intensity).map_err(fail)?;
                let mut cone = Cone::WHOLE;
                if let LightKind::Spot { direction, cone: desc, .. } = light.kind {
                    if direction.as_dvec3().try_normalize().is_none() {
                        return Err(fail(format!("its direction {direction} points nowhere")));
                    }
                    if !desc.is_possible() {
                        let ConeDesc { beam_deg, cutoff_deg, .. } = desc;
                        return Err(fail(format!(
                            "a beam of {beam_deg} and a cutoff of {cutoff_deg} degrees are no cone"
                        )));
                    }
                    cone = Cone::new(direction, &desc);
                }
                if !dark(intensity) {
                    compiled.points.push(PointLight { position, intensity, cone });
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
    for x in Arc::make_mut(&mut map.texels).as_flattened_mut().iter_mut().filter(|x| !(x.is_finite() && **x >= 0.0)) {
        *x = 0.0;
        repaired += 1;
    }
    repaired
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::{CameraDesc, LightDesc, Texels, TextureDesc, texture_hash};

    fn scene(lights: Vec<LightKind>, environment: Option<EnvironmentDesc>) -> SceneDesc {
        let named = |(i, kind)| LightDesc { name: format!("l{i}"), kind };
        SceneDesc {
            views: Vec::new(),
            resolution: [1, 1],
            max_depth: 1,
            camera: CameraDesc { position: Vec3::Z, target: Vec3::ZERO, ..CameraDesc::default() },
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
