//! `lumbre metric` and `lumbre diff`: two picture files from anywhere, measured against one another.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value as Json, json};

use super::args::{DiffArgs, Global, MetricArgs, split, value};
use super::exit::{Exit, Failure, data, talk};
use super::load::shown;
use super::run::counted;
use super::text;
use crate::film::Image;
use crate::metrics::map::ErrorMap;
use crate::metrics::{METRICS, MetricError, MetricSpec};
use crate::output::picture::{self, Picture};
use crate::output::{exr, png};
use crate::value::Value;

/// Largest picture file that is read, in bytes.
const MAX_FILE_BYTES: u64 = 1 << 32;

/// `lumbre metric`: prints what metrics say about an image and its reference.
pub fn metric(args: &MetricArgs, global: &Global) -> Result<Exit, Failure> {
    let asked: Vec<MetricSpec> = args.metric.iter().map(|text| spec(text)).collect::<Result<_, _>>()?;
    let pair = Pair::load(&args.image, &args.reference, global)?;
    let all = || METRICS.iter().filter_map(|row| MetricSpec::new(row.name, row.name, BTreeMap::new()).ok()).collect();
    let mut measured = Vec::new();
    for spec in if asked.is_empty() { all() } else { asked } {
        match pair.eval(&spec) {
            Ok(value) => measured.push((spec, value)),
            // Nobody asked for this one by name: the others are still worth having.
            Err(e @ MetricError::TooSmall { .. }) if args.metric.is_empty() => pair.say(&format!("left out: {e}")),
            Err(e) => return Err(Failure::usage(e)),
        }
    }
    if args.json {
        let metrics: Vec<Json> = measured.iter().map(|(spec, value)| pair.metric_json(spec, *value)).collect();
        let mut json = pair.json();
        json.insert("metrics".to_owned(), metrics.into());
        data(&format!("{:#}\n", Json::Object(json)))?;
        return Ok(Exit::Done);
    }
    let line = |(spec, value): &(MetricSpec, f64)| {
        vec![
            spec.row.name.to_owned(),
            number(*value),
            spec.unit(),
            format!("{} is better", spec.row.better),
            pair.words(spec),
        ]
    };
    data(&text::aligned(&measured.iter().map(line).collect::<Vec<_>>()))?;
    Ok(Exit::Done)
}

/// `lumbre diff`: says where and by how much two pictures differ, and draws the map.
pub fn diff(args: &DiffArgs, global: &Global) -> Result<Exit, Failure> {
    let spec = spec(&args.metric)?;
    let out = args.map_file().map(OutFormat::of).transpose()?;
    let pair = Pair::load(&args.a, &args.b, global)?;
    let map = spec.error_map(&pair.image.image, &pair.reference.image).map_err(Failure::usage)?;
    let found = pair.eval(&spec).map_err(Failure::usage)?;
    let scale = map.scale(args.max);
    let bits = |image: &Image| image.data.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let identical = bits(&pair.image.image) == bits(&pair.reference.image);
    let (pixels, differing) = (map.values.len(), map.values.iter().filter(|v| **v != 0.0).count());
    if let (Some(path), Some(format)) = (args.map_file(), out) {
        let [low, high] = scale.map(|x| x.to_string());
        let words =
            [("metric", spec.row.name.to_owned()), ("options", pair.words(&spec)), ("value", found.to_string())];
        let more = [("image", shown(&args.a)), ("reference", shown(&args.b)), ("scale", format!("{low} to {high}"))];
        let version = [("program", format!("lumbre {}", env!("CARGO_PKG_VERSION")))];
        let meta = words.into_iter().chain(more).chain(version).map(|(k, v)| (k.to_owned(), v));
        let bytes = format.encode(&map, scale, &meta.collect::<Vec<_>>())?;
        crate::store::atomic(path, &bytes).map_err(Failure::usage)?;
    }
    let worst = map.worst();
    if args.json {
        let mut json = pair.json();
        json.insert("identical".to_owned(), identical.into());
        json.insert("measured".to_owned(), pair.metric_json(&spec, found));
        json.insert(
            "map".to_owned(),
            json!({
                "file": args.map_file().map(shown),
                "colours": map.colours.name(),
                "scale": scale.map(float),
                "differing_pixels": differing,
                "pixels": pixels,
                "worst": worst.map(|(x, y, value)| json!({ "x": x, "y": y, "value": float(value) })),
                "percentiles": Json::Object(percentiles(&map).into_iter().map(|(p, v)| (p, float(v))).collect()),
            }),
        );
        data(&format!("{:#}\n", Json::Object(json)))?;
        return Ok(Exit::Done);
    }
    let mut lines = vec![
        vec![spec.row.name.to_owned(), [number(found), spec.unit()].join(" ").trim_end().to_owned(), pair.words(&spec)],
        vec!["pixels".to_owned(), format!("{differing} of {pixels} differ"), String::new()],
    ];
    if identical {
        lines[1][1] = "the pictures are identical".to_owned();
    }
    if let Some((x, y, value)) = worst.filter(|(_, _, value)| *value != 0.0) {
        lines.push(vec!["worst".to_owned(), format!("{} at {x},{y}", number(f64::from(value))), String::new()]);
        let shares = percentiles(&map).into_iter().map(|(p, v)| format!("{p} {}", number(f64::from(v))));
        lines.push(vec!["percentiles".to_owned(), shares.collect::<Vec<_>>().join(", "), String::new()]);
    }
    if let Some(path) = args.map_file() {
        let [low, high] = scale.map(|x| number(f64::from(x)));
        lines.push(vec!["map".to_owned(), shown(path), format!("{} from {low} to {high}", map.colours.name())]);
    }
    data(&text::aligned(&lines))?;
    Ok(Exit::Done)
}

