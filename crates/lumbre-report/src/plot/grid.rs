//! Grids of pictures with labels: the one drawing of sheets of films, frames and pictures of runs.

use super::sizes::{COLUMN, FULL, SCREEN};
use super::style::{FAINT, FRAME, GRID, INK, style};
use super::svg::{Anchor, Drawing, Font, shorten, text_width, wrap};
use crate::{OutputError, png};
use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;

/// Space between pictures, in points.
const GAP: f64 = 3.0;
/// Maximum space for the labels of rows, in points.
const LEFT: f64 = 84.0;
/// Space for the labels of columns, and below a row of labelled pictures, in points.
const LINE: f64 = 9.5;
/// Height of a row without pictures, relative to its width.
const EMPTY_ASPECT: f64 = 0.75;
/// Maximum height of a picture, relative to the width of its column.
const TALLEST: f64 = 2.0;
/// Maximum pixels of a picture per point of the drawing: 300 per inch.
const DENSEST: f64 = 300.0 / 72.0;

const HEADING: Font = Font::strong(8.5);
const LABEL: Font = Font::new(7.6, INK);
const SMALL: Font = Font::new(7.0, FAINT);

/// A grid of pictures.
pub struct Grid {
    /// Text above the grid; may be empty.
    pub heading: String,
    /// Labels above the columns; none if empty.
    pub heads: Vec<String>,
    /// Text below the grid; may be empty.
    pub notes: String,
    /// Labels of the rows, whose lines are separated by `\n`; none if empty.
    rows: Vec<String>,
    /// Space left of the pictures, in points.
    left: f64,
    /// Width of a column, in points.
    width: f64,
    columns: usize,
    tiles: Vec<Tile>,
}

/// Content of a cell.
struct Tile {
    /// Column and row.
    cell: [usize; 2],
    content: Content,
    /// Text below it; may be empty.
    label: String,
}

enum Content {
    /// Width and height in points, and PNG.
    Picture([f64; 2], Vec<u8>),
    /// Reason of the gap.
    Gap(String),
    Plot(Plot),
}

/// A small plot without axes, whose coordinates are between 0 and 1.
pub struct Plot {
    /// Lines from left to right, with heights above the bottom.
    pub lines: Vec<Vec<(f64, f64)>>,
    /// Labels of the left and right end of the horizontal axis.
    pub ends: [String; 2],
}

/// Reduces an image by averaging squares of `n` by `n` pixels. Remaining pixels at the edges are
/// dropped.
pub fn reduced(image: &Image, n: u32) -> Image {
    if n == 1 {
        return image.clone();
    }
    Image::from_fn(
        (image.width / n).max(1),
        (image.height / n).max(1),
        |x, y| {
            let mut sum = [0.0f64; 3];
            let mut count = 0.0;
            for j in y * n..(y * n + n).min(image.height) {
                for i in x * n..(x * n + n).min(image.width) {
                    let pixel = image.at(i, j);
                    (0..3).for_each(|c| sum[c] += f64::from(pixel[c]));
                    count += 1.0;
                }
            }
            sum.map(|s| (s / count) as f32)
        },
    )
}

impl Grid {
    /// Size of the letters of labels of rows and columns, in points.
    pub const LABEL_SIZE: f64 = LABEL.size;

    /// Creates an empty grid as wide as a page. `rows` are labels, whose lines are separated by
    /// `\n`; `widest` is the greatest width of a column in points.
    pub fn new(columns: usize, rows: Vec<String>, widest: f64) -> Grid {
        let lines = rows.iter().flat_map(|label| label.lines());
        let longest = lines.map(|line| text_width(line, LABEL.size) + 5.0);
        let left = longest.fold(0.0, f64::max).min(LEFT);
        let free = FULL - left - GAP * (columns as f64 - 1.0);
        Grid {
            heading: String::new(),
            heads: Vec::new(),
            notes: String::new(),
            rows,
            left,
            width: (free / columns as f64).min(widest),
            columns,
            tiles: Vec::new(),
        }
    }

