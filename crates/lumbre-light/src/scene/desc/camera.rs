//! Camera description: kind, position, extent of the view, lens and sensor.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::place::split;
use super::view_window::ViewWindow;

/// Map from directions or positions to the picture of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum CameraKind {
    /// Rays through a pinhole or a thin lens.
    #[default]
    Perspective,
    /// Parallel rays along the viewing direction, from a rectangle about the position that is
    /// perpendicular to it.
    Orthographic,
    /// Rays from the position in all directions: longitude over the width of the picture, latitude
    /// over its height.
    Spherical,
}

/// Every kind of camera with its name in scripts.
pub const CAMERA_KINDS: [(CameraKind, &str); 3] = [
    (CameraKind::Perspective, "perspective"),
    (CameraKind::Orthographic, "orthographic"),
    (CameraKind::Spherical, "spherical"),
];

/// Names of the kinds of cameras, in the order of [`CAMERA_KINDS`].
pub const CAMERA_KIND_NAMES: [&str; CAMERA_KINDS.len()] = {
    let mut names = [""; CAMERA_KINDS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = CAMERA_KINDS[i].1;
        i += 1;
    }
    names
};

impl CameraKind {
    /// Returns the name in scripts.
    pub fn name(self) -> &'static str {
        CAMERA_KIND_NAMES[self as usize]
    }

    /// Returns the kind with this name.
    pub fn from_name(name: &str) -> Option<CameraKind> {
        CAMERA_KINDS
            .iter()
            .find(|(_, n)| *n == name)
            .map(|(kind, _)| *kind)
    }
}

/// A camera with its place, view and lens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraDesc {
    /// Map from directions or positions to the picture.
    #[serde(default)]
    pub kind: CameraKind,
    /// Centre of projection, or of the lens; of an orthographic camera, the centre of the rectangle
    /// from which its rays start.
    pub position: Vec3,
    /// A point on the optical axis; of a spherical camera, a point in the middle of the picture.
    pub target: Vec3,
    /// Rest that single precision leaves of the position and of the target, which counts in scenes
    /// far from the origin.
    #[serde(default)]
    pub rest: [Vec3; 2],
    /// Direction that points up in the image.
    pub up: Vec3,
    /// Height of the picture of an orthographic camera in scene units, positive.
    #[serde(default = "default_view_height")]
    pub view_height: f32,
    /// The part of this view that the picture shows; a spherical camera shows the whole.
    #[serde(default)]
    pub window: ViewWindow,
    /// Distance from the lens to the focal plane along the axis; `None` is the distance to
    /// `target`.
    pub focus_distance: Option<f32>,
    /// Field of view and lens of a perspective camera.
    pub optics: Optics,
}

/// Field of view and lens as a scene states them: as an angle and a diameter, or in photographic
/// terms, which override these. [`CameraDesc::view_deg`] and [`CameraDesc::lens_diameter`] return
/// what follows; the values themselves are private, so that none is shown without the one that
/// overrides it.
///
/// The sensor is at the focal length behind the lens, as in thesis S1 (docs/inside/transport.md), whatever
/// the focus distance. (A real lens moves away from its sensor to focus on a near object, which
/// narrows the view slightly.) S1 states focal length and sensor in metres; here they are in scene
/// units, like all lengths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Optics {
    fov_deg: f32,
    aperture: f32,
    f_number: Option<f32>,
    focal_length: Option<f32>,
    sensor_height: Option<f32>,
}

impl Default for Optics {
    /// Returns a pinhole with a vertical field of view of 45 degrees.
    fn default() -> Optics {
        Optics::pinhole(45.0)
    }
}

impl Optics {
    /// Returns a pinhole with a vertical field of view in degrees, between 0 and 180 exclusive.
    pub fn pinhole(fov_deg: f32) -> Optics {
        Optics {
            fov_deg,
            aperture: 0.0,
            f_number: None,
            focal_length: None,
            sensor_height: None,
        }
    }

    /// Replaces the vertical field of view in degrees, between 0 and 180 exclusive.
    pub fn with_fov_deg(self, fov_deg: f32) -> Optics {
        Optics { fov_deg, ..self }
    }

