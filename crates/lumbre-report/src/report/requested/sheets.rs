//! Sheets that a script requests: pictures of runs side by side, and frames of runs with a time
//! axis. They are drawn from the files of finished runs, at the end of a night and in reports.

use std::collections::BTreeSet;

use super::SECTION;
use super::figures::unique_stem;
use crate::OutputError;
use crate::dependent_axes::is_determined;
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
use lumbre_night::experiment::WaveRow;
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
    let all = nights.iter().flat_map(|night| {
        let sheets = night.plan.sheets.iter();
        sheets.map(move |spec| (night, spec))
    });
    for (night, spec) in all {
        let study = grouped(night, spec);
        let mut sheet = Sheet {
            study: &study,
            display: night.plan.report.display.unwrap_or(night.plan.display),
            files,
            notes: &mut *notes,
            caption: Vec::new(),
            shown: Vec::new(),
        };
        let mut grid = sheet.grid(spec)?;
        let caption = sheet.caption();
        let provenance = Provenance::from_members(sheet.shown);
        if captioned {
            grid.notes.clone_from(&caption);
        }
        let title = format!("{}: {}", night.plan.name, spec.name);
        items.push(ReportItem::figure(
            SECTION,
            format!("sheets/{}", unique_stem(&spec.name, &[], &mut taken)),
            spec.name.clone(),
            caption,
            grid.svg(&title, &provenance.text()),
            provenance,
        ));
    }
    Ok(items)
}

/// Groups the runs of a night by the columns and the rows of a sheet.
fn grouped<'a>(night: &'a Night, spec: &SheetSpec) -> Study<'a> {
    match &spec.content {
        SheetContent::Pictures { cols, .. } => Study::of_night(night, cols, &spec.rows),
        SheetContent::Frames { .. } if spec.rows.is_empty() => {
            let axes = night.plan.axes.iter().zip(&night.plan.varying);
            let varying = axes.filter(|(_, varies)| **varies);
            let rows: Vec<String> = varying.map(|(axis, _)| axis.clone()).collect();
            Study::of_night(night, &[], &rows)
        }
        SheetContent::Frames { .. } => Study::of_night(night, &[], &spec.rows),
    }
}

/// Image of a cell, or why it has none.
type Found = Result<Image, &'static str>;

/// A sheet under construction.
struct Sheet<'a, 'b> {
    study: &'a Study<'a>,
    /// Tone map of complete pictures: that of the report, or else of measurements.
    display: Tonemap,
    files: RunFiles<'b>,
    notes: &'b mut Vec<String>,
    /// Sentences of the caption.
    caption: Vec<String>,
    /// Runs that are shown.
    shown: Vec<Member<'a>>,
}

