//! Scenes with radiance known in closed form, rendered by every unbiased integrator and variant. Pictures
//! are compared as a whole: in blocks, a few rare splats next to noise-free areas would not follow
//! a normal distribution.

use std::rc::Rc;
use std::sync::Arc;

use glam::Vec3;

use super::picture::{NoisyPicture, Setting, confirmed, judge, render};
use super::technique::{self, Technique};
use super::{Check, SeedFamily, VerifyRequest};
use lumbre_light::film::Image;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{
    CameraDesc, EntityDesc, EnvironmentDesc, EnvironmentSource, MaterialDesc, Model, SceneDesc,
};
use lumbre_light::scene::simple::{ball, lambert, quad, quads, room};

/// A scene with known radiance.
pub(super) struct KnownScene {
    pub(super) name: &'static str,
    pub(super) formula: &'static str,
    pub(super) scene: SceneDesc,
    pub(super) max_depth: u32,
    /// Radiance at a position in the picture; coordinates from -1 to 1, to the right and up.
    radiance: Box<dyn Fn(f64, f64) -> [f64; 3]>,
    /// Samples per pixel; large if light is only found by chance.
    samples: u64,
}

/// Returns all scenes with known radiance.
pub(super) fn known_scenes() -> Vec<KnownScene> {
    vec![
        furnace(),
        glass(),
        uniform_environment(),
        white_plastic(),
        paper_ball(),
        sphere_over_floor(),
    ]
}

/// Lists the checks against known radiance.
///
/// # Errors
/// Never: the scenes defined here compile.
pub fn plan(request: &VerifyRequest) -> Result<Vec<Check>, String> {
    let mut checks = Vec::new();
    let mut seeds = 0;
    for case in known_scenes() {
        let side = if request.quick { 8 } else { 32 };
        let (scene, _) = compile(&case.scene).map_err(|e| format!("{}: {e}", case.name))?;
        let scene = Arc::new(scene);
        let truth = Rc::new(truth(&case, side));
        for technique in technique::plain().into_iter().flat_map(|t: Technique| {
            let variants = t.variants();
            std::iter::once(t).chain(variants)
        }) {
            seeds += 1;
            let setting = Setting {
                resolution: [side; 2],
                max_depth: case.max_depth,
                samples: case.samples,
                seed: request.seed(SeedFamily::Analytic, seeds),
                threads: request.threads,
                ..Setting::PLAIN
            };
            let truth = Rc::clone(&truth);
            let scene = Arc::clone(&scene);
            let compared = format!("{technique} with {}", case.formula);
            checks.push(Check::new(case.name, compared, move |tests| {
                confirmed(|attempt| {
                    let rendered = render(&scene, &technique, attempt.setting(setting))?;
                    Ok(judge(&rendered, &truth, side, tests).outcome())
                })
            }));
        }
    }
    Ok(checks)
}

/// Computes the exact picture of `side` pixels a side; each pixel is the mean over a grid.
pub(super) fn truth(case: &KnownScene, side: u32) -> NoisyPicture {
    const GRID: u32 = 8;
    let coordinate = |pixel: u32, i: u32| {
        (f64::from(pixel) + (f64::from(i) + 0.5) / f64::from(GRID)) / f64::from(side) * 2.0 - 1.0
    };
    let mean = Image::from_fn(side, side, |x, y| {
        let mut sum = [0.0; 3];
        for (i, j) in (0..GRID * GRID).map(|n| (n % GRID, n / GRID)) {
            let radiance = (case.radiance)(coordinate(x, i), -coordinate(y, j));
            sum = [0, 1, 2].map(|c| sum[c] + radiance[c]);
        }
        sum.map(|s| (s / f64::from(GRID * GRID)) as f32)
    });
    NoisyPicture::from_values(mean, Image::new(side, side))
}

/// Radiance that is constant over the picture.
fn constant(radiance: [f64; 3]) -> Box<dyn Fn(f64, f64) -> [f64; 3]> {
    Box::new(move |_, _| radiance)
}

/// A closed room whose walls emit e and reflect a: e (1 + a + .. + a^(k-1)) after k edges.
fn furnace() -> KnownScene {
    let (albedo, emitted, edges) = (Vec3::new(0.8, 0.6, 0.3), 0.5, 5);
    let walls = MaterialDesc {
        emission: Vec3::splat(emitted),
        ..lambert("walls", albedo)
    };
    let series =
        |a: f32| f64::from(emitted) * (1.0 - f64::from(a).powi(edges)) / (1.0 - f64::from(a));
    KnownScene {
        name: "furnace",
        formula: "e (1 - a^k) / (1 - a)",
        scene: scene(
            Vec3::new(0.1, 0.2, 0.3),
            Vec3::new(0.7, 0.1, -0.4),
            70.0,
            vec![walls],
            vec![room(1.0)],
        ),
        max_depth: edges as u32,
        radiance: constant(albedo.to_array().map(series)),
        samples: 128,
    }
}

