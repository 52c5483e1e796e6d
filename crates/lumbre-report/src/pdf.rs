//! Converts Lumbre's SVG figures to single-page PDF files with vector paths and lossless pictures.
//!
//! Text becomes outlines of the embedded font. The page size equals the view box of the SVG in
//! points, so that a figure of 241 units fills a column of 241 pt and its font sizes are in points.
//! SVG features that the figures do not use are reported as errors.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, TextStr};
use resvg::tiny_skia::{self, PathSegment};
use resvg::usvg::{self, ImageKind, Node, Paint, Transform};

use super::OutputError;
use super::plot::raster;

/// Converts an SVG to PDF. The description of the SVG becomes the subject of the document.
///
/// # Errors
/// Returns an error if the SVG cannot be parsed, or uses gradients, patterns, clips, masks or
/// filters.
pub fn from_svg(svg: &str) -> Result<Vec<u8>, OutputError> {
    let tree = raster::parse(svg)?;
    let (width, height) = view_box(svg).unwrap_or((tree.size().width(), tree.size().height()));
    let zoom = width / tree.size().width();
    let mut page = PageContent {
        content: Content::new(),
        opacities: Vec::new(),
        images: Vec::new(),
    };
    page.content.transform([zoom, 0.0, 0.0, -zoom, 0.0, height]);
    page.group(tree.root())?;
    write_document(svg, page, width, height)
}

/// Writes the objects of the document: catalog, page, metadata, pictures and opacities.
fn write_document(
    svg: &str,
    page: PageContent,
    width: f32,
    height: f32,
) -> Result<Vec<u8>, OutputError> {
    let mut pdf = Pdf::new();
    let (catalog, pages, page_id, content, info) = (
        Ref::new(1),
        Ref::new(2),
        Ref::new(3),
        Ref::new(4),
        Ref::new(5),
    );
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([page_id]).count(1);
    write_info(&mut pdf, info, svg);
    let mut next = 6;
    let mut new_id = || {
        next += 1;
        Ref::new(next - 1)
    };
    let images: Vec<(Ref, &EmbeddedImage)> =
        page.images.iter().map(|image| (new_id(), image)).collect();
    let states: Vec<(Ref, f32)> = page
        .opacities
        .iter()
        .map(|alpha| (new_id(), *alpha))
        .collect();
    let mut page_object = pdf.page(page_id);
    page_object
        .parent(pages)
        .media_box(Rect::new(0.0, 0.0, width, height))
        .contents(content);
    let mut resources = page_object.resources();
    let mut objects = resources.x_objects();
    for (i, (id, _)) in images.iter().enumerate() {
        objects.pair(Name(format!("i{i}").as_bytes()), *id);
    }
    objects.finish();
    let mut graphics = resources.ext_g_states();
    for (i, (id, _)) in states.iter().enumerate() {
        graphics.pair(Name(format!("g{i}").as_bytes()), *id);
    }
    graphics.finish();
    resources.finish();
    page_object.finish();
    for (id, alpha) in states {
        pdf.ext_graphics(id)
            .non_stroking_alpha(alpha)
            .stroking_alpha(alpha);
    }
    for (id, image) in images {
        image.write(&mut pdf, id);
    }
    let commands = deflate(page.content.finish().as_slice())?;
    pdf.stream(content, &commands).filter(Filter::FlateDecode);
    Ok(pdf.finish())
}

/// Writes program, title and description.
fn write_info(pdf: &mut Pdf, id: Ref, svg: &str) {
    let mut info = pdf.document_info(id);
    info.producer(TextStr(lumbre_night::text::program()));
    info.title(TextStr(&raster::element(svg, "title").unwrap_or_default()));
    // Text with line breaks would be written as UTF-16, which text searches do not find.
    let description = raster::element(svg, "desc")
        .unwrap_or_default()
        .replace('\n', "; ");
    info.subject(TextStr(&description));
    info.finish();
}

/// An 8-bit RGB picture with its pixels deflated.
struct EmbeddedImage {
    width: u32,
    height: u32,
    deflated: Vec<u8>,
}

impl EmbeddedImage {
    fn write(&self, pdf: &mut Pdf, id: Ref) {
        let mut object = pdf.image_xobject(id, &self.deflated);
        object.filter(Filter::FlateDecode);
        object.width(self.width as i32).height(self.height as i32);
        object.color_space().device_rgb();
        object.bits_per_component(8).interpolate(false);
    }
}