/// Two pictures of one size.
struct Pair {
    files: [PathBuf; 2],
    image: Picture,
    reference: Picture,
    quiet: bool,
}

impl Pair {
    fn load(image: &Path, reference: &Path, global: &Global) -> Result<Pair, Failure> {
        let read = |path: &Path| read(path).map_err(|e| Failure::usage(format!("{}: {e}", path.display())));
        let pair = Pair {
            files: [image.to_owned(), reference.to_owned()],
            image: read(image)?,
            reference: read(reference)?,
            quiet: global.quiet,
        };
        let size = |p: &Picture| [p.image.width, p.image.height];
        let (a, b) = (size(&pair.image), size(&pair.reference));
        if a != b {
            return Err(Failure::usage(format!(
                "the pictures differ in size: {} is {}x{} but {} is {}x{} pixels",
                shown(image),
                a[0],
                a[1],
                shown(reference),
                b[0],
                b[1]
            )));
        }
        for (path, picture) in pair.both() {
            picture.notes.iter().for_each(|note| pair.say(&format!("{}: {note}", shown(path))));
            let broken = |p: &[f32; 3]| p.iter().any(|x| !x.is_finite());
            if let Some(at) = picture.image.data.iter().position(broken) {
                let n = picture.image.data.iter().filter(|p| broken(p)).count();
                let (x, y) = (at % a[0] as usize, at / a[0] as usize);
                // This decides what the numbers mean, so it is said even to those who want no talk.
                talk(&format!("warning: {}: {} not finite, the first at {x},{y}", shown(path), counted(n, "pixel")));
            }
        }
        Ok(pair)
    }

    fn both(&self) -> [(&Path, &Picture); 2] {
        [(&self.files[0], &self.image), (&self.files[1], &self.reference)]
    }

    fn say(&self, note: &str) {
        if !self.quiet {
            talk(&format!("note: {note}"));
        }
    }

    fn eval(&self, spec: &MetricSpec) -> Result<f64, MetricError> {
        spec.eval(&self.image.image, &self.reference.image)
    }

    /// The options in words, `auto` ones with what they were settled to.
    fn words(&self, spec: &MetricSpec) -> String {
        let settled = spec.settled(&self.reference.image);
        let settled: Vec<String> = settled.iter().map(|(key, value)| format!("{key} {value}")).collect();
        match settled.is_empty() {
            true => spec.describe_options(),
            false => format!("{} ({})", spec.describe_options(), settled.join(", ")),
        }
    }

    fn json(&self) -> Map<String, Json> {
        let [image, reference] = self.both().map(|(path, picture)| {
            let Image { width, height, .. } = picture.image;
            json!({ "file": shown(path), "format": picture.format, "width": width, "height": height, "notes": picture.notes })
        });
        Map::from_iter([("image".to_owned(), image), ("reference".to_owned(), reference)])
    }

    fn metric_json(&self, spec: &MetricSpec, value: f64) -> Json {
        let identity = spec.identity().to_json();
        json!({
            "metric": spec.row.name,
            "label": spec.row.label,
            "value": Value::Num(value).to_json(),
            "unit": spec.unit(),
            "better": spec.row.better.to_string(),
            "options": identity["options"],
            "settled": Value::Map(spec.settled(&self.reference.image)).to_json(),
        })
    }
}

