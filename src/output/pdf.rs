//! Our own SVG figures as PDF pages: one page, vector paths, text as outlines of the embedded font, pictures without loss.
//!
//! The page is as large as the drawing's own coordinates, in points, so that a figure of 241 units fills a column of
//! that width with text of the size that it says. What figures do not use is refused rather than dropped.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, TextStr};
use resvg::tiny_skia::PathSegment;
use resvg::usvg::{self, ImageKind, Node, Paint, Transform};

use super::OutputError;
use super::plot::raster;

/// The PDF of an SVG. Its description becomes the document's subject.
///
/// # Errors
/// When the SVG cannot be parsed, or uses what this cannot carry over: gradients, patterns, clips, masks, filters.
pub fn from_svg(svg: &str) -> Result<Vec<u8>, OutputError> {
    let tree = raster::parse(svg)?;
    let (width, height) = view_box(svg).unwrap_or((tree.size().width(), tree.size().height()));
    let zoom = width / tree.size().width();
    let mut page = Page { content: Content::new(), opacities: Vec::new(), images: Vec::new() };
    page.content.transform([zoom, 0.0, 0.0, -zoom, 0.0, height]);
    page.group(tree.root())?;

    let mut pdf = Pdf::new();
    let (catalog, pages, page_id, content, info) = (Ref::new(1), Ref::new(2), Ref::new(3), Ref::new(4), Ref::new(5));
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([page_id]).count(1);
    let mut facts = pdf.document_info(info);
    facts.producer(TextStr(super::report::PROGRAM));
    facts.title(TextStr(&raster::element(svg, "title").unwrap_or_default()));
    // One line: with line ends it would be written as UTF-16, which no search of the file finds.
    let about = raster::element(svg, "desc").unwrap_or_default().replace('\n', "; ");
    facts.subject(TextStr(&about));
    facts.finish();
    let mut next = 6;
    let mut reference = || {
        next += 1;
        Ref::new(next - 1)
    };
    let images: Vec<(Ref, &Pixels)> = page.images.iter().map(|image| (reference(), image)).collect();
    let states: Vec<(Ref, f32)> = page.opacities.iter().map(|alpha| (reference(), *alpha)).collect();
    let mut written = pdf.page(page_id);
    written.parent(pages).media_box(Rect::new(0.0, 0.0, width, height)).contents(content);
    let mut resources = written.resources();
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
    written.finish();
    for (id, alpha) in states {
        pdf.ext_graphics(id).non_stroking_alpha(alpha).stroking_alpha(alpha);
    }
    for (id, pixels) in images {
        let mut image = pdf.image_xobject(id, &pixels.deflated);
        image.filter(Filter::FlateDecode);
        image.width(pixels.width as i32).height(pixels.height as i32);
        image.color_space().device_rgb();
        image.bits_per_component(8).interpolate(false);
    }
    let drawn = page.content.finish();
    let packed = deflate(drawn.as_slice())?;
    pdf.stream(content, &packed).filter(Filter::FlateDecode);
    Ok(pdf.finish())
}

/// 8-bit RGB pixels, deflated.
struct Pixels {
    width: u32,
    height: u32,
    deflated: Vec<u8>,
}

struct Page {
    content: Content,
    opacities: Vec<f32>,
    images: Vec<Pixels>,
}

impl Page {
    fn group(&mut self, group: &usvg::Group) -> Result<(), OutputError> {
        if group.clip_path().is_some() || group.mask().is_some() || !group.filters().is_empty() {
            return Err(refused("clips, masks or filters"));
        }
        group.children().iter().try_for_each(|node| match node {
            Node::Group(group) => self.group(group),
            Node::Path(path) => self.path(path),
            Node::Text(text) => self.group(text.flattened()),
            Node::Image(image) => self.image(image),
        })
    }