/// Lossless glass and a mirror in a room that emits 1: they are invisible.
fn glass() -> KnownScene {
    let walls = MaterialDesc {
        emission: Vec3::ONE,
        emitter_reflects: false,
        ..lambert("walls", Vec3::ZERO)
    };
    let glass = MaterialDesc {
        opacity: 0.0,
        ..lambert("glass", Vec3::ONE)
    };
    let mirror = MaterialDesc {
        metallic: 1.0,
        ..lambert("mirror", Vec3::ONE)
    };
    let balls = [
        ("glass", Vec3::new(-0.2, 0.0, 0.0)),
        ("mirror", Vec3::new(0.3, 0.1, -0.2)),
    ];
    let mut entities = vec![room(1.0)];
    entities.extend(balls.map(|(material, center)| ball(material, center, 0.25)));
    KnownScene {
        name: "lossless",
        formula: "1",
        scene: scene(
            Vec3::Z * 0.9,
            Vec3::ZERO,
            50.0,
            vec![walls, glass, mirror],
            entities,
        ),
        max_depth: 64,
        radiance: constant([1.0; 3]),
        samples: 16,
    }
}

/// A convex diffuse body under uniform radiance L has the radiance a L.
fn uniform_environment() -> KnownScene {
    let albedo = Vec3::new(0.9, 0.5, 0.2);
    KnownScene {
        name: "environment",
        formula: "a L",
        scene: ball_under_radiance(lambert("ball", albedo), 2.0),
        max_depth: 3,
        radiance: constant(albedo.to_array().map(|a| 2.0 * f64::from(a))),
        samples: 128,
    }
}

/// White plastic, whose smooth coat is a Dirac lobe beside a diffuse one, loses no light: a convex
/// body of it under uniform radiance L has the radiance L.
fn white_plastic() -> KnownScene {
    let plastic = MaterialDesc {
        model: Model::Plastic,
        roughness: 0.0,
        ior: 2.5,
        ..lambert("ball", Vec3::ONE)
    };
    KnownScene {
        name: "white plastic",
        formula: "L",
        scene: ball_under_radiance(plastic, 2.0),
        max_depth: 3,
        radiance: constant([2.0; 3]),
        samples: 128,
    }
}

/// A hollow ball of paper with reflectance R and transmittance T under uniform radiance L: inside is
/// the radiance T L / (1 - R), of which the share T passes out again.
fn paper_ball() -> KnownScene {
    let (r, t) = (Vec3::new(0.3, 0.5, 0.2), Vec3::new(0.6, 0.2, 0.7));
    let paper = MaterialDesc {
        model: Model::Translucent,
        transmittance: t,
        ..lambert("ball", r)
    };
    let radiance = [0, 1, 2].map(|c| {
        let (r, t) = (f64::from(r[c]), f64::from(t[c]));
        2.0 * (r + t * t / (1.0 - r))
    });
    KnownScene {
        name: "paper ball",
        formula: "L (R + T^2 / (1 - R))",
        scene: ball_under_radiance(paper, 2.0),
        max_depth: 24,
        radiance: constant(radiance),
        samples: 128,
    }
}

/// Returns a ball that fills the picture, under the same radiance from all directions.
fn ball_under_radiance(material: MaterialDesc, radiance: f32) -> SceneDesc {
    let mut scene = scene(
        Vec3::Z * 4.0,
        Vec3::ZERO,
        10.0,
        vec![material],
        vec![ball("ball", Vec3::ZERO, 1.0)],
    );
    let source = EnvironmentSource::Color(Vec3::splat(radiance));
    scene.environment = Some(EnvironmentDesc::new(source));
    scene
}

/// A floor under an emissive sphere of radius r at height h, seen from below the sphere. At the
/// distance x from the foot of the sphere the floor has the radiance
/// a L r^2 h / (h^2 + x^2)^(3/2).
fn sphere_over_floor() -> KnownScene {
    let (albedo, radius, height, radiance, eye) = (0.5f32, 0.5f32, 2.0f32, 3.0f32, 1.0f32);
    let lamp = MaterialDesc {
        emission: Vec3::splat(radiance),
        emitter_reflects: false,
        ..lambert("lamp", Vec3::ZERO)
    };
    let floor = quad(
        Vec3::new(-50.0, 0.0, 50.0),
        Vec3::X * 100.0,
        Vec3::Z * -100.0,
    );
    let materials = vec![lambert("floor", Vec3::splat(albedo)), lamp];
    let entities = vec![
        quads("floor", &[floor]),
        ball("lamp", Vec3::Y * height, radius),
    ];
    let mut scene = scene(Vec3::Y * eye, Vec3::ZERO, 60.0, materials, entities);
    scene.camera.up = Vec3::Z;
    let [a, r, h, l] = [albedo, radius, height, radiance].map(f64::from);
    let extent = f64::from(eye) * 30f64.to_radians().tan();
    KnownScene {
        name: "lamp over floor",
        formula: "a L r^2 h / d^3",
        scene,
        max_depth: 2,
        radiance: Box::new(move |x, y| {
            let d2 = h * h + extent * extent * (x * x + y * y);
            [a * l * r * r * h / (d2 * d2.sqrt()); 3]
        }),
        samples: 512,
    }
}

fn scene(
    position: Vec3,
    target: Vec3,
    fov_deg: f32,
    materials: Vec<MaterialDesc>,
    entities: Vec<EntityDesc>,
) -> SceneDesc {
    SceneDesc {
        resolution: [1, 1],
        max_depth: 1,
        camera: CameraDesc::pinhole(position, target, fov_deg),
        materials: materials.into(),
        entities: entities.into(),
        ..SceneDesc::default()
    }
}
