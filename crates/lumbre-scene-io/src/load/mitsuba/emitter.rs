//! Lights of Mitsuba scenes: `area` on shapes, `constant`, `envmap`, `sunsky`, `point`, `spot` and
//! `directional`; of version 0.6 also `sky` and `sun`.

use std::f64::consts::{PI, TAU};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};

use super::sky;
use super::texture::{self, TextureReader};
use super::tree::XmlObject;
use super::{as_texture, sensor};
use crate::load::environment::{FINE_ROWS, MAX_HEIGHT, MIN_HEIGHT, bilinear, resampled, texel};
use lumbre_light::scene::desc::{
    ConeDesc, ConeEdge, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind, MaterialDesc,
    SpotImage, Texels, TextureDesc, TextureSlot, Wrap,
};
use lumbre_light::scene::{Note, SceneError};

/// A light without a shape.
pub(super) enum SceneLight {
    /// Light that surrounds the scene.
    Environment(EnvironmentDesc),
    /// A point, spot or directional light, still without a name.
    Light(LightDesc),
}

/// Sets the emission of a material to that of an area light.
pub(super) fn set_emission(
    material: &mut MaterialDesc,
    o: &Rc<XmlObject>,
    textures: &mut TextureReader,
    notes: &mut Vec<Note>,
) -> Result<(), SceneError> {
    o.mark_read(&["sampling_weight"]);
    if let Some(t) = as_texture(o.property("radiance")) {
        if let Some(read) = textures.read(t, notes)? {
            if let Err(e) = read.apply_relative(material, TextureSlot::Emission) {
                notes.push(t.note(e.to_string()));
            }
            material.emission = Vec3::ONE;
        }
        return Ok(());
    }
    material.emission = radiometric_color(o, "radiance")?;
    if material.emission == Vec3::ZERO {
        notes.push(o.note("the area light is black and emits nothing"));
    }
    Ok(())
}

/// Reads a radiance, intensity or irradiance, which must not be negative.
fn radiometric_color(o: &XmlObject, key: &str) -> Result<Vec3, SceneError> {
    let color = o.color(key)?.unwrap_or(Vec3::ONE);
    if color.min_element() < 0.0 || color.max_element() > 1e9 {
        return Err(o.error(format!("`{key}` must be between 0 and 1e9, found {color}")));
    }
    Ok(color)
}

/// Reads a light of the scene; `None`, with a note, if it is not supported.
pub(super) fn read(
    o: &Rc<XmlObject>,
    textures: &mut TextureReader,
    notes: &mut Vec<Note>,
) -> Result<Option<SceneLight>, SceneError> {
    o.mark_read(&["sampling_weight"]);
    match o.plugin.as_str() {
        "constant" => {
            let source = EnvironmentSource::Color(radiometric_color(o, "radiance")?);
            Ok(Some(SceneLight::Environment(EnvironmentDesc::new(source))))
        }
        "envmap" => environment_map(o, textures, notes),
        "sunsky" => Ok(sky::read(o, textures, notes)?.map(SceneLight::Environment)),
        "sky" | "sun" if o.legacy => {
            Ok(sky::read(o, textures, notes)?.map(SceneLight::Environment))
        }
        "point" => {
            let position = match o.vector("position")? {
                Some(position) => position,
                None => o.transform("to_world")?.translation,
            };
            let kind = LightKind::Point {
                position: position.as_vec3(),
                intensity: radiometric_color(o, "intensity")?,
            };
            Ok(Some(placed(kind, position)))
        }
        "spot" => {
            let kind = spot(o, textures, notes)?;
            Ok(Some(placed(kind, o.transform("to_world")?.translation)))
        }
        "projector" => {
            let Some(kind) = projector(o, textures, notes)? else {
                return Ok(None);
            };
            Ok(Some(placed(kind, o.transform("to_world")?.translation)))
        }
        "directional" => {
            let direction = match o.vector("direction")? {
                Some(direction) => direction,
                None => o.transform("to_world")?.transform_vector3(DVec3::Z),
            };
            let direction = direction.as_vec3();
            if direction.try_normalize().is_none() {
                return Err(o.error("a `direction` must have a length above 0"));
            }
            let kind = LightKind::Directional {
                direction,
                irradiance: radiometric_color(o, "irradiance")?,
            };
            Ok(Some(placed(kind, DVec3::ZERO)))
        }
        other => {
            let shown = super::values::truncated(other);
            notes.push(o.note(format!("the light `{shown}` is not supported; ignored")));
            o.mark_all_read();
            Ok(None)
        }
    }
}

