//! Lights: `diffuse` on shapes, `point`, `spot`, `goniometric`, `distant` and `infinite`.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::environment;
use super::params::Params;
use super::spectrum::{Spectra, Use};
use super::texture::{TextureContext, TextureReader};
use super::token::truncated;
use super::version::Version;
use crate::load::environment::texel;
use crate::load::images::mean_texel;
use crate::model_differences;
use lumbre_light::math::luminance::luminance_f32;
use lumbre_light::scene::compile::Curve;
use lumbre_light::scene::desc::light::CUTOFF_RANGE;
use lumbre_light::scene::desc::{
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightKind, MaterialDesc, ShapeDesc,
    SpotImage, Texels, TextureDesc, TextureSlot,
};
use lumbre_light::scene::{Note, SceneError};

/// An `AreaLightSource` directive, for the shapes after it.
#[derive(Debug)]
pub(super) struct AreaSource {
    pub class: String,
    pub params: Params,
    pub spectra: Spectra,
}

/// A light without a shape.
pub(super) enum SceneLight {
    /// Light that surrounds the scene.
    Environment(EnvironmentDesc),
    /// A point, spot or directional light, and its position.
    Light(LightKind, DVec3),
}

/// Reader of lights.
pub(super) struct LightReader<'a> {
    pub spectra: &'a Spectra,
    pub textures: &'a mut TextureReader,
    pub notes: &'a mut Vec<Note>,
    /// Factor of the film on all light.
    pub exposure: f32,
}

/// Areas of the triangles of a shape in the world, or of a sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Areas {
    least: f64,
    most: f64,
}

impl Areas {
    /// Measures a shape.
    pub fn of(shape: &ShapeDesc, to_world: &DAffine3) -> Areas {
        match shape {
            ShapeDesc::Sphere { radius } => {
                let radius = f64::from(*radius) * to_world.matrix3.x_axis.length();
                let area = 4.0 * PI * radius * radius;
                Areas {
                    least: area,
                    most: area,
                }
            }
            ShapeDesc::Mesh(mesh) => {
                let mut areas = Areas {
                    least: f64::INFINITY,
                    most: 0.0,
                };
                for t in &mesh.triangles {
                    let corners = t.map(|i| mesh.positions[i as usize].as_dvec3());
                    let [a, b, c] = corners.map(|p| to_world.transform_point3(p));
                    let area = 0.5 * (b - a).cross(c - a).length();
                    areas.least = areas.least.min(area);
                    areas.most = areas.most.max(area);
                }
                areas
            }
        }
    }
}

