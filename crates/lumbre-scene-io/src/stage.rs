//! Stages: light, ground and camera for scenes that bring none, such as the models of a library.

use glam::{Affine3A, DAffine3, Quat, Vec2, Vec3};

use crate::load::default_scene::{bounds, framing_camera, visit_points};
use lumbre_light::scene::desc::place::{double, origin, shift};
use lumbre_light::scene::desc::{
    CameraDesc, EntityDesc, EnvironmentDesc, EnvironmentSource, MaterialDesc, SceneDesc, ShapeDesc,
    TextureSlot, Transform,
};
use lumbre_light::scene::shape;

/// Surroundings that are put around the entities of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// A grey ground, an area light, a dim environment, and a camera that frames the entities unless
    /// the file has one.
    Studio,
    /// An environment of radiance 1, in which a white surface is invisible.
    White,
    /// No surroundings at all.
    Bare,
}

/// Scene option that names a stage.
pub const OPTION: &str = "stage";

/// Name of [`Stage::White`].
pub const WHITE: &str = "white";

/// Names of the stages in scene options, in the order of their variants.
pub const STAGES: [(&str, Stage); 3] = [
    ("studio", Stage::Studio),
    (WHITE, Stage::White),
    ("none", Stage::Bare),
];

/// Field of view of the studio's camera, in degrees.
const FOV_DEG: f32 = 35.0;
/// Fraction of the picture's height or width that the entities fill.
const FILL: f32 = 0.8;
/// Direction from the entities to the studio's camera.
const VIEW: Vec3 = Vec3::new(0.5, 0.45, 1.0);
/// Position of the area light from the centre, and its side, in radii of the entities. It is as far
/// away and as large as the ground, so that its power is a fair share of that of the environment on
/// the whole stage: lights are selected by power.
const LIGHT: Vec3 = Vec3::new(-21.6, 31.2, 16.8);
const LIGHT_SIDE: f32 = 19.2;
/// Radiance of the area light and of the environment: a white surface that faces the light has a
/// radiance below 1.
const LIGHT_RADIANCE: f32 = 8.0;
const ENVIRONMENT_RADIANCE: f32 = 0.2;
/// Side of the ground in radii of the entities.
const GROUND_SIDE: f32 = 80.0;
/// Albedo of the ground.
const GROUND_ALBEDO: f32 = 0.4;

/// Returns whether nothing in a scene emits light. Emissive textures do not count: they are signs
/// and screens, which viewers show in their own light.
pub fn is_unlit(scene: &SceneDesc) -> bool {
    let is_light =
        |m: &MaterialDesc| m.emission != Vec3::ZERO && m.texture(TextureSlot::Emission).is_none();
    scene.lights.is_empty() && scene.environment.is_none() && !scene.materials.iter().any(is_light)
}

/// Puts a stage around a scene. An environment that is there is replaced.
pub fn set_up(scene: &mut SceneDesc, stage: Stage) {
    match stage {
        Stage::Bare => {}
        Stage::White => scene.environment = Some(constant_environment(1.0)),
        Stage::Studio => {
            scene.environment = Some(constant_environment(ENVIRONMENT_RADIANCE));
            let framed = scene.camera == framing_camera(bounds(&scene.entities));
            // Far from the origin, single precision is too coarse for a ground below a model.
            let origin = origin(scene);
            shift(scene, -origin);
            if let Some([low, high]) = bounds(&scene.entities) {
                if framed {
                    scene.camera =
                        studio_camera(&scene.entities, (low + high) / 2.0, scene.resolution);
                }
                add_ground_and_light(scene, [low, high]);
            }
            shift(scene, origin);
        }
    }
}

fn constant_environment(radiance: f32) -> EnvironmentDesc {
    EnvironmentDesc::new(EnvironmentSource::Color(Vec3::splat(radiance)))
}

/// Returns a camera that looks at some entities from the front, the right and above, at the least
/// distance at which they fill no more than [`FILL`] of the picture; `middle` is that of their box.
fn studio_camera(entities: &[EntityDesc], middle: Vec3, resolution: [u32; 2]) -> CameraDesc {
    let back = VIEW.normalize_or(Vec3::Z);
    let right = Vec3::Y.cross(back).normalize_or(Vec3::X);
    let up = back.cross(right);
    let slope = (FOV_DEG.to_radians() / 2.0).tan() * FILL;
    let slopes = Vec2::new(
        slope * resolution[0] as f32 / resolution[1].max(1) as f32,
        slope,
    );
    // A point at (x, z) is within the slope s of a camera at (c, d) if x + s z <= c + s d and
    // -x + s z <= -c + s d. The two maxima of the left sides give the centre and the distance.
    let [mut above, mut below] = [Vec2::NEG_INFINITY; 2];
    let [mut nearest, mut farthest] = [f32::NEG_INFINITY, f32::INFINITY];
    // Relative to the middle, for models far from the origin.
    visit_points(entities, |p| {
        let p = p - middle;
        let (across, z) = (Vec2::new(p.dot(right), p.dot(up)), p.dot(back));
        above = above.max(across + slopes * z);
        below = below.max(slopes * z - across);
        (nearest, farthest) = (nearest.max(z), farthest.min(z));
    });
    let center = (above - below) / 2.0;
    let distance = ((above + below) / (2.0 * slopes)).max_element();
    let precision = 1e-5 * middle.abs().max_element().max(1e-1);
    let depth = (nearest - farthest).max(precision);
    let at = |z: f32| middle + right * center.x + up * center.y + back * z;
    CameraDesc::pinhole(
        at(distance.max(nearest + depth / 8.0)),
        at((nearest + farthest) / 2.0),
        FOV_DEG,
    )
}

