//! Golden values of Mitsuba 3.9.1, `scalar_rgb`, and the maps.

use super::*;
use lumbre_light::scene::desc::Texels;

/// Elevations of the sun, turbidities and albedos of the rows of [`SKY`].
const SUNS: [f64; 3] = [8.0, 35.0, 70.0];
const TURBIDITIES: [f64; 3] = [2.0, 4.0, 8.0];
const ALBEDOS: [Vec3; 2] = [Vec3::splat(0.1), Vec3::new(0.8, 0.5, 0.3)];

/// Elevation and angle from the azimuth of the sun of the directions of a row, in degrees.
const DIRECTIONS: [[f64; 2]; 8] = [
    [2.0, 30.0],
    [10.0, 100.0],
    [20.0, 200.0],
    [30.0, 0.0],
    [45.0, 300.0],
    [60.0, 45.0],
    [75.0, 150.0],
    [89.0, 10.0],
];

/// Radiance of the emitter `sunsky` with `sun_scale` 0 in red, green and blue.
const SKY: [[f64; 24]; 18] = [
    [
        0.1674, 0.1516, 0.08726, 0.04902, 0.06679, 0.06795, 0.04235, 0.06046, 0.0719, 0.04715,
        0.05946, 0.06799, 0.01548, 0.02611, 0.03955, 0.01102, 0.01976, 0.03165, 0.00767, 0.01501,
        0.02558, 0.007141, 0.01419, 0.02446,
    ],
    [
        0.183, 0.1623, 0.09127, 0.05761, 0.07333, 0.07114, 0.04725, 0.06466, 0.07405, 0.05073,
        0.06279, 0.06975, 0.01777, 0.02825, 0.04083, 0.01265, 0.02144, 0.03273, 0.008926, 0.01643,
        0.02655, 0.008316, 0.01554, 0.0254,
    ],
    [
        0.2854, 0.2068, 0.09209, 0.05148, 0.06547, 0.06385, 0.04334, 0.0598, 0.06894, 0.1055,
        0.09769, 0.07992, 0.01973, 0.02983, 0.04055, 0.014, 0.02242, 0.03264, 0.009084, 0.01656,
        0.02635, 0.008553, 0.01565, 0.02525,
    ],
    [
        0.3043, 0.2185, 0.09556, 0.06127, 0.07177, 0.06648, 0.04913, 0.06369, 0.07066, 0.1102,
        0.1014, 0.08151, 0.02195, 0.03187, 0.04166, 0.01549, 0.02399, 0.03362, 0.01015, 0.0178,
        0.02723, 0.009539, 0.01685, 0.02612,
    ],
    [
        0.3009, 0.1919, 0.08151, 0.04825, 0.0529, 0.04939, 0.04611, 0.05792, 0.06194, 0.2154,
        0.1664, 0.09825, 0.03213, 0.03782, 0.04312, 0.02296, 0.02842, 0.03514, 0.01309, 0.01929,
        0.02768, 0.01275, 0.0184, 0.02668,
    ],
    [
        0.3152, 0.1983, 0.08399, 0.05774, 0.05769, 0.05135, 0.05141, 0.06044, 0.06321, 0.2191,
        0.1686, 0.09926, 0.0336, 0.03884, 0.04384, 0.02402, 0.02933, 0.03579, 0.01395, 0.02016,
        0.02827, 0.01356, 0.01927, 0.02727,
    ],
    [
        0.1666, 0.2223, 0.237, 0.06322, 0.1081, 0.164, 0.04569, 0.08247, 0.1393, 0.1094, 0.1444,
        0.1889, 0.02667, 0.04876, 0.0919, 0.02278, 0.04105, 0.07952, 0.01326, 0.0275, 0.06014,
        0.01452, 0.02874, 0.06157,
    ],
    [
        0.2347, 0.2745, 0.2668, 0.1035, 0.1415, 0.187, 0.06972, 0.1043, 0.1559, 0.1227, 0.1618,
        0.2031, 0.0372, 0.05994, 0.1019, 0.03057, 0.04982, 0.08791, 0.01959, 0.0348, 0.06748,
        0.0205, 0.03574, 0.06871,
    ],
    [
        0.2628, 0.278, 0.2512, 0.06997, 0.108, 0.1566, 0.04994, 0.08299, 0.1341, 0.3966, 0.4008,
        0.3518, 0.04239, 0.06228, 0.09968, 0.04147, 0.05777, 0.0907, 0.01888, 0.03332, 0.0633,
        0.02235, 0.03631, 0.06617,
    ],
    [
        0.3456, 0.3314, 0.2802, 0.1196, 0.1426, 0.1785, 0.07897, 0.1057, 0.1499, 0.4212, 0.425,
        0.3693, 0.05437, 0.07363, 0.1093, 0.04965, 0.06666, 0.09881, 0.02576, 0.04049, 0.07025,
        0.02865, 0.04321, 0.07297,
    ],
    [
        0.4013, 0.3538, 0.2785, 0.08342, 0.1045, 0.1327, 0.0558, 0.07863, 0.1159, 1.062, 0.9679,
        0.7416, 0.08599, 0.09991, 0.1228, 0.09776, 0.1092, 0.1237, 0.03353, 0.04732, 0.07205,
        0.04528, 0.05804, 0.0807,
    ],
    [
        0.5043, 0.411, 0.3037, 0.1466, 0.1406, 0.1506, 0.09286, 0.1024, 0.1286, 1.105, 1.005,
        0.7612, 0.1005, 0.1119, 0.1309, 0.1068, 0.1186, 0.131, 0.04159, 0.05517, 0.07784, 0.05243,
        0.0655, 0.08652,
    ],
    [
        0.1245, 0.1763, 0.2314, 0.07291, 0.1184, 0.195, 0.04324, 0.07774, 0.145, 0.04629, 0.08003,
        0.15, 0.03208, 0.05726, 0.1149, 0.04124, 0.06201, 0.1167, 0.02302, 0.04101, 0.08793,
        0.03562, 0.05276, 0.1019,
    ],
    [
        0.2374, 0.2618, 0.2815, 0.1402, 0.1768, 0.2356, 0.08261, 0.1152, 0.1742, 0.07335, 0.1098,
        0.1745, 0.04972, 0.07797, 0.1334, 0.05625, 0.08128, 0.1334, 0.03405, 0.055, 0.1017, 0.0474,
        0.06865, 0.1163,
    ],
    [
        0.1312, 0.1722, 0.2083, 0.07907, 0.1211, 0.193, 0.04848, 0.0829, 0.1493, 0.07279, 0.1078,
        0.1736, 0.05349, 0.0797, 0.1345, 0.1007, 0.1228, 0.1667, 0.04322, 0.06157, 0.106, 0.09237,
        0.1095, 0.1497,
    ],
    [
        0.2672, 0.2599, 0.2573, 0.1609, 0.1828, 0.2344, 0.09453, 0.1224, 0.1793, 0.1051, 0.1414,
        0.1993, 0.07333, 0.1028, 0.154, 0.1198, 0.1472, 0.1853, 0.0547, 0.07693, 0.1207, 0.1068,
        0.1291, 0.1659,
    ],
    [
        0.1626, 0.1761, 0.1771, 0.1022, 0.1327, 0.1801, 0.0685, 0.09753, 0.152, 0.1604, 0.1924,
        0.2378, 0.1245, 0.1497, 0.1914, 0.28, 0.3022, 0.3149, 0.1096, 0.1282, 0.1616, 0.2643,
        0.2818, 0.293,
    ],
    [
        0.329, 0.2657, 0.217, 0.213, 0.1976, 0.2151, 0.1342, 0.1398, 0.1775, 0.2071, 0.2273,
        0.2598, 0.1526, 0.1731, 0.2081, 0.3044, 0.3277, 0.3327, 0.1236, 0.1428, 0.1746, 0.2782,
        0.3009, 0.3093,
    ],
];