    /// Returns the width of a column in points.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Reduces an image to the resolution at which it is drawn.
    pub fn fitted(&self, image: &Image) -> Image {
        let [width, _] = self.size(image);
        let n = (f64::from(image.width) / (width * DENSEST)).floor();
        reduced(image, (n as u32).max(1))
    }

    /// Adds a picture at a column and row, with a label below it, which may be empty.
    ///
    /// # Errors
    /// Returns an error if the picture cannot be encoded.
    pub fn picture(
        &mut self,
        cell: [usize; 2],
        image: &Image,
        display: Tonemap,
        label: String,
    ) -> Result<(), OutputError> {
        let png = png::encode(&self.fitted(image), display, &[])?;
        self.add(cell, Content::Picture(self.size(image), png), label);
        Ok(())
    }

    /// Adds a picture as [`Grid::picture`] does, or a gap with the reason for it.
    ///
    /// # Errors
    /// Returns an error if the picture cannot be encoded.
    pub fn found(
        &mut self,
        cell: [usize; 2],
        found: &Result<Image, &str>,
        display: Tonemap,
        label: String,
    ) -> Result<(), OutputError> {
        match found {
            Ok(image) => self.picture(cell, image, display, label),
            Err(reason) => {
                self.add(cell, Content::Gap((*reason).to_owned()), label);
                Ok(())
            }
        }
    }

    /// Adds a plot.
    pub fn plot(&mut self, cell: [usize; 2], plot: Plot) {
        self.add(cell, Content::Plot(plot), String::new());
    }

    fn add(&mut self, cell: [usize; 2], content: Content, label: String) {
        self.tiles.push(Tile {
            cell,
            content,
            label,
        });
    }

    /// Returns the width and height at which a picture is drawn, in points.
    fn size(&self, image: &Image) -> [f64; 2] {
        let sides = [image.width, image.height].map(f64::from);
        let zoom = (self.width / sides[0]).min(TALLEST * self.width / sides[1]);
        sides.map(|side| side * zoom)
    }

    /// Draws the grid as SVG. `title` and `description` are those of the document.
    pub fn svg(&self, title: &str, description: &str) -> String {
        let mut drawing = Drawing::default();
        let columns = self.columns as f64;
        let grid_width = self.left + columns * self.width + (columns - 1.0) * GAP;
        let whole = grid_width.max(if self.notes.is_empty() { 0.0 } else { COLUMN });
        let mut y = 0.0;
        for line in wrapped(&self.heading, HEADING, grid_width) {
            drawing.text((0.0, y + 8.0), HEADING, Anchor::Start, &line);
            y += HEADING.size + 3.0;
        }
        for (column, head) in self.heads.iter().enumerate() {
            let head = shorten(head, LABEL.size, self.width);
            let middle = self.x(column) + self.width / 2.0;
            drawing.text((middle, y + 7.0), LABEL, Anchor::Middle, &head);
        }
        y += if self.heads.is_empty() { 0.0 } else { LINE };
        let last = self.tiles.iter().map(|tile| tile.cell[1] + 1).max();
        for row in 0..last.unwrap_or(0) {
            y += self.draw_row(&mut drawing, row, y) + GAP;
        }
        y += 1.0 - GAP;
        for line in wrapped(&self.notes, SMALL, whole) {
            y += SMALL.size + 2.0;
            drawing.text((0.0, y), SMALL, Anchor::Start, &line);
        }
        drawing.finish_scaled(whole, y + 2.0, SCREEN, title, description)
    }

