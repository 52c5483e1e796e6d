//! Path-vertex parity: many samples, step by step, on a device and on the CPU.

use std::sync::Arc;

use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_render::Job;
use lumbre_render::cpu;
use lumbre_render::path_trace::{PathEvent, SampleAt};
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness::{self, add_delays, timing};
use super::images::{room, supported_modes, technique_job};

/// Returns whether two steps are the same apart from rounding.
fn same_step(a: &PathEvent, b: &PathEvent) -> bool {
    let near = |a: glam::Vec3, b: glam::Vec3| {
        (a - b).abs().max_element() <= 1e-3 * (1.0 + b.abs().max_element())
    };
    match (a, b) {
        (PathEvent::Closest { hit: x, .. }, PathEvent::Closest { hit: y, .. }) => {
            let same = x.map(|hit| hit.primitive) == y.map(|hit| hit.primitive);
            same && a.vertex().is_some() == b.vertex().is_some()
                && a.vertex().zip(b.vertex()).is_none_or(|(a, b)| near(a, b))
        }
        (
            PathEvent::Shadow {
                ray: r, blocked: x, ..
            },
            PathEvent::Shadow {
                ray: s, blocked: y, ..
            },
        ) => x == y && near(r.origin, s.origin) && near(r.dir, s.dir),
        (PathEvent::Light(c), PathEvent::Light(d)) => {
            let scale = 0.01 * d.unweighted.abs().max_element().max(1e-3);
            (c.pixel, c.s, c.t) == (d.pixel, d.s, d.t)
                && (c.value - d.value).abs().max_element() <= scale
                && (c.length - d.length).abs() <= 1e-4 * d.length
        }
        _ => false,
    }
}

#[test]
fn samples_have_the_same_steps_and_vertices_on_every_backend() {
    let device = or_return!(harness::device());
    // The job has a time axis and composed materials, so their sample numbers and optical lengths
    // are compared as well.
    let mut scene = room();
    add_delays(Arc::make_mut(&mut scene));
    for row in INTEGRATORS.iter().filter(|row| harness::renders(row)) {
        let job = Job {
            resolution: [16, 12],
            ..technique_job(row.name, 11)
        }
        .with(|settings| settings.timing = Some(timing(0.0, 1.0, 1)));
        let rows = (0..12u32).flat_map(|y| [(y, 0u64), (y, 5 + (u64::from(y) << 33))]);
        let samples: Vec<SampleAt> = rows
            .flat_map(|(y, sample)| {
                (0..16).map(move |x| SampleAt {
                    pixel: [x, y],
                    sample,
                })
            })
            .collect();
        let expected = (cpu::ROW.paths)(&scene, &job, &samples).unwrap();
        let vertices: usize = expected
            .iter()
            .flatten()
            .filter(|step| step.vertex().is_some())
            .count();
        assert!(
            vertices > 2 * samples.len(),
            "{}: only {vertices} vertices",
            row.name
        );
        // Ray queries find the same hits as pipelines: their pictures have the same bits.
        let able = |kind: &TracingMode| {
            *kind == TracingMode::Pipeline || (*kind == TracingMode::Compute && row.name == "bpt")
        };
        for kind in supported_modes(&device).into_iter().filter(able) {
            let mut renderer =
                VulkanRenderer::recording(&device, kind, &harness::sources(), &scene, &job)
                    .unwrap();
            let found = renderer.paths(&samples).unwrap();
            let same = |(a, b): &(&Vec<PathEvent>, &Vec<PathEvent>)| {
                a.len() == b.len() && a.iter().zip(b.iter()).all(|(a, b)| same_step(a, b))
            };
            let pairs = || found.iter().zip(&expected);
            let off = pairs().filter(|pair| !same(pair)).count();
            println!(
                "{} by {}: {off} of {} samples differ",
                row.name,
                kind.backend(),
                samples.len()
            );
            // Rounding makes a path diverge where it passes an edge.
            assert!(
                off * 100 <= samples.len(),
                "{} by {}: {off} samples differ",
                row.name,
                kind.backend()
            );
        }
    }
    harness::assert_no_validation_messages();
}
