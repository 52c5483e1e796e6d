//! Replaces the text of SVG figures by outlines of the embedded fonts.
//!
//! PNG and PDF files are made from the result, so that they do not depend on the fonts of the
//! machine. The SVG files themselves keep their text. The module covers what [`super::svg`]
//! writes: lines of left-to-right text with an anchor, and `tspan` elements that change the font
//! size and shift the baseline. Glyphs are placed by the advances and the pair kerning of the font;
//! f, i and l are joined as its ligatures. Combining marks and scripts that need shaping or
//! reordering are not supported.

use std::fmt::Write;

use roxmltree::{Document, Node};
use ttf_parser::gpos::{PairAdjustment, PositioningSubtable};
use ttf_parser::opentype_layout::Lookup;
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use super::svg::escape;
use crate::OutputError;

/// Embedded fonts in order of preference: Ubuntu Light, then Hack for its arrows and symbols.
const FONTS: [&[u8]; 2] = [
    epaint_default_fonts::UBUNTU_LIGHT,
    epaint_default_fonts::HACK_REGULAR,
];

/// Ligatures of Ubuntu Light, and the characters under which the font contains their glyphs. Longer
/// ones come first.
const LIGATURES: [(&str, &str); 5] = [
    ("ffi", "\u{fb03}"),
    ("ffl", "\u{fb04}"),
    ("ff", "\u{fb00}"),
    ("fi", "\u{fb01}"),
    ("fl", "\u{fb02}"),
];

/// Attributes that place the glyphs. All others are copied to the outlines.
const PLACEMENT: [&str; 5] = ["x", "y", "dy", "font-size", "text-anchor"];

/// Replaces each text element of an SVG by a group of paths. Fill, stroke, opacity and transform
/// are kept.
///
/// # Errors
/// Returns an error if the SVG cannot be parsed, or if its text has no font size, a length
/// that is not a plain number, or elements other than those that [`super::svg`] writes.
pub(super) fn outline_text(svg: &str) -> Result<String, OutputError> {
    let document = Document::parse(svg).map_err(|e| fail(e.to_string()))?;
    let fonts = Fonts::load()?;
    let mut out = String::with_capacity(svg.len());
    let mut end = 0;
    let is_text = |node: &Node<'_, '_>| node.has_tag_name("text");
    for element in document.descendants().filter(is_text) {
        let range = element.range();
        out += &svg[end..range.start];
        write_outlines(&fonts, element, &mut out)?;
        end = range.end;
    }
    out += &svg[end..];
    Ok(out)
}

/// Text with one font size and one set of attributes.
#[derive(Debug)]
struct Span {
    text: String,
    /// Font size in the units of the drawing.
    size: f64,
    /// Shift of the baseline, downwards.
    shift: f64,
    /// Attributes of the `tspan` that are copied to the path, as XML.
    attributes: String,
}

