//! Image parity: the same seed on a device and on the CPU gives nearly the same image, sample by sample; what differs is
//! rounding, and the few paths that it sends another way.

use std::sync::Arc;

use glam::Vec3;
use lumbre::film::Film;
use lumbre::render::vulkan::device::Device;
use lumbre::render::vulkan::program::Kind;
use lumbre::render::vulkan::renderer::VulkanRenderer;
use lumbre::render::vulkan::spirv::Sources;
use lumbre::render::{Job, Renderer};
use lumbre::scene::CompiledScene;
use lumbre::scene::compile::Model;

use super::harness;
use crate::common::{self, SceneBuilder, WHITE, grey, job, light};

/// The kinds that the device can do.
fn kinds(_device: &Device) -> Vec<Kind> {
    vec![Kind::Compute]
}

/// Renders `samples` samples on a device.
pub fn render(device: &Arc<Device>, kind: Kind, scene: &CompiledScene, job: &Job, samples: u64) -> Film {
    let mut renderer = VulkanRenderer::new(device, kind, &Sources::Embedded, scene, job).unwrap();
    let stats = renderer.advance(samples).unwrap();
    assert_eq!(stats.invalid, 0, "invalid samples, first at {:?}", stats.first_invalid);
    assert!(stats.rays >= stats.paths && stats.device_s > 0.0);
    renderer.film().clone()
}

/// What two films of the same samples may differ by.
fn compare(name: &str, found: &Film, expected: &Film) {
    assert_eq!(found.samples, expected.samples);
    let (a, b) = (found.mean(), expected.mean());
    let mean = b.data.as_flattened().iter().map(|x| f64::from(*x)).sum::<f64>() / (3 * b.data.len()) as f64;
    let mut squares = 0.0;
    let mut off = 0;
    for (x, y) in a.data.as_flattened().iter().zip(b.data.as_flattened()) {
        let d = f64::from(x - y);
        squares += d * d;
        off += usize::from(d.abs() > 0.01 * f64::from(y.abs()).max(mean));
    }
    let rmse = (squares / (3 * b.data.len()) as f64).sqrt() / mean;
    let means: f64 = a.data.as_flattened().iter().map(|x| f64::from(*x)).sum::<f64>() / (3 * a.data.len()) as f64;
    println!("{name}: mean {mean:.5}, relative RMSE {rmse:.1e}, {off} values off by more than 1 %");
    assert!(mean > 0.0, "{name}: black");
    assert!((means / mean - 1.0).abs() < 1e-3, "{name}: mean {means} instead of {mean}");
    assert!(rmse < 1e-3, "{name}: relative RMSE {rmse:e}");
    assert!(off as f64 <= 0.001 * (3 * b.data.len()) as f64, "{name}: {off} values are off by more than 1 %");
}

/// A closed room with a lamp, a glossy ball, a glass ball and a rough one.
fn room() -> Arc<CompiledScene> {
    let mut glass = grey(1.0);
    (glass.model, glass.opacity, glass.roughness) = (Model::Disney, 0.0, 0.3);
    let mut metal = grey(0.9);
    (metal.model, metal.metallic, metal.roughness) = (Model::Disney, 1.0, 0.2);
    let mut coated = grey(0.4);
    (coated.model, coated.clearcoat, coated.sheen, coated.anisotropic) = (Model::Disney, 1.0, 0.5, 0.5);
    SceneBuilder::new(Vec3::new(0.0, 0.0, 1.9), Vec3::ZERO, 60.0)
        .room(2.0, grey(0.7))
        .quad(Vec3::new(-0.5, 1.99, -0.5), Vec3::X, Vec3::Z, light(8.0))
        .quad(Vec3::new(-1.5, -1.0, -1.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0), coated)
        .sphere(Vec3::new(-0.7, -1.4, -0.5), 0.5, metal)
        .sphere(Vec3::new(0.8, -1.4, 0.0), 0.5, glass)
        .sphere(Vec3::new(0.0, 0.2, -1.0), 0.3, WHITE)
        .build()
}

#[test]
fn bpt_is_the_same_sample_by_sample() {
    let Some(device) = harness::device() else { return };
    let (scene, job) = (room(), Job { rr_start: Some(3), ..job([64, 36], 5, 1) });
    let expected = common::render(&scene, job.clone(), 16);
    for kind in kinds(&device) {
        let found = render(&device, kind, &scene, &job, 16);
        compare(&format!("bpt by {}", kind.backend()), &found, &expected);
    }
    harness::silent();
}