    fn path(&mut self, path: &usvg::Path) -> Result<(), OutputError> {
        if !path.is_visible() {
            return Ok(());
        }
        self.content.save_state();
        self.transform(path.abs_transform());
        let opacity = |x: usvg::Opacity| x.get();
        let alpha = path.fill().map(|f| opacity(f.opacity())).or(path.stroke().map(|s| opacity(s.opacity())));
        if let Some(alpha) = alpha.filter(|alpha| *alpha < 1.0) {
            let state = self.opacities.iter().position(|a| *a == alpha).unwrap_or_else(|| {
                self.opacities.push(alpha);
                self.opacities.len() - 1
            });
            self.content.set_parameters(Name(format!("g{state}").as_bytes()));
        }
        if let Some(fill) = path.fill() {
            let [r, g, b] = colour(fill.paint())?;
            self.content.set_fill_rgb(r, g, b);
        }
        if let Some(stroke) = path.stroke() {
            let [r, g, b] = colour(stroke.paint())?;
            self.content.set_stroke_rgb(r, g, b).set_line_width(stroke.width().get());
            self.content.set_line_cap(LineCapStyle::ButtCap);
            self.content.set_line_join(match stroke.linejoin() {
                usvg::LineJoin::Round => LineJoinStyle::RoundJoin,
                usvg::LineJoin::Bevel => LineJoinStyle::BevelJoin,
                _ => LineJoinStyle::MiterJoin,
            });
            let dashes = stroke.dasharray().unwrap_or(&[]);
            self.content.set_dash_pattern(dashes.iter().copied(), stroke.dashoffset());
        }
        let mut at = (0.0, 0.0);
        for segment in path.data().segments() {
            match segment {
                PathSegment::MoveTo(p) => {
                    self.content.move_to(p.x, p.y);
                    at = (p.x, p.y);
                }
                PathSegment::LineTo(p) => {
                    self.content.line_to(p.x, p.y);
                    at = (p.x, p.y);
                }
                PathSegment::QuadTo(c, p) => {
                    // A quadratic curve is the cubic whose handles are two thirds of the way to its own.
                    let third = |from: f32, to: f32| from + 2.0 / 3.0 * (to - from);
                    let (x1, y1) = (third(at.0, c.x), third(at.1, c.y));
                    self.content.cubic_to(x1, y1, third(p.x, c.x), third(p.y, c.y), p.x, p.y);
                    at = (p.x, p.y);
                }
                PathSegment::CubicTo(a, b, p) => {
                    self.content.cubic_to(a.x, a.y, b.x, b.y, p.x, p.y);
                    at = (p.x, p.y);
                }
                PathSegment::Close => {
                    self.content.close_path();
                }
            }
        }
        let even_odd = path.fill().is_some_and(|f| f.rule() == usvg::FillRule::EvenOdd);
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

    fn image(&mut self, image: &usvg::Image) -> Result<(), OutputError> {
        let ImageKind::PNG(bytes) = image.kind() else { return Err(refused("a picture that is no PNG")) };
        let decoded = image::load_from_memory(bytes).map_err(|e| OutputError::Svg { reason: e.to_string() })?.to_rgb8();
        let deflated = deflate(decoded.as_raw())?;
        self.images.push(Pixels { width: decoded.width(), height: decoded.height(), deflated });
        self.content.save_state();
        self.transform(image.abs_transform());
        // Pictures fill the unit square upwards.
        let size = image.size();
        self.content.transform([size.width(), 0.0, 0.0, -size.height(), 0.0, size.height()]);
        self.content.x_object(Name(format!("i{}", self.images.len() - 1).as_bytes()));
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
        _ => Err(refused("gradients or patterns")),
    }
}

fn refused(what: &str) -> OutputError {
    OutputError::Svg { reason: format!("it uses {what}, which are not carried over to PDF") }
}

/// Width and height of the drawing's own coordinates.
fn view_box(svg: &str) -> Option<(f32, f32)> {
    let (_, rest) = svg.split_once("viewBox=\"")?;
    let numbers: Vec<f32> = rest.split_once('"')?.0.split(' ').filter_map(|n| n.parse().ok()).collect();
    Some((*numbers.get(2)?, *numbers.get(3)?))
}

/// Bytes in zlib's format.
fn deflate(bytes: &[u8]) -> Result<Vec<u8>, OutputError> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.map_err(|e| OutputError::Svg { reason: e.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::plot::style::{INK, style};
    use crate::output::plot::svg::{Anchor, Drawing, Font};

    fn drawing() -> String {
        let mut drawing = Drawing::default();
        drawing.curve(&[(1.0, 2.0), (30.0, 40.0)], style(1), 1.5);
        drawing.area(&[(0.0, 0.0), (9.0, 0.0), (9.0, 9.0)], "#0072b2", 0.25);
        drawing.text((4.0, 16.0), Font::new(8.0, INK), Anchor::Start, "bdpt");
        let png = crate::output::png::encode_bytes([2, 1], ::png::ColorType::Rgb, &[255, 0, 0, 0, 0, 255], &[]);
        drawing.image([10.0, 10.0, 8.0, 4.0], &png.unwrap());
        drawing.finish_scaled(241.0, 60.0, 1.6, "a title", "run 3f9a & more")
    }

    #[test]
    fn a_page_is_as_large_as_the_drawing_says_and_carries_everything() {
        let bytes = from_svg(&drawing()).unwrap();
        assert_eq!(bytes, from_svg(&drawing()).unwrap(), "equal input gives equal bytes");
        let text = String::from_utf8_lossy(&bytes);
        for expected in ["%PDF-1.7", "/MediaBox [0 0 241 60]", "(run 3f9a & more)", "(a title)", "/ca 0.25", "/Width 2"]
        {
            assert!(text.contains(expected), "{expected} is missing");
        }
        assert!(!text.contains("/Font"), "text is outlines");
    }

    #[test]
    fn what_cannot_be_carried_over_is_refused() {
        let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><defs><linearGradient id="g"><stop offset="0" stop-color="#fff"/><stop offset="1"/></linearGradient></defs><rect width="5" height="5" fill="url(#g)"/></svg>"##;
        assert!(from_svg(svg).unwrap_err().to_string().contains("gradients"));
        assert!(from_svg("no svg").is_err());
    }
}
