//! Position of the sun, and its irradiance through the air.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use crate::load::spectrum::{Sampled, to_srgb, xyz};

/// Mean angular radius of the sun in radians.
pub(in crate::load) const SUN_RADIUS: f64 = 0.5 * 0.5358 * PI / 180.0;

/// Returns the solid angle of a disk in steradians, for its angular radius in radians.
fn solid_angle(radius: f64) -> f64 {
    // Twice the square of the sine of a half is 1 minus the cosine without cancellation.
    2.0 * TAU * (0.5 * radius).sin().powi(2)
}

/// A time at a place.
#[derive(Clone, Copy, Debug)]
pub(in crate::load) struct Moment {
    /// Latitude and longitude in degrees, positive to the north and to the east.
    pub place: [f64; 2],
    /// Offset of the local time from universal time in hours.
    pub timezone: f64,
    /// Year, month and day of the Gregorian calendar.
    pub date: [i32; 3],
    /// Local time in hours.
    pub hours: f64,
}

impl Moment {
    /// Returns the angle of the sun from the zenith, and its azimuth from north towards east, in
    /// radians: the algorithm PSA [Blanco-Muriel et al. 2001, section 3].
    pub fn sun(&self) -> [f64; 2] {
        let hours = self.hours - self.timezone;
        let days = f64::from(days_since_2000(self.date)) - 0.5 + hours / 24.0;
        let node = 2.1429 - 0.001_039_459_4 * days;
        let anomaly = 6.240_06 + 0.017_201_969_9 * days;
        let longitude = 4.895_063
            + 0.017_202_791_698 * days
            + 0.033_416_07 * anomaly.sin()
            + 0.000_348_94 * (2.0 * anomaly).sin()
            - 0.000_113_4
            - 0.000_020_3 * node.sin();
        let obliquity = 0.409_092_8 - 6.214e-9 * days + 0.000_039_6 * node.cos();
        let ascension = (obliquity.cos() * longitude.sin()).atan2(longitude.cos());
        let declination = (obliquity.sin() * longitude.sin()).asin();
        let sidereal = 6.697_424_324_2 + 0.065_709_828_3 * days + hours;
        let [north, east] = self.place;
        let hour_angle = (15.0 * sidereal + east).to_radians() - ascension;
        let (sin, cos) = north.to_radians().sin_cos();
        let height = cos * hour_angle.cos() * declination.cos() + declination.sin() * sin;
        let zenith = height.clamp(-1.0, 1.0).acos();
        let azimuth = (-hour_angle.sin()).atan2(declination.tan() * cos - sin * hour_angle.cos());
        // Mean radius of the Earth over its distance from the sun.
        let parallax = 6_371.01 / 149_597_890.0 * zenith.sin();
        [zenith + parallax, azimuth]
    }
}

/// Returns the number of days from 2000-01-01 to a date of the Gregorian calendar.
fn days_since_2000([year, month, day]: [i32; 3]) -> i32 {
    // Years start in March, so that a leap day is the last of its year.
    let (year, month) = match month {
        ..=2 => (year - 1, month + 12),
        _ => (year, month),
    };
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    365 * year + leap_days + 306 * (month + 1) / 10 + day - 730_548
}

/// Bands of the direct light of the sun at 400 nm to 720 nm, 40 nm apart: irradiance above the air
/// in linear sRGB, optical depth of clear air at the zenith, and of haze relative to 520 nm.
///
/// Fitted to the solar radiance of Hosek & Wilkie 2013 with the weights by which Mitsuba 3.9.1
/// converts it to colours.
const BANDS: [([f64; 3], f64, f64); 9] = [
    ([0.00501, -0.00433, 0.03043], 0.4665, 0.8536),
    ([0.12236, -0.12212, 1.02489], 0.3190, 0.9353),
    ([-0.20022, 0.13079, 0.54188], 0.2257, 0.9811),
    ([-0.55516, 0.76426, -0.03516], 0.1638, 1.0),
    ([0.22091, 0.72166, -0.09271], 0.1217, 0.9887),
    ([1.38347, 0.08633, -0.03850], 0.0923, 0.9357),
    ([0.61885, -0.05539, -0.00563], 0.0713, 0.9049),
    ([0.06161, -0.00660, -0.00043], 0.0560, 0.8508),
    ([0.00357, -0.00039, -0.00002], 0.0445, 0.7970),
];

/// Optical depth of haze at 520 nm and the zenith for turbidities from 1 to 10, of the same fit.
const HAZE: [f64; 10] = [
    0.0, 0.0099, 0.0264, 0.0535, 0.0834, 0.1061, 0.1429, 0.2020, 0.2998, 0.4611,
];

