//! Indices of refraction by name.
//!
//! Indices of metals are given by channel of linear sRGB: measured spectra [Palik 1998; Johnson &
//! Christy 1972; Weaver & Frederikse 1995] integrated with the colour matching functions, as
//! published by Tungsten.

use glam::Vec3;

/// Name, eta and k of each metal.
const METALS: &[(&str, [f32; 3], [f32; 3])] = &[
    (
        "a-C",
        [2.9441, 2.22715, 1.96817],
        [0.887433, 0.799322, 0.815286],
    ),
    (
        "Ag",
        [0.155265, 0.116723, 0.138381],
        [4.82834, 3.12225, 2.14705],
    ),
    (
        "Al",
        [1.65746, 0.880369, 0.521229],
        [9.22387, 6.26952, 4.837],
    ),
    (
        "Au",
        [0.143119, 0.374957, 1.44248],
        [3.98316, 2.38572, 1.60322],
    ),
    (
        "Be",
        [4.18506, 3.18506, 2.78409],
        [3.83544, 3.01013, 2.86901],
    ),
    ("Cr", [4.36968, 2.9167, 1.6547], [5.20643, 4.23136, 3.75495]),
    (
        "Cu",
        [0.200438, 0.924033, 1.10221],
        [3.91295, 2.45285, 2.14219],
    ),
    (
        "Cu2O",
        [3.54928, 2.95206, 2.73692],
        [0.113218, 0.194666, 0.600168],
    ),
    (
        "CuO",
        [3.24536, 2.44963, 2.19741],
        [0.520274, 0.570737, 0.717225],
    ),
    (
        "Hg",
        [2.39893, 1.44003, 0.909551],
        [6.32763, 4.37194, 3.42179],
    ),
    (
        "Ir",
        [3.08641, 2.08218, 1.61789],
        [5.59215, 4.06718, 3.26726],
    ),
    (
        "K",
        [0.0640493, 0.0464101, 0.0381842],
        [2.10422, 1.34894, 0.913211],
    ),
    (
        "Li",
        [0.265787, 0.19561, 0.22092],
        [3.54017, 2.31113, 1.66859],
    ),
    ("Mo", [4.4837, 3.52546, 2.77608], [4.11113, 3.42087, 3.1506]),
    (
        "Na",
        [0.0602665, 0.0561412, 0.0619909],
        [3.17929, 2.11248, 1.57909],
    ),
    (
        "Nb",
        [3.42014, 2.79019, 2.39559],
        [3.44138, 2.73764, 2.57991],
    ),
    (
        "Ni",
        [2.36728, 1.66336, 1.46706],
        [4.49883, 3.05016, 2.34543],
    ),
    (
        "Rh",
        [2.5858, 1.86019, 1.55443],
        [6.78229, 4.70295, 3.97609],
    ),
    (
        "Ta",
        [2.06258, 2.39309, 2.62807],
        [2.40805, 1.74137, 1.94704],
    ),
    (
        "TiC",
        [3.70047, 2.83744, 2.5823],
        [3.26569, 2.35156, 2.17279],
    ),
    (
        "TiN",
        [1.64847, 1.15045, 1.37978],
        [3.36846, 1.94349, 1.10201],
    ),
    ("V", [4.27751, 3.51315, 2.76113], [3.49118, 2.88936, 3.1117]),
    (
        "VC",
        [3.65757, 2.75273, 2.53268],
        [3.06835, 2.19867, 1.96318],
    ),
    (
        "VN",
        [2.8656, 2.11918, 1.94008],
        [3.03233, 2.05611, 1.61629],
    ),
    ("W", [4.37099, 3.3003, 2.99827], [3.50068, 2.60487, 2.27319]),
];

/// Name and index of each dielectric: common tabulated values at the sodium line, of gases at
/// normal pressure.
const DIELECTRICS: &[(&str, f64)] = &[
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// Returns eta and k of a metal; `none` is a perfect mirror. Suffixes such as `_palik` are ignored.
pub(in crate::load) fn metal(name: &str) -> Option<(Vec3, Vec3)> {
    if name.eq_ignore_ascii_case("none") {
        return Some((Vec3::ZERO, Vec3::ONE));
    }
    let short = name.split('_').next().unwrap_or(name);
    let row = METALS.iter().find(|row| row.0 == short)?;
    Some((Vec3::from(row.1), Vec3::from(row.2)))
}

/// Returns the names of the metals, separated by commas.
pub(in crate::load) fn metal_names() -> String {
    METALS
        .iter()
        .map(|row| row.0)
        .collect::<Vec<_>>()
        .join(", ")
}

/// Returns the index of a dielectric, or `None` if the name is unknown.
pub(in crate::load) fn dielectric(name: &str) -> Option<f64> {
    DIELECTRICS
        .iter()
        .find(|row| row.0.eq_ignore_ascii_case(name.trim()))
        .map(|row| row.1)
}
