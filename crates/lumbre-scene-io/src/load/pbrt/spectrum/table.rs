//! Spectra that pbrt knows by name.

/// Index of refraction of a metal by channel of linear sRGB, relative to air.
type Metal = (&'static str, [f32; 3], [f32; 3]);

/// Metals and oxides by pbrt's name: measured eta and k of refractiveindex.info, as in pbrt-v4,
/// weighted by D65 and the channels of linear sRGB. The reflectance of these at normal incidence
/// differs from that of the spectrum by at most 0.05 of the light (gold in red, which is outside of
/// sRGB), otherwise by 0.021.
pub(super) const METALS: [Metal; 7] = [
    ("Ag", [0.1285, 0.1235, 0.1509], [4.0649, 3.2863, 2.3918]),
    ("Al", [1.4074, 0.9267, 0.584], [7.7404, 6.6026, 5.3603]),
    ("Au", [0.0801, 0.4047, 1.5614], [3.3905, 2.5038, 1.7709]),
    ("Cu", [0.1045, 0.9782, 1.2047], [3.2733, 2.5924, 2.3692]),
    ("CuZn", [0.4184, 0.5199, 1.1231], [3.6678, 2.6808, 1.771]),
    ("MgO", [1.7337, 1.7409, 1.7535], [0.0, 0.0, 0.0]),
    ("TiO2", [2.8604, 2.9565, 3.1855], [0.0, 0.0, 0.0]),
];

/// Glasses by pbrt's name, and their index at the helium d line of 587.6 nm by Schott.
pub(super) const GLASSES: [(&str, f64); 11] = [
    ("glass-BK7", 1.5168),
    ("glass-BAF10", 1.67),
    ("glass-FK51A", 1.4866),
    ("glass-LASF9", 1.8503),
    ("glass-F5", 1.6727),
    ("glass-SF5", 1.6727),
    ("glass-F10", 1.7283),
    ("glass-SF10", 1.7283),
    ("glass-F11", 1.7847),
    ("glass-SF11", 1.7847),
    ("glass-LaSF9", 1.8503),
];

/// Illuminants by pbrt's name, and their chromaticities x and y [CIE 015:2018].
pub(super) const ILLUMINANTS: [(&str, [f64; 2]); 16] = [
    ("stdillum-A", [0.4476, 0.4074]),
    ("stdillum-D50", [0.3457, 0.3585]),
    ("stdillum-D65", [0.3127, 0.329]),
    ("stdillum-F1", [0.3131, 0.3373]),
    ("stdillum-F2", [0.3721, 0.3753]),
    ("stdillum-F3", [0.4091, 0.3943]),
    ("stdillum-F4", [0.4402, 0.4033]),
    ("stdillum-F5", [0.3138, 0.3453]),
    ("stdillum-F6", [0.3779, 0.3883]),
    ("stdillum-F7", [0.3129, 0.3293]),
    ("stdillum-F8", [0.3459, 0.3588]),
    ("stdillum-F9", [0.3742, 0.3728]),
    ("stdillum-F10", [0.3461, 0.359]),
    ("stdillum-F11", [0.3805, 0.3771]),
    ("stdillum-F12", [0.4369, 0.4044]),
    ("illum-acesD60", [0.3217, 0.3377]),
];