    /// Draws the row whose upper edge is at `y`, and returns its height.
    fn draw_row(&self, drawing: &mut Drawing, row: usize, y: f64) -> f64 {
        let tiles = || self.tiles.iter().filter(move |tile| tile.cell[1] == row);
        let tallest = |tiles: &mut dyn Iterator<Item = &Tile>| {
            let heights = tiles.filter_map(|tile| match tile.content {
                Content::Picture([_, height], _) => Some(height),
                Content::Gap(_) | Content::Plot(_) => None,
            });
            heights.reduce(f64::max)
        };
        let height = tallest(&mut tiles()).or_else(|| tallest(&mut self.tiles.iter()));
        let height = height.unwrap_or(EMPTY_ASPECT * self.width);
        let mut below = 0.0;
        for tile in tiles() {
            let x = self.x(tile.cell[0]);
            let middle = x + self.width / 2.0;
            let label = shorten(&tile.label, SMALL.size, self.width);
            match &tile.content {
                Content::Gap(reason) => {
                    let reason = shorten(reason, SMALL.size, self.width - 2.0);
                    let place = (middle, y + height / 2.0 + 2.5);
                    drawing.outline([x, y, self.width, height], GRID, 0.6);
                    drawing.text(place, SMALL, Anchor::Middle, &reason);
                }
                Content::Plot(plot) => {
                    draw_plot(drawing, [x, y, self.width, height], plot);
                    below = LINE;
                }
                Content::Picture([width, height], png) => {
                    drawing.image([middle - width / 2.0, y, *width, *height], png);
                }
            }
            if !label.is_empty() {
                drawing.text((middle, y + height + 7.5), SMALL, Anchor::Middle, &label);
                below = LINE;
            }
        }
        let label = self.rows.get(row).map_or("", String::as_str).lines();
        let lines = label.flat_map(|line| wrap(line, LABEL.size, self.left - 5.0));
        let lines: Vec<String> = lines.collect();
        let top = y + (height - (lines.len() as f64 - 1.0) * 9.0) / 2.0 + 2.5;
        for (i, line) in lines.iter().enumerate() {
            let line = shorten(line, LABEL.size, self.left - 3.0);
            drawing.text((0.0, top + 9.0 * i as f64), LABEL, Anchor::Start, &line);
        }
        height + below
    }

    /// Returns the left edge of a column.
    fn x(&self, column: usize) -> f64 {
        self.left + column as f64 * (self.width + GAP)
    }
}

/// Breaks a text into lines; an empty one has none.
fn wrapped(text: &str, font: Font, width: f64) -> Vec<String> {
    let mut lines = wrap(text, font.size, width);
    lines.retain(|line| !line.is_empty());
    lines
}

/// Draws a plot in the rectangle left, top, width, height, with its labels below.
fn draw_plot(drawing: &mut Drawing, [x, y, width, height]: [f64; 4], plot: &Plot) {
    drawing.line([x, y + height, x + width, y + height], FRAME, 0.6);
    for line in &plot.lines {
        let place = |(a, b): &(f64, f64)| (x + a * width, y + height * (1.0 - b));
        let points: Vec<(f64, f64)> = line.iter().map(place).collect();
        drawing.curve(&points, style(0).solid(), 1.0);
    }
    let [first, last] = &plot.ends;
    drawing.text((x, y + height + 7.5), SMALL, Anchor::Start, first);
    drawing.text((x + width, y + height + 7.5), SMALL, Anchor::End, last);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reduced_pictures_are_means() {
        let image = Image::from_fn(5, 4, |x, y| [(x + 10 * y) as f32; 3]);
        let half = reduced(&image, 2);
        assert_eq!((half.width, half.height, half.at(1, 1)), (2, 2, [27.5; 3]));
    }

    #[test]
    fn pictures_of_other_shapes_fit_into_their_column() {
        let grid = Grid::new(4, Vec::new(), 96.0);
        assert_eq!(grid.width(), 96.0);
        let size = |w: u32, h: u32| grid.size(&Image::from_fn(w, h, |_, _| [0.0; 3]));
        assert_eq!(size(40, 30), [96.0, 72.0]);
        assert_eq!(size(3, 300), [1.92, 192.0]);
        let large = grid.fitted(&Image::from_fn(2000, 10, |_, _| [0.5; 3]));
        assert_eq!((large.width, large.height), (400, 2), "300 pixels per inch");
    }
}