impl LightReader<'_> {
    /// Returns the factor `scale`, at least 0, times that of the film.
    fn scale(&self, params: &Params) -> Result<f32, SceneError> {
        let scale = params.number("scale", 1.0)?;
        if (0.0..=1e9).contains(&scale) {
            return Ok(scale as f32 * self.exposure);
        }
        Err(params.error(format!("`scale` must be between 0 and 1e9, found {scale}")))
    }

    /// Returns a colour of light, by default white. In version 3 `scale` may be a colour.
    fn color(&mut self, params: &Params, name: &str) -> Result<Vec3, SceneError> {
        let color = match params.get(name) {
            Some(p) => self.spectra.color(p, Use::Light)?,
            None => Vec3::ONE,
        };
        let scale = match params.get("scale") {
            Some(p) if p.ty != "float" => {
                let by = self.spectra.color(p, Use::Reflectance)?;
                by * self.exposure
            }
            _ => Vec3::splat(self.scale(params)?),
        };
        Ok(color * scale)
    }

    /// Returns the radiance times a factor, within the limit on lights.
    fn limited(params: &Params, color: Vec3, by: f64) -> Result<Vec3, SceneError> {
        let color = (color.as_dvec3() * by).as_vec3();
        if color.is_finite() && color.max_element() <= 1e9 {
            return Ok(color);
        }
        Err(params.error(format!("the light has {color}, more than 1e9")))
    }

    /// Sets the emission of a material to that of an area light on a shape.
    pub fn set_emission(
        &mut self,
        m: &mut MaterialDesc,
        source: &AreaSource,
        areas: Areas,
    ) -> Result<(), SceneError> {
        let params = &source.params;
        // Versions 1 to 3 also know it as `area`.
        if !["diffuse", "area"].contains(&source.class.as_str()) {
            return Err(params.error(format!(
                "the area light `{}` is not known; expected `diffuse`",
                truncated(&source.class)
            )));
        }
        params.mark_read(&["samples", "nsamples"]);
        let mut color = self.color(params, "L")?;
        let two_sided = params.flag("twosided", false)?;
        let image = match params.text("filename")? {
            Some(_) if params.get("L").is_some() => {
                return Err(params.error("`L` and `filename` exclude each other"));
            }
            Some(file) => {
                let mut context = TextureContext {
                    spectra: self.spectra,
                    notes: self.notes,
                };
                self.textures.emission(params, file, &mut context)?
            }
            None => None,
        };
        let power = params.number("power", -1.0)?;
        if power > 0.0 {
            if areas.most > 1.001 * areas.least {
                self.notes.push(params.note(
                    "`power` is that of each triangle in pbrt; the radiance of the largest is used \
                     for all",
                ));
            }
            let mean = image
                .as_ref()
                .map_or(1.0, |image| mean_luminance(&image.image));
            let sides = if two_sided { 2.0 } else { 1.0 };
            let emitted = PI * areas.most * sides * mean;
            color = Self::limited(params, color, power / emitted.max(1e-30))?;
        }
        m.emission = Self::limited(params, color, 1.0)?;
        if let Some(image) = image {
            image.apply_to(m, TextureSlot::Emission);
        }
        params.note_unread(self.notes);
        Ok(())
    }

    /// Reads a `LightSource`; `None`, with a note, if it is not supported.
    pub fn read(
        &mut self,
        class: &str,
        params: &Params,
        to_world: &DAffine3,
    ) -> Result<Option<SceneLight>, SceneError> {
        params.mark_read(&["samples", "nsamples"]);
        let light = match class {
            "point" => self.point(params, to_world)?,
            "spot" => self.spot(params, to_world)?,
            "projection" => match self.projection(params, to_world)? {
                Some(kind) => SceneLight::Light(kind, to_world.translation),
                None => return Ok(None),
            },
            "goniometric" => {
                SceneLight::Light(self.goniometric(params, to_world)?, to_world.translation)
            }
            "distant" => SceneLight::Light(self.distant(params, to_world)?, DVec3::ZERO),
            "infinite" | "exinfinite" => match self.infinite(params, to_world)? {
                Some(environment) => SceneLight::Environment(environment),
                None => return Ok(None),
            },
            other => {
                self.notes.push(params.note(format!(
                    "the light `{}` is not supported; ignored",
                    truncated(other)
                )));
                return Ok(None);
            }
        };
        params.note_unread(self.notes);
        Ok(Some(light))
    }

    /// Reads a `point` light.
    fn point(&mut self, params: &Params, to_world: &DAffine3) -> Result<SceneLight, SceneError> {
        let from = to_world.transform_point3(params.point("from", DVec3::ZERO)?);
        let intensity = self.color(params, "I")?;
        let power = params.number("power", -1.0)?;
        let by = if power > 0.0 { power / (4.0 * PI) } else { 1.0 };
        let kind = LightKind::Point {
            position: from.as_vec3(),
            intensity: Self::limited(params, intensity, by)?,
        };
        Ok(SceneLight::Light(kind, from))
    }

    /// Reads a `spot` light. Its falloff is a polynomial of the cosine in pbrt.
    fn spot(&mut self, params: &Params, to_world: &DAffine3) -> Result<SceneLight, SceneError> {
        let from = params.point("from", DVec3::ZERO)?;
        let to = params.point("to", DVec3::Z)?;
        let intensity = self.color(params, "I")?;
        let cutoff = params.number("coneangle", 30.0)?;
        let delta = params.number("conedeltaangle", 5.0)?;
        let start = (cutoff - delta).max(0.0);
        let (cos_start, cos_end) = (start.to_radians().cos(), cutoff.to_radians().cos());
        let (beam, edge) = match self.spectra.version {
            Version::V4 => {
                self.notes.push(params.note(model_differences::PBRT_SPOT));
                (start, ConeEdge::Linear)
            }
            // The fourth power of a ramp has a mean of 1/5, the square here one of 1/3: the ramp
            // begins where the same light is emitted.
            Version::V3 => {
                self.notes.push(params.note(model_differences::PBRT3_SPOT));
                let cos = (1.2 * cos_start - 0.2 * cos_end).clamp(-1.0, 1.0);
                (cos.acos().to_degrees(), ConeEdge::Smooth)
            }
        };
        let power = params.number("power", -1.0)?;
        let by = if power > 0.0 {
            let solid_angle = 2.0 * PI * ((1.0 - cos_start) + (cos_start - cos_end) / 2.0);
            power / solid_angle.max(1e-30)
        } else {
            1.0
        };
        let cone = ConeDesc {
            beam_deg: beam as f32,
            cutoff_deg: cutoff as f32,
            edge,
        };
        let direction = to_world.transform_vector3(to - from).as_vec3();
        if !cone.is_possible() || direction.try_normalize().is_none() {
            let [least, most] = CUTOFF_RANGE;
            return Err(params.error(format!(
                "an angle of {cutoff} degrees and one of {beam} form no cone; expected an angle \
                 from {least} to {most}, and two different points"
            )));
        }
        let from = to_world.transform_point3(from);
        let kind = LightKind::Spot {
            position: from.as_vec3(),
            direction,
            intensity: Self::limited(params, intensity, by)?,
            cone,
            image: None,
        };
        Ok(SceneLight::Light(kind, from))
    }

    /// Reads a `projection` light, whose angle is that of the shorter side of its image; `None` if
    /// the image cannot be read and the policy allows it.
    fn projection(
        &mut self,
        params: &Params,
        to_world: &DAffine3,
    ) -> Result<Option<LightKind>, SceneError> {
        let (name, angle, intensity, up) = match self.spectra.version {
            Version::V3 => ("mapname", 45.0, self.color(params, "I")?, DVec3::NEG_Y),
            Version::V4 => ("filename", 90.0, Vec3::ONE, DVec3::Y),
        };
        let angle = params.number("fov", angle)?;
        let scale = params.number("scale", 1.0)?;
        let power = params.number("power", -1.0)?;
        let Some(file) = params.text(name)? else {
            return Err(params.error(format!("a projection light needs a `{name}`")));
        };
        if !(angle > 0.0 && angle < 179.0) {
            return Err(params.error(format!(
                "`fov` must be between 0 and 179 degrees, found {angle}"
            )));
        }
        let mut context = TextureContext {
            spectra: self.spectra,
            notes: self.notes,
        };
        let Some(texture) = self.textures.file(params, file, &mut context)? else {
            return Ok(None);
        };
        let [w, h] = [texture.width, texture.height].map(f64::from);
        let half = (angle.to_radians() / 2.0).tan() / w.min(h);
        let by = if power > 0.0 {
            power / emitted(&texture, [half * w, half * h]).max(1e-30)
        } else {
            scale
        };
        // A scale of the transform moves the image away and makes it larger.
        let along = to_world.transform_vector3(DVec3::Z).length();
        let side = |v: DVec3| (to_world.transform_vector3(v) / along).as_vec3();
        let image = SpotImage {
            right: side(DVec3::X * half * w),
            up: side(up * half * h),
            even: false,
            texture,
        };
        self.notes
            .push(params.note(model_differences::PBRT_PROJECTION));
        Ok(Some(LightKind::Spot {
            position: to_world.translation.as_vec3(),
            direction: side(DVec3::Z),
            intensity: Self::limited(params, intensity, by)?,
            cone: image.cone(),
            image: Some(image),
        }))
    }

    /// Reads a `goniometric` light; a point light without a map, or if its image cannot be read and
    /// the policy allows it.
    fn goniometric(
        &mut self,
        params: &Params,
        to_world: &DAffine3,
    ) -> Result<LightKind, SceneError> {
        let position = to_world.transform_point3(DVec3::ZERO).as_vec3();
        let intensity = self.color(params, "I")?;
        let power = params.number("power", -1.0)?;
        let (name, v4) = match self.spectra.version {
            Version::V3 => (params.text("mapname")?, false),
            Version::V4 => (params.text("filename")?, true),
        };
        // pbrt exchanges y and z of the light's space.
        let axes = to_world.matrix3 * DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
        let map = match name {
            Some(file) => self.map(params, file, &axes)?,
            None => None,
        };
        let mean = match &map {
            // The mean of red, green and blue, which version 4 uses.
            Some((image, ..)) => f64::from(mean_texel(image, true).element_sum()) / 3.0,
            None => 1.0,
        };
        let by = if power > 0.0 {
            power / (4.0 * PI * mean.max(1e-30))
        } else {
            1.0
        };
        let intensity = Self::limited(params, intensity, by)?;
        Ok(match map {
            None => LightKind::Point {
                position,
                intensity,
            },
            Some((_, map, rotation_deg)) => {
                let average = |[r, g, b]: [f32; 3]| [(r + g + b) / 3.0; 3];
                let map = if v4 { recolored(&map, average) } else { map };
                LightKind::Goniometric {
                    position,
                    intensity,
                    map: Arc::new(map),
                    rotation_deg,
                }
            }
        })
    }

    /// Reads a `distant` light.
    fn distant(&mut self, params: &Params, to_world: &DAffine3) -> Result<LightKind, SceneError> {
        let from = params.point("from", DVec3::ZERO)?;
        let to = params.point("to", DVec3::Z)?;
        let irradiance = self.color(params, "L")?;
        let illuminance = params.number("illuminance", -1.0)?;
        let by = if illuminance > 0.0 { illuminance } else { 1.0 };
        let direction = to_world.transform_vector3(to - from).as_vec3();
        if direction.try_normalize().is_none() {
            return Err(params.error("`from` and `to` must be different points"));
        }
        Ok(LightKind::Directional {
            direction,
            irradiance: Self::limited(params, irradiance, by)?,
        })
    }

    /// Reads a map of directions, of an environment or a light: the image, the map in the world and
    /// its rotation in degrees. `to_world` is the linear map of the space of its directions.
    fn map(
        &mut self,
        params: &Params,
        file: &str,
        to_world: &DMat3,
    ) -> Result<Option<(Arc<TextureDesc>, TextureDesc, f32)>, SceneError> {
        let mut context = TextureContext {
            spectra: self.spectra,
            notes: self.notes,
        };
        let Some(image) = self.textures.file(params, file, &mut context)? else {
            return Ok(None);
        };
        if to_world.determinant() == 0.0 {
            return Err(params.error("the transform is not invertible"));
        }
        let (map, rotation) = match self.spectra.version {
            Version::V3 => environment::from_equirectangular(&image, to_world),
            Version::V4 => {
                if image.width != image.height {
                    return Err(params.error(format!(
                        "the map has {}x{} pixels; version 4 needs a square of equal areas",
                        image.width, image.height
                    )));
                }
                self.notes.push(params.note(model_differences::EQUAL_AREA));
                (environment::from_equal_area(&image, to_world), 0.0)
            }
        };
        Ok(Some((image, map, rotation)))
    }

    /// Reads an `infinite` light; `None` if its image cannot be read and the policy allows it.
    fn infinite(
        &mut self,
        params: &Params,
        to_world: &DAffine3,
    ) -> Result<Option<EnvironmentDesc>, SceneError> {
        if params.get("portal").is_some() {
            self.notes
                .push(params.note("a `portal` is not supported; the whole environment is used"));
        }
        let color = self.color(params, "L")?;
        let illuminance = params.number("illuminance", -1.0)?;
        let name = match self.spectra.version {
            Version::V3 => params.text("mapname")?,
            Version::V4 => params.text("filename")?,
        };
        let Some(file) = name else {
            let by = if illuminance > 0.0 {
                illuminance / PI
            } else {
                1.0
            };
            let source = EnvironmentSource::Color(Self::limited(params, color, by)?);
            return Ok(Some(EnvironmentDesc::new(source)));
        };
        let Some((image, map, rotation_deg)) = self.map(params, file, &to_world.matrix3)? else {
            return Ok(None);
        };
        let by = if illuminance > 0.0 {
            illuminance / environment::upper_illuminance(&image).max(1e-30)
        } else {
            1.0
        };
        let scale = Self::limited(params, color, by)?;
        let grey = scale.max_element() == scale.min_element();
        let tint = |[r, g, b]: [f32; 3]| [r * scale.x, g * scale.y, b * scale.z];
        let map = if grey { map } else { recolored(&map, tint) };
        Ok(Some(EnvironmentDesc {
            rotation_deg,
            scale: if grey { scale.x } else { 1.0 },
            ..EnvironmentDesc::new(EnvironmentSource::Map(Arc::new(map)))
        }))
    }
}

