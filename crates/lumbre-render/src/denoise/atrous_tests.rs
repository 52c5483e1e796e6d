use super::*;

const SIZE: [u32; 2] = [48, 40];

/// Largest allowed ratio of the noise after filtering and before, inside of an even surface.
const FALL: f32 = 0.17;

/// The same beside an edge, where about half of the pixels can be averaged, and on fine texture.
const FALL_AT_EDGES: f32 = 1.5 * FALL;

/// Uniform random numbers in 0..1, by a linear congruential generator.
fn noise() -> impl FnMut() -> f32 {
    let mut state = 1u32;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    }
}

/// Pictures of a flat wall that faces the camera, with what guides the filter.
struct Scene {
    truth: Image,
    mean: Image,
    variance: Image,
    albedo: Image,
    normal: Image,
}

impl Scene {
    /// Adds uniform noise with this standard deviation, relative to the value, to `light` times
    /// `albedo`.
    fn noisy(
        deviation: f32,
        light: impl Fn(u32, u32) -> f32,
        albedo: impl Fn(u32, u32) -> [f32; 3],
    ) -> Scene {
        let [width, height] = SIZE;
        let albedo = Image::from_fn(width, height, &albedo);
        let truth = Image::from_fn(width, height, |x, y| {
            albedo.at(x, y).map(|a| a * light(x, y))
        });
        let mut random = noise();
        let factors = Image::from_fn(width, height, |_, _| {
            // A uniform distribution of width w has the standard deviation w / sqrt(12).
            [1.0 + deviation * 12f32.sqrt() * (random() - 0.5); 3]
        });
        let product = |x: u32, y: u32| {
            let (value, factor) = (truth.at(x, y), factors.at(x, y));
            [0, 1, 2].map(|c| value[c] * factor[c])
        };
        let variance = |x: u32, y: u32| truth.at(x, y).map(|v| (v * deviation).powi(2));
        Scene {
            mean: Image::from_fn(width, height, product),
            variance: Image::from_fn(width, height, variance),
            normal: Image::from_fn(width, height, |_, _| [0.0, 0.0, 1.0]),
            albedo,
            truth,
        }
    }

    fn filtered(&self) -> Image {
        filter(
            &AtrousSettings::default(),
            Guided {
                mean: &self.mean,
                variance: &self.variance,
                samples: 16,
                albedo: &self.albedo,
                normal: &self.normal,
            },
        )
    }

    /// Root mean square error over pixels whose column `keeps`, relative to the true value.
    fn error(&self, image: &Image, keeps: impl Fn(u32) -> bool) -> f32 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (i, (value, truth)) in image.data.iter().zip(&self.truth.data).enumerate() {
            if keeps(i as u32 % SIZE[0]) {
                sum += (value[1] / truth[1] - 1.0).powi(2);
                count += 1.0;
            }
        }
        (sum / count).sqrt()
    }
}

fn grey(_: u32, _: u32) -> [f32; 3] {
    [0.5, 0.4, 0.3]
}

/// The two columns beside the middle.
fn beside_the_middle(x: u32) -> bool {
    x == SIZE[0] / 2 - 1 || x == SIZE[0] / 2
}

#[test]
fn a_constant_picture_keeps_its_bits() {
    let scene = Scene::noisy(0.0, |_, _| 1.7, grey);
    let spread = Image::from_fn(SIZE[0], SIZE[1], |x, _| [0.3 * x as f32; 3]);
    let scene = Scene {
        variance: spread,
        ..scene
    };
    assert_eq!(scene.filtered(), scene.mean);
}

#[test]
fn a_picture_without_variance_keeps_its_bits() {
    let scene = Scene::noisy(0.0, |x, y| 1.0 + 0.01 * (x * y) as f32, grey);
    assert_eq!(scene.filtered(), scene.mean);
}

#[test]
fn noise_falls_by_the_root_of_the_pixels_that_are_averaged() {
    let scene = Scene::noisy(0.2, |_, _| 1.0, grey);
    let [before, after] =
        [&scene.mean, &scene.filtered()].map(|image| scene.error(image, |_| true));
    assert!((before / 0.2 - 1.0).abs() < 0.05, "{before}");
    assert!(after < FALL * before, "{before} {after}");
}

