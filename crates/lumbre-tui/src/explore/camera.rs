//! Motions of the camera: orbit, pan and dolly about the target, and the focus.

use glam::{Quat, Vec3};

use lumbre_light::scene::desc::{CameraDesc, CameraKind};

/// Smallest angle between the viewing direction and the vertical, in radians.
const POLE: f32 = 0.02;

/// A motion of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Rotation of the camera about its target, in radians: to the right, and upwards.
    Orbit([f32; 2]),
    /// Translation of camera and target, in units of the distance between them: to the right, and
    /// upwards.
    Pan([f32; 2]),
    /// Factor of the distance between camera and target, and of the height of an orthographic
    /// picture.
    Dolly(f32),
}

/// Returns the camera after a motion. The focus stays at its distance, or on the target.
pub fn moved(camera: &CameraDesc, motion: Motion) -> CameraDesc {
    let offset = camera.position - camera.target;
    let up = camera.up.normalize_or(Vec3::Y);
    let right = up.cross(offset).normalize_or(up.any_orthonormal_vector());
    let mut camera = camera.clone();
    match motion {
        Motion::Orbit([yaw, pitch]) => {
            // The angle to the vertical is kept away from 0 and pi, where the view would flip over.
            let polar = offset.angle_between(up);
            let least = POLE.min(polar);
            let most = (std::f32::consts::PI - POLE).max(polar);
            let pitch = polar - (polar - pitch).clamp(least, most);
            let turned = Quat::from_axis_angle(right, -pitch) * offset;
            camera.position = camera.target + Quat::from_axis_angle(up, yaw) * turned;
        }
        Motion::Pan([x, y]) => {
            let above = offset.cross(right).normalize_or(up);
            let by = (right * x + above * y) * offset.length();
            camera.position += by;
            camera.target += by;
        }
        Motion::Dolly(factor) => {
            camera.position = camera.target + offset * factor;
            // Distance alone does not change the size of what parallel rays show.
            if camera.kind == CameraKind::Orthographic {
                camera.view_height *= factor;
            }
        }
    }
    camera
}

/// Returns the distance along the viewing direction of a point, in scene units; `None` if the point
/// is behind the camera.
pub fn depth(camera: &CameraDesc, point: Vec3) -> Option<f32> {
    let forward = (camera.target - camera.position).normalize_or(Vec3::NEG_Z);
    let depth = (point - camera.position).dot(forward);
    (depth > 0.0).then_some(depth)
}

/// Returns the distance of the plane in focus, in scene units.
pub fn focus_distance(camera: &CameraDesc) -> f32 {
    camera
        .focus_distance
        .unwrap_or_else(|| camera.target.distance(camera.position))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> CameraDesc {
        CameraDesc {
            position: Vec3::new(0.0, 1.0, 4.0),
            target: Vec3::new(0.0, 1.0, 0.0),
            ..CameraDesc::default()
        }
    }

    fn near(a: Vec3, b: Vec3) -> bool {
        a.distance(b) < 1e-5
    }

    #[test]
    fn an_orbit_keeps_the_distance_and_the_target() {
        let quarter = std::f32::consts::FRAC_PI_2;
        let right = moved(&camera(), Motion::Orbit([quarter, 0.0]));
        assert!(near(right.position, Vec3::new(4.0, 1.0, 0.0)), "{right:?}");
        assert_eq!(right.target, camera().target);
        let above = moved(&camera(), Motion::Orbit([0.0, 0.5]));
        assert!(
            above.position.y > 1.0 && (above.position.distance(above.target) - 4.0).abs() < 1e-5
        );
    }

    #[test]
    fn an_orbit_stops_before_the_pole() {
        let mut above = camera();
        for _ in 0..40 {
            above = moved(&above, Motion::Orbit([0.0, 0.2]));
        }
        let offset = above.position - above.target;
        let polar = offset.angle_between(Vec3::Y);
        assert!((polar - POLE).abs() < 1e-3 && offset.z > 0.0, "{polar}");
    }

    #[test]
    fn a_pan_moves_camera_and_target_and_a_dolly_changes_the_distance() {
        let panned = moved(&camera(), Motion::Pan([0.5, 0.25]));
        assert!(
            near(panned.position, Vec3::new(2.0, 2.0, 4.0)),
            "{panned:?}"
        );
        assert!(near(panned.target, Vec3::new(2.0, 2.0, 0.0)));
        let nearer = moved(&camera(), Motion::Dolly(0.5));
        assert!(near(nearer.position, Vec3::new(0.0, 1.0, 2.0)));
        let parallel = CameraDesc {
            kind: CameraKind::Orthographic,
            view_height: 3.0,
            ..camera()
        };
        assert_eq!(moved(&parallel, Motion::Dolly(0.5)).view_height, 1.5);
    }

    #[test]
    fn depth_is_measured_along_the_axis() {
        assert_eq!(depth(&camera(), Vec3::new(2.0, 3.0, 1.0)), Some(3.0));
        assert_eq!(depth(&camera(), Vec3::new(0.0, 0.0, 5.0)), None);
        assert_eq!(focus_distance(&camera()), 4.0);
    }
}
