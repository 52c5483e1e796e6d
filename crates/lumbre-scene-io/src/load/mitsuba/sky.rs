//! Sun and sky of Mitsuba: `sunsky` of version 3, and `sky`, `sun` and `sunsky` of version 0.6.
//!
//! - The sky is that of Hosek & Wilkie 2012 for RGB, as in the RGB variants of version 3 and in
//!   version 0.6 as it is distributed.
//! - The sun of version 3 is that of Hosek & Wilkie 2013, the one of version 0.6 that of Preetham
//!   et al. 1999. At turbidity 3 the latter is 15 % darker 35 degrees above the horizon, and 65 %
//!   darker at 8 degrees.
//! - In version 3 up is +z, south +x and west +y. In version 0.6 up is +y, east +x and north -z, as
//!   the program has it; its manual has north at +z.

#[cfg(test)]
mod tests;

use std::ops::RangeInclusive;
use std::rc::Rc;
use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};

use super::as_texture;
use super::texture::TextureReader;
use super::tree::XmlObject;
use crate::load::environment::texel;
use crate::load::sky::{
    DaySky, MIN_RADIUS, Moment, SUN_RADIUS, hosek_irradiance, preetham_irradiance,
};
use lumbre_light::scene::desc::{EnvironmentDesc, EnvironmentSource, TextureDesc};
use lumbre_light::scene::{Note, SceneError};

/// Parameters of place and time with their defaults and ranges.
const MOMENT: [(&str, f64, RangeInclusive<f64>); 9] = [
    ("latitude", 35.6894, -90.0..=90.0),
    ("longitude", 139.6917, -360.0..=360.0),
    ("timezone", 9.0, -24.0..=24.0),
    ("day", 10.0, 1.0..=31.0),
    ("month", 7.0, 1.0..=12.0),
    ("year", 2010.0, 1.0..=9999.0),
    ("hour", 15.0, -48.0..=48.0),
    ("minute", 0.0, -6000.0..=6000.0),
    ("second", 0.0, -1e6..=1e6),
];

/// Number of the parameters of [`MOMENT`] that version 0.6 refuses beside a direction of the sun.
const REFUSED_IN_0_6: usize = 4;

/// Reads a light of a day; `None`, with a note, if it is black.
pub(super) fn read(
    o: &Rc<XmlObject>,
    textures: &mut TextureReader,
    notes: &mut Vec<Note>,
) -> Result<Option<EnvironmentDesc>, SceneError> {
    let to_local = o.transform("to_world")?.matrix3.inverse();
    if !to_local.is_finite() {
        return Err(o.error("`to_world` is not invertible"));
    }
    if !keeps_angles(&to_local) {
        notes.push(o.note(
            "`to_world` distorts the sky; the sun has the irradiance that it has without it",
        ));
    }
    // The local frame of version 3 with its +z at +y.
    let upright = match o.legacy {
        true => DMat3::IDENTITY,
        false => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
    };
    let to_sky = upright * to_local;
    let turbidity = ranged(o, "turbidity", 3.0, 1.0..=10.0)?;
    let [sky_scale, sun_scale] = scales(o)?;
    let albedo = match o.plugin.as_str() {
        "sun" => Vec3::ZERO,
        _ => albedo(o, textures, notes)?,
    };
    let sun_radius = sun_radius(o, notes)?;
    let mut stretch = 1.0;
    let mut extend = false;
    if o.legacy {
        o.mark_read(&["resolution"]);
        stretch = ranged(o, "stretch", 1.0, 1.0..=2.0)?;
        extend = o.plugin != "sun" && o.flag("extend", false)?;
    } else if o.flag("complex_sun", false)? {
        notes.push(o.note(
            "`complex_sun` is not supported: the disk of the sun is uniform, with the same \
             irradiance within 0.3 %",
        ));
    }
    let sun = sun_direction(o, &upright, &to_sky)?;
    if sun.y < 0.0 && o.legacy {
        return Err(o.error("the sun is below the horizon; choose another time or direction"));
    }
    if sun.y < 0.0 || (sky_scale == 0.0 && sun_scale == 0.0) {
        notes.push(o.note(match sun.y < 0.0 {
            true => "the sun is below the horizon, where this light is black; ignored",
            false => "`sun_scale` and `sky_scale` are 0: the light is black; ignored",
        }));
        return Ok(None);
    }
    let zenith = sun.y.clamp(0.0, 1.0).acos();
    let irradiance = match o.legacy {
        true => preetham_irradiance(zenith, turbidity),
        false => hosek_irradiance(zenith, turbidity),
    };
    let day = DaySky {
        sun,
        turbidity,
        albedo,
        sky_scale,
        sun_irradiance: irradiance * sun_scale,
        sun_radius,
        stretch,
        extend,
    };
    let map = day.map(&to_sky).map_err(|e| o.error(e.to_string()))?;
    notes.push(o.note(format!(
        "the `{}` becomes an environment map of {} x {} texels, which blurs the horizon and the \
         edge of the sun",
        o.plugin, map.width, map.height
    )));
    let source = EnvironmentSource::Map(Arc::new(map));
    Ok(Some(EnvironmentDesc::new(source)))
}