/// Returns a light without a name at a position.
fn placed(kind: LightKind, position: DVec3) -> SceneLight {
    SceneLight::Light(LightDesc::placed("", kind, position))
}

/// Reads an environment map; `None` if its image cannot be read and the policy allows it.
fn environment_map(
    o: &XmlObject,
    textures: &mut TextureReader,
    notes: &mut Vec<Note>,
) -> Result<Option<SceneLight>, SceneError> {
    let Some(file) = o.text("filename")? else {
        return Err(o.error("an `envmap` needs a `filename`"));
    };
    let scale = o.number("scale", 1.0)?;
    if !(0.0..=1e9).contains(&scale) {
        return Err(o.error(format!("`scale` must be between 0 and 1e9, found {scale}")));
    }
    let decoding = texture::decoding(o)?;
    let Some(mut map) = textures.image(o, file, decoding, notes)? else {
        return Ok(None);
    };
    let to_world = o.transform("to_world")?.matrix3;
    let mut rotation_deg = 0.0;
    if let Some(angle) = rotation_about_y(&to_world) {
        rotation_deg = angle.to_degrees() as f32;
        if map.height < FINE_ROWS {
            map = Arc::new(in_axes_of_scene(&map, &DMat3::IDENTITY));
            notes.push(o.note(
                "the first and the last row of an environment map are at the poles in Mitsuba, and half \
                 a texel from them here: from this coarse one a finer one is computed",
            ));
        }
    } else {
        let to_map = to_world.inverse();
        if !to_map.is_finite() {
            return Err(o.error("`to_world` is not invertible"));
        }
        map = Arc::new(in_axes_of_scene(&map, &to_map));
        notes.push(o.note(
            "the environment map is tilted; a finer one in the axes of the scene is computed: a \
             difference of up to 0.5 %",
        ));
    }
    Ok(Some(SceneLight::Environment(EnvironmentDesc {
        rotation_deg,
        scale: scale as f32,
        ..EnvironmentDesc::new(EnvironmentSource::Map(map))
    })))
}

/// Returns a map in the axes of the scene, of twice the resolution if it is not too large.
fn in_axes_of_scene(map: &TextureDesc, to_map: &DMat3) -> TextureDesc {
    let finer = 2 * map.height <= MAX_HEIGHT;
    let height = if finer {
        (2 * map.height).max(MIN_HEIGHT)
    } else {
        MAX_HEIGHT
    };
    // A wide map of few rows keeps its columns.
    let width = map.width.clamp(2 * height, 2 * MAX_HEIGHT);
    let samples = if finer && map.width <= width {
        1
    } else {
        map.height.div_ceil(height).max(map.width.div_ceil(width)) + 1
    };
    resampled(map, [width, height], samples, to_map, in_direction)
}

/// Returns the colour of a map in a direction of its space. Its first and its last row are at the
/// poles.
fn in_direction(map: &TextureDesc, d: DVec3) -> [f32; 3] {
    let x = d.x.atan2(-d.z) / TAU * f64::from(map.width) - 0.5;
    let y = d.y.clamp(-1.0, 1.0).acos() / PI * f64::from(map.height - 1);
    bilinear(map, x, y)
}

/// Reads the image that is the texture of a light; `None`, with a note, if it is not supported.
fn light_image(
    t: &Rc<XmlObject>,
    textures: &mut TextureReader,
    notes: &mut Vec<Note>,
) -> Result<Option<Arc<TextureDesc>>, SceneError> {
    let Some(read) = textures.read(t, notes)? else {
        return Ok(None);
    };
    if !read.is_plain() {
        notes.push(t.note(
            "the image of a light is interpolated and covers it once; `to_uv` and other filters are \
             ignored",
        ));
    }
    let finer = wrapped_finer(&read.image, read.wrap).map(Arc::new);
    Ok(Some(finer.unwrap_or(read.image)))
}

/// Least side of the image of a light: coarser ones are computed anew, since Mitsuba interpolates half
/// a texel at the edges across them.
const FINE_SIDE: u32 = 256;

/// Greatest number of texels of an image that is computed anew.
const MAX_TEXELS: u32 = 1 << 22;