/// Elevation of the sun, turbidity, and radiance of the emitter `sunsky` with `sky_scale` 0 towards
/// the sun times the solid angle of its disk.
const SUN: [(f64, f64, [f64; 3]); 16] = [
    (3.5, 2.0, [0.57454, 0.22686, 0.02025]),
    (3.5, 4.0, [0.31165, 0.12287, 0.01336]),
    (3.5, 5.5, [0.18670, 0.07314, 0.00895]),
    (3.5, 8.0, [0.05412, 0.02010, 0.00290]),
    (8.0, 2.0, [0.99460, 0.55922, 0.15591]),
    (8.0, 4.0, [0.74277, 0.40647, 0.11500]),
    (8.0, 5.5, [0.56972, 0.30416, 0.08714]),
    (8.0, 8.0, [0.28383, 0.14197, 0.04218]),
    (35.0, 2.0, [1.46411, 1.17716, 0.81811]),
    (35.0, 4.0, [1.36376, 1.08812, 0.75928]),
    (35.0, 5.5, [1.27790, 1.01298, 0.70934]),
    (35.0, 8.0, [1.08106, 0.84206, 0.59520]),
    (70.0, 2.0, [1.53960, 1.30008, 1.01608]),
    (70.0, 4.0, [1.47429, 1.23907, 0.97093]),
    (70.0, 5.5, [1.41713, 1.18605, 0.93137]),
    (70.0, 8.0, [1.27957, 1.05934, 0.83668]),
];