/// Returns a number in a range.
fn ranged(
    o: &XmlObject,
    name: &str,
    default: f64,
    range: RangeInclusive<f64>,
) -> Result<f64, SceneError> {
    let x = o.number(name, default)?;
    if range.contains(&x) {
        return Ok(x);
    }
    let (least, greatest) = (range.start(), range.end());
    Err(o.error(format!(
        "`{name}` must be between {least} and {greatest}, found {x}"
    )))
}

/// Returns the factors on sky and sun.
fn scales(o: &XmlObject) -> Result<[f64; 2], SceneError> {
    let scale = |name: &str, default: f64| ranged(o, name, default, 0.0..=1e9);
    let both = if o.legacy { scale("scale", 1.0)? } else { 1.0 };
    Ok(match o.plugin.as_str() {
        "sky" => [both, 0.0],
        "sun" => [0.0, both],
        _ => [scale("sky_scale", both)?, scale("sun_scale", both)?],
    })
}

/// Returns the albedo of the ground; of a texture the mean, with a note.
fn albedo(
    o: &XmlObject,
    textures: &mut TextureReader,
    notes: &mut Vec<Note>,
) -> Result<Vec3, SceneError> {
    let mut albedo = Vec3::splat(if o.legacy { 0.2 } else { 0.3 });
    if let Some(t) = as_texture(o.property("albedo")) {
        if let Some(read) = textures.read(t, notes)? {
            notes.push(t.note("the albedo of the ground is the mean of this texture"));
            albedo = mean(&read.image);
        }
    } else if let Some(color) = o.color("albedo")? {
        albedo = color;
    }
    if albedo.min_element() < 0.0 || albedo.max_element() > 1.0 {
        return Err(o.error(format!("`albedo` must be between 0 and 1, found {albedo}")));
    }
    Ok(albedo)
}

/// Returns the mean of the linear colours of an image.
fn mean(image: &TextureDesc) -> Vec3 {
    let row = |y: u32| (0..image.width).map(move |x| Vec3::from(texel(image, x, y)));
    let rows = (0..image.height).map(|y| row(y).sum::<Vec3>() / image.width as f32);
    rows.sum::<Vec3>() / image.height as f32
}

/// Returns the angular radius of the disk of the sun in radians.
fn sun_radius(o: &XmlObject, notes: &mut Vec<Note>) -> Result<f64, SceneError> {
    let radius = match o.legacy {
        true if o.plugin == "sky" => SUN_RADIUS,
        true => SUN_RADIUS * ranged(o, "sun_radius_scale", 1.0, 0.0..=300.0)?,
        false => {
            let aperture = o.number("sun_aperture", 0.5358)?;
            if aperture <= 0.0 || aperture >= 180.0 {
                return Err(o.error(format!(
                    "`sun_aperture` must be above 0 and below 180 degrees, found {aperture}"
                )));
            }
            0.5 * aperture.to_radians()
        }
    };
    if radius < MIN_RADIUS {
        let least = 2.0 * MIN_RADIUS.to_degrees();
        notes.push(o.note(format!(
            "the sun is widened to {least} degrees, with the same irradiance"
        )));
    }
    Ok(radius.max(MIN_RADIUS))
}

/// Returns the unit vector towards the sun in the frame of the sky.
fn sun_direction(o: &XmlObject, upright: &DMat3, to_sky: &DMat3) -> Result<DVec3, SceneError> {
    if let Some(direction) = o.vector("sun_direction")? {
        let refused = if o.legacy {
            REFUSED_IN_0_6
        } else {
            MOMENT.len()
        };
        let mut beside = MOMENT[..refused].iter().map(|(name, ..)| name);
        if let Some(name) = beside.find(|name| o.property(name).is_some()) {
            return Err(o.error(format!("`sun_direction` cannot be given beside `{name}`")));
        }
        let direction = *to_sky * direction;
        return direction
            .try_normalize()
            .ok_or_else(|| o.error("a `sun_direction` must have a length above 0"));
    }
    let mut values = [0.0; MOMENT.len()];
    for (value, (name, default, range)) in values.iter_mut().zip(MOMENT) {
        *value = ranged(o, name, default, range)?;
    }
    let [
        latitude,
        longitude,
        timezone,
        day,
        month,
        year,
        hour,
        minute,
        second,
    ] = values;
    let moment = Moment {
        place: [latitude, longitude],
        timezone,
        date: [year, month, day].map(|x| x as i32),
        hours: hour + (minute + second / 60.0) / 60.0,
    };
    let [zenith, azimuth] = moment.sun();
    let ((sin, cos), (east, north)) = (zenith.sin_cos(), azimuth.sin_cos());
    Ok(match o.legacy {
        true => DVec3::new(east * sin, cos, -north * sin),
        false => *upright * DVec3::new(-north * sin, -east * sin, cos),
    })
}

/// Returns whether a map is a rotation, a reflection or a uniform scale.
fn keeps_angles(map: &DMat3) -> bool {
    let gram = map.transpose() * *map;
    let scale = gram.x_axis.x;
    (0..3).all(|i| (gram.col(i) - DMat3::IDENTITY.col(i) * scale).length() < 1e-4 * scale)
}
