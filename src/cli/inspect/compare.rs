//! `lumbre metric` and `lumbre diff`: comparison of two picture files of any origin.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value as Json, json};

use super::picture_limits::{Limit, LimitResult, junit, not_finite};
use crate::cli::args::{DiffArgs, Global, MetricArgs, split, value};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{self, display_path};
use crate::cli::json;
use lumbre_light::film::Image;
use lumbre_light::value::Value;
use lumbre_metrics::map::ErrorMap;
use lumbre_metrics::{METRICS, MetricError, MetricSpec};
use lumbre_night::paths::extension;
use lumbre_night::store::{Evidence, NOISE};
use lumbre_report::picture::{self, Picture};
use lumbre_report::{exr, png};

/// Runs `lumbre metric`: prints the error of a picture against a reference for one or more metrics.
pub fn metric(args: &MetricArgs, global: &Global) -> Result<Exit, Failure> {
    let requested: Vec<MetricSpec> = args
        .metric
        .iter()
        .map(|text| parse_metric(text))
        .collect::<Result<_, _>>()?;
    let pair = PicturePair::load(&args.image, &args.reference, global)?;
    let all = || {
        METRICS
            .iter()
            .filter_map(|row| MetricSpec::new(row.name, row.name, BTreeMap::new()).ok())
            .collect()
    };
    let mut measured = Vec::new();
    for spec in if requested.is_empty() {
        all()
    } else {
        requested
    } {
        match pair.eval(&spec) {
            Ok(value) => measured.push((spec, value)),
            // If no metric was requested by name, those that do not apply are omitted.
            Err(e @ MetricError::TooSmall { .. }) if args.metric.is_empty() => {
                pair.print_note(&format!("omitted: {e}"))
            }
            Err(e) => return Err(Failure::usage(e)),
        }
    }
    if args.json {
        let metrics: Vec<Json> = measured
            .iter()
            .map(|(spec, value)| pair.metric_json(spec, *value))
            .collect();
        let mut json = pair.json();
        json.insert("metrics".to_owned(), metrics.into());
        json::print(Json::Object(json))?;
        return Ok(Exit::Done);
    }
    let line = |(spec, value): &(MetricSpec, f64)| {
        vec![
            spec.row.name.to_owned(),
            number(*value),
            spec.unit(),
            format!("{} is better", spec.row.better),
            pair.describe_options(spec),
        ]
    };
    print_result(&format::aligned(
        &measured.iter().map(line).collect::<Vec<_>>(),
    ))?;
    Ok(Exit::Done)
}

/// Runs `lumbre diff`: prints where and by how much two pictures differ, and writes the error map.
pub fn diff(args: &DiffArgs, global: &Global) -> Result<Exit, Failure> {
    let spec = parse_metric(&args.metric)?;
    let format = args.map_file().map(MapFormat::from_path).transpose()?;
    let limits: Vec<Limit> = args
        .fail
        .iter()
        .map(|text| Limit::parse(text, parse_metric))
        .collect::<Result<_, _>>()?;
    let pair = PicturePair::load(&args.a, &args.b, global)?;
    let limits = pair.check(&limits, &args.stderr)?;
    let map = spec
        .error_map(&pair.image.image, &pair.reference.image)
        .map_err(Failure::usage)?;
    let value = pair.eval(&spec).map_err(Failure::usage)?;
    let difference = Difference {
        identical: pair.is_identical(),
        differing: map.values.iter().filter(|v| **v != 0.0).count(),
        scale: map.scale(args.max),
        pair,
        spec,
        value,
        map,
        limits,
    };
    if let Some(path) = &args.junit {
        let files = difference
            .pair
            .files
            .each_ref()
            .map(|file| display_path(file));
        let xml = junit(files.each_ref().map(String::as_str), &difference.limits);
        lumbre_night::store::write_atomically(path, xml.as_bytes()).map_err(Failure::usage)?;
    }
    if let (Some(path), Some(format)) = (args.map_file(), format) {
        difference.write_map(path, format)?;
    }
    print_result(&if args.json {
        difference.json(args.map_file())
    } else {
        difference.page(args.map_file())
    })?;
    let all_hold = difference.limits.iter().all(|result| result.holds);
    Ok(if all_hold {
        Exit::Done
    } else {
        Exit::NotVerified
    })
}

