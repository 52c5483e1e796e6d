//! Figures of the films that runs kept beside their pictures: Veach's pyramid, strips by depth, and maps of how often
//! light bounced.

use super::Pictures;
use super::convergence::{FULL, SCREEN};
use super::crops::shorten;
use super::item::{Item, Kind, Provenance};
use super::study::{Member, Study};
use crate::film::Image;
use crate::film::layer::{Layer, LayerFilm, LayerImage, Part};
use crate::metrics::map::{Colours, ErrorMap};
use crate::output::plot::sheet;
use crate::output::plot::style::{FAINT, FRAME, INK};
use crate::output::plot::svg::{Anchor, Drawing, Font};
use crate::output::{OutputError, png};

const GAP: f64 = 3.0;
const NAME: Font = Font::strong(8.0);
const LABEL: Font = Font::new(7.6, INK);
const SMALL: Font = Font::new(7.0, FAINT);

/// Widest tile of a sheet, in points.
const WIDEST: f64 = 96.0;

/// One film's place on a sheet.
struct Tile<'a> {
    layer: &'a LayerImage,
    column: u32,
    row: u32,
    /// Path length, which decides its gain.
    length: u32,
    label: String,
}

/// The figures of every run that is the first finished repeat of its kind and kept films.
pub fn all(study: &Study, pictures: &Pictures, notes: &mut Vec<String>) -> Result<Vec<Item>, OutputError> {
    let mut items = Vec::new();
    for facet in 0..study.facets.len() {
        let mut bounced = Vec::new();
        for series in 0..study.series.len() {
            let members = study.members(facet, series);
            let Some(member) = members.into_iter().find(|m| m.run.done() && !m.run.films.is_empty()) else { continue };
            let layers = read(&member, pictures, notes);
            items.extend(sheets(study, facet, series, member, &layers)?);
            let bounces = layers.into_iter().find(|l| l.film.layer == Layer::Bounces);
            bounced.extend(bounces.map(|layer| (series, member, layer.image)));
        }
        if !bounced.is_empty() {
            items.push(bounces(study, facet, &bounced)?);
        }
    }
    Ok(items)
}

/// The radiance films and the map of bounces of a run.
fn read(member: &Member, pictures: &Pictures, notes: &mut Vec<String>) -> Vec<LayerImage> {
    let films = member.run.films.iter().filter_map(|name| Some((name, film(name)?)));
    let image = |(name, film): (&String, LayerFilm)| {
        let path = member.run.folder.join("films").join(format!("{name}.exr"));
        match pictures(&path) {
            Ok(image) => Some(LayerImage { film, image }),
            Err(reason) => {
                notes.push(format!("a film is left out: {reason}"));
                None
            }
        }
    };
    films.filter_map(image).collect()
}

/// The film that a name means, if it is one that figures show: [`LayerFilm::name`] the other way round.
fn film(name: &str) -> Option<LayerFilm> {
    let of = |layer: Layer, part: Part| LayerFilm { layer, part, splats: false };
    if name == Layer::Bounces.row().name {
        return Some(of(Layer::Bounces, Part::Whole));
    }
    if let Some(length) = name.strip_prefix("depth-") {
        return Some(of(Layer::Depth, Part::Depth(length.parse().ok()?)));
    }
    let mut parts = name.strip_prefix("strategies-s")?.split('-');
    let (s, t) = (parts.next()?.parse().ok()?, parts.next()?.strip_prefix('t')?.parse().ok()?);
    let weighted = match parts.next()? {
        "weighted" => true,
        "raw" => false,
        _ => return None,
    };
    Some(of(Layer::Strategies, Part::Strategy { s, t, weighted }))
}

