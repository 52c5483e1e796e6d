//! Exposure of pictures in figures.

use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;

/// Returns the sRGB tone map with a suitable exposure in whole stops, between -10 and 10. The 97th
/// percentile of brightness becomes at most 0.9, but the median at least about 0.05, as for a room
/// with bright windows.
pub fn automatic(image: &Image) -> Tonemap {
    let mut brightest: Vec<f32> = image
        .data
        .iter()
        .map(|p| p[0].max(p[1]).max(p[2]))
        .filter(|v| v.is_finite())
        .collect();
    brightest.sort_unstable_by(f32::total_cmp);
    let stops = |percentile: usize, target: f64| {
        let value = brightest
            .get(brightest.len() * percentile / 100)
            .copied()
            .unwrap_or(1.0);
        if value > 0.0 {
            (target / f64::from(value)).log2().floor()
        } else {
            f64::NEG_INFINITY
        }
    };
    let stops = stops(97, 0.9).max(stops(50, 0.1));
    let stops = if stops.is_finite() {
        stops.clamp(-10.0, 10.0)
    } else {
        0.0
    };
    Tonemap::Srgb {
        exposure: stops as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dark_pictures_are_brightened_by_whole_stops() {
        let exposed = |value: f32| automatic(&Image::from_fn(10, 10, |_, _| [value; 3]));
        assert_eq!(exposed(0.1), Tonemap::Srgb { exposure: 3.0 });
        assert_eq!(exposed(0.9), Tonemap::Srgb { exposure: 0.0 });
        assert_eq!(exposed(3.0), Tonemap::Srgb { exposure: -2.0 });
        assert_eq!(exposed(0.0), Tonemap::Srgb { exposure: 0.0 });
        // A tenth of the picture shows a window 64 times as bright as the room.
        let room = Image::from_fn(10, 10, |x, _| [if x == 0 { 6.4 } else { 0.09 }; 3]);
        assert_eq!(automatic(&room), Tonemap::Srgb { exposure: 0.0 });
    }
}
