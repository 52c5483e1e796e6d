//! Cameras and film: view, lens, resolution and exposure.

use glam::{DAffine3, DVec3};

use super::Version;
use super::params::Params;
use super::token::truncated;
use crate::scene::desc::{CameraDesc, MAX_SIDE, Optics};
use crate::scene::{Note, SceneError};

/// Width and height of a film without any.
const DEFAULT_FILM: [u32; 2] = [1280, 720];

/// Reads the resolution of a film.
pub(super) fn resolution(
    film: Option<&Params>,
    notes: &mut Vec<Note>,
) -> Result<[u32; 2], SceneError> {
    let Some(film) = film else {
        return Ok(DEFAULT_FILM);
    };
    let mut size = DEFAULT_FILM;
    for (n, key) in size.iter_mut().zip(["xresolution", "yresolution"]) {
        *n = film.integer(key, *n, MAX_SIDE)?;
        if *n == 0 {
            return Err(film.error(format!("`{key}` must be above 0")));
        }
    }
    film.mark_read(&[
        "filename",
        "diagonal",
        "savefp16",
        "maxcomponentvalue",
        "maxsampleluminance",
        "nbuckets",
        "lambdamin",
        "lambdamax",
    ]);
    let crops = ["cropwindow", "pixelbounds"];
    if crops.iter().any(|name| film.get(name).is_some()) {
        notes.push(film.note("a crop is not supported; the whole image is rendered"));
    }
    Ok(size)
}

/// Returns the factor of the film on all light: in version 4 exposure time times ISO over 100, in
/// version 3 `scale`.
pub(super) fn exposure(
    film: Option<&Params>,
    camera: Option<&Params>,
    version: Version,
    notes: &mut Vec<Note>,
) -> Result<f32, SceneError> {
    let number = |params: Option<&Params>, name: &str, default: f64| match params {
        Some(params) => params.number(name, default),
        None => Ok(default),
    };
    let open = number(camera, "shutteropen", 0.0)?;
    let close = number(camera, "shutterclose", 1.0)?;
    let factor = match version {
        Version::V3 => number(film, "scale", 1.0)?,
        Version::V4 => (close - open) * number(film, "iso", 100.0)? / 100.0,
    };
    if let Some(film) = film {
        if factor <= 0.0 || factor > 1e9 {
            return Err(film.error(format!(
                "the exposure must be above 0 and at most 1e9, found {factor}"
            )));
        }
        let sensor = film.text("sensor")?.unwrap_or("cie1931");
        if sensor != "cie1931" {
            notes.push(film.note(format!(
                "the sensor `{}` is not supported; the colours are those of the CIE observer",
                truncated(sensor)
            )));
        }
        if number(Some(film), "whitebalance", 0.0)? != 0.0 {
            notes.push(film.note("`whitebalance` is not supported; ignored"));
        }
    }
    Ok(factor as f32)
}

/// Returns half of the height of the image at distance 1 over the tangent of half the field of
/// view: the smaller side of the image has the field of view.
fn half_height(
    params: &Params,
    [width, height]: [u32; 2],
    notes: &mut Vec<Note>,
) -> Result<f64, SceneError> {
    let aspect = f64::from(width) / f64::from(height);
    let frame = params.number("frameaspectratio", aspect)?;
    if frame <= 0.0 {
        return Err(params.error(format!("`frameaspectratio` must be above 0, found {frame}")));
    }
    let window = match params.numbers("screenwindow")? {
        Some([a, b, c, d]) if b > a && d > c => [*a, *b, *c, *d],
        Some(_) => return Err(params.error("`screenwindow` needs four numbers in order")),
        None if frame > 1.0 => [-frame, frame, -1.0, 1.0],
        None => [-1.0, 1.0, -1.0 / frame, 1.0 / frame],
    };
    let [a, b, c, d] = window;
    let (across, up) = (0.5 * (b - a), 0.5 * (d - c));
    if (a + b).abs() > 1e-4 * across || (c + d).abs() > 1e-4 * up {
        notes.push(params.note("a `screenwindow` off the centre is not supported; it is centred"));
    }
    if (across / up / aspect - 1.0).abs() > 2e-3 {
        notes.push(params.note("pixels that are not square are not supported; the height is kept"));
    }
    Ok(up)
}

/// Reads radius and focus distance of a lens, in units of the world.
fn lens(params: &Params, scale: f64) -> Result<(f64, f64), SceneError> {
    let radius = params.number("lensradius", 0.0)? * scale;
    let focus = params.number("focaldistance", 1e6)? * scale;
    if (0.0..=1e6).contains(&radius) && focus > 0.0 {
        return Ok((radius, focus));
    }
    Err(params.error(format!(
        "a lens of radius {radius} with focus distance {focus} is invalid"
    )))
}

/// Reads a camera. `to_world` maps camera space, with x to the right, y up and z forward, to the
/// right-handed world.
pub(super) fn read(
    class: &str,
    params: &Params,
    to_world: &DAffine3,
    resolution: [u32; 2],
    notes: &mut Vec<Note>,
) -> Result<CameraDesc, SceneError> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| to_world.transform_vector3(axis));
    let unit = axes.map(DVec3::try_normalize);
    let [Some(right), Some(up), Some(forward)] = unit else {
        return Err(params.error("the transform of the camera is not invertible"));
    };
    let skew = right.dot(up).abs() + up.dot(forward).abs() + forward.dot(right).abs();
    let scale = axes[2].length();
    if skew > 1e-3 || axes.iter().any(|a| (a.length() / scale - 1.0).abs() > 1e-3) {
        notes.push(
            params.note("a transform of the camera that stretches is not supported; ignored"),
        );
    }
    let supported = class == "perspective";
    if !supported {
        notes.push(params.note(format!(
            "the camera `{}` is not supported; a perspective one at its place, of 90 degrees, is \
            used",
            truncated(class)
        )));
    }
    let fov = if supported {
        params.number("fov", 90.0)?
    } else {
        90.0
    };
    if !(fov > 0.0 && fov < 179.9) {
        return Err(params.error(format!(
            "`fov` must be between 0 and 180 degrees, found {fov}"
        )));
    }
    let up_extent = if supported {
        half_height(params, resolution, notes)?
    } else {
        1.0
    };
    let half = (0.5 * fov.to_radians()).tan() * up_extent;
    let (radius, focus) = lens(params, scale)?;
    let position = to_world.translation;
    let camera = CameraDesc {
        position: position.as_vec3(),
        target: (position + forward).as_vec3(),
        up: up.as_vec3(),
        fov_deg: (2.0 * half.atan()).to_degrees() as f32,
        aperture: (2.0 * radius) as f32,
        focus_distance: (radius > 0.0).then_some(focus.min(1e12) as f32),
        optics: Optics::default(),
    };
    if camera.position == camera.target {
        return Err(params.error("the position is too far from the origin for a view direction"));
    }
    if supported {
        params.note_unread(notes);
    }
    Ok(camera)
}