    /// Replaces the diameter of the lens in scene units, 0 for a pinhole, and removes the f-number.
    pub fn with_aperture(self, aperture: f32) -> Optics {
        Optics {
            aperture,
            f_number: None,
            ..self
        }
    }

    /// Replaces the f-number: focal length divided by lens diameter, positive.
    pub fn with_f_number(self, f_number: Option<f32>) -> Optics {
        Optics { f_number, ..self }
    }

    /// Replaces the focal length in scene units, positive.
    pub fn with_focal_length(self, focal_length: Option<f32>) -> Optics {
        Optics {
            focal_length,
            ..self
        }
    }

    /// Replaces the height of the part of the sensor that the image fills, in scene units,
    /// positive.
    pub fn with_sensor_height(self, sensor_height: Option<f32>) -> Optics {
        Optics {
            sensor_height,
            ..self
        }
    }

    /// Returns the f-number if it is set.
    pub fn f_number(&self) -> Option<f32> {
        self.f_number
    }

    /// Returns the focal length in scene units if it is set. See [`CameraDesc::focal_length`].
    pub fn focal_length(&self) -> Option<f32> {
        self.focal_length
    }

    /// Returns the height of the sensor in scene units if it is set.
    pub fn sensor_height(&self) -> Option<f32> {
        self.sensor_height
    }

    /// Returns whether focal length and sensor height determine the field of view.
    pub fn determine_view(&self) -> bool {
        self.focal_length.is_some() && self.sensor_height.is_some()
    }
}

/// Smallest and greatest height of the picture of an orthographic camera, in scene units.
pub const VIEW_HEIGHT_RANGE: [f64; 2] = [1e-6, 1e9];

/// Height of the picture of orthographic cameras that state none, in scene units.
const DEFAULT_VIEW_HEIGHT: f32 = 2.0;

/// Returns [`DEFAULT_VIEW_HEIGHT`] for records without a height.
fn default_view_height() -> f32 {
    DEFAULT_VIEW_HEIGHT
}

impl Default for CameraDesc {
    /// Returns a pinhole camera at the origin that looks along -z, +y up, with a vertical field of
    /// view of 45 degrees.
    fn default() -> CameraDesc {
        CameraDesc {
            kind: CameraKind::Perspective,
            position: Vec3::ZERO,
            target: Vec3::NEG_Z,
            rest: [Vec3::ZERO; 2],
            up: Vec3::Y,
            view_height: DEFAULT_VIEW_HEIGHT,
            window: ViewWindow::WHOLE,
            focus_distance: None,
            optics: Optics::default(),
        }
    }
}

impl CameraDesc {
    /// Returns a pinhole camera with +y up; the vertical field of view is in degrees.
    pub fn pinhole(position: Vec3, target: Vec3, fov_deg: f32) -> CameraDesc {
        CameraDesc {
            position,
            target,
            optics: Optics::pinhole(fov_deg),
            ..CameraDesc::default()
        }
    }

    /// Returns the position and the target in double precision.
    pub fn places(&self) -> [DVec3; 2] {
        let whole = [self.position, self.target].map(|p| p.as_dvec3());
        [0, 1].map(|i| whole[i] + self.rest[i].as_dvec3())
    }

    /// Returns the camera at another position with another target, in double precision.
    pub fn placed(self, position: DVec3, target: DVec3) -> CameraDesc {
        let [(position, p), (target, t)] = [position, target].map(split);
        CameraDesc {
            position,
            target,
            rest: [p, t],
            ..self
        }
    }

    /// Returns the vertical field of view in degrees: `2 atan(h / 2f)` if a sensor height `h` and a
    /// focal length `f` are set, else the angle that is set.
    pub fn view_deg(&self) -> f32 {
        match (self.optics.sensor_height, self.optics.focal_length) {
            (Some(height), Some(focal)) => (2.0 * (0.5 * height / focal).atan()).to_degrees(),
            _ => self.optics.fov_deg,
        }
    }

    /// Returns the vertical angle in degrees that the window of a perspective camera shows if it is
    /// centred on the axis: that of [`CameraDesc::view_deg`] for the whole view.
    pub fn picture_deg(&self) -> f32 {
        let [_, shown] = self.window.size();
        if shown == 1.0 {
            return self.view_deg();
        }
        let half = (0.5 * self.view_deg().to_radians()).tan() * shown;
        (2.0 * half.atan()).to_degrees()
    }

