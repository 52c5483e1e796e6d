//! Films with a time axis: light arrives in the pixels and bins that closed forms predict.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::time::{TimeCube, TimeFilter};
use lumbre_light::math::stats::{chi_square_p, normal_two_sided_p, sidak};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{DelayProfile, Delays, Material, MaterialComponent, Uv};
use lumbre_light::scene::desc::{DelayDesc, DelayKind};
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_light::transport::time_settings::Timing;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer};

use crate::common::{SceneBuilder, WHITE, grey, job, light, render_waves, timed_job, timing};

/// A filter without extent: every ray goes through the centre of its pixel.
const PIN: FilterSpec = FilterSpec {
    kind: FilterKind::Box,
    radius: 0.0,
};
const MIRROR: Material = Material {
    metallic: 1.0,
    ..WHITE
};
const GLASS: Material = Material {
    opacity: 0.0,
    ..WHITE
};

fn cube(scene: &Arc<CompiledScene>, job: Job, samples: u64) -> TimeCube {
    render_waves(scene, job, &[samples]).times().unwrap()
}

/// Returns the scene with some materials delayed, given by index.
fn delayed(builder: SceneBuilder, materials: &[usize], desc: &DelayDesc) -> SceneBuilder {
    builder.with(|s| {
        let mut delays = Delays {
            profiles: vec![DelayProfile::plain(desc)],
            ..Delays::default()
        };
        for row in 0..s.materials.len() {
            let own = u32::from(materials.contains(&row));
            delays.rows.push([delays.components.len() as u32, own]);
            if own == 1 {
                delays.components.push(MaterialComponent {
                    cumulative_weight: 1.0,
                    material: row as u32,
                    profiles: [0, 1],
                });
            }
        }
        s.delays = delays;
    })
}

fn constant(c: f32) -> DelayDesc {
    DelayDesc {
        kind: DelayKind::Constant,
        constant: [c, 0.0],
        ..DelayDesc::default()
    }
}

fn every_profile() -> Vec<DelayDesc> {
    vec![
        constant(1.5),
        DelayDesc {
            kind: DelayKind::Exponential,
            rate: [0.5, 0.0],
            ..DelayDesc::default()
        },
        DelayDesc {
            kind: DelayKind::Epanechnikov,
            mean: [2.0, 0.0],
            width: [1.0, 0.5],
            ..DelayDesc::default()
        },
        DelayDesc {
            kind: DelayKind::Table,
            table: vec![0.0, 0.0, 1.0, 2.0, 3.0, 1.0],
            ..DelayDesc::default()
        },
    ]
}

/// Returns a room with an area light, a glass ball, a light inside glass and a mirror ball; light
/// from a point and, through a hole, from the environment.
fn varied_room() -> SceneBuilder {
    let bulb = Vec3::new(-0.5, -0.55, 0.1);
    SceneBuilder::new(Vec3::new(0.0, 0.0, 2.6), Vec3::ZERO, 45.0)
        .floor(1.0, -1.0, grey(0.7))
        .quad(
            Vec3::new(-1.0, -1.0, -1.0),
            Vec3::X * 2.0,
            Vec3::Y * 2.0,
            grey(0.6),
        )
        .quad(
            Vec3::new(-1.0, -1.0, 1.0),
            Vec3::Z * -2.0,
            Vec3::Y * 2.0,
            Material {
                roughness: 0.3,
                ..grey(0.5)
            },
        )
        .ceiling(0.4, 0.98, light(4.0))
        .sphere(
            Vec3::new(0.45, -0.5, 0.0),
            0.4,
            Material {
                model: lumbre_light::scene::compile::Model::Disney,
                roughness: 0.35,
                ..GLASS
            },
        )
        .sphere(bulb, 0.35, GLASS)
        .sphere(bulb, 0.15, light(6.0))
        .point(Vec3::new(0.6, 0.6, 0.6), Vec3::splat(0.4))
        .directional(Vec3::new(-0.3, -1.0, -0.4), Vec3::splat(0.3))
        .environment(None, Vec3::splat(0.2), 0.0)
}

