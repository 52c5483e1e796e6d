//! Styles of curves: colour, dash pattern and marker. Each of the three is sufficient to tell
//! neighbouring curves apart.
//!
//! The colours are from the palettes of Okabe and Ito [2008] and Tol [2021] for colour-blind
//! readers. They are ordered so that neighbours differ in lightness too. In greyscale print, dashes
//! and markers distinguish the curves. A technique has the same style in every figure of every
//! night.

use lumbre_light::transport::integrator::INTEGRATORS;

/// Colour of text.
pub const INK: &str = "#1f1f1f";
/// Colour of secondary text.
pub const FAINT: &str = "#6b6b6b";
/// Colour of frames and tick marks.
pub const FRAME: &str = "#4d4d4d";
/// Colour of the grid at labelled ticks.
pub const GRID: &str = "#d4d4d4";

const COLOURS: [Colour; 8] = [
    Colour(*b"#0072b2"),
    Colour(*b"#d55e00"),
    Colour(*b"#117733"),
    Colour(*b"#cc79a7"),
    Colour(*b"#332288"),
    Colour(*b"#e69f00"),
    Colour(*b"#882255"),
    Colour(*b"#56b4e9"),
];
/// No curve is dotted: dots are the noise of references.
const DASHES: [&str; 5] = ["", "7 3", "9 3 2 3", "4 2 1 2 1 2", "13 2.5 5 2.5"];

/// A colour as hexadecimal text, such as `#0072b2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Colour([u8; 7]);

impl Colour {
    /// Parses `#` with six hexadecimal digits; `None` for any other text.
    pub fn parse(text: &str) -> Option<Colour> {
        let bytes: [u8; 7] = text.as_bytes().try_into().ok()?;
        let is_hex = bytes[0] == b'#' && bytes[1..].iter().all(u8::is_ascii_hexdigit);
        is_hex.then_some(Colour(bytes))
    }

    /// Returns the text.
    pub fn text(&self) -> &str {
        std::str::from_utf8(&self.0).unwrap_or(INK)
    }
}

/// Style of one curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Style {
    /// Colour of line and marker.
    pub colour: Colour,
    /// Dash pattern as in SVG's `stroke-dasharray`; empty for a solid line.
    pub dash: &'static str,
    marker: usize,
}

/// Techniques in the order of their styles, those that are compared most often first. Others of the
/// program follow in the order of its table.
const TECHNIQUES: [&str; 4] = ["bpt", "nee", "bdpt", "vcm"];

/// Returns the styles of some different techniques, each the same whatever the others are.
/// Techniques that the program does not have follow those that it has, in the order of `names`.
pub fn of_techniques(names: &[&str]) -> Vec<Style> {
    let own = INTEGRATORS.iter().map(|row| row.name);
    let first = TECHNIQUES.into_iter();
    let mut known: Vec<&str> = first
        .chain(own.filter(|name| !TECHNIQUES.contains(name)))
        .collect();
    let mut style_of = |name: &&str| {
        let index = known.iter().position(|known| known == name);
        style(index.unwrap_or_else(|| {
            known.push("");
            known.len() - 1
        }))
    };
    names.iter().map(&mut style_of).collect()
}

/// Returns the style of curve `index`. The combinations of colour, dash and marker repeat after 280
/// curves.
pub fn style(index: usize) -> Style {
    Style {
        colour: COLOURS[index % COLOURS.len()],
        dash: DASHES[index % DASHES.len()],
        marker: index % MARKERS.len(),
    }
}

/// Corners of a polygon about the origin in pixels; `None` is a circle.
type Marker = Option<&'static [(f64, f64)]>;

const MARKERS: [Marker; 7] = [
    None,
    Some(&[(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)]),
    Some(&[(0.0, -4.0), (3.7, 2.7), (-3.7, 2.7)]),
    Some(&[(0.0, -4.3), (4.3, 0.0), (0.0, 4.3), (-4.3, 0.0)]),
    Some(&[(0.0, 4.0), (3.7, -2.7), (-3.7, -2.7)]),
    Some(&[
        (-1.2, -4.0),
        (1.2, -4.0),
        (1.2, -1.2),
        (4.0, -1.2),
        (4.0, 1.2),
        (1.2, 1.2),
        (1.2, 4.0),
        (-1.2, 4.0),
        (-1.2, 1.2),
        (-4.0, 1.2),
        (-4.0, -1.2),
        (-1.2, -1.2),
    ]),
    Some(&[
        (-4.0, 0.0),
        (-2.0, -3.5),
        (2.0, -3.5),
        (4.0, 0.0),
        (2.0, 3.5),
        (-2.0, 3.5),
    ]),
];

impl Default for Style {
    /// The style of the first curve.
    fn default() -> Style {
        style(0)
    }
}

impl Style {
    /// Returns the style with another colour, if one is given.
    pub fn coloured(self, colour: Option<Colour>) -> Style {
        Style {
            colour: colour.unwrap_or(self.colour),
            ..self
        }
    }

    /// Returns the style with a solid line.
    pub fn solid(self) -> Style {
        Style { dash: "", ..self }
    }

    /// Returns the corners of the marker about the origin in pixels; `None` is a circle.
    pub fn marker(&self) -> Marker {
        MARKERS[self.marker]
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Relative luminance of `#rrggbb` [WCAG 2.1].
    fn luminance(colour: &str) -> f64 {
        let channel = |i: usize| {
            let x =
                f64::from(u8::from_str_radix(&colour[1 + 2 * i..3 + 2 * i], 16).unwrap()) / 255.0;
            if x <= 0.04045 {
                x / 12.92
            } else {
                ((x + 0.055) / 1.055).powf(2.4)
            }
        };
        lumbre_light::math::luminance::luminance([0, 1, 2].map(channel))
    }

    #[test]
    fn neighbouring_curves_differ_in_every_way_and_show_on_white() {
        for i in 0..40 {
            let (a, b) = (style(i), style(i + 1));
            assert!(
                a.colour != b.colour && a.dash != b.dash && a.marker != b.marker,
                "{i}"
            );
            let (la, lb) = (luminance(a.colour.text()), luminance(b.colour.text()));
            assert!(
                (la - lb).abs() > 0.05,
                "{} and {} are the same grey",
                a.colour.text(),
                b.colour.text()
            );
            assert!(
                1.05 / (la + 0.05) > 2.0,
                "{} fades on white",
                a.colour.text()
            );
        }
    }

    #[test]
    fn techniques_keep_their_styles_whatever_they_are_compared_with() {
        let alone = of_techniques(&["vcm"]);
        let all = of_techniques(&["mine", "vcm", "bpt", "other", "sppm"]);
        assert_eq!(alone[0], all[1]);
        assert_eq!(all[2], style(0));
        let distinct: BTreeSet<_> = all.iter().map(|s| (s.colour, s.dash, s.marker)).collect();
        assert_eq!(distinct.len(), all.len());
    }

    #[test]
    fn the_first_curves_are_all_different() {
        let styles: BTreeSet<_> = (0..280)
            .map(style)
            .map(|s| (s.colour, s.dash, s.marker))
            .collect();
        assert_eq!(styles.len(), 280);
    }
}