/// Drawing commands of the page, and the opacities and pictures that they refer to by index.
struct PageContent {
    content: Content,
    opacities: Vec<f32>,
    images: Vec<EmbeddedImage>,
}

impl PageContent {
    fn group(&mut self, group: &usvg::Group) -> Result<(), OutputError> {
        if group.clip_path().is_some() || group.mask().is_some() || !group.filters().is_empty() {
            return Err(unsupported("clips, masks or filters"));
        }
        group.children().iter().try_for_each(|node| match node {
            Node::Group(group) => self.group(group),
            Node::Path(path) => self.path(path),
            Node::Text(_) => Err(unsupported("text without outlines")),
            Node::Image(image) => self.image(image),
        })
    }

    fn path(&mut self, path: &usvg::Path) -> Result<(), OutputError> {
        if !path.is_visible() {
            return Ok(());
        }
        self.content.save_state();
        self.transform(path.abs_transform());
        self.paint_state(path)?;
        self.segments(path.data());
        let even_odd = path
            .fill()
            .is_some_and(|f| f.rule() == usvg::FillRule::EvenOdd);
        match (path.fill().is_some(), path.stroke().is_some(), even_odd) {
            (true, true, false) => self.content.fill_nonzero_and_stroke(),
            (true, true, true) => self.content.fill_even_odd_and_stroke(),
            (true, false, false) => self.content.fill_nonzero(),
            (true, false, true) => self.content.fill_even_odd(),
            (false, true, _) => self.content.stroke(),
            (false, false, _) => self.content.end_path(),
        };
        self.content.restore_state();
        Ok(())
    }

    /// Sets opacity, fill colour and stroke of a path.
    fn paint_state(&mut self, path: &usvg::Path) -> Result<(), OutputError> {
        let opacity = |x: usvg::Opacity| x.get();
        let alpha = path
            .fill()
            .map(|f| opacity(f.opacity()))
            .or(path.stroke().map(|s| opacity(s.opacity())));
        if let Some(alpha) = alpha.filter(|alpha| *alpha < 1.0) {
            let state = self
                .opacities
                .iter()
                .position(|a| *a == alpha)
                .unwrap_or_else(|| {
                    self.opacities.push(alpha);
                    self.opacities.len() - 1
                });
            self.content
                .set_parameters(Name(format!("g{state}").as_bytes()));
        }
        if let Some(fill) = path.fill() {
            let [r, g, b] = colour(fill.paint())?;
            self.content.set_fill_rgb(r, g, b);
        }
        if let Some(stroke) = path.stroke() {
            let [r, g, b] = colour(stroke.paint())?;
            self.content
                .set_stroke_rgb(r, g, b)
                .set_line_width(stroke.width().get());
            self.content.set_line_cap(LineCapStyle::ButtCap);
            self.content.set_line_join(match stroke.linejoin() {
                usvg::LineJoin::Round => LineJoinStyle::RoundJoin,
                usvg::LineJoin::Bevel => LineJoinStyle::BevelJoin,
                _ => LineJoinStyle::MiterJoin,
            });
            let dashes = stroke.dasharray().unwrap_or(&[]);
            self.content
                .set_dash_pattern(dashes.iter().copied(), stroke.dashoffset());
        }
        Ok(())
    }

    /// Writes the segments of a path.
    fn segments(&mut self, path: &tiny_skia::Path) {
        let mut last = (0.0, 0.0);
        for segment in path.segments() {
            match segment {
                PathSegment::MoveTo(p) => {
                    self.content.move_to(p.x, p.y);
                    last = (p.x, p.y);
                }
                PathSegment::LineTo(p) => {
                    self.content.line_to(p.x, p.y);
                    last = (p.x, p.y);
                }
                PathSegment::QuadTo(c, p) => {
                    // PDF has no quadratic curves. The control points of the equal cubic curve lie
                    // at two thirds of the way from each end to the quadratic control point.
                    let third = |from: f32, to: f32| from + 2.0 / 3.0 * (to - from);
                    let (x1, y1) = (third(last.0, c.x), third(last.1, c.y));
                    self.content
                        .cubic_to(x1, y1, third(p.x, c.x), third(p.y, c.y), p.x, p.y);
                    last = (p.x, p.y);
                }
                PathSegment::CubicTo(a, b, p) => {
                    self.content.cubic_to(a.x, a.y, b.x, b.y, p.x, p.y);
                    last = (p.x, p.y);
                }
                PathSegment::Close => {
                    self.content.close_path();
                }
            }
        }
    }

