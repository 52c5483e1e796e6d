//! Figures of films with a time axis: what every series shows at the same moments, one row each.

use super::Pictures;
use super::convergence::{FULL, SCREEN};
use super::crops::shorten;
use super::films::{place_name, suffix};
use super::item::{Item, Kind, Provenance};
use super::study::{Member, Study};
use crate::film::Image;
use crate::metrics::tonemap::Tonemap;
use crate::output::plot::style::{FAINT, INK};
use crate::output::plot::svg::{Anchor, Drawing, Font};
use crate::output::time::still_length;
use crate::output::{OutputError, labels, png};

const GAP: f64 = 2.0;
const NAME: Font = Font::new(7.6, INK);
const SMALL: Font = Font::new(6.6, FAINT);
const LEFT: f64 = 62.0;

/// The most moments beside one another.
const COLUMNS: usize = 8;

/// One series with its pictures by optical length.
struct Row<'a> {
    name: String,
    member: Member<'a>,
    frames: Vec<(f64, Image)>,
}

/// A figure for every facet of which some finished run kept frames.
pub fn all(study: &Study, pictures: &Pictures, notes: &mut Vec<String>) -> Result<Vec<Item>, OutputError> {
    let mut items = Vec::new();
    for facet in 0..study.facets.len() {
        let mut rows: Vec<Row> = Vec::new();
        for series in 0..study.series.len() {
            let members = study.members(facet, series);
            let timed = |m: &Member| m.run.done() && m.run.films.iter().any(|name| still_length(name).is_some());
            let Some(member) = members.into_iter().find(timed) else { continue };
            let frames = read(&member, pictures, notes);
            if !frames.is_empty() {
                rows.push(Row { name: study.series[series].full(), member, frames });
            }
        }
        if !rows.is_empty() {
            items.push(figure(study, facet, &rows)?);
        }
    }
    Ok(items)
}

fn read(member: &Member, pictures: &Pictures, notes: &mut Vec<String>) -> Vec<(f64, Image)> {
    let stills = member.run.films.iter().filter_map(|name| Some((name, still_length(name)?)));
    let all: Vec<_> = stills.collect();
    // Evenly chosen, the first and the last among them.
    let count = all.len().min(COLUMNS);
    let chosen = (0..count).map(|i| if count < 2 { 0 } else { i * (all.len() - 1) / (count - 1) });
    let image = |i: usize| {
        let (name, length) = all[i];
        match pictures(&member.run.folder.join("films").join(format!("{name}.exr"))) {
            Ok(image) => Some((length, image)),
            Err(reason) => {
                notes.push(format!("a frame is left out: {reason}"));
                None
            }
        }
    };
    chosen.filter_map(image).collect()
}

/// The exposure at which 99.5 % of what is lit in any frame stays below white.
fn exposure(rows: &[Row]) -> Tonemap {
    let all = rows.iter().flat_map(|row| &row.frames).flat_map(|(_, image)| &image.data);
    let mut lit: Vec<f32> = all.map(|p| p[0].max(p[1]).max(p[2])).filter(|v| *v > 0.0 && v.is_finite()).collect();
    if lit.is_empty() {
        return Tonemap::Srgb { exposure: 0.0 };
    }
    let at = (lit.len() * 199 / 200).min(lit.len() - 1);
    let (_, white, _) = lit.select_nth_unstable_by(at, f32::total_cmp);
    Tonemap::Srgb { exposure: (-white.log2() * 4.0).round() / 4.0 }
}

fn figure(study: &Study, facet: usize, rows: &[Row]) -> Result<Item, OutputError> {
    let provenance = Provenance::of(rows.iter().map(|row| row.member));
    let display = exposure(rows);
    let across = rows.iter().map(|row| row.frames.len()).max().unwrap_or(1) as f64;
    let width = (FULL - LEFT - GAP * (across - 1.0)) / across;
    let mut drawing = Drawing::default();
    let mut y = 0.0;
    for row in rows {
        let mut height = 0.0f64;
        for (i, (length, image)) in row.frames.iter().enumerate() {
            let x = LEFT + i as f64 * (width + GAP);
            height = width * f64::from(image.height) / f64::from(image.width);
            drawing.image([x, y, width, height], &png::encode(image, display, &[])?);
            let label = labels::significant(*length, 4);
            drawing.text((x + width / 2.0, y + height + 7.0), SMALL, Anchor::Middle, &label);
        }
        drawing.text((0.0, y + height / 2.0), NAME, Anchor::Start, &shorten(&row.name, NAME.size, LEFT - 4.0));
        y += height + 10.0;
    }
    let place = place_name(study, facet, None);
    let title = if place.is_empty() { "Light over time".to_owned() } else { format!("Light over time: {place}") };
    let svg = drawing.finish_scaled(FULL, y, SCREEN, &title, &provenance.text());
    let caption = format!(
        "Light by the optical length of its path, in scene units: each frame is the sum of an even part of the time axis \
         about the length below it. One exposure for all, {display}."
    );
    let stem = format!("figures/times{}", suffix(&place));
    Ok(Item { kind: Kind::Figure, stem, title, caption, svg: Some(svg), grid: None, extra: Vec::new(), provenance })
}
