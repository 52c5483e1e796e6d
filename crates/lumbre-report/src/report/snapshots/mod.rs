//! Selects stored pictures of runs at a given time or error, and reads their references.

use std::path::Path;

use super::Pictures;
use super::study::{Member, Study};
use crate::format::significant;
use crate::metric_display::MetricDisplay;
use lumbre_light::film::Image;
use lumbre_metrics::MetricSpec;
use lumbre_night::experiment::WaveRow;
use lumbre_night::experiment::night::run::Run;
use lumbre_night::experiment::spec::PictureMoment;

/// Stored picture of a run with its measurements.
#[derive(Debug)]
pub struct Snapshot {
    /// Index of the series in the study.
    pub series: usize,
    /// Identity of the run.
    pub run: String,
    /// Samples per pixel of the picture.
    pub samples: u64,
    /// Render time of the picture in seconds.
    pub render_s: f64,
    /// Values of the study's metrics at the picture.
    pub metrics: Vec<Option<f64>>,
    /// Pixels in linear sRGB.
    pub image: Image,
}

/// Moment at which a snapshot is selected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moment {
    /// Render time in seconds.
    Time(f64),
    /// Samples per pixel.
    Samples(u64),
    /// Metric of the study and its drawn value.
    Error(usize, f64),
    /// End of the run.
    End,
}

impl Moment {
    /// Returns a sentence for captions on the pictures that are selected at it.
    pub fn sentence(self, study: &Study) -> String {
        match self {
            Moment::Time(t) => format!(
                "Stored pictures nearest to {} s of render time.",
                significant(t, 3)
            ),
            Moment::Samples(n) => format!("Stored pictures nearest to {n} samples per pixel."),
            Moment::Error(metric, error) => {
                let spec = &study.metrics[metric];
                let error = MetricDisplay::for_metric(spec).metric_value(error);
                format!(
                    "Stored pictures nearest to {} = {}.",
                    spec.row.label,
                    significant(error, 3)
                )
            }
            Moment::End => "Final pictures.".to_owned(),
        }
    }
}

impl From<PictureMoment> for Moment {
    fn from(moment: PictureMoment) -> Moment {
        match moment {
            PictureMoment::End => Moment::End,
            PictureMoment::Time(seconds) => Moment::Time(seconds),
            PictureMoment::Samples(samples) => Moment::Samples(samples),
        }
    }
}

/// Picture of a reference.
pub struct Reference {
    /// Pixels in linear sRGB.
    pub image: Image,
    /// Integrator and samples per pixel, or the name of the file.
    pub description: String,
    /// Expected value of the study's error metric between the true picture and this one, if known.
    floor: Option<f64>,
}

/// References of a facet. Techniques may share one or have different ones.
pub struct FacetReferences {
    /// References of equal size, with the least noise first; those of unknown noise are last. At
    /// least one.
    pub all: Vec<Reference>,
    /// For each series of the study, the index of its reference, if it could be read.
    pub by_series: Vec<Option<usize>>,
}

/// Two references that differ by more than their noise explains.
#[derive(Clone, Debug, PartialEq)]
pub struct Disagreement {
    /// Index of the reference with the larger noise; the other one is the first.
    pub reference: usize,
    /// Error of one against the other.
    pub error: f64,
    /// Expected error of two pictures of the same scene with the noise of these.
    pub expected: f64,
}

impl FacetReferences {
    /// Returns the reference that a snapshot is compared with.
    pub fn for_snapshot(&self, snapshot: &Snapshot) -> &Image {
        &self.all[self.by_series[snapshot.series].unwrap_or(0)].image
    }

    /// Returns the name of a reference, with its series if there are several references.
    pub fn name(&self, study: &Study, reference: usize) -> String {
        let series = self.owner(reference).map(|s| study.series[s].full_label());
        series.map_or("reference".to_owned(), |s| format!("reference of {s}"))
    }

    /// Returns the references whose squared error against the first one is more than twice the sum
    /// of both noises.
    pub fn disagreements(&self, metric: &MetricSpec) -> Vec<Disagreement> {
        let first = &self.all[0];
        let compared = |(index, other): (usize, &Reference)| {
            let both = [first.floor?, other.floor?];
            let expected = metric.sum_of_noise(both)?;
            let error = metric.eval(&other.image, &first.image).ok()?;
            (!metric.is_at_floor(error, expected)).then_some(Disagreement {
                reference: index,
                error,
                expected,
            })
        };
        let others = self.all.iter().enumerate().skip(1);
        others.filter_map(compared).collect()
    }