    fn image(&mut self, image: &usvg::Image) -> Result<(), OutputError> {
        let ImageKind::PNG(bytes) = image.kind() else {
            return Err(unsupported("pictures other than PNG"));
        };
        let decoded = image::load_from_memory(bytes)
            .map_err(|e| OutputError::Svg {
                reason: e.to_string(),
            })?
            .to_rgb8();
        let deflated = deflate(decoded.as_raw())?;
        self.images.push(EmbeddedImage {
            width: decoded.width(),
            height: decoded.height(),
            deflated,
        });
        self.content.save_state();
        self.transform(image.abs_transform());
        // PDF pictures fill the unit square, with y upwards.
        let size = image.size();
        self.content
            .transform([size.width(), 0.0, 0.0, -size.height(), 0.0, size.height()]);
        self.content
            .x_object(Name(format!("i{}", self.images.len() - 1).as_bytes()));
        self.content.restore_state();
        Ok(())
    }

    fn transform(&mut self, t: Transform) {
        if !t.is_identity() {
            self.content.transform([t.sx, t.ky, t.kx, t.sy, t.tx, t.ty]);
        }
    }
}

fn colour(paint: &Paint) -> Result<[f32; 3], OutputError> {
    match paint {
        Paint::Color(c) => Ok([c.red, c.green, c.blue].map(|x| f32::from(x) / 255.0)),
        _ => Err(unsupported("gradients or patterns")),
    }
}

fn unsupported(feature: &str) -> OutputError {
    OutputError::Svg {
        reason: format!("it uses {feature}, which the PDF export does not support"),
    }
}

/// Returns width and height of the SVG's view box.
fn view_box(svg: &str) -> Option<(f32, f32)> {
    let (_, rest) = svg.split_once("viewBox=\"")?;
    let numbers: Vec<f32> = rest
        .split_once('"')?
        .0
        .split(' ')
        .filter_map(|n| n.parse().ok())
        .collect();
    Some((*numbers.get(2)?, *numbers.get(3)?))
}

/// Compresses bytes to the zlib format.
fn deflate(bytes: &[u8]) -> Result<Vec<u8>, OutputError> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.map_err(|e| OutputError::Svg {
        reason: e.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::style::{INK, style};
    use crate::plot::svg::{Anchor, Drawing, Font};

    fn drawing() -> String {
        let mut drawing = Drawing::default();
        drawing.curve(&[(1.0, 2.0), (30.0, 40.0)], style(1), 1.5);
        drawing.area(&[(0.0, 0.0), (9.0, 0.0), (9.0, 9.0)], "#0072b2", 0.25);
        drawing.text((4.0, 16.0), Font::new(8.0, INK), Anchor::Start, "bdpt");
        let png =
            crate::png::encode_bytes([2, 1], ::png::ColorType::Rgb, &[255, 0, 0, 0, 0, 255], &[]);
        drawing.image([10.0, 10.0, 8.0, 4.0], &png.unwrap());
        drawing.finish_scaled(241.0, 60.0, 1.6, "a title", "run 3f9a & more")
    }

    #[test]
    fn the_page_has_the_size_of_the_view_box_and_all_content() {
        let bytes = from_svg(&drawing()).unwrap();
        assert_eq!(
            bytes,
            from_svg(&drawing()).unwrap(),
            "equal input gives equal bytes"
        );
        let text = String::from_utf8_lossy(&bytes);
        for expected in [
            "%PDF-1.7",
            "/MediaBox [0 0 241 60]",
            "(run 3f9a & more)",
            "(a title)",
            "/ca 0.25",
            "/Width 2",
        ] {
            assert!(text.contains(expected), "{expected} is missing");
        }
        assert!(!text.contains("/Font"), "text is outlines");
    }

    #[test]
    fn unsupported_features_are_errors() {
        let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><defs><linearGradient id="g"><stop offset="0" stop-color="#fff"/><stop offset="1"/></linearGradient></defs><rect width="5" height="5" fill="url(#g)"/></svg>"##;
        assert!(from_svg(svg).unwrap_err().to_string().contains("gradients"));
        assert!(from_svg("no svg").is_err());
    }
}