#[test]
fn edges_of_albedo_are_kept() {
    let checks = |x: u32, _: u32| {
        if x < SIZE[0] / 2 {
            [0.8, 0.7, 0.1]
        } else {
            [0.1, 0.2, 0.9]
        }
    };
    let scene = Scene::noisy(0.2, |_, _| 1.0, checks);
    let after = scene.error(&scene.filtered(), beside_the_middle);
    assert!(after < FALL_AT_EDGES * 0.2, "{after}");
}

#[test]
fn fine_texture_is_kept_while_its_noise_falls() {
    let texture = |x: u32, y: u32| {
        let value = if (x + y).is_multiple_of(2) {
            0.45
        } else {
            0.55
        };
        [value; 3]
    };
    let scene = Scene::noisy(0.2, |_, _| 1.0, texture);
    let after = scene.error(&scene.filtered(), |_| true);
    assert!(after < FALL_AT_EDGES * 0.2, "{after}");
}

#[test]
fn an_edge_of_light_is_kept_where_it_exceeds_the_noise() {
    let light = |x: u32, _: u32| if x < SIZE[0] / 2 { 1.0 } else { 5.0 };
    let scene = Scene::noisy(0.02, light, grey);
    let [before, after] =
        [&scene.mean, &scene.filtered()].map(|image| scene.error(image, beside_the_middle));
    assert!(after < before, "{before} {after}");
}

#[test]
fn a_line_of_light_that_no_feature_shows_is_kept() {
    let light = |x: u32, _: u32| if x == SIZE[0] / 2 { 1.6 } else { 1.0 };
    let scene = Scene::noisy(0.1, light, grey);
    let line = |x: u32| x == SIZE[0] / 2;
    let [before, after] = [&scene.mean, &scene.filtered()].map(|image| scene.error(image, line));
    assert!(after < before, "{before} {after}");
}

#[test]
fn noise_falls_beside_a_firefly_and_so_does_the_firefly() {
    let mut scene = Scene::noisy(0.2, |_, _| 1.0, grey);
    let (place, firefly) = ((SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2) as usize, 20.0);
    for c in 0..3 {
        // All of it comes from one sample, so its standard error is its value.
        let value = firefly * scene.truth.data[place][c];
        scene.mean.data[place][c] += value;
        scene.variance.data[place][c] += value * value;
    }
    let mut filtered = scene.filtered();
    let error = |value: [f32; 3]| (value[1] / scene.truth.data[place][1] - 1.0).abs();
    assert!(error(filtered.data[place]) < 0.1 * firefly);
    filtered.data[place] = scene.truth.data[place];
    let near = |x: u32| x.abs_diff(SIZE[0] / 2) < 4;
    let after = scene.error(&filtered, near);
    assert!(after < FALL_AT_EDGES * 0.2, "{after}");
}

#[test]
fn pixels_without_variance_by_chance_are_filtered_with_the_others() {
    let mut scene = Scene::noisy(0.0, |_, _| 1.0, grey);
    let mut random = noise();
    for (i, truth) in scene.truth.data.iter().enumerate() {
        // A quarter of the pixels have found a rare light, each by one sample.
        let value = if random() < 0.25 { 4.0 } else { 0.0 };
        scene.mean.data[i] = truth.map(|x| value * x);
        scene.variance.data[i] = truth.map(|x| (value * x).powi(2));
    }
    let [before, after] =
        [&scene.mean, &scene.filtered()].map(|image| scene.error(image, |_| true));
    assert!(after < FALL_AT_EDGES * before, "{before} {after}");
}

#[test]
fn surfaces_with_other_normals_are_not_mixed() {
    let light = |x: u32, _: u32| if x < SIZE[0] / 2 { 1.0 } else { 1.3 };
    let mut scene = Scene::noisy(0.3, light, grey);
    let blurred = scene.error(&scene.filtered(), beside_the_middle);
    scene.normal = Image::from_fn(SIZE[0], SIZE[1], |x, _| {
        if x < SIZE[0] / 2 {
            [0.0, 0.0, 1.0]
        } else {
            [0.6, 0.0, 0.8]
        }
    });
    let kept = scene.error(&scene.filtered(), beside_the_middle);
    let limit = FALL_AT_EDGES * 0.3;
    assert!(blurred > limit && kept < limit, "{blurred} {kept}");
}