    /// Returns the focal length if it is set or follows from sensor height and field of view.
    pub fn focal_length(&self) -> Option<f32> {
        let from_view = |height: f32| 0.5 * height / (0.5 * self.optics.fov_deg.to_radians()).tan();
        self.optics
            .focal_length
            .or(self.optics.sensor_height.map(from_view))
    }

    /// Returns the lens diameter in scene units: focal length over f-number if an f-number is set,
    /// else the diameter that is set. An f-number without a focal length, which loaders and sweeps
    /// refuse, yields a pinhole.
    pub fn lens_diameter(&self) -> f32 {
        match self.optics.f_number {
            Some(number) => self.focal_length().map_or(0.0, |focal| focal / number),
            None => self.optics.aperture,
        }
    }

    /// Returns why no picture can show the window, if so.
    pub fn window_problem(&self) -> Option<String> {
        let parts = self.kind == CameraKind::Spherical && self.window != ViewWindow::WHOLE;
        let whole = parts.then(|| "spherical cameras show their whole view".to_owned());
        whole.or_else(|| self.window.problem())
    }

    /// Returns an error if a lens is set on a camera of a kind that cannot have one, with what to do
    /// about it.
    pub fn lens_problem(&self) -> Option<[String; 2]> {
        let diameter = self.lens_diameter();
        (self.kind != CameraKind::Perspective && diameter > 0.0).then(|| {
            [
                format!(
                    "{} cameras have no lens, but the diameter of the lens is {diameter}",
                    self.kind.name()
                ),
                "set `aperture = 0`, or the kind `perspective`".to_owned(),
            ]
        })
    }

    /// Returns whether an f-number is set while the focal length is unknown.
    pub fn lacks_focal_length(&self) -> bool {
        self.optics.f_number.is_some() && self.focal_length().is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(optics: Optics) -> CameraDesc {
        CameraDesc {
            optics: Optics {
                fov_deg: 60.0,
                aperture: 0.25,
                ..optics
            },
            ..CameraDesc::default()
        }
    }

    #[test]
    fn names_of_kinds_are_those_of_their_rows() {
        for (kind, name) in CAMERA_KINDS {
            assert_eq!(
                (kind.name(), CameraKind::from_name(name)),
                (name, Some(kind))
            );
        }
    }

    #[test]
    fn full_frame_lenses_match_the_angles_of_data_sheets() {
        // 36 x 24 mm sensor, landscape: vertical angles of 20, 35, 50 and 85 mm are 61.9, 37.8,
        // 27.0 and 16.1 degrees.
        for (focal, degrees) in [(0.020, 61.9), (0.035, 37.8), (0.050, 27.0), (0.085, 16.1)] {
            let optics = Optics {
                sensor_height: Some(0.024),
                focal_length: Some(focal),
                ..Optics::default()
            };
            assert!(
                (camera(optics).view_deg() - degrees).abs() < 0.06,
                "{focal}: {}",
                camera(optics).view_deg()
            );
        }
    }

    #[test]
    fn missing_values_follow_from_the_others_or_keep_their_defaults() {
        let none = camera(Optics::default());
        assert_eq!(
            (none.view_deg(), none.lens_diameter(), none.focal_length()),
            (60.0, 0.25, None)
        );
        let lens = camera(Optics {
            f_number: Some(2.0),
            focal_length: Some(0.05),
            ..Optics::default()
        });
        assert_eq!((lens.view_deg(), lens.lens_diameter()), (60.0, 0.025));
        // tan 30 degrees is 1 / sqrt 3: a sensor of height 2 is sqrt 3 behind the lens.
        let sensor = camera(Optics {
            f_number: Some(2.0),
            sensor_height: Some(2.0),
            ..Optics::default()
        });
        assert_eq!(sensor.view_deg(), 60.0);
        assert!((sensor.lens_diameter() - 0.5 * 3f32.sqrt()).abs() < 1e-6);
        let lost = camera(Optics {
            f_number: Some(2.0),
            ..Optics::default()
        });
        assert!(
            lost.lacks_focal_length() && !lens.lacks_focal_length() && !none.lacks_focal_length()
        );
        assert_eq!(lost.lens_diameter(), 0.0);
    }
}
