//! What a scene says about its camera.

use glam::Vec3;

/// A pinhole or thin-lens camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraDesc {
    /// The centre of projection or of the lens.
    pub position: Vec3,
    /// A point on the optical axis.
    pub target: Vec3,
    /// The direction that is up in the picture.
    pub up: Vec3,
    /// Vertical field of view in degrees, between 0 and 180 exclusive, unless `optics` decides it: see
    /// [`CameraDesc::view_deg`].
    pub fov_deg: f32,
    /// Diameter of the lens in scene units, 0 is a pinhole, unless `optics` decides it: see
    /// [`CameraDesc::lens_diameter`].
    pub aperture: f32,
    /// Distance from the lens to the plane in focus along the axis; `None` is the distance to `target`.
    pub focus_distance: Option<f32>,
    /// Lens and sensor, as photographers and the second source describe them.
    pub optics: Optics,
}

/// Lens and sensor of a real camera. Whatever is there takes the place of [`CameraDesc::aperture`] and
/// [`CameraDesc::fov_deg`].
///
/// The sensor stands at the focal length behind the lens, as in the second source, whatever the focus. (A real lens that
/// focuses on something near moves away from its sensor, which narrows the view a little.) That source gives focal length
/// and sensor in metres; here they are in scene units, like everything else.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Optics {
    /// Focal length over the diameter of the lens, positive.
    pub f_number: Option<f32>,
    /// Focal length in scene units, positive.
    pub focal_length: Option<f32>,
    /// Height of the part of the sensor that the picture fills, in scene units, positive.
    pub sensor_height: Option<f32>,
}

impl Default for CameraDesc {
    /// A pinhole at the origin that looks along -z with +y up, through 45 degrees.
    fn default() -> CameraDesc {
        CameraDesc {
            position: Vec3::ZERO,
            target: Vec3::NEG_Z,
            up: Vec3::Y,
            fov_deg: 45.0,
            aperture: 0.0,
            focus_distance: None,
            optics: Optics::default(),
        }
    }
}

impl CameraDesc {
    /// The vertical field of view in degrees: `2 atan(h / 2f)` where there are a sensor of height `h` and a focal length
    /// `f`, else [`CameraDesc::fov_deg`].
    pub fn view_deg(&self) -> f32 {
        match (self.optics.sensor_height, self.optics.focal_length) {
            (Some(height), Some(focal)) => (2.0 * (0.5 * height / focal).atan()).to_degrees(),
            _ => self.fov_deg,
        }
    }

    /// The focal length, if it is given, or follows from the sensor and the field of view.
    pub fn focal_length(&self) -> Option<f32> {
        let from_view = |height: f32| 0.5 * height / (0.5 * self.fov_deg.to_radians()).tan();
        self.optics.focal_length.or(self.optics.sensor_height.map(from_view))
    }

    /// The diameter of the lens in scene units: focal length over f-number where there is an f-number, else
    /// [`CameraDesc::aperture`]. An f-number without a focal length, which loaders and sweeps refuse, is a pinhole.
    pub fn lens_diameter(&self) -> f32 {
        match self.optics.f_number {
            Some(number) => self.focal_length().map_or(0.0, |focal| focal / number),
            None => self.aperture,
        }
    }

    /// Whether an f-number stands there without anything from which a focal length follows.
    pub fn lacks_focal_length(&self) -> bool {
        self.optics.f_number.is_some() && self.focal_length().is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(optics: Optics) -> CameraDesc {
        CameraDesc { fov_deg: 60.0, aperture: 0.25, optics, ..CameraDesc::default() }
    }

    #[test]
    fn full_frame_lenses_have_the_angles_of_their_data_sheets() {
        // 36 x 24 mm lying: vertical angles of 20, 35, 50 and 85 mm are 61.9, 37.8, 27.0 and 16.1 degrees.
        for (focal, degrees) in [(0.020, 61.9), (0.035, 37.8), (0.050, 27.0), (0.085, 16.1)] {
            let optics = Optics { sensor_height: Some(0.024), focal_length: Some(focal), ..Optics::default() };
            assert!((camera(optics).view_deg() - degrees).abs() < 0.06, "{focal}: {}", camera(optics).view_deg());
        }
    }

    #[test]
    fn what_is_left_out_follows_from_the_rest_or_stays() {
        let none = camera(Optics::default());
        assert_eq!((none.view_deg(), none.lens_diameter(), none.focal_length()), (60.0, 0.25, None));
        let lens = camera(Optics { f_number: Some(2.0), focal_length: Some(0.05), sensor_height: None });
        assert_eq!((lens.view_deg(), lens.lens_diameter()), (60.0, 0.025));
        // tan 30 degrees is 1 / sqrt 3: a sensor of height 2 stands sqrt 3 behind the lens.
        let sensor = camera(Optics { f_number: Some(2.0), focal_length: None, sensor_height: Some(2.0) });
        assert_eq!(sensor.view_deg(), 60.0);
        assert!((sensor.lens_diameter() - 0.5 * 3f32.sqrt()).abs() < 1e-6);
        let lost = camera(Optics { f_number: Some(2.0), ..Optics::default() });
        assert!(lost.lacks_focal_length() && !lens.lacks_focal_length() && !none.lacks_focal_length());
        assert_eq!(lost.lens_diameter(), 0.0);
    }
}
