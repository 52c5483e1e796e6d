//! Pictures of runs at a moment that is chosen after the fact, from the snapshots that were kept.

use std::path::Path;

use super::Pictures;
use super::study::{Member, Shown, Study};
use crate::experiment::WaveRow;
use crate::film::Image;
use crate::metrics::tonemap::Tonemap;

/// One picture of a run.
#[derive(Debug)]
pub struct Shot {
    /// Which of the study's series it is of.
    pub series: usize,
    /// The run.
    pub run: String,
    /// Samples per pixel.
    pub samples: u64,
    /// Seconds inside the renderer.
    pub render_s: f64,
    /// The study's metrics then.
    pub metrics: Vec<Option<f64>>,
    /// The picture.
    pub image: Image,
}

/// Where a shot is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moment {
    /// At this render time in seconds.
    Time(f64),
    /// At this drawn value of a metric of the study.
    Error(usize, f64),
    /// At the end.
    End,
}

/// The references of a facet. Techniques may share one, or have one each.
pub struct Truths {
    /// Pictures of one size, with words for what they are; at least one.
    pub all: Vec<(Image, String)>,
    /// For each series of the study, the place of its reference, if that can be read.
    pub of: Vec<Option<usize>>,
}

impl Truths {
    /// What a shot is measured against.
    pub fn of(&self, shot: &Shot) -> &Image {
        &self.all[self.of[shot.series].unwrap_or(0)].0
    }

    /// The first series that is measured against a reference, where there are several references.
    pub fn owner(&self, truth: usize) -> Option<usize> {
        if self.all.len() > 1 { self.of.iter().position(|of| *of == Some(truth)) } else { None }
    }
}

/// The references that a facet's series were measured against, those of their first runs; `None` if none can be read. One
/// of another size than the first is left out.
pub fn references(study: &Study, facet: usize, pictures: &Pictures, notes: &mut Vec<String>) -> Option<Truths> {
    let mut truths = Truths { all: Vec::new(), of: vec![None; study.series.len()] };
    let mut paths: Vec<&Path> = Vec::new();
    for series in 0..study.series.len() {
        for member in study.members(facet, series) {
            let Some(truth) = member.run.reference.and_then(|r| member.night.references.get(r)) else { continue };
            let Some(path) = &truth.picture else { continue };
            truths.of[series] = paths.iter().position(|known| known == path);
            if truths.of[series].is_none() {
                let Some(image) = read(path, pictures, notes) else { continue };
                let size = truths.all.first().map(|(first, _)| [first.width, first.height]);
                if size.is_some_and(|size| size != [image.width, image.height]) {
                    notes.push(format!("{} has another size than the other references", path.display()));
                    continue;
                }
                truths.of[series] = Some(truths.all.len());
                truths.all.push((image, truth.words.clone()));
                paths.push(path);
            }
            break;
        }
    }
    (!truths.all.is_empty()).then_some(truths)
}

/// For each series of a facet that has one and a reference, the kept picture of its first finished repeat that is nearest to a moment
/// on a logarithmic scale. Pictures of another size than the references are left out.
pub fn shots(
    study: &Study,
    facet: usize,
    moment: Moment,
    truths: &Truths,
    pictures: &Pictures,
    notes: &mut Vec<String>,
) -> Vec<Shot> {
    let size = [truths.all[0].0.width, truths.all[0].0.height];
    let mut found = Vec::new();
    for series in (0..study.series.len()).filter(|s| truths.of[*s].is_some()) {
        let members = study.members(facet, series);
        let Some(member) = members.iter().find(|m| m.run.done() && !m.run.pictures.is_empty()) else { continue };
        let Some((row, path)) = nearest(study, member, moment) else { continue };
        let Some(image) = read(path, pictures, notes) else { continue };
        if size != [image.width, image.height] {
            notes.push(format!("{} has another size than its reference and is not compared", path.display()));
            continue;
        }
        found.push(Shot {
            series,
            run: member.run.id.clone(),
            samples: row.samples,
            render_s: row.render_s,
            metrics: (0..study.metrics.len()).map(|metric| member.value(row, metric)).collect(),
            image,
        });
    }
    found
}

