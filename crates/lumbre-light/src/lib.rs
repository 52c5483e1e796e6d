//! Light transport: scenes, materials, lights, cameras, samplers and integrators.
//!
//! A [`scene::SceneDesc`] describes a scene. Loaders fill it from files, and programs fill it by
//! hand. [`scene::compile()`] turns it into a [`scene::CompiledScene`], which a renderer draws
//! samples from with one of the [`transport::integrator::INTEGRATORS`]. Tracing rays is left to the
//! renderer, through the trait [`transport::ray::Trace`]; the crate `lumbre-render` has one for
//! CPUs. This example renders a grey ball under a sky that has the radiance 1 everywhere:
//!
//! ```
//! use std::sync::Arc;
//!
//! use glam::Vec3;
//! use lumbre_light::scene::compile;
//! use lumbre_light::scene::desc::*;
//! use lumbre_light::transport::integrator::integrator;
//! use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};
//!
//! let grey = MaterialDesc {
//!     base_color: Vec3::splat(0.5),
//!     model: Model::Lambert,
//!     ..MaterialDesc::new("grey")
//! };
//! let ball = EntityDesc {
//!     name: "ball".into(),
//!     transform: Transform::default(),
//!     material: Some("grey".into()),
//!     anisotropic_direction: None,
//!     shape: ShapeDesc::Sphere { radius: 1.0 },
//! };
//! let sky = EnvironmentDesc {
//!     source: EnvironmentSource::Color(Vec3::ONE),
//!     rotation_deg: 0.0,
//!     scale: 1.0,
//!     sampling: EnvironmentSampling::Luminance,
//! };
//! let (scene, _notes) = compile(&SceneDesc {
//!     resolution: [64, 64],
//!     max_depth: 4,
//!     camera: CameraDesc {
//!         position: Vec3::Z * 4.0,
//!         ..CameraDesc::default()
//!     },
//!     views: vec![],
//!     materials: vec![grey],
//!     entities: vec![ball],
//!     lights: vec![],
//!     environment: Some(sky),
//! })?;
//!
//! let job = Job::plain(integrator("nee").unwrap(), [64, 64], 4, 1);
//! let mut renderer = CpuRenderer::new(Arc::new(scene), job)?;
//! renderer.advance(64)?;
//! let picture = renderer.film().mean();
//!
//! // A convex body reflects the share of the sky's light that its reflectance states.
//! assert!((picture.at(32, 32)[1] - 0.5).abs() < 0.02);
//! assert_eq!(picture.at(0, 0), [1.0; 3]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`value`], [`math`] | values with schemas; mathematics, statistics, SIMD vectors |
//! | [`film`] | sums of samples: pictures, layers, time axes |
//! | [`scene`] | descriptions of scenes, loaders, compiled scenes |
//! | [`transport`] | BSDFs, lights, cameras, samplers and integrators |
//! | [`prelude`] | what a technique of another crate usually imports |

pub mod film;
pub mod math;
pub mod prelude;
pub mod scene;
pub mod transport;
pub mod value;