/// The pyramids and the strip of one run.
fn sheets(
    study: &Study,
    facet: usize,
    series: usize,
    member: Member,
    layers: &[LayerImage],
) -> Result<Vec<Item>, OutputError> {
    let strategies = |wanted: bool| -> Vec<Tile<'_>> {
        let tile = |layer| match layer_part(layer) {
            Part::Strategy { s, t, weighted } if weighted == wanted => {
                let label = format!("s = {s}, t = {t}");
                Some(Tile { layer, column: s, row: (s + t).saturating_sub(3), length: s + t - 1, label })
            }
            _ => None,
        };
        // Paths of one edge are the lights themselves; the pyramid begins at two.
        layers.iter().filter_map(tile).filter(|tile| tile.length >= 2).collect()
    };
    let depths = layers.iter().filter_map(|layer| match layer_part(layer) {
        Part::Depth(k) => Some(Tile { layer, column: k - 1, row: 0, length: k, label: format!("k = {k}") }),
        _ => None,
    });
    let kinds = [
        ("pyramid-weighted", "Light by strategy, weighted", strategies(true)),
        ("pyramid-raw", "Light by strategy, unweighted", strategies(false)),
        ("depths", "Light by path length", depths.collect()),
    ];
    let place = place_name(study, facet, Some(series));
    let display = super::shots::exposure(&sum(layers));
    let gains = sheet::stops(layers);
    let mut items = Vec::new();
    for (kind, heading, tiles) in kinds {
        if tiles.is_empty() {
            continue;
        }
        let provenance = Provenance::of([member]);
        let title = if place.is_empty() { heading.to_owned() } else { format!("{heading}: {place}") };
        let svg = draw_tiles(&tiles, &gains, display, &title, &provenance.text())?;
        let caption = format!(
            "{heading}, {place}, {display}: {}. Longer paths are brightened by the power of two beside them.",
            if kind == "depths" {
                "k edges from the camera to the light"
            } else {
                "s vertices on the light's side, t on the camera's; a row is one path length k = s + t − 1"
            }
        );
        let stem = format!("figures/{kind}{}", suffix(&place));
        items.push(Item {
            kind: Kind::Figure,
            stem,
            title,
            caption,
            svg: Some(svg),
            grid: None,
            extra: Vec::new(),
            provenance,
        });
    }
    Ok(items)
}

fn layer_part(layer: &LayerImage) -> Part {
    layer.film.part
}

/// All light of the weighted films, for the exposure.
fn sum(layers: &[LayerImage]) -> Image {
    let depth = layers.iter().any(|l| matches!(layer_part(l), Part::Depth(_)));
    let counts = |l: &&LayerImage| match layer_part(l) {
        Part::Depth(_) => true,
        Part::Strategy { weighted, .. } => weighted && !depth,
        Part::Whole => false,
    };
    let mut chosen = layers.iter().filter(counts);
    let Some(first) = chosen.next() else { return Image::new(1, 1) };
    chosen.fold(first.image.clone(), |mut total, layer| {
        for (to, from) in total.data.iter_mut().zip(&layer.image.data) {
            (0..3).for_each(|c| to[c] += from[c]);
        }
        total
    })
}

fn draw_tiles(
    tiles: &[Tile],
    gains: &[f64],
    display: crate::metrics::tonemap::Tonemap,
    title: &str,
    about: &str,
) -> Result<String, OutputError> {
    let columns = tiles.iter().map(|t| t.column + 1).max().unwrap_or(1);
    let rows = tiles.iter().map(|t| t.row + 1).max().unwrap_or(1);
    let left = if rows > 1 { 34.0 } else { 0.0 };
    let across = f64::from(columns);
    let width = ((FULL - left - GAP * (across - 1.0)) / across).min(WIDEST);
    let image = &tiles[0].layer.image;
    let height = width * f64::from(image.height) / f64::from(image.width);
    let gain = |length: u32| gains.get(length as usize - 1).copied().unwrap_or(0.0).exp2();
    let step = height + 9.5 + GAP;
    let mut drawing = Drawing::default();
    for tile in tiles {
        let (x, y) = (left + f64::from(tile.column) * (width + GAP), f64::from(tile.row) * step);
        let factor = gain(tile.length) as f32;
        let bright = tile.layer.image.data.iter().map(|p| p.map(|v| v * factor)).collect();
        let bright = Image { data: bright, ..tile.layer.image };
        drawing.image([x, y, width, height], &png::encode(&bright, display, &[])?);
        let label = match (rows, factor) {
            (1, f) if f > 1.0 => format!("{}, ×{f}", tile.label),
            _ => tile.label.clone(),
        };
        drawing.text((x + width / 2.0, y + height + 7.5), SMALL, Anchor::Middle, &label);
    }
    if rows > 1 {
        for row in 0..rows {
            let Some(length) = tiles.iter().find(|t| t.row == row).map(|t| t.length) else { continue };
            let y = f64::from(row) * step + height / 2.0;
            drawing.text((0.0, y), LABEL, Anchor::Start, &format!("k = {length}"));
            if gain(length) > 1.0 {
                drawing.text((0.0, y + 9.0), SMALL, Anchor::Start, &format!("×{}", gain(length)));
            }
        }
    }
    let total = left + across * width + (across - 1.0) * GAP;
    Ok(drawing.finish_scaled(total, f64::from(rows) * step - GAP + 1.0, SCREEN, title, about))
}

