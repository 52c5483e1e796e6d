//! Primaries of colour spaces, and maps of their colours to linear sRGB.

use exr::meta::attribute::Chromaticities;
use glam::{DMat3, DVec2, DVec3};

/// Chromaticities (x, y) of the primaries and the white point of a linear RGB space.
#[derive(Clone, Copy, Debug)]
pub struct Primaries {
    /// Red, green and blue.
    pub rgb: [DVec2; 3],
    /// The colour of (1, 1, 1).
    pub white: DVec2,
}

/// White point of sRGB.
const D65: DVec2 = DVec2::new(0.3127, 0.329);

/// Responses of cones by which colours are adapted to another white point [Lam 1985; ICC.1:2010, E.3].
const BRADFORD: DMat3 = DMat3::from_cols_array(&[
    0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296,
]);

impl Primaries {
    /// sRGB [ITU-R BT.709].
    pub const SRGB: Primaries = Primaries::d65([[0.64, 0.33], [0.3, 0.6], [0.15, 0.06]]);
    /// DCI-P3 with the white point of sRGB [SMPTE EG 432-1].
    pub const DCI_P3: Primaries = Primaries::d65([[0.68, 0.32], [0.265, 0.69], [0.15, 0.06]]);
    /// The space of wide television [ITU-R BT.2020].
    pub const REC2020: Primaries = Primaries::d65([[0.708, 0.292], [0.17, 0.797], [0.131, 0.046]]);

    const fn d65([r, g, b]: [[f64; 2]; 3]) -> Primaries {
        Primaries {
            rgb: [
                DVec2::from_array(r),
                DVec2::from_array(g),
                DVec2::from_array(b),
            ],
            white: D65,
        }
    }

    /// Returns whether no chromaticity differs from those of sRGB by 0.001 or more.
    fn is_near_srgb(&self) -> bool {
        let all = |p: &Primaries| [p.rgb[0], p.rgb[1], p.rgb[2], p.white];
        let mut pairs = all(self).into_iter().zip(all(&Primaries::SRGB));
        pairs.all(|(a, b)| (a - b).abs().max_element() < 1e-3)
    }

    /// Returns the map of colours to CIE XYZ, in which the white has Y = 1; `None` if the primaries
    /// do not span a space.
    fn to_xyz(self) -> Option<DMat3> {
        let xyz = |c: DVec2| DVec3::new(c.x, c.y, 1.0 - c.x - c.y);
        let columns = DMat3::from_cols(xyz(self.rgb[0]), xyz(self.rgb[1]), xyz(self.rgb[2]));
        let weights = columns.inverse() * (xyz(self.white) / self.white.y);
        let map = columns * DMat3::from_diagonal(weights);
        (map.is_finite() && columns.determinant().abs() > 1e-4).then_some(map)
    }

    /// Returns the map of colours to linear sRGB, which keeps white white; `None` if the primaries do
    /// not span a space.
    pub fn to_srgb(self) -> Option<DMat3> {
        let cones = |xyz: DMat3| BRADFORD * (xyz * DVec3::ONE);
        let (from, to) = (self.to_xyz()?, Primaries::SRGB.to_xyz()?);
        let adapted = DMat3::from_diagonal(cones(to) / cones(from));
        let map = to.inverse() * BRADFORD.inverse() * adapted * BRADFORD * from;
        map.is_finite().then_some(map)
    }
}

/// Returns the map of an EXR file's colours to linear sRGB; `None` if its header does not name other
/// primaries.
pub fn of_exr(header: Option<Chromaticities>) -> Option<DMat3> {
    let c = header?;
    let [red, green, blue, white] = [c.red, c.green, c.blue, c.white]
        .map(|exr::math::Vec2(x, y)| DVec2::new(f64::from(x), f64::from(y)));
    let primaries = Primaries {
        rgb: [red, green, blue],
        white,
    };
    primaries.to_srgb().filter(|_| !primaries.is_near_srgb())
}

/// Note about a file whose colours were converted.
pub const CONVERTED: &str = "its colours are converted from other primaries to those of sRGB";

/// Maps all pixels of an image.
pub fn convert(pixels: &mut [[f32; 3]], map: DMat3) {
    for pixel in pixels {
        *pixel = (map * DVec3::from_array(pixel.map(f64::from)))
            .as_vec3()
            .to_array();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(primaries: Primaries, rows: [[f64; 3]; 3], precision: f64) {
        let map = primaries.to_srgb().unwrap();
        let expected = DMat3::from_cols_array_2d(&rows).transpose();
        assert!(map.abs_diff_eq(expected, precision), "{map} {expected}");
    }

    #[test]
    fn wide_spaces_have_the_published_maps() {
        // SMPTE EG 432-1 and ITU-R BT.2087, table 2.
        let p3 = [
            [1.22494, -0.22494, 0.0],
            [-0.042057, 1.042057, 0.0],
            [-0.019638, -0.078636, 1.098274],
        ];
        check(Primaries::DCI_P3, p3, 1e-5);
        let wide = [
            [1.6605, -0.5876, -0.0728],
            [-0.1246, 1.1329, -0.0083],
            [-0.0182, -0.1006, 1.1187],
        ];
        check(Primaries::REC2020, wide, 1e-4);
    }

    #[test]
    fn aces_is_adapted_to_the_white_of_srgb() {
        let chromaticities = |white: [f32; 2], blue: [f32; 2]| Chromaticities {
            red: exr::math::Vec2(0.7347, 0.2653),
            green: exr::math::Vec2(0.0, 1.0),
            blue: exr::math::Vec2(blue[0], blue[1]),
            white: exr::math::Vec2(white[0], white[1]),
        };
        let map = of_exr(Some(chromaticities([0.32168, 0.33767], [0.0001, -0.077]))).unwrap();
        // The map AP0 to sRGB of the package colour-science with the Bradford transform.
        let expected = DMat3::from_cols_array(&[
            2.5214, -0.2762, -0.0153, -1.134, 1.3726, -0.153, -0.3876, -0.0963, 1.1684,
        ]);
        assert!(map.abs_diff_eq(expected, 1e-3), "{map}");
        let mut white = [[1.0; 3]];
        convert(&mut white, map);
        assert!(white[0].iter().all(|x| (x - 1.0).abs() < 1e-6), "{white:?}");
        // A white of no luminance, and primaries on a line.
        assert_eq!(
            of_exr(Some(chromaticities([0.3, 0.0], [0.0001, -0.077]))),
            None
        );
        assert_eq!(
            of_exr(Some(chromaticities([0.3, 0.3], [0.36735, 0.63265]))),
            None
        );
        assert_eq!(of_exr(None), None);
    }
}
