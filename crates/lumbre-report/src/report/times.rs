//! Figures of films with a time axis: frames of every series at the same optical lengths, one row
//! for each series.

use super::Pictures;
use super::films::{facet_and_series_label, file_suffix, titled};
use super::item::ReportItem;
use super::snapshots::read_picture;
use super::study::{Member, Study};
use crate::format;
use crate::plot::sizes::{FULL, SCREEN};
use crate::plot::style::{FAINT, INK};
use crate::plot::svg::{Anchor, Drawing, Font, shorten};
use crate::provenance::Provenance;
use crate::time::still_length;
use crate::{OutputError, png};
use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;

const GAP: f64 = 2.0;
const NAME: Font = Font::new(7.6, INK);
const SMALL: Font = Font::new(6.6, FAINT);
/// Space for the names of the series.
const LEFT: f64 = 62.0;

/// Maximum number of frames in a row.
const COLUMNS: usize = 8;

/// Frames of one series with their optical lengths.
struct FrameRow<'a> {
    name: String,
    member: Member<'a>,
    frames: Vec<(f64, Image)>,
}

/// Draws a figure for every facet with a finished run that stored frames.
pub fn all(
    study: &Study,
    pictures: &Pictures,
    notes: &mut Vec<String>,
) -> Result<Vec<ReportItem>, OutputError> {
    let mut items = Vec::new();
    for facet in 0..study.facets.len() {
        let mut rows: Vec<FrameRow> = Vec::new();
        for series in 0..study.series.len() {
            let has_frames =
                |m: &Member| m.run.films.iter().any(|name| still_length(name).is_some());
            let mut finished = study.finished(facet, series).into_iter();
            let Some(member) = finished.find(has_frames) else {
                continue;
            };
            let frames = read_frames(&member, pictures, notes);
            if !frames.is_empty() {
                rows.push(FrameRow {
                    name: study.series[series].full_label(),
                    member,
                    frames,
                });
            }
        }
        if !rows.is_empty() {
            items.push(figure(study, facet, &rows)?);
        }
    }
    Ok(items)
}

/// Reads at most [`COLUMNS`] frames of a run, evenly selected with the first and the last one.
fn read_frames(member: &Member, pictures: &Pictures, notes: &mut Vec<String>) -> Vec<(f64, Image)> {
    let stills: Vec<(&String, f64)> = member
        .run
        .films
        .iter()
        .filter_map(|name| Some((name, still_length(name)?)))
        .collect();
    let count = stills.len().min(COLUMNS);
    let selected = (0..count).map(|i| {
        if count < 2 {
            0
        } else {
            i * (stills.len() - 1) / (count - 1)
        }
    });
    let frame = |i: usize| {
        let (name, length) = stills[i];
        let path = member.run.folder.join("films").join(format!("{name}.exr"));
        let image = read_picture(("a frame", &path), pictures, notes)?;
        Some((length, image))
    };
    selected.filter_map(frame).collect()
}

/// Returns the exposure at which 99.5 % of the lit pixels of all frames stay below white.
fn exposure(rows: &[FrameRow]) -> Tonemap {
    let pixels = rows
        .iter()
        .flat_map(|row| &row.frames)
        .flat_map(|(_, image)| &image.data);
    let mut lit: Vec<f32> = pixels
        .map(|p| p[0].max(p[1]).max(p[2]))
        .filter(|v| *v > 0.0 && v.is_finite())
        .collect();
    if lit.is_empty() {
        return Tonemap::Srgb { exposure: 0.0 };
    }
    let index = (lit.len() * 199 / 200).min(lit.len() - 1);
    let (_, white, _) = lit.select_nth_unstable_by(index, f32::total_cmp);
    Tonemap::Srgb {
        exposure: (-white.log2() * 4.0).round() / 4.0,
    }
}

fn figure(study: &Study, facet: usize, rows: &[FrameRow]) -> Result<ReportItem, OutputError> {
    let provenance = Provenance::from_members(rows.iter().map(|row| row.member));
    let display = exposure(rows);
    let (drawing, height) = draw_rows(rows, display)?;
    let label = facet_and_series_label(study, facet, None);
    let title = titled("Light over time", &label);
    let svg = drawing.finish_scaled(FULL, height, SCREEN, &title, &provenance.text());
    let caption = format!(
        "Light by the optical length of its path. Below each frame: the optical length at the \
         centre of its time interval, in scene units. The intervals divide the time axis evenly. \
         Tone map of all frames: {display}."
    );
    Ok(ReportItem::figure(
        "Light over time",
        format!("figures/times{}", file_suffix(&label)),
        title,
        caption,
        svg,
        provenance,
    ))
}

/// Draws the rows and returns the drawing and its height.
fn draw_rows(rows: &[FrameRow], display: Tonemap) -> Result<(Drawing, f64), OutputError> {
    let columns = rows.iter().map(|row| row.frames.len()).max().unwrap_or(1) as f64;
    let width = (FULL - LEFT - GAP * (columns - 1.0)) / columns;
    let mut drawing = Drawing::default();
    let mut y = 0.0;
    for row in rows {
        let mut height = 0.0f64;
        for (i, (length, image)) in row.frames.iter().enumerate() {
            let x = LEFT + i as f64 * (width + GAP);
            height = width * f64::from(image.height) / f64::from(image.width);
            drawing.image([x, y, width, height], &png::encode(image, display, &[])?);
            drawing.text(
                (x + width / 2.0, y + height + 7.0),
                SMALL,
                Anchor::Middle,
                &format::significant(*length, 4),
            );
        }
        drawing.text(
            (0.0, y + height / 2.0),
            NAME,
            Anchor::Start,
            &shorten(&row.name, NAME.size, LEFT - 4.0),
        );
        y += height + 10.0;
    }
    Ok((drawing, y))
}
