//! Cameras and film: view, lens, resolution and exposure.

use glam::{DAffine3, DVec3};

use super::params::Params;
use super::token::truncated;
use super::version::Version;
use crate::load::default_scene;
use crate::load::film::Film;
use lumbre_light::scene::desc::{CameraDesc, CameraKind, MAX_SIDE, Optics, VIEW_HEIGHT_RANGE};
use lumbre_light::scene::{Note, SceneError};

/// Width and height of a film without any.
const DEFAULT_FILM: [u32; 2] = [1280, 720];

/// Returns width and height of the picture of a camera in pixels: that of a spherical one is not
/// cropped.
pub(super) fn resolution(
    film: &Film,
    camera: &CameraDesc,
    notes: &mut Vec<Note>,
    at: Option<&Params>,
) -> [u32; 2] {
    let cropped = film.resolution();
    if camera.kind != CameraKind::Spherical || cropped == film.size {
        return cropped;
    }
    notes.extend(at.map(|film| {
        film.note("a crop of a spherical camera is not supported; the whole is rendered")
    }));
    film.size
}

/// Reads the size and the crop of a film.
pub(super) fn film(film: Option<&Params>) -> Result<Film, SceneError> {
    let mut size = DEFAULT_FILM;
    let Some(film) = film else {
        return Ok(Film::whole(size));
    };
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
    let pixels = crop(film, size)?;
    Ok(Film { size, pixels })
}