/// The maps of bounces of a facet's series on one scale.
fn bounces(study: &Study, facet: usize, maps: &[(usize, Member, Image)]) -> Result<Item, OutputError> {
    let provenance = Provenance::of(maps.iter().map(|(_, member, _)| *member));
    let mut all: Vec<f32> =
        maps.iter().flat_map(|(_, _, i)| &i.data).map(|p| p[0]).filter(|v| v.is_finite() && *v > 0.0).collect();
    all.sort_unstable_by(f32::total_cmp);
    let top = all.get((all.len() * 199 / 200).min(all.len().saturating_sub(1))).copied().unwrap_or(1.0).max(0.5);
    let across = maps.len() as f64;
    let bar = 26.0;
    let width = ((FULL - bar - GAP * across) / across).min(1.6 * WIDEST);
    let place = place_name(study, facet, None);
    let title = if place.is_empty() { "Bounces".to_owned() } else { format!("Bounces: {place}") };
    let mut drawing = Drawing::default();
    let mut tallest = 0.0f64;
    for (i, (series, _, image)) in maps.iter().enumerate() {
        let x = i as f64 * (width + GAP);
        let height = width * f64::from(image.height) / f64::from(image.width);
        tallest = tallest.max(height);
        let values = image.data.iter().map(|p| p[0]).collect();
        let map = ErrorMap { width: image.width, height: image.height, values, colours: Colours::Magma, top: None };
        drawing.text((x, 8.0), NAME, Anchor::Start, &shorten(&study.series[*series].full(), NAME.size, width));
        drawing.image([x, 12.0, width, height], &png::encode_map(&map, [0.0, top], &[])?);
    }
    let x = across * (width + GAP) + 2.0;
    colour_bar(&mut drawing, [x, 12.0, 5.0, tallest], [0.0, 1.0]);
    drawing.text((x + 8.0, 18.0), SMALL, Anchor::Start, &crate::output::labels::significant(f64::from(top), 2));
    drawing.text((x + 8.0, 12.0 + tallest), SMALL, Anchor::Start, "0");
    let svg = drawing.finish_scaled(x + bar - 2.0, 12.0 + tallest + 2.0, SCREEN, &title, &provenance.text());
    let caption = format!(
        "How often light bounced before it reached each pixel: the mean over the light that arrives, weighted by its \
         luminance, of path edges minus one; black where none was found. One scale for all, cut at the 99.5th percentile of {} bounces.",
        crate::output::labels::significant(f64::from(top), 3)
    );
    let stem = format!("figures/bounces{}", suffix(&place));
    Ok(Item { kind: Kind::Figure, stem, title, caption, svg: Some(svg), grid: None, extra: Vec::new(), provenance })
}

/// A vertical scale in magma from its position `low` to `high`: left, top, width, height.
pub(super) fn colour_bar(drawing: &mut Drawing, [x, y, width, height]: [f64; 4], [low, high]: [f32; 2]) {
    let steps = 48;
    for step in 0..steps {
        let [r, g, b] = Colours::Magma.at(high + (low - high) * step as f32 / (steps - 1) as f32);
        let part = height / f64::from(steps);
        drawing.fill([x, y + f64::from(step) * part, width, part + 0.2], &format!("#{r:02x}{g:02x}{b:02x}"));
    }
    drawing.outline([x, y, width, height], FRAME, 0.4);
}

pub(super) fn place_name(study: &Study, facet: usize, series: Option<usize>) -> String {
    let series = series.map(|s| study.series[s].full());
    [Some(study.facet_label(facet)), series]
        .into_iter()
        .flatten()
        .filter(|p| !p.is_empty())
        .collect::<Vec<_>>()
        .join(", ")
}

/// The end of a file's stem that says what it is of: `-cornell_bdpt`; empty for nothing.
pub(super) fn suffix(place: &str) -> String {
    let fit = |c: char| if c.is_ascii_alphanumeric() || "-_=.".contains(c) { c } else { '_' };
    let name: String = place.replace(" = ", "=").replace(", ", "_").chars().map(fit).take(100).collect();
    if name.is_empty() { name } else { format!("-{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_films_are_read_back() {
        let layout =
            crate::film::layer::Layout::new(&[Layer::Depth, Layer::Strategies, Layer::Bounces], 4, 100).unwrap();
        for known in layout.films() {
            let read = film(&known.name()).unwrap_or_else(|| panic!("{}", known.name()));
            assert_eq!((read.layer, read.part), (known.layer, known.part));
        }
        assert!(film("albedo").is_none() && film("strategies-sx-t1-raw").is_none());
    }

    #[test]
    fn places_become_file_names() {
        assert_eq!(suffix("scene = box, bdpt"), "-scene=box_bdpt");
        assert_eq!(suffix(""), "");
        assert_eq!(suffix("a/b c"), "-a_b_c");
    }
}