#[test]
fn slots_sum_to_the_film_and_have_the_same_bits_for_any_threads_waves_and_checkpoints() {
    let scene = delayed(varied_room(), &[0, 3], &every_profile()[1]).build();
    for row in INTEGRATORS {
        for filter in [TimeFilter::None, TimeFilter::Gauss(0.8)] {
            let timing = Timing {
                filter,
                ..timing(3.0, 0.25, 30)
            };
            let job = timed_job(row.name, timing, [10, 8], 5, 3).on_threads(1);
            let whole = render_waves(&scene, job.clone(), &[9]);
            let all = whole.times().unwrap();
            assert_eq!(all.steady(), whole.film().mean(), "{}", row.name);
            let sums: Vec<[f64; 3]> = (0..80)
                .map(|p| lumbre_light::film::time::sum_slots(all.slots(p % 10, p / 10)))
                .collect();
            assert_eq!(
                sums,
                whole.film().sum,
                "{}: the film is not the sum of its slots",
                row.name
            );
            assert!(all.sum.iter().any(|s| s[0] > 0.0) && all.slots(5, 5).len() == 32);
            for (threads, waves) in [(3, &[9u64][..]), (2, &[1, 2, 4, 2])] {
                let other = render_waves(&scene, job.clone().on_threads(threads), waves);
                assert!(
                    other.times().unwrap() == all,
                    "{}: {threads} threads, waves {waves:?}",
                    row.name
                );
                assert_eq!(other.film(), whole.film());
            }
            let before = render_waves(&scene, job.clone(), &[4]);
            let (mut state, mut after) = (
                Vec::new(),
                CpuRenderer::new(Arc::clone(&scene), job.clone()).unwrap(),
            );
            assert!(before.save(&mut state).unwrap());
            after.restore(&state).unwrap();
            after.advance(5).unwrap();
            assert!(
                after.times().unwrap() == all,
                "{}: from a checkpoint",
                row.name
            );
            assert!(
                CpuRenderer::new(Arc::clone(&scene), job)
                    .unwrap()
                    .restore(&state[..state.len() - 8])
                    .is_err()
            );
        }
    }
}

#[test]
fn time_axes_and_delays_do_not_change_the_picture() {
    for row in INTEGRATORS {
        let plain = job([10, 8], 5, 4);
        let plain = Job {
            integrator: row,
            ..plain
        };
        let untimed = render_waves(&varied_room().build(), plain.clone(), &[6]);
        for desc in every_profile() {
            let scene = delayed(varied_room(), &[0, 2, 3, 8], &desc).build();
            assert_eq!(
                render_waves(&scene, plain.clone(), &[6]).film(),
                untimed.film(),
                "{} {desc:?}",
                row.name
            );
            let timed = render_waves(
                &scene,
                plain
                    .clone()
                    .with(|settings| settings.timing = Some(timing(0.0, 0.5, 20))),
                &[6],
            );
            for (a, b) in timed
                .film()
                .sum
                .as_flattened()
                .iter()
                .zip(untimed.film().sum.as_flattened())
            {
                assert!(
                    (a - b).abs() <= 1e-6 * b.abs(),
                    "{} {desc:?}: {a} and {b}",
                    row.name
                );
            }
        }
    }
}

/// Returns the direction through the middle of every pixel of a square picture, for a camera that
/// looks along -z.
fn directions(size: u32, fov_deg: f32) -> impl Iterator<Item = ([u32; 2], Vec3)> {
    let half = (0.5 * fov_deg.to_radians()).tan();
    (0..size * size).map(move |i| {
        let at = [i % size, i / size];
        let film = at.map(|n| (2.0 * (n as f32 + 0.5) / size as f32 - 1.0) * half);
        (at, Vec3::new(film[0], -film[1], -1.0).normalize_or_zero())
    })
}