impl<'a> Sheet<'a, '_> {
    fn grid(&mut self, spec: &SheetSpec) -> Result<Grid, OutputError> {
        let facets = 0..self.study.facets.len();
        let label = |facet| self.study.facet_label(facet).replace(", ", "\n");
        let rows = facets.map(label).collect();
        match &spec.content {
            SheetContent::Pictures { at, .. } => {
                self.display = spec.display.unwrap_or(self.display);
                self.pictures(rows, *at)
            }
            SheetContent::Frames {
                at,
                density,
                complete,
            } => self.frames(rows, at, (density.as_deref(), *complete), spec.display),
        }
    }

    /// Draws a picture for each combination of rows and columns.
    fn pictures(&mut self, rows: Vec<String>, at: PictureMoment) -> Result<Grid, OutputError> {
        let study = self.study;
        let (count, wraps) = (study.series.len(), study.facet_axes.is_empty());
        let columns = if wraps {
            count.div_ceil(count.div_ceil(WRAP).max(1)).max(1)
        } else {
            count
        };
        let mut grid = Grid::new(columns, if wraps { Vec::new() } else { rows }, WIDEST);
        let names = study.series.iter().filter(|_| !study.by.is_empty());
        let names: Vec<String> = names
            .map(|series| series.label_within(Grid::LABEL_SIZE, grid.width()))
            .collect();
        let mut sizes = BTreeSet::new();
        let mut samples = Vec::new();
        let mut before = 0;
        for (facet, series) in
            (0..study.facets.len()).flat_map(|facet| (0..count).map(move |series| (facet, series)))
        {
            let members = study.members(facet, series);
            if members.is_empty() {
                continue;
            }
            let found = first_done(&members).and_then(|member| {
                let (row, image) = self.picture(&member, at.into())?;
                self.shown.push(member);
                samples.push(row.samples);
                sizes.insert([image.width, image.height]);
                before += usize::from(member.run.rows.last().is_some_and(|row| at.is_after(row)));
                Ok(image)
            });
            let (cell, label) = if wraps {
                let label = names.get(series).cloned();
                (
                    [series % columns, series / columns],
                    label.unwrap_or_default(),
                )
            } else {
                ([series, facet], String::new())
            };
            grid.found(cell, &found, self.display, label)?;
        }
        if !wraps {
            grid.heads = names;
        }
        self.caption.push(Moment::from(at).sentence(study));
        if let Some((least, most)) = samples.iter().min().zip(samples.iter().max()) {
            let range = if least == most {
                most.to_string()
            } else {
                format!("{least} to {most}")
            };
            self.caption.push(format!("{range} samples per pixel."));
        }
        if before > 0 {
            self.caption.push(format!(
                "Runs that ended before, with their last picture: {before}."
            ));
        }
        if sizes.len() > 1 {
            self.caption
                .push("Pictures of different sizes are drawn at one width.".to_owned());
        }
        self.caption.push(format!("Tone map: {}.", self.display));
        Ok(grid)
    }

    /// Draws a row of frames for each combination of rows, after a column with the density of a
    /// material's delay and one with the complete picture, if they are requested. The tone map of
    /// frames has one exposure unless `display` is given.
    fn frames(
        &mut self,
        rows: Vec<String>,
        at: &[f64],
        (density, complete): (Option<&str>, bool),
        display: Option<Tonemap>,
    ) -> Result<Grid, OutputError> {
        let study = self.study;
        let mut heads: Vec<String> = density.map(|_| "density".to_owned()).into_iter().collect();
        heads.extend(complete.then(|| "without time".to_owned()));
        let first = heads.len();
        heads.extend(at.iter().map(|at| format!("t = {at}")));
        let mut grid = Grid::new(heads.len(), rows, WIDEST);
        grid.heads = heads;
        let mut frames: Vec<([usize; 2], Found)> = Vec::new();
        let mut mixtures = Vec::new();
        let mut seconds = None;
        for facet in 0..study.facets.len() {
            let members = study.members(facet, 0);
            let planned = members.first().map(|member| &member.run.planned);
            let mixture = density.and_then(|material| planned?.delays.get(material));
            mixtures.extend(mixture.map(|mixture| (facet, mixture.as_slice())));
            seconds = seconds.or_else(|| planned?.timing.as_ref()?.seconds());
            let member = first_done(&members);
            self.shown.extend(member);
            if complete {
                let found = member.and_then(|member| Ok(self.picture(&member, Moment::End)?.1));
                grid.found([first - 1, facet], &found, self.display, String::new())?;
            }
            let movie = member.and_then(|member| self.movie(&member));
            frames.extend(at.iter().enumerate().map(|(i, at)| {
                let frame = movie.as_ref().map_err(|reason| *reason).and_then(|movie| {
                    let bin = movie.bin(*at).ok_or("outside of the axis")?;
                    Ok(grid.fitted(&movie.frame(bin..bin + 1)))
                });
                ([first + i, facet], frame)
            }));
        }
        let images = frames.iter().filter_map(|(_, frame)| frame.as_ref().ok());
        let display = display.unwrap_or_else(|| exposure(images));
        for (cell, frame) in &frames {
            grid.found(*cell, frame, display, String::new())?;
        }
        self.caption.push(
            "t: optical length in scene units; a frame is the time bin that contains it."
                .to_owned(),
        );
        let unit = |s: f64| format!("1 scene unit is {} ns.", significant(s * 1e9, 4));
        self.caption.extend(seconds.map(unit));
        if let Some(material) = density {
            let scale = DensityScale::new(mixtures.iter().map(|(_, mixture)| *mixture));
            for (facet, mixture) in &mixtures {
                grid.plot([0, *facet], scale.plot(mixture));
            }
            let greatest = match scale.greatest {
                0.0 => String::new(),
                greatest => format!(", up to {} per scene unit", significant(greatest, 3)),
            };
            self.caption.push(format!(
                "Density: of the delay of {material} over the delay in scene units{greatest}; \
                 arrows are constant delays."
            ));
        }
        self.caption.push(format!("Tone map of frames: {display}."));
        if complete {
            self.caption
                .push(format!("Without time: {}.", self.display));
        }
        Ok(grid)
    }

    /// Reads the stored picture of a run that is nearest to a moment.
    fn picture<'m>(
        &mut self,
        member: &Member<'m>,
        moment: Moment,
    ) -> Result<(&'m WaveRow, Image), &'static str> {
        let nearest = snapshots::nearest(self.study, member, moment);
        let (row, path) = nearest.ok_or("no picture")?;
        let image = read_picture(("a picture", path), self.files.pictures, self.notes);
        Ok((row, image.ok_or("no picture")?))
    }

    /// Reads the time bins of a run.
    fn movie(&mut self, member: &Member) -> Result<Movie, &'static str> {
        let timing = member.run.timing.as_ref().ok_or("no time axis")?;
        let path = member.run.folder.join("films").join(CUBE_FILE);
        let movie = (self.files.bytes)(&path).and_then(|bytes| {
            Movie::from_array(&bytes, timing).map_err(|e| format!("{}: {e}", path.display()))
        });
        movie.map_err(|reason| {
            self.notes.push(format!("frames are left out: {reason}"));
            "no frames"
        })
    }

    /// Returns the caption with sentences on the axes of rows and columns, and on what is shown of
    /// other axes and of repeats.
    fn caption(&self) -> String {
        let study = self.study;
        let mut sentences = self.caption.clone();
        for (role, axes) in [("Rows", &study.facet_axes), ("Columns", &study.by)] {
            if !axes.is_empty() {
                sentences.push(format!("{role}: {}.", axes.join(", ")));
            }
        }
        let used = [study.facet_axes.as_slice(), &study.by].concat();
        for axis in study.axes() {
            let pairs = study.all();
            let pairs = pairs.map(|m| (m.run.axis_values(&used), m.run.axis_value(&axis)));
            if is_determined(pairs) {
                continue;
            }
            let values: BTreeSet<_> = self.shown.iter().map(|m| m.run.axis_value(&axis)).collect();
            sentences.push(match (values.len(), values.first()) {
                (1, Some(Some(value))) => {
                    let count = study.values(&axis).len();
                    format!(
                        "{axis} = {}, the first of {count} values.",
                        study.name(value)
                    )
                }
                _ => format!("Of {axis}, the first value of each picture."),
            });
        }
        if study.nights[0].plan.is_repeated {
            sentences.push("Of the repeats, the first.".to_owned());
        }
        sentences.extend(study.bias_sentences());
        sentences.join(" ")
    }
}

/// Returns the first finished repeat of the first point of some runs, or the state of its first run.
fn first_done<'a>(members: &[Member<'a>]) -> Result<Member<'a>, &'static str> {
    let first = members.first().ok_or("no run")?;
    let mut repeats = members.iter().filter(|m| m.run.point == first.run.point);
    let done = repeats.find(|m| m.run.is_done()).copied();
    done.ok_or(first.run.state.name())
}
