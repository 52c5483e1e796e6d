//! Figure of the tree that guides paths: its regions as the camera sees them, and its density of
//! directions in one.

use std::f64::consts::PI;

use glam::Vec3;

use super::OutputError;
use super::format::significant;
use super::plot::style::{FAINT, FRAME, INK};
use super::plot::svg::{Anchor, Drawing, Font};
use super::png;
use lumbre_light::film::Image;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_metrics::map::{Colours, ErrorMap};
use lumbre_metrics::tonemap::Tonemap;
use lumbre_render::cpu::guiding_tree::{COLUMNS, GuidingTree, ROWS};

/// Content of a figure.
pub struct TreeFigure<'a> {
    /// Heading: the run.
    pub heading: &'a str,
    /// Description in the file's metadata.
    pub description: &'a str,
    /// Tree whose regions and density are drawn.
    pub tree: &'a GuidingTree,
    /// Pixel that is marked.
    pub pixel: [u32; 2],
    /// Density of directions in its region, as of [`GuidingTree::density`]; `None` if paths are not
    /// guided there.
    pub density: Option<&'a [f64]>,
}

const MARGIN: f64 = 28.0;
const TOP: f64 = 58.0;
/// Width of both panels.
const PANEL: f64 = 340.0;
const GAP: f64 = 40.0;
const WIDTH: f64 = 2.0 * (MARGIN + PANEL) + GAP;
const HEADING: Font = Font::strong(14.0);
const NAME: Font = Font::new(11.0, INK);
const SMALL: Font = Font::new(9.0, FAINT);

/// Least density of the map, relative to a uniform one.
const LEAST: f64 = 0.01;

/// Draws a figure as SVG.
///
/// # Errors
/// Returns an error if a picture cannot be encoded.
pub fn draw(figure: &TreeFigure<'_>) -> Result<String, OutputError> {
    let mut drawing = Drawing::default();
    drawing.text((MARGIN, 24.0), HEADING, Anchor::Start, figure.heading);
    let [width, height] = figure.tree.resolution.map(f64::from);
    let tall = (PANEL * height / width).min(1.5 * PANEL);
    regions(
        &mut drawing,
        [MARGIN, TOP, tall * width / height, tall],
        figure,
    )?;
    let map = [MARGIN + PANEL + GAP, TOP, PANEL, PANEL / 2.0];
    directions(&mut drawing, map, figure.density)?;
    let height = TOP + tall.max(PANEL / 2.0) + 44.0;
    Ok(drawing.finish(WIDTH, height, figure.heading, figure.description))
}

/// Draws the regions in random colours, those that do not guide in grey, and marks the pixel.
fn regions(
    drawing: &mut Drawing,
    [x, y, w, h]: [f64; 4],
    figure: &TreeFigure<'_>,
) -> Result<(), OutputError> {
    let tree = figure.tree;
    let colour = |region: &Option<u32>| match region {
        None => Vec3::ZERO,
        Some(region) if tree.guides(*region) => {
            let [r, g, b, _] = pcg4d([*region, 1, 2, 3]);
            Vec3::from([r, g, b].map(|word| 0.1 + 0.8 * unit(word)))
        }
        Some(_) => Vec3::splat(0.2),
    };
    let [width, height] = tree.resolution;
    let picture = Image::from_pixels(
        width,
        height,
        tree.regions.iter().map(|r| colour(r).to_array()).collect(),
    );
    let picture = png::encode(&picture, Tonemap::Srgb { exposure: 0.0 }, &[])?;
    drawing.image([x, y, w, h], &picture);
    drawing.frame([x, y, w, h], FRAME);
    drawing.text((x, y - 6.0), NAME, Anchor::Start, "regions of space");
    let [px, py] = [0, 1]
        .map(|i| (f64::from(figure.pixel[i]) + 0.5) / f64::from(tree.resolution[i]) * [w, h][i]);
    for (colour, half) in [("#000000", 6.0), ("#ffffff", 5.0)] {
        let side = 2.0 * half;
        drawing.outline([x + px - half, y + py - half, side, side], colour, 1.2);
    }
    let note = "each in a colour of its own; grey: not guided; the square marks the pixel";
    drawing.text((x, y + h + 14.0), SMALL, Anchor::Start, note);
    Ok(())
}

/// Draws the density of directions.
fn directions(
    drawing: &mut Drawing,
    [x, y, w, h]: [f64; 4],
    density: Option<&[f64]>,
) -> Result<(), OutputError> {
    let name = "density of directions in the region of the pixel";
    drawing.text((x, y - 6.0), NAME, Anchor::Start, name);
    let Some(density) = density else {
        drawing.frame([x, y, w, h], FRAME);
        let (text, at) = ("not guided", (x + w / 2.0, y + h / 2.0));
        drawing.text(at, NAME, Anchor::Middle, text);
        return Ok(());
    };
    let relative = density.iter().map(|density| density * 4.0 * PI);
    let most = relative.clone().fold(1.0, f64::max);
    let map = ErrorMap {
        width: COLUMNS as u32,
        height: ROWS as u32,
        values: relative.map(|d| d.max(LEAST).log10() as f32).collect(),
        colours: Colours::Magma,
        top: None,
    };
    let scale = [LEAST.log10() as f32, most.log10() as f32];
    drawing.image([x, y, w, h], &png::encode_map(&map, scale, &[])?);
    drawing.frame([x, y, w, h], FRAME);
    for (share, text) in [
        (0.0, "0°"),
        (0.25, "90°"),
        (0.5, "180°"),
        (0.75, "270°"),
        (1.0, "360°"),
    ] {
        drawing.text((x + share * w, y + h + 13.0), SMALL, Anchor::Middle, text);
    }
    for (share, text) in [(0.03, "+z"), (1.0, "-z")] {
        drawing.text((x - 4.0, y + share * h), SMALL, Anchor::End, text);
    }
    let label = "azimuth about the z axis, from +x to +y; downwards: cosine to +z";
    drawing.text((x + w / 2.0, y + h + 26.0), SMALL, Anchor::Middle, label);
    let scale = format!(
        "{LEAST} to {} times a uniform density, logarithmic",
        significant(most, 3)
    );
    drawing.text((x + w / 2.0, y + h + 38.0), SMALL, Anchor::Middle, &scale);
    Ok(())
}