/// Returns the irradiance of the sun on a surface that faces it, for its angle from the zenith in
/// radians and a turbidity from 1 to 10. Negative channels become 0.
///
/// The law of Beer and Lambert, fitted to the solar radiance of Hosek & Wilkie 2013: within 1.3 %
/// of Mitsuba 3.9.1 where the sun is at least 5 degrees high, 2 % at turbidity 10. As there, it is
/// linear between elevations 3 degrees apart and between turbidities, and constant below 2 degrees.
pub(in crate::load) fn hosek_irradiance(zenith: f64, turbidity: f64) -> DVec3 {
    let step = (((FRAC_PI_2 - zenith).to_degrees() - 2.0) / 3.0).clamp(0.0, 29.0);
    let elevation = |step: f64| 2.0 + 3.0 * step;
    let hazy = |step: f64| {
        let [a, b] = [turbidity.floor(), turbidity.ceil()];
        let [a, b] = [a, b].map(|turbidity| beer_lambert(elevation(step), turbidity));
        a.lerp(b, turbidity.fract())
    };
    let irradiance = hazy(step.floor()).lerp(hazy(step.ceil()), step.fract());
    irradiance.max(DVec3::ZERO)
}

/// Returns the irradiance for an elevation in degrees and a whole turbidity.
fn beer_lambert(elevation: f64, turbidity: f64) -> DVec3 {
    // Paths through the air relative to that from the zenith, in the form of Kasten & Young 1989.
    let mass = |a: f64, b: f64, c: f64| {
        let curvature = a * (elevation + b).powf(-c);
        1.0 / (elevation.to_radians().sin() + curvature)
    };
    let air = mass(0.969, 7.415, 1.652);
    let haze = HAZE[(turbidity as usize).clamp(1, 10) - 1] * mass(0.129, 2.269, 2.393);
    let band = |(color, clear, relative): ([f64; 3], f64, f64)| {
        DVec3::from(color) * (-clear * air - relative * haze).exp()
    };
    BANDS.into_iter().map(band).sum()
}

/// Radiance of the sun above the air in 100 W m^-2 sr^-1 nm^-1, from 380 nm to 750 nm, 10 nm apart
/// [Preetham et al. 1999, table 2].
const SOLAR: [f64; 38] = [
    165.5, 162.3, 211.3, 258.8, 258.2, 242.3, 267.6, 296.6, 305.4, 300.6, 306.6, 288.3, 287.1,
    278.2, 271.0, 272.3, 263.6, 255.0, 250.6, 253.1, 253.5, 251.3, 246.3, 241.7, 236.8, 232.1,
    228.2, 223.4, 219.7, 215.3, 211.0, 207.3, 202.4, 198.7, 194.3, 190.7, 186.3, 182.6,
];

/// Absorption by ozone in 1/cm at the wavelengths of [`SOLAR`], from the same table.
const OZONE: [f64; 38] = [
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.003, 0.006, 0.009, 0.014, 0.021, 0.030, 0.040, 0.048,
    0.063, 0.075, 0.085, 0.103, 0.120, 0.120, 0.115, 0.125, 0.120, 0.105, 0.090, 0.079, 0.067,
    0.057, 0.048, 0.036, 0.028, 0.023, 0.018, 0.014, 0.011, 0.010, 0.009,
];

/// Returns the irradiance of the sun on a surface that faces it [Preetham et al. 1999, appendix 1],
/// for its angle from the zenith in radians and a turbidity. Negative channels become 0.
///
/// Absorption by water vapour and mixed gases, beyond 689 nm, is left out: less than 0.2 %.
pub(in crate::load) fn preetham_irradiance(zenith: f64, turbidity: f64) -> DVec3 {
    let sampled = |values: [f64; 38]| {
        let pairs = values.into_iter().enumerate();
        Sampled::new(pairs.map(|(i, x)| [380.0 + 10.0 * i as f64, x]).collect())
    };
    let [sun, ozone] = [SOLAR, OZONE].map(sampled);
    let mass = 1.0 / (zenith.cos() + 0.15 * (93.885 - zenith.to_degrees()).powf(-1.253));
    let haze = 0.046_08 * turbidity - 0.045_86;
    let radiance = |nm: f64| {
        let micrometres = nm / 1000.0;
        let depth = 0.008_735 * micrometres.powf(-4.08)
            + haze * micrometres.powf(-1.3)
            + 0.35 * ozone.at(nm);
        100.0 * sun.at_or_zero(nm) * (-mass * depth).exp()
    };
    let irradiance = to_srgb() * xyz(radiance) * solid_angle(SUN_RADIUS);
    irradiance.max(DVec3::ZERO)
}
