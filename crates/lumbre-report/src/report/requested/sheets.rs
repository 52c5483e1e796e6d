//! Sheets that a script requests: pictures of runs side by side, and frames of runs with a time
//! axis. They are drawn from the files of finished runs, at the end of a night and in reports.

use std::collections::BTreeSet;

use super::figures::unique_stem;
use crate::OutputError;
use crate::format::significant;
use crate::plot::grid::Grid;
use crate::provenance::Provenance;
use crate::report::item::ReportItem;
use crate::report::snapshots::{self, Moment, read_picture};
use crate::report::study::{Member, Study};
use crate::report::times::exposure;
use crate::report::{Bytes, Pictures};
use crate::time::{DensityScale, Movie};
use lumbre_light::film::Image;
use lumbre_light::film::time::CUBE_FILE;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::night::Night;
use lumbre_night::experiment::spec::{PictureMoment, SheetContent, SheetSpec};

/// Maximum width of a picture, in points.
const WIDEST: f64 = 166.0;
/// Maximum number of pictures of a row that is not given by an axis.
const WRAP: usize = 6;

/// Callbacks that read files of runs.
#[derive(Clone, Copy)]
pub struct RunFiles<'a> {
    /// Reads a picture.
    pub pictures: &'a Pictures<'a>,
    /// Reads any other file.
    pub bytes: &'a Bytes<'a>,
}