    /// Sorts the references by noise.
    fn sort_by_noise(&mut self) {
        let mut order: Vec<usize> = (0..self.all.len()).collect();
        let noise = |index: &usize| self.all[*index].floor.unwrap_or(f64::INFINITY);
        order.sort_by(|a, b| noise(a).total_cmp(&noise(b)));
        let mut all: Vec<Option<Reference>> = self.all.drain(..).map(Some).collect();
        self.all = order
            .iter()
            .filter_map(|index| all[*index].take())
            .collect();
        for reference in self.by_series.iter_mut().flatten() {
            *reference = order.iter().position(|i| i == reference).unwrap_or(0);
        }
    }

    /// Returns the first series that uses a reference, or `None` if there is only one reference.
    pub fn owner(&self, reference: usize) -> Option<usize> {
        if self.all.len() > 1 {
            self.by_series.iter().position(|of| *of == Some(reference))
        } else {
            None
        }
    }
}

/// Reads the references of a facet's series, taken from the first run of each series that has one.
/// References whose size differs from the first one are left out. Returns `None` if no reference
/// can be read.
pub fn references(
    study: &Study,
    facet: usize,
    pictures: &Pictures,
    notes: &mut Vec<String>,
) -> Option<FacetReferences> {
    let mut references = FacetReferences {
        all: Vec::new(),
        by_series: vec![None; study.series.len()],
    };
    let noise_metric = study.error_metric();
    let mut paths: Vec<&Path> = Vec::new();
    for series in 0..study.series.len() {
        for member in study.members(facet, series) {
            let Some(reference) = member
                .run
                .reference
                .and_then(|r| member.night.references.get(r))
            else {
                continue;
            };
            let Some(path) = &reference.picture else {
                continue;
            };
            references.by_series[series] = paths.iter().position(|known| known == path);
            if references.by_series[series].is_none() {
                let Some(image) = read_picture(("a picture", path), pictures, notes) else {
                    continue;
                };
                let size = references
                    .all
                    .first()
                    .map(|first| [first.image.width, first.image.height]);
                if size.is_some_and(|size| size != [image.width, image.height]) {
                    notes.push(format!(
                        "{} is left out: its size differs from that of the other references",
                        path.display()
                    ));
                    continue;
                }
                references.by_series[series] = Some(references.all.len());
                let floor = noise_metric.and_then(|m| member.run.floor(&study.metrics[m].column));
                let floor = floor.map(|floor| floor.value);
                references.all.push(Reference {
                    image,
                    description: reference.origin.describe(),
                    floor,
                });
                paths.push(path);
            }
            break;
        }
    }
    references.sort_by_noise();
    (!references.all.is_empty()).then_some(references)
}

/// Greatest ratio of the render times of pictures that are compared at equal time.
pub const EQUAL_TIME: f64 = 1.05;

/// Greatest ratio of that time to the time of the tables, or the other way round.
const NEAR_TIME: f64 = 1.5;

/// Returns the render time nearest to `time`, within [`NEAR_TIME`] of it, at which every series of
/// a facet with a reference has a stored picture, all within [`EQUAL_TIME`] of one another; `None`
/// if there is none.
pub fn common_stored_time(
    study: &Study,
    facet: usize,
    time: f64,
    references: &FacetReferences,
) -> Option<f64> {
    let with_reference = (0..study.series.len()).filter(|s| references.by_series[*s].is_some());
    let stored: Vec<Vec<f64>> = with_reference
        .filter_map(|series| {
            let member = shown_member(study, facet, series)?;
            let stored = stored(member.run).map(|(row, _)| row.render_s);
            Some(stored.filter(|time| *time > 0.0).collect())
        })
        .collect();
    let distance = |a: f64, b: f64| (a / b).ln().abs();
    let is_common = |time: &f64| {
        let nearest = stored.iter().map(|times| {
            let nearest = times.iter().copied();
            nearest.min_by(|a, b| distance(*a, *time).total_cmp(&distance(*b, *time)))
        });
        let nearest: Option<Vec<f64>> = nearest.collect();
        nearest.is_some_and(|times| {
            let low = times.iter().copied().fold(f64::INFINITY, f64::min);
            times.iter().all(|time| time / low <= EQUAL_TIME)
        })
    };
    let is_near = |stored: &f64| distance(*stored, time) <= NEAR_TIME.ln();
    let candidates = stored.iter().flatten().copied();
    let candidates = candidates.filter(|stored| is_near(stored) && is_common(stored));
    candidates.min_by(|a, b| distance(*a, time).total_cmp(&distance(*b, time)))
}