/// Result of the comparison of two pictures with one metric.
struct Difference {
    pair: PicturePair,
    spec: MetricSpec,
    /// Error of the whole picture.
    value: f64,
    /// Error of every pixel.
    map: ErrorMap,
    /// Errors at the lower and upper end of the colours.
    scale: [f32; 2],
    /// Whether all values of the two pictures have the same bits.
    identical: bool,
    /// Number of pixels with an error other than 0.
    differing: usize,
    /// Results of the limits that were given.
    limits: Vec<LimitResult>,
}

impl Difference {
    /// Writes the error map with its parameters as metadata.
    fn write_map(&self, path: &Path, format: MapFormat) -> Result<(), Failure> {
        let [low, high] = self.scale.map(|x| x.to_string());
        let [image, reference] = self.pair.files.each_ref().map(|file| display_path(file));
        let metadata = [
            ("metric", self.spec.row.name.to_owned()),
            ("options", self.pair.describe_options(&self.spec)),
            ("value", self.value.to_string()),
            ("image", image),
            ("reference", reference),
            ("scale", format!("{low} to {high}")),
            ("program", lumbre_night::text::program().to_owned()),
        ];
        let metadata = metadata.map(|(key, value)| (key.to_owned(), value));
        let bytes = format.encode(&self.map, self.scale, &metadata)?;
        lumbre_night::store::write_atomically(path, &bytes).map_err(Failure::usage)
    }

    /// Formats the result as JSON. `file` is the file of the error map.
    fn json(&self, file: Option<&Path>) -> String {
        let map = &self.map;
        let percentiles = percentiles(map).into_iter().map(|(p, v)| (p, float(v)));
        let mut json = self.pair.json();
        json.insert("identical".to_owned(), self.identical.into());
        json.insert(
            "measured".to_owned(),
            self.pair.metric_json(&self.spec, self.value),
        );
        json.insert(
            "map".to_owned(),
            json!({
                "file": file.map(display_path),
                "colours": map.colours.name(),
                "scale": self.scale.map(float),
                "differing_pixels": self.differing,
                "pixels": map.values.len(),
                "worst": map.worst().map(|(x, y, value)| json!({ "x": x, "y": y,
                    "value": float(value) })),
                "percentiles": Json::Object(percentiles.collect()),
            }),
        );
        if !self.limits.is_empty() {
            let limits: Vec<Json> = self.limits.iter().map(LimitResult::json).collect();
            json.insert("limits".to_owned(), limits.into());
        }
        format!("{:#}\n", json::versioned(Json::Object(json)))
    }

    /// Formats the result as text. `file` is the file of the error map.
    fn page(&self, file: Option<&Path>) -> String {
        let (spec, map) = (&self.spec, &self.map);
        let line = |name: &str, value: String, detail: String| vec![name.to_owned(), value, detail];
        let value = [number(self.value), spec.unit()].join(" ");
        let pixels = if self.identical {
            "the pictures are identical".to_owned()
        } else {
            format!("{} of {} differ", self.differing, map.values.len())
        };
        let mut lines = vec![
            line(
                spec.row.name,
                value.trim_end().to_owned(),
                self.pair.describe_options(spec),
            ),
            line("pixels", pixels, String::new()),
        ];
        if let Some((x, y, value)) = map.worst().filter(|(_, _, value)| *value != 0.0) {
            let worst = format!("{} at {x},{y}", number(f64::from(value)));
            lines.push(line("worst", worst, String::new()));
            let percentiles = percentiles(map)
                .into_iter()
                .map(|(p, v)| format!("{p} {}", number(f64::from(v))));
            let percentiles = percentiles.collect::<Vec<_>>().join(", ");
            lines.push(line("percentiles", percentiles, String::new()));
        }
        if let Some(path) = file {
            let [low, high] = self.scale.map(|x| number(f64::from(x)));
            let colours = format!("{} from {low} to {high}", map.colours.name());
            lines.push(line("map", display_path(path), colours));
        }
        for result in &self.limits {
            let verdict = if result.holds { "holds" } else { "fails" };
            let limit = format!("{} {verdict}", result.limit);
            lines.push(line("limit", limit, result.found.clone()));
        }
        format::aligned(&lines)
    }
}