/// Returns the direction at an elevation and an azimuth in degrees, of which 0 is +x.
fn towards([elevation, azimuth]: [f64; 2]) -> DVec3 {
    let (sin, cos) = elevation.to_radians().sin_cos();
    let (y, x) = azimuth.to_radians().sin_cos();
    DVec3::new(cos * x, sin, cos * y)
}

/// Returns a sky whose sun is at an elevation in degrees, without a disk.
fn sky(elevation: f64) -> DaySky {
    DaySky {
        sun: towards([elevation, 0.0]),
        turbidity: 3.0,
        albedo: Vec3::splat(0.3),
        sky_scale: 1.0,
        sun_irradiance: DVec3::ZERO,
        sun_radius: SUN_RADIUS,
        stretch: 1.0,
        extend: false,
    }
}

/// Returns the texels of a map in the frame of the sky, with direction and solid angle.
fn texels(day: &DaySky) -> Vec<(DVec3, f64, DVec3)> {
    let map = day.map(&DMat3::IDENTITY).unwrap();
    let Texels::RgbaF32(texels) = &map.texels else {
        panic!("floats expected")
    };
    let grid = Grid {
        width: map.width,
        height: map.height,
        to_sky: &DMat3::IDENTITY,
    };
    let color = |t: &[f32; 4]| DVec3::new(t[0].into(), t[1].into(), t[2].into());
    let places = grid.texels().zip(texels);
    let place = |((x, y), t)| (grid.center(x, y), grid.solid_angle(y), color(t));
    places.map(place).collect()
}

/// Returns the greatest relative difference of two colours, channel by channel.
fn difference(found: DVec3, expected: DVec3) -> f64 {
    (found / expected - 1.0).abs().max_element()
}

#[test]
fn radiance_of_the_sky_is_that_of_mitsuba() {
    let mut rows = SKY.iter();
    for elevation in SUNS {
        for turbidity in TURBIDITIES {
            for albedo in ALBEDOS {
                let day = DaySky {
                    turbidity,
                    albedo,
                    ..sky(elevation)
                };
                let state = SkyState::new(&SkyParams {
                    elevation: elevation.to_radians() as f32,
                    turbidity: turbidity as f32,
                    albedo: albedo.to_array(),
                });
                let state = state.unwrap();
                let (colors, _) = rows.next().unwrap().as_chunks::<3>();
                for (direction, expected) in DIRECTIONS.into_iter().zip(colors) {
                    let found = day.radiance(&state, towards(direction));
                    let error = difference(found, DVec3::from(*expected));
                    assert!(
                        error < 2e-3,
                        "{elevation} {turbidity} {direction:?}: {found}"
                    );
                }
            }
        }
    }
}

#[test]
fn irradiance_of_the_sun_is_that_of_mitsuba() {
    for (elevation, turbidity, expected) in SUN {
        let zenith = (90.0 - elevation).to_radians();
        let found = hosek_irradiance(zenith, turbidity);
        let error = difference(found, DVec3::from(expected));
        assert!(
            error < 0.01,
            "{elevation} {turbidity}: {found}, not {expected:?}"
        );
    }
}

#[test]
fn irradiance_by_preetham_is_that_of_a_second_program() {
    for (elevation, turbidity, expected) in [
        (35.0, 3.0, [1.20760, 0.96740, 0.73934]),
        (70.0, 8.0, [0.92978, 0.70606, 0.51180]),
    ] {
        let zenith = f64::to_radians(90.0 - elevation);
        let error = difference(
            preetham_irradiance(zenith, turbidity),
            DVec3::from(expected),
        );
        assert!(error < 2e-3, "{elevation} {turbidity}: {error}");
    }
}