fn read(path: &Path) -> Result<Picture, String> {
    let file = File::open(path).map_err(|e| e.to_string())?;
    if !file.metadata().map_err(|e| e.to_string())?.is_file() {
        return Err("it is not a regular file".to_owned());
    }
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    picture::decode(&bytes).map_err(|e| e.to_string())
}

/// Reads `NAME` or `NAME:key=value,key=value`; `on=srgb` is short for `on={"kind":"srgb"}`.
fn spec(text: &str) -> Result<MetricSpec, Failure> {
    let (name, rest) = text.split_once(':').unwrap_or((text, ""));
    let mut options = BTreeMap::new();
    for part in split(rest).into_iter().filter(|part| !part.trim().is_empty()) {
        let fail = |problem: String| Failure::usage(format!("--metric {text}: {problem}"));
        let (key, typed) =
            part.split_once('=').ok_or_else(|| fail(format!("expected key=value such as ppd=60, found `{part}`")))?;
        let mut given = value(typed).map_err(fail)?;
        if key.trim() == "on" && given.as_str().is_some() {
            given = Value::Map(BTreeMap::from([("kind".to_owned(), given)]));
        }
        if options.insert(key.trim().to_owned(), given).is_some() {
            return Err(fail(format!("`{}` is said twice", key.trim())));
        }
    }
    MetricSpec::new(name.trim(), name.trim(), options).map_err(Failure::usage)
}

/// What a map is written as.
#[derive(Clone, Copy)]
enum OutFormat {
    Png,
    Exr,
}

impl OutFormat {
    fn of(path: &Path) -> Result<OutFormat, Failure> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("png") => Ok(OutFormat::Png),
            Some("exr") => Ok(OutFormat::Exr),
            _ => Err(Failure::usage(format!(
                "{}: a map is written as .png (in colours) or .exr (the values themselves)",
                path.display()
            ))),
        }
    }

    fn encode(self, map: &ErrorMap, scale: [f32; 2], meta: &[(String, String)]) -> Result<Vec<u8>, Failure> {
        let encoded = match self {
            OutFormat::Png => png::encode_map(map, scale, meta),
            OutFormat::Exr => {
                let data = map.values.iter().map(|v| [*v; 3]).collect();
                exr::encode(&Image { width: map.width, height: map.height, data }, meta)
            }
        };
        encoded.map_err(Failure::internal)
    }
}

/// The median and two upper percentiles of the magnitudes that are numbers, by nearest rank.
fn percentiles(map: &ErrorMap) -> Vec<(String, f32)> {
    let mut sizes: Vec<f32> = map.values.iter().map(|v| v.abs()).filter(|v| !v.is_nan()).collect();
    sizes.sort_unstable_by(f32::total_cmp);
    let rank = |p: usize| sizes.get((sizes.len() * p).div_ceil(100).max(1) - 1).copied();
    [50, 95, 99].iter().filter_map(|p| Some((format!("{p}%"), rank(*p)?))).collect()
}

/// Six digits, which is what single precision can mean.
fn number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() || (1e-3..1e6).contains(&x.abs()) {
        let digits = if x == 0.0 || !x.is_finite() { 0 } else { (5 - x.abs().log10().floor() as i32).max(0) as usize };
        let text = format!("{x:.digits$}");
        return if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text };
    }
    format!("{x:.5e}")
}

fn float(x: f32) -> Json {
    Value::Num(f64::from(x)).to_json()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_are_typed_with_their_options() {
        let words = |text: &str| spec(text).unwrap().describe_options();
        assert_eq!(words("ssim"), "range 1, window uniform");
        assert_eq!(words("ssim:window=gauss,on=srgb"), "range 1, window gauss, on srgb (exposure 0)");
        assert_eq!(words("flip: ppd=30 ,on={\"kind\":\"srgb\",\"exposure\":-1}"), "ppd 30, on srgb (exposure -1)");
        let wrong = |text: &str| spec(text).unwrap_err().report.to_string();
        assert!(wrong("filp").contains("did you mean `flip`?"));
        assert!(wrong("flip:pdp=3").contains("did you mean `ppd`?"));
        assert!(wrong("flip:ppd").contains("key=value"));
        assert!(wrong("flip:ppd=1,ppd=2").contains("twice"));
        assert!(wrong("hdr_flip:start=soon").contains("auto"));
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