/// Two pictures of the same size.
struct PicturePair {
    files: [PathBuf; 2],
    image: Picture,
    reference: Picture,
    quiet: bool,
}

impl PicturePair {
    /// Reads two pictures and prints notes and warnings about them.
    ///
    /// # Errors
    /// Returns an error if a file cannot be read, or the pictures differ in size.
    fn load(image: &Path, reference: &Path, global: &Global) -> Result<PicturePair, Failure> {
        let evidence = Evidence::default();
        let read = |path: &Path| {
            read_picture(path, &evidence).map_err(|e| {
                if evidence.problems().is_empty() {
                    Failure::usage(e)
                } else {
                    Failure::damaged(e)
                }
            })
        };
        let pair = PicturePair {
            files: [image.to_owned(), reference.to_owned()],
            image: read(image)?,
            reference: read(reference)?,
            quiet: global.quiet,
        };
        let size = |p: &Picture| [p.image.width, p.image.height];
        let (a, b) = (size(&pair.image), size(&pair.reference));
        if a != b {
            return Err(Failure::usage(format!(
                "the pictures differ in size: {} has {}x{} pixels but {} has {}x{}",
                display_path(image),
                a[0],
                a[1],
                display_path(reference),
                b[0],
                b[1]
            )));
        }
        for (path, picture) in pair.both() {
            picture
                .notes
                .iter()
                .for_each(|note| pair.print_note(&format!("{}: {note}", display_path(path))));
            if let Some(found) = not_finite(&picture.image) {
                // Printed even with `--quiet`, since it makes the measured values doubtful.
                print_status(&format!("warning: {}: {found}", display_path(path)));
            }
        }
        Ok(pair)
    }

    /// Checks limits of the difference. `errors` are pictures of the standard errors of the first
    /// and of the second picture.
    ///
    /// # Errors
    /// Returns an error if such a picture cannot be read or has another size, and if the noise is
    /// needed and no picture has any.
    fn check(&self, limits: &[Limit], errors: &[PathBuf]) -> Result<Vec<LimitResult>, Failure> {
        let images = [&self.image.image, &self.reference.image];
        let mut variances = [None, None];
        if limits.iter().any(Limit::needs_noise) {
            for (i, variance) in variances.iter_mut().enumerate() {
                *variance = variance_of(&self.files[i], errors.get(i), images[i])?;
            }
            if variances.iter().all(Option::is_none) {
                return Err(Failure::usage(
                    "`--fail ztest` and `detects` compare pictures with their noise: give a picture of standard \
                     errors by `--stderr`",
                ));
            }
            let exact = variances.iter().zip(&self.files);
            for (_, file) in exact.filter(|(variance, _)| variance.is_none()) {
                let file = display_path(file);
                self.print_note(&format!(
                    "{file} counts as exact: no picture of its standard errors is given"
                ));
            }
        }
        let results = limits.iter().map(|limit| limit.check(images, &variances));
        results.collect()
    }

    /// Returns whether all values of the two pictures have the same bits.
    fn is_identical(&self) -> bool {
        fn bits(image: &Image) -> impl Iterator<Item = u32> {
            image.data.as_flattened().iter().map(|x| x.to_bits())
        }
        bits(&self.image.image).eq(bits(&self.reference.image))
    }

    fn both(&self) -> [(&Path, &Picture); 2] {
        [
            (&self.files[0], &self.image),
            (&self.files[1], &self.reference),
        ]
    }

    /// Prints a note unless `--quiet` was given.
    fn print_note(&self, note: &str) {
        if !self.quiet {
            print_status(&format!("note: {note}"));
        }
    }

    fn eval(&self, spec: &MetricSpec) -> Result<f64, MetricError> {
        spec.eval(&self.image.image, &self.reference.image)
    }

    /// Describes the options of a metric, including the values chosen for `auto` options.
    fn describe_options(&self, spec: &MetricSpec) -> String {
        let settled = spec.settled(&self.reference.image);
        let settled: Vec<String> = settled
            .iter()
            .map(|(key, value)| format!("{key} {value}"))
            .collect();
        if settled.is_empty() {
            spec.describe_options()
        } else {
            format!("{} ({})", spec.describe_options(), settled.join(", "))
        }
    }