/// Returns a finer image of a coarse one, interpolated by its wrap modes; `None` for others.
fn wrapped_finer(image: &TextureDesc, wrap: [Wrap; 2]) -> Option<TextureDesc> {
    let room = (MAX_TEXELS / image.width.checked_mul(image.height)?).isqrt();
    let by = FINE_SIDE.div_ceil(image.width.min(image.height)).min(room);
    if by < 2 || !wrap.contains(&Wrap::Repeat) {
        return None;
    }
    // The two texels around a place and the weight of the second.
    let around = |x: u32, count: u32, wrap: Wrap| {
        let at = (f64::from(x) + 0.5) / f64::from(by) - 0.5;
        let last = i64::from(count) - 1;
        let texels = [0, 1].map(|i| {
            let texel = at.floor() as i64 + i;
            let inside = match wrap {
                Wrap::Repeat => texel.rem_euclid(last + 1),
                Wrap::Mirror | Wrap::Clamp => texel.clamp(0, last),
            };
            inside as u32
        });
        (texels, (at - at.floor()) as f32)
    };
    let (width, height) = (by * image.width, by * image.height);
    let mut texels = Vec::with_capacity((width * height) as usize);
    for y in 0..height {
        let (rows, fy) = around(y, image.height, wrap[1]);
        for x in 0..width {
            let (columns, fx) = around(x, image.width, wrap[0]);
            let row = |y: u32| {
                let [a, b] = columns.map(|x| Vec3::from_array(texel(image, x, y)));
                a.lerp(b, fx)
            };
            let [upper, lower] = rows.map(row);
            texels.push(upper.lerp(lower, fy).extend(1.0).to_array());
        }
    }
    Some(TextureDesc::new(
        &image.file,
        width,
        height,
        Texels::RgbaF32(texels),
    ))
}

/// Reads a projector, whose image is an irradiance at distance 1; `None`, with a note, if its
/// texture is not supported.
fn projector(
    o: &Rc<XmlObject>,
    textures: &mut TextureReader,
    notes: &mut Vec<Note>,
) -> Result<Option<LightKind>, SceneError> {
    let map = o.transform("to_world")?;
    let scale = o.number("scale", 1.0)?;
    if !(0.0..=1e9).contains(&scale) {
        return Err(o.error(format!("`scale` must be between 0 and 1e9, found {scale}")));
    }
    let texture = match as_texture(o.property("irradiance")) {
        Some(t) => match light_image(t, textures, notes)? {
            Some(image) => image,
            None => return Ok(None),
        },
        None => {
            let [r, g, b] = radiometric_color(o, "irradiance")?.to_array();
            let texels = Texels::RgbaF32(vec![[r, g, b, 1.0]]);
            Arc::new(TextureDesc::new("", 1, 1, texels))
        }
    };
    let size = [texture.width, texture.height];
    let half = (f64::from(sensor::fov(o, size)?).to_radians() / 2.0).tan();
    // A scale of the transform moves the image away and makes it larger.
    let along = map.transform_vector3(DVec3::Z).length();
    let side = |v: DVec3| (map.transform_vector3(v) / along).as_vec3();
    let image = SpotImage {
        // Its space is that of a camera, with +x to the left.
        right: side(DVec3::NEG_X * (half * f64::from(size[0]) / f64::from(size[1]))),
        up: side(DVec3::Y * half),
        even: true,
        texture,
    };
    let direction = side(DVec3::Z);
    if direction.try_normalize().is_none() {
        return Err(o.error("`to_world` is not invertible"));
    }
    Ok(Some(LightKind::Spot {
        position: map.translation.as_vec3(),
        direction,
        // Mitsuba multiplies by pi, as if the irradiance were a radiance.
        intensity: Vec3::splat((PI * scale) as f32),
        cone: image.cone(),
        image: Some(image),
    }))
}

/// Reads a spot light.
fn spot(
    o: &Rc<XmlObject>,
    textures: &mut TextureReader,
    notes: &mut Vec<Note>,
) -> Result<LightKind, SceneError> {
    let map = o.transform("to_world")?;
    let cutoff = o.number("cutoff_angle", 20.0)?;
    let beam = o.number("beam_width", 0.75 * cutoff)?;
    let cone = ConeDesc {
        beam_deg: beam as f32,
        cutoff_deg: cutoff as f32,
        edge: ConeEdge::Linear,
    };
    let direction = map.transform_vector3(DVec3::Z).as_vec3();
    if !cone.is_possible() || direction.try_normalize().is_none() {
        return Err(o.error(format!(
            "a beam of {beam} and a cutoff of {cutoff} degrees form no cone; expected 0 <= beam <= \
             cutoff < 180 and an invertible `to_world`"
        )));
    }
    let texture = match as_texture(o.property("texture")) {
        Some(t) => light_image(t, textures, notes)?,
        None => None,
    };
    let image = texture.map(|texture| {
        // The image is turned by half a turn about the axis, and as wide as the cone.
        let half = cutoff.min(89.9).to_radians().tan();
        let side = |v: DVec3| map.transform_vector3(v).normalize_or(v).as_vec3();
        SpotImage {
            right: side(DVec3::X) * half as f32,
            up: side(DVec3::NEG_Y) * half as f32,
            even: false,
            texture,
        }
    });
    Ok(LightKind::Spot {
        position: map.translation.as_vec3(),
        direction,
        intensity: radiometric_color(o, "intensity")?,
        cone,
        image,
    })
}