/// The measured row with a kept picture that is nearest to a moment.
fn nearest<'a>(study: &Study, member: &Member<'a>, moment: Moment) -> Option<(&'a WaveRow, &'a Path)> {
    let run = member.run;
    let kept = run.pictures.iter().filter_map(|(samples, path)| {
        let row = run.rows.iter().find(|row| row.samples == *samples)?;
        Some((row, path.as_path()))
    });
    let distance = |row: &WaveRow| -> Option<f64> {
        let (here, there) = match moment {
            Moment::End => return Some(-(row.samples as f64)),
            Moment::Time(t) => (row.render_s, t),
            Moment::Error(metric, error) => {
                (Shown::of(&study.metrics[metric]).value(member.value(row, metric)?)?, error)
            }
        };
        Some((here / there).ln().abs()).filter(|d| d.is_finite())
    };
    let ranked = kept.filter_map(|(row, path)| Some((distance(row)?, row, path)));
    ranked.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, row, path)| (row, path))
}

fn read(path: &Path, pictures: &Pictures, notes: &mut Vec<String>) -> Option<Image> {
    match pictures(path) {
        Ok(image) => Some(image),
        Err(reason) => {
            notes.push(format!("a picture is left out: {reason}"));
            None
        }
    }
}

/// The sRGB tone map under which a picture is well exposed: as many whole stops as bring the brightness that 97 of 100
/// pixels stay below next to white, or more where half of the pixels would then stay below a tenth, as in a room with
/// bright windows; at most ten either way.
pub fn exposure(image: &Image) -> Tonemap {
    let mut brightest: Vec<f32> =
        image.data.iter().map(|p| p[0].max(p[1]).max(p[2])).filter(|v| v.is_finite()).collect();
    brightest.sort_unstable_by(f32::total_cmp);
    let stops = |share: usize, place: f64| {
        let value = brightest.get(brightest.len() * share / 100).copied().unwrap_or(1.0);
        if value > 0.0 { (place / f64::from(value)).log2().floor() } else { f64::NEG_INFINITY }
    };
    let stops = stops(97, 0.9).max(stops(50, 0.1));
    let stops = if stops.is_finite() { stops.clamp(-10.0, 10.0) } else { 0.0 };
    Tonemap::Srgb { exposure: stops as f32 }
}

/// The part of an image in a window: left, top, width, height; `None` if it is not inside.
pub fn crop(image: &Image, [x, y, w, h]: [u32; 4]) -> Option<Image> {
    let inside = x.checked_add(w)? <= image.width && y.checked_add(h)? <= image.height && w > 0 && h > 0;
    inside.then(|| Image::from_fn(w, h, |i, j| image.at(x + i, y + j)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_must_be_inside() {
        let image = Image::from_fn(8, 6, |x, y| [x as f32, y as f32, 0.0]);
        assert_eq!(crop(&image, [2, 1, 3, 2]).unwrap().at(2, 1), [4.0, 2.0, 0.0]);
        assert!(crop(&image, [6, 0, 3, 2]).is_none() && crop(&image, [u32::MAX, 0, 2, 2]).is_none());
    }

    #[test]
    fn dark_pictures_are_brightened_by_whole_stops() {
        let exposed = |value: f32| exposure(&Image::from_fn(10, 10, |_, _| [value; 3]));
        assert_eq!(exposed(0.1), Tonemap::Srgb { exposure: 3.0 });
        assert_eq!(exposed(0.9), Tonemap::Srgb { exposure: 0.0 });
        assert_eq!(exposed(3.0), Tonemap::Srgb { exposure: -2.0 });
        assert_eq!(exposed(0.0), Tonemap::Srgb { exposure: 0.0 });
        // A tenth of the picture is a window 64 times as bright as the room.
        let room = Image::from_fn(10, 10, |x, _| [if x == 0 { 6.4 } else { 0.09 }; 3]);
        assert_eq!(exposure(&room), Tonemap::Srgb { exposure: 0.0 });
    }
}