    fn json(&self) -> Map<String, Json> {
        let [image, reference] = self.both().map(|(path, picture)| {
            let Image { width, height, .. } = picture.image;
            json!({ "file": display_path(path), "format": picture.format, "width": width,
                "height": height, "notes": picture.notes })
        });
        Map::from_iter([
            ("image".to_owned(), image),
            ("reference".to_owned(), reference),
        ])
    }

    fn metric_json(&self, spec: &MetricSpec, value: f64) -> Json {
        json!({
            "metric": spec.row.name,
            "label": spec.row.label,
            "value": Value::Num(value),
            "unit": spec.unit(),
            "better": spec.row.better.to_string(),
            "options": spec.all_options(),
            "settled": spec.settled(&self.reference.image),
        })
    }
}

/// Returns the variance of every pixel of a picture: the squares of the given standard errors, or of
/// those that Lumbre stores beside a reference.
fn variance_of(
    picture: &Path,
    errors: Option<&PathBuf>,
    image: &Image,
) -> Result<Option<Image>, Failure> {
    let beside = picture.with_file_name(NOISE);
    let is_reference = picture.file_stem().is_some_and(|stem| stem == "ref");
    let file = match errors {
        Some(file) => file,
        None if is_reference && beside.is_file() => &beside,
        None => return Ok(None),
    };
    let read = read_picture(file, &Evidence::default()).map_err(Failure::usage)?;
    let mut variance = read.image;
    if [variance.width, variance.height] != [image.width, image.height] {
        return Err(Failure::usage(format!(
            "{}: it has {}x{} pixels, but the picture has {}x{}",
            file.display(),
            variance.width,
            variance.height,
            image.width,
            image.height
        )));
    }
    let errors = variance.data.as_flattened_mut();
    errors.iter_mut().for_each(|x| *x *= *x);
    Ok(Some(variance))
}

/// Reads and decodes a picture file of any known format. A file of a finished run has to match its
/// checksum.
fn read_picture(path: &Path, evidence: &Evidence) -> Result<Picture, String> {
    let bytes = evidence.read(path)?;
    picture::decode(&bytes).map_err(|e| format!("{}: {e}", path.display()))
}

/// Parses a metric: `NAME` or `NAME:key=value,key=value`. `on=srgb` is short for
/// `on={"kind":"srgb"}`.
fn parse_metric(text: &str) -> Result<MetricSpec, Failure> {
    let (name, rest) = text.split_once(':').unwrap_or((text, ""));
    let mut options = BTreeMap::new();
    for part in split(rest)
        .into_iter()
        .filter(|part| !part.trim().is_empty())
    {
        let fail = |problem: String| Failure::usage(format!("--metric {text}: {problem}"));
        let (key, value_text) = part
            .split_once('=')
            .ok_or_else(|| fail(format!("expected key=value such as ppd=60, found `{part}`")))?;
        let mut option = value(value_text).map_err(fail)?;
        if key.trim() == "on" && option.as_str().is_some() {
            option = Value::Map(BTreeMap::from([("kind".to_owned(), option)]));
        }
        if options.insert(key.trim().to_owned(), option).is_some() {
            return Err(fail(format!("`{}` is given twice", key.trim())));
        }
    }
    MetricSpec::new(name.trim(), name.trim(), options).map_err(Failure::usage)
}

/// File format of an error map.
#[derive(Clone, Copy)]
enum MapFormat {
    /// Colours by error.
    Png,
    /// Errors as values.
    Exr,
}

impl MapFormat {
    /// Returns the format for the extension of a path.
    fn from_path(path: &Path) -> Result<MapFormat, Failure> {
        match extension(path).as_str() {
            "png" => Ok(MapFormat::Png),
            "exr" => Ok(MapFormat::Exr),
            _ => Err(Failure::usage(format!(
                "{}: unknown format for an error map; use .png (colours) or .exr (values)",
                path.display()
            ))),
        }
    }

