//! Figures of films with a time axis: frames of every series at the same optical lengths, one row
//! for each series.

use super::Pictures;
use super::films::{facet_and_series_label, file_suffix, titled};
use super::item::ReportItem;
use super::snapshots::read_picture;
use super::study::{Member, Study};
use crate::OutputError;
use crate::format;
use crate::plot::grid::Grid;
use crate::plot::sizes::FULL;
use crate::provenance::Provenance;
use crate::time::still_length;
use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;

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
pub(super) fn exposure<'a>(frames: impl Iterator<Item = &'a Image>) -> Tonemap {
    let pixels = frames.flat_map(|image| &image.data);
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
    let frames = rows.iter().flat_map(|row| &row.frames);
    let display = exposure(frames.map(|(_, image)| image));
    let columns = rows.iter().map(|row| row.frames.len()).max().unwrap_or(1);
    let names = rows.iter().map(|row| row.name.clone()).collect();
    let mut grid = Grid::new(columns, names, FULL);
    for (row, FrameRow { frames, .. }) in rows.iter().enumerate() {
        for (column, (length, image)) in frames.iter().enumerate() {
            let label = format::significant(*length, 4);
            grid.picture([column, row], image, display, label)?;
        }
    }
    let label = facet_and_series_label(study, facet, None);
    let title = titled("Light over time", &label);
    let svg = grid.svg(&title, &provenance.text());
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
