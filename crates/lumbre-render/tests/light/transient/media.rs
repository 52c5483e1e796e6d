//! Arrival times in a medium around everything.

use glam::Vec3;
use lumbre_light::transport::time_settings::Timing;
use lumbre_render::Renderer;

use super::arrival::histogram;
use crate::common::{SceneBuilder, grey, light, render_waves, timed_job, timing};

/// Without other media, all times are the index times the lengths: light from lamps and from the
/// environment arrives in the same bins if these are wider by the index.
#[test]
fn a_medium_around_everything_scales_all_times() {
    let scene = SceneBuilder::new(Vec3::new(0.0, 0.4, 3.0), Vec3::ZERO, 60.0)
        .floor(1.0, -0.5, grey(0.7))
        .sphere(Vec3::new(0.0, 0.2, 0.0), 0.4, grey(0.6))
        .ceiling(0.4, 1.5, light(2.0))
        .environment(None, Vec3::splat(0.5), 0.0)
        .build();
    for name in ["bpt", "nee", "bdpt"] {
        for camera in [false, true] {
            let [plain, dense] = [1.0f32, 1.5].map(|medium| {
                let timing = Timing {
                    camera,
                    medium,
                    ..timing(0.0, 0.25 * f64::from(medium), 48)
                };
                let job = timed_job(name, timing, [12, 12], 4, 5);
                histogram(&render_waves(&scene, job, &[16]).times().unwrap())
            });
            let total: f64 = plain.iter().map(|(mean, _)| mean).sum();
            let off: f64 = plain
                .iter()
                .zip(&dense)
                .map(|(a, b)| (a.0 - b.0).abs())
                .sum();
            // Rounding may carry paths over the bounds of bins.
            assert!(
                total > 0.0 && off < 1e-3 * total,
                "{name}, {camera}: {off} of {total}"
            );
        }
    }
}