#[test]
fn the_sun_is_where_mitsuba_has_it() {
    // Mitsuba rounds dates to quarters of a day: up to 0.05 degrees.
    let moment = |place, timezone, date, hours| Moment {
        place,
        timezone,
        date,
        hours,
    };
    for (moment, expected) in [
        (
            moment([35.6894, 139.6917], 9.0, [2010, 7, 10], 15.0),
            [0.051_385_4, 0.691_748, 0.720_308],
        ),
        (
            moment([-33.9, 18.4], 2.0, [2024, 2, 29], 9.5),
            [-0.226_473, -0.783_074, 0.579_228],
        ),
        (
            moment([51.5, -0.1], 0.0, [1999, 12, 21], 12.0),
            [0.965_624, 0.006_839_8, 0.259_852],
        ),
        (
            moment([64.1, -21.9], 0.0, [2025, 6, 1], 20.25),
            [-0.343_17, 0.904_668, 0.252_607],
        ),
    ] {
        let [zenith, azimuth] = moment.sun();
        // South is +x, west +y.
        let (east, north) = azimuth.sin_cos();
        let (sin, cos) = zenith.sin_cos();
        let found = DVec3::new(-north * sin, -east * sin, cos);
        let degrees = found.angle_between(DVec3::from(expected)).to_degrees();
        assert!(degrees < 0.06, "{moment:?}: {found}, {degrees} degrees off");
    }
}

#[test]
fn the_disk_of_the_sun_has_its_irradiance() {
    for (elevation, radius, share) in [
        (0.0, SUN_RADIUS, 0.5),
        (8.0, SUN_RADIUS, 1.0),
        (35.0, MIN_RADIUS, 1.0),
        (35.0, 20.0 * SUN_RADIUS, 1.0),
        (90.0, SUN_RADIUS, 1.0),
    ] {
        let day = DaySky {
            sky_scale: 0.0,
            sun_irradiance: DVec3::new(1.0, 2.0, 3.0),
            sun_radius: radius,
            ..sky(elevation)
        };
        let (mut power, mut center) = (DVec3::ZERO, DVec3::ZERO);
        for (d, solid_angle, color) in texels(&day) {
            power += color * solid_angle;
            center += d * color.x * solid_angle;
        }
        let error = difference(power, day.sun_irradiance * share);
        assert!(error < 1e-3, "{elevation}: {power}");
        let away = center.angle_between(day.sun).to_degrees();
        assert!(
            away < 0.02 || share < 1.0,
            "{elevation}: {away} degrees off"
        );
    }
}

#[test]
fn the_lower_half_is_black_unless_the_sky_is_stretched_or_extended() {
    let lit = |stretch: f64, extend: bool, y: f64| {
        let day = DaySky {
            stretch,
            extend,
            ..sky(35.0)
        };
        let below = texels(&day).into_iter().filter(|(d, ..)| d.y < y);
        below.fold(0.0f64, |sum, (_, _, color)| sum + color.x)
    };
    assert_eq!(lit(1.0, false, -0.005), 0.0);
    assert!(lit(1.0, false, 0.0) >= 0.0);
    assert!(lit(1.5, false, -0.1) > 0.0);
    assert_eq!(lit(1.5, false, -0.72), 0.0);
    assert!(lit(1.0, true, -0.9) > 0.0);
}

#[test]
fn a_stretched_sun_is_where_the_sky_is_brightest() {
    let day = DaySky {
        stretch: 1.5,
        ..sky(60.0)
    };
    let brightest = |day: &DaySky| {
        let high = texels(day).into_iter().filter(|(d, ..)| d.y > 0.3);
        high.max_by(|a, b| a.2.x.total_cmp(&b.2.x)).unwrap().0
    };
    let aureole = brightest(&day);
    assert!(
        aureole.angle_between(towards([45.0, 0.0])) < 0.01,
        "{aureole}"
    );
    let disk = brightest(&DaySky {
        sun_irradiance: DVec3::ONE,
        ..day
    });
    assert!(disk.angle_between(towards([45.0, 0.0])) < 0.01, "{disk}");
}
