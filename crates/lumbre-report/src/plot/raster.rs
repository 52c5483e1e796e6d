//! Renders SVG as PNG with embedded fonts only, so that the picture is the same on every machine.

use resvg::{tiny_skia, usvg};

use super::svg::unescape;
use super::text_outlines::outline_text;
use crate::{OutputError, png};

/// Pixels of the PNG per pixel of the SVG, along each side.
const ZOOM: f32 = 2.0;

/// Renders an SVG at twice its size on white. The description of the SVG becomes a text chunk of
/// the PNG.
///
/// # Errors
/// Returns an error if the SVG cannot be parsed or the picture is too large for memory.
pub fn rasterize(svg: &str) -> Result<Vec<u8>, OutputError> {
    let (size, rgb) = pixels(svg, ZOOM)?;
    let meta: Vec<(String, String)> = element(svg, "desc")
        .map(|text| ("Description".to_owned(), text))
        .into_iter()
        .collect();
    png::encode_bytes(size, ::png::ColorType::Rgb, &rgb, &meta)
}

/// Renders an SVG on white, magnified by `zoom`. Returns width, height and 8-bit RGB pixels.
///
/// # Errors
/// Returns the errors of [`rasterize`].
pub(super) fn pixels(svg: &str, zoom: f32) -> Result<([u32; 2], Vec<u8>), OutputError> {
    let fail = |reason: String| OutputError::Svg { reason };
    let tree = parse(svg)?;
    let [width, height] =
        [tree.size().width(), tree.size().height()].map(|side| (side * zoom).ceil() as u32);
    let mut pixmap = tiny_skia::Pixmap::new(width, height).ok_or_else(|| {
        fail(format!(
            "cannot allocate a picture of {width}x{height} pixels"
        ))
    })?;
    pixmap.fill(tiny_skia::Color::WHITE);
    resvg::render(
        &tree,
        tiny_skia::Transform::from_scale(zoom, zoom),
        &mut pixmap.as_mut(),
    );
    let rgb = pixmap
        .data()
        .as_chunks::<4>()
        .0
        .iter()
        .flat_map(|[r, g, b, _]| [*r, *g, *b])
        .collect();
    Ok(([width, height], rgb))
}

/// Parses an SVG. Its text becomes outlines of the embedded fonts.
///
/// # Errors
/// Returns an error if the SVG is not valid or its text cannot be outlined.
pub fn parse(svg: &str) -> Result<usvg::Tree, OutputError> {
    let outlined = outline_text(svg)?;
    usvg::Tree::from_str(&outlined, &usvg::Options::default()).map_err(|e| OutputError::Svg {
        reason: e.to_string(),
    })
}

/// Returns the text of the first element `name` without attributes: `title` or `desc`.
pub fn element(svg: &str, name: &str) -> Option<String> {
    let (_, rest) = svg.split_once(&format!("<{name}>"))?;
    rest.split_once(&format!("</{name}>"))
        .map(|(text, _)| unescape(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::style::INK;
    use crate::plot::svg::{Anchor, Drawing, Font};

    #[test]
    fn text_is_drawn_with_the_embedded_font_and_metadata_is_kept() {
        let mut drawing = Drawing::default();
        drawing.text(
            (4.0, 16.0),
            Font::new(14.0, INK),
            Anchor::Start,
            "error −1 ×",
        );
        let bytes = rasterize(&drawing.finish(100.0, 24.0, "t", "run a & b")).unwrap();
        let mut reader = ::png::Decoder::new(std::io::Cursor::new(&bytes))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        reader.finish().unwrap();
        assert_eq!((reader.info().width, reader.info().height), (200, 48));
        let dark = pixels
            .as_chunks::<3>()
            .0
            .iter()
            .filter(|p| p[0] < 128)
            .count();
        assert!((100..4000).contains(&dark), "{dark} dark pixels");
        assert_eq!(reader.info().uncompressed_latin1_text[0].text, "run a & b");
    }

    #[test]
    fn invalid_svg_is_an_error() {
        assert!(matches!(
            rasterize("plain text"),
            Err(OutputError::Svg { .. })
        ));
    }
}