/// Writes the group of paths that replaces a text element: one path for each span.
fn write_outlines(
    fonts: &Fonts,
    element: Node<'_, '_>,
    out: &mut String,
) -> Result<(), OutputError> {
    let spans = spans(element)?;
    let (glyphs, width) = fonts.place(&spans);
    let start = length(element, "x")?.unwrap_or(0.0)
        - match element.attribute("text-anchor") {
            Some("middle") => width / 2.0,
            Some("end") => width,
            _ => 0.0,
        };
    let baseline = length(element, "y")?.unwrap_or(0.0);
    // Writing to a String cannot fail.
    let _ = write!(out, "<g{}>", copied_attributes(element));
    for (i, span) in spans.iter().enumerate() {
        let mut path = PathData::default();
        for glyph in glyphs.iter().filter(|glyph| glyph.span == i) {
            let face = &fonts.faces[glyph.font];
            path.origin = (start + glyph.x, baseline + span.shift);
            path.scale = span.size / f64::from(face.units_per_em());
            face.outline_glyph(glyph.id, &mut path);
        }
        if !path.data.is_empty() {
            let _ = write!(out, r#"<path{} d="{}"/>"#, span.attributes, path.data);
        }
    }
    *out += "</g>";
    Ok(())
}

/// Reads the spans of a text element. As in SVG, runs of spaces become one, and those at both ends
/// are dropped.
fn spans(element: Node<'_, '_>) -> Result<Vec<Span>, OutputError> {
    let size = length(element, "font-size")?.ok_or_else(|| fail("its text has no font size"))?;
    let mut shift = 0.0;
    let mut after_space = true;
    let mut spans = Vec::new();
    let parts = element.children().filter(|n| n.is_text() || n.is_element());
    for child in parts {
        let mut span = Span {
            text: String::new(),
            size,
            shift,
            attributes: String::new(),
        };
        if child.is_element() {
            let nested = child.children().any(|n| n.is_element());
            let moved = ["x", "y", "dx"]
                .iter()
                .any(|name| child.has_attribute(*name));
            if !child.has_tag_name("tspan") || nested || moved {
                return Err(fail("its text has parts other than plain tspan elements"));
            }
            shift += length(child, "dy")?.unwrap_or(0.0);
            span.size = length(child, "font-size")?.unwrap_or(size);
            span.shift = shift;
            span.attributes = copied_attributes(child);
        }
        for c in child.text().unwrap_or_default().chars() {
            match c {
                '\n' | '\r' => continue,
                ' ' | '\t' if after_space => continue,
                ' ' | '\t' => span.text.push(' '),
                c => span.text.push(c),
            }
            after_space = span.text.ends_with(' ');
        }
        spans.push(span);
    }
    if let Some(last) = spans.iter_mut().rfind(|span| !span.text.is_empty()) {
        last.text.truncate(last.text.trim_end_matches(' ').len());
    }
    Ok(spans)
}

/// Returns the attributes that do not place glyphs, as XML with a leading space.
fn copied_attributes(element: Node<'_, '_>) -> String {
    element
        .attributes()
        .filter(|a| a.namespace().is_none() && !PLACEMENT.contains(&a.name()))
        .map(|a| format!(r#" {}="{}""#, a.name(), escape(a.value())))
        .collect()
}

/// Returns an attribute that is a length without unit.
fn length(element: Node<'_, '_>, name: &str) -> Result<Option<f64>, OutputError> {
    element
        .attribute(name)
        .map(|value| {
            value
                .parse()
                .map_err(|_| fail(format!("{name} of its text is {value}, not a number")))
        })
        .transpose()
}

/// A glyph of a line of text.
#[derive(Clone, Copy, Debug)]
struct Glyph {
    /// Index in [`FONTS`].
    font: usize,
    id: GlyphId,
    /// Index of the span that it belongs to.
    span: usize,
    /// Horizontal position of its origin from the start of the line, in the units of the drawing.
    x: f64,
}

/// The embedded fonts.
struct Fonts {
    faces: Vec<Face<'static>>,
}

impl Fonts {
    fn load() -> Result<Fonts, OutputError> {
        let faces: Result<Vec<_>, _> = FONTS.iter().map(|data| Face::parse(data, 0)).collect();
        let faces = faces.map_err(|e| fail(format!("the embedded font is damaged: {e}")))?;
        Ok(Fonts { faces })
    }

    /// Returns the font and the glyph of a character: of the first font that contains it, or else
    /// the box that the first font has for missing characters. All kinds of space are equally wide.
    fn glyph(&self, c: char) -> (usize, GlyphId) {
        let c = if c.is_whitespace() { ' ' } else { c };
        let glyphs = self.faces.iter().map(|face| face.glyph_index(c));
        glyphs
            .enumerate()
            .find_map(|(font, id)| Some((font, id?)))
            .unwrap_or((0, GlyphId(0)))
    }

    /// Places the glyphs of a line from 0 to the right. Returns them and the width of the line.
    fn place(&self, spans: &[Span]) -> (Vec<Glyph>, f64) {
        let mut glyphs: Vec<Glyph> = Vec::new();
        let mut x = 0.0;
        for (span, Span { text, size, .. }) in spans.iter().enumerate() {
            let text = LIGATURES
                .iter()
                .fold(text.clone(), |text, (from, to)| text.replace(from, to));
            for c in text.chars().filter(|c| !is_invisible(*c)) {
                let (font, id) = self.glyph(c);
                let face = &self.faces[font];
                if let Some(last) = glyphs.last().filter(|last| last.font == font) {
                    let em = spans[last.span].size / f64::from(face.units_per_em());
                    x += kerning(face, last.id, id) * em;
                }
                glyphs.push(Glyph { font, id, span, x });
                let advance = face.glyph_hor_advance(id).unwrap_or(0);
                x += f64::from(advance) * size / f64::from(face.units_per_em());
            }
        }
        (glyphs, x)
    }
}

/// Returns whether a character only controls layout: the soft hyphen, zero-width characters,
/// directional marks, joiners and variation selectors.
fn is_invisible(c: char) -> bool {
    matches!(
        c,
        '\u{ad}'
            | '\u{200b}'..='\u{200f}'
            | '\u{202a}'..='\u{202e}'
            | '\u{2060}'..='\u{2064}'
            | '\u{fe00}'..='\u{fe0f}'
            | '\u{feff}'
    )
}

/// Returns the change of the advance of `left` before `right` in font units. All lookups in the
/// GPOS table of Ubuntu Light are pairs of the feature `kern`; Hack has no such table.
fn kerning(face: &Face<'_>, left: GlyphId, right: GlyphId) -> f64 {
    let Some(positions) = face.tables().gpos else {
        return 0.0;
    };
    let lookups = positions.lookups.into_iter();
    let adjustment = |lookup: Lookup<'_>| {
        let mut subtables = lookup.subtables.into_iter::<PositioningSubtable<'_>>();
        subtables.find_map(|subtable| match subtable {
            PositioningSubtable::Pair(pairs) => pair_adjustment(pairs, left, right),
            _ => None,
        })
    };
    f64::from(lookups.filter_map(adjustment).sum::<i16>())
}

/// Returns the change of the advance of `left` before `right`, or `None` if the table does not list
/// them.
fn pair_adjustment(pairs: PairAdjustment<'_>, left: GlyphId, right: GlyphId) -> Option<i16> {
    let (first, _) = match pairs {
        PairAdjustment::Format1 { coverage, sets } => sets.get(coverage.get(left)?)?.get(right)?,
        PairAdjustment::Format2 {
            coverage,
            classes: (lefts, rights),
            matrix,
        } => {
            coverage.get(left)?;
            matrix.get((lefts.get(left), rights.get(right)))?
        }
    };
    Some(first.x_advance)
}

/// SVG path data under construction.
#[derive(Debug, Default)]
struct PathData {
    data: String,
    /// Origin of the current glyph in the drawing.
    origin: (f64, f64),
    /// Length of a font unit in the drawing.
    scale: f64,
}

impl PathData {
    /// Writes a command with points in font units, y upwards, as points of the drawing with three
    /// decimals.
    fn command<const N: usize>(&mut self, name: char, points: [(f32, f32); N]) {
        let rounded = |x: f64| (x * 1000.0).round() / 1000.0;
        self.data.push(name);
        for (i, (x, y)) in points.into_iter().enumerate() {
            let space = if i == 0 { "" } else { " " };
            let x = rounded(self.origin.0 + f64::from(x) * self.scale);
            let y = rounded(self.origin.1 - f64::from(y) * self.scale);
            let _ = write!(self.data, "{space}{x} {y}");
        }
    }
}

impl OutlineBuilder for PathData {
    fn move_to(&mut self, x: f32, y: f32) {
        self.command('M', [(x, y)]);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.command('L', [(x, y)]);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.command('Q', [(x1, y1), (x, y)]);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.command('C', [(x1, y1), (x2, y2), (x, y)]);
    }

    fn close(&mut self) {
        self.data.push('Z');
    }
}

fn fail(reason: impl Into<String>) -> OutputError {
    OutputError::Svg {
        reason: reason.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an SVG that contains only the given element.
    fn svg(element: &str) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\"><desc>&lt;text&gt;</desc>{element}</svg>"
        )
    }

    /// Returns the glyphs of a line in font units of 1/1000 em, and its width.
    fn placed(text: &str) -> (Vec<Glyph>, f64) {
        let span = Span {
            text: text.to_owned(),
            size: 1000.0,
            shift: 0.0,
            attributes: String::new(),
        };
        Fonts::load().unwrap().place(&[span])
    }

    /// Returns the smallest and largest x of the points in path data.
    fn extent(outlined: &str) -> (f64, f64) {
        let data = outlined.split("d=\"").nth(1).unwrap();
        let numbers = data
            .split('"')
            .next()
            .unwrap()
            .replace(char::is_alphabetic, " ");
        let numbers: Vec<f64> = numbers
            .split_whitespace()
            .map(|n| n.parse().unwrap())
            .collect();
        let xs = numbers.iter().step_by(2);
        xs.fold((f64::MAX, f64::MIN), |(low, high), x| {
            (low.min(*x), high.max(*x))
        })
    }

    /// The widths and positions are those of harfrust 0.12, the text shaper of usvg 0.49.
    #[test]
    fn lines_are_as_wide_as_a_text_shaper_sets_them() {
        let widths = [
            ("RMSE (radiance)", 7175.0),
            ("AVATAR To. 7.4", 6671.0),
            ("office waffle", 5646.0),
            ("\u{3bb} = 532 nm", 4864.0),
            ("nee, Another GPU", 7967.0),
        ];
        for (text, width) in widths {
            assert_eq!(placed(text).1, width, "{text}");
        }
        let xs: Vec<f64> = placed("AVAV").0.iter().map(|glyph| glyph.x).collect();
        assert_eq!(xs, [0.0, 591.0, 1165.0, 1756.0]);
    }

    #[test]
    fn missing_characters_come_from_the_second_font_or_are_boxes() {
        let (glyphs, width) = placed("a\u{2192}\u{6f22}\u{200b}");
        let fonts: Vec<usize> = glyphs.iter().map(|glyph| glyph.font).collect();
        assert_eq!(fonts, [0, 1, 0]);
        assert_eq!(glyphs[2].id, GlyphId(0));
        assert!((width - (509.0 + 602.0508 + 500.0)).abs() < 1e-3, "{width}");
        let outlined = outline_text(&svg("<text font-size=\"10\">\u{6f22}</text>"));
        let (left, right) = extent(&outlined.unwrap());
        assert!(
            left > 0.0 && right < 5.0,
            "the box is visible: {left} {right}"
        );
    }

    #[test]
    fn outlines_keep_paint_and_transform_and_follow_the_anchor() {
        let element = |anchor: &str| {
            svg(&format!(
                "<text x=\"50\" y=\"20\" font-size=\"10\" fill=\"#123456\" opacity=\"0.5\" \
                 text-anchor=\"{anchor}\" transform=\"rotate(-90 50 20)\">AA &amp; A</text>"
            ))
        };
        let extents = ["start", "middle", "end"].map(|anchor| {
            let outlined = outline_text(&element(anchor)).unwrap();
            assert!(outlined.contains(
                "<g fill=\"#123456\" opacity=\"0.5\" transform=\"rotate(-90 50 20)\"><path d=\"M"
            ));
            assert!(outlined.contains("<desc>&lt;text&gt;</desc>") && !outlined.contains("<text"));
            extent(&outlined)
        });
        let width = placed("AA & A").1 / 100.0;
        for (anchored, shift) in extents.iter().zip([0.0, width / 2.0, width]) {
            assert!(
                (anchored.0 - (extents[0].0 - shift)).abs() < 0.002,
                "{extents:?}"
            );
        }
        assert!(extents[0].0 > 50.0 && extents[0].1 < 50.0 + width);
    }

    #[test]
    fn spans_have_their_own_size_and_baseline() {
        let text = "<text y=\"20\" font-size=\"10\">  10 \n<tspan dy=\"-4\" font-size=\"7.5\" \
                    fill=\"#fff\"> 3 </tspan></text>";
        let document = svg(text);
        let document = Document::parse(&document).unwrap();
        let element = document.descendants().find(|n| n.has_tag_name("text"));
        let spans = spans(element.unwrap()).unwrap();
        let rows: Vec<_> = spans
            .iter()
            .map(|s| (s.text.as_str(), s.size, s.shift, s.attributes.as_str()))
            .collect();
        assert_eq!(
            rows,
            [("10 ", 10.0, 0.0, ""), ("3", 7.5, -4.0, " fill=\"#fff\"")]
        );
        let outlined = outline_text(&svg(text)).unwrap();
        assert_eq!(outlined.matches("<path").count(), 2);
    }

    #[test]
    fn text_that_drawings_do_not_contain_is_an_error() {
        for (element, reason) in [
            ("<text>a</text>", "no font size"),
            (
                "<text font-size=\"1em\">a</text>",
                "font-size of its text is 1em",
            ),
            ("<text font-size=\"9\"><a>b</a></text>", "plain tspan"),
            (
                "<text font-size=\"9\"><tspan x=\"1\">b</tspan></text>",
                "plain tspan",
            ),
        ] {
            let error = outline_text(&svg(element)).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
        assert!(outline_text("no svg").is_err());
    }
}