/// Panics unless all light of a pixel lies in the slot of this optical length, or in one beside it
/// where rounding may decide.
fn arrives_at(cube: &TimeCube, [x, y]: [u32; 2], length: f64, what: &str) {
    let slots = cube.slots(x, y);
    let total: f64 = slots.iter().map(|s| s[0]).sum();
    let place = cube.axis.bin_position(length);
    let near: f64 = [place - 1e-3, place + 1e-3]
        .map(|p| cube.axis.slot(p))
        .into_iter()
        .collect::<std::collections::BTreeSet<_>>()
        .into_iter()
        .map(|slot| slots[slot][0])
        .sum();
    let lit: Vec<usize> = slots
        .iter()
        .enumerate()
        .filter(|(_, s)| s[0] > 0.0)
        .map(|(i, _)| i)
        .collect();
    assert!(total > 0.0, "{what} {x} {y}: no light arrives");
    assert!(
        (near - total).abs() <= 1e-12 * total,
        "{what} {x} {y}: {lit:?} instead of {}",
        cube.axis.slot(place)
    );
}

#[test]
fn a_pulse_between_two_plates_arrives_after_the_length_of_its_path() {
    // Plates at z = -3 and z = 4 face each other. The camera is at the origin, a point light beside
    // it.
    let lamp = Vec3::new(1.2, 0.4, 0.5);
    let (near, far) = (-3.0f32, 4.0f32);
    let scene = SceneBuilder::new(Vec3::ZERO, -Vec3::Z, 50.0)
        .quad(
            Vec3::new(-40.0, -40.0, near),
            Vec3::X * 80.0,
            Vec3::Y * 80.0,
            grey(0.8),
        )
        .quad(
            Vec3::new(-40.0, -40.0, far),
            Vec3::Y * 80.0,
            Vec3::X * 80.0,
            grey(0.8),
        )
        .point(lamp, Vec3::ONE)
        .build();
    for name in ["nee", "bdpt"] {
        let job = |depth| {
            timed_job(name, timing(2.0, 0.05, 600), [9, 9], depth, 5)
                .with(|settings| settings.filter = PIN)
        };
        let direct = cube(&scene, job(2), 4);
        let twice = cube(&scene, job(3), 256);
        for (at, dir) in directions(9, 50.0) {
            let x = dir * (near / dir.z);
            let direct_length = f64::from(x.length() + x.distance(lamp));
            arrives_at(&direct, at, direct_length, name);
            // The shortest path over the far plate is as long as a straight one from the mirror
            // image of the light. No light arrives between the direct light and this.
            let image = Vec3::new(lamp.x, lamp.y, 2.0 * far - lamp.z);
            let first = f64::from(x.length() + x.distance(image));
            let slots = twice.slots(at[0], at[1]);
            let (direct_slot, first_slot) = (
                twice.axis.slot(twice.axis.bin_position(direct_length)),
                twice.axis.slot(twice.axis.bin_position(first)),
            );
            let lit: Vec<usize> = (0..slots.len()).filter(|i| slots[*i][0] > 0.0).collect();
            assert_eq!(lit[0], direct_slot, "{name}: direct light is not the first");
            assert!(
                lit[1] + 1 >= first_slot,
                "{name}: light before slot {first_slot}: {lit:?}"
            );
            assert!(
                lit[1] <= first_slot + 12,
                "{name}: no light soon after slot {first_slot}: {lit:?}"
            );
        }
    }
}

#[test]
fn paths_between_mirrors_have_the_length_of_the_unfolded_path() {
    // Mirrors at x = -1 and x = 1, an emitting wall at z = -10: the length of a path is 10 / cos
    // for any number of reflections.
    let scene = SceneBuilder::new(Vec3::new(0.3, 0.0, 0.0), Vec3::new(0.3, 0.0, -1.0), 60.0)
        .quad(
            Vec3::new(-1.0, -30.0, 1.0),
            Vec3::Z * -20.0,
            Vec3::Y * 60.0,
            MIRROR,
        )
        .quad(
            Vec3::new(1.0, -30.0, -19.0),
            Vec3::Z * 20.0,
            Vec3::Y * 60.0,
            MIRROR,
        )
        .quad(
            Vec3::new(-1.0, -30.0, -10.0),
            Vec3::X * 2.0,
            Vec3::Y * 60.0,
            light(1.0),
        )
        .build();
    for name in ["bpt", "nee"] {
        let cube = cube(
            &scene,
            timed_job(name, timing(9.0, 0.01, 400), [15, 15], 12, 6)
                .with(|settings| settings.filter = PIN),
            1,
        );
        for (at, dir) in directions(15, 60.0) {
            arrives_at(&cube, at, f64::from(10.0 / -dir.z), name);
        }
    }
}