/// Reads the pixels of a film that are rendered: `pixelbounds`, or those of `cropwindow` in
/// fractions of the film, whose edges are rounded up.
fn crop(film: &Params, size: [u32; 2]) -> Result<[[u32; 2]; 2], SceneError> {
    let four = |name: &str| match film.numbers(name)? {
        None => Ok(None),
        Some([a, b, c, d]) => Ok(Some([*a, *b, *c, *d])),
        Some(_) => Err(film.error(format!("`{name}` needs four numbers"))),
    };
    let [width, height] = size.map(f64::from);
    let edges = match (four("pixelbounds")?, four("cropwindow")?) {
        (Some(edges), _) => edges,
        (None, Some([a, b, c, d])) => [a * width, b * width, c * height, d * height],
        (None, None) => [0.0, width, 0.0, height],
    };
    let pixel = |edge: f64, most: u32| edge.ceil().clamp(0.0, f64::from(most)) as u32;
    let [a, b, c, d] = edges;
    let pixels = [
        [pixel(a, size[0]), pixel(b, size[0])],
        [pixel(c, size[1]), pixel(d, size[1])],
    ];
    if pixels.iter().any(|[first, end]| first >= end) {
        return Err(film.error("the crop of the film has no pixel"));
    }
    Ok(pixels)
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

/// The part of the screen that a film shows.
struct Screen {
    /// Half of its height: of a perspective camera, half the height of the image at distance 1 over
    /// the tangent of half the field of view, since the smaller side of the image has the field of
    /// view; of an orthographic one, half the height in units of camera space.
    half_height: f64,
    /// Vector from the axis to its middle, in its own width and height, to the right and downwards.
    offset: [f64; 2],
}

/// Reads the screen of a film of this size.
fn screen(
    params: &Params,
    [width, height]: [u32; 2],
    notes: &mut Vec<Note>,
) -> Result<Screen, SceneError> {
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
    let (across, up) = (b - a, d - c);
    if (across / up / aspect - 1.0).abs() > 2e-3 {
        notes.push(params.note("pixels that are not square are not supported; the height is kept"));
    }
    Ok(Screen {
        half_height: 0.5 * up,
        offset: [0.5 * (a + b) / across, -0.5 * (c + d) / up],
    })
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
    film: &Film,
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
    let position = to_world.translation;
    let towards = |direction: DVec3| CameraDesc {
        up: up.as_vec3(),
        ..CameraDesc::default().placed(position, default_scene::target(position, direction))
    };
    let camera = match class {
        "perspective" => perspective(params, scale, film, towards(forward), notes)?,
        "orthographic" => orthographic(params, scale, film, towards(forward), notes)?,
        // The left edge of the picture is on the right of the camera, and forward is a quarter of
        // the width further: the middle is on the left.
        "spherical" => {
            note_mapping(params, notes)?;
            spherical(towards(-right))
        }
        "environment" => spherical(towards(-right)),
        other => {
            notes.push(params.note(format!(
                "the camera `{}` is not supported; a perspective one at its place, of 90 degrees, \
                 is used",
                truncated(other)
            )));
            CameraDesc {
                optics: Optics::pinhole(90.0),
                window: film.window([0.0; 2]),
                ..towards(forward)
            }
        }
    };
    if camera.position == camera.target {
        return Err(params.error("the position is too far from the origin for a view direction"));
    }
    if CLASSES.contains(&class) {
        params.note_unread(notes);
    }
    Ok(camera)
}

/// Classes of cameras that are read.
const CLASSES: [&str; 4] = ["perspective", "orthographic", "spherical", "environment"];

/// Completes a perspective camera by its field of view and its lens.
fn perspective(
    params: &Params,
    scale: f64,
    film: &Film,
    camera: CameraDesc,
    notes: &mut Vec<Note>,
) -> Result<CameraDesc, SceneError> {
    let fov = params.number("fov", 90.0)?;
    if !(fov > 0.0 && fov < 179.9) {
        return Err(params.error(format!(
            "`fov` must be between 0 and 180 degrees, found {fov}"
        )));
    }
    let screen = screen(params, film.size, notes)?;
    let half = (0.5 * fov.to_radians()).tan() * screen.half_height;
    let (radius, focus) = lens(params, scale)?;
    Ok(CameraDesc {
        window: film.window(screen.offset),
        optics: Optics::pinhole((2.0 * half.atan()).to_degrees() as f32)
            .with_aperture((2.0 * radius) as f32),
        focus_distance: (radius > 0.0).then_some(focus.min(1e12) as f32),
        ..camera
    })
}

/// Completes an orthographic camera by the height of its screen window.
fn orthographic(
    params: &Params,
    scale: f64,
    film: &Film,
    camera: CameraDesc,
    notes: &mut Vec<Note>,
) -> Result<CameraDesc, SceneError> {
    let (radius, _) = lens(params, scale)?;
    if radius > 0.0 {
        notes.push(params.note("the lens of an orthographic camera is not supported; ignored"));
    }
    let screen = screen(params, film.size, notes)?;
    let height = 2.0 * screen.half_height * scale;
    let [least, most] = VIEW_HEIGHT_RANGE;
    if !(least..=most).contains(&height) {
        return Err(params.error(format!(
            "the height of the screen must be between {least:e} and {most:e} units, found {height:e}"
        )));
    }
    Ok(CameraDesc {
        kind: CameraKind::Orthographic,
        view_height: height as f32,
        window: film.window(screen.offset),
        ..camera
    })
}

/// Makes a camera spherical: its picture has longitude and latitude.
fn spherical(camera: CameraDesc) -> CameraDesc {
    CameraDesc {
        kind: CameraKind::Spherical,
        ..camera
    }
}

/// Notes a spherical camera whose picture does not have longitude and latitude.
fn note_mapping(params: &Params, notes: &mut Vec<Note>) -> Result<(), SceneError> {
    match params.text("mapping")?.unwrap_or("equalarea") {
        "equirectangular" => {}
        mapping => notes.push(params.note(format!(
            "the mapping `{}` is not supported; longitude and latitude (`equirectangular`) are \
             used",
            truncated(mapping)
        ))),
    }
    Ok(())
}

/// Returns whether the picture of a camera of this class shows a mirrored scene if that of a
/// perspective one does not: the longitudes of spherical ones grow to the left.
pub(super) fn mirrors(class: &str) -> bool {
    matches!(class, "spherical" | "environment")
}
