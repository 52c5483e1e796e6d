//! Cameras of Mitsuba scenes: `perspective`, `thinlens` and `orthographic`, with the size of their
//! film.

use glam::{DAffine3, DVec3};

use super::DEFAULT_FILM;
use super::tree::XmlObject;
use crate::load::default_scene;
use crate::load::film::Film;
use lumbre_light::scene::desc::{CameraDesc, CameraKind, EntityDesc, MAX_SIDE, VIEW_HEIGHT_RANGE};
use lumbre_light::scene::{Note, SceneError};

/// Focal length of cameras that have neither one nor a field of view.
const DEFAULT_FOCAL_LENGTH: &str = "50mm";

/// Distance beyond which nothing is shown, of cameras that state none.
const DEFAULT_FAR_CLIP: f64 = 1e4;

/// Width and height in millimetres of the film to which `focal_length` refers.
const FILM_35MM: [f64; 2] = [36.0, 24.0];

/// Reads a camera and the resolution of its film. `entities` are what it may see.
pub(super) fn read(
    o: &XmlObject,
    entities: &[EntityDesc],
    notes: &mut Vec<Note>,
) -> Result<(CameraDesc, [u32; 2]), SceneError> {
    let (kind, thin) = match o.plugin.as_str() {
        "perspective" => (CameraKind::Perspective, false),
        "thinlens" => (CameraKind::Perspective, true),
        "orthographic" => (CameraKind::Orthographic, false),
        other => {
            return Err(o.error(format!(
                "the sensor `{}` is not supported; expected `perspective`, `thinlens` or \
                 `orthographic`",
                super::values::truncated(other)
            )));
        }
    };
    let film = match o.children("film").next() {
        None => Film::whole(DEFAULT_FILM),
        Some(film) => self::film(film)?,
    };
    let map = o.transform("to_world")?;
    let position = map.translation;
    let axis = |v: DVec3| map.transform_vector3(v).try_normalize();
    let (Some(forward), Some(up)) = (axis(DVec3::Z), axis(DVec3::Y)) else {
        return Err(o.error("`to_world` is not invertible"));
    };
    let mut camera = CameraDesc {
        kind,
        up: up.as_vec3(),
        ..CameraDesc::default().placed(position, default_scene::target(position, forward))
    };
    camera.window = film.window(principal_point_offset(o, kind, thin)?);
    if let Some(problem) = camera.window.problem() {
        return Err(o.error(problem));
    }
    if map.matrix3.determinant() < 0.0 {
        camera.window = camera.window.mirrored();
    }
    if kind == CameraKind::Orthographic {
        camera.view_height = view_height(o, &map, film.size, notes)?;
    } else {
        camera.optics = camera.optics.with_fov_deg(fov(o, film.size)?);
    }
    if camera.position == camera.target {
        return Err(o.error("the position is too far from the origin for a view direction"));
    }
    o.mark_read(&["near_clip", "shutter_open", "shutter_close"]);
    o.children("sampler")
        .for_each(|s| s.mark_read(&["sample_count", "seed", "scramble", "jitter"]));
    if thin {
        lens(o, &mut camera)?;
    } else {
        o.mark_read(&["focus_distance"]);
    }
    note_clipping(o, &camera, entities, notes)?;
    Ok((camera, film.resolution()))
}

/// Returns the offset of the principal point in sizes of the film, which thin lenses and parallel
/// rays lack.
fn principal_point_offset(
    o: &XmlObject,
    kind: CameraKind,
    thin: bool,
) -> Result<[f64; 2], SceneError> {
    if kind != CameraKind::Perspective || thin {
        return Ok([0.0; 2]);
    }
    Ok([
        o.number("principal_point_offset_x", 0.0)?,
        o.number("principal_point_offset_y", 0.0)?,
    ])
}

/// Notes that Mitsuba cuts off what lies beyond `far_clip`, if anything may. Its camera rays end
/// there, along the viewing direction; those of this program do not.
fn note_clipping(
    o: &XmlObject,
    camera: &CameraDesc,
    entities: &[EntityDesc],
    notes: &mut Vec<Note>,
) -> Result<(), SceneError> {
    let far = o.number("far_clip", DEFAULT_FAR_CLIP)?;
    let Some(bounds) = default_scene::bounds(entities) else {
        return Ok(());
    };
    let forward = (camera.target - camera.position).normalize_or_zero();
    let reach = default_scene::corners(bounds)
        .map(|corner| (corner - camera.position).dot(forward))
        .fold(0.0, f32::max);
    if f64::from(reach) > far {
        notes.push(o.note(format!(
            "Mitsuba shows nothing that is more than {far} units away (`far_clip`), which is not \
             supported; the scene reaches {reach:.0} units"
        )));
    }
    Ok(())
}