    fn encode(
        self,
        map: &ErrorMap,
        scale: [f32; 2],
        meta: &[(String, String)],
    ) -> Result<Vec<u8>, Failure> {
        let encoded = match self {
            MapFormat::Png => png::encode_map(map, scale, meta),
            MapFormat::Exr => {
                let data = map.values.iter().map(|v| [*v; 3]).collect();
                exr::encode(&Image::from_pixels(map.width, map.height, data), meta)
            }
        };
        encoded.map_err(Failure::internal)
    }
}

/// Returns the 50th, 95th and 99th percentile of the magnitudes of the errors by nearest rank,
/// without NaNs.
fn percentiles(map: &ErrorMap) -> Vec<(String, f32)> {
    let mut sizes: Vec<f32> = map
        .values
        .iter()
        .map(|v| v.abs())
        .filter(|v| !v.is_nan())
        .collect();
    sizes.sort_unstable_by(f32::total_cmp);
    let rank = |p: usize| {
        sizes
            .get((sizes.len() * p).div_ceil(100).max(1) - 1)
            .copied()
    };
    [50, 95, 99]
        .iter()
        .filter_map(|p| Some((format!("{p}%"), rank(*p)?)))
        .collect()
}

/// Formats a number with six significant digits, about the precision of an `f32`.
fn number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() || (1e-3..1e6).contains(&x.abs()) {
        let digits = if x == 0.0 || !x.is_finite() {
            0
        } else {
            (5 - x.abs().log10().floor() as i32).max(0) as usize
        };
        let text = format!("{x:.digits$}");
        return if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        };
    }
    format!("{x:.5e}")
}

/// Converts a number to JSON; values that are not finite become strings.
fn float(x: f32) -> Json {
    json!(Value::Num(f64::from(x)))
}

#[cfg(test)]
mod tests {
    use crate::cli::inspect::compare::*;
    use lumbre_metrics::map::Colours;

    #[test]
    fn metrics_are_typed_with_their_options() {
        let options = |text: &str| parse_metric(text).unwrap().describe_options();
        assert_eq!(
            options("ssim"),
            "range 1, window uniform, on srgb (exposure 0)"
        );
        assert_eq!(options("ssim:range=50"), "range 50, window uniform");
        assert_eq!(
            options("ssim:window=gauss,on=srgb"),
            "range 1, window gauss, on srgb (exposure 0)"
        );
        assert_eq!(
            options("flip: ppd=30 ,on={\"kind\":\"srgb\",\"exposure\":-1}"),
            "ppd 30, on srgb (exposure -1)"
        );
        let wrong = |text: &str| parse_metric(text).unwrap_err().message;
        assert!(wrong("filp").contains("did you mean `flip`?"));
        assert!(wrong("flip:pdp=3").contains("did you mean `ppd`?"));
        assert!(wrong("flip:ppd").contains("key=value"));
        assert!(wrong("flip:ppd=1,ppd=2").contains("twice"));
        assert!(wrong("hdr_flip:start=soon").contains("auto"));
    }

    #[test]
    fn percentiles_are_errors_of_the_map_by_nearest_rank() {
        let of = |values: &[f32]| {
            let map = ErrorMap {
                width: values.len() as u32,
                height: 1,
                values: values.to_vec(),
                colours: Colours::Magma,
                top: None,
            };
            percentiles(&map)
                .into_iter()
                .map(|(_, value)| value)
                .collect::<Vec<_>>()
        };
        let hundred: Vec<f32> = (1..=100).rev().map(|i| i as f32).collect();
        assert_eq!(of(&hundred), [50.0, 95.0, 99.0]);
        assert_eq!(of(&[3.0, f32::NAN, -4.0, 1.0, 2.0]), [2.0, 4.0, 4.0]);
        assert_eq!(of(&[7.0]), [7.0; 3]);
        assert!(of(&[f32::NAN]).is_empty());
    }

    #[test]
    fn numbers_have_six_digits() {
        for (x, expected) in [
            (0.0, "0"),
            (0.123_456_789, "0.123457"),
            (48.0, "48"),
            (0.000_012_345_678, "1.23457e-5"),
            (-1_234.567_89, "-1234.57"),
            (f64::INFINITY, "inf"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(number(x), expected);
        }
    }
}