/// Adds a ground below a box and an area light above it.
fn add_ground_and_light(scene: &mut SceneDesc, [low, high]: [Vec3; 2]) {
    let center = (low + high) / 2.0;
    let radius = ((high - low).length() / 2.0).max(1e-6);
    // Slightly below, so that it does not coincide with the underside of the entities.
    let below = Vec3::new(center.x, low.y - 1e-3 * radius, center.z);
    let ground = MaterialDesc {
        base_color: Vec3::splat(GROUND_ALBEDO),
        roughness: 1.0,
        ..MaterialDesc::new("stage_ground")
    };
    add_square(
        scene,
        ground,
        GROUND_SIDE * radius,
        DAffine3::from_translation(below.as_dvec3()),
    );
    let light = MaterialDesc {
        emission: Vec3::splat(LIGHT_RADIANCE),
        ..MaterialDesc::new("stage_light")
    };
    let facing_down = Quat::from_rotation_arc(Vec3::Y, -LIGHT.normalize_or(Vec3::Y));
    let place = Affine3A::from_rotation_translation(facing_down, center + radius * LIGHT);
    add_square(scene, light, LIGHT_SIDE * radius, double(place));
}

/// Adds a square with its own material. Names that the scene has already are left to it.
fn add_square(scene: &mut SceneDesc, mut material: MaterialDesc, side: f32, frame: DAffine3) {
    while scene.material_index(&material.name).is_some() {
        material.name += "_";
    }
    // A square of positive size is always a valid shape.
    let Ok(square) = shape::grid(Vec2::splat(side), [1, 1]) else {
        return;
    };
    let mesh = square.into_mesh(std::path::PathBuf::new(), &material.name);
    scene.entities.push(EntityDesc {
        transform: Transform::framed(frame),
        ..EntityDesc::new(
            material.name.clone(),
            ShapeDesc::Mesh(std::sync::Arc::new(mesh)),
        )
    });
    scene.materials.push(material);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::default_scene;

    /// A scene of one triangle mesh of unit size, without lights.
    fn bare() -> SceneDesc {
        let cube = shape::cuboid(Vec3::new(1.0, 2.0, 0.5), 0.0, 1).unwrap();
        let mesh = cube.into_mesh("cube.ply".into(), "stone");
        let materials = vec![MaterialDesc::new("stone")];
        default_scene::scene(std::path::Path::new("cube.ply"), mesh, materials)
    }

    #[test]
    fn a_studio_has_ground_light_and_a_camera_that_frames_the_entities() {
        let mut scene = bare();
        assert!(is_unlit(&scene));
        set_up(&mut scene, Stage::Studio);
        assert!(!is_unlit(&scene));
        let names: Vec<&str> = scene.entities.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["cube", "stage_ground", "stage_light"]);
        let camera = &scene.camera;
        let forward = (camera.target - camera.position).normalize_or(Vec3::Z);
        let up = (Vec3::Y - forward * Vec3::Y.dot(forward)).normalize_or(Vec3::Y);
        let slope = (camera.view_deg().to_radians() / 2.0).tan();
        let corners =
            default_scene::corners([Vec3::new(-0.5, -1.0, -0.25), Vec3::new(0.5, 1.0, 0.25)]);
        let heights = corners.map(|corner| {
            let p = corner - camera.position;
            p.dot(up) / (p.dot(forward) * slope)
        });
        let (lowest, highest) = heights.fold((0.0f32, 0.0f32), |(l, h), y| (l.min(y), h.max(y)));
        assert!(
            (lowest + FILL).abs() < 1e-3 && (highest - FILL).abs() < 1e-3,
            "{lowest} {highest}"
        );
    }

    #[test]
    fn the_area_light_of_a_studio_has_a_fair_share_of_the_power() {
        use std::f32::consts::PI;
        let mut scene = bare();
        set_up(&mut scene, Stage::Studio);
        let (compiled, _) = lumbre_light::scene::compile(&scene).unwrap();
        let (_, radius) = compiled.bounds_and_radius();
        let environment = PI * radius * radius * 4.0 * PI * ENVIRONMENT_RADIANCE;
        let area: f32 = compiled.emitters.iter().map(|e| e.area).sum();
        let light = PI * area * LIGHT_RADIANCE;
        let share = light / (light + environment);
        assert!((0.2..0.5).contains(&share), "{share}");
    }

    #[test]
    fn a_camera_of_the_file_stays_and_other_stages_add_no_entities() {
        let mut own = bare();
        own.camera.position = Vec3::new(0.0, 0.0, 9.0);
        let camera = own.camera.clone();
        set_up(&mut own, Stage::Studio);
        assert_eq!(own.camera, camera);
        for (name, stage) in [STAGES[1], STAGES[2]] {
            let mut scene = bare();
            set_up(&mut scene, stage);
            assert_eq!(scene.entities.len(), 1, "{name}");
            assert_eq!(scene.environment.is_some(), stage == Stage::White);
        }
    }
}
