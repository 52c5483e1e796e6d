//! Colour spaces for perceptual differences: linear sRGB, CIELAB, and YCxCz, an opponent space that
//! is CIELAB without its nonlinear curve.
//!
//! XYZ is divided by the white point of sRGB throughout, so white is (1, 1, 1).

/// Matrix from linear sRGB (D65) to XYZ, from exact fractions of the primaries' chromaticities, as
/// in the program of the FLIP authors.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [
        10_135_552.0 / 24_577_794.0,
        8_788_810.0 / 24_577_794.0,
        4_435_075.0 / 24_577_794.0,
    ],
    [
        2_613_072.0 / 12_288_897.0,
        8_788_810.0 / 12_288_897.0,
        887_015.0 / 12_288_897.0,
    ],
    [
        1_425_312.0 / 73_733_382.0,
        8_788_810.0 / 73_733_382.0,
        70_074_185.0 / 73_733_382.0,
    ],
];

const TO_XYZ: [[f64; 3]; 3] = rows_sum_to_one(XYZ_FROM_RGB);
const TO_XYZ_F32: [[f32; 3]; 3] = single(TO_XYZ);
const TO_RGB_F32: [[f32; 3]; 3] = single(inverse(TO_XYZ));

const fn rows_sum_to_one(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut out = m;
    let mut r = 0;
    while r < 3 {
        let white = m[r][0] + m[r][1] + m[r][2];
        out[r] = [m[r][0] / white, m[r][1] / white, m[r][2] / white];
        r += 1;
    }
    out
}

const fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut adjugate = [[0.0; 3]; 3];
    let mut r = 0;
    while r < 3 {
        let mut c = 0;
        while c < 3 {
            let (a, b, d, e) = ((c + 1) % 3, (c + 2) % 3, (r + 1) % 3, (r + 2) % 3);
            adjugate[r][c] = m[a][d] * m[b][e] - m[a][e] * m[b][d];
            c += 1;
        }
        r += 1;
    }
    let determinant =
        m[0][0] * adjugate[0][0] + m[0][1] * adjugate[1][0] + m[0][2] * adjugate[2][0];
    let mut i = 0;
    while i < 9 {
        adjugate[i / 3][i % 3] /= determinant;
        i += 1;
    }
    adjugate
}

const fn single(m: [[f64; 3]; 3]) -> [[f32; 3]; 3] {
    let mut out = [[0.0; 3]; 3];
    let mut i = 0;
    while i < 9 {
        out[i / 3][i % 3] = m[i / 3][i % 3] as f32;
        i += 1;
    }
    out
}

fn times(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Converts linear sRGB to unscaled YCxCz: Y is in 0..=1 instead of -16..=100, Cx is X - Y and Cz
/// is Y - Z.
///
/// The scales and the offset of the published space have no effect on linear filters that preserve
/// constants, but in single precision the offset of 16 would cost dark pixels their last digits.
pub fn opponent(rgb: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = times(&TO_XYZ_F32, rgb);
    [y, x - y, y - z]
}

/// Converts unscaled YCxCz to linear sRGB. Values outside 0..=1 cannot be displayed.
pub fn from_opponent([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    times(&TO_RGB_F32, [y + cx, y, y - cz])
}

/// Argument at which the curve of CIELAB changes from linear to a cube root.
const DELTA: f32 = 6.0 / 29.0;

/// Converts linear sRGB in 0..=1 to CIELAB.
pub fn lab(rgb: [f32; 3]) -> [f32; 3] {
    let compress = |t: f32| {
        if t > DELTA * DELTA * DELTA {
            cube_root(t)
        } else {
            t / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    };
    let [x, y, z] = times(&TO_XYZ_F32, rgb).map(compress);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Cube root of a positive normal number, with a relative error of at most 3e-7: an estimate from
/// the exponent bits and two steps of Halley's method, three times as fast as the library's.
fn cube_root(x: f32) -> f32 {
    // Dividing the bits by three divides the exponent by three; the constant restores its bias and
    // balances the error.
    let mut y = f32::from_bits(x.to_bits() / 3 + 709_921_077);
    for _ in 0..2 {
        let cube = y * y * y;
        y *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    y
}

/// Converts CIELAB to linear sRGB. Values outside 0..=1 cannot be displayed.
pub fn from_lab([l, a, b]: [f32; 3]) -> [f32; 3] {
    let y = (l + 16.0) / 116.0;
    let expand = |t: f32| {
        if t > DELTA {
            t * t * t
        } else {
            (t - 4.0 / 29.0) * 3.0 * DELTA * DELTA
        }
    };
    times(&TO_RGB_F32, [y + a / 500.0, y, y - b / 200.0].map(expand))
}

/// Converts linear sRGB in 0..=1 to CIELAB with a and b scaled by L / 100, since colour differences
/// matter less in the dark [Hunt 2004].
pub fn hunt_lab(rgb: [f32; 3]) -> [f32; 3] {
    let [l, a, b] = lab(rgb);
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// HyAB distance: city-block in lightness, Euclidean in a and b [Abasi 2020].
pub fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [da, db] = [a[1] - b[1], a[2] - b[2]];
    (a[0] - b[0]).abs() + (da * da + db * db).sqrt()
}

/// Largest HyAB distance of two displayable colours after Hunt's adjustment, which is that of green
/// and blue.
pub fn largest_distance() -> f32 {
    hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_come_back_and_white_is_neutral() {
        for ([l, a, b], white) in [(opponent([1.0; 3]), 1.0), (lab([1.0; 3]), 100.0)] {
            assert!(
                (l - white).abs() < 1e-4 && a.abs() < 1e-4 && b.abs() < 1e-4,
                "{l} {a} {b}"
            );
        }
        for rgb in [
            [0.2, 0.7, 0.1],
            [1.0, 0.0, 0.5],
            [0.01, 0.02, 0.9],
            [0.001; 3],
        ] {
            for back in [from_opponent(opponent(rgb)), from_lab(lab(rgb))] {
                assert!(
                    back.iter().zip(rgb).all(|(a, b)| (a - b).abs() < 2e-6),
                    "{back:?} {rgb:?}"
                );
            }
        }
    }

    #[test]
    fn cube_roots_are_those_of_the_library() {
        let mut x = 1e-6f32;
        while x < 1.5 {
            assert!((cube_root(x) / x.cbrt() - 1.0).abs() < 3e-7, "{x}");
            x *= 1.001;
        }
        assert!(cube_root(f32::NAN).is_nan());
    }

    #[test]
    fn lab_of_known_colours() {
        // CIELAB of sRGB blue is (32.30, 79.19, -107.86).
        let blue = lab([0.0, 0.0, 1.0]);
        for (value, expected) in blue.iter().zip([32.30, 79.19, -107.86]) {
            assert!((value - expected).abs() < 0.03, "{value} {expected}");
        }
        // No two corners of the display's cube are further apart than green and blue.
        let corner = |i: u32| hunt_lab([0, 1, 2].map(|c| (i >> c & 1) as f32));
        let furthest = (0..64)
            .map(|i| hyab(corner(i / 8), corner(i % 8)))
            .fold(0.0, f32::max);
        assert_eq!(furthest, largest_distance());
    }
}