/// Returns the angle of a rotation about +y in radians; `None` for other maps.
fn rotation_about_y(map: &DMat3) -> Option<f64> {
    let angle = map.z_axis.x.atan2(map.z_axis.z);
    let upright = DMat3::from_rotation_y(angle);
    let straight = (0..3).all(|i| (upright.col(i) - map.col(i)).length() < 1e-4);
    straight.then_some(angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::with_rows_at_poles;
    use lumbre_light::scene::desc::Texels;

    #[test]
    fn single_texels_of_wide_maps_of_few_rows_keep_their_light() {
        for column in 1000..1004 {
            let mut texels = vec![[0.0, 0.0, 0.0, 1.0]; 2048 * 16];
            texels[2048 * 8 + column] = [1.0; 4];
            let map = TextureDesc::new("map", 2048, 16, Texels::RgbaF32(texels));
            for finer in [
                in_axes_of_scene(&map, &DMat3::IDENTITY),
                with_rows_at_poles(&map),
            ] {
                let Texels::RgbaF32(t) = &finer.texels else {
                    panic!("floats expected")
                };
                let sum: f32 = t.iter().map(|t| t[0]).sum();
                // A texel becomes as many as its row: all columns stay.
                let expected = finer.height as f32 / 16.0;
                assert!(
                    (sum / expected - 1.0).abs() < 0.1,
                    "{column}: {sum}, not {expected}"
                );
            }
        }
    }

    #[test]
    fn a_coarse_map_for_mitsuba_has_the_same_light() {
        let rows = [1.0f32, 8.0, 2.0].map(|x| [[x, 1.0, 0.0, 1.0], [0.0, x, 1.0, 1.0]]);
        let map = TextureDesc::new("map", 2, 3, Texels::RgbaF32(rows.concat()));
        let finer = with_rows_at_poles(&map);
        for (x, y) in [
            (0.3, 0.0),
            (-0.2, 0.6),
            (0.0, 1.0),
            (0.1, -0.95),
            (-0.7, -0.3),
        ] {
            let z = (1.0f64 - x * x - y * y).max(0.0).sqrt();
            let d = DVec3::new(x, y, z);
            let column = d.x.atan2(-d.z) / TAU * 2.0 - 0.5;
            let here = bilinear(&map, column, y.acos() / PI * 3.0 - 0.5);
            let there = in_direction(&finer, d);
            for (a, b) in here.into_iter().zip(there) {
                assert!((a - b).abs() < 0.02, "{d}: {here:?}, not {there:?}");
            }
        }
    }

    #[test]
    fn coarse_images_of_lights_are_interpolated_across_their_edges() {
        let texels = [0.0f32, 1.0].map(|x| [x, x, x, 1.0]);
        let image = TextureDesc::new("image", 2, 1, Texels::RgbaF32(texels.to_vec()));
        let finer = wrapped_finer(&image, [Wrap::Repeat; 2]).unwrap();
        let at = |u: f32| {
            let x = (u * finer.width as f32) as u32;
            texel(&finer, x, 0)[0]
        };
        for (u, expected) in [
            (0.0, 0.5),
            (0.25, 0.0),
            (0.5, 0.5),
            (0.75, 1.0),
            (0.999, 0.5),
        ] {
            assert!((at(u) - expected).abs() < 0.01, "{u}: {}", at(u));
        }
        assert_eq!(wrapped_finer(&image, [Wrap::Clamp; 2]), None);
    }

    #[test]
    fn the_first_and_the_last_row_of_an_environment_map_are_at_the_poles() {
        let rows = [1.0f32, 2.0, 8.0].map(|x| [[x, x, x, 1.0]; 4]);
        let map = TextureDesc::new("map", 4, 3, Texels::RgbaF32(rows.concat()));
        let slope = (PI / 4.0).cos();
        for (y, expected) in [
            (1.0, 1.0),
            (slope, 1.5),
            (0.0, 2.0),
            (-slope, 5.0),
            (-1.0, 8.0),
        ] {
            let across = (1.0 - y * y).max(0.0f64).sqrt();
            let [red, ..] = in_direction(&map, DVec3::new(across, y, 0.0));
            assert!((red - expected).abs() < 1e-5, "{y}: {red}, not {expected}");
        }
    }
}
