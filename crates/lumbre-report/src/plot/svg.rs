//! Writes the SVG elements that figures use.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::html;

use super::style::{INK, Style};
use lumbre_night::text::is_control;

/// Horizontal alignment of text at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The point is the left end of the text.
    Start,
    /// The point is the centre of the text.
    Middle,
    /// The point is the right end of the text.
    End,
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        }
    }
}

/// Size, colour and weight of text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Font<'a> {
    /// Font size in pixels.
    pub size: f64,
    /// Colour of the text.
    pub fill: &'a str,
    /// Whether the text is a heading. Only a light weight is embedded, so headings are outlined.
    pub strong: bool,
}

impl<'a> Font<'a> {
    /// Creates the font of body text.
    pub const fn new(size: f64, fill: &'a str) -> Font<'a> {
        Font {
            size,
            fill,
            strong: false,
        }
    }

    /// Creates the font of a heading.
    pub const fn strong(size: f64) -> Font<'a> {
        Font {
            size,
            fill: INK,
            strong: true,
        }
    }
}

/// An SVG document under construction. Coordinates are pixels from the top left corner.
#[derive(Debug, Default)]
pub struct Drawing {
    body: String,
}

impl Drawing {
    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a String cannot fail.
        let _ = self.body.write_fmt(element);
        self.body.push('\n');
    }

    /// Draws a line from `(x1, y1)` to `(x2, y2)`.
    pub fn line(&mut self, [x1, y1, x2, y2]: [f64; 4], colour: &str, width: f64) {
        let [x1, y1, x2, y2] = [x1, y1, x2, y2].map(number);
        self.push(format_args!(
            r#"<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{colour}" stroke-width="{width}"/>"#
        ));
    }

    /// Draws the outline of a rectangle, given as left, top, width, height.
    pub fn frame(&mut self, [x, y, w, h]: [f64; 4], colour: &str) {
        let [x, y, w, h] = [x, y, w, h].map(number);
        self.push(format_args!(
            r#"<rect x="{x}" y="{y}" width="{w}" height="{h}" fill="none" stroke="{colour}" stroke-width="0.8"/>"#
        ));
    }

    /// Draws a polyline through points in the colour and dash pattern of a style.
    pub fn curve(&mut self, points: &[(f64, f64)], style: Style, width: f64) {
        let points: Vec<String> = points
            .iter()
            .map(|(x, y)| format!("{},{}", number(*x), number(*y)))
            .collect();
        let dash = if style.dash.is_empty() {
            String::new()
        } else {
            format!(r#" stroke-dasharray="{}""#, style.dash)
        };
        self.push(format_args!(
            r#"<polyline points="{}" fill="none" stroke="{}" stroke-width="{width}" stroke-linejoin="round"{dash}/>"#,
            points.join(" "),
            style.colour.text()
        ));
    }

    /// Draws a dashed line; `dash` is as in SVG's `stroke-dasharray`.
    pub fn dashed(&mut self, [x1, y1, x2, y2]: [f64; 4], colour: &str, width: f64, dash: &str) {
        let [x1, y1, x2, y2] = [x1, y1, x2, y2].map(number);
        self.push(format_args!(
            r#"<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{colour}" stroke-width="{width}" stroke-dasharray="{dash}"/>"#
        ));
    }

    /// Fills a rectangle, given as left, top, width, height.
    pub fn fill(&mut self, [x, y, w, h]: [f64; 4], colour: &str) {
        let [x, y, w, h] = [x, y, w, h].map(number);
        self.push(format_args!(
            r#"<rect x="{x}" y="{y}" width="{w}" height="{h}" fill="{colour}"/>"#
        ));
    }

    /// Draws the outline of a rectangle with the given line width.
    pub fn outline(&mut self, [x, y, w, h]: [f64; 4], colour: &str, stroke: f64) {
        let [x, y, w, h] = [x, y, w, h].map(number);
        self.push(format_args!(
            r#"<rect x="{x}" y="{y}" width="{w}" height="{h}" fill="none" stroke="{colour}" stroke-width="{stroke}"/>"#
        ));
    }

    /// Fills a polygon with an opacity.
    pub fn area(&mut self, corners: &[(f64, f64)], colour: &str, opacity: f64) {
        let corners: Vec<String> = corners
            .iter()
            .map(|(x, y)| format!("{},{}", number(*x), number(*y)))
            .collect();
        self.push(format_args!(
            r#"<polygon points="{}" fill="{colour}" fill-opacity="{opacity}"/>"#,
            corners.join(" ")
        ));
    }

    /// Embeds a PNG in the rectangle left, top, width, height, without interpolation.
    pub fn image(&mut self, [x, y, w, h]: [f64; 4], png: &[u8]) {
        let [x, y, w, h] = [x, y, w, h].map(number);
        let data = base64(png);
        self.push(format_args!(
            r#"<image x="{x}" y="{y}" width="{w}" height="{h}" preserveAspectRatio="none" image-rendering="optimizeSpeed" style="image-rendering:pixelated" href="data:image/png;base64,{data}"/>"#
        ));
    }

    /// Draws a marker with its size relative to [`Drawing::marker`], and its fill and edge colours.
    pub fn sized_marker(
        &mut self,
        (x, y): (f64, f64),
        style: Style,
        size: f64,
        fill: &str,
        edge: &str,
    ) {
        let look = format!(r##"fill="{fill}" stroke="{edge}" stroke-width="0.7""##);
        match style.marker() {
            None => self.push(format_args!(
                r#"<circle cx="{}" cy="{}" r="{}" {look}/>"#,
                number(x),
                number(y),
                number(3.3 * size)
            )),
            Some(corners) => {
                let corner = |(dx, dy): &(f64, f64)| {
                    format!("{},{}", number(x + dx * size), number(y + dy * size))
                };
                let corners: Vec<String> = corners.iter().map(corner).collect();
                self.push(format_args!(
                    r#"<polygon points="{}" {look}/>"#,
                    corners.join(" ")
                ));
            }
        }
    }

    /// Writes a line of text with its baseline at the point.
    pub fn text(&mut self, at: (f64, f64), font: Font, anchor: Anchor, text: &str) {
        self.text_element(at, font, anchor, "", &escape(text));
    }

    /// Writes a line of text that reads upwards.
    pub fn text_upwards(&mut self, (x, y): (f64, f64), font: Font, anchor: Anchor, text: &str) {
        let turn = format!(r#" transform="rotate(-90 {} {})""#, number(x), number(y));
        self.text_element((x, y), font, anchor, &turn, &escape(text));
    }

    /// Writes the label of a tick, with a raised exponent if it is a power of ten.
    pub fn tick_label(&mut self, at: (f64, f64), font: Font, anchor: Anchor, label: &TickLabel) {
        let content = match label {
            TickLabel::Plain(text) => escape(text),
            TickLabel::Power { factor, exponent } => {
                let factor = factor
                    .as_ref()
                    .map(|f| format!("{}×", escape(f)))
                    .unwrap_or_default();
                let (rise, small) = (number(font.size * 0.4), number(font.size * 0.75));
                let exponent = exponent.to_string().replace('-', "−");
                format!(r#"{factor}10<tspan dy="-{rise}" font-size="{small}">{exponent}</tspan>"#)
            }
        };
        self.text_element(at, font, anchor, "", &content);
    }

    fn text_element(
        &mut self,
        (x, y): (f64, f64),
        font: Font,
        anchor: Anchor,
        attributes: &str,
        content: &str,
    ) {
        let strong = if font.strong {
            format!(
                r#" stroke="{}" stroke-width="{}""#,
                font.fill,
                number(font.size * 0.025)
            )
        } else {
            String::new()
        };
        self.push(format_args!(
            r#"<text x="{}" y="{}" font-size="{}" fill="{}" text-anchor="{}"{strong}{attributes}>{content}</text>"#,
            number(x),
            number(y),
            number(font.size),
            font.fill,
            anchor.name()
        ));
    }

    /// Returns the document on a white background, with a title and a description.
    pub fn finish(self, width: f64, height: f64, title: &str, description: &str) -> String {
        self.finish_scaled(width, height, 1.0, title, description)
    }

    /// Returns the document with its displayed size multiplied by `scale`.
    pub fn finish_scaled(
        self,
        width: f64,
        height: f64,
        scale: f64,
        title: &str,
        description: &str,
    ) -> String {
        let shown = [width, height].map(|side| number(side.ceil() * scale));
        let (width, height) = (number(width.ceil()), number(height.ceil()));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"{FONTS}\" font-weight=\"300\">\n\
             <title>{}</title>\n<desc>{}</desc>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{}</svg>\n",
            shown[0],
            shown[1],
            escape(title),
            escape(description),
            self.body
        )
    }
}

/// Fonts in order of preference. The first is the one embedded for PNG and PDF.
const FONTS: &str = "Ubuntu, 'Ubuntu Light', 'Helvetica Neue', Arial, sans-serif";

/// Widths of the printable ASCII characters of Ubuntu Light, from its `hmtx` table, in thousandths
/// of the font size.
#[rustfmt::skip]
const WIDTHS: [u16; 95] = [
    228, 274, 392, 653, 564, 831, 648, 240, 310, 310, 472, 564, 246, 282, 246, 359, 564, 564,
    564, 564, 564, 564, 564, 564, 564, 564, 246, 246, 564, 564, 564, 380, 940, 641, 630, 609,
    702, 555, 520, 658, 692, 248, 487, 599, 502, 865, 709, 774, 592, 774, 618, 517, 548, 680,
    624, 921, 608, 569, 560, 310, 359, 310, 564, 490, 376, 509, 583, 460, 583, 548, 376, 573,
    569, 237, 237, 495, 255, 863, 569, 582, 583, 583, 374, 428, 387, 569, 480, 775, 499, 474,
    455, 319, 262, 319, 564,
];

/// Returns the width of a line of text in pixels. Characters outside of ASCII count as wide ones.
pub fn text_width(text: &str, size: f64) -> f64 {
    let width = |c: char| {
        let index = (c as usize).checked_sub(32);
        f64::from(index.and_then(|i| WIDTHS.get(i)).copied().unwrap_or(640))
    };
    text.chars().map(width).sum::<f64>() * size / 1000.0
}

/// Breaks text at spaces into lines of at most `width` pixels, except for longer words.
pub fn wrap(text: &str, size: f64, width: f64) -> Vec<String> {
    lumbre_night::text::wrap(text, |line| text_width(line, size) <= width)
}

/// Formats a coordinate with at most two decimals.
fn number(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

/// Encodes bytes in base 64 with padding [RFC 4648].
pub fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

/// Escapes text as XML character data. Control characters, which XML does not allow, become spaces.
pub fn escape(text: &str) -> String {
    html! { (without_controls(text)) }.into_string()
}

/// Replaces control characters, which no document may contain, by spaces; lines stay.
pub fn without_controls(text: &str) -> String {
    let is_bad = |c: char| {
        c != '\n' && (c.is_control() || is_control(c) || matches!(c, '\u{fffe}' | '\u{ffff}'))
    };
    text.replace(is_bad, " ")
}

/// Reverses the replacements of [`escape`].
pub fn unescape(text: &str) -> String {
    text.replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&quot;", "\"")
        .replace("&amp;", "&")
}

/// Cuts text with an ellipsis so that it fits into `width`.
pub fn shorten(text: &str, size: f64, width: f64) -> String {
    if text_width(text, size) <= width {
        return text.to_owned();
    }
    let mut short: String = text.to_owned();
    while !short.is_empty() && text_width(&short, size) + 0.64 * size > width {
        short.pop();
    }
    short.trim_end().to_owned() + "…"
}

/// Text at a tick.
#[derive(Clone, Debug, PartialEq)]
pub enum TickLabel {
    /// A number or name, such as `0.05`.
    Plain(String),
    /// A power of ten with an optional factor, such as `2×10` with a raised exponent.
    Power {
        /// Factor before the power; `None` is 1.
        factor: Option<String>,
        /// Exponent of ten.
        exponent: i32,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escaped_text_is_restored() {
        let hostile = "a<b> & \"c\" &lt;";
        assert_eq!(escape(hostile), "a&lt;b&gt; &amp; &quot;c&quot; &amp;lt;");
        assert_eq!(unescape(&escape(hostile)), hostile);
        assert_eq!(escape("bell\u{7}"), "bell ");
    }

    #[test]
    fn base_64_matches_the_test_vectors_of_the_rfc() {
        let cases = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, coded) in cases {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64(&[255, 254, 253]), "//79");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [1.0, 0.126, -0.001, 12.5].map(number),
            ["1", "0.13", "0", "12.5"]
        );
    }

    #[test]
    fn long_lines_are_broken_at_spaces() {
        let lines = wrap(
            "one two three four",
            10.0,
            text_width("one two three", 10.0),
        );
        assert_eq!(lines, ["one two three", "four"]);
        assert_eq!(wrap("", 10.0, 50.0), [""]);
        assert_eq!(wrap("unbreakable word", 10.0, 1.0), ["unbreakable", "word"]);
    }

    #[test]
    fn long_names_are_cut_to_the_width_of_their_column() {
        assert_eq!(shorten("bdpt", 8.0, 100.0), "bdpt");
        let cut = shorten("a very long name of a series", 8.0, 60.0);
        assert!(cut.ends_with('…') && text_width(&cut, 8.0) <= 61.0, "{cut}");
    }
}
