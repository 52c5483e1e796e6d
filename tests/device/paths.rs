//! Path-vertex parity: many samples, step by step, on a device and on the CPU.

use std::sync::Arc;

use lumbre::render::Job;
use lumbre::render::cpu;
use lumbre::render::paths::{SampleAt, Step};
use lumbre::render::vulkan::program::Kind;
use lumbre::render::vulkan::renderer::VulkanRenderer;
use lumbre::render::vulkan::spirv::Sources;
use lumbre::transport::integrator::INTEGRATORS;

use super::harness::{self, slow, timing};
use super::images::{kinds, room, with};

/// Whether two steps are the same but for rounding.
fn alike(a: &Step, b: &Step) -> bool {
    let near = |a: glam::Vec3, b: glam::Vec3| (a - b).abs().max_element() <= 1e-3 * (1.0 + b.abs().max_element());
    match (a, b) {
        (Step::Closest { hit: x, .. }, Step::Closest { hit: y, .. }) => {
            let same = x.map(|hit| hit.primitive) == y.map(|hit| hit.primitive);
            same && a.vertex().is_some() == b.vertex().is_some()
                && a.vertex().zip(b.vertex()).is_none_or(|(a, b)| near(a, b))
        }
        (Step::Shadow { ray: r, blocked: x, .. }, Step::Shadow { ray: s, blocked: y, .. }) => {
            x == y && near(r.origin, s.origin) && near(r.dir, s.dir)
        }
        (Step::Light(c), Step::Light(d)) => {
            let scale = 0.01 * d.unweighted.abs().max_element().max(1e-3);
            (c.pixel, c.s, c.t) == (d.pixel, d.s, d.t)
                && (c.value - d.value).abs().max_element() <= scale
                && (c.length - d.length).abs() <= 1e-4 * d.length
        }
        _ => false,
    }
}

#[test]
fn samples_take_the_same_steps_to_the_same_vertices_on_every_backend() {
    let Some(device) = harness::device() else { return };
    // With a time axis and composed materials, whose numbers and lengths then are compared as well.
    let mut scene = room();
    slow(Arc::make_mut(&mut scene));
    for row in INTEGRATORS {
        let job = Job { resolution: [16, 12], timing: Some(timing(0.0, 1.0, 1)), ..with(row.name, 11) };
        let rows = (0..12u32).flat_map(|y| [(y, 0u64), (y, 5 + (u64::from(y) << 33))]);
        let samples: Vec<SampleAt> =
            rows.flat_map(|(y, sample)| (0..16).map(move |x| SampleAt { pixel: [x, y], sample })).collect();
        let expected = (cpu::ROW.paths)(&scene, &job, &samples).unwrap();
        let vertices: usize = expected.iter().flatten().filter(|step| step.vertex().is_some()).count();
        assert!(vertices > 2 * samples.len(), "{}: only {vertices} vertices", row.name);
        // Ray queries meet what pipelines meet: the pictures of both are the same to the bit.
        let able = |kind: &Kind| *kind == Kind::Pipeline || (*kind == Kind::Compute && row.name == "bpt");
        for kind in kinds(&device).into_iter().filter(able) {
            let mut renderer = VulkanRenderer::stepwise(&device, kind, &Sources::Embedded, &scene, &job).unwrap();
            let found = renderer.paths(&samples).unwrap();
            let same = |(a, b): &(&Vec<Step>, &Vec<Step>)| {
                a.len() == b.len() && a.iter().zip(b.iter()).all(|(a, b)| alike(a, b))
            };
            let pairs = || found.iter().zip(&expected);
            let off = pairs().filter(|pair| !same(pair)).count();
            println!("{} by {}: {off} of {} samples differ", row.name, kind.backend(), samples.len());
            // Rounding sends a path another way where it passes an edge.
            assert!(off * 100 <= samples.len(), "{} by {}: {off} samples differ", row.name, kind.backend());
        }
    }
    harness::silent();
}
