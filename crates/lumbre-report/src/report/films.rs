//! Figures of the films that runs store beside their pictures: Veach's pyramid of strategies,
//! strips
//! by path length, and maps of the number of bounces.

use super::Pictures;
use super::item::ReportItem;
use super::study::{Member, Study};
use crate::format::significant;
use crate::plot::sheet::{Sheet, Sheets};
use crate::plot::sizes::{FULL, SCREEN};
use crate::plot::style::{FAINT, FRAME};
use crate::plot::svg::{Anchor, Drawing, Font};
use crate::provenance::Provenance;
use crate::{OutputError, png};
use lumbre_light::film::Image;
use lumbre_light::film::layer::{Layer, LayerFilm, LayerImage, PathSubset};
use lumbre_metrics::map::{Colours, ErrorMap};

/// Space between pictures.
const GAP: f64 = 3.0;
const NAME: Font = Font::strong(8.0);
const SMALL: Font = Font::new(7.0, FAINT);

/// Maximum width of a picture, in points.
const WIDEST: f64 = 96.0;

/// Draws the films of the first finished repeat with films of every series and facet.
pub fn all(
    study: &Study,
    pictures: &Pictures,
    notes: &mut Vec<String>,
) -> Result<Vec<ReportItem>, OutputError> {
    let mut items = Vec::new();
    for facet in 0..study.facets.len() {
        let mut maps = Vec::new();
        for series in 0..study.series.len() {
            let mut finished = study.finished(facet, series).into_iter();
            let Some(member) = finished.find(|m| !m.run.films.is_empty()) else {
                continue;
            };
            let layers = read_films(&member, pictures, notes);
            items.extend(sheets(study, facet, series, member, &layers)?);
            let bounces = layers.into_iter().find(|l| l.film.layer == Layer::Bounces);
            maps.extend(bounces.map(|layer| (series, member, layer.image)));
        }
        if !maps.is_empty() {
            items.push(bounce_maps(study, facet, &maps)?);
        }
    }
    Ok(items)
}

/// Reads the radiance films and the bounce map of a run, from files of their own or from that of
/// its picture.
fn read_films(member: &Member, pictures: &Pictures, notes: &mut Vec<String>) -> Vec<LayerImage> {
    let films = member
        .run
        .films
        .iter()
        .filter_map(|name| Some((name, parse_film_name(name)?)));
    let image = |(name, film): (&String, LayerFilm)| {
        let folder = &member.run.folder;
        let file = folder.join("films").join(format!("{name}.exr"));
        let image = match film.layer.row().exr {
            [group] if !file.is_file() => pictures(&folder.join("final.exr"), Some(group)),
            _ => pictures(&file, None),
        };
        let left_out = |reason| notes.push(format!("a film is left out: {reason}"));
        let image = image.map_err(left_out).ok()?;
        Some(LayerImage { film, image })
    };
    films.filter_map(image).collect()
}

/// Parses the name of a film that figures show. Reverses [`LayerFilm::name`].
fn parse_film_name(name: &str) -> Option<LayerFilm> {
    let film = |layer: Layer, subset: PathSubset| LayerFilm {
        layer,
        subset,
        splats: false,
    };
    if name == Layer::Bounces.row().name {
        return Some(film(Layer::Bounces, PathSubset::Whole));
    }
    if let Some(length) = name.strip_prefix("depth-") {
        return Some(film(Layer::Depth, PathSubset::Depth(length.parse().ok()?)));
    }
    let mut parts = name.strip_prefix("strategies-s")?.split('-');
    let (s, t) = (
        parts.next()?.parse().ok()?,
        parts.next()?.strip_prefix('t')?.parse().ok()?,
    );
    let weighted = match parts.next()? {
        "weighted" => true,
        "raw" => false,
        _ => return None,
    };
    Some(film(
        Layer::Strategies,
        PathSubset::Strategy { s, t, weighted },
    ))
}

/// Draws the pyramids and the strip of one run.
fn sheets(
    study: &Study,
    facet: usize,
    series: usize,
    member: Member,
    layers: &[LayerImage],
) -> Result<Vec<ReportItem>, OutputError> {
    let label = facet_and_series_label(study, facet, Some(series));
    let sheets = Sheets::new(layers, study.display())?;
    let item = |sheet: &Sheet| {
        let provenance = Provenance::from_members([member]);
        let title = titled(sheet.heading, &label);
        Ok(ReportItem::figure(
            "Light by length and strategy",
            format!("figures/{}{}", sheet.stem, file_suffix(&label)),
            title.clone(),
            format!("{title}. {}", sheet.notes),
            sheets.draw(sheet, "", &title, &provenance.text())?,
            provenance,
        ))
    };
    sheets.sheets.iter().map(item).collect()
}