/// Returns the run of a series that pictures show: its first finished repeat with a stored picture.
fn shown_member<'a>(study: &'a Study<'_>, facet: usize, series: usize) -> Option<Member<'a>> {
    let mut finished = study.finished(facet, series).into_iter();
    finished.find(|m| !m.run.pictures.is_empty())
}

/// Returns the measurements of a run that have a stored picture, with its file.
fn stored(run: &Run) -> impl Iterator<Item = (&WaveRow, &Path)> {
    run.pictures.iter().filter_map(|(samples, path)| {
        let row = run.rows.iter().find(|row| row.samples == *samples)?;
        Some((row, path.as_path()))
    })
}

/// Selects, for each series of a facet with a reference, the stored picture of its first finished
/// repeat that is nearest to a moment on a logarithmic scale. Pictures whose size differs from the
/// reference are left out.
pub fn nearest_snapshots(
    study: &Study,
    facet: usize,
    moment: Moment,
    references: &FacetReferences,
    pictures: &Pictures,
    notes: &mut Vec<String>,
) -> Vec<Snapshot> {
    let first = &references.all[0].image;
    let size = [first.width, first.height];
    let mut snapshots = Vec::new();
    for series in (0..study.series.len()).filter(|s| references.by_series[*s].is_some()) {
        let Some(member) = shown_member(study, facet, series) else {
            continue;
        };
        let Some((row, path)) = nearest(study, &member, moment) else {
            continue;
        };
        let Some(image) = read_picture(("a picture", path), pictures, notes) else {
            continue;
        };
        if size != [image.width, image.height] {
            notes.push(format!(
                "{} is left out: its size differs from that of its reference",
                path.display()
            ));
            continue;
        }
        snapshots.push(Snapshot {
            series,
            run: member.run.id.clone(),
            samples: row.samples,
            render_s: row.render_s,
            metrics: (0..study.metrics.len())
                .map(|metric| member.value(row, metric))
                .collect(),
            image,
        });
    }
    snapshots
}

/// Returns the measurement with a stored picture that is nearest to a moment.
pub fn nearest<'a>(
    study: &Study,
    member: &Member<'a>,
    moment: Moment,
) -> Option<(&'a WaveRow, &'a Path)> {
    let distance = |row: &WaveRow| -> Option<f64> {
        let (here, there) = match moment {
            Moment::End => return Some(-(row.samples as f64)),
            Moment::Time(t) => (row.render_s, t),
            Moment::Samples(n) => (row.samples as f64, n as f64),
            Moment::Error(metric, error) => (
                MetricDisplay::for_metric(&study.metrics[metric])
                    .drawn_value(member.value(row, metric)?)?,
                error,
            ),
        };
        Some((here / there).ln().abs()).filter(|d| d.is_finite())
    };
    let ranked = stored(member.run).filter_map(|(row, path)| Some((distance(row)?, row, path)));
    ranked
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, row, path)| (row, path))
}

/// Reads a picture. If that fails, returns `None` and notes that `name` is left out, and why.
pub fn read_picture(
    (name, path): (&str, &Path),
    pictures: &Pictures,
    notes: &mut Vec<String>,
) -> Option<Image> {
    let image = pictures(path, None);
    image
        .map_err(|reason| notes.push(format!("{name} is left out: {reason}")))
        .ok()
}

/// Returns the pixels in a window, given as left, top, width, height, or `None` if it is not inside
/// of the image.
pub fn crop(image: &Image, [x, y, w, h]: [u32; 4]) -> Option<Image> {
    let inside =
        x.checked_add(w)? <= image.width && y.checked_add(h)? <= image.height && w > 0 && h > 0;
    inside.then(|| Image::from_fn(w, h, |i, j| image.at(x + i, y + j)))
}

#[cfg(test)]
mod tests {
    use crate::report::snapshots::*;

    #[test]
    fn windows_must_be_inside_of_the_image() {
        let image = Image::from_fn(8, 6, |x, y| [x as f32, y as f32, 0.0]);
        assert_eq!(
            crop(&image, [2, 1, 3, 2]).unwrap().at(2, 1),
            [4.0, 2.0, 0.0]
        );
        assert!(
            crop(&image, [6, 0, 3, 2]).is_none() && crop(&image, [u32::MAX, 0, 2, 2]).is_none()
        );
    }
}