/// Returns the power of an image that is projected with an intensity of 1, by luminance; `half` has
/// half its width and half its height at distance 1.
fn emitted(image: &TextureDesc, half: [f64; 2]) -> f64 {
    let [w, h] = [image.width, image.height];
    let at = |i: u32, n: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
    let area = 4.0 * half[0] * half[1] / (f64::from(w) * f64::from(h));
    let points = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
    let light = points.map(|(x, y)| {
        let p = DVec3::new(half[0] * at(x, w), half[1] * at(y, h), 1.0);
        f64::from(luminance_f32(texel(image, x, y))) * area / p.length().powi(3)
    });
    light.sum()
}

/// Returns a map with other linear colours.
fn recolored(map: &TextureDesc, color: impl Fn([f32; 3]) -> [f32; 3]) -> TextureDesc {
    let texel = |rgb| {
        let [r, g, b] = color(rgb);
        [r, g, b, 1.0]
    };
    let texels = match &map.texels {
        Texels::Rgba8(t) => t
            .iter()
            .map(|[r, g, b, _]| texel([*r, *g, *b].map(|c| Curve::Srgb.decode(c))))
            .collect(),
        Texels::RgbaF32(t) => t.iter().map(|[r, g, b, _]| texel([*r, *g, *b])).collect(),
    };
    TextureDesc::new(&map.file, map.width, map.height, Texels::RgbaF32(texels))
}

/// Returns the mean luminance of an image.
fn mean_luminance(image: &TextureDesc) -> f64 {
    let mean = mean_texel(image, true);
    f64::from(luminance_f32(mean.to_array())).max(1e-30)
}
