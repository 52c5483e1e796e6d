//! Cameras: `perspective` and `thinlens`, with the size of their film.

use glam::DVec3;

use super::DEFAULT_FILM;
use super::tree::Object;
use crate::scene::desc::{CameraDesc, MAX_SIDE, Optics};
use crate::scene::{Note, SceneError};

/// Width and height of the film that `focal_length` is meant for, in millimetres.
const FILM_35MM: [f64; 2] = [36.0, 24.0];

/// Reads a camera, and the resolution of its film.
pub(super) fn read(o: &Object, notes: &mut Vec<Note>) -> Result<(CameraDesc, [u32; 2]), SceneError> {
    let thin = match o.kind.as_str() {
        "perspective" => false,
        "thinlens" => true,
        other => {
            return Err(o.error(format!(
                "the sensor `{}` is not possible: `perspective` and `thinlens` are",
                super::values::shorten(other)
            )));
        }
    };
    let resolution = match o.children("film").next() {
        None => DEFAULT_FILM,
        Some(film) => self::film(film)?,
    };
    let map = o.map("to_world")?;
    if map.matrix3.determinant() < 0.0 {
        notes.push(
            o.note("its `to_world` mirrors the picture, which cameras here do not: left and right are exchanged"),
        );
    }
    let position = map.translation;
    let axis = |v: DVec3| map.transform_vector3(v).try_normalize();
    let (Some(forward), Some(up)) = (axis(DVec3::Z), axis(DVec3::Y)) else {
        return Err(o.error("its `to_world` flattens space"));
    };
    let mut camera = CameraDesc {
        position: position.as_vec3(),
        target: (position + forward).as_vec3(),
        up: up.as_vec3(),
        fov_deg: fov(o, resolution)?,
        aperture: 0.0,
        focus_distance: None,
        optics: Optics::default(),
    };
    if camera.position == camera.target {
        return Err(o.error("it stands too far from the origin to look anywhere"));
    }
    o.known(&["near_clip", "far_clip", "shutter_open", "shutter_close"]);
    o.children("sampler").for_each(|s| s.known(&["sample_count", "seed", "scramble", "jitter"]));
    if thin {
        let radius = o.number("aperture_radius", 1.0)?;
        let focus = o.number("focus_distance", 1e6)?;
        let possible = (0.0..=1e6).contains(&radius) && focus > 0.0 && focus <= 1e12;
        if !possible {
            return Err(o.error(format!("a lens of radius {radius} in focus at {focus} is none")));
        }
        camera.aperture = (2.0 * radius) as f32;
        camera.focus_distance = Some(focus as f32);
    } else {
        o.known(&["focus_distance"]);
    }
    Ok((camera, resolution))
}

fn film(film: &Object) -> Result<[u32; 2], SceneError> {
    // What becomes of the picture is the script's to say.
    film.known(&[
        "file_format",
        "pixel_format",
        "component_format",
        "gamma",
        "banner",
        "high_quality_edges",
        "exposure",
    ]);
    film.children("rfilter").for_each(|f| f.known(&["radius", "stddev"]));
    let mut size = DEFAULT_FILM;
    for (n, key) in size.iter_mut().zip(["width", "height"]) {
        let x = film.number(key, f64::from(*n))?;
        if x.fract() != 0.0 || x < 1.0 || x > f64::from(MAX_SIDE) {
            return Err(film.error(format!("`{key}` must be a whole number from 1 to {MAX_SIDE}, found {x}")));
        }
        *n = x as u32;
    }
    Ok(size)
}

/// The vertical field of view in degrees.
fn fov(o: &Object, [width, height]: [u32; 2]) -> Result<f32, SceneError> {
    let aspect = f64::from(width) / f64::from(height);
    let diagonal = |half_height: f64| half_height * aspect.hypot(1.0);
    // Half the height of the picture at distance one.
    let half = if let Some(text) = o.text("focal_length")? {
        let length = super::values::number(text.trim().trim_end_matches("mm")).map_err(|e| o.error(e))?;
        if !(length > 0.0 && length < 1e6) {
            return Err(o.error(format!("`focal_length` must be positive, found {length}")));
        }
        FILM_35MM[0].hypot(FILM_35MM[1]) / (2.0 * length) / diagonal(1.0)
    } else {
        let degrees = o.number("fov", 50.0)?;
        if !(degrees > 0.0 && degrees < 179.9) {
            return Err(o.error(format!("`fov` must lie between 0 and 180 degrees, found {degrees}")));
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
                    super::values::shorten(other)
                )));
            }
        }
    };
    Ok((2.0 * half.atan()).to_degrees() as f32)
}