#[test]
fn the_optical_length_in_glass_is_the_length_times_the_index() {
    // A slab of index 1.5 and thickness 2 across the view, an emitting wall behind it.
    let (thick, far, index) = (2.0f32, 7.0f32, 1.5f32);
    let slab = |z: f32, up: bool| {
        let (a, b) = (Vec3::X * 80.0, Vec3::Y * 80.0);
        (Vec3::new(-40.0, -40.0, z), if up { (a, b) } else { (b, a) })
    };
    let ((c0, (a0, b0)), (c1, (a1, b1))) = (slab(-2.0, true), slab(-2.0 - thick, false));
    let scene = SceneBuilder::new(Vec3::ZERO, -Vec3::Z, 60.0)
        .quad(c0, a0, b0, GLASS)
        .quad(c1, a1, b1, GLASS)
        .quad(
            Vec3::new(-40.0, -40.0, -far),
            Vec3::X * 80.0,
            Vec3::Y * 80.0,
            light(1.0),
        )
        .build();
    let medium = 1.25f32;
    for (name, camera, around) in [
        ("bpt", true, 1.0),
        ("nee", false, 1.0),
        ("bpt", true, medium),
    ] {
        let timing = Timing {
            camera,
            medium: around,
            ..timing(0.0, 0.01, 3000)
        };
        let cube = cube(
            &scene,
            timed_job(name, timing, [9, 9], 3, 7).with(|settings| settings.filter = PIN),
            16,
        );
        for (at, dir) in directions(9, 60.0) {
            let sin = (1.0 - dir.z * dir.z).sqrt();
            let inside = (1.0 - (sin / index) * (sin / index)).sqrt();
            let before = if camera { 2.0 / -dir.z } else { 0.0 };
            let length = around * (before + (far - 2.0 - thick) / -dir.z + index * thick / inside);
            arrives_at(&cube, at, f64::from(length), name);
        }
    }
}

#[test]
fn a_constant_delay_shifts_all_reflected_light_by_its_length() {
    let open = || {
        SceneBuilder::new(Vec3::new(0.0, 1.5, 2.0), Vec3::ZERO, 50.0)
            .floor(3.0, 0.0, grey(0.8))
            .ceiling(0.5, 2.5, light(5.0))
    };
    let axis = || timing(0.0, 0.25, 60);
    for row in INTEGRATORS {
        let job = |timing| timed_job(row.name, timing, [8, 8], 2, 8);
        let plain = cube(&open().build(), job(axis()), 64);
        // A delay of 2 shifts all reflected light by exactly eight bins of 0.25.
        let late = cube(
            &delayed(open(), &[0, 1], &constant(2.0)).build(),
            job(axis()),
            64,
        );
        let later = Timing {
            emission: Profile::Constant(2.0),
            ..axis()
        };
        let later = cube(&open().build(), job(later), 64);
        let mut moved = 0;
        for p in 0..64 {
            let (before, after) = (plain.slots(p % 8, p / 8), late.slots(p % 8, p / 8));
            assert_eq!(&before[1..50], &after[9..58], "{}: pixel {p}", row.name);
            assert!(after[..9].iter().all(|s| *s == [0.0; 3]));
            assert_eq!(
                after,
                later.slots(p % 8, p / 8),
                "{}: a delayed pulse instead of delayed materials",
                row.name
            );
            moved += before.iter().filter(|s| s[0] > 0.0).count();
        }
        assert!(moved > 64, "{}: {moved} slots with light", row.name);
    }
}