#[test]
fn few_samples_take_the_noise_from_their_neighbours() {
    let mut scene = Scene::noisy(0.2, |_, _| 1.0, grey);
    scene.variance = Image::new(SIZE[0], SIZE[1]);
    let after = |samples: u64| {
        let input = Guided {
            mean: &scene.mean,
            variance: &scene.variance,
            samples,
            albedo: &scene.albedo,
            normal: &scene.normal,
        };
        scene.error(&filter(&AtrousSettings::default(), input), |_| true)
    };
    assert!(after(1) < FALL * 0.2, "{}", after(1));
    assert_eq!(after(FEW_SAMPLES), scene.error(&scene.mean, |_| true));
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let light = |x: u32, y: u32| 1.0 + (x as f32 * 0.3).sin() * (y as f32 * 0.2).cos();
    let scene = Scene::noisy(0.3, light, grey);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| scene.filtered())
    };
    let bits = |image: &Image| -> Vec<u32> {
        let values = image.data.as_flattened().iter();
        values.map(|x| x.to_bits()).collect()
    };
    let one = bits(&on(1));
    assert!([2, 7].iter().all(|threads| bits(&on(*threads)) == one));
}

#[test]
fn settings_read_back_and_the_table_has_their_defaults() {
    let changed = AtrousSettings {
        levels: 3,
        sigma_luminance: 1.5,
        sigma_albedo: 0.25,
        normal_power: 0.0,
    };
    assert_eq!(AtrousSettings::from_map(&changed.to_map()), changed);
    let default = AtrousSettings::default().to_map();
    for field in ATROUS.fields {
        let value = default[field.key].as_f64().unwrap();
        assert_eq!(
            value as f32,
            field.default.parse::<f32>().unwrap(),
            "{}",
            field.key
        );
    }
    ATROUS.check("atrous", &default).unwrap();
}

#[test]
fn a_picture_that_is_four_times_as_bright_becomes_four_times_as_bright() {
    let light = |x: u32, y: u32| 1.0 + (x as f32 * 0.4).sin() * (y as f32 * 0.3).cos();
    let scene = Scene::noisy(0.3, light, grey);
    let scaled = |image: &Image, factor: f32| {
        Image::from_fn(SIZE[0], SIZE[1], |x, y| image.at(x, y).map(|v| v * factor))
    };
    // The variance is in units of the square of the picture.
    let bright = Scene {
        mean: scaled(&scene.mean, 4.0),
        variance: scaled(&scene.variance, 16.0),
        ..Scene::noisy(0.3, light, grey)
    };
    // Powers of two leave all digits alone.
    assert_eq!(bright.filtered(), scaled(&scene.filtered(), 4.0));
    assert_ne!(scene.filtered(), scene.mean);
}

#[test]
fn the_variance_after_a_pass_is_that_of_the_means_of_independent_pixels() {
    let size = Size {
        width: 96,
        height: 96,
    };
    let mut random = noise();
    // Uniform numbers of width 1 have the variance 1 / 12.
    let pixels: Vec<Pixel> = (0..size.width * size.height)
        .map(|_| Pixel {
            light: [1.0 + random(); 3],
            variance: 1.0 / 12.0,
        })
        .collect();
    let surfaces = vec![Surface::default(); pixels.len()];
    // Differences of luminance count nothing.
    let settings = AtrousSettings {
        sigma_luminance: 1e6,
        ..AtrousSettings::default()
    };
    let after = pass(&settings, size, 1, &pixels, &surfaces);
    let inside: Vec<&Pixel> = (4..size.height - 4)
        .flat_map(|y| (4..size.width - 4).map(move |x| (y * size.width + x) as usize))
        .map(|i| &after[i].pixel)
        .collect();
    let n = inside.len() as f32;
    let mean = inside.iter().map(|p| p.light[1]).sum::<f32>() / n;
    let found = inside
        .iter()
        .map(|p| (p.light[1] - mean).powi(2))
        .sum::<f32>()
        / n;
    let stated = inside.iter().map(|p| p.variance).sum::<f32>() / n;
    // Some 600 independent neighbourhoods: a standard error of 6 %.
    assert!(
        (stated / found - 1.0).abs() < 0.25,
        "{stated} is stated, {found} is found"
    );
}
