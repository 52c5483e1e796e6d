//! `vulkan-compute` builds its hierarchy as requested, reports the result, and finds the same hits.

use glam::{Vec2, Vec3};
use lumbre_render::hierarchy::{AccelSpec, Builder, Quality};
use lumbre_render::{OpenStats, Renderer};
use lumbre_vulkan::context::device::Device;
use lumbre_vulkan::layout::TriangleAttributes;
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness;
use super::images::supported_modes;
use super::twins::RandomInputs;
use crate::common::{SceneBuilder, grey, job};

#[test]
fn hierarchies_are_built_as_requested_and_all_give_the_same_picture() {
    let device = or_return!(harness::integer_splat_device());
    if !supported_modes(&device).contains(&TracingMode::Compute) {
        return;
    }
    // No room encloses the triangles: within its large bounds, boxes in half precision would be too
    // coarse for the median cut to divide them further.
    let sky = Vec3::new(0.5, 1.0, 1.5);
    let mut b =
        SceneBuilder::new(Vec3::new(0.0, 0.0, 2.9), Vec3::ZERO, 60.0).environment(None, sky, 0.0);
    let mut corners = Vec::new();
    RandomInputs::rows(400, |d, _| {
        let a = d.vector(1.5);
        corners.push([a, a + d.vector(0.3), a + d.vector(0.3)]);
    });
    for corners in corners {
        b = b.triangle(corners, [Vec2::ZERO; 3], grey(0.5));
    }
    let scene = b.build();
    let plain = AccelSpec::default();
    let with = |spec: AccelSpec| -> (OpenStats, Vec<[f64; 3]>) {
        let job = job([24, 16], 3, 5).with(|settings| settings.accel = spec);
        let mut renderer = VulkanRenderer::new(
            &device,
            TracingMode::Compute,
            &harness::sources(),
            &scene,
            &job,
        )
        .unwrap();
        renderer.advance(2).unwrap();
        (renderer.open_stats().clone(), renderer.film().sum.clone())
    };
    let by = |builder: Builder, max_leaf: u32| {
        with(AccelSpec {
            builder,
            max_leaf,
            ..plain
        })
    };
    let (stats, picture) = with(plain);
    assert!(picture.iter().flatten().sum::<f64>() > 0.0);
    let none = by(Builder::None, 8);
    let [plane, sah, ploc, cwbvh] =
        [Builder::Plane, Builder::Sah, Builder::Ploc, Builder::Cwbvh].map(|b| by(b, 2));
    let fine = by(Builder::Sah, 1);
    let coarse = by(Builder::Sah, 32);
    let shallow = with(AccelSpec {
        builder: Builder::Sah,
        max_depth: 2,
        ..plain
    });
    let bins = with(AccelSpec {
        builder: Builder::Sah,
        bins: 2,
        max_leaf: 2,
        ..plain
    });
    let fast = with(AccelSpec {
        quality: Quality::Fastest,
        ..plain
    });
    let all = [
        &none, &plane, &sah, &ploc, &cwbvh, &fine, &coarse, &shallow, &bins, &fast,
    ];
    for (i, (found, film)) in all.into_iter().enumerate() {
        assert!(
            found.accel_build_s > 0.0 && found.accel_nodes > 0 && found.accel_bytes > 0,
            "{i}: {found:?}"
        );
        assert!(
            found.accel_cost > 1.0 && found.accel_cost.is_finite(),
            "{i}: {found:?}"
        );
        assert!(*film == picture, "{i}: the picture differs");
    }
    let cost = |of: &(OpenStats, Vec<[f64; 3]>)| of.0.accel_cost;
    assert!(
        cost(&none) > 400.0 && cost(&none) > 3.0 * cost(&plane),
        "{} {}",
        cost(&none),
        cost(&plane)
    );
    assert!(
        cost(&none) > 3.0 * cost(&sah) && cost(&shallow) > 1.5 * cost(&sah),
        "{}",
        cost(&shallow)
    );
    assert!(
        cost(&bins) != cost(&sah) && cost(&fine) != cost(&coarse),
        "bins and the size of leaves must change the cost"
    );
    assert_eq!(
        (ploc.0.accel_nodes, cost(&ploc)),
        (cwbvh.0.accel_nodes, cost(&cwbvh)),
        "this backend must build the same hierarchy for both"
    );
    assert!(
        cost(&fast) != stats.accel_cost,
        "the quality must change the cost"
    );
    harness::assert_no_validation_messages();
}

#[test]
fn an_acceleration_structure_may_exceed_the_size_limit_of_arrays() {
    let device = or_return!(harness::device());
    let kind = harness::fastest_to_compile(&device);
    if kind == TracingMode::Compute {
        crate::common::skipped(format_args!(
            "{} has no acceleration structures",
            device.info.line()
        ));
        return;
    }
    let mut b =
        SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 60.0).environment(None, Vec3::ONE, 0.0);
    for i in 0..4096 {
        let a = Vec3::new((i % 64) as f32, (i / 64) as f32, 0.0) / 32.0 - 1.0;
        b = b.triangle(
            [a, a + Vec3::X / 40.0, a + Vec3::Y / 40.0],
            [Vec2::ZERO; 3],
            grey(0.5),
        );
    }
    let scene = b.with(|s| {
        s.attributes.iter_mut().for_each(|a| a.material = 0);
        s.materials.truncate(1);
    });
    let scene = scene.build();
    let mut info = device.info.clone();
    // The limit is the size of the largest array of the scene.
    info.limits.storage_range = (scene.triangles.len() * size_of::<TriangleAttributes>()) as u64;
    let (range, narrow) = (
        info.limits.storage_range,
        Device::open(info, device.info.caps).unwrap(),
    );
    let job = job([24, 16], 3, 5);
    let mut renderer =
        VulkanRenderer::new(&narrow, kind, &harness::sources(), &scene, &job).unwrap();
    let bytes = renderer.open_stats().accel_bytes;
    renderer.advance(1).unwrap();
    println!("acceleration structures of {bytes} bytes with a limit of {range} for arrays");
    if bytes <= range && !device.info.software {
        crate::common::skipped(
            "the structures of this driver are smaller than the arrays of the scene",
        );
    } else {
        assert!(bytes > range, "the scene is too small for this test");
    }
    harness::assert_no_validation_messages();
}