#[test]
fn the_histogram_of_paths_of_equal_length_is_the_delay_profile() {
    // A point light above a floor, seen through the centre of one pixel: all samples contribute
    // the same light with different delays.
    let lamp = Vec3::new(0.0, 2.0, 0.0);
    let floor = || {
        SceneBuilder::new(Vec3::new(0.0, 3.0, 4.0), Vec3::ZERO, 20.0)
            .floor(9.0, 0.0, grey(0.5))
            .point(lamp, Vec3::ONE)
    };
    let samples = 1u64 << 14;
    let alpha = sidak(1e-3, 4);
    for (i, desc) in every_profile().into_iter().enumerate().skip(1) {
        let job = timed_job("nee", timing(7.0, 0.1, 200), [1, 1], 2, 9 + i as u64)
            .with(|settings| settings.filter = PIN);
        let cube = cube(&delayed(floor(), &[0, 1], &desc).build(), job, samples);
        let slots = cube.slots(0, 0);
        let one = slots.iter().map(|s| s[0]).sum::<f64>() / samples as f64;
        let observed: Vec<f64> = slots.iter().map(|s| s[0] / one).collect();
        let profile = lumbre_light::transport::delay::profile_at(
            &DelayProfile::plain(&desc),
            &[],
            Uv::default(),
        );
        let below = |slot: usize| match slot {
            0 => 0.0,
            slot if slot == slots.len() => 1.0,
            slot => profile.cdf(cube.axis.bin_start(slot as u32 - 1) - 7.0),
        };
        let expected: Vec<f64> = (0..slots.len())
            .map(|s| (below(s + 1) - below(s)) * samples as f64)
            .collect();
        let p = chi_square_p(
            &observed.iter().map(|o| o.round()).collect::<Vec<_>>(),
            &expected,
            0,
        );
        assert!(p > alpha, "{desc:?}: {p}");
    }
}

/// Returns the light of the whole picture by slot, with its variance, as means over pixels and
/// channels.
pub fn histogram(cube: &TimeCube) -> Vec<(f64, f64)> {
    let n = f64::from(cube.width * cube.height) * 3.0;
    (0..cube.axis.slots())
        .map(|slot| {
            let (mut mean, mut variance) = (0.0, 0.0);
            for y in 0..cube.height {
                for x in 0..cube.width {
                    mean += cube
                        .mean(x, y, slot)
                        .iter()
                        .map(|v| f64::from(*v))
                        .sum::<f64>();
                    // Channels of one sample are not independent: their standard errors add up.
                    let sigma: f64 = cube
                        .variance_of_mean(x, y, slot)
                        .iter()
                        .map(|v| f64::from(*v).sqrt())
                        .sum();
                    variance += sigma * sigma;
                }
            }
            (mean / n, variance / (n * n))
        })
        .collect()
}

/// Returns the slots whose light differs between two histograms at the significance `alpha` for all
/// together.
pub fn differing(a: &[(f64, f64)], b: &[(f64, f64)], alpha: f64) -> Vec<(usize, f64, f64)> {
    let each = sidak(alpha, a.len());
    let pairs = a.iter().zip(b).enumerate();
    pairs
        .filter(|(_, ((x, v), (y, w)))| {
            let sigma = (v + w).sqrt();
            sigma > 0.0 && normal_two_sided_p((x - y) / sigma) < each
        })
        .map(|(slot, ((x, _), (y, _)))| (slot, *x, *y))
        .collect()
}

#[test]
fn integrators_agree_on_the_histogram_of_arrival_times() {
    // Rough and smooth glass, a light inside glass, a point light, a directional light, a constant
    // environment, a delayed wall.
    let scene = delayed(varied_room(), &[2, 3], &every_profile()[2]).build();
    let histogram = |name: &str, samples: u64| {
        let job = timed_job(name, timing(1.0, 0.4, 24), [12, 12], 6, 31)
            .with(|settings| settings.rr_start = Some(4));
        histogram(&cube(&scene, job, samples))
    };
    let (nee, bdpt) = (histogram("nee", 3000), histogram("bdpt", 900));
    assert!(
        nee.iter().filter(|(mean, _)| *mean > 1e-3).count() > 12,
        "too few bins have light: {nee:?}"
    );
    let found = differing(&nee, &bdpt, 1e-3);
    assert!(found.is_empty(), "{found:?}");
    // The test is sensitive: a shift of one bin is detected.
    assert!(!differing(&nee[1..], &bdpt[..bdpt.len() - 1], 1e-3).is_empty());
}