/// Draws the bounce maps of a facet's series on a common scale.
fn bounce_maps(
    study: &Study,
    facet: usize,
    maps: &[(usize, Member, Image)],
) -> Result<ReportItem, OutputError> {
    let provenance = Provenance::from_members(maps.iter().map(|(_, member, _)| *member));
    let top = bounce_scale(maps);
    let columns = maps.len() as f64;
    let scale_width = 26.0;
    let width = ((FULL - scale_width - GAP * columns) / columns).min(1.6 * WIDEST);
    let label = facet_and_series_label(study, facet, None);
    let title = titled("Bounces", &label);
    let mut drawing = Drawing::default();
    let mut tallest = 0.0f64;
    for (i, (series, _, image)) in maps.iter().enumerate() {
        let x = i as f64 * (width + GAP);
        let height = width * f64::from(image.height) / f64::from(image.width);
        tallest = tallest.max(height);
        let map = bounce_map(image);
        drawing.text(
            (x, 8.0),
            NAME,
            Anchor::Start,
            &study.series[*series].label_within(NAME.size, width),
        );
        drawing.image(
            [x, 12.0, width, height],
            &png::encode_map(&map, [0.0, top], &[])?,
        );
    }
    let x = columns * (width + GAP) + 2.0;
    colour_bar(&mut drawing, [x, 12.0, 5.0, tallest], [0.0, 1.0]);
    let top_label = significant(f64::from(top), 2);
    drawing.text((x + 8.0, 18.0), SMALL, Anchor::Start, &top_label);
    drawing.text((x + 8.0, 12.0 + tallest), SMALL, Anchor::Start, "0");
    let svg = drawing.finish_scaled(
        x + scale_width - 2.0,
        12.0 + tallest + 2.0,
        SCREEN,
        &title,
        &provenance.text(),
    );
    let caption = format!(
        "Mean number of bounces of the light that reaches each pixel (path edges minus one), \
         weighted by luminance. Pixels without light are black. All maps have the same scale, \
         which ends at the 99.5th percentile of {} bounces.",
        significant(f64::from(top), 3)
    );
    Ok(ReportItem::figure(
        "Path lengths",
        format!("figures/bounces{}", file_suffix(&label)),
        title,
        caption,
        svg,
        provenance,
    ))
}

/// Converts the first channel of an image to a map.
fn bounce_map(image: &Image) -> ErrorMap {
    ErrorMap {
        width: image.width,
        height: image.height,
        values: image.data.iter().map(|p| p[0]).collect(),
        colours: Colours::Magma,
        top: None,
    }
}

/// Returns the upper end of the common scale: the 99.5th percentile of all pixels with light, at
/// least 0.5.
fn bounce_scale(maps: &[(usize, Member, Image)]) -> f32 {
    let mut values: Vec<f32> = maps
        .iter()
        .flat_map(|(_, _, image)| &image.data)
        .map(|p| p[0])
        .filter(|v| v.is_finite() && *v > 0.0)
        .collect();
    values.sort_unstable_by(f32::total_cmp);
    values
        .get((values.len() * 199 / 200).min(values.len().saturating_sub(1)))
        .copied()
        .unwrap_or(1.0)
        .max(0.5)
}

/// Draws a vertical colour scale in the rectangle left, top, width, height, from position `low` of
/// the colour map at the bottom to `high` at the top.
pub(super) fn colour_bar(
    drawing: &mut Drawing,
    [x, y, width, height]: [f64; 4],
    [low, high]: [f32; 2],
) {
    let steps = 48;
    for step in 0..steps {
        let [r, g, b] = Colours::Magma.at(high + (low - high) * step as f32 / (steps - 1) as f32);
        let step_height = height / f64::from(steps);
        drawing.fill(
            [
                x,
                y + f64::from(step) * step_height,
                width,
                step_height + 0.2,
            ],
            &format!("#{r:02x}{g:02x}{b:02x}"),
        );
    }
    drawing.outline([x, y, width, height], FRAME, 0.4);
}

/// Joins a heading and a label, which may be empty.
pub(super) fn titled(heading: &str, label: &str) -> String {
    if label.is_empty() {
        heading.to_owned()
    } else {
        format!("{heading}: {label}")
    }
}

/// Returns the labels of a facet and, if given, a series, separated by a comma.
pub(super) fn facet_and_series_label(study: &Study, facet: usize, series: Option<usize>) -> String {
    let series = series.map(|s| study.series[s].full_label());
    [Some(study.facet_label(facet)), series]
        .into_iter()
        .flatten()
        .filter(|p| !p.is_empty())
        .collect::<Vec<_>>()
        .join(", ")
}

/// Converts a label to the end of a file name, such as `-cornell_bdpt`. An empty label gives an
/// empty text.
pub(super) fn file_suffix(label: &str) -> String {
    let safe = |c: char| {
        if c.is_ascii_alphanumeric() || "-_=.".contains(c) {
            c
        } else {
            '_'
        }
    };
    let name: String = label
        .replace(" = ", "=")
        .replace(", ", "_")
        .chars()
        .map(safe)
        .take(100)
        .collect();
    if name.is_empty() {
        name
    } else {
        format!("-{name}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn film_names_are_parsed() {
        let layout = lumbre_light::film::layer::LayerLayout::new(
            &[Layer::Depth, Layer::Strategies, Layer::Bounces],
            4,
            100,
        )
        .unwrap();
        for known in layout.films() {
            let film = parse_film_name(&known.name()).unwrap_or_else(|| panic!("{}", known.name()));
            assert_eq!((film.layer, film.subset), (known.layer, known.subset));
        }
        assert!(
            parse_film_name("albedo").is_none()
                && parse_film_name("strategies-sx-t1-raw").is_none()
        );
    }

    #[test]
    fn labels_become_file_names() {
        assert_eq!(file_suffix("scene = box, bdpt"), "-scene=box_bdpt");
        assert_eq!(file_suffix(""), "");
        assert_eq!(file_suffix("a/b c"), "-a_b_c");
    }
}