/// Draws the sheets of the nights' scripts. `captioned` is whether captions are drawn below them,
/// for files that are shown alone. `notes` receives what cannot be read.
///
/// # Errors
/// Returns an error if a picture cannot be encoded.
pub fn sheets(
    nights: &[Night],
    files: RunFiles,
    captioned: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<ReportItem>, OutputError> {
    let mut items = Vec::new();
    let mut taken = BTreeSet::new();
    for night in nights {
        for spec in &night.plan.sheets {
            let mut builder = Builder {
                night,
                spec,
                files,
                notes: &mut *notes,
            };
            let Sheet {
                mut grid,
                caption,
                provenance,
            } = builder.sheet()?;
            let caption = caption.join(" ");
            if captioned {
                grid.notes.clone_from(&caption);
            }
            let title = format!("{}: {}", night.plan.name, spec.name);
            items.push(ReportItem::figure(
                "Sheets",
                format!("sheets/{}", unique_stem(&spec.name, &[], &mut taken)),
                spec.name.clone(),
                caption,
                grid.svg(&title, &provenance.text()),
                provenance,
            ));
        }
    }
    Ok(items)
}

/// A sheet with the sentences of its caption.
struct Sheet {
    grid: Grid,
    caption: Vec<String>,
    provenance: Provenance,
}

/// A sheet under construction.
struct Builder<'a, 'b> {
    night: &'a Night,
    spec: &'a SheetSpec,
    files: RunFiles<'a>,
    notes: &'b mut Vec<String>,
}

impl Builder<'_, '_> {
    fn sheet(&mut self) -> Result<Sheet, OutputError> {
        match &self.spec.content {
            SheetContent::Pictures { cols, at } => self.pictures(cols, *at),
            SheetContent::Frames {
                at,
                density,
                complete,
            } => self.frames(at, density.as_deref(), *complete),
        }
    }

    /// Returns the tone map of complete pictures: that of the report, or else of measurements.
    fn display(&self) -> Tonemap {
        let plan = &self.night.plan;
        plan.report.display.unwrap_or(plan.display)
    }

    /// Draws a picture of each combination of rows and columns.
    fn pictures(&mut self, cols: &[String], at: PictureMoment) -> Result<Sheet, OutputError> {
        let study = Study::of_night(self.night, cols, &self.spec.rows);
        let display = self.spec.display.unwrap_or_else(|| self.display());
        let (count, wraps) = (study.series.len(), self.spec.rows.is_empty());
        let columns = if wraps {
            count.div_ceil(count.div_ceil(WRAP).max(1)).max(1)
        } else {
            count
        };
        let rows = (0..study.facets.len()).filter(|_| !wraps);
        let rows = rows.map(|facet| study.facet_label(facet));
        let mut grid = Grid::new(columns, rows.collect(), WIDEST);
        let names = study.series.iter().filter(|_| !cols.is_empty());
        let mut names: Vec<String> = names
            .map(|series| series.label_within(Grid::LABEL_SIZE, grid.width()))
            .collect();
        if !wraps {
            grid.heads = std::mem::take(&mut names);
        }
        let moment = Moment::from(at);
        let (mut shown, mut sizes, mut before) = (Vec::new(), BTreeSet::new(), 0);
        for facet in 0..study.facets.len() {
            for series in 0..count {
                let cell = if wraps {
                    [series % columns, series / columns]
                } else {
                    [series, facet]
                };
                let members = study.members(facet, series);
                let Some(first) = members.first() else {
                    continue;
                };
                let Some(member) = first_done(&members) else {
                    grid.gap(cell, first.run.state.name().to_owned());
                    continue;
                };
                let read = snapshots::nearest(&study, &member, moment).and_then(|(row, path)| {
                    let image = read_picture(("a picture", path), self.files.pictures, self.notes)?;
                    Some((row, image))
                });
                let Some((row, image)) = read else {
                    grid.gap(cell, "no picture".to_owned());
                    continue;
                };
                before += usize::from(match at {
                    PictureMoment::End => false,
                    PictureMoment::Time(seconds) => {
                        row.render_s < seconds && is_last(&member, row.samples)
                    }
                    PictureMoment::Samples(samples) => {
                        row.samples < samples && is_last(&member, row.samples)
                    }
                });
                sizes.insert([image.width, image.height]);
                let label = names.get(series).cloned().unwrap_or_default();
                grid.picture(cell, &image, display, label)?;
                shown.push((member, row.samples));
            }
        }
        let mut caption = vec![moment.sentence(&study)];
        let samples = shown.iter().map(|(_, samples)| *samples);
        if let Some((least, most)) = samples.clone().min().zip(samples.max()) {
            let range = if least == most {
                String::new()
            } else {
                format!("{least} to ")
            };
            caption.push(format!("{range}{most} samples per pixel."));
        }
        match before {
            0 => {}
            1 => caption.push("1 run ended before; its last picture is shown.".to_owned()),
            n => caption.push(format!(
                "{n} runs ended before; their last pictures are shown."
            )),
        }
        if sizes.len() > 1 {
            caption.push("Pictures of different sizes are drawn at one width.".to_owned());
        }
        let shown: Vec<Member> = shown.into_iter().map(|(member, _)| member).collect();
        caption.extend(self.axes(&study, &self.spec.rows, cols, &shown));
        caption.push(format!("Tone map: {display}."));
        caption.extend(study.bias_sentences());
        Ok(Sheet {
            grid,
            caption,
            provenance: Provenance::from_members(shown),
        })
    }

    /// Draws a row of frames of each combination of rows.
    fn frames(
        &mut self,
        at: &[f64],
        density: Option<&str>,
        complete: bool,
    ) -> Result<Sheet, OutputError> {
        let plan = &self.night.plan;
        let varying = plan.axes.iter().zip(&plan.varying);
        let varying = varying.filter(|(_, varies)| **varies);
        let rows: Vec<String> = match self.spec.rows.as_slice() {
            [] => varying.map(|(axis, _)| axis.clone()).collect(),
            rows => rows.to_vec(),
        };
        let study = Study::of_night(self.night, &[], &rows);
        let labels: Vec<String> = (0..study.facets.len())
            .map(|f| study.facet_label(f))
            .collect();
        let heads = density.map(|_| "density".to_owned()).into_iter();
        let heads = heads.chain(complete.then(|| "without time".to_owned()));
        let before = heads.clone().count();
        let heads = heads
            .chain(at.iter().map(|at| format!("t = {at}")))
            .collect();
        let mut grid = Grid::new(before + at.len(), labels, WIDEST);
        grid.heads = heads;
        let mut shown = Vec::new();
        let mut frames: Vec<([usize; 2], Image)> = Vec::new();
        for facet in 0..study.facets.len() {
            let members = study.members(facet, 0);
            let Some(member) = first_done(&members) else {
                let state = members.first().map_or("", |member| member.run.state.name());
                (0..before + at.len()).for_each(|c| grid.gap([c, facet], state.to_owned()));
                continue;
            };
            shown.push((facet, member));
            let found = self.read_frames(&member, at, &grid);
            for (i, frame) in found.into_iter().enumerate() {
                let cell = [before + i, facet];
                match frame {
                    Ok(frame) => frames.push((cell, frame)),
                    Err(reason) => grid.gap(cell, reason),
                }
            }
            if complete {
                let cell = [before - 1, facet];
                let nearest = snapshots::nearest(&study, &member, Moment::End);
                let image = nearest.and_then(|(_, path)| {
                    read_picture(("a picture", path), self.files.pictures, self.notes)
                });
                match image {
                    Some(image) => grid.picture(cell, &image, self.display(), String::new())?,
                    None => grid.gap(cell, "no picture".to_owned()),
                }
            }
        }
        let images = frames.iter().map(|(_, frame)| frame);
        let display = self.spec.display.unwrap_or_else(|| exposure(images));
        for (cell, frame) in &frames {
            grid.picture(*cell, frame, display, String::new())?;
        }
        let mut caption = vec![
            "t: optical length of the paths in scene units; each frame is the time bin that \
             contains it."
                .to_owned(),
        ];
        let seconds = shown
            .iter()
            .find_map(|(_, m)| m.run.timing.as_ref()?.seconds());
        caption.extend(seconds.map(|s| {
            let nanoseconds = significant(s * 1e9, 4);
            format!("1 scene unit is {nanoseconds} ns.")
        }));
        if let Some(material) = density {
            let mixture = |member: &Member<'_>| member.run.delays.get(material).cloned();
            let known = shown.iter().filter_map(|(f, m)| Some((*f, mixture(m)?)));
            let known: Vec<_> = known.collect();
            let scale = DensityScale::new(known.iter().map(|(_, mixture)| mixture.as_slice()));
            for (facet, mixture) in &known {
                grid.plot([0, *facet], scale.plot(mixture));
            }
            caption.push(format!(
                "Left: density of the delay of {material} over the delay in scene units; an arrow \
                 is a constant delay."
            ));
            if scale.greatest > 0.0 {
                let greatest = significant(scale.greatest, 3);
                caption.push(format!("Greatest density: {greatest} per scene unit."));
            }
        }
        let shown: Vec<Member> = shown.into_iter().map(|(_, member)| member).collect();
        caption.extend(self.axes(&study, &rows, &[], &shown));
        caption.push(format!("Tone map of the frames: {display}."));
        if complete {
            caption.push(format!(
                "Tone map of the pictures without time: {}.",
                self.display()
            ));
        }
        caption.extend(study.bias_sentences());
        Ok(Sheet {
            grid,
            caption,
            provenance: Provenance::from_members(shown),
        })
    }

    /// Reads the frames of a run at the moments, reduced as the grid draws them, or returns for each
    /// why there is none.
    fn read_frames(
        &mut self,
        member: &Member,
        at: &[f64],
        grid: &Grid,
    ) -> Vec<Result<Image, String>> {
        let all = |reason: &str| vec![Err(reason.to_owned()); at.len()];
        let Some(timing) = &member.run.timing else {
            return all("no time axis");
        };
        let path = member.run.folder.join("films").join(CUBE_FILE);
        let bytes = (self.files.bytes)(&path);
        let movie = bytes.and_then(|bytes| {
            Movie::from_array(&bytes, timing).map_err(|e| format!("{}: {e}", path.display()))
        });
        match movie {
            Ok(movie) => {
                let frame = |at: &f64| {
                    let bin = movie.bin(*at).ok_or("outside of the axis")?;
                    Ok(grid.fitted(&movie.frame(bin..bin + 1)))
                };
                at.iter().map(frame).collect()
            }
            Err(reason) => {
                self.notes.push(format!("frames are left out: {reason}"));
                all("no frame")
            }
        }
    }

    /// Returns sentences on the axes of rows and columns, and on what the sheet shows of the other
    /// axes and of repeats.
    fn axes(
        &self,
        study: &Study,
        rows: &[String],
        cols: &[String],
        shown: &[Member],
    ) -> Vec<String> {
        let mut sentences = Vec::new();
        for (role, axes) in [("Rows", rows), ("Columns", cols)] {
            if !axes.is_empty() {
                sentences.push(format!("{role}: {}.", axes.join(", ")));
            }
        }
        let used = [rows, cols].concat();
        for axis in study.axes() {
            let all = study.values(&axis);
            let is_determined = crate::dependent_axes::is_determined(
                study
                    .all()
                    .map(|m| (m.run.axis_values(&used), m.run.axis_value(&axis))),
            );
            if all.len() < 2 || used.contains(&axis) || is_determined {
                continue;
            }
            let values: BTreeSet<_> = shown.iter().map(|m| m.run.axis_value(&axis)).collect();
            sentences.push(match (values.len(), values.first()) {
                (1, Some(Some(value))) => {
                    let count = all.len();
                    format!(
                        "{axis} = {}, the first of {count} values.",
                        study.name(value)
                    )
                }
                _ => format!("Of {axis}, the first value of each picture."),
            });
        }
        if self.night.plan.is_repeated {
            sentences.push("Of the repeats, the first.".to_owned());
        }
        sentences
    }
}

/// Returns the first finished repeat of the first point of some runs.
fn first_done<'a>(members: &[Member<'a>]) -> Option<Member<'a>> {
    let point = &members.first()?.run.point;
    let mut repeats = members.iter().filter(|m| m.run.point == *point);
    repeats.find(|m| m.run.is_done()).copied()
}

/// Returns whether the picture with these samples is the last of its run.
fn is_last(member: &Member, samples: u64) -> bool {
    member
        .run
        .pictures
        .last()
        .is_some_and(|(last, _)| *last == samples)
}
