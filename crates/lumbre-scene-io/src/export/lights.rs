//! Export of lights without a surface, and of the environment.

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

use super::texture::TexelConversion;
use super::{SceneWriter, identifier};
use crate::load::{FINE_ROWS, environment_square, mean_texel, with_rows_at_poles};
use lumbre_light::scene::desc::{
    ConeDesc, ConeEdge, EnvironmentSource, LightKind, SpotImage, TextureDesc, Wrap,
};
use lumbre_light::scene::{Note, SceneError};

/// Returns the mean of a map over all directions.
fn mean_of_directions(map: &TextureDesc) -> Vec3 {
    mean_texel(&environment_square(map, 0.0), true)
}

/// Returns the axes of the image of a spot light: right, up and forward, of unit length.
pub(super) fn image_axes(image: &SpotImage, direction: Vec3) -> DMat3 {
    let [right, up, forward] = [image.right, image.up, direction].map(|v| v.as_dvec3().normalize());
    DMat3::from_cols(right, up, forward)
}

/// Returns whether a spot light shows its image as a projector does: with square pixels, across the
/// axis, and with a cone that dims no part of it.
pub(super) fn is_whole(image: &SpotImage, direction: Vec3, cone: &ConeDesc) -> bool {
    let axes = image_axes(image, direction);
    let skew = (axes.transpose() * axes - DMat3::IDENTITY).abs();
    let shape = f64::from(image.texture.height) / f64::from(image.texture.width);
    let sides = f64::from(image.up.length()) / f64::from(image.right.length());
    skew.to_cols_array().iter().all(|x| *x < 1e-4)
        && (sides / shape - 1.0).abs() < 1e-3
        && cone.beam_deg >= 0.999 * image.cone().cutoff_deg
}

impl SceneWriter<'_> {
    /// Writes the lights without a surface.
    pub(super) fn lights(&mut self) -> Result<(), SceneError> {
        for light in &self.desc.lights {
            let id = self.ids.allocate(&identifier(&light.name));
            let xml = &mut self.xml;
            match light.kind {
                LightKind::Point {
                    position,
                    intensity,
                } => {
                    xml.open("emitter", &[("type", "point"), ("id", &id)]);
                    xml.vector("point", "position", position);
                    xml.rgb("intensity", intensity);
                }
                LightKind::Spot {
                    position,
                    direction,
                    intensity,
                    cone,
                    image: Some(ref image),
                } if image.even && is_whole(image, direction, &cone) => {
                    let conversion = TexelConversion::Light(intensity);
                    let file = self
                        .textures
                        .file(&image.texture, conversion, &mut self.folder)?;
                    // Its space has +x to the left.
                    let axes = image_axes(image, direction);
                    let axes = DMat3::from_cols(-axes.x_axis, axes.y_axis, axes.z_axis);
                    xml.open("emitter", &[("type", "projector"), ("id", &id)]);
                    let map = DAffine3::from_mat3_translation(axes, position.as_dvec3());
                    xml.transform("to_world", &map);
                    xml.value("float", "scale", std::f32::consts::FRAC_1_PI);
                    let angle = 2.0 * image.right.length().atan().to_degrees();
                    xml.value("float", "fov", angle);
                    xml.open("texture", &[("type", "bitmap"), ("name", "irradiance")]);
                    xml.value("string", "filename", &file);
                    xml.value("string", "wrap_mode", Wrap::Clamp.name());
                    xml.close();
                }
                LightKind::Spot {
                    position,
                    direction,
                    intensity,
                    cone,
                    ref image,
                } => {
                    if image.is_some() {
                        let place = format!("lights.{}", light.name);
                        let text = "an image whose intensity is not that of a projector, or with a \
                                    falloff, has no counterpart in Mitsuba; it is left out";
                        self.notes.push(Note::new("", &place, text));
                    }
                    xml.open("emitter", &[("type", "spot"), ("id", &id)]);
                    let axis = direction.normalize_or(Vec3::Z);
                    let matrix = DMat3::from_quat(DQuat::from_rotation_arc(
                        DVec3::Z,
                        axis.as_dvec3().normalize_or(DVec3::Z),
                    ));
                    xml.transform(
                        "to_world",
                        &DAffine3::from_mat3_translation(matrix, position.as_dvec3()),
                    );
                    xml.rgb("intensity", intensity);
                    xml.value("float", "cutoff_angle", cone.cutoff_deg);
                    xml.value("float", "beam_width", cone.beam_deg);
                    if cone.edge == ConeEdge::Smooth {
                        let place = format!("lights.{}", light.name);
                        self.notes.push(Note::new(
                            "",
                            &place,
                            "the falloff of the cone is linear in the angle in Mitsuba",
                        ));
                    }
                }
                LightKind::Goniometric {
                    position,
                    intensity,
                    ref map,
                    ..
                } => {
                    xml.open("emitter", &[("type", "point"), ("id", &id)]);
                    xml.vector("point", "position", position);
                    xml.rgb("intensity", intensity * mean_of_directions(map));
                    let place = format!("lights.{}", light.name);
                    let message = "Mitsuba has no goniometric light; a point light of the same \
                                   power is written";
                    self.notes.push(Note::new("", &place, message));
                }
                LightKind::Directional {
                    direction,
                    irradiance,
                } => {
                    xml.open("emitter", &[("type", "directional"), ("id", &id)]);
                    xml.vector("vector", "direction", direction);
                    xml.rgb("irradiance", irradiance);
                }
            }
            xml.close();
        }
        Ok(())
    }

    /// Writes the environment.
    pub(super) fn environment(&mut self) -> Result<(), SceneError> {
        let Some(environment) = &self.desc.environment else {
            return Ok(());
        };
        match &environment.source {
            EnvironmentSource::Color(color) => {
                self.xml.open("emitter", &[("type", "constant")]);
                self.xml.rgb("radiance", *color * environment.scale);
            }
            EnvironmentSource::Map(map) => {
                let finer = (map.height < FINE_ROWS).then(|| with_rows_at_poles(map));
                let map = finer.as_ref().unwrap_or(map);
                let file = self.textures.environment_map(map, &mut self.folder)?;
                self.xml.open("emitter", &[("type", "envmap")]);
                self.xml.value("string", "filename", &file);
                self.xml.value("float", "scale", environment.scale);
                if environment.rotation_deg != 0.0 {
                    let angle = environment.rotation_deg.to_string();
                    self.xml.open("transform", &[("name", "to_world")]);
                    self.xml.leaf("rotate", &[("y", "1"), ("angle", &angle)]);
                    self.xml.close();
                }
            }
        }
        self.xml.close();
        Ok(())
    }
}