/// Returns the height of the picture of an orthographic camera in scene units. Its width is that of
/// the interval from -1 to 1 of the camera's own x axis.
fn view_height(
    o: &XmlObject,
    map: &DAffine3,
    [width, height]: [u32; 2],
    notes: &mut Vec<Note>,
) -> Result<f32, SceneError> {
    let [x, y] = [DVec3::X, DVec3::Y].map(|axis| map.transform_vector3(axis).length());
    if (x / y - 1.0).abs() > 2e-3 {
        notes.push(o.note(
            "`to_world` scales x and y by different factors; pixels that are not square are not \
             supported; the height is kept",
        ));
    }
    let extent = 2.0 * y * f64::from(height) / f64::from(width);
    let [least, most] = VIEW_HEIGHT_RANGE;
    if !(least..=most).contains(&extent) {
        return Err(o.error(format!(
            "the height of the picture must be between {least:e} and {most:e} units, found \
             {extent:e}"
        )));
    }
    Ok(extent as f32)
}

/// Reads the aperture and the focus distance of a thin lens.
fn lens(o: &XmlObject, camera: &mut CameraDesc) -> Result<(), SceneError> {
    let radius = o.number("aperture_radius", 1.0)?;
    let focus = o.number("focus_distance", 1e6)?;
    let valid = (0.0..=1e6).contains(&radius) && focus > 0.0 && focus <= 1e12;
    if !valid {
        return Err(o.error(format!(
            "a lens of radius {radius} with focus distance {focus} is invalid; expected a radius \
             of 0 or more and a positive distance"
        )));
    }
    camera.optics = camera.optics.with_aperture((2.0 * radius) as f32);
    camera.focus_distance = Some(focus as f32);
    Ok(())
}

/// Reads the size and the crop of a film.
fn film(film: &XmlObject) -> Result<Film, SceneError> {
    // Everything else about the film is set by the script.
    film.mark_read(&[
        "file_format",
        "pixel_format",
        "component_format",
        "gamma",
        "banner",
        "high_quality_edges",
    ]);
    film.children("rfilter")
        .for_each(|f| f.mark_read(&["radius", "stddev"]));
    let [width, height] = DEFAULT_FILM;
    let size = [
        pixels(film, "width", 1, width)?,
        pixels(film, "height", 1, height)?,
    ];
    let offset = [
        pixels(film, "crop_offset_x", 0, 0)?,
        pixels(film, "crop_offset_y", 0, 0)?,
    ];
    let rest = [0, 1].map(|i| size[i].saturating_sub(offset[i]));
    let cropped = [
        pixels(film, "crop_width", 0, rest[0])?,
        pixels(film, "crop_height", 0, rest[1])?,
    ];
    if (0..2).any(|i| cropped[i] == 0 || cropped[i] > rest[i]) {
        return Err(film.error("the crop of the film is empty or reaches beyond its edges"));
    }
    Ok(Film {
        size,
        pixels: [0, 1].map(|i| [offset[i], offset[i] + cropped[i]]),
    })
}

/// Reads a number of pixels of a film, at least `least`.
fn pixels(film: &XmlObject, key: &str, least: u32, default: u32) -> Result<u32, SceneError> {
    let x = film.number(key, f64::from(default))?;
    if x.fract() != 0.0 || x < f64::from(least) || x > f64::from(MAX_SIDE) {
        return Err(film.error(format!(
            "`{key}` must be a whole number from {least} to {MAX_SIDE}, found {x}"
        )));
    }
    Ok(x as u32)
}

/// Returns the vertical field of view in degrees.
pub(super) fn fov(o: &XmlObject, [width, height]: [u32; 2]) -> Result<f32, SceneError> {
    let aspect = f64::from(width) / f64::from(height);
    let diagonal = |half_height: f64| half_height * aspect.hypot(1.0);
    // Half the height of the image at distance one.
    let half = if o.property("fov").is_none() {
        let text = o.text("focal_length")?.unwrap_or(DEFAULT_FOCAL_LENGTH);
        let length =
            super::values::number(text.trim().trim_end_matches("mm")).map_err(|e| o.error(e))?;
        if !(length > 0.0 && length < 1e6) {
            return Err(o.error(format!("`focal_length` must be positive, found {length}")));
        }
        FILM_35MM[0].hypot(FILM_35MM[1]) / (2.0 * length) / diagonal(1.0)
    } else {
        let degrees = o.number("fov", 0.0)?;
        if !(degrees > 0.0 && degrees < 179.9) {
            return Err(o.error(format!(
                "`fov` must be between 0 and 180 degrees, found {degrees}"
            )));
        }
        let extent = (0.5 * degrees.to_radians()).tan();
        match o.text("fov_axis")?.unwrap_or("x") {
            "x" => extent / aspect,
            "y" => extent,
            "diagonal" => extent / diagonal(1.0),
            "smaller" if aspect > 1.0 => extent,
            "larger" if aspect < 1.0 => extent,
            "smaller" | "larger" => extent / aspect,
            other => {
                return Err(o.error(format!(
                    "`fov_axis` must be x, y, diagonal, smaller or larger, found `{}`",
                    super::values::truncated(other)
                )));
            }
        }
    };
    Ok((2.0 * half.atan()).to_degrees() as f32)
}
